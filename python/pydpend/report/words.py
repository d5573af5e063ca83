"""Numbers as people read them."""

from __future__ import annotations

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
    raised = str(exponent).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return text if exponent == 0 else f"({text}) × 10{raised}"


def with_squares(unit: str) -> str:
    """``N m s2`` as ``N m s²``."""
    return unit.replace("s2", "s²")
