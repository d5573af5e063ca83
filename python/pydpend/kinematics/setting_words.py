"""Lines, pivots and distances in the words of a command line or a file of options."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from pydpend.errors import OptionError, Setting, fault
from pydpend.kinematics.metres import last_digit
from pydpend.number_words import numbers

_UNIT = re.compile(r"\d\s*(mm|cm|dm|m|km|in|inch|ft|px)\b")
"""A number with the unit of a length behind it."""


def axes_in_words(words: Iterable[str]) -> dict[str, str]:
    """The lines of links, ``upper=pivot-elbow``, by the links' names, as `angles` takes them.

    Raises OptionError for words without a link or points, or a link that is named twice.
    """
    return dict(_parted(words, "axis", "a link and two points", "upper=pivot-elbow"))


def pivots_in_words(words: Iterable[str]) -> list[float] | dict[str, list[float]] | None:
    """Places of pivots, ``320,215`` of the only one or ``bob=320,215,0.5``, as `angles` takes them; None without words.

    Raises OptionError for a place that is no list of numbers, a link that is named twice, or several places of which
    one has no link.
    """
    given = list(words)
    if not given:
        return None
    if len(given) == 1 and "=" not in given[0]:
        return numbers(given[0], "pivot")
    parted = _parted(given, "pivot", "a link and its place, where there are several", "bob=320.5,80")
    return {link: numbers(place, "pivot") for link, place in parted}


def scales_in_words(words: Iterable[str]) -> dict[str, tuple[float, ...]] | None:
    """Known distances, ``n0-n3=0.1719`` or with their uncertainty ``n0-n3=0.1719,0.0002``, as `places` takes them.

    A length without an uncertainty is known to half a unit of its last digit as it is written: 0.170 to a millimetre.
    Raises OptionError for words without points or a length, or a distance that is given twice.
    """
    out: dict[str, tuple[float, ...]] = {}
    for points, text in _parted(words, "scale", "two points and their distance in m", "n0-n3=0.1719"):
        unit = _UNIT.search(text)
        if unit is not None:
            advice = f"Write metres, and no unit: {points}=0.1719"
            raise OptionError(fault(Setting("scale"), f"{text!r} has the unit {unit[1]}", advice))
        values = numbers(text, "scale")
        out[points] = tuple(values) if len(values) > 1 else (values[0], last_digit(text) / 12**0.5)
    return out or None


def _parted(words: Iterable[str], setting: str, wanted: str, example: str) -> Sequence[tuple[str, str]]:
    """Each word's two sides of its last equals sign; no name twice."""
    out: dict[str, str] = {}
    for word in words:
        name, equals, value = (part.strip() for part in word.rpartition("="))
        if not (name and equals and value):
            raise OptionError(fault(Setting(setting), f"{word!r} does not name {wanted}", f"Write {example}"))
        if name in out:
            raise OptionError(
                fault(Setting(setting), f"{name} is given twice, {out[name]} and {value}", "Give it once")
            )
        out[name] = value
    return list(out.items())
