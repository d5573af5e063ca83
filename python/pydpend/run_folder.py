"""The folder of a run of ``pydpend analyse``: the names of what lies in it, and a run as it is read.

The files of its recordings are those of `pydpend.recording_folder`, those of its fit those of `pydpend.fit_folder`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from pydpend.damping import EnergyCurve, Prediction, Residuals
from pydpend.documents import Table
from pydpend.errors import ANALYSE, fault
from pydpend.fit_folder import FitFolder
from pydpend.json_text import write_json
from pydpend.kinds import expect
from pydpend.kinematics import LinkAngles
from pydpend.nodes import Nodes, read_nodes
from pydpend.recording_folder import AGAIN, RecordingFolder, RunFile, RunFileError, read_document

RECORD = "run.json"
"""The run's own record."""
PAGE = "report.html"
"""The page for people."""
README = "README.txt"
"""Contents of the folder, in words."""
FIT_FOLDER = "fit"
"""Folder of the damping fit."""
PREDICTION = "prediction.json"
"""Each recording predicted from the others."""


def fit_folder(run: Path) -> FitFolder:
    """The folder of a run's damping fit."""
    return FitFolder(run / FIT_FOLDER, RunFileError)


def write_predictions(run: Path, found: Mapping[str, Prediction]) -> None:
    """Writes each recording predicted from the others, by its name."""
    write_json(run / PREDICTION, {name: one.to_dict() for name, one in found.items()})
    for name, one in found.items():
        folder = RecordingFolder(run / name)
        folder.folder.mkdir(exist_ok=True)
        folder.write_windows(one)


@dataclass(frozen=True)
class StageRecord:
    """The record of a stage: its words, its duration, and the files that it made, by their paths from the run."""

    message: str
    seconds: float
    files: tuple[str, ...] = ()


@dataclass(frozen=True)
class StoredRecording(RecordingFolder):
    """One recording of a run: its place among all, its folder, what it was made from."""

    index: int
    run: Path
    name: str
    label: str
    path: str
    kind: str
    """``film``, ``nodes`` or ``angles``."""
    stages: frozenset[str]
    """Stages of the run that gave results."""

    def did(self, stage: str) -> bool:
        """Whether the recording's stage gave results."""
        return f"{self.name}/{stage}" in self.stages

    def nodes(self) -> Nodes:
        """The node table that the run made or was given. Raises RunFileError if it is no longer there."""
        if self.file(RunFile.NODES).exists():
            return super().nodes()
        if not Path(self.path).is_file():
            raise RunFileError(fault(self.path, "the run's node table is no longer there", AGAIN))
        return read_nodes(self.path)

    def angles(self, name: str | None = None) -> LinkAngles:
        """The angles, called after the recording."""
        return super().angles(name or self.label)

    def energy(self) -> EnergyCurve | None:
        """The energy of the fitted motion and what each law takes out."""
        return fit_folder(self.run).energy(self.index)

    def residuals(self) -> Residuals | None:
        """Measured minus fitted angles."""
        return fit_folder(self.run).residuals(self.index)


@dataclass(frozen=True)
class StoredRun:
    """A run folder as it is read."""

    path: Path
    version: str
    command: str
    versions: dict[str, str]
    titles: dict[str, str]
    not_done: dict[str, str]
    """Stages that these data did not allow, and why."""
    does_not_apply: dict[str, str]
    """Stages that have no meaning for these recordings, and why."""
    inputs: tuple[tuple[str, str, str], ...]
    """Each input: what it was given as, its path, its SHA-256."""
    stages: dict[str, StageRecord]
    recordings: tuple[StoredRecording, ...]

    def title(self, stage: str) -> str:
        """The name of a stage for people."""
        return self.titles.get(stage, stage)

    @property
    def fit_folder(self) -> FitFolder:
        """The folder of the damping fit."""
        return fit_folder(self.path)

    def predictions(self) -> dict[str, Prediction]:
        """Each recording predicted from the others; empty where that was not done."""
        if "prediction" not in self.stages:
            return {}
        given = read_document(self.path / PREDICTION)
        return {name: Prediction.of_table(given.table(name)) for name in given}


def read_run(run: str | Path) -> StoredRun:
    """A run folder. Raises RunFileError if it is none."""
    path = Path(run)
    expect(path, ("run",), RunFileError)
    record = path / RECORD
    if not record.is_file():
        raise RunFileError(
            fault(str(path), f"is not a run folder (it has no {RECORD})", "Make one with " + ANALYSE)
        )
    given = read_document(record)
    facts = given.table("facts")
    done = given.table("stages") if "stages" in given else None
    stages = {
        name: StageRecord(stage.text("message"), stage.number("seconds"), tuple(stage.table("files")))
        for name in (() if done is None else done)
        if done is not None and (stage := done.table(name))
    }
    recordings = []
    for i, table in enumerate(facts.tables("recordings")):
        name = table.text("name")
        if "/" in name or name in ("", ".", ".."):
            table.refuse("name", f"{name!r} is no folder of the run", "Make the run again with " + ANALYSE)
        label, source, kind = (table.text(key) for key in ("label", "path", "kind"))
        recordings.append(StoredRecording(path / name, i, path, name, label, source, kind, frozenset(stages)))
    inputs = facts.tables("inputs") if "inputs" in facts else []
    return StoredRun(
        path,
        facts.text("version") if "version" in facts else "",
        facts.text("command") if "command" in facts else "",
        _texts(facts, "versions"),
        _texts(facts, "titles"),
        _texts(facts, "not_done"),
        _texts(facts, "does_not_apply"),
        tuple((i.text("given_as"), i.text("path"), i.text("sha256")) for i in inputs),
        stages,
        tuple(recordings),
    )


def _texts(facts: Table, key: str) -> dict[str, str]:
    if key not in facts:
        return {}
    table = facts.table(key)
    return {name: table.text(name) for name in table}
