"""Cells of text files that have no plain header: numbers with their lines, and libraries that may not be installed."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pydpend.delimited import EMPTY
from pydpend.documents import read_bytes
from pydpend.errors import TableError, fault
from pydpend.plain_text import decoded
from pydpend.raw_tracks import Floats

EXTRA = "tracks"
"""The choice of dependencies that has the libraries of HDF5 and NetCDF."""

DAMAGE = (OSError, RuntimeError, ValueError, KeyError, TypeError, AttributeError, IndexError, OverflowError)
"""Exceptions of HDF5's libraries for a file that is damaged or of another layout."""


def damaged(path: Path, problem: BaseException) -> TableError:
    """The error for a file that a library cannot read, with what that says on one line."""
    said = next(iter(str(problem).splitlines()), type(problem).__name__)
    return TableError(fault(str(path), f"it cannot be read ({said})", "Copy or write it again"))


def lines_of(path: Path) -> list[str]:
    """The lines of a text. Raises TableError if it cannot be read."""
    text = decoded(read_bytes(path, TableError)).lstrip("\ufeff")
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")


def numbers_of(
    source: str,
    rows: Sequence[tuple[int, Sequence[str]]],
    columns: Sequence[str],
    missing: Sequence[str] = (),
) -> Floats:
    """Fields as numbers, NaN where there is none; rows may be shorter than the columns.

    Parameters
    ----------
    source
        The file.
    rows
        Line, from 1, and fields of each of R rows.
    columns
        What each of C columns is called in a message.
    missing
        Words, in small letters, that mean "no value" beside the usual ones.

    Returns
    -------
    ndarray of float, shape (R, C)
        The numbers.

    Raises
    ------
    TableError
        Naming line and column of a field that is no number, or the line of a row with more fields.
    """
    out = np.full((len(rows), len(columns)), np.nan)
    nothing = {*EMPTY, *missing}
    for r, (line, fields) in enumerate(rows):
        extra = [f for f in fields[len(columns) :] if f.strip()]
        if extra:
            problem = f"{len(fields)} fields, and {len(columns)} are expected"
            raise TableError(fault(source, problem, "Repair or remove the line", place=f"line {line}"))
        for c, text in enumerate(fields[: len(columns)]):
            field = text.strip()
            if field.lower() in nothing:
                continue
            try:
                if "_" in field:
                    raise ValueError
                out[r, c] = float(field)
            except ValueError:
                place = f"line {line}, column {columns[c]}"
                problem = f"{field[:40]!r} is not a number"
                raise TableError(
                    fault(source, problem, "Remove the line or leave the field empty", place=place)
                ) from None
    return out


def library(name: str, source: str, what: str, extra: str) -> Any:
    """A library that is not always installed. Raises TableError with the command that installs it."""
    try:
        return importlib.import_module(name)
    except ImportError:
        problem = f"{what} is read by {name}, which is not installed"
        raise TableError(fault(source, problem, f"pip install 'pydpend[{extra}]'")) from None
