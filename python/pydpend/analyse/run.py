"""The stages of a run in order, each done once.

A stage that does not apply, or that these data do not allow, says why and leaves the rest alone; only inputs that
cannot be read at all end the run.
"""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

from pydpend.analyse import provenance, stages
from pydpend.analyse.folder import UNFINISHED, Digests, RunFolder, digest, write_whole
from pydpend.analyse.options import Options, check_files
from pydpend.analyse.recordings import Recording, check_options, recordings
from pydpend.errors import OptionError, PydpendError, Setting, fault
from pydpend.output import keeping

Progress = Callable[[int, int, str, str], None]
"""Called as ``progress(stage number from 1, stages, title, what)``, ``what`` being ``start``, how far it is
(``40 %``), ``kept``, ``done``, ``not done: why`` or ``does not apply: why``."""


LEFT_OUT = ("not done", "does not apply")
"""How what is said of a stage that gave nothing begins."""


@dataclass(frozen=True)
class Stage:
    """One step. ``key`` is what it is made from; of the stages it ``needs`` one at least must have worked.

    ``action`` writes into the folder it is given, calls what it is given besides with how far it is, and returns a
    sentence. Its files belong into ``into``, relative to the run folder. With ``in_place``, their names, it writes
    there at once, because an interrupted one is gone on with; it is told whether it can be.
    """

    name: str
    title: str
    key: str
    needs: tuple[str, ...]
    into: str
    action: Callable[[Path, stages.Tell, bool], str]
    in_place: tuple[str, ...] = ()


@dataclass(frozen=True)
class Outcome:
    """What a run came to. ``status``: ``done``, or ``partly`` where a stage could not be done or the fit did not
    converge."""

    folder: Path
    status: str
    message: str
    stages: dict[str, str]
    """For each stage ``done``, ``kept``, ``not done: why`` or ``does not apply: why``."""
    seconds: dict[str, float]
    """How long each stage took when it was done, the report included."""

    def to_json(self) -> dict[str, Any]:
        """As plain values."""
        return {
            "folder": str(self.folder),
            "status": self.status,
            "message": self.message,
            "stages": self.stages,
            "seconds": self.seconds,
            "report": str(self.folder / "report.html"),
        }


def plan(options: Options, folder: Path, digests: Digests | None = None) -> list[Stage]:
    """The stages that these options ask for, in order. Reads the inputs' bytes to know them again, no more."""
    check_files(options)
    known = Digests() if digests is None else digests
    found = recordings(options, known)
    check_options(options, found)
    out: list[Stage] = []

    def add(
        name: str,
        title: str,
        needs: tuple[str, ...],
        into: str,
        parts: Any,
        action: Callable[[Path, stages.Tell, bool], str],
        in_place: tuple[str, ...] = (),
    ) -> None:
        before = {s.name: s.key for s in out if s.name in needs}
        key = digest([name, stages.version(), parts, before])
        out.append(Stage(name, title, key, needs, into, action, in_place))

    for r in found:
        _plan_recording(r, options, folder / r.name, known, add)
    ready = tuple(f"{r.name}/angles" for r in found)
    several = len(found) > 1
    if options.prediction and not several and options.method == "energy":
        raise OptionError(
            fault(
                Setting("prediction"),
                "the energy fit of one recording leaves no part out to be predicted",
                "Leave it out, or give " + Setting("method", "trajectory") + " or another recording",
            )
        )
    model = known.option(options.model)
    add(
        "fit",
        "Damping fit",
        ready,
        "fit",
        [model, options.joint_fit(several).key()],
        lambda into, tell, resume: stages.fit(found, options, folder, into, tell),
    )
    if several and options.prediction is not False:
        add(
            "prediction",
            "Prediction of each recording from the others",
            ready,
            "",
            [model, options.bare().key()],
            lambda into, tell, resume: stages.prediction(found, options, folder, into, tell),
        )
    for r in found:
        _plan_page(r, options, folder / r.name, add)
    return out


def _plan_page(r: Recording, options: Options, here: Path, add: Callable[..., None]) -> None:
    """What only the page needs, and no number waits for."""
    needs = (f"{r.name}/track",) if r.kind == "film" else ()
    if r.kind != "angles":
        add(
            f"{r.name}/markers",
            f"Markers of {r.label} against their rigid bodies",
            needs,
            r.name,
            [r.digest],
            lambda into, tell, resume: stages.markers(r, here, into),
        )
    if r.kind == "film" and options.overlay:
        add(
            f"{r.name}/overlay",
            f"Drawing into {r.label}",
            needs,
            r.name,
            [r.digest],
            lambda into, tell, resume: stages.overlay(r, here, into, tell),
        )


