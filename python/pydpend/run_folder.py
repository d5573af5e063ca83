"""The folder of a run of ``pydpend analyse``: the names of its files, and what is read of them.

Owns: every file name of a run and the typed result that each file holds, checked as it is read, because a folder may
come from anyone. The stages of `pydpend.analyse` write the files; figures, the page and films of a run are made of what
is read here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from pydpend.columns import read_columns
from pydpend.damping import DampingFit
from pydpend.documents import Table, read_json
from pydpend.encoder import Calibration, read_calibration
from pydpend.errors import ANALYSE, PydpendError, fault
from pydpend.kinds import expect
from pydpend.kinematics import LinkAngles, read_angles
from pydpend.nodes import Nodes, read_nodes
from pydpend.worded import Words

Floats: TypeAlias = NDArray[np.float64]

AGAIN = "Do " + ANALYSE + " again"
"""What to do about a file of a run that is not as it should be."""

RECORD = "run.json"
"""The run's own record."""
PAGE = "report.html"
"""The page for people."""
README = "README.txt"
"""What lies in the folder, in words."""
FIT_FOLDER = "fit"
"""Folder of the damping fit."""


class RunFileError(PydpendError):
    """A run folder that is none, or a file of one that is missing or damaged."""


class RunFile(Words):
    """The files that stages make, by name; ``words`` says what each is."""

    NODES = "nodes.parquet", "node table: where each marker is in each frame"
    RESIDUALS = "residuals.parquet", "distance of each marker from where its rigid body puts it, px"
    MARKERS = "markers.json", "each marker summed up: seen, gaps, residual"
    ANGLES = "angles.parquet", "angles of the links and their standard uncertainties, rad"
    ANGLES_ABOUT = "angles.json", "how the angles were had: bodies, joints, scale, zero"
    ZERO = "zero.parquet", "node table of the film that hangs still"
    ZERO_RIG = "zero_rig.toml", "the rig it was tracked with"
    ENCODER = "encoder.json", "calibration of the encoder"
    CALIBRATION_FIGURE = "calibration.svg", "calibration line and its residuals (Fig. 10)"
    COMPARISON = "comparison.json", "film against encoder, numbers"
    COMPARED = "comparison.parquet", "film and encoder at the encoder's times, rad"
    COMPARISON_FIGURE = "comparison.png", "film against encoder (Fig. 15)"
    OVERLAY = "overlay.mp4", "the film with nodes, names and bodies drawn in"
    OVERLAY_ABOUT = "overlay.json", "times of its frames in the recording"
    FIT = "fit.json", "damping coefficients, uncertainties, shares, identifiability"
    MODEL = (
        "model.json",
        "constants of the model that the fit began from, with their standard uncertainties, SI",
    )
    COEFFICIENTS = "coefficients.csv", "the coefficients as a table"
    SHARES_FIGURE = "shares.png", "where the energy goes"
    TRIALS = "trials.json", "the coefficients of each recording and their mean"
    TRIALS_FIGURE = "trials.png", "the same, drawn (Fig. 20)"
    MAPS_FIGURE = "maps.png", "angle-dependent bias of the tracking"
    WINDOWS = "windows.csv", "error of each predicted window, degrees"
    PREDICTION = "prediction.json", "each recording predicted from the others"


def read_table(path: Path, *required: str) -> dict[str, Floats]:
    """All columns of a table that a stage wrote. Raises RunFileError if it is damaged or lacks a ``required`` one."""
    return read_columns(path, required, None, error=RunFileError).values


def read_document(path: Path) -> Table:
    """A JSON file that a stage wrote. Raises RunFileError if it is damaged."""
    return read_json(path, RunFileError, AGAIN)


@dataclass(frozen=True, eq=False)
class StoredOverlay:
    """The film with what was found drawn in."""

    path: Path
    times_s: Floats
    """Time in the recording of each of its pictures."""
    rate_hz: float
    size_px: tuple[int, int]
    every: int
    """One frame in so many of the recording."""


@dataclass(frozen=True, eq=False)
class StoredComparison:
    """What a run keeps of a `pydpend.encoder.Comparison`; its fields have the same names and units."""

    link: int
    n: int
    clocks_given: bool
    clock_offset_s: float
    clock_offset_sigma_s: float
    drift: float
    drift_sigma: float
    gain: float
    gain_sigma: float
    offset_rad: float
    offset_sigma_rad: float
    delay_s: float
    delay_sigma_s: float
    rms_rad: float
    largest_rad: float
    shares: dict[str, float]
    """Parts of the residual's variance that are known."""
    encoder_sigma_rad: float
    """Stated standard uncertainty of a reading; NaN where none is."""
    stated_sigma_rad: tuple[float, ...]
    """Those of film and encoder that are stated."""
    t_s: Floats
    video_rad: Floats
    encoder_rad: Floats
    residual_rad: Floats
    video_sigma_rad: Floats
    notes: tuple[str, ...]


