"""Delimited text taken apart: which character parts the fields, which marks the decimals, where the header is.

Owns: what a spreadsheet, a logger, LabVIEW or ``numpy.savetxt`` may have written. What could be read in two ways is
refused by its line: a wrong number without a word is the worst that a reader can give.
"""

from __future__ import annotations

import csv
import io
import re
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NoReturn

from pydpend.errors import Message, PydpendError, RecordingWarning, Setting, fault
from pydpend.plain_text import CUT_OFF, decoded, doubt, is_unended
from pydpend.units import unit_at_end

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

EMPTY = frozenset({"", "nan", "na", "n/a", "null", "none"})
"""Fields (lower case, stripped) that mean "no value"."""

_HEADER_WITHIN = 200
"""A header is looked for in this many lines: loggers write some lines of notes before it."""

_COMMENTS = ("#", "%", "//")
"""First character of a line that is not data; a header may begin so too."""

_PARTERS = {",": "commas", ";": "semicolons", "\t": "tabs", " ": "spaces"}

_NO_SEPARATORS = "|:&!~^"
"""Characters that part the fields of some tables, and are not known here."""

_COMMA_NUMBER = re.compile(r"[+-]?(\d+,\d*|,\d+)([eE][+-]?\d+)?")
_MAY_BE_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}[.,]\d{3}")
_BELOW_THOUSAND = re.compile(r"[+-]?\d{1,3}")
_POINTS_IN_MILLIONS = re.compile(r"[+-]?\d{1,3}(\.\d{3}){2,}")

_MINUS = "\N{MINUS SIGN}"
"""The sign that programs with fine typography write for minus; it means nothing else."""
_DASHES = "\N{HYPHEN}\N{NON-BREAKING HYPHEN}\N{FIGURE DASH}\N{EN DASH}\N{EM DASH}\N{HORIZONTAL BAR}"
"""Signs that look like a minus, and may stand for a range or for nothing as well."""
_DOUBLE = re.compile(r"([+-]?(?:\d+[.,]\d*|[.,]\d+))[dD]([+-]?\d+)|([+-]?\d+)[dD]([+-]\d+)")
"""A double of Fortran, ``5.0D+00``. ``5D3`` may be a name."""
_MAY_BE_DOUBLE = re.compile(r"[\d.,][dD][+-]?\d")
"""Part of every such double."""

_WHOLE = re.compile(r"[+-]?\d+")
_SHORT_WHOLE = re.compile(r"[+-]?\d{1,2}")
_POINT_NUMBER = re.compile(r"[+-]?(\d+\.\d*|\.\d+)([eE][+-]?\d+)?")
_DIGITS = re.compile(r"\d+")
_LEADING_ZERO = re.compile(r"0\d+")
_MANY_DECIMALS = 3
"""As many digits as this, right of whole numbers of one or two digits, may be decimals."""
_NOTE_NAME = re.compile(r"|.*(note|comment|remark|bemerkung|kommentar|unnamed|text|label).*", re.IGNORECASE)
_FLAG_NAME = re.compile(r".*(flag|status|quality|valid|marker|event).*", re.IGNORECASE)


