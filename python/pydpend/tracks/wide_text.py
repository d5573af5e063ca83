"""Tables with columns for each point: DLTdv's xypts, DeepLabCut's and SLEAP's CSV, Kinovea's CSV and text."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pydpend.delimited import Numbers, take_apart
from pydpend.documents import read_bytes
from pydpend.errors import Setting, TableError, fault
from pydpend.long_table import read_long
from pydpend.raw_tracks import Floats, RawTracks, Rows, pivot
from pydpend.track_forms import form_of_columns
from pydpend.tracks.cells import lines_of, numbers_of
from pydpend.units import unit_at_end

PCUTOFF = 0.6
"""Likelihood below which DeepLabCut itself leaves a point out: ``pcutoff`` of its configuration as it makes one."""


def dltdv(path: Path, names: Sequence[str] = ()) -> RawTracks:
    """DLTdv's xypts: ``pt1_cam1_X``, a row per frame, pixels from 1, y upwards from the lowest row.

    Raises TableError if points of more than one camera are wanted: those are in different pictures.
    """
    head = next((line for line in lines_of(path) if line.strip()), "")
    header = [c.strip().strip('"') for c in re.split(r"[,;\t]", head)]
    found: dict[tuple[int, int], dict[str, str]] = {}
    for column in header:
        parts = re.fullmatch(r"pt(\d+)_cam(\d+)_([XY])", column, re.IGNORECASE)
        if parts:
            found.setdefault((int(parts[2]), int(parts[1])), {})[parts[3].upper()] = column
    several = len({camera for camera, _ in found}) > 1
    points = {f"pt{p}_cam{c}" if several else f"pt{p}": (c, xy) for (c, p), xy in sorted(found.items())}
    wanted = [name for name in points if not names or name in names]
    cameras = sorted({points[name][0] for name in wanted})
    if len(cameras) > 1:
        first = ",".join(name for name in wanted if points[name][0] == cameras[0])
        problem = f"its points are of cameras {', '.join(map(str, cameras))}, each with pictures of its own"
        raise TableError(fault(str(path), problem, "Name the points of one with " + Setting("nodes", first)))
    columns = [points[name][1].get(axis, f"{name}_{axis}") for name in wanted for axis in "XY"]
    values = _columns(path, columns)
    xy = values.reshape(len(values), len(wanted), 2) - 1
    return RawTracks("DLTdv", str(path), tuple(wanted), np.arange(len(xy), dtype=np.int64), xy, is_y_up=True)


def _columns(path: Path, columns: Sequence[str]) -> Floats:
    """Columns of numbers (R, C) of a text with a header."""
    cells = take_apart(str(path), read_bytes(path, TableError), columns, TableError)
    found = cells.fields(list(columns))
    numbers = Numbers(cells, found.columns, found.lines)
    return np.stack([numbers.column(c) for c in columns], axis=1)


def deeplabcut_csv(path: Path, names: Sequence[str] = ()) -> RawTracks:
    """DeepLabCut's CSV: rows ``scorer``, ``individuals`` (of several), ``bodyparts``, ``coords``, then the frames."""
    heads: dict[str, list[str]] = {}
    rows: list[tuple[int, list[str]]] = []
    for line, fields in enumerate(csv.reader(lines_of(path)), start=1):
        if fields and fields[0] in ("scorer", "individuals", "bodyparts", "coords") and not rows:
            heads[fields[0]] = [f.strip() for f in fields]
        elif fields:
            rows.append((line, fields))
    for wanted in ("bodyparts", "coords"):
        if wanted not in heads:
            raise TableError(
                fault(str(path), f"there is no row {wanted}", "Give the CSV as DeepLabCut wrote it")
            )
    parts, coords = heads["bodyparts"], heads["coords"]
    people = heads.get("individuals", parts)
    if not len(parts) == len(coords) == len(people):
        raise TableError(
            fault(str(path), "its rows of names are of different lengths", "Copy the file again")
        )
    called = ["frame", *(f"{p} {c}" for p, c in zip(parts[1:], coords[1:], strict=True))]
    values = numbers_of(str(path), rows, called)
    return of_deeplabcut(
        str(path), values[:, 0], list(zip(people, parts, coords, strict=True))[1:], values[:, 1:]
    )