@dataclass(frozen=True)
class StoredSpread:
    """A coefficient over the recordings (`pydpend.trials.Spread`)."""

    values: tuple[float, ...]
    sigmas: tuple[float, ...]
    mean: float
    sigma: float
    spread: float
    p_value: float
    unit: str


@dataclass(frozen=True)
class StoredTrials:
    """What a run keeps of `pydpend.trials.Trials`."""

    message: str
    spreads: dict[str, StoredSpread]


@dataclass(frozen=True)
class StoredWindow:
    """Prediction errors in windows of one length, degrees, per link (`pydpend.damping.Window`)."""

    rms_deg: tuple[float, ...]
    median_deg: tuple[float, ...]
    n: int


@dataclass(frozen=True)
class StoredPrediction:
    """One recording predicted from the others, by window length in s."""

    in_window: dict[str, StoredWindow]
    forecast: dict[str, StoredWindow]


@dataclass(frozen=True)
class StoredScale:
    """The constant that stands behind all coefficients, and the model that it is of."""

    model: str
    psi_kg_m2: float
    sigma_kg_m2: float


@dataclass(frozen=True)
class StageRecord:
    """What a stage said and how long it took."""

    message: str
    seconds: float


@dataclass(frozen=True)
class StoredRecording:
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

    @property
    def here(self) -> Path:
        """The recording's folder."""
        return self.run / self.name

    def did(self, stage: str) -> bool:
        """Whether the recording's stage gave results."""
        return f"{self.name}/{stage}" in self.stages

    def file(self, name: RunFile) -> Path:
        """The path of one of its files."""
        return self.here / name

    def nodes(self) -> Nodes:
        """The node table that the run made or was given. Raises RunFileError if it is no longer there."""
        path = self.file(RunFile.NODES)
        if not path.exists():
            path = Path(self.path)
            if not path.is_file():
                raise RunFileError(fault(str(path), "the run's node table is no longer there", AGAIN))
        return read_nodes(path)

    def residual_px(self, nodes: Nodes) -> Floats:
        """Distance of each node from its place in its body's shape, (T, N), px; NaN where not known."""
        names = [f"node{i}_px" for i in range(len(nodes.rig.nodes))]
        columns = read_table(self.file(RunFile.RESIDUALS), *names)
        residual = np.column_stack([columns[name] for name in names])
        if len(residual) != len(nodes):
            raise RunFileError(
                fault(str(self.here), f"{len(residual)} rows of residuals for {len(nodes)} frames", AGAIN)
            )
        return residual

    def angles(self) -> LinkAngles:
        """The angles."""
        return read_angles(self.file(RunFile.ANGLES), name=self.label)

    def angles_about(self) -> dict[str, Any]:
        """How the angles were had: `LinkAngles.meta`."""
        return read_document(self.file(RunFile.ANGLES_ABOUT)).values

    def calibration(self) -> Calibration | None:
        """The encoder's calibration, if there is one."""
        path = self.file(RunFile.ENCODER)
        return read_calibration(path) if path.exists() else None

    def comparison(self) -> StoredComparison:
        """The film against the encoder."""
        numbers = read_document(self.file(RunFile.COMPARISON))
        columns = ("time_s", "video_rad", "encoder_rad", "residual_rad")
        c = read_table(self.file(RunFile.COMPARED), *columns)
        film = read_angles(self.file(RunFile.ANGLES))
        link = numbers.whole("link", 1, film.links) - 1
        clocks, shares, sigmas = (numbers.table(key) for key in ("clocks", "shares", "stated_sigma_rad"))
        stated = tuple(v for v in (sigmas.number_or_nan(key) for key in ("encoder", "video")) if v == v)
        return StoredComparison(
            link=link,
            n=numbers.whole("n"),
            clocks_given=clocks.flag("given"),
            clock_offset_s=clocks.number("offset_s"),
            clock_offset_sigma_s=clocks.number_or_nan("offset_sigma_s"),
            drift=clocks.number("drift"),
            drift_sigma=clocks.number_or_nan("drift_sigma"),
            gain=numbers.number("gain"),
            gain_sigma=numbers.number_or_nan("gain_sigma"),
            offset_rad=numbers.number("offset_rad"),
            offset_sigma_rad=numbers.number_or_nan("offset_sigma_rad"),
            delay_s=numbers.number_or_nan("delay_s"),
            delay_sigma_s=numbers.number_or_nan("delay_sigma_s"),
            rms_rad=numbers.number("rms_rad"),
            largest_rad=numbers.number("largest_rad"),
            shares={key: shares.number(key) for key in shares if key in shares},
            encoder_sigma_rad=sigmas.number_or_nan("encoder") or math.nan,
            stated_sigma_rad=stated,
            t_s=c["time_s"],
            video_rad=c["video_rad"],
            encoder_rad=c["encoder_rad"],
            residual_rad=c["residual_rad"],
            video_sigma_rad=np.interp(c["time_s"], film.t_s, film.sigma_rad[:, link]),
            notes=numbers.texts("notes"),
        )

    def overlay(self) -> StoredOverlay | None:
        """The film with what was found drawn in, if there is one."""
        path = self.file(RunFile.OVERLAY_ABOUT)
        if not path.exists():
            return None
        about = read_document(path)
        width, height = (int(side) for side in about.array("size_px", 2))
        times, rate = about.array("times_s", -1), about.number("rate_hz")
        return StoredOverlay(
            self.file(RunFile.OVERLAY), times, rate, (width, height), about.whole("every", 1)
        )

    def energy(self) -> dict[str, Floats] | None:
        """The energy of the fitted motion and what each law takes out: ``time_s`` and columns in J."""
        path = self._table_of_fit("energy")
        return read_table(path, "time_s", "energy_j", "model_j") if path.exists() else None

    def residuals(self) -> dict[str, Floats] | None:
        """Measured minus fitted angles: ``time_s`` and columns in rad."""
        path = self._table_of_fit("residuals")
        return read_table(path, "time_s", "phi1_residual_rad", "phi1_sigma_rad") if path.exists() else None

    def windows(self) -> dict[str, Floats]:
        """The error of each predicted window: ``window_s``, ``start_s`` and degrees."""
        return read_table(self.file(RunFile.WINDOWS), "window_s", "start_s", "phi1_rms_deg")

    def _table_of_fit(self, name: str) -> Path:
        """A recording's table of the fit: ``energy.csv``, or ``energy-2.csv`` where there are several recordings."""
        alone = self.run / FIT_FOLDER / f"{name}.csv"
        return alone if alone.exists() else self.run / FIT_FOLDER / f"{name}-{self.index + 1}.csv"


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
        """What a stage is called for people."""
        return self.titles.get(stage, stage)

    def file(self, name: RunFile) -> Path:
        """The path of a file of the fit."""
        return self.path / FIT_FOLDER / name

    def fit(self) -> DampingFit:
        """The damping fit, without its tables."""
        return DampingFit.of_table(read_document(self.file(RunFile.FIT)))

    def scale(self) -> StoredScale | None:
        """The constant behind all coefficients, if the run kept it."""
        path = self.file(RunFile.MODEL)
        if not path.exists():
            return None
        model = read_document(path)
        psi = model.table("constants").table("psi_kg_m2")
        return StoredScale(model.text("name"), psi.number("value"), psi.number("sigma"))

    def trials(self) -> StoredTrials | None:
        """The recordings beside each other, if there are several."""
        path = self.file(RunFile.TRIALS)
        if not path.exists():
            return None
        given = read_document(path)
        table = given.table("coefficients")
        return StoredTrials(given.text("message"), {name: _spread(table.table(name)) for name in table})

    def predictions(self) -> dict[str, StoredPrediction]:
        """Each recording predicted from the others; empty where that was not done."""
        if "prediction" not in self.stages:
            return {}
        given = read_document(self.path / RunFile.PREDICTION)
        return {name: _prediction(given.table(name)) for name in given}


