"""Node tables without our metadata: any CSV, Parquet or DataFrame with ``frame, time_s, node, x_px, y_px``.

Columns that may be there too: ``body``, ``sigma_px``, ``area_px``, ``status``.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow.parquet as pq

from pydpend.columns import PARQUET_FAULTS
from pydpend.errors import TableError, fault, listed
from pydpend.kinds import kind_of
from pydpend.long_table import LongTable, read_long
from pydpend.marker_status import MISSING, SEEN, STATUS_WORDS
from pydpend.raw_tracks import Pivoted, RawTracks, Rows, pivot

FORM = "node table without metadata"
REQUIRED = ("node", "x_px", "y_px")
OPTIONAL = ("frame", "time_s", "body", "sigma_px", "area_px", "status")


def is_bare(path: Path) -> bool:
    """Whether a file has the columns of a node table and none of our metadata."""
    if kind_of(path) != "nodes":
        return False
    with path.open("rb") as file:
        if file.read(4) != b"PAR1":
            return not Path(f"{path}.json").exists()
    try:
        # A file, because pyarrow takes no name that is not UTF-8.
        with path.open("rb") as file:
            return b"pydpend.schema_version" not in (pq.read_metadata(file).metadata or {})
    except PARQUET_FAULTS:
        return False


def bare_tracks(path: Path) -> RawTracks:
    """The tracks of a bare node table's file. Raises TableError naming the line or row at fault."""
    return tracks_of(read_long(path, REQUIRED, OPTIONAL))


def tracks_of(table: LongTable) -> RawTracks:
    """The tracks of a bare node table. Raises TableError naming the line or row at fault."""
    name = table.source
    if "frame" not in table and "time_s" not in table:
        raise TableError(
            fault(name, "there is neither a column frame nor time_s", "Number the frames, or give times")
        )
    t_s = table.numbers("time_s") if "time_s" in table else None
    notes = []
    if "frame" in table:
        frame = table.numbers("frame")
    else:
        assert t_s is not None
        frame = np.unique(t_s, return_inverse=True)[1].astype(np.float64)
        notes.append("there is no column frame: times are numbered from 0")
    rows = Rows(name, frame, table.words("node"), table.place, t_s)
    wide = pivot(rows)
    status = _status(table, wide, notes) if "status" in table else None
    lacking = wide.frame.size * len(wide.names) - table.rows
    if lacking:
        notes.append(
            f"{lacking} of {wide.frame.size * len(wide.names)} rows are not there: these nodes are missing"
        )
    return RawTracks(
        FORM,
        name,
        wide.names,
        wide.frame,
        wide.spread(np.stack([table.numbers("x_px"), table.numbers("y_px")], axis=1)),
        wide.t_s,
        wide.words_of(table.words("body")) if "body" in table else None,
        wide.spread(table.numbers("sigma_px")) if "sigma_px" in table else None,
        status=status,
        area_px=wide.spread(table.numbers("area_px")) if "area_px" in table else None,
        notes=notes,
    )


def _status(
    table: LongTable, wide: Pivoted, notes: list[str]
) -> np.ndarray[tuple[int, ...], np.dtype[np.uint8]]:
    """The states (T, N); rows that are not there are missing, and an empty status is what the place says."""
    numbers = {word: i for i, word in enumerate(STATUS_WORDS)}
    words = table.words("status")
    places = np.isfinite(table.numbers("x_px"))
    out = np.full((wide.frame.size, len(wide.names)), MISSING, dtype=np.uint8)
    values = np.empty(len(words), dtype=np.uint8)
    for row, word in enumerate(words):
        number = numbers.get(word) if word else (SEEN if places[row] else MISSING)
        if number is None:
            problem = f"the status {word!r} is not known"
            place = f"{table.place(row)}, column status"
            raise TableError(fault(table.source, problem, f"Write {listed(STATUS_WORDS)}", place=place))
        values[row] = number
    out[wide.at] = values
    unsure = int((places & ~np.isin(values, (1, 2))).sum())
    if unsure:
        notes.append(
            f"{unsure} rows have a place and a status that says they are not seen: their places are left out"
        )
    return out
