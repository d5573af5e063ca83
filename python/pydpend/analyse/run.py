"""The stages of a run in order, each done once.

A stage that does not apply, or that these data do not allow, says why and leaves the rest alone; only inputs that
cannot be read at all end the run.
"""

from __future__ import annotations

import shutil
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

from pydpend.analyse import motion, provenance, stages
from pydpend.analyse.folder import UNFINISHED, Digests, RunFolder, RunFolderError, digest
from pydpend.analyse.options import Options, check_files
from pydpend.analyse.recordings import Recording, check_options, recordings
from pydpend.analyse.state import (
    DoesNotApply,
    Note,
    Progress,
    RunState,
    StageResult,
    StageState,
    Started,
    Tell,
)
from pydpend.documents import Table
from pydpend.errors import OptionError, PydpendError, RecordingWarning, Setting, fault
from pydpend.json_text import JsonResult
from pydpend.output import keeping, write_text
from pydpend.recording_folder import RunFile
from pydpend.run_folder import FIT_FOLDER, PAGE, README, RECORD


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
    action: Callable[[Path, Tell, bool], str]
    in_place: tuple[str, ...] = ()
    ends_the_run: bool = False
    """Whether nothing is left to do where it cannot be done."""


@dataclass(frozen=True)
class Outcome(JsonResult):
    """The outcome of a run."""

    _error: ClassVar = RunFolderError
    _source: ClassVar = "the outcome of a run"

    folder: Path
    status: RunState
    message: str
    stages: dict[str, StageState]
    """State of each stage."""
    reasons: dict[str, str]
    """Why, of each stage that gave nothing."""
    seconds: dict[str, float]
    """How long each stage took when it was done, the report included."""
    warnings: tuple[str, ...] = ()
    """The warnings of the report, the most important first."""

    def to_dict(self) -> dict[str, Any]:
        """The outcome as plain values."""
        return {
            "folder": str(self.folder),
            "status": str(self.status),
            "message": self.message,
            "stages": {name: str(state) for name, state in self.stages.items()},
            "reasons": self.reasons,
            "seconds": self.seconds,
            "warnings": list(self.warnings),
            "report": str(self.folder / PAGE),
        }

    @classmethod
    def of_table(cls, table: Table) -> Outcome:
        """The inverse of `to_dict`, of a document that is read already."""
        status, stages, why, took = (
            table.text("status"),
            *(table.table(k) for k in ("stages", "reasons", "seconds")),
        )
        if status not in list(RunState):
            table.refuse("status", f"{status!r} is not known")
        for name in stages:
            if stages.text(name) not in list(StageState):
                stages.refuse(name, f"{stages.text(name)!r} is not known")
        return cls(
            Path(table.text("folder")),
            RunState(status),
            table.text("message"),
            {name: StageState(stages.text(name)) for name in stages},
            {name: why.text(name) for name in why},
            {name: took.number(name) for name in took},
            table.texts("warnings") if "warnings" in table else (),
        )


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
        action: Callable[[Path, Tell, bool], str],
        in_place: tuple[str, ...] = (),
        ends_the_run: bool = False,
    ) -> None:
        before = {s.name: s.key for s in out if s.name in needs}
        key = digest([name, stages.version(), parts, before])
        out.append(Stage(name, title, key, needs, into, action, in_place, ends_the_run))

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
        FIT_FOLDER,
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
    """The stages that only the page needs, and no number waits for."""
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


