"""Pieces of a recording with gaps: they end where both links are seen on either side, and a gap lies inside one.

A piece then starts from a state that its own samples tell, and what happens in a gap follows from the equations of
motion.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

REACH_S = 0.012
"""Half width of the window of the local cubic that tells a state, s; at least `LEAST` samples a side."""

LEAST = 4
"""Samples of each link on either side of an end, for a cubic through them."""

ENOUGH = 6
"""Least samples of each link in a piece: two for the state, and enough to test it (the compiled part's number)."""


def good_ends(t_s: Floats, phi_rad: Floats) -> NDArray[np.bool_]:
    """Whether both links are seen well on either side of each sample (T,)."""
    step = float(np.median(np.diff(t_s)))
    reach = max(REACH_S, (LEAST + 0.5) * step)
    before, after = np.searchsorted(t_s, t_s - reach), np.searchsorted(t_s, t_s + reach, side="right")
    out = np.ones(t_s.size, dtype=bool)
    at = np.arange(t_s.size)
    for column in phi_rad.T:
        count = np.concatenate([[0], np.cumsum(np.isfinite(column))])
        out &= (count[at] - count[before] >= LEAST) & (count[after] - count[at] >= LEAST)
    return out


def ends_of(t_s: Floats, phi_rad: Floats, span: tuple[float, float], length_s: float) -> Floats | None:
    """Ends of pieces of about ``length_s``, s, each at a good sample; None where the even ones are good already.

    An end that has no good sample within half a length is left out, and its pieces are one.
    """
    count = max(1, round((span[1] - span[0]) / length_s))
    wanted = np.linspace(span[0], span[1], count + 1)
    good = t_s[good_ends(t_s, phi_rad)]
    good = good[(good >= span[0]) & (good <= span[1])]
    if good.size < 2:
        return None
    after = np.searchsorted(good, wanted).clip(1, good.size - 1)
    nearest = np.where(wanted - good[after - 1] < good[after] - wanted, good[after - 1], good[after])
    off = np.abs(nearest - wanted)
    inner = off[1:-1]
    if (inner <= 2 * float(np.median(np.diff(t_s)))).all():
        return None
    ends = nearest[off <= 0.5 * length_s]
    return np.unique(np.concatenate([ends[ends < span[1] - 0.5 * length_s], [span[1]]]))


def state_at(t_s: Floats, phi_rad: Floats, at_s: float) -> Floats:
    """Angles and rates (4,) of both links at a good end, by local cubics; a link that is not measured rests."""
    step = float(np.median(np.diff(t_s)))
    reach = max(REACH_S, (LEAST + 0.5) * step)
    near = slice(*np.searchsorted(t_s, (at_s - reach, at_s + 1.001 * reach)))
    u = (t_s[near] - at_s) / reach
    out = np.zeros(4)
    for j, column in enumerate(phi_rad[near].T):
        seen = np.isfinite(column)
        fit = np.linalg.lstsq(np.vander(u[seen], 4, increasing=True), column[seen], rcond=None)[0]
        out[j], out[2 + j] = fit[0], fit[1] / reach
    return out


def cut_between(
    t_s: Floats, phi_rad: Floats, ends_s: Floats, recording: int, chained: bool
) -> tuple[Ints, Floats, Floats]:
    """Rows (K, 4), times (K, 2) and states (K, 4) of the pieces between ``ends_s``, as the compiled part cuts them.

    Pieces with too few samples of a link are left out, and the chain is broken there.
    """
    rows: list[list[int]] = []
    times: list[tuple[float, float]] = []
    guesses: list[Floats] = []
    for start, stop in zip(ends_s[:-1].tolist(), ends_s[1:].tolist(), strict=True):
        first, last = np.searchsorted(t_s, (start, stop)).tolist()
        if (np.isfinite(phi_rad[first:last]).sum(axis=0) < ENOUGH).any():
            if rows:
                rows[-1][3] = 0
            continue
        rows.append([recording, first, last, int(chained)])
        times.append((start, stop))
        guesses.append(state_at(t_s, phi_rad, start))
    if rows:
        rows[-1][3] = 0
    return (
        np.array(rows, dtype=np.int64).reshape(-1, 4),
        np.array(times, dtype=np.float64).reshape(-1, 2),
        np.array(guesses, dtype=np.float64).reshape(-1, 4),
    )
