"""Markers that keep their distances, and the camera by which they seem not to: which markers are one rigid body.

A camera that looks at the plane askew, or through a lens, changes a distance with its place and direction, and all
distances by the same few numbers; a joint changes it by far more than noise, and by no such numbers.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pydpend.kinematics.table import Floats

Complex = NDArray[np.complex128]
"""Places in the world, x + i y, px."""

MOST_FRAMES = 1500
"""Frames that distances are looked at in, spread evenly: enough to know a scatter to 2 %."""

LEAST_TOGETHER = 30
"""Frames in which two markers must be seen together for their distance to count."""

TRIMMED = 0.98
"""Part of the deviations that counts: one in 50 may be a wrong place."""

APART = 1.5
"""A distance that scatters by more than this many times its noise is not constant."""

CHANGES = 1.2
"""Limit of the same ratio between markers of which each one's noise is known by its steadiest distance: 1500 frames
know a scatter to 2 %, and the rest is for noise that is not the same everywhere."""

CAMERA_SLACKS = (0.03, 0.01, 0.003)
"""Parts by which a distance may change with its place at first, and after each round in which the camera is fitted: a
camera aimed by eye is some 3 deg askew, which changes distances by some percent over the picture."""

CAMERA_PRIOR = np.array([0.1, 0.1, 0.03, 0.03, 0.1])
"""Standard deviations of cameras, over half a picture's width: scale along x and y, aspect, shear, radial lens."""

BETTER = 0.95
"""The camera's numbers are taken where the scatter of the steadiest distances falls below this part of itself."""


@dataclass(frozen=True, eq=False)
class Distances:
    """How constant the distances of N markers are, and the places by which they are most.

    ``ratio`` (N, N): scatter of each distance over its noise, NaN where the markers are hardly seen together.
    ``factor``: the true noise over the stated one. ``places`` (T, N): with the camera's part taken out. ``camera``: its
    five numbers, or None where there is none to be seen.
    """

    ratio: Floats
    factor: float
    places: Complex
    camera: Floats | None


def distances(places: Complex, sigma: Floats, centre: complex, half_px: float) -> Distances:
    """The distances of places (T, N), NaN where not seen, with standard uncertainties (N,).

    ``centre``, ``half_px``: the picture's middle and half its width, about which a camera distorts.
    """
    rows = _evenly(np.isfinite(places).sum(axis=1) > 1)
    plain = _ratios(places[rows], sigma, 0.0)
    found, numbers = places, np.zeros(CAMERA_PRIOR.size)
    for slack in CAMERA_SLACKS:
        steady = _ratios(found[rows], sigma, slack) < APART
        numbers = numbers + _camera(found[rows], sigma, steady, centre, half_px)
        found = corrected(places, numbers, centre, half_px)
    straight = _ratios(found[rows], sigma, 0.0)
    before, after = _factor(plain), _factor(straight)
    if after < BETTER * before:
        return Distances(straight / after, after, found, numbers)
    return Distances(plain / before, before, places, None)


def corrected(places: Complex, numbers: Floats, centre: complex, half_px: float) -> Complex:
    """The places without what a camera of these numbers does to them, to first order."""
    p = (places - centre) / half_px
    along, across, aspect, shear, lens = numbers
    moved = p * (along * p.real + across * p.imag + lens * np.abs(p) ** 2) + (aspect + 1j * shear) * p.conj()
    return np.asarray(places + half_px * moved)


def grouped(found: Distances) -> list[list[int]]:
    """The markers of each rigid body: all distances within one are constant, the steadiest pairs first."""
    ratio = found.ratio
    # Markers whose noise is larger than the others' are held against their own steadiest distance.
    own = np.clip(np.nanmin(np.where(np.isfinite(ratio), ratio, np.inf), axis=1), 1.0, APART)
    ratio = ratio / np.sqrt((own[:, None] ** 2 + own[None, :] ** 2) / 2)
    groups = [[n] for n in range(len(ratio))]
    pairs = [(ratio[i, j], i, j) for i in range(len(ratio)) for j in range(i) if ratio[i, j] < CHANGES]
    for _, i, j in sorted(pairs):
        one, other = (next(g for g in groups if k in g) for k in (i, j))
        if one is other:
            continue
        across = ratio[np.ix_(one, other)]
        if not (across >= CHANGES).any():
            groups.remove(other)
            one += other
    _settle(groups, ratio)
    return [sorted(g) for g in groups]


