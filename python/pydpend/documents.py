"""JSON and TOML files, with errors that name the file, the place in it and what was expected.

Owns: what the file system, the decoder and the parsers raise, as errors of pydpend; the check of each value's type as
it is asked for. Knows nothing of what the values mean: who asks does.
"""

from __future__ import annotations

import json
import math
import re
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from pydpend.errors import Message, PydpendError, Text, fault

MOST_DEEP = 100
"""Tables within tables that a document may have; what pydpend writes has eight."""

_KINDS = {
    dict: "a table",
    list: "a list",
    str: "text",
    bool: "true or false",
    int: "a number",
    float: "a number",
}


@dataclass(frozen=True)
class Table:
    """A table (an object of JSON) of a document and where it stands, for readers that check as they read.

    Each method gives the value under ``key`` if it is of the kind that its name says, and raises ``error`` naming
    file and key if it is missing or something else.
    """

    values: dict[str, Any]
    source: str
    error: type[PydpendError]
    where: str = ""
    advice: Text = ""

    def __contains__(self, key: str) -> bool:
        return self.values.get(key) is not None

    def __iter__(self) -> Iterator[str]:
        return iter(self.values)

    def place(self, key: str | int) -> str:
        """The place of a value: ``holds[2].std_v``."""
        if isinstance(key, int):
            return f"{self.where}[{key}]"
        name = key if key.isprintable() else repr(key)
        return f"{self.where}.{name}" if self.where else name

    def refuse(self, key: str, problem: str, advice: Text = "") -> NoReturn:
        """Raises the document's error for the value under ``key``."""
        raise self.error(fault(self.source, problem, advice or self.advice, place=f"key {self.place(key)}"))

    def _wrong(self, place: str, value: object, wanted: str) -> NoReturn:
        said = repr(value)
        shown = _KINDS.get(type(value), type(value).__name__) if len(said) > 40 or value is None else said
        problem = f"{wanted} is expected, not {'null' if value is None else shown}"
        raise self.error(fault(self.source, problem, self.advice, place=f"key {place}"))

    def _get(self, key: str) -> object:
        if key not in self.values:
            place = f"in {self.where}" if self.where else ""
            raise self.error(fault(self.source, f"there is no key {key}", self.advice, place=place))
        return self.values[key]

    def text(self, key: str) -> str:
        """A text."""
        value = self._get(key)
        return value if isinstance(value, str) else self._wrong(self.place(key), value, "text")

    def flag(self, key: str) -> bool:
        """True or false."""
        value = self._get(key)
        return value if isinstance(value, bool) else self._wrong(self.place(key), value, "true or false")

    def number(self, key: str, *, finite: bool = True) -> float:
        """A number; NaN and infinity only with ``finite=False``."""
        return self._number(self.place(key), self._get(key), finite)

    def number_or_nan(self, key: str) -> float:
        """A number, NaN where there is null or nothing."""
        return self.number(key) if key in self else math.nan

    def _number(self, place: str, value: object, finite: bool = True) -> float:
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            self._wrong(place, value, "a number")
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if finite and not math.isfinite(number):
            self._wrong(place, value, "a finite number")
        return number

    def whole(self, key: str, least: int = 0, most: int = 2**53) -> int:
        """A whole number from ``least`` to ``most``."""
        value = self._get(key)
        if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
            self._wrong(self.place(key), value, f"a whole number from {least} to {most}")
        return value

    def table(self, key: str) -> Table:
        """A table."""
        return self._table(self.place(key), self._get(key))

    def _table(self, place: str, value: object) -> Table:
        if not isinstance(value, dict):
            self._wrong(place, value, "a table")
        return Table(value, self.source, self.error, place, self.advice)

    def tables(self, key: str) -> list[Table]:
        """A list of tables; TOML writes each ``[[key]]``."""
        if isinstance(self.values.get(key), dict):
            self.refuse(key, f"it is one table [{key}] where a list is expected", f"Write [[{key}]]")
        return [self._table(f"{self.place(key)}[{i}]", v) for i, v in enumerate(self.items(key, "tables"))]

    def items(self, key: str, of: str = "values") -> list[Any]:
        """A list."""
        value = self._get(key)
        return value if isinstance(value, list) else self._wrong(self.place(key), value, f"a list of {of}")

    def texts(self, key: str) -> tuple[str, ...]:
        """A list of texts."""
        for i, value in enumerate(self.items(key, "texts")):
            if not isinstance(value, str):
                self._wrong(f"{self.place(key)}[{i}]", value, "text")
        return tuple(self.values[key])

    def numbers_or_nan(self, key: str) -> tuple[float, ...]:
        """A list of numbers, NaN where there is null."""
        return tuple(
            math.nan if v is None else self._number(f"{self.place(key)}[{i}]", v)
            for i, v in enumerate(self.items(key, "numbers"))
        )

    def flags(self, key: str) -> tuple[bool, ...]:
        """A list of truth values."""
        for i, value in enumerate(self.items(key, "truth values")):
            if not isinstance(value, bool):
                self._wrong(f"{self.place(key)}[{i}]", value, "true or false")
        return tuple(self.values[key])

    def array(self, key: str, *shape: int) -> NDArray[np.float64]:
        """Finite numbers in lists within lists, of this shape; -1 stands for any length."""
        nested = self._nested(self.place(key), self._get(key), shape)
        try:
            out = np.array(nested, dtype=np.float64)
        except ValueError:
            self.refuse(key, "its lists are of different lengths")
        # A list that is empty hides the lengths of what it has none of.
        return out.reshape([max(n, 0) for n in shape]) if out.size == 0 else out

    def _nested(self, place: str, value: object, shape: tuple[int, ...]) -> Any:
        if not shape:
            return self._number(place, value)
        if not isinstance(value, list) or (shape[0] >= 0 and len(value) != shape[0]):
            self._wrong(place, value, "a list of numbers" if shape[0] < 0 else f"a list of {shape[0]}")
        return [self._nested(f"{place}[{i}]", v, shape[1:]) for i, v in enumerate(value)]


