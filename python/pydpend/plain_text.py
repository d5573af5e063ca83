"""The text of a file: its characters, and whether its last line is whole."""

from __future__ import annotations

import re
from itertools import pairwise

CUT_OFF = "The file may be cut off there: copy it again, or remove the line"
"""Advice for a last line that has no end and too few fields."""

_OPEN = re.compile(r"[+-]?(\d+[.,]|\d*[.,]?\d+[eE][+-]?|)|[+-]")
"""A number that has begun and has no digit where one is due: ``2.``, ``1e``, ``-``; or nothing."""

_DIGIT = re.compile(r"\d")

_NUMBER = re.compile(r"[+-]?(\d+[.,]?\d*|[.,]\d+)([eE][+-]?\d+)?")

_LEAST = 3
"""Rows above that are needed to say how the numbers of a column are written."""


def decoded(data: bytes) -> str:
    """The text of bytes in UTF-8, UTF-16 with or without its mark, or Latin-1."""
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return data.decode("utf-16", "replace")
    head = data[:512]
    for start, encoding in ((1, "utf-16-le"), (0, "utf-16-be")):
        half = head[start::2]
        # Latin letters and digits in UTF-16 without its mark: every second byte is zero.
        if half and not any(half) and any(head):
            return data.decode(encoding, "replace")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def is_unended(text: str, line: int) -> bool:
    """Whether a line, from 1, is the text's last and has no end."""
    return not text.endswith("\n") and text.count("\n") + 1 == line


def doubt(text: str, header_line: int, delimiter: str) -> str:
    """The doubt about the end of a table, a sentence; empty if there is none.

    Programs that write no end after the last line write it whole: its last field looks like those above it. A number
    with fewer digits than each of these, or with none where one is due, may be the beginning of one. ``delimiter``: a
    space stands for any run of white space.
    """
    lines = text.split("\n")
    if not lines[-1].strip() or len(lines) <= header_line:
        return ""
    separator = None if delimiter == " " else delimiter
    above = [line.split(separator)[-1].strip().strip('"') for line in lines[header_line:-1] if line.strip()]
    last = lines[-1].split(separator)[-1].strip().strip('"')
    numbers = [field for field in above if _NUMBER.fullmatch(field)]
    if len(numbers) < _LEAST or 2 * len(numbers) < len(above):
        return ""
    ends_open = _OPEN.fullmatch(last) is not None and not any(_OPEN.fullmatch(field) for field in above)
    digits = min(len(_DIGIT.findall(field)) for field in numbers)
    is_short = _NUMBER.fullmatch(last) is not None and len(_DIGIT.findall(last)) < digits
    if not (ends_open or is_short or _falls_back(numbers, last)):
        return ""
    said = f"with {last!r}" if last else "without a last field"
    return (
        f"line {len(lines)}: the file ends {said} and no end of the line, unlike all lines above it: it may be cut "
        "off there, and its last number only begun"
    )


def _falls_back(numbers: list[str], last: str) -> bool:
    """Whether a number is less than the one before it, where all before rise."""
    try:
        values = [float(field) for field in (*numbers, last)]
    except ValueError:
        return False
    return values[-1] < values[-2] and all(a < b for a, b in pairwise(values[:-1]))