def of_deeplabcut(
    source: str, frame: Floats, columns: Sequence[tuple[str, str, str]], values: Floats
) -> RawTracks:
    """Tracks of DeepLabCut's table: individual, part and coordinate of each of C columns, and values (T, C)."""
    several = len({person for person, part, _ in columns if person != part}) > 1
    at: dict[str, dict[str, int]] = {}
    for i, (person, part, coordinate) in enumerate(columns):
        at.setdefault(f"{person}.{part}" if several else part, {})[coordinate] = i
    axes = "xyz" if all("z" in found for found in at.values()) else "xy"
    lacking = next((n for n, found in at.items() if not set(axes) <= set(found)), None)
    if lacking is not None:
        raise TableError(fault(source, f"{lacking} has no x or no y", "Copy the file again"))
    xyz = np.stack([values[:, [found[a] for a in axes]] for found in at.values()], axis=1)
    likelihood = None
    if all("likelihood" in found for found in at.values()):
        likelihood = values[:, [found["likelihood"] for found in at.values()]]
    numbers = Rows(source, frame, [""] * len(frame), lambda row: f"row {row}").check_frames()
    return RawTracks("DeepLabCut", source, tuple(at), numbers, xyz, confidence=likelihood,
                     unit="" if axes == "xyz" else "px", least_confidence=PCUTOFF)  # fmt: skip


def sleap_csv(path: Path, names: Sequence[str] = ()) -> RawTracks:
    """SLEAP's analysis CSV: a row per frame and track, with ``NODE.x``, ``NODE.y`` and ``NODE.score``."""
    found = read_long(path, ("track", "frame_idx"))
    points = [c.removesuffix(".x") for c in found.header if c.endswith(".x")]
    columns = [f"{p}.{axis}" for p in points for axis in ("x", "y", "score")]
    table = read_long(path, ("track", "frame_idx", *columns))
    tracks = [word or "track" for word in table.words("track")]
    wide = pivot(Rows(str(path), table.numbers("frame_idx"), tracks, table.place))
    values = np.stack([table.numbers(c) for c in columns], axis=1).reshape(table.rows, len(points), 3)
    spread = wide.spread(values).reshape(wide.frame.size, -1, 3)
    return RawTracks("SLEAP", str(path), names_of(wide.names, points), wide.frame, spread[..., :2],
                     confidence=spread[..., 2])  # fmt: skip


def names_of(groups: Sequence[str], points: Sequence[str]) -> tuple[str, ...]:
    """Names of the points of each group; without the group's where there is one group alone."""
    return tuple(f"{g}.{p}" if len(groups) > 1 else p for g in groups for p in points)


def kinovea_csv(path: Path, names: Sequence[str] = ()) -> RawTracks:
    """Kinovea's CSV: ``Time`` and ``OBJECT/POINT/X``, ``OBJECT/POINT/Y``, y upwards in the units of its calibration."""
    head = next((line for line in lines_of(path) if line.strip()), "")
    header = next(
        (
            row
            for d in ",;\t"
            for row in csv.reader([head], delimiter=d)
            if form_of_columns(row) == "kinovea_csv"
        ),
        [],
    )
    header = [c.strip() for c in header]
    points: dict[str, dict[str, str]] = {}
    for column in header[1:]:
        named = re.fullmatch(r"(.+)/(.+)/([XY])", column)
        if named:
            points.setdefault(f"{named[1]}/{named[2]}", {})[named[3]] = column
    lone = {name.rpartition("/")[0] for name in points}
    short = len(lone) == len(points)
    columns = [points[name].get(axis, f"{name}/{axis}") for name in points for axis in "XY"]
    values = _columns(path, [header[0], *columns])
    return _kinovea(
        path, header[0], values[:, 0], [n.rpartition("/")[0] if short else n for n in points], values[:, 1:]
    )


def _kinovea(path: Path, time: str, t: Floats, names: Sequence[str], values: Floats) -> RawTracks:
    unit = unit_at_end(time)[1]
    notes = [] if unit is not None else ["Kinovea does not name the unit of its times: s is taken"]
    t_s = t if unit is None else unit.to_base(t)
    return RawTracks(
        "Kinovea",
        str(path),
        tuple(names),
        np.arange(len(t_s), dtype=np.int64),
        values.reshape(len(t_s), len(names), 2),
        t_s,
        unit="",
        is_y_up=True,
        notes=[*notes, "frames are numbered from 0: this form has times alone"],
    )


def kinovea_text(path: Path, names: Sequence[str] = ()) -> RawTracks:
    """Kinovea's trajectory text: a block ``# NAME`` per trajectory with rows ``T X Y``, decimal comma or point."""
    name, rows, owner = "", [], []
    for line, text in enumerate(lines_of(path), start=1):
        if text.startswith("#"):
            name = text[1:].strip()
        elif text.strip():
            rows.append((line, [f.replace(",", ".") for f in text.split()]))
            owner.append(name)
    values = numbers_of(str(path), rows, ("T", "X", "Y"))
    times, at = np.unique(values[:, 0], return_inverse=True)
    wide = pivot(Rows(str(path), at.astype(float), owner, lambda row: f"line {rows[row][0]}"))
    return _kinovea(path, "T", times, wide.names, wide.spread(values[:, 1:]).reshape(times.size, -1))
