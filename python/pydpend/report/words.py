"""Numbers as people read them."""

from __future__ import annotations

import re

import numpy as np


def with_sigma(value: float | None, sigma: float | None) -> str:
    """A value and its uncertainty, both to the uncertainty's second digit."""
    if value is None:
        return "–"
    if sigma is None or not sigma > 0:
        return f"{value:.5g}"
    exponent = int(np.floor(np.log10(max(abs(value), sigma))))
    if -3 <= exponent <= 4:
        exponent = 0
    digits = max(0, exponent + 1 - int(np.floor(np.log10(sigma))))
    scale = 10.0**exponent
    text = f"{value / scale:.{digits}f} ± {sigma / scale:.{digits}f}"
    return text if exponent == 0 else f"({text}) × 10{_raised(exponent)}"


def _raised(exponent: int) -> str:
    return str(exponent).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def digits(value: float, count: int = 2) -> str:
    """A number above 0 to so many significant digits, or all before its point."""
    return f"{value:.{max(0, count - 1 - int(np.floor(np.log10(value))))}f}" if value > 0 else f"{value:g}"


def with_squares(unit: str) -> str:
    """``N m s2`` as ``N m s²``, on one line."""
    return unit.replace("s2", "s²").replace(" ", "\u00a0")


def sentence(text: str) -> str:
    """A stage's message as it stands on a page: ±, powers of ten and squares, and a capital where a word begins it."""
    text = re.sub(r"(\d)e([+-]\d+)\b", lambda m: f"{m[1]} × 10{_raised(int(m[2]))}", text)
    text = re.sub(r"(?<=m )s2\b", "s²", text.replace(" +- ", " ± "))
    return text[0].upper() + text[1:] if re.match("[a-z]+ ", text) else text