def _plan_recording(
    r: Recording, options: Options, here: Path, known: Digests, add: Callable[..., None]
) -> None:
    needs: tuple[str, ...] = ()
    if r.kind == "film":
        add(
            f"{r.name}/track",
            f"Tracking {r.label}",
            (),
            r.name,
            [r.digest, known.option(options.rig), options.fps, options.pixel_aspect],
            lambda into, tell, resume: stages.track(r, options, into, tell, resume),
            ("nodes.parquet",),
        )
        needs = (f"{r.name}/track",)
    add(
        f"{r.name}/angles",
        f"Angles of {r.label}",
        needs,
        r.name,
        [
            r.digest,
            options.columns,
            options.hanging_deg,
            options.clockwise,
            options.unwrap,
            options.bodies,
            options.mirrored,
            options.estimator,
            options.zero,
            known.option(options.zero),
            options.link_length_m,
        ],
        lambda into, tell, resume: stages.angles(r, options, here, into),
    )
    if r.encoder is not None:
        add(
            f"{r.name}/encoder",
            f"Encoder beside {r.label}",
            (f"{r.name}/angles",),
            r.name,
            [
                known.option(options.encoder),
                known.option(options.calibration),
                options.column,
                options.time_column,
                options.rate_hz,
                options.unit,
            ],
            lambda into, tell, resume: stages.encoder(r, options, here, into),
        )


def analyse(options: Options, folder: str | Path, progress: Progress | None = None) -> Outcome:
    """Does every stage that is not done yet, and writes the report.

    Raises :class:`~pydpend.errors.PydpendError` if an input cannot be read or the folder cannot be written. An
    interrupted run (`KeyboardInterrupt` passes through) keeps what it finished; the same call goes on from there.
    """
    path = Path(folder)
    run = RunFolder.open(path) if (path / "run.json").exists() else None
    digests = Digests() if run is None else run.digests()
    todo = plan(options, path, digests)
    if run is None:
        run = RunFolder.open(path)
    run.forget({s.name for s in todo})
    run.facts = {
        "version": stages.version(),
        "versions": provenance.versions(),
        "options": asdict(options),
        "recordings": [r.facts() for r in recordings(options, digests)],
        "inputs": provenance.inputs(options, digests),
        "command": provenance.command(options, path),
        "titles": {s.name: s.title for s in todo},
        "digests": digests.known,
    }
    with keeping(str(i["path"]) for i in run.facts["inputs"]):
        return _analyse(run, todo, options, progress)


def _analyse(run: RunFolder, todo: list[Stage], options: Options, progress: Progress | None) -> Outcome:
    path = run.path
    run.save()
    said: dict[str, str] = {}
    of = len(todo) + 1
    tell = progress or (lambda number, of, title, what: None)
    for number, stage in enumerate(todo, 1):
        failed = [n for n in stage.needs if said[n].startswith(LEFT_OUT)]
        if failed and len(failed) == len(stage.needs):
            how = "does not apply" if all(said[n].startswith(LEFT_OUT[1]) for n in failed) else "not done"
            said[stage.name] = f"{how}: it needs {' and '.join(run.facts['titles'][n] for n in failed)}"
            run.stages.pop(stage.name, None)
        elif run.holds(stage.name, stage.key):
            said[stage.name] = "kept"
        else:
            tell(number, of, stage.title, "start")
            said[stage.name] = _do(run, stage, partial(tell, number, of, stage.title))
        tell(number, of, stage.title, said[stage.name])
    for key, how in zip(("not_done", "does_not_apply"), LEFT_OUT, strict=True):
        run.facts[key] = {n: s.removeprefix(f"{how}: ") for n, s in said.items() if s.startswith(how)}
    run.save()
    tell(of, of, "Report", "start")
    begun = time.monotonic()
    stages.report(path)
    write_whole(path / "README.txt", provenance.readme(run))
    seconds = {name: float(done["seconds"]) for name, done in run.stages.items()}
    seconds["report"] = round(time.monotonic() - begun, 2)
    tell(of, of, "Report", "done")
    missing = sum(s.startswith("not done") for s in said.values())
    problems = [f"{missing} of {len(said)} stages could not be done"] if missing else []
    if "fit" in run.stages and not stages.converged(path):
        problems.append("the damping fit did not converge")
    status = "partly" if problems else "done"
    return Outcome(path, status, "; ".join(problems) or "every stage is done", said, seconds)


def _do(run: RunFolder, stage: Stage, tell: stages.Tell) -> str:
    """Does one stage and records it. A film that cannot be tracked ends the run."""
    target = run.path / stage.into
    work = target if stage.in_place else run.path / UNFINISHED
    shutil.rmtree(run.path / UNFINISHED, ignore_errors=True)
    work.mkdir(parents=True, exist_ok=True)
    resume = run.begin(stage.name, stage.key) if stage.in_place else False
    begun = time.monotonic()
    try:
        message = stage.action(work, tell, resume)
    except stages.DoesNotApply as reason:
        run.stages.pop(stage.name, None)
        return f"does not apply: {reason}"
    except PydpendError as error:
        run.stages.pop(stage.name, None)
        if stage.name.endswith("/track"):
            run.save()
            raise
        return f"not done: {error}"
    if stage.in_place:
        files = [(target / name).relative_to(run.path).as_posix() for name in stage.in_place]
    else:
        files = run.take(stage.name, work, target)
        shutil.rmtree(work, ignore_errors=True)
    run.done(stage.name, stage.key, files, message, time.monotonic() - begun)
    return "done"
