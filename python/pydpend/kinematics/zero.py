"""Rests of a recording: segments in which no link moves.

A link hangs at rest at zero. The rest may be before the release, at the end, or in a recording of its own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pydpend.errors import AnglesError, Setting, fault
from pydpend.kinematics.table import Floats, LinkAngles
from pydpend.series import correlation_time
from pydpend.typed import typed

REST_WITHIN_RAD = np.radians(0.1)
"""At rest, means over :data:`BLOCK_S` stay within this range (or six of their standard errors)."""

REST_AT_LEAST_S = 0.5
"""A rest lasts at least this long: more than half a swing of a hand-sized pendulum's slow mode."""

REPEATS = 0.4
"""Rows that scatter by less than this part of their sigmas repeat one picture rather than taking it anew."""

BLOCK_S = 0.05
"""Rest is looked for in means over this long, s."""


GIVE_ZERO = (
    "Give "
    + Setting("zero", "vertical")
    + " for the picture's vertical, or "
    + Setting("zero")
    + " with the links' angles in the rig's reference picture or a recording in which they hang at rest"
)
"""Advice where a recording has no zero of its own."""


@dataclass(frozen=True, eq=False)
class Rest:
    """A stretch in which no link of L moves.

    Attributes
    ----------
    first, last : int
        Its rows in the angles, both inside.
    start_s, stop_s : float
        Their times, s.
    phi_rad : ndarray of float, shape (L,)
        Mean angles, rad, counter-clockwise positive.
    sigma_rad : ndarray of float, shape (L,)
        Standard errors of the means, rad: scatter over sqrt(rows), rows that hang together counting as fewer. Where
        the rows scatter by far less than their own sigmas, as compressed film of something at rest does, they all
        have one and the same error, and that is it.
    """

    first: int
    last: int
    start_s: float
    stop_s: float
    phi_rad: Floats
    sigma_rad: Floats


@typed()
def find_rest(angles: LinkAngles, at_least_s: float = REST_AT_LEAST_S) -> list[Rest]:
    """The stretches in which every link keeps still, in the order of time.

    Upside down counts as well: which rest hangs, these angles cannot say.

    Parameters
    ----------
    angles : LinkAngles
        Angles of the links.
    at_least_s : float
        Shortest stretch that counts, s.

    Returns
    -------
    list of pydpend.kinematics.Rest
        Empty if there is none.
    """
    if not at_least_s > 0:
        raise AnglesError(fault("at_least_s", f"{at_least_s} is no length", "Give s, above 0"))
    t, phi = angles.t_s, angles.phi_rad
    step = angles.step_s
    if not np.isfinite(step):
        return []
    rows = max(3, round(BLOCK_S / step))
    blocks = t.size // rows
    if blocks < 2:
        return []
    shaped = phi[: blocks * rows].reshape(blocks, rows, -1)
    known = np.isfinite(shaped)
    count = known.sum(axis=1)
    full = (count >= max(2, rows // 2)).all(axis=1)
    # A block with a hole in time is no block of BLOCK_S.
    full &= np.ptp(t[: blocks * rows].reshape(blocks, rows), axis=1) <= 1.5 * rows * step
    safe = np.maximum(count, 1)
    mean = np.where(known, shaped, 0.0).sum(axis=1) / safe
    scatter = np.sqrt(
        (np.where(known, shaped - mean[:, None, :], 0.0) ** 2).sum(axis=1) / np.maximum(count - 1, 1)
    )
    if not full.any():
        return []
    quiet = np.median(scatter[full], axis=0) if full.sum() < 8 else np.quantile(scatter[full], 0.1, axis=0)
    within = np.maximum(REST_WITHIN_RAD, 6.0 * quiet / np.sqrt(rows))
    out: list[Rest] = []
    i = 0
    while i < blocks:
        j = i
        low, high = mean[i].copy(), mean[i].copy()
        while j < blocks and full[j]:
            low, high = np.minimum(low, mean[j]), np.maximum(high, mean[j])
            if (high - low > within).any() or (scatter[j] > 3.0 * quiet + within).any():
                break
            j += 1
        if j > i and t[j * rows - 1] - t[i * rows] + 1.5 * step >= at_least_s:
            out.append(_rest(angles, i * rows, j * rows - 1))
            i = j
        else:
            i += 1
    return out


def _rest(angles: LinkAngles, first: int, last: int) -> Rest:
    part = angles.phi_rad[first : last + 1]
    mean, scatter = np.nanmean(part, axis=0), np.nanstd(part, axis=0, ddof=1)
    together = np.array([correlation_time(column) for column in (part - mean).T])
    own = scatter * np.sqrt(together / np.isfinite(part).sum(axis=0))
    sigma = angles.sigma_rad[first : last + 1]
    stated = np.array([float(np.median(s[np.isfinite(s)])) if np.isfinite(s).any() else 0.0 for s in sigma.T])
    common = np.where(scatter < REPEATS * stated, stated, 0.0)
    return Rest(
        first,
        last,
        float(angles.t_s[first]),
        float(angles.t_s[last]),
        mean,
        np.maximum(own, common),
    )


def zero_of(rests: list[Rest], name: str) -> tuple[Floats, Floats]:
    """The zero (L,) and its standard error (L,) from the rests at which the links hang.

    Their mean, each taken back by whole turns to the first. Where they differ by more than their errors (dry
    friction lets a joint stop a little off), half the difference is the error.

    Raises :class:`AnglesError` if there is no rest, or two that differ by more than 5 degrees.
    """
    if not rests:
        raise AnglesError(
            fault(
                name,
                "no stretch of 0.5 s was found in which all links hang at rest, so there is no zero",
                GIVE_ZERO,
            )
        )
    base = rests[0].phi_rad
    values = np.array([r.phi_rad - 2 * np.pi * np.rint((r.phi_rad - base) / (2 * np.pi)) for r in rests])
    spread = np.ptp(values, axis=0)
    if (spread > np.radians(5.0)).any():
        times = ", ".join(f"{r.start_s:.3g}-{r.stop_s:.3g} s" for r in rests)
        raise AnglesError(
            fault(
                name,
                f"the links rest at angles that differ by {np.degrees(spread.max()):.1f} deg ({times})",
                GIVE_ZERO,
            )
        )
    weight = np.array([r.last - r.first + 1 for r in rests], dtype=np.float64)
    zero = (values * weight[:, None]).sum(axis=0) / weight.sum()
    error = (
        np.sqrt(((weight[:, None] * np.array([r.sigma_rad for r in rests])) ** 2).sum(axis=0)) / weight.sum()
    )
    return zero, np.maximum(error, spread / 2)
