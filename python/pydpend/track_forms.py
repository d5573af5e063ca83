"""The form of a file of tracks by what is in it: which program's it is.

Owns: how each form is told. `pydpend.kinds` asks it for what the compiled half does not know; readers are in
`pydpend.tracks`.
"""

from __future__ import annotations

import csv
import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal, TypeAlias, get_args

from pydpend.plain_text import decoded

Form: TypeAlias = Literal[
    "nodes",
    "dltdv",
    "osp_text",
    "osp_trk",
    "kinovea_csv",
    "kinovea_text",
    "kinovea_kva",
    "deeplabcut_csv",
    "deeplabcut_h5",
    "sleap_h5",
    "sleap_slp",
    "sleap_csv",
    "trackpy",
    "laptrack",
    "trackmate_csv",
    "trackmate_xml",
    "trackmate_tracks",
    "trc",
    "c3d",
    "qualisys",
    "movement",
]

FORMS: tuple[Form, ...] = get_args(Form)

NOUNS: dict[Form, str] = {
    "nodes": "a node table without metadata",
    "dltdv": "a table of DLTdv (xypts)",
    "osp_text": "a text of OSP Tracker",
    "osp_trk": "a tab of OSP Tracker (.trk)",
    "kinovea_csv": "a CSV of Kinovea",
    "kinovea_text": "a trajectory text of Kinovea",
    "kinovea_kva": "annotations of Kinovea (.kva)",
    "deeplabcut_csv": "a CSV of DeepLabCut",
    "deeplabcut_h5": "an HDF5 of DeepLabCut",
    "sleap_h5": "an analysis HDF5 of SLEAP",
    "sleap_slp": "a project of SLEAP (.slp)",
    "sleap_csv": "an analysis CSV of SLEAP",
    "trackpy": "a table of trackpy",
    "laptrack": "a table of laptrack",
    "trackmate_csv": "a spots table of TrackMate",
    "trackmate_xml": "a file of TrackMate (XML)",
    "trackmate_tracks": "exported tracks of TrackMate (XML)",
    "trc": "a TRC file of motion capture",
    "c3d": "a C3D file of motion capture",
    "qualisys": "a TSV of Qualisys",
    "movement": "a dataset of movement (NetCDF)",
}
"""The forms in words, with their articles."""

BEGINNING = 1 << 16
"""Bytes that are looked at."""

DLTDV = re.compile(r"pt\d+_cam\d+_[XY]", re.IGNORECASE)
"""A column of DLTdv's xypts."""

KINOVEA = re.compile(r"(.+)/(.+)/([XY])")
"""A column of Kinovea's CSV: object, point and axis."""

_HDF5 = b"\x89HDF\r\n\x1a\n"


def form_of(path: str | os.PathLike[str], *, is_sure: bool = True) -> Form | None:
    """The form of a file; None if it is none that is known, or cannot be read.

    ``is_sure``: a table of ``t``, ``x`` and ``y``, which may be anything, is OSP Tracker's only if its title is above.
    """
    file = Path(path)
    # Of a name that no file can have pathlib raises what this does not.
    if not os.path.isfile(file):
        return None
    try:
        with file.open("rb") as opened:
            head = opened.read(BEGINNING)
    except OSError:
        return None
    if head.startswith(_HDF5):
        return _of_hdf5(file)
    if head[:3] == b"CDF":
        return "movement"
    if head.startswith(b"PAR1"):
        import pyarrow.parquet as pq

        from pydpend.columns import PARQUET_FAULTS

        try:
            # A file, because pyarrow takes no name that is not UTF-8.
            with file.open("rb") as opened:
                return form_of_columns(pq.read_schema(opened).names)
        except PARQUET_FAULTS:
            return None
    # The second byte is C3D's key, the first the block in which its parameters begin.
    if head[1:2] == b"\x50" and 1 < head[0] < 128 and b"POINT" in head:
        return "c3d"
    return (
        None
        if b"\0" in head[:64] and head[:2] not in (b"\xff\xfe", b"\xfe\xff")
        else _of_text(decoded(head), is_sure)
    )


