"""The scale of a picture from distances that are known, averaged and compared."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pydpend.errors import AnglesError, Setting, fault
from pydpend.kinematics.table import Floats

APART = 3.0
"""Two scales that differ by more than so many of their standard uncertainties are told."""

CHANGES = 5.0
"""A distance that scatters by so many times its noise is not constant."""


@dataclass(frozen=True, eq=False)
class Measured:
    """A point in world px: place (T, 2) or (2,), standard uncertainty (T,) or (), and the link or links of it."""

    xy_px: Floats
    sigma_px: Floats
    on: str | tuple[str, ...]


@dataclass(frozen=True)
class Known:
    """A distance that is known, m, and as it is in the picture, px, each with its standard uncertainty."""

    word: str
    length_m: float
    sigma_m: float
    length_px: float
    sigma_px: float

    @property
    def scale(self) -> float:
        """Metres per px."""
        return self.length_m / self.length_px

    @property
    def sigma(self) -> float:
        """Its standard uncertainty, m per px."""
        return self.scale * math.hypot(self.sigma_m / self.length_m, self.sigma_px / self.length_px)

    @staticmethod
    def of(word: str, value: float | Sequence[float], points: Mapping[str, Measured]) -> Known:
        """The distance between two points, from words and numbers of a caller.

        Raises :class:`AnglesError` for points that are not there, a length that cannot be, a distance that changes.
        """
        cuts = [(word[:i], word[i + 1 :]) for i, c in enumerate(word) if c == "-"]
        ends = [cut for cut in cuts if cut[0] in points and cut[1] in points]
        if len(ends) != 1:
            advice = f"Give two of {', '.join(points)}, or places in px, as n0-n3 or 10,20-410,22"
            raise AnglesError(fault(Setting("scale"), f"{word!r} names no two points", advice))
        length, sigma = _length(word, value)
        one, other = (points[name] for name in ends[0])
        apart = np.hypot(*np.moveaxis(np.atleast_2d(one.xy_px - other.xy_px), -1, 0))
        noise = np.broadcast_to(np.hypot(one.sigma_px, other.sigma_px), apart.shape)
        seen = np.isfinite(apart)
        if not seen.any():
            raise AnglesError(fault(Setting("scale"), f"{word}: they are never seen together", "Name others"))
        mean, scatter = float(apart[seen].mean()), float(apart[seen].std())
        expected = float(np.sqrt(np.mean(noise[seen] ** 2)))
        if scatter > max(CHANGES * expected, 1e-3 * mean) or not mean > 0:
            raise AnglesError(
                fault(
                    Setting("scale"),
                    f"{word}: their distance goes from {apart[seen].min():.4g} to {apart[seen].max():.4g} px",
                    "Name two points of one link, or of the ground",
                )
            )
        # Places that are pointed at, and joints, err alike in all frames.
        still = any(p.xy_px.ndim == 1 or isinstance(p.on, tuple) for p in (one, other))
        error = expected if still else max(scatter, expected) / math.sqrt(np.count_nonzero(seen))
        return Known(word, length, sigma, mean, error)


def _length(word: str, value: float | Sequence[float]) -> tuple[float, float]:
    """A length and its standard uncertainty, m; half a unit of the last digit, evenly spread, where none is given."""
    numbers = [value] if isinstance(value, (int, float)) else list(value)
    try:
        length, *rest = (float(v) for v in numbers)
    except (TypeError, ValueError):
        length, rest = math.nan, []
    sigma = rest[0] if rest else last_digit(repr(length)) / math.sqrt(12)
    if not (math.isfinite(length) and length > 0 and math.isfinite(sigma) and sigma >= 0) or len(rest) > 1:
        raise AnglesError(
            fault(
                Setting("scale"),
                f"{word}: {value!r} is no length",
                "Give metres, and if it is known their standard uncertainty: 0.1719 or 0.1719,0.0002",
            )
        )
    return length, sigma


def last_digit(text: str) -> float:
    """A unit of the last digit of a number as it is written: 0.001 of ``0.170``, 1e-5 of ``1.2e-4``."""
    match = re.fullmatch(r"[-+]?\d*\.?(\d*)(?:e([-+]?\d+))?", text.strip().lower())
    if match is None:
        return 0.0
    return float(10.0 ** (int(match[2] or 0) - len(match[1])))


def scale_of(known: Sequence[Known]) -> tuple[dict[str, Any], list[str]]:
    """The mean scale, m per px, with its standard uncertainty, and notes where distances disagree.

    Where they scatter by more than their uncertainties, that of the mean is larger by as much (Birge, Physical Review
    40 (1932) 207).
    """
    values, sigmas = np.array([k.scale for k in known]), np.array([k.sigma for k in known])
    weight = 1 / np.maximum(sigmas, 1e-9 * values) ** 2
    mean = float((weight * values).sum() / weight.sum())
    error = float(weight.sum() ** -0.5)
    dof = len(known) - 1
    birge = math.sqrt(float((weight * (values - mean) ** 2).sum()) / dof) if dof else 1.0
    notes = []
    for i, one in enumerate(known):
        for other in known[:i]:
            off = abs(one.scale - other.scale)
            if off > APART * math.hypot(one.sigma, other.sigma):
                each = [
                    f"{k.word} gives {1e3 * k.scale:.6g} +- {1e3 * k.sigma:.2g} mm a px" for k in (other, one)
                ]
                notes.append(f"two scales disagree: {' and '.join(each)}; the mean's uncertainty says so")
    meta = {
        "m_per_px": mean,
        "sigma_m_per_px": error * max(1.0, birge),
        "from": [
            {"distance": k.word, "m": k.length_m, "px": k.length_px, "m_per_px": k.scale, "sigma": k.sigma}
            for k in known
        ],
    }
    return meta, notes
