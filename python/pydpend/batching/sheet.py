"""The sheet of a batch: a row a recording, its path and the options in which it differs from the others.

Owns: what a laboratory's spreadsheet may have written. Anything that could be meant in two ways is refused by its line.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Mapping
from dataclasses import Field, dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any, NoReturn

from pydpend.analyse.options import all_options
from pydpend.analyse.provenance import FILES
from pydpend.documents import read_text
from pydpend.errors import OptionError, Setting, Text, fault
from pydpend.kinds import kind_of
from pydpend.number_words import number
from pydpend.option_fields import flag_of, kind_of_value

PATH_NAMES = ("path", "film", "recording", "file", "input")
"""Names that the column of the recordings may have."""

NOT_A_COLUMN = {"scale": "Call the column link_length_m and give the distance from pivot to elbow in m"}
"""Names that could be meant in several ways, and what to do about each."""

PARTERS = ",;\t"
_FLAGS = {"true": True, "yes": True, "1": True, "false": False, "no": False, "0": False}
_MAY_BE_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}[.,]\d{3}")
_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d*([eE][+-]?\d+)?")


@dataclass(frozen=True)
class SheetRow:
    """One recording of a sheet."""

    line: int
    path: Path
    """Absolute."""
    options: Mapping[str, Any]
    """Options that the row gives, as `Options` takes them."""
    kept: Mapping[str, str]
    """Columns that are no options, as they stand."""


class _Reader:
    def __init__(self, path: Path, keep: tuple[str, ...]) -> None:
        self.path = path
        self.keep = keep
        self.options: dict[str, Field[Any]] = {f.name: f for f in all_options() if f.name != "inputs"}
        self.names = {flag_of(name)[2:].replace("-", "_"): name for name in self.options}
        self.names |= {name: name for name in self.options}

    def refuse(self, problem: Text, advice: Text, place: str = "") -> NoReturn:
        raise OptionError(fault(str(self.path), problem, advice, place=place))

    def rows(self) -> list[SheetRow]:
        if kind_of(self.path) == "spreadsheet":
            self.refuse("is a spreadsheet's own file", "Save the sheet as CSV")
        text = read_text(self.path, OptionError, "Give " + Setting("sheet") + " the name of a CSV file")
        lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
        if not lines:
            self.refuse("the sheet is empty", "Write a line of names, then a line for each recording")
        self.parter = max(PARTERS, key=lines[0].count)
        table = csv.reader(io.StringIO(text), delimiter=self.parter, skipinitialspace=True)
        header: list[str] | None = None
        columns: list[tuple[str, str]] = []
        out: list[SheetRow] = []
        for cells in table:
            line = table.line_num
            if not any(cell.strip() for cell in cells) or cells[0].startswith("#"):
                continue
            if header is None:
                header = [cell.strip() for cell in cells]
                columns = self._columns(header, line)
                continue
            if len(cells) != len(header) and any(cell.strip() for cell in cells[len(header) :]):
                problem = f"{len(cells)} fields, and the header has {len(header)}"
                self.refuse(problem, "Put a field that holds the separator into quotes", f"line {line}")
            out.append(self._row(line, columns, [cell.strip() for cell in cells]))
        if not out:
            self.refuse("there is no recording below the names of the columns", "Write a line for each")
        return out

    def _columns(self, header: list[str], line: int) -> list[tuple[str, str]]:
        """The meaning of each column: ``path``, ``option`` or ``kept``, and its name."""
        place = f"line {line}"
        words = [re.sub(r"[\s-]+", "_", name.lower()) for name in header]
        while header and not header[-1]:
            header.pop()  # columns without a name at the end, as spreadsheets write them
            words.pop()
        out: list[tuple[str, str]] = []
        for name, word in zip(header, words, strict=True):
            if name in self.keep:
                out.append(("kept", name))
            elif word in PATH_NAMES:
                out.append(("path", "path"))
            elif word in NOT_A_COLUMN:
                self.refuse(f"the column {name} could mean several things", NOT_A_COLUMN[word], place)
            elif word in self.names:
                out.append(("option", self.names[word]))
            elif "all" in self.keep:
                out.append(("kept", name))
            else:
                self._unknown(name, word, place)
        for column in out:
            if out.count(column) > 1:
                self.refuse(f"the column {column[1]} is there twice", "Leave one out", place)
        if ("path", "path") not in out:
            self.refuse("there is no column path", "Name the column of the recordings path", place)
        missing = [name for name in self.keep if name != "all" and name not in header]
        if missing:
            problem = f"there is no column {missing[0]}, which " + Setting("keep") + " names"
            self.refuse(problem, f"Columns are {', '.join(header)}")
        return out

    def _unknown(self, name: str, word: str, place: str) -> NoReturn:
        if not name:
            self.refuse("a column has no name", "Name it, or take it out", place)
        near = get_close_matches(word, list(self.names), 1, 0.6)
        advice: Text = f"Did you mean {near[0]}? If not, take" if near else "Rename it, or take"
        advice = advice + " it into the table as it is with " + Setting("keep", name)
        self.refuse(f"the column {name} is no option of `pydpend analyse`", advice, place)

    def _row(self, line: int, columns: list[tuple[str, str]], cells: list[str]) -> SheetRow:
        path: Path | None = None
        options: dict[str, Any] = {}
        kept: dict[str, str] = {}
        for (what, name), cell in zip(columns, cells, strict=False):
            if what == "kept":
                kept[name] = cell
            elif what == "path":
                path = self._beside(cell) if cell else None
            elif cell:
                options[name] = self._value(name, cell, f"line {line}, column {name}")
        if path is None:
            self.refuse("the path is empty", "Name the recording, or take the line out", f"line {line}")
        return SheetRow(line, path, options, kept)

    def _beside(self, name: str) -> Path:
        """A name as the sheet has it, relative to the sheet."""
        given = Path(name.replace("\\", "/") if "\\" in name and "/" not in name else name).expanduser()
        return given if given.is_absolute() else self.path.absolute().parent / given

    def _value(self, name: str, cell: str, place: str) -> Any:
        match kind_of_value(self.options[name]):
            case "flag":
                if cell.lower() not in _FLAGS:
                    self.refuse(f"{cell!r} is not yes or no", "Write yes or no", place)
                return _FLAGS[cell.lower()]
            case "number" | "whole" as kind:
                return self._number(cell, kind, place)
            case "texts":
                return tuple(cell.split())
        if name in FILES and (there := self._beside(cell)).exists():
            return str(there)
        return cell

    def _number(self, cell: str, kind: str, place: str) -> float | int:
        if self.parter != "," and _MAY_BE_THOUSANDS.fullmatch(cell):
            self.refuse(
                f"{cell} may be {cell.replace(',', '').replace('.', '')} or {cell.replace(',', '.')}",
                "Write it without a mark of thousands, or with another count of decimals",
                place,
            )
        word = cell.replace(",", ".") if self.parter != "," and _DECIMAL_COMMA.fullmatch(cell) else cell
        try:
            value = number(word)
        except ValueError:
            self.refuse(f"{cell!r} is not a number", "Write a number, or leave the field empty", place)
        if kind == "number":
            return value
        if value != int(value):
            self.refuse(f"{cell} is not a whole number", "Write a whole number", place)
        return int(value)


def read_sheet(path: str | Path, keep: tuple[str, ...] = ()) -> list[SheetRow]:
    """The rows of a sheet, each recording once.

    ``keep`` names columns that are no options and are kept as they are, ``all`` every such column. Raises OptionError
    naming file, line and column.
    """
    reader = _Reader(Path(path), keep)
    rows = reader.rows()
    lines: dict[Path, int] = {}
    for row in rows:
        if row.path in lines:
            problem = f"{row.path} is in lines {lines[row.path]} and {row.line}"
            reader.refuse(problem, "Give each recording once")
        lines[row.path] = row.line
    return rows