@dataclass(frozen=True)
class Cells:
    """A text file with its header found. ``delimiter`` parts the fields; a space stands for any run of white space.

    ``doubt``: what makes its end doubtful, if anything does.
    """

    name: str
    text: str
    header: tuple[str, ...]
    header_line: int
    delimiter: str
    error: type[PydpendError]
    doubt: str = ""

    def refuse(self, problem: str, advice: str, place: str) -> NoReturn:
        """Raises the file's error."""
        raise self.error(fault(self.name, problem, advice, place=place))

    def fields(self, wanted: Sequence[str]) -> Fields:
        """The stripped fields of each wanted column, "" for those without a value, each row's line, and the units.

        Raises the file's error where commas part the fields and may be decimal marks as well.
        """
        index = [self.header.index(c) for c in wanted]
        count = len(index)
        if self.delimiter == ",":
            beside = {j for i in index for j in (i - 1, i + 1) if 0 <= j < len(self.header)}
            index += sorted(beside - set(index))
        out: list[list[str]] = [[] for _ in index]
        lines: list[int] = []
        units: dict[str, str] = {}
        units_line = 0
        units_may_come = True
        width = len(self.header)
        is_odd = _MINUS in self.text or _MAY_BE_DOUBLE.search(self.text) is not None
        for line, row in self._rows():
            if line <= self.header_line or row[0].lstrip().startswith(_COMMENTS):
                continue
            if len(row) != width and not self._only_empty(row):
                self._wrong_width(line, row)
            if not any(f and not f.isspace() for f in row):
                continue
            here = [_plain(row[i].strip()) if is_odd else row[i].strip() for i in index]
            if units_may_come:
                units_may_come = False
                if all(_is_word(f) for f in here[:count]):
                    units, units_line = dict(zip(wanted, here[:count], strict=True)), line
                    continue
            lines.append(line)
            for column, field in zip(out, here, strict=True):
                column.append("" if field.lower() in EMPTY else field)
        if self.delimiter == ",":
            self._refuse_cut_numbers(dict(zip(index, out, strict=True)), set(index[:count]), lines)
        return Fields(dict(zip(wanted, out[:count], strict=True)), lines, units, units_line)

    def _refuse_cut_numbers(self, fields: dict[int, list[str]], wanted: set[int], lines: list[int]) -> None:
        """Refuses whole numbers whose decimals may be the next column's digits: 5,64567 under ``voltage_v,note``."""
        for left in sorted(fields):
            right = left + 1
            if right not in fields or not (left in wanted or right in wanted):
                continue
            whole = [f for f in fields[left] if f]
            if not whole or not all(map(_WHOLE.fullmatch, whole)):
                continue
            row = self._row_of_decimals(
                fields[left], fields[right], right, left in wanted and right not in wanted
            )
            if row is None and left in wanted and right in wanted:
                row = self._row_of_time_decimals(fields, left, wanted)
            # Points elsewhere may be the time's alone; a table has no leading zeros whatever stands elsewhere.
            if row is not None and (_LEADING_ZERO.fullmatch(fields[right][row]) or not self._has_points()):
                self.refuse(
                    f"the commas may be decimal marks: {fields[left][row]},{fields[right][row]} may be one number, or "
                    f"{fields[left][row]} in column {self.header[left]} and {fields[right][row]} in column "
                    f"{self.header[right] or '(no name)'}",
                    "Write decimal points (5.0 for whole numbers too), or semicolons between the fields",
                    f"line {lines[row]}",
                )

    def _row_of_time_decimals(self, fields: dict[int, list[str]], time: int, wanted: set[int]) -> int | None:
        """The first row in which a comma may be a decimal mark of the time; ``None`` where there is none.

        Whole seconds and the value beside them may be one time, 0,125, and the column behind them, which nobody asked
        for, the value.
        """
        value, behind = time + 1, time + 2
        if behind not in fields or behind in wanted or not _is_in_seconds(self.header[time]):
            return None
        given = [row for row, f in enumerate(fields[value]) if f]
        if not all(_DIGITS.fullmatch(f) for column in (value, behind) for f in fields[column] if f):
            return None
        long = [row for row in given if len(fields[value][row]) >= _MANY_DECIMALS and fields[behind][row]]
        return long[0] if long and 2 * len(long) >= len(given) else None

    def _has_points(self) -> bool:
        """Whether any row has a number with a decimal point, so that commas only part fields."""
        return any(
            _POINT_NUMBER.fullmatch(field.strip())
            for line, row in self._rows()
            if line > self.header_line and not row[0].lstrip().startswith(_COMMENTS)
            for field in row
        )

    def _row_of_decimals(
        self, whole: list[str], fields: list[str], column: int, is_cut_from_wanted: bool
    ) -> int | None:
        """The first row in which digits right of whole numbers may be their decimals; ``None`` where they are not."""
        digits = [row for row, f in enumerate(fields) if _DIGITS.fullmatch(f) and whole[row]]
        if not digits:
            return None
        # A table has no leading zeros: decimals do.
        only_digits = all(not f or _DIGITS.fullmatch(f) for f in fields)
        leading = [row for row in digits if _LEADING_ZERO.fullmatch(fields[row])]
        if leading and only_digits:
            return leading[0]
        if not is_cut_from_wanted:
            return None
        if _NOTE_NAME.fullmatch(self.header[column]):
            return digits[0]
        if not only_digits or not all(not f or _SHORT_WHOLE.fullmatch(f) for f in whole):
            return None
        if _FLAG_NAME.fullmatch(self.header[column]):
            return None if all(fields[row] in ("0", "1") for row in digits) else digits[0]
        long = [row for row in digits if len(fields[row]) >= _MANY_DECIMALS]
        return long[0] if 2 * len(long) >= len(digits) else None

    def _rows(self) -> Iterator[tuple[int, list[str]]]:
        if self.delimiter == " ":
            for number, line in enumerate(self.text.split("\n"), 1):
                yield number, line.split() or [""]
        elif '"' not in self.text:
            for number, line in enumerate(self.text.split("\n"), 1):
                yield number, line.split(self.delimiter)
        else:
            # The limit is the module's own and only grows: a long note is no fault.
            csv.field_size_limit(max(csv.field_size_limit(), len(self.text)))
            reader = csv.reader(io.StringIO(self.text, newline=""), delimiter=self.delimiter, strict=True)
            start = 1
            try:
                for row in reader:
                    yield start, row or [""]
                    start = reader.line_num + 1
            except csv.Error as problem:
                said = (
                    "a quote is opened and not closed" if "unexpected end" in str(problem) else str(problem)
                )
                self.refuse(said, "Repair or remove the line", f"line {start}")

    def _only_empty(self, row: list[str]) -> bool:
        """Whether a row has the header's fields and empty ones after them, or may be shorter.

        It may if it is blank, or lacks LabVIEW's comment, which that writes in the first row alone.
        """
        width = len(self.header)
        if len(row) > width:
            return not any(f.strip() for f in row[width:])
        return (
            row == [""]
            or (len(row) == 1 and row[0].isspace())
            or (len(row) == width - 1 and self.header[-1].lower() == "comment")
        )

    def _wrong_width(self, line: int, row: list[str]) -> NoReturn:
        names, parted = len(self.header), _PARTERS[self.delimiter]
        problem = f"{len(row)} fields parted by {parted}, the header in line {self.header_line} has {names}"
        advice = CUT_OFF if is_unended(self.text, line) else "Repair or remove the line"
        if self.delimiter == "," and len(row) > names:
            advice = (
                "If the commas are decimal marks too, write the file with semicolons between the fields or with "
                "decimal points; put text that holds commas in quotes"
            )
        self.refuse(problem, advice, f"line {line}")