def _settle(groups: list[list[int]], ratio: Floats) -> None:
    """Gives each marker to the body from which its distances are steadiest: a first pair may be so by chance."""
    for _ in range(len(ratio)):
        moved = False
        for n in range(len(ratio)):
            costs = []
            for group in groups:
                there = ratio[n, [m for m in group if m != n]]
                known = there[np.isfinite(there)]
                steady = known.size and (known < CHANGES).all()
                costs.append(float((known**2).mean()) if steady else np.inf)
            best, now = int(np.argmin(costs)), next(k for k, group in enumerate(groups) if n in group)
            if costs[best] < costs[now] and len(groups[now]) > 1:
                groups[now].remove(n)
                groups[best].append(n)
                moved = True
        if not moved:
            return


def _evenly(mask: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Rows that count, at most `MOST_FRAMES` of them."""
    rows = np.flatnonzero(mask)
    few = np.unique(np.linspace(0, rows.size - 1, min(rows.size, MOST_FRAMES)).astype(np.intp))
    return np.asarray(rows[few])


def trimmed_rms(values: Floats, part: float = TRIMMED) -> float:
    """Root mean square of this part of the deviations, without the largest, which may be wrong places."""
    square = np.sort(values**2)
    return float(np.sqrt(square[: max(1, int(part * square.size))].mean()))


def _ratios(z: Complex, sigma: Floats, slack: float) -> Floats:
    """Scatter of each distance over its noise and the slack's part of it."""
    count = z.shape[1]
    out = np.full((count, count), np.nan)
    for i in range(count):
        for j in range(i):
            d = np.abs(z[:, i] - z[:, j])
            d = d[np.isfinite(d)]
            if d.size < LEAST_TOGETHER:
                continue
            noise = float(np.sqrt(sigma[i] ** 2 + sigma[j] ** 2 + (slack * d.mean()) ** 2))
            out[i, j] = out[j, i] = trimmed_rms(d - np.median(d)) / noise
    return out


def _factor(ratio: Floats) -> float:
    """The true noise over the stated one: the middle of the markers' steadiest distances."""
    known = ratio[np.isfinite(ratio).any(axis=1)]
    return float(np.median(np.nanmin(known, axis=1))) if len(known) else 1.0


def _camera(z: Complex, sigma: Floats, steady: NDArray[np.bool_], centre: complex, half_px: float) -> Floats:
    """The camera's five numbers under which these pairs' distances change least, (5,)."""
    normal, right = np.diag(CAMERA_PRIOR**-2), np.zeros(CAMERA_PRIOR.size)
    for i, j in zip(*np.nonzero(np.tril(steady)), strict=True):
        step = z[:, i] - z[:, j]
        seen = np.isfinite(step) & (np.abs(step) > 0)
        step, middle = step[seen], ((z[:, i] + z[:, j]) / 2)[seen]
        if step.size < LEAST_TOGETHER:
            continue
        p, u, size = (middle - centre) / half_px, step / np.abs(step), np.abs(step)
        on = (p * u.conj()).real
        slopes = np.stack(
            [
                p.real + on * u.real,
                p.imag + on * u.imag,
                u.real**2 - u.imag**2,
                2 * u.real * u.imag,
                np.abs(p) ** 2 + 2 * on**2,
            ],
            axis=1,
        )
        slopes -= slopes.mean(axis=0)
        change = np.log(size) - np.log(size).mean()
        weight = size.mean() ** 2 / (sigma[i] ** 2 + sigma[j] ** 2)
        # A pair that is none counts no more than what scatters as it does.
        weight /= max(1.0, weight * float((change**2).mean()))
        normal += weight * slopes.T @ slopes
        right -= weight * slopes.T @ change
    return np.asarray(np.linalg.solve(normal, right))
