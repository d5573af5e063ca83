"""Named columns of numbers out of a CSV or Parquet file, with errors that name file, line and column.

Owns: reading the named columns of a table, Parquet or text, into float64. Knows nothing of what the numbers mean:
:mod:`pydpend.kinematics` and :mod:`pydpend.encoder` do. How text is taken apart is :mod:`pydpend.delimited`'s.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeAlias

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from pydpend.delimited import Cells, Numbers, names_on_first_line, no_column, take_apart
from pydpend.documents import read_bytes, unreadable
from pydpend.errors import Message, PydpendError, Setting, fault
from pydpend.instants import NotInstants, is_instant, seconds_of_arrow, seconds_of_text
from pydpend.units import unit_at_end, unit_called

PARQUET_FAULTS = (pa.ArrowException, OSError, UnicodeDecodeError, KeyError, MemoryError, OverflowError)
"""Errors that pyarrow raises for a Parquet file that is damaged."""

_FIRST_LINE_BYTES = 1 << 16
"""More than the names of any table's columns."""


Optional: TypeAlias = "Sequence[str] | Callable[[Sequence[str]], Sequence[str]] | None"
"""Columns that may be missing: their names, or which of a header's names they are, or all."""


@dataclass(frozen=True, eq=False)
class Columns:
    """The columns that were asked for and found.

    ``values[name]`` is a float64 array of shape (R,), NaN where the file has no value. ``lines`` (R,) is each
    row's line in the text file, from 1, or ``None`` for Parquet. ``header`` is every column name of the file.
    ``first_stamp`` is the date and time from which the seconds of a column of dates are counted, "" without one.
    ``units[name]`` is a column's unit as the row under the header spells it, a known one that does not contradict the
    column's name. ``has_instants``: the times are seconds because they were dates, times of day or durations.
    ``doubt``: what makes the end of a text doubtful, if anything does; it was warned of.
    """

    source: str
    header: tuple[str, ...]
    values: dict[str, NDArray[np.float64]]
    lines: NDArray[np.int64] | None
    metadata: dict[str, str]
    first_stamp: str = ""
    units: dict[str, str] = field(default_factory=dict)
    has_instants: bool = False
    doubt: str = ""

    def place(self, row: int, column: str = "") -> str:
        """The place of a row, for a message: ``line 12, column voltage_v`` or ``row 11, column voltage_v``."""
        where = f"row {row}" if self.lines is None else f"line {int(self.lines[row])}"
        return f"{where}, column {column}" if column else where

    @property
    def rows(self) -> int:
        """The number of rows."""
        return next((v.size for v in self.values.values()), 0)


def read_columns(
    path: Path,
    required: Sequence[str],
    optional: Optional = (),
    *,
    error: type[PydpendError],
    time: str | None = None,
    naming: Setting | None = None,
) -> Columns:
    """Reads the named columns of a Parquet file (by its first four bytes) or else of a delimited text file.

    ``optional`` columns may be missing; a function picks them from the header, ``None`` takes all. The column
    ``time`` may hold dates, times of day or durations: dates become seconds from the first, the others seconds.
    ``naming``: the caller's setting that names columns.

    In text the header is the first line that holds every required name, so notes above it do no harm, nor does a
    line of units below it, nor lines that begin with ``#``, ``%`` or ``//``. Fields are parted by commas, semicolons,
    tabs or, where none of these part the header, by spaces. A decimal comma is read where it cannot be anything else.
    An empty field, ``nan``, ``null`` or ``n/a`` is NaN.

    Raises ``error`` naming file, line and column: no such file, no header with these names, a name twice, a line with
    another number of fields than the header, a field that is not a number or may be two different ones.
    """
    data = read_bytes(path, error)
    if data[:4] == b"PAR1":
        return _parquet(str(path), data, required, optional, error, time, naming)
    return _text(str(path), data, required, optional, error, time, naming)


def column_names(path: Path, error: type[PydpendError]) -> list[str]:
    """Names of a Parquet file's columns, or those on the first line of a text. Raises ``error`` naming the file."""
    try:
        with path.open("rb") as file:
            if file.read(4) != b"PAR1":
                file.seek(0)
                return names_on_first_line(file.read(_FIRST_LINE_BYTES))
            file.seek(0)
            return list(pq.read_schema(file).names)
    except PARQUET_FAULTS as problem:
        if isinstance(problem, OSError) and problem.errno is not None:
            raise error(unreadable(path, problem)) from problem
        raise error(damaged_parquet(str(path), problem)) from problem


def damaged_parquet(name: str, problem: BaseException) -> Message:
    """The message for what pyarrow says of a damaged file, on one line."""
    said = next(iter(str(problem).splitlines()), type(problem).__name__)
    return fault(name, f"the Parquet file is damaged ({said})", "Write or copy the file again")


