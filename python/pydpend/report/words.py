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
    text = f"{value / scale:.{digits}f} ± {sigma / scale:.{digits}f}".replace("-", "−")
    return text if exponent == 0 else f"({text}) × 10{_raised(exponent)}"


def quantity(value: float | None, sigma: float | None, unit: str) -> str:
    """`with_sigma` and the unit, which alone may go to a second line."""
    return f"{with_sigma(value, sigma).replace(' ', chr(0xA0))} {unit}".strip()


def _raised(exponent: int) -> str:
    return str(exponent).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def between(low: float | None, high: float | None) -> str:
    """An interval, to what stands for its uncertainty's second digit; an end that is not known is a question mark."""
    known = [v for v in (low, high) if v is not None]
    largest = max(map(abs, known), default=0.0)
    if largest == 0:
        return "?"
    # Four standard errors wide.
    sigma = (high - low) / 4 if low is not None and high is not None and high > low else 0.01 * largest
    exponent = int(np.floor(np.log10(largest)))
    if -3 <= exponent <= 4:
        exponent = 0
    count = max(0, exponent + 1 - int(np.floor(np.log10(sigma))))
    text = " to ".join("?" if v is None else f"{v / 10.0**exponent:.{count}f}" for v in (low, high)).replace(
        "-", "−"
    )
    return text if exponent == 0 else f"({text}) × 10{_raised(exponent)}"


def signed(value: float, count: int) -> str:
    """A number with its sign, to so many significant digits, or all before its point."""
    return ("−" if value < 0 else "+") + digits(abs(value), count)


def listed(parts: list[str]) -> str:
    """``a, b and c``."""
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"


def digits(value: float, count: int = 2) -> str:
    """A number above 0 to so many significant digits, or all before its point."""
    return f"{value:.{max(0, count - 1 - int(np.floor(np.log10(value))))}f}" if value > 0 else f"{value:g}"


def with_squares(unit: str) -> str:
    """``N m s2`` as ``N m s²``, on one line."""
    return re.sub(r"\b([ms])2\b", r"\1²", unit.replace("1/s2", "s⁻²")).replace(" ", "\u00a0")


def sentence(text: str) -> str:
    """A stage's message as it stands on a page: ±, powers of ten and squares, and a capital where a word begins it."""
    text = re.sub(r"(\d)e([+-]\d+)\b", lambda m: f"{m[1]} × 10{_raised(int(m[2]))}", text)
    text = re.sub(r"(?<=m )s2\b", "s²", text.replace(" +- ", " ± "))
    text = re.sub(r"(?<=[ (])-(?=\d)", "−", text)
    return text[0].upper() + text[1:] if re.match("[a-z]+ ", text) else text