@dataclass(frozen=True)
class Fields:
    """The fields of the wanted columns (R each), each row's line, and the row of units under the header, if any."""

    columns: dict[str, list[str]]
    lines: list[int]
    units: dict[str, str]
    units_line: int


def no_column(name: str, missing: Sequence[str], header: Sequence[str], naming: Setting | None) -> Message:
    """The message for columns that a table has not. ``naming``: the caller's setting that names columns."""
    advice = Message.of(f"The columns are {', '.join(header) or '(none)'}; name the right one")
    return fault(
        name,
        f"there is no column {', '.join(missing)}",
        advice if naming is None else advice + " with " + naming,
    )


def take_apart(
    name: str,
    data: bytes,
    required: Sequence[str],
    error: type[PydpendError],
    naming: Setting | None = None,
) -> Cells:
    """The text of a file and its header, the first line that holds every required name. Warns of a doubtful end."""
    text = decoded(data).replace("\r\n", "\n").replace("\r", "\n")
    if "\0" in text[:4096]:
        raise error(
            fault(
                name, "the file is neither Parquet nor text", "Give a CSV or Parquet file with named columns"
            )
        )
    if not text.strip():
        raise error(fault(name, "the file is empty", "Give a CSV file with a header line and rows"))
    header, line, delimiter = _find_header(name, text, required, error, naming)
    said = doubt(text, line, delimiter)
    if said:
        warnings.warn(f"{name}, {said}", RecordingWarning, stacklevel=2)
    return Cells(name, text, header, line, delimiter, error, said)