def form_of_columns(names: Sequence[str]) -> Form | None:
    """The form of a table by its columns."""
    has = set(names).issuperset
    if has({"node", "x_px", "y_px"}):
        return "nodes"
    if names and any(DLTDV.fullmatch(name) for name in names):
        return "dltdv"
    if has({"TRACK_ID", "POSITION_X", "POSITION_Y", "FRAME"}):
        return "trackmate_csv"
    if has({"track", "frame_idx", "instance.score"}):
        return "sleap_csv"
    if has({"frame", "particle", "x", "y"}):
        return "trackpy"
    if has({"track_id", "x", "y"}) and ("frame" in names or "frame_y" in names):
        return "laptrack"
    if names and names[0].partition(" ")[0] == "Time" and any(KINOVEA.fullmatch(name) for name in names[1:]):
        return "kinovea_csv"
    return "osp_text" if has({"t", "x", "y"}) else None


def _of_hdf5(path: Path) -> Form | None:
    """The form of an HDF5 file by its outermost names; None without h5py too, which the readers then ask for."""
    try:
        import h5py
    except ImportError:
        return None
    try:
        with h5py.File(path, "r") as file:
            return _of_groups(file)
    except (OSError, RuntimeError, ValueError, KeyError, TypeError, AttributeError):
        return None


def _of_groups(file: Any) -> Form | None:
    has = set(file.keys()).issuperset
    if has({"tracks", "node_names", "track_occupancy"}):
        return "sleap_h5"
    if has({"metadata", "frames", "instances", "points"}):
        return "sleap_slp"
    if has({"position", "space", "time"}):
        return "movement"
    # pandas marks the groups that it writes, and names the levels of their columns there or in their parts.
    marked = (group for group in file.values() if "pandas_type" in group.attrs)
    parts = (part for group in marked for part in (group, *group.values()))
    names = (value for part in parts for value in part.attrs.values())
    return "deeplabcut_h5" if any(isinstance(v, bytes) and b"bodyparts" in v for v in names) else None


def _of_text(text: str, is_sure: bool) -> Form | None:
    text = text.lstrip("\ufeff \r\n\t")
    if text.startswith("<"):
        return _of_xml(text)
    if text.startswith("PathFileType"):
        return "trc"
    if text.startswith("#Kinovea Trajectory"):
        return "kinovea_text"
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")[:4]
    if re.match(r"(FILE_VERSION|NO_OF_FRAMES)[\t ]", text):
        return "qualisys"
    first = [row for row in _cells(lines[0]) if row]
    rows = [row for line in lines for row in _cells(line)]
    if any(row[0] == "scorer" for row in rows) and any(row[0] == "bodyparts" for row in rows):
        return "deeplabcut_csv"
    found = next((form for form in map(form_of_columns, rows) if form is not None), None)
    is_bare = found == "osp_text" and any(form_of_columns(row) == "osp_text" for row in first)
    return None if is_bare and is_sure else found


def _cells(line: str) -> list[list[str]]:
    """A line's fields by each delimiter that parts it."""
    out = [[c.strip() for c in row] for d in ",;\t" if d in line for row in csv.reader([line], delimiter=d)]
    return out or [line.split()] if line.strip() else []


def _of_xml(text: str) -> Form | None:
    roots: tuple[tuple[str, Form], ...] = (
        (r"<object\s+class=\"org\.opensourcephysics\.cabrillo\.tracker\.TrackerPanel\"", "osp_trk"),
        (r"<KinoveaVideoAnalysis[\s>]", "kinovea_kva"),
        (r"<TrackMate[\s>]", "trackmate_xml"),
        (r"<Tracks[\s>]", "trackmate_tracks"),
    )
    return next((form for pattern, form in roots if re.search(pattern, text)), None)
