"""Tables of numbers and words out of Parquet, text or a DataFrame, with errors that name file, line and column.

`pydpend.columns` reads tables of numbers alone. How text is taken apart is `pydpend.delimited`'s.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from pydpend.columns import PARQUET_FAULTS, damaged_parquet
from pydpend.delimited import Numbers, take_apart
from pydpend.documents import read_bytes
from pydpend.errors import TableError, WrongTypeError, fault
from pydpend.raw_tracks import Floats

FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""Beginnings of cells that ``--safe-csv`` puts a ``'`` before."""


@dataclass(frozen=True, eq=False)
class LongTable:
    """The wanted columns of a table, R rows.

    Attributes
    ----------
    source : str
        File, or what a caller's table is called, for messages.
    header : tuple of str
        Every column's name.
    rows : int
        The number R of rows.
    place : callable
        Where a row stands, from its number: ``line 12``.
    metadata : dict of bytes to bytes
        A Parquet file's own.
    """

    source: str
    header: tuple[str, ...]
    rows: int
    place: Callable[[int], str]
    metadata: dict[bytes, bytes]
    _numbers: Callable[[str], Floats]
    _words: Callable[[str], list[str]]

    def __contains__(self, name: str) -> bool:
        return name in self.header

    def numbers(self, name: str) -> Floats:
        """A column of numbers (R,), NaN where there is none. Raises TableError naming what is no number."""
        return self._numbers(name)

    def words(self, name: str) -> list[str]:
        """A column of words (R), "" where there is none; numbers as they are written."""
        return self._words(name)


def read_long(path: Path, required: Sequence[str], optional: Sequence[str] = ()) -> LongTable:
    """The wanted columns of a Parquet file (by its first bytes) or else of a delimited text.

    Raises TableError naming file, line and column: no such file or column, a column twice, lines of other lengths.
    """
    data = read_bytes(path, TableError)
    if data[:4] == b"PAR1":
        try:
            table = pq.ParquetFile(pa.BufferReader(data), page_checksum_verification=True).read()
        except PARQUET_FAULTS as problem:
            raise TableError(damaged_parquet(str(path), problem)) from problem
        return of_arrow(table, str(path), required)
    cells = take_apart(str(path), data, required, TableError)
    wanted = [*required, *(c for c in optional if c in cells.header)]
    _once(str(path), cells.header, wanted)
    found = cells.fields(wanted)

    def numbers(name: str) -> Floats:
        return Numbers(cells, {name: found.columns[name]}, found.lines).column(name)

    def words(name: str) -> list[str]:
        return [f[1:] if f[:1] == "'" and f[1:2] in ("'", *FORMULA) else f for f in found.columns[name]]

    def place(row: int) -> str:
        return f"line {found.lines[row]}"

    return LongTable(str(path), cells.header, len(found.lines), place, {}, numbers, words)


def of_frame(table: Any, source: str, required: Sequence[str]) -> LongTable:
    """The wanted columns of a DataFrame: pandas', polars', or anything that Arrow takes.

    Raises WrongTypeError for what is no table, TableError for a column that is not there.
    """
    try:
        arrow = table if isinstance(table, pa.Table) else pa.table(_plain(table))
    except (TypeError, ValueError, NotImplementedError) as problem:
        why = next(iter(str(problem).splitlines()), "no columns")
        said = f"a {type(table).__name__} is no table ({why})"
        raise WrongTypeError(
            fault(source, said, "Give a file's name, a DataFrame or an Arrow table")
        ) from problem
    return of_arrow(arrow, source, required)


def _plain(table: Any) -> Any:
    """A pandas frame with its index as columns, where that has names that no column has; anything else as it is."""
    names = getattr(getattr(table, "index", None), "names", None)
    if names is None or not hasattr(table, "reset_index"):
        return table
    columns = [str(c) for c in table.columns]
    new = [n for n in names if n is not None and n not in columns]
    table = table.reset_index(level=new) if new else table
    return table.reset_index(drop=True)


def of_arrow(table: pa.Table, source: str, required: Sequence[str]) -> LongTable:
    """The wanted columns of an Arrow table."""
    header = tuple(table.column_names)
    missing = [c for c in required if c not in header]
    if missing:
        raise TableError(
            fault(source, f"there is no column {', '.join(missing)}", f"The columns are {', '.join(header)}")
        )
    _once(source, header, required)

    def numbers(name: str) -> Floats:
        column = table.column(name)
        try:
            if pa.types.is_boolean(column.type):
                raise pa.ArrowInvalid("truth values")
            return np.asarray(
                column.cast(pa.float64()).to_numpy(zero_copy_only=False), dtype=np.float64
            ).copy()
        except pa.ArrowException as problem:
            said = f"the column is of type {column.type}, not numbers"
            raise TableError(fault(source, said, "Give numbers", place=f"column {name}")) from problem

    def words(name: str) -> list[str]:
        return ["" if v is None else str(v) for v in table.column(name).to_pylist()]

    return LongTable(
        source, header, table.num_rows, lambda row: f"row {row}", table.schema.metadata or {}, numbers, words
    )


def _once(source: str, header: Sequence[str], wanted: Sequence[str]) -> None:
    for name in wanted:
        if header.count(name) > 1:
            problem = f"the column {name} is there {header.count(name)} times"
            raise TableError(fault(source, problem, "Rename all but one"))
