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
from pydpend.json_text import write_json
from pydpend.kinematics import LinkAngles, read_angles, write_angles
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