def read_json(path: Path, error: type[PydpendError], advice: Text = "") -> Table:
    """A JSON file that holds a table. ``advice`` says what to do about one that is not as it should be.

    Raises ``error`` naming the file and the line if it cannot be read, is no text or no JSON.
    """
    return parse_json(read_text(path, error, advice), str(path), error, advice)


def parse_json(text: str, source: str, error: type[PydpendError], advice: Text = "") -> Table:
    """`read_json` of text that is in memory; ``source`` names it in messages."""
    try:
        value = json.loads(text)
    except json.JSONDecodeError as problem:
        place = f"line {problem.lineno}, column {problem.colno}"
        raise error(fault(source, f"is not JSON ({_small(problem.msg)})", advice, place=place)) from problem
    except (RecursionError, ValueError) as problem:  # too deep; an integer of thousands of digits
        raise error(fault(source, _beyond(problem), advice)) from problem
    return _root(value, source, error, advice, "JSON")


def read_toml(path: Path, error: type[PydpendError], advice: Text = "") -> Table:
    """A TOML file; as `read_json`."""
    source, text = str(path), read_text(path, error, advice)
    try:
        value = tomllib.loads(text)
    except tomllib.TOMLDecodeError as problem:
        said = re.fullmatch(r"(.*) \(at (line \d+, column \d+|end of document)\)", str(problem), re.DOTALL)
        what, place = said.groups() if said else (str(problem), "")
        raise error(fault(source, f"is not TOML ({_small(what)})", advice, place=place)) from problem
    except (RecursionError, ValueError) as problem:
        raise error(fault(source, _beyond(problem), advice)) from problem
    return _root(value, source, error, advice, "TOML")


def _small(text: str) -> str:
    """A parser's sentence inside one of ours, on one line."""
    return " ".join((text[:1].lower() + text[1:]).split())


def _beyond(problem: Exception) -> str:
    if isinstance(problem, RecursionError):
        return f"its tables and lists stand more than {MOST_DEEP} deep in each other"
    return "a number in it has thousands of digits"


def _root(value: object, source: str, error: type[PydpendError], advice: Text, form: str) -> Table:
    if not isinstance(value, dict):
        kind = _KINDS.get(type(value), "null")
        raise error(fault(source, f"a table is expected, the {form} is {kind}", advice))
    level: list[object] = [value]
    for _ in range(MOST_DEEP):
        level = [
            v
            for held in level
            for v in (held.values() if isinstance(held, dict) else held if isinstance(held, list) else ())
            if isinstance(v, (dict, list))
        ]
        if not level:
            return Table(value, source, error, advice=advice)
    raise error(fault(source, _beyond(RecursionError()), advice))


def read_text(path: Path, error: type[PydpendError], advice: Text = "") -> str:
    r"""The text of a file, UTF-8 or, with a byte order mark, UTF-16; line ends as ``\n``.

    Raises ``error`` naming the file, and the line of what is no text.
    """
    data = read_bytes(path, error, advice)
    encoding = "utf-16" if data[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig"
    try:
        text = data.decode(encoding)
    except UnicodeDecodeError as problem:
        line = data.count(b"\n", 0, problem.start) + 1
        place = f"line {line}, byte {problem.start}"
        raise error(fault(str(path), "is not text in UTF-8", "Save it as UTF-8", place=place)) from problem
    return text.replace("\r\n", "\n").replace("\r", "\n")


def read_bytes(path: Path, error: type[PydpendError], advice: Text = "") -> bytes:
    """All bytes of a file. Raises ``error`` if it cannot be read."""
    try:
        return path.read_bytes()
    except OSError as problem:
        raise error(unreadable(path, problem, advice)) from problem


def unreadable(path: Path, problem: OSError, advice: Text = "") -> Message:
    """The message for a file that the system does not give."""
    return fault(
        str(path), f"the file cannot be read ({problem.strerror or problem})", advice or "Check the path"
    )
