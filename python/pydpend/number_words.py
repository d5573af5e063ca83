"""Numbers in the words of an option: ``0.5``, or a list of them as ``0.5,1,2``.

Commas part the numbers of a list and points mark decimals. A word that could be read in two ways is refused.
"""

from __future__ import annotations

import math
import re

from pydpend.errors import OptionError, Setting, fault

_CUT_DECIMALS = re.compile(r"[+-]?\d+,0\d")
"""Digits behind a comma that begin with 0, as decimals do and whole numbers do not: ``12,05``."""


_PAIR = re.compile(r"[+-]?(\d+),(\d+)")
"""Two whole numbers, or one with a decimal comma: ``1,5``."""


def number(word: str) -> float:
    """The number that a word is. Raises ValueError with what is wrong and how to write it."""
    try:
        if "_" in word:
            raise ValueError
        value = float(word)
    except ValueError:
        advice = f". Write {word.replace(',', '.')}" if re.fullmatch(r"[+-]?\d*,\d+", word) else ""
        raise ValueError(f"{word!r} is not a number{advice}") from None
    if not math.isfinite(value):
        raise ValueError(f"{word!r} is not a finite number")
    return value


def numbers(text: str, setting: str, *, is_pair: bool = True) -> list[float]:
    """The numbers of a list with commas, the value of the option ``setting``.

    Parameters
    ----------
    text
        The value.
    setting
        The option's name.
    is_pair
        Whether two whole numbers are what one expects there; else they may be one number with a decimal comma.

    Raises
    ------
        OptionError: if a part is no number, or the commas may be decimal marks.
    """
    cut = _CUT_DECIMALS.search(text)
    if cut is not None:
        raise OptionError(
            fault(
                Setting(setting),
                f"the commas of {text!r} may be decimal marks: {cut[0]} may be one number or two",
                "Write decimals with a point, and commas between the numbers: 0.5,1,2",
            )
        )
    pair = None if is_pair else _PAIR.fullmatch(text.strip())
    if pair is not None:
        raise OptionError(
            fault(
                Setting(setting),
                f"{text!r} may be one number or two",
                f"Write {text.strip().replace(',', '.')}, or {pair[1]}.0,{pair[2]}.0",
            )
        )
    try:
        out = [number(word) for word in text.split(",")]
    except ValueError:
        out = []
    if not out:
        raise OptionError(
            fault(
                Setting(setting),
                f"{text!r} is not a list of numbers",
                "Write decimals with a point, and commas between the numbers: 0.5,1,2",
            )
        )
    return out