def _wanted(
    name: str,
    header: Sequence[str],
    required: Sequence[str],
    optional: Optional,
    error: type[PydpendError],
    naming: Setting | None,
    place: str = "",
) -> list[str]:
    """The names that are read, each once in the header."""
    missing = [c for c in required if c not in header]
    if missing:
        raise error(no_column(name, missing, header, naming))
    picked = optional(header) if callable(optional) else optional
    more = header if picked is None else [c for c in picked if c in header]
    wanted = list(dict.fromkeys([*required, *more]))
    for column in wanted:
        if header.count(column) > 1:
            raise error(
                fault(
                    name,
                    f"the column {column} is there {header.count(column)} times",
                    "Rename all but one",
                    place=place,
                )
            )
    return wanted


def _parquet(
    name: str,
    data: bytes,
    required: Sequence[str],
    optional: Optional,
    error: type[PydpendError],
    time: str | None,
    naming: Setting | None,
) -> Columns:
    try:
        file = pq.ParquetFile(pa.BufferReader(data), page_checksum_verification=True)
        header = tuple(file.schema_arrow.names)
    except PARQUET_FAULTS as problem:
        raise error(damaged_parquet(name, problem)) from problem
    wanted = _wanted(name, header, required, optional, error, naming)
    try:
        table = file.read(columns=wanted)
        metadata = {
            k.decode("utf-8", "replace"): v.decode("utf-8", "replace")
            for k, v in (file.schema_arrow.metadata or {}).items()
        }
    except PARQUET_FAULTS as problem:
        raise error(damaged_parquet(name, problem)) from problem
    values: dict[str, NDArray[np.float64]] = {}
    first_stamp, has_instants = "", False
    for column in wanted:
        array = table.column(column)
        instants = seconds_of_arrow(array) if column == time else None
        if instants is not None:
            values[column], first_stamp = instants
            has_instants = True
            continue
        try:
            if pa.types.is_boolean(array.type):
                raise pa.ArrowInvalid("truth values")
            values[column] = np.asarray(
                array.cast(pa.float64()).to_numpy(zero_copy_only=False), dtype=np.float64
            ).copy()
        except pa.ArrowException as problem:
            if pa.types.is_integer(array.type):
                raise error(
                    fault(
                        name,
                        "it has whole numbers above 2^53, which a float64 cannot hold",
                        "Write stamps as the type timestamp, other numbers as float64",
                        place=f"column {column}",
                    )
                ) from problem
            raise error(
                fault(
                    name,
                    f"the column is of type {array.type}, not numbers",
                    "Name a column of numbers",
                    place=f"column {column}",
                )
            ) from problem
    return Columns(name, header, values, None, metadata, first_stamp, {}, has_instants)


def _text(
    name: str,
    data: bytes,
    required: Sequence[str],
    optional: Optional,
    error: type[PydpendError],
    time: str | None,
    naming: Setting | None,
) -> Columns:
    cells = take_apart(name, data, required, error, naming)
    place = f"line {cells.header_line}"
    wanted = _wanted(name, cells.header, required, optional, error, naming, place)
    found = cells.fields(wanted)
    fields, lines = dict(found.columns), found.lines
    values: dict[str, NDArray[np.float64]] = {}
    first_stamp = ""
    has_instants = time in fields and is_instant(next((f for f in fields[time] if f), ""))
    if time is not None and has_instants:
        values[time], first_stamp = _instants(cells, time, fields.pop(time), lines)
    numbers = Numbers(cells, fields, lines)
    values |= {c: numbers.column(c) for c in wanted if c in fields}
    units = {c: u for c, u in found.units.items() if not (c == time and has_instants)}
    for column, spelled in units.items():
        _check_unit(cells, column, spelled, found.units_line)
    rows = np.asarray(lines, dtype=np.int64)
    return Columns(name, cells.header, values, rows, {}, first_stamp, units, has_instants, cells.doubt)


def _check_unit(cells: Cells, column: str, spelled: str, line: int) -> None:
    """Refuses a unit under the header that is not known or contradicts the column's name."""
    unit, (named, of_name) = unit_called(spelled), unit_at_end(column)
    place = f"line {line}, column {column}"
    if unit is None:
        cells.refuse(
            f"the unit {spelled!r} is not known",
            "Write s, ms, us, ns, V, mV, rad, mrad or deg, or remove the line",
            place,
        )
    if of_name is not None and of_name != unit:
        cells.refuse(
            f"the unit is {spelled!r}, and the column's name says {named!r}",
            "Name the column or its unit rightly",
            place,
        )


def _instants(
    cells: Cells, column: str, fields: list[str], lines: list[int]
) -> tuple[NDArray[np.float64], str]:
    try:
        return seconds_of_text(fields)
    except NotInstants as problem:
        raise cells.error(
            fault(
                cells.name,
                str(problem),
                "Write every time alike, as 2024-05-01T12:00:00.250+02:00, or as seconds",
                place=f"line {lines[problem.row]}, column {column}",
            )
        ) from problem