def _plan_motion(
    r: Recording, options: Options, here: Path, needs: tuple[str, ...], add: Callable[..., None]
) -> None:
    """Rates and accelerations, of links by their angles and of points by their places."""
    add(
        f"{r.name}/states",
        f"Rates of {r.label}",
        (f"{r.name}/angles",),
        r.name,
        [options.pinned, options.start_s, options.stop_s],
        lambda into, tell, resume: motion.states(r.name, options, here, into, tell),
    )
    if r.kind != "angles":
        parts = [r.digest, options.points, options.scale, options.origin, options.pivot, options.mirrored]
        add(
            f"{r.name}/points",
            f"Speeds of points of {r.label}",
            needs,
            r.name,
            [*parts, options.link_length_m],
            lambda into, tell, resume: motion.points(stages.nodes_of(here, r), options, into, tell),
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
            [
                r.digest,
                known.option(options.rig),
                options.reading_key(),
                *options.of_markers().items(),
                *([] if options.edits is None else [known.option(options.edits)]),
            ],
            lambda into, tell, resume: stages.track(r, options, into, tell, resume),
            (RunFile.NODES,),
            ends_the_run=True,
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
            options.reading_key(),
            options.link_length_m,
            options.axis,
            options.pivot,
        ],
        lambda into, tell, resume: stages.angles(r, options, here, into),
    )
    _plan_motion(r, options, here, needs, add)
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
    run = RunFolder.open(path) if (path / RECORD).exists() else None
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
    found: dict[str, StageResult] = {}
    of = len(todo) + 1
    tell = progress or (lambda number, of, title, event: None)
    for number, stage in enumerate(todo, 1):
        missing = [name for name in stage.needs if not found[name].state.has_results]
        if missing and len(missing) == len(stage.needs):
            apart = all(found[name].state is StageState.DOES_NOT_APPLY for name in missing)
            state = StageState.DOES_NOT_APPLY if apart else StageState.NOT_DONE
            why = f"it needs {' and '.join(run.facts['titles'][name] for name in missing)}"
            found[stage.name] = StageResult(state, why)
            run.stages.pop(stage.name, None)
        elif run.holds(stage.name, stage.key):
            found[stage.name] = StageResult(StageState.KEPT)
        else:
            tell(number, of, stage.title, Started())
            found[stage.name] = _do(run, stage, partial(tell, number, of, stage.title))
        tell(number, of, stage.title, found[stage.name])
    for state in (StageState.NOT_DONE, StageState.DOES_NOT_APPLY):
        run.facts[str(state)] = {name: r.why for name, r in found.items() if r.state is state}
    run.save()
    tell(of, of, "Report", Started())
    begun = time.monotonic()
    warnings = stages.report(path)
    write_text(path / README, provenance.readme(run))
    seconds = {name: float(done["seconds"]) for name, done in run.stages.items()}
    seconds["report"] = round(time.monotonic() - begun, 2)
    tell(of, of, "Report", StageResult(StageState.DONE))
    failed = sum(r.state is StageState.NOT_DONE for r in found.values())
    problems = [f"{failed} of {len(found)} stages could not be done"] if failed else []
    if "fit" in run.stages and not stages.converged(path):
        problems.append("the damping fit did not converge")
    return Outcome(
        path,
        RunState.PARTLY if problems else RunState.DONE,
        "; ".join(problems) or _all_done(found, run.facts["titles"]),
        {name: r.state for name, r in found.items()},
        {name: r.why for name, r in found.items() if r.why},
        seconds,
        warnings,
    )


def _all_done(found: dict[str, StageResult], titles: dict[str, str]) -> str:
    """The words for a run without a failure, with the stages that do not apply."""
    apart = [titles[name] for name, r in found.items() if r.state is StageState.DOES_NOT_APPLY]
    return f"every stage that applies is done (not: {', '.join(apart)})" if apart else "every stage is done"


@contextmanager
def _warnings_told(tell: Tell) -> Iterator[None]:
    """Warnings of recordings are told as a stage's notes meanwhile."""
    others = warnings.showwarning

    def show(message: Warning | str, category: type[Warning], *place: Any, **more: Any) -> None:
        if issubclass(category, RecordingWarning):
            tell(Note(str(message)))
        else:
            others(message, category, *place, **more)

    with warnings.catch_warnings():
        warnings.simplefilter("always", RecordingWarning)
        warnings.showwarning = show
        yield


def _do(run: RunFolder, stage: Stage, tell: Tell) -> StageResult:
    """Does one stage and records it. Raises what a stage raises without which there is nothing to do."""
    target = run.path / stage.into
    work = target if stage.in_place else run.path / UNFINISHED
    shutil.rmtree(run.path / UNFINISHED, ignore_errors=True)
    work.mkdir(parents=True, exist_ok=True)
    resume = run.begin(stage.name, stage.key) if stage.in_place else False
    begun = time.monotonic()
    try:
        with _warnings_told(tell):
            message = stage.action(work, tell, resume)
    except DoesNotApply as reason:
        run.stages.pop(stage.name, None)
        return StageResult(StageState.DOES_NOT_APPLY, str(reason))
    except PydpendError as error:
        run.stages.pop(stage.name, None)
        if stage.ends_the_run:
            run.save()
            raise
        return StageResult(StageState.NOT_DONE, str(error))
    if stage.in_place:
        files = [(target / name).relative_to(run.path).as_posix() for name in stage.in_place]
    else:
        files = run.take(stage.name, work, target)
        shutil.rmtree(work, ignore_errors=True)
    run.done(stage.name, stage.key, files, message, time.monotonic() - begun)
    return StageResult(StageState.DONE)
