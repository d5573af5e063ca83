"""The folder of one recording in a run of ``pydpend analyse``: its files by name, written and read.

Owns: every file name of a recording's folder, and the typed result that each file holds, checked as it is read, because
a folder may come from anyone. The stages of `pydpend.analyse` write the files; figures, the page and films of a run are
made of what is read here.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from pydpend.columns import read_columns
from pydpend.damping import Prediction
from pydpend.documents import Table, read_json
from pydpend.encoder import Calibration, Comparison, read_calibration
from pydpend.errors import ANALYSE, PydpendError, fault
from pydpend.free_swing import RingDown
from pydpend.json_text import write_json
from pydpend.kinematics import LinkAngles, read_angles, write_angles
from pydpend.link_states import LinkStates, PointStates
from pydpend.nodes import Nodes, read_nodes
from pydpend.output import write_text
from pydpend.tabular import write_csv, write_parquet
from pydpend.worded import Words

Floats: TypeAlias = NDArray[np.float64]

AGAIN = "Do " + ANALYSE + " again"
"""Advice about a file of a run that is not as it should be."""


class RunFileError(PydpendError):
    """A run folder that is none, or a file of one that is missing or damaged."""


class RunFile(Words):
    """The files that stages make of a recording, by name; ``words`` says what each is."""

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
    STATES = (
        "states.parquet",
        "angles, rates and accelerations of the links with their standard uncertainties, SI",
    )
    STATES_ABOUT = "states.json", "names of these links, and why no period is told"
    SWING = "swing.json", "a single pendulum's period, law of damping, logarithmic decrement and Q"
    SWING_TABLE = "swing.csv", "its turning points: time and amplitude"
    POINTS = "points.parquet", "places, velocities and accelerations of joints and markers"
    POINTS_ABOUT = "points.json", "their unit, scale and origin"
    WINDOWS = "windows.csv", "error of each predicted window, degrees"


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
class StoredStates:
    """Angles, rates and accelerations of L links at T times, each (T, L), SI; NaN where not known."""

    t_s: Floats
    link_names: tuple[str, ...]
    phi_rad: Floats
    w_rad_s: Floats
    a_rad_s2: Floats
    no_swing: str
    """Why a single pendulum has no period; empty where it has or there are several links."""


@dataclass(frozen=True, eq=False)
class StoredPoints:
    """Speeds of P points at T times, (T, P), in ``unit``/s, and how their places were had."""

    t_s: Floats
    names: tuple[str, ...]
    unit: str
    speed: Floats
    about: dict[str, Any]


@dataclass(frozen=True)
class RecordingFolder:
    """The folder of one recording. What is missing or damaged raises RunFileError."""

    folder: Path

    def file(self, name: RunFile) -> Path:
        """The path of one of its files."""
        return self.folder / name

    def write_residuals(self, t_s: Floats, off_px: Floats) -> None:
        """Writes the distance of each node from its place in its body's shape, (T, N), px."""
        # Columns are numbered, because a node may be called anything; their names are in the file of the markers.
        columns = {"time_s": t_s} | {f"node{i}_px": off_px[:, i] for i in range(off_px.shape[1])}
        write_parquet(self.file(RunFile.RESIDUALS), columns)

    def write_markers(self, nodes: Nodes, off_px: Floats) -> None:
        """Writes how well each node was seen, and its distances from its place, summed up."""
        rows = []
        for i, node in enumerate(nodes.rig.nodes):
            off = off_px[np.isfinite(off_px[:, i]), i]
            rows.append(
                {
                    "node": node.name,
                    "body": node.body,
                    "seen": float(nodes.seen[:, i].mean()),
                    "residual_rms_px": float(np.sqrt(np.mean(off**2))) if off.size else None,
                    "residual_largest_px": float(off.max()) if off.size else None,
                }
            )
        write_json(self.file(RunFile.MARKERS), {"nodes": rows})

    def write_angles(self, angles: LinkAngles) -> None:
        """Writes the angles and how they were had."""
        write_angles(angles, self.file(RunFile.ANGLES))
        write_json(self.file(RunFile.ANGLES_ABOUT), angles.meta)

    def write_states(self, found: LinkStates, no_swing: str) -> None:
        """Writes rates and accelerations, and why no period is told."""
        write_parquet(self.file(RunFile.STATES), found.to_columns())
        names = list(found.link_names) or [str(k + 1) for k in range(found.phi_rad.shape[1])]
        about = {"links": names, "columns": list(found.to_columns()), "no_swing": no_swing}
        write_json(self.file(RunFile.STATES_ABOUT), about | {"sigma_factor": found.sigma_factor})

    def write_swing(self, found: RingDown) -> None:
        """Writes a single pendulum's free swing."""
        write_json(self.file(RunFile.SWING), found.to_dict())
        write_csv(self.file(RunFile.SWING_TABLE), found.to_columns())

    def write_points(self, found: PointStates, about: dict[str, Any]) -> None:
        """Writes places, velocities and accelerations of points, and how their places were had."""
        write_parquet(self.file(RunFile.POINTS), found.to_columns())
        write_json(self.file(RunFile.POINTS_ABOUT), about | {"points": found.names, "unit": found.unit})

    def write_comparison(self, found: Comparison) -> None:
        """Writes the film against the encoder."""
        write_text(self.file(RunFile.COMPARISON), found.to_json())
        write_parquet(self.file(RunFile.COMPARED), found.to_columns())

    def write_overlay(self, drawn: StoredOverlay) -> None:
        """Writes what the film with what was found drawn in shows when."""
        about = {
            "rate_hz": drawn.rate_hz,
            "every": drawn.every,
            "size_px": drawn.size_px,
            "times_s": drawn.times_s,
        }
        write_json(self.file(RunFile.OVERLAY_ABOUT), about)

    def write_windows(self, found: Prediction) -> None:
        """Writes the error of each predicted window."""
        write_csv(self.file(RunFile.WINDOWS), found.to_columns())

    def nodes(self) -> Nodes:
        """The node table that the run made."""
        return read_nodes(self.file(RunFile.NODES))

    def residual_px(self, nodes: Nodes) -> Floats:
        """Distance of each node from its place in its body's shape, (T, N), px; NaN where not known."""
        names = [f"node{i}_px" for i in range(len(nodes.rig.nodes))]
        columns = read_table(self.file(RunFile.RESIDUALS), *names)
        residual = np.column_stack([columns[name] for name in names])
        if len(residual) != len(nodes):
            raise RunFileError(
                fault(str(self.folder), f"{len(residual)} rows of residuals for {len(nodes)} frames", AGAIN)
            )
        return residual

    def angles(self, name: str | None = None) -> LinkAngles:
        """The angles, called ``name``."""
        return read_angles(self.file(RunFile.ANGLES), name=name)

    def angles_about(self) -> dict[str, Any]:
        """The origin of the angles: `LinkAngles.meta`."""
        return read_document(self.file(RunFile.ANGLES_ABOUT)).values

    def states(self) -> StoredStates:
        """Rates and accelerations of the links."""
        about = read_document(self.file(RunFile.STATES_ABOUT))
        links, columns = about.texts("links"), about.texts("columns")
        # Of each link angle, rate, acceleration, in the order of `LinkStates.to_columns`; uncertainties come after.
        count = len(links)
        table = read_table(self.file(RunFile.STATES), *columns)
        if len(columns) != 1 + 6 * count:
            raise RunFileError(fault(str(self.folder), f"{len(columns)} columns of {count} links", AGAIN))
        phi, w, a = (
            np.column_stack([table[name] for name in columns[1 + k * count : 1 + (k + 1) * count]])
            for k in range(3)
        )
        return StoredStates(table["time_s"], links, phi, w, a, about.text("no_swing"))

    def swing(self) -> RingDown | None:
        """A single pendulum's free swing, if there is one."""
        path = self.file(RunFile.SWING)
        if not path.exists():
            return None
        turns = read_table(self.file(RunFile.SWING_TABLE), "time_s", "amplitude_rad", "sigma_amplitude_rad")
        return replace(
            RingDown.of_table(read_document(path)),
            t_s=turns["time_s"],
            amplitude_rad=turns["amplitude_rad"],
            amplitude_sigma_rad=turns["sigma_amplitude_rad"],
        )

    def points(self) -> StoredPoints:
        """Speeds of points."""
        about = read_document(self.file(RunFile.POINTS_ABOUT))
        names, unit = about.texts("points"), about.text("unit")
        speeds = [f"speed_{name}_{unit}_s" for name in names]
        table = read_table(self.file(RunFile.POINTS), "time_s", *speeds)
        return StoredPoints(
            table["time_s"], names, unit, np.column_stack([table[s] for s in speeds]), about.values
        )

    def calibration(self) -> Calibration | None:
        """The encoder's calibration, if there is one."""
        path = self.file(RunFile.ENCODER)
        return read_calibration(path) if path.exists() else None

    def comparison(self) -> Comparison:
        """The film against the encoder."""
        numbers = read_document(self.file(RunFile.COMPARISON))
        c = read_table(self.file(RunFile.COMPARED), "time_s", "video_rad", "encoder_rad", "residual_rad")
        film = self.angles()
        link = numbers.whole("link", 1, film.links) - 1
        return replace(
            Comparison.of_table(numbers),
            t_s=c["time_s"],
            video_rad=c["video_rad"],
            encoder_rad=c["encoder_rad"],
            residual_rad=c["residual_rad"],
            video_sigma_rad=np.interp(c["time_s"], film.t_s, film.sigma_rad[:, link]),
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
