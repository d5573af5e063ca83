"""Angles that are no measurement of the motion: single samples far from where the samples around have the link."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pydpend.damping.noise import high_pass
from pydpend.kinematics import LinkAngles

Floats = NDArray[np.float64]

FAR = 8.0
"""Standard errors, and times the size of the same around (ninth decile over that of noise), that an outlier is off by.
White noise makes no such sample in 1e9; the size around takes in the bends that few frames a second leave out."""

AROUND_S = 0.5
"""Length of the stretch whose decile is taken, s."""

FARTHEST = 6.0
"""Median sample distances over which a sample is told from others: beside a gap it is not."""

ROUNDS = 3
"""Passes: an outlier beside an outlier is seen when that is gone."""

CUBIC = 4
"""Samples on either side through which a cubic goes."""

SIDES = ((-3, -2, -1), (1, 2, 3), (-2, -1, 1, 2))
"""Neighbours from which a sample is told in three ways, by the parabola or cubic through them. A good sample beside one
outlier agrees with at least one of them."""


@dataclass(frozen=True)
class Outlier:
    """A sample that is left out of a fit.

    Attributes
    ----------
    time_s : float
        Its time, s.
    link : int
        Its link, from 1.
    off_rad : float
        By how much it is off the nearest of what its neighbours give, rad.
    """

    time_s: float
    link: int
    off_rad: float


def without_outliers(angles: LinkAngles) -> tuple[LinkAngles, tuple[Outlier, ...]]:
    """Angles with outliers not seen (NaN), and these, in order of time.

    A sample is one if what its neighbours give of it on either side and around (`SIDES`) are all off by more than `FAR`
    times their standard error, and `FAR` times the size of that around (`_usual`). When those are gone, so is one that
    is as far off the cubic through the four samples on either side of it, if it is farther than any of these.
    """
    phi = angles.phi_rad.copy()
    found: list[Outlier] = []
    for j in range(angles.links):
        noise = high_pass(phi[:, j])
        if not (np.isfinite(noise) and noise > 0):
            continue
        for tell in (*[_off] * ROUNDS, *[_off_cubic] * ROUNDS):
            seen = np.flatnonzero(np.isfinite(phi[:, j]))
            if seen.size < 20:
                break
            t = angles.t_s[seen]
            off, score = tell(t, phi[seen, j], noise)
            width = max(9, round(AROUND_S / float(np.median(np.diff(t)))) | 1)
            bad = score > FAR * np.maximum(1.0, _usual(score, width))
            found += [
                Outlier(float(when), j + 1, float(by)) for when, by in zip(t[bad], off[bad], strict=True)
            ]
            phi[seen[bad], j] = np.nan
    if not found:
        return angles, ()
    from dataclasses import replace

    return replace(angles, phi_rad=phi), tuple(sorted(found, key=lambda o: (o.time_s, o.link)))


def _off(t: Floats, x: Floats, noise: float) -> tuple[Floats, Floats]:
    """How far each sample is off the nearest of what its neighbours give, rad, and over the standard error of that."""
    n = t.size
    step = float(np.median(np.diff(t)))
    best, least = np.zeros(n), np.full(n, np.inf)
    for side in SIDES:
        inner = np.arange(max(0, -min(side)), n - max(0, max(side)))
        at = inner[:, None] + np.array(side)
        near = np.abs(t[at] - t[inner, None]).max(axis=1) <= FARTHEST * step
        inner, at = inner[near], at[near]
        weights = _lagrange(t[at], t[inner])
        off = x[inner] - (weights * x[at]).sum(axis=1)
        score = np.abs(off) / (noise * np.sqrt(1 + (weights**2).sum(axis=1)))
        better = score < least[inner]
        best[inner[better]], least[inner[better]] = off[better], score[better]
    # A sample that nothing tells is kept.
    least[~np.isfinite(least)] = 0.0
    return best, least


def _off_cubic(t: Floats, x: Floats, noise: float) -> tuple[Floats, Floats]:
    """As `_off`, from the cubic through `CUBIC` neighbours on either side; 0 for all but the farthest of those."""
    offset = np.concatenate([np.arange(-CUBIC, 0), np.arange(1, CUBIC + 1)])
    design = np.linalg.pinv(np.vander(offset, 4, increasing=True).astype(np.float64))[0]
    inner = np.arange(CUBIC, t.size - CUBIC)
    step = float(np.median(np.diff(t)))
    inner = inner[np.abs(t[inner + CUBIC] - t[inner - CUBIC] - 2 * CUBIC * step) < 0.5 * step]
    off, score = np.zeros(t.size), np.zeros(t.size)
    off[inner] = x[inner] - x[inner[:, None] + offset] @ design
    score[inner] = np.abs(off[inner]) / (noise * np.sqrt(1 + design @ design))
    padded = np.pad(score, CUBIC)
    largest = np.lib.stride_tricks.sliding_window_view(padded, 2 * CUBIC + 1).max(axis=1)
    # The others stay for the decile, below what an outlier is.
    return off, np.where(score >= largest, score, np.minimum(score, FAR))


def _lagrange(nodes: Floats, at: Floats) -> Floats:
    """Weights (N, K) with which values at ``nodes`` (N, K) give the polynomial through them ``at`` (N,)."""
    out = np.ones_like(nodes)
    for k in range(nodes.shape[1]):
        for m in range(nodes.shape[1]):
            if m != k:
                out[:, k] *= (at - nodes[:, m]) / (nodes[:, k] - nodes[:, m])
    return out


def _usual(score: Floats, width: int) -> Floats:
    """Size of the scores around each, over what noise alone makes it: the ninth decile over that of the normal's."""
    half = max(1, width // 2)
    edges = np.arange(0, score.size, half)
    deciles = np.array([np.quantile(score[max(0, a - half) : a + half], 0.9) for a in edges])
    return np.asarray(np.interp(np.arange(score.size), edges, deciles) / 1.645, dtype=np.float64)


def words(name: str, outliers: tuple[Outlier, ...], samples: int) -> tuple[str, ...]:
    """How many samples are left out, and by which rule; empty for none."""
    if not outliers:
        return ()
    most = max(outliers, key=lambda o: abs(o.off_rad))
    count = len(outliers)
    return (
        f"{name}: {count} angle{'s' if count > 1 else ''} of {samples} samples left out as outliers (off by more than "
        f"{FAR:g} standard errors from what the samples before, after and around give; the farthest, phi{most.link} at "
        f"{most.time_s:.3f} s, by {np.degrees(abs(most.off_rad)):.2g} deg)",
    )
