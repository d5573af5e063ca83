"""Angles counted on over whole turns, through frames in which a link was hidden.

Between neighbouring frames a link is taken to turn less than half a turn. Over a gap the turn is counted
with the rates on both sides, and refused where they cannot decide: a link that turns at ``w`` may lose a
turn in a gap longer than ``pi / |w|``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pydpend.kinematics.table import Floats

RATE_SAMPLES = 8
"""Rates beside a gap come from a straight line or parabola through up to this many frames."""

RATE_REACH = 4
"""The frames before a gap may lie this many times as far back as they would without gaps: a link seen in single
frames between short gaps still has a rate."""

_BLOCK_S = 0.02
"""Accelerations are judged from mean rates over this long, s: shorter ones are mostly noise."""


@dataclass(frozen=True)
class Gap:
    """A stretch in which a link was not seen and its turn could not be counted.

    ``before`` and ``after`` are the rows on its two sides; ``limit_s`` is the longest gap that would have
    done.
    """

    before: int
    after: int
    length_s: float
    limit_s: float


def unwrap(t_s: Floats, wrapped_rad: Floats) -> tuple[Floats, list[Gap]]:
    """Unwraps one link's angle (T,), NaN where not seen; returns it and the gaps that may have lost a turn.

    A gap of length ``g`` is counted if ``g max|w| <= pi`` with the rates ``w`` on its two sides, and if the
    largest angular acceleration ``a`` of the recording, within the gap and unseen, cannot have added a turn:
    with rates known on both sides the angle between them can stray by at most ``a g^2 / 16`` from the mean of
    both rates, with one by ``a g^2 / 2``; either must stay below a quarter turn. Over a gap that is not
    counted the nearest turn is taken, so that the caller can refuse or cut there.
    """
    phi = wrapped_rad.copy()
    rows = np.flatnonzero(np.isfinite(wrapped_rad))
    if rows.size < 2:
        return phi, []
    t, angle = t_s[rows], np.unwrap(wrapped_rad[rows])
    step = float(np.median(np.diff(t_s)))
    breaks = np.flatnonzero(np.diff(t) > 1.5 * step)
    lost: list[Gap] = []
    if breaks.size:
        acceleration = _largest_acceleration(t, angle, breaks, step)
        edges = np.concatenate([[0], breaks + 1, [t.size]])
        counted = 0  # from here on every turn is counted
        for k, last in enumerate(breaks):
            first, stop = last + 1, edges[k + 2]
            gap = float(t[first] - t[last])
            near = int(np.searchsorted(t, t[last] - RATE_REACH * RATE_SAMPLES * step))
            start = max(counted, near, last - RATE_SAMPLES + 1)
            before = _rate(t[start : last + 1], angle[start : last + 1], True)
            after = _rate(
                t[first : min(stop, first + RATE_SAMPLES)],
                angle[first : min(stop, first + RATE_SAMPLES)],
                False,
            )
            rates = [r for r in (before, after) if r is not None]
            expected = gap * float(np.mean(rates)) if rates else 0.0
            miss = float(angle[first] - angle[last]) - expected
            turns = round(miss / (2 * np.pi))
            if turns:
                angle[first:] -= turns * 2 * np.pi
            limit = _longest(rates, acceleration)
            if gap > limit:
                lost.append(Gap(int(rows[last]), int(rows[first]), gap, limit))
                counted = int(first)
    phi[rows] = angle
    return phi, lost


def _longest(rates: list[float], acceleration: float) -> float:
    """The longest gap, s, over which the turn is certain."""
    if not rates:
        return 0.0
    fastest = max(abs(r) for r in rates)
    by_rate = np.pi / fastest if fastest > 0 else np.inf
    stray = 16.0 if len(rates) == 2 else 2.0
    by_acceleration = np.sqrt(stray * (np.pi / 2) / acceleration) if acceleration > 0 else np.inf
    return float(min(by_rate, by_acceleration))


def _rate(t: Floats, angle: Floats, at_end: bool) -> float | None:
    """Rate at the end (or start) of a short run: a parabola through five or more points, else a line."""
    if t.size < 2:
        return None
    x = t - (t[-1] if at_end else t[0])
    scale = float(np.abs(x).max())
    powers = np.vander(x / scale, 3 if t.size >= 5 else 2, increasing=True)
    coefficients = np.linalg.lstsq(powers, angle - angle[0], rcond=None)[0]
    return float(coefficients[1] / scale)


def _largest_acceleration(t: Floats, angle: Floats, breaks: NDArray[np.int64], step: float) -> float:
    """The 99.9 % point of |acceleration|, rad/s^2, within the runs between gaps; 0 if none is long enough."""
    block = max(5, round(_BLOCK_S / step))
    if t.size <= 2 * block:
        return 0.0
    run = np.zeros(t.size, dtype=np.int64)
    run[breaks + 1] = 1
    run = np.cumsum(run)
    inside = run[2 * block :] == run[: -2 * block]
    first = angle[block:-block] - angle[: -2 * block]
    second = angle[2 * block :] - angle[block:-block]
    span = (t[2 * block :] - t[: -2 * block]) / 2
    values = np.abs((second - first)[inside] / span[inside] ** 2)
    return float(np.quantile(values, 0.999)) if values.size else 0.0