def _spread(table: Table) -> StoredSpread:
    values, sigmas = table.array("values", -1), table.array("sigmas", -1)
    if values.shape != sigmas.shape:
        table.refuse("sigmas", f"{sigmas.size} uncertainties for {values.size} values")
    numbers = (table.number("mean"), table.number("sigma"), table.number_or_nan("spread"))
    lists = (tuple(values.tolist()), tuple(sigmas.tolist()))
    return StoredSpread(*lists, *numbers, table.number_or_nan("p_value"), table.text("unit"))


def _prediction(table: Table) -> StoredPrediction:
    def windows(key: str) -> dict[str, StoredWindow]:
        group = table.table(key)
        return {w: _window(group.table(w)) for w in group}

    return StoredPrediction(windows("in_window"), windows("forecast"))


def _window(table: Table) -> StoredWindow:
    n = table.whole("n")
    if not n:
        return StoredWindow((), (), 0)
    rms, median = (tuple(table.array(key, -1).tolist()) for key in ("rms_deg", "median_deg"))
    return StoredWindow(rms, median, n)


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
        name: StageRecord(done.table(name).text("message"), done.table(name).number("seconds"))
        for name in (() if done is None else done)
        if done is not None
    }
    recordings = []
    for i, table in enumerate(facts.tables("recordings")):
        name = table.text("name")
        if "/" in name or name in ("", ".", ".."):
            table.refuse("name", f"{name!r} is no folder of the run", "Make the run again with " + ANALYSE)
        label, source, kind = (table.text(key) for key in ("label", "path", "kind"))
        recordings.append(StoredRecording(i, path, name, label, source, kind, frozenset(stages)))
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