def names_on_first_line(data: bytes) -> list[str]:
    """The fields of a text's first line, parted by commas."""
    line = decoded(data).lstrip().replace("\r", "\n").partition("\n")[0]
    return _names(line, ",")


def _find_header(
    name: str,
    text: str,
    required: Sequence[str],
    error: type[PydpendError],
    naming: Setting | None,
) -> tuple[tuple[str, ...], int, str]:
    """Column names, the header's line (from 1) and the delimiter."""
    head = text.split("\n", _HEADER_WITHIN)[:_HEADER_WITHIN]
    bare = [line.strip(" \r").lstrip("#%/").strip(" ") for line in head]
    first: list[str] | None = None
    # A sentence above the header may hold the names between spaces, so spaces are tried last.
    for delimiters in (",;\t", " "):
        for number, line in enumerate(bare, start=1):
            for delimiter in delimiters if line.strip() else "":
                names = line.split() if delimiter == " " else _names(line, delimiter)
                if first is None and (len(names) > 1 or delimiter == " "):
                    first = names
                if all(c in names for c in required):
                    return tuple(names), number, delimiter
    for number, line in enumerate(bare, start=1):
        for separator in _NO_SEPARATORS if line else "":
            if separator in line and all(c in [f.strip() for f in line.split(separator)] for c in required):
                raise error(
                    fault(
                        name,
                        f"the fields are parted by {separator!r}, a separator that is not known",
                        "Write the file with commas, semicolons, tabs or spaces between the fields",
                        place=f"line {number}",
                    )
                )
    found = first or []
    if found and all(_is_number(f) for f in found):
        raise error(
            fault(
                name,
                f"there is no header line with the names {', '.join(required)}",
                "Write the names of the columns above the numbers",
                place="line 1",
            )
        )
    missing = [c for c in required if c not in found] or list(required)
    raise error(no_column(name, missing, found, naming))


def _names(line: str, delimiter: str) -> list[str]:
    """The names of a header; separators at its end part nothing."""
    try:
        names = [f.strip() for f in next(csv.reader([line], delimiter=delimiter), [])]
    except csv.Error:  # a note of more than the module's limit
        names = [f.strip() for f in line.split(delimiter)]
    while names and not names[-1]:
        names.pop()
    return names


def _is_in_seconds(name: str) -> bool:
    """Whether a column's name says that it holds times in seconds."""
    unit = unit_at_end(name)[1]
    return name.strip().lower() in ("t", "time") if unit is None else unit.name == "s"


def _plain(field: str) -> str:
    """The field with a typographic minus and the exponent of a double of Fortran as every program writes them."""
    plain = field.replace(_MINUS, "-")
    double = _DOUBLE.fullmatch(plain)
    return plain if double is None else f"{double[1] or double[3]}E{double[2] or double[4]}"


def _is_word(field: str) -> bool:
    """Whether a field is neither a number nor empty, as the units under a header are."""
    bare = field.lstrip(_DASHES)
    return field.lower() not in EMPTY and not re.match(r"[+-]?[.,]?\d", bare) and not _is_number(field)


def _is_number(field: str) -> bool:
    try:
        float(field.replace(",", "."))
    except ValueError:
        return False
    return True


