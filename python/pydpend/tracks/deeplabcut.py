"""DeepLabCut's HDF5, a DataFrame as pandas writes it, read with h5py: nothing of it is run.

pandas keeps the columns' names as pickles, which may do anything: here they may make lists, texts and numbers alone.
And PyTables, which pandas reads with, ends the whole program on some damaged files.
"""

from __future__ import annotations

import io
import pickle
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from pydpend.errors import TableError, fault
from pydpend.raw_tracks import Floats, RawTracks
from pydpend.tracks.cells import DAMAGE, EXTRA, damaged, library
from pydpend.tracks.wide_text import of_deeplabcut

Names = list[tuple[str, ...]]
"""The name of each column, a text for each level."""


def deeplabcut_h5(path: Path, names: Sequence[str] = ()) -> RawTracks:
    """DeepLabCut's table in HDF5, in either of pandas' layouts."""
    h5py = library("h5py", str(path), "HDF5 of DeepLabCut", EXTRA)
    try:
        with h5py.File(path, "r") as file:
            group = next(g for g in file.values() if "pandas_type" in g.attrs)
            levels, columns, frame, values = _of_table(group) if "table" in group else _of_blocks(group)
    except (*DAMAGE, pickle.UnpicklingError, EOFError, StopIteration, MemoryError) as problem:
        raise damaged(path, problem) from problem
    return _chosen(str(path), levels, columns, frame, values)


def of_deeplabcut_frame(frame: Any, source: str) -> RawTracks:
    """DeepLabCut's DataFrame: columns by scorer, individual (of several), body part and coordinate."""
    columns = [tuple(map(str, c)) for c in frame.columns]
    try:
        numbers, values = np.asarray(frame.index, dtype=float), frame.to_numpy(dtype=float)
    except (TypeError, ValueError) as problem:
        said = f"it is no table of numbers ({problem})"
        raise TableError(fault(source, said, "Give the table as DeepLabCut wrote it")) from problem
    return _chosen(source, list(map(str, frame.columns.names)), columns, numbers, values)


def _chosen(source: str, levels: Sequence[str], columns: Names, frame: Floats, values: Floats) -> RawTracks:
    """The tracks of a table with columns of several levels."""
    if not {"bodyparts", "coords"} <= set(levels):
        problem = f"its columns have the levels {', '.join(levels)}, not bodyparts and coords"
        raise TableError(fault(source, problem, "Give the table as DeepLabCut wrote it"))
    part, coordinate = levels.index("bodyparts"), levels.index("coords")
    person = levels.index("individuals") if "individuals" in levels else part
    return of_deeplabcut(source, frame, [(c[person], c[part], c[coordinate]) for c in columns], values)


def _of_table(group: Any) -> tuple[list[str], Names, Floats, Floats]:
    """Levels, columns, frames and values of pandas' layout ``table``: rows of an index and blocks of columns."""
    table = group["table"]
    blocks = [name for name in table.dtype.names if name.startswith("values_block_")]
    found = [tuple(map(str, c)) for name in blocks for c in _plain(table.attrs[f"{name}_kind"])]
    rows = table[()]
    values = np.concatenate(
        [np.asarray(rows[n], dtype=np.float64).reshape(len(rows), -1) for n in blocks], axis=1
    )
    axis, order = _plain(group.attrs["non_index_axes"])[0]
    columns = [tuple(map(str, c)) for c in order]
    levels = [str(name) for name in _plain(group.attrs["info"])[axis]["names"]]
    frame = np.asarray(rows["index"], dtype=np.float64)
    return levels, columns, frame, values[:, [found.index(c) for c in columns]]


def _of_blocks(group: Any) -> tuple[list[str], Names, Floats, Floats]:
    """Levels, columns, frames and values of its layout ``fixed``: an axis of numbered levels, and blocks of values."""
    count = int(group.attrs["nblocks"])
    parts = [
        (_axis(group, f"block{i}_items")[1], np.asarray(group[f"block{i}_values"][()])) for i in range(count)
    ]
    found = [column for names, _ in parts for column in names]
    frame = np.asarray(group["axis1"][()], dtype=np.float64)
    flat = [np.asarray(values, dtype=np.float64).reshape(frame.size, -1) for _, values in parts]
    levels, columns = _axis(group, "axis0")
    return levels, columns, frame, np.concatenate(flat, axis=1)[:, [found.index(c) for c in columns]]


def _axis(group: Any, name: str) -> tuple[list[str], Names]:
    """The levels of an axis and the names along it."""
    levels, words = [], []
    for i in range(int(group.attrs[f"{name}_nlevels"])):
        level = group[f"{name}_level{i}"]
        known = [v.decode("utf-8", "replace") if isinstance(v, bytes) else str(v) for v in level[()]]
        words.append([known[at] for at in group[f"{name}_label{i}"][()]])
        called = level.attrs["name"]
        levels.append(called.decode("utf-8", "replace") if isinstance(called, bytes) else str(called))
    return levels, list(zip(*words, strict=True))


class _Plain(pickle.Unpickler):
    """Pickles of lists, dictionaries, texts and numbers; anything else is refused."""

    def find_class(self, module: str, name: str) -> NoReturn:
        """Raises UnpicklingError: no plain value needs a class."""
        raise pickle.UnpicklingError(f"a pickle in it asks for {module}.{name}")


def _plain(value: Any) -> Any:
    """The value of an attribute that pandas pickled."""
    data = value.encode("utf-8") if isinstance(value, str) else bytes(value)
    return _Plain(io.BytesIO(data)).load()
