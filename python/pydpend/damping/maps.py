"""Angle-bias maps: what trackers get wrong at the same angles again and again.

The residual of each link against phi1, phi2 and phi2 - phi1, each a periodic piecewise-linear function,
learned together by ridge regression.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pydpend.damping import shooting
from pydpend.damping.fitted_recording import KNOTS, AngleMaps
from pydpend.damping.shooting import Solution, Track

Floats = NDArray[np.float64]

PRIOR_RAD = np.radians(0.1)
"""Prior standard deviation of a knot's bias; steps between markers are of this size."""


@dataclass(frozen=True, eq=False)
class Maps:
    """Bias of each measured angle, rad, at the knots, (2, 3, KNOTS): link, argument (phi1, phi2, phi2 - phi1)."""

    knots_rad: Floats

    def bias(self, phi_rad: Floats) -> Floats:
        """The bias (T, 2) at measured angles (T, 2), rad."""
        out = np.zeros_like(phi_rad)
        for k, (low, high, part) in enumerate(_places(phi_rad)):
            for j in range(2):
                knots = self.knots_rad[j, k]
                out[:, j] += knots[low] * (1 - part) + knots[high] * part
        return out

    def result(self) -> AngleMaps:
        """The maps as a fit's result has them, in degrees."""
        return AngleMaps(np.degrees(self.knots_rad))

    @classmethod
    def of(cls, maps: AngleMaps) -> Maps:
        """The inverse of `result`."""
        return cls(np.radians(maps.knots_deg))


def _places(phi: Floats) -> list[tuple[NDArray[np.int64], NDArray[np.int64], Floats]]:
    """For each argument: lower and upper knot and the fraction between; samples not seen are put at zero."""
    out = []
    for x in (phi[:, 0], phi[:, 1], phi[:, 1] - phi[:, 0]):
        place = np.nan_to_num(np.mod(x, 2 * np.pi)) * KNOTS / (2 * np.pi)
        low = np.floor(place).astype(np.int64)
        out.append((low % KNOTS, (low + 1) % KNOTS, place - low))
    return out


def corrected(tracks: Sequence[Track], maps: Maps) -> list[Track]:
    """The recordings with the bias taken off."""
    return [(t, phi - maps.bias(phi), sigma) for t, phi, sigma in tracks]


def learn(tracks: Sequence[Track], solution: Solution) -> Maps:
    """Maps from the residuals of a fit to the uncorrected angles ``tracks``."""
    path = shooting.trace(tracks, solution.segments, solution.parameters, solution.clock_scale)
    residual = shooting.residuals(tracks, path, solution.zeros_rad)
    phi = np.empty_like(residual)
    sigma = np.empty_like(residual)
    for r, (_, measured, s) in enumerate(tracks):
        here = path.recording == r
        phi[here], sigma[here] = measured[path.sample[here]], s[path.sample[here]]
    size = 3 * KNOTS
    knots = np.zeros((2, 3, KNOTS))
    places = _places(phi)
    columns = [(k * KNOTS + low, k * KNOTS + high, part) for k, (low, high, part) in enumerate(places)]
    for j in range(2):
        good = np.isfinite(residual[:, j]) & (np.abs(residual[:, j]) < 6 * sigma[:, j])
        weight = good / np.where(good, sigma[:, j], 1.0) ** 2
        # Neighbouring samples see the same bias: they count as one in five, so that the prior keeps its say.
        weight = weight / 5
        value = np.where(good, residual[:, j], 0.0)
        gram = np.zeros(size * size)
        right = np.zeros(size)
        entries = [(low, 1 - part) for low, _, part in columns] + [(high, part) for _, high, part in columns]
        for place, w in entries:
            right += np.bincount(place, weight * w * value, size)
            for other, v in entries:
                gram += np.bincount(place * size + other, weight * w * v, size * size)
        matrix = gram.reshape(size, size) + np.eye(size) / PRIOR_RAD**2
        knots[j] = np.linalg.solve(matrix, right).reshape(3, KNOTS)
        # The mean belongs to the recording's zero.
        knots[j] -= knots[j].mean(axis=1, keepdims=True)
    return Maps(knots)
