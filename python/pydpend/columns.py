"""Named columns of numbers out of a CSV or Parquet file, with errors that name file, line and column.

Owns: finding the header, the delimiter and the wanted columns, turning text into numbers. Knows nothing of
what the numbers mean: :mod:`pydpend.angles` and :mod:`pydpend.encoder` do.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from pydpend.errors import PydpendError, fault

_EMPTY = frozenset({"", "nan", "na", "n/a", "null", "none"})
"""Fields (lower case, stripped) that mean "no value"."""

_HEADER_WITHIN = 200
"""A header is looked for in this many lines: loggers write some lines of notes before it."""


@dataclass(frozen=True)
class Columns:
    """The columns that were asked for and found.

    ``values[name]`` is a float64 array of shape (R,), NaN where the file has no value. ``lines`` (R,) is each
    row's line in the text file, from 1, or ``None`` for Parquet. ``header`` is every column name of the file.
    """

    source: str
    header: tuple[str, ...]
    values: dict[str, NDArray[np.float64]]
    lines: NDArray[np.int64] | None
    metadata: dict[str, str]

    def place(self, row: int, column: str = "") -> str:
        """Where a row is, for a message: ``line 12, column voltage_v`` or ``row 11, column voltage_v``."""
        where = f"row {row}" if self.lines is None else f"line {int(self.lines[row])}"
        return f"{where}, column {column}" if column else where

    @property
    def rows(self) -> int:
        """How many rows there are."""
        return next((v.size for v in self.values.values()), 0)


def read_columns(
    path: Path,
    required: Sequence[str],
    optional: Sequence[str] = (),
    *,
    error: type[PydpendError],
) -> Columns:
    """Reads the named columns of a Parquet file (by its first four bytes) or else of a delimited text file.

    In text the header is the first line that holds every required name, so notes above it do no harm, nor does a
    line of units below it. The delimiter is comma, semicolon or tab, with a decimal comma allowed between
    semicolons or tabs. An empty field, ``nan``, ``null`` or ``n/a`` is NaN.

    Raises ``error`` naming file, line and column: no such file, no header with these names, a name twice, a
    line with too few fields, a field that is not a number.
    """
    name = str(path)
    try:
        data = path.read_bytes()
    except OSError as problem:
        raise error(
            fault(name, f"the file cannot be read ({problem.strerror})", "Check the path")
        ) from problem
    if data[:4] == b"PAR1":
        return _parquet(name, data, required, optional, error)
    return _text(name, data, required, optional, error)


def _parquet(
    name: str, data: bytes, required: Sequence[str], optional: Sequence[str], error: type[PydpendError]
) -> Columns:
    try:
        file = pq.ParquetFile(pa.BufferReader(data))
        header = tuple(file.schema_arrow.names)
        _need(name, header, required, error)
        wanted = [*required, *(c for c in optional if c in header)]
        table = file.read(columns=wanted)
        metadata = {
            k.decode("utf-8", "replace"): v.decode("utf-8", "replace")
            for k, v in (file.schema_arrow.metadata or {}).items()
        }
    except pa.ArrowException as problem:
        text = str(problem).splitlines()[0]
        raise error(
            fault(name, f"the Parquet file is damaged ({text})", "Write or copy the file again")
        ) from problem
    values: dict[str, NDArray[np.float64]] = {}
    for column in wanted:
        array = table.column(column)
        try:
            values[column] = np.asarray(
                array.cast(pa.float64()).to_numpy(zero_copy_only=False), dtype=np.float64
            ).copy()
        except pa.ArrowException as problem:
            raise error(
                fault(
                    name,
                    f"the column is of type {array.type}, not numbers",
                    "Name a column of numbers",
                    place=f"column {column}",
                )
            ) from problem
    return Columns(name, header, values, None, metadata)


def _need(name: str, header: Sequence[str], required: Sequence[str], error: type[PydpendError]) -> None:
    missing = [c for c in required if c not in header]
    if missing:
        raise error(
            fault(
                name,
                f"there is no column {', '.join(missing)}",
                f"The columns are {', '.join(header) or '(none)'}; name the right one",
            )
        )


def _text(
    name: str, data: bytes, required: Sequence[str], optional: Sequence[str], error: type[PydpendError]
) -> Columns:
    try:
        text = data.decode("utf-16" if data[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    if "\0" in text[:4096]:
        raise error(
            fault(
                name, "the file is neither Parquet nor text", "Give a CSV or Parquet file with named columns"
            )
        )
    if not text.strip():
        raise error(fault(name, "the file is empty", "Give a CSV file with a header line and rows"))
    header, header_line, delimiter = _find_header(name, text, required, error)
    wanted = [*required, *(c for c in optional if c in header)]
    for column in wanted:
        if header.count(column) > 1:
            raise error(
                fault(
                    name,
                    f"the column {column} is there {header.count(column)} times",
                    "Rename all but one",
                    place=f"line {header_line}",
                )
            )
    index = [header.index(c) for c in wanted]
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter)
    lines: list[int] = []
    units: bool | None = None
    fields: list[list[str]] = [[] for _ in wanted]
    try:
        for row in reader:
            line = reader.line_num
            if line <= header_line or not any(f.strip() for f in row) or row[0].startswith("#"):
                continue
            if len(row) <= max(index):
                raise error(
                    fault(
                        name,
                        f"there are {len(row)} fields, the header has {len(header)}",
                        "Repair or remove the line",
                        place=f"line {line}",
                    )
                )
            if not lines and units is None:
                units = all(_is_word(row[i]) for i in index)
                if units:
                    continue
            lines.append(line)
            for texts, i in zip(fields, index, strict=True):
                texts.append(row[i])
    except csv.Error as problem:
        raise error(
            fault(name, str(problem), "Repair or remove the line", place=f"line {reader.line_num}")
        ) from problem
    comma = delimiter in ";\t"
    values = {c: _numbers(name, c, f, lines, comma, error) for c, f in zip(wanted, fields, strict=True)}
    return Columns(name, tuple(header), values, np.asarray(lines, dtype=np.int64), {})


def _is_word(field: str) -> bool:
    """Whether a field is neither a number nor empty, as the units under a header are."""
    bare = field.strip().lower()
    return bare not in _EMPTY and not any(c.isdigit() for c in bare)


def _find_header(
    name: str, text: str, required: Sequence[str], error: type[PydpendError]
) -> tuple[list[str], int, str]:
    """Column names, the header's line (from 1) and the delimiter."""
    first: list[str] | None = None
    for number, line in enumerate(io.StringIO(text), start=1):
        if number > _HEADER_WITHIN:
            break
        bare = line.strip().lstrip("#").strip()
        if not bare:
            continue
        for delimiter in ",;\t":
            names = [f.strip() for f in next(csv.reader([bare], delimiter=delimiter), [])]
            if first is None and (len(names) > 1 or delimiter == "\t"):
                first = names
            if all(c in names for c in required):
                return names, number, delimiter
    _need(name, first or [], required, error)
    raise error(fault(name, f"no line holds the names {', '.join(required)}", "Give the file a header line"))


def _numbers(
    name: str, column: str, fields: list[str], lines: list[int], comma: bool, error: type[PydpendError]
) -> NDArray[np.float64]:
    try:
        return np.array(fields, dtype=np.float64)
    except ValueError:
        pass  # gaps, decimal commas or a fault: one by one
    out = np.empty(len(fields))
    for i, field in enumerate(fields):
        bare = field.strip()
        if bare.lower() in _EMPTY:
            out[i] = np.nan
            continue
        try:
            out[i] = float(bare.replace(",", ".") if comma else bare)
        except ValueError as problem:
            raise error(
                fault(
                    name,
                    f"{bare!r} is not a number",
                    "Remove the line or leave the field empty",
                    place=f"line {lines[i]}, column {column}",
                )
            ) from problem
    return out