class Numbers:
    """The numbers of a file's fields, with one decimal mark for the whole file."""

    def __init__(self, cells: Cells, fields: Mapping[str, list[str]], lines: Sequence[int]) -> None:
        self._cells, self._fields, self._lines = cells, fields, lines
        self._comma = self._decimal_comma()

    def _at(self, row: int, column: str) -> str:
        return f"line {self._lines[row]}, column {column}"

    def _decimal_comma(self) -> bool:
        """Whether the decimal mark is a comma. Refuses a file that has both marks or may mean thousands."""
        doubtful: tuple[int, str] | None = None
        sure: tuple[int, str] | None = None
        for column, fields in self._fields.items():
            for row, field in enumerate(fields):
                if "," not in field:
                    continue
                if "." in field or field.count(",") > 1:
                    self._cells.refuse(
                        f"{field!r} has marks between thousands",
                        "Write numbers without them",
                        self._at(row, column),
                    )
                if not _COMMA_NUMBER.fullmatch(field):
                    self._not_a_number(row, column)
                if _MAY_BE_THOUSANDS.fullmatch(field):
                    doubtful = doubtful or (row, column)
                else:
                    sure = sure or (row, column)
        if sure is None and doubtful is not None:
            row, column = doubtful
            field = self._fields[column][row]
            self._cells.refuse(
                f"{field!r} may be {field.replace(',', '.')} or {field.replace(',', '')}, and no other number of the "
                "file tells which",
                "Write decimal points, and no marks between thousands",
                self._at(row, column),
            )
        if sure is None:
            self._refuse_thousands_by_points()
            return False
        for column, fields in self._fields.items():
            for row, field in enumerate(fields):
                if "." in field:
                    seen = f"{self._fields[sure[1]][sure[0]]!r} in {self._at(*sure)}"
                    self._cells.refuse(
                        f"{field!r} has a decimal point, {seen} a decimal comma",
                        "Use one decimal mark in the whole file",
                        self._at(row, column),
                    )
        return True

    def _refuse_thousands_by_points(self) -> None:
        """Refuses columns as 1.031, 969: with three decimals here and none there, its points may mean thousands.

        A point that can only be a decimal one, as in 0.5, tells of the whole file. It does not tell of a column with
        1.250 and 969: who writes the last zero of decimals writes them in every row.
        """
        doubtful: list[tuple[str, int, int]] = []
        points_are_decimal = False
        for column, fields in self._fields.items():
            pointed = [row for row, field in enumerate(fields) if "." in field]
            odd = next((row for row in pointed if not _MAY_BE_THOUSANDS.fullmatch(fields[row])), None)
            if odd is not None:
                many = next((row for row in pointed if _POINTS_IN_MILLIONS.fullmatch(fields[row])), None)
                if many is not None:
                    self._cells.refuse(
                        f"{fields[many]!r} has marks between thousands",
                        "Write numbers without them",
                        self._at(many, column),
                    )
                points_are_decimal |= _POINT_NUMBER.fullmatch(fields[odd]) is not None
                continue
            whole = [row for row, field in enumerate(fields) if _WHOLE.fullmatch(field)] if pointed else []
            if whole and all(_BELOW_THOUSAND.fullmatch(fields[row]) for row in whole):
                doubtful.append((column, pointed[0], whole[0]))
        for column, row, beside in doubtful:
            fields = self._fields[column]
            if points_are_decimal and not any("." in f and f.endswith("0") for f in fields):
                continue
            self._cells.refuse(
                f"{fields[row]!r} may be {fields[row]} or {fields[row].replace('.', '')}: each point in the column has "
                f"three digits behind it, and {fields[beside]!r} in line {self._lines[beside]} has no point",
                f"Write no marks between thousands, or every number with its decimals ({fields[beside]}.000)",
                self._at(row, column),
            )

    def _not_a_number(self, row: int, column: str) -> NoReturn:
        field = self._fields[column][row]
        shown = repr(field if len(field) <= 40 else field[:40] + "...")
        advice = "Remove the line or leave the field empty"
        if field[0] in _DASHES:
            shown += f" begins with a dash (U+{ord(field[0]):04X}) that is no minus sign, so it"
            advice = "Write - for minus"
        self._cells.refuse(f"{shown} is not a number", advice, self._at(row, column))

    def column(self, column: str) -> NDArray[np.float64]:
        """The numbers of a column (R,), NaN where there is none."""
        import numpy as np

        fields = [f or "nan" for f in self._fields[column]]
        if self._comma:
            fields = [f.replace(",", ".") for f in fields]
        # Python's own 1_000 and digits of other scripts are no numbers of a data file.
        if all(f.isascii() and "_" not in f for f in fields):
            try:
                return np.array(fields, dtype=np.float64)
            except ValueError:
                pass  # one by one, to find which
        out = np.empty(len(fields))
        for row, field in enumerate(fields):
            try:
                if "_" in field or not field.isascii():
                    raise ValueError
                out[row] = float(field)
            except ValueError:
                self._not_a_number(row, column)
        return out
