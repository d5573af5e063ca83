"""The stages of a run in order, each done once.

A stage that does not apply, or that these data do not allow, says why and leaves the rest alone; only inputs that
cannot be read at all end the run.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from pydpend.analyse import stages
from pydpend.analyse.folder import RunFolder, digest, write_whole
from pydpend.analyse.options import Options
from pydpend.analyse.recordings import Recording, recordings
from pydpend.errors import PydpendError

Progress = Callable[[int, int, str, str], None]
"""Called as ``progress(stage number from 1, stages, title, "start" | "kept" | "done" | "not done: why")``."""


@dataclass(frozen=True)
class Stage:
    """One step. ``key`` is what it was made from; ``needs`` are stages that must have worked."""

    name: str
    title: str
    key: str
    files: tuple[str, ...]
    needs: tuple[str, ...]
    action: Callable[[], str]


@dataclass(frozen=True)
class Outcome:
    """What a run came to. ``status``: ``done``, or ``partly`` where a stage could not be done."""

    folder: Path
    status: str
    message: str
    stages: dict[str, str]
    """For each stage ``done``, ``kept`` or ``not done: why``."""

    def to_json(self) -> dict[str, Any]:
        """As plain values."""
        return {
            "folder": str(self.folder),
            "status": self.status,
            "message": self.message,
            "stages": self.stages,
            "report": str(self.folder / "report.html"),
        }


def plan(options: Options, folder: Path) -> list[Stage]:
    """The stages that these options ask for, in order. Reads the inputs' bytes to know them again, no more."""
    found = recordings(options)
    out: list[Stage] = []
    version = stages.version()

    def add(
        name: str,
        title: str,
        files: tuple[str, ...],
        needs: tuple[str, ...],
        parts: Any,
        action: Callable[[], str],
    ) -> None:
        before = {s.name: s.key for s in out if s.name in needs}
        out.append(Stage(name, title, digest([name, version, parts, before]), files, needs, action))

    for r in found:
        _plan_recording(r, options, folder, add)
    ready = tuple(f"{r.name}/angles" for r in found)
    add(
        "fit",
        "Damping fit",
        ("fit/fit.json",),
        ready,
        [
            options.model,
            stages.file_key(options.model),
            options.method,
            options.laws,
            options.start_s,
            options.stop_s,
            options.angle_maps,
        ],
        lambda: stages.fit(found, options, folder),
    )
    if len(found) > 1:
        add(
            "prediction",
            "Prediction of each recording from the others",
            ("prediction.json",),
            ready,
            [
                options.model,
                stages.file_key(options.model),
                options.laws,
                options.start_s,
                options.stop_s,
                options.angle_maps,
            ],
            lambda: stages.prediction(found, options, folder),
        )
    return out


def _plan_recording(r: Recording, options: Options, folder: Path, add: Callable[..., None]) -> None:
    here = folder / r.name
    needs: tuple[str, ...] = ()
    if r.kind == "film":
        add(
            f"{r.name}/track",
            f"Tracking {r.label}",
            (f"{r.name}/nodes.parquet",),
            (),
            [r.digest, stages.file_key(options.rig), options.fps],
            lambda: stages.track(r, options, here),
        )
        needs = (f"{r.name}/track",)
    add(
        f"{r.name}/angles",
        f"Angles of {r.label}",
        (f"{r.name}/angles.parquet", f"{r.name}/angles.json"),
        needs,
        [
            r.digest,
            options.columns,
            options.hanging_deg,
            options.estimator,
            options.zero,
            stages.file_key(options.zero),
            options.link_length_m,
        ],
        lambda: stages.angles(r, options, here),
    )
    if r.encoder is not None:
        add(
            f"{r.name}/encoder",
            f"Encoder beside {r.label}",
            (f"{r.name}/comparison.json", f"{r.name}/comparison.parquet"),
            (f"{r.name}/angles",),
            [stages.file_key(options.encoder), stages.file_key(options.calibration), options.encoder_column],
            lambda: stages.encoder(r, options, here),
        )


def analyse(options: Options, folder: str | Path, progress: Progress | None = None) -> Outcome:
    """Does every stage that is not done yet, and writes the report.

    Raises :class:`~pydpend.errors.PydpendError` if an input cannot be read or the folder cannot be written. An
    interrupted run (`KeyboardInterrupt` passes through) keeps what it finished; the same call goes on from there.
    """
    path = Path(folder)
    todo = plan(options, path)
    run = RunFolder.open(path)
    run.forget({s.name for s in todo})
    run.facts = {
        "version": stages.version(),
        "options": asdict(options),
        "recordings": [r.facts() for r in recordings(options)],
        "command": stages.command(options, path),
    }
    run.save()
    said: dict[str, str] = {}
    tell = progress or (lambda number, of, title, what: None)
    for number, stage in enumerate(todo, 1):
        failed = [n for n in stage.needs if said.get(n, "").startswith("not done")]
        if failed and len(failed) == len(stage.needs):
            said[stage.name] = f"not done: it needs {' and '.join(failed)}"
            run.stages.pop(stage.name, None)
            tell(number, len(todo) + 1, stage.title, said[stage.name])
            continue
        if run.holds(stage.name, stage.key):
            said[stage.name] = "kept"
            tell(number, len(todo) + 1, stage.title, "kept")
            continue
        tell(number, len(todo) + 1, stage.title, "start")
        run.stages.pop(stage.name, None)
        try:
            message = stage.action()
        except PydpendError as error:
            said[stage.name] = f"not done: {error}"
            if stage.name.endswith("/track"):
                raise
        else:
            run.done(stage.name, stage.key, list(stage.files), message)
            said[stage.name] = "done"
        tell(number, len(todo) + 1, stage.title, said[stage.name])
    run.facts["not_done"] = {
        n: s.removeprefix("not done: ") for n, s in said.items() if s.startswith("not done")
    }
    run.save()
    tell(len(todo) + 1, len(todo) + 1, "Report", "start")
    stages.report(path)
    write_whole(path / "README.txt", stages.readme(run))
    tell(len(todo) + 1, len(todo) + 1, "Report", "done")
    missing = [s for s in said.values() if s.startswith("not done")]
    return Outcome(
        path,
        "partly" if missing else "done",
        f"{len(missing)} of {len(said)} stages could not be done" if missing else "every stage is done",
        said,
    )
