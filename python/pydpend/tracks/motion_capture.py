"""Motion capture: TRC, C3D and Qualisys's TSV, three coordinates in a length."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pydpend.documents import unreadable
from pydpend.errors import TableError, fault
from pydpend.raw_tracks import Floats, RawTracks
from pydpend.tracks.cells import library, lines_of, numbers_of

AXES = "XYZ"


def trc(path: Path, names: Sequence[str] = ()) -> RawTracks:
    """A TRC file: rate, unit and marker names above ``Frame#``, ``Time`` and X, Y, Z of each marker."""
    source, lines = str(path), lines_of(path)
    head = {}
    for keys, below in pairwise(lines):
        if keys.startswith("DataRate"):
            head = dict(zip(_fields(keys), _fields(below), strict=False))
            break
    start = next((i for i, line in enumerate(lines) if line.startswith("Frame#")), None)
    if start is None or "Units" not in head:
        lack = "row Frame#" if start is None else "entry Units under DataRate"
        raise TableError(fault(source, f"there is no {lack}", "Write the file again"))
    called = [f.strip() for f in lines[start].rstrip("\t ").split("\t")[2:] if f.strip()]
    columns = ["Frame#", "Time", *(f"{name} {axis}" for name in called for axis in AXES)]
    # The line under the names has X1 Y1 Z1 ...
    rows = [
        (i, line.split("\t"))
        for i, line in enumerate(lines[start + 1 :], start=start + 2)
        if line.strip() and not re.match(r"\s*X1\b", line)
    ]
    values = numbers_of(source, rows, columns)
    xyz = values[:, 2:].reshape(len(rows), len(called), 3)
    number = values[:, 0]
    bad = np.flatnonzero(~(number >= 1) | (number != np.round(number)))
    if bad.size:
        said = f"the frame is {number[bad[0]]:g}, and a whole number from 1 is expected"
        raise TableError(fault(source, said, "Number the frames", place=f"line {rows[int(bad[0])][0]}"))
    # Frames count from 1 there.
    return RawTracks("TRC", source, tuple(called), number.astype(np.int64) - 1, xyz, values[:, 1], unit=head["Units"],
                     is_y_up=True)  # fmt: skip


def _fields(line: str) -> list[str]:
    return [f.strip() for f in line.split("\t")]


def c3d(path: Path, names: Sequence[str] = ()) -> RawTracks:
    """A C3D file, which ezc3d reads: points, their unit and rate; the residual is their uncertainty."""
    source = str(path)
    library("ezc3d", source, "C3D", "export")
    with tempfile.TemporaryDirectory() as folder:
        content = _read_beside(path, Path(folder))
    points = content["points"][:3].transpose(2, 1, 0)
    residual = content["residuals"][0].T
    called = [str(v) for v in content["labels"]][: points.shape[1]]
    unit, rate, first = str(content["unit"]), float(content["rate"]), int(content["first"])
    called += [f"point{i + 1}" for i in range(len(called), points.shape[1])]
    points = np.where((residual >= 0)[..., None], points, np.nan)
    frame = first + np.arange(points.shape[0], dtype=np.int64)
    sigma, notes = _of_residual(residual, np.asarray(np.isfinite(points).all(axis=2)))
    return RawTracks("C3D", source, tuple(called), frame, points, frame / rate if rate > 0 else None, sigma=sigma,
                     unit=unit, is_y_up=True, notes=notes)  # fmt: skip


READER = """
import sys
import ezc3d, numpy
file = ezc3d.c3d("points.c3d")
point = file["parameters"]["POINT"]
numpy.savez(
    "points.npz",
    points=numpy.asarray(file["data"]["points"], dtype=float),
    residuals=numpy.asarray(file["data"]["meta_points"]["residuals"], dtype=float),
    labels=numpy.array([str(v) for v in point["LABELS"]["value"]], dtype=str),
    unit=next((str(v) for v in point.get("UNITS", {}).get("value", [])), ""),
    rate=float(point["RATE"]["value"][0]),
    first=int(file["header"]["points"]["first_frame"]),
)
"""
"""Program that reads a C3D by itself: ezc3d 1.7 ends the whole program on some damaged files."""


