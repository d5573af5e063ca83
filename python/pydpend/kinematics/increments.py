"""The paper's two ways to an angle from one vector (Section 8.2.1), with errors propagated as they really go.

Method 1 (Eqs. 39-40) turns each frame's vector against a reference vector. Method 2 (Eqs. 41-44) adds up the
turns from frame to frame. The paper adds the errors of method 2 up as well, ``T`` times one step's; but
neighbouring steps share a frame, and what the first counts too much the second counts too little (ERRATA 25):

- the same vector in every frame: the sum telescopes and **is** method 1's angle, whatever the number of
frames;
- another vector in every frame: nothing cancels, and the errors walk at random, as the square root of the
  number of frames, not as the number.

What method 2 does lose: the paper's arcsin of the cross product cannot tell a step of 95 degrees from one
of 85. Here each step is the atan2 of cross and dot product, right up to 180 degrees a step. And a step over
a frame in which the vector was not seen is a step all the same, so a gap can lose a turn.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pydpend.errors import AnglesError, fault
from pydpend.kinematics.table import Floats


@dataclass(frozen=True, eq=False)
class Turned:
    """Angle (T,) against the first frame (or a reference), rad, and its standard uncertainty.

    ``sigma_rad`` is propagated with all that frames share. ``summed_rad`` is what the paper's Eq. 44 makes
    of it, the sum of the steps' own uncertainties; ``None`` for method 1, where there is nothing to sum.
    """

    theta_rad: Floats
    sigma_rad: Floats
    summed_rad: Floats | None = None


def vectors_of(xy_px: Floats, i: int, j: int) -> Floats:
    """The vectors (T, 2) from marker ``i`` to marker ``j`` of centres (T, K, 2)."""
    return np.asarray(xy_px[:, j] - xy_px[:, i])


def by_reference(vectors_px: Floats, sigma_px: float, reference_px: Floats | None = None) -> Turned:
    """Method 1: the turn of each vector (T, 2) against the reference, by default the first frame's.

    ``sigma_px``: standard uncertainty of each marker's coordinates, px; a vector's end points have sqrt(2)
    of it together. A given ``reference_px`` counts as exact; the first frame does not, its error is in all
    others. Within (-pi, pi], unwrapped from frame to frame.
    """
    v = _vectors(vectors_px)
    exact = reference_px is not None
    r = v[0] if reference_px is None else np.asarray(reference_px, dtype=np.float64)
    theta = np.unwrap(np.arctan2(r[0] * v[:, 1] - r[1] * v[:, 0], v @ r))
    one = 2 * sigma_px**2 / (v**2).sum(axis=1)
    variance = one + (0.0 if exact else one[0])
    if not exact:
        variance[0] = 0.0
    return Turned(theta, np.sqrt(variance))


def steps(vectors_px: Floats) -> Floats:
    """The turns (T - 1,) from frame to frame, rad, by the atan2 of cross and dot product; right below 180 deg."""
    v = _vectors(vectors_px)
    return _turn(v[:-1], v[1:])


def arcsin_steps(vectors_px: Floats) -> Floats:
    """The paper's Eq. 42: the arcsin of the normalised cross product, wrong for steps beyond 90 degrees.

    Here to show what it loses; nothing else uses it.
    """
    v = _vectors(vectors_px)
    length = np.hypot(v[:, 0], v[:, 1])
    sine = (v[:-1, 0] * v[1:, 1] - v[1:, 0] * v[:-1, 1]) / (length[:-1] * length[1:])
    return np.asarray(np.arcsin(np.clip(sine, -1.0, 1.0)))


def by_increments(vectors_px: Floats, sigma_px: float) -> Turned:
    """Method 2 with one vector (T, 2): the sum of its steps. It telescopes: the error is that of method 1."""
    v = _vectors(vectors_px)
    theta = np.concatenate([[0.0], np.cumsum(steps(v))])
    one = 2 * sigma_px**2 / (v**2).sum(axis=1)
    variance = one + one[0]
    variance[0] = 0.0
    summed = np.concatenate([[0.0], np.cumsum(np.sqrt(one[1:] + one[:-1]))])
    return Turned(theta, np.sqrt(variance), summed)


def by_changing_vectors(xy_px: Floats, pairs: NDArray[np.int64], sigma_px: float) -> Turned:
    """Method 2 with another vector in every step: markers ``pairs[s] = (i, j)`` (T - 1, 2) for step ``s``.

    The uncertainty is exact to first order: in each frame the error of the vector that ends a step is set
    against that of the vector that begins the next; they cancel where both are the same and partly where they
    share a marker.
    """
    xy = np.asarray(xy_px, dtype=np.float64)
    total, k = xy.shape[:2]
    if pairs.shape != (total - 1, 2):
        raise AnglesError(
            fault("pairs", f"of shape {pairs.shape} for {total} frames", "Give one pair a step")
        )
    rows = np.arange(total - 1)
    before = xy[rows, pairs[:, 1]] - xy[rows, pairs[:, 0]]
    after = xy[rows + 1, pairs[:, 1]] - xy[rows + 1, pairs[:, 0]]
    theta = np.concatenate([[0.0], np.cumsum(_turn(before, after))])
    # Derivative of the sum by each marker's place: a step's end counts up, the next one's begin down.
    ends, begins = np.zeros((total, k, 2)), np.zeros((total, k, 2))
    for gradient, vectors, at in ((begins, before, rows), (ends, after, rows + 1)):
        across = np.stack([-vectors[:, 1], vectors[:, 0]], axis=1) / (vectors**2).sum(axis=1)[:, None]
        gradient[at, pairs[:, 1]] += across
        gradient[at, pairs[:, 0]] -= across
    settled = sigma_px**2 * ((ends - begins) ** 2).sum(axis=(1, 2))
    last = sigma_px**2 * (ends**2).sum(axis=(1, 2))
    earlier = np.concatenate([[0.0], np.cumsum(settled)[:-1]])
    variance = earlier + last
    variance[0] = 0.0
    one_step = sigma_px * np.sqrt((begins[:-1] ** 2).sum(axis=(1, 2)) + (ends[1:] ** 2).sum(axis=(1, 2)))
    return Turned(theta, np.sqrt(variance), np.concatenate([[0.0], np.cumsum(one_step)]))


def _turn(before: Floats, after: Floats) -> Floats:
    cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    return np.asarray(np.arctan2(cross, (before * after).sum(axis=1)))


def _vectors(vectors_px: Floats) -> Floats:
    v = np.asarray(vectors_px, dtype=np.float64)
    if v.ndim != 2 or v.shape[1] != 2 or v.shape[0] < 1:
        raise AnglesError(fault("vectors", f"of shape {v.shape}, not (T, 2)", "Give one vector a frame"))
    if not np.isfinite(v).all():
        frame = int(np.flatnonzero(~np.isfinite(v).all(axis=1))[0])
        raise AnglesError(
            fault("vectors", "not seen", "Use frames in which both markers are", place=f"frame {frame}")
        )
    return v