def _read_beside(path: Path, folder: Path) -> dict[str, NDArray[Any]]:
    """The content of a C3D, read by another process in ``folder``, where its name is one that ezc3d takes."""
    try:
        shutil.copyfile(path, folder / "points.c3d")
    except OSError as problem:
        raise TableError(unreadable(path, problem)) from problem
    where = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    done = subprocess.run(
        [sys.executable, "-c", READER], cwd=folder, env=where, capture_output=True, text=True, check=False
    )
    if done.returncode:
        said = (done.stderr.strip().splitlines() or ["the reader ended at once"])[-1]
        raise TableError(fault(str(path), f"it cannot be read as C3D ({said})", "Copy it again"))
    with np.load(folder / "points.npz") as found:
        return dict(found)


def _of_residual(
    residual: Floats, seen: np.ndarray[tuple[int, ...], np.dtype[np.bool_]]
) -> tuple[Floats | None, list[str]]:
    """Residuals as uncertainties: 0 is a point that was filled in, and has the middle one of the others."""
    there = residual[seen & (residual > 0)]
    if not there.size:
        return None, []
    filled = int((seen & (residual == 0)).sum())
    notes = ["the residual of a point is taken for its standard uncertainty"]
    if filled:
        notes.append(
            f"{filled} points have no residual, as points that were filled in: the middle one of the others is taken"
        )
    return np.where(residual > 0, residual, float(np.median(there))), notes


def qualisys(path: Path, names: Sequence[str] = ()) -> RawTracks:
    """Qualisys's TSV: ``FREQUENCY``, ``MARKER_NAMES``, then X, Y, Z of each marker in mm; gaps are empty or zero."""
    source, lines = str(path), lines_of(path)
    head: dict[str, list[str]] = {}
    start = 0
    for i, line in enumerate(lines):
        key, *fields = line.split("\t")
        if not re.fullmatch(r"[A-Z][A-Z_]+", key.strip()):
            start = i
            break
        head.setdefault(key.strip(), [v.strip() for v in fields])
    called = [v for v in head.get("MARKER_NAMES", []) if v]
    if not called:
        raise TableError(fault(source, "there is no line MARKER_NAMES", "Export 3D data with the TSV header"))
    if head.get("DATA_INCLUDED", ["3D"])[0] != "3D":
        said = f"its data are {head['DATA_INCLUDED'][0]}, and 3D is expected"
        raise TableError(fault(source, said, "Export 3D data"))
    columns = [f"{name} {axis}" for name in called for axis in AXES]
    # With column names switched on there is a line of them, which begins with Frame and Time where those are there.
    titles = [f.strip() for f in lines[start].split("\t")]
    before = ["Frame", "Time"] if titles[:2] == ["Frame", "Time"] else []
    if before or (titles and titles[0] and not re.match(r"[-+.\d]", titles[0])):
        start += 1
    rows = [(i, line.split("\t")) for i, line in enumerate(lines[start:], start=start + 1) if line.strip()]
    values = numbers_of(source, rows, [*before, *columns], ("null",))
    xyz = values[:, len(before) :].reshape(len(rows), len(called), 3)
    zero = (xyz == 0).all(axis=2)
    notes = [f"{int(zero.sum())} points at exactly (0, 0, 0) are gaps"] if zero.any() else []
    xyz[zero] = np.nan
    frame = np.arange(len(rows), dtype=np.int64)
    return RawTracks("Qualisys", source, tuple(called), frame, xyz, _rate_times(source, head, frame), unit="mm",
                     is_y_up=True, notes=notes)  # fmt: skip


def _rate_times(
    source: str, head: dict[str, list[str]], frame: np.ndarray[tuple[int, ...], np.dtype[np.int64]]
) -> Floats | None:
    """Times by the header's rate; None for an external time base."""
    text = next(iter(head.get("FREQUENCY", [])), "")
    if text in ("", "EXT"):
        return None
    try:
        rate = float(text)
    except ValueError:
        rate = 0.0
    if not rate > 0:
        raise TableError(fault(source, f"FREQUENCY is {text!r}, which is no rate", "Write frames per s"))
    return frame / rate
