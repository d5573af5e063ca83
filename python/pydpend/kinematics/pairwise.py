"""The paper's pairwise angles, Eqs. 30-32, made right.

Each pair of markers of a link gives the turn of its connecting vector against a reference. The paper takes
their plain mean; values of different pairs wrap at different angles, so that mean is wrong in 28-40 % of
orientations (ERRATA 26). Here it is the circular mean. The scatter of the pairs (Eq. 32) **is not the error
of the mean**: pairs share markers and have very different lengths; it is given, and the propagated error
beside it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pydpend.errors import AnglesError, Setting, fault
from pydpend.kinematics.markers import BodyMarkers
from pydpend.kinematics.table import Floats


@dataclass(frozen=True, eq=False)
class PairAngles:
    """Pairwise angles of one link over T frames; NaN where fewer than two markers were seen.

    ``mean_rad`` (T,): circular mean, within (-pi, pi]. ``scatter_rad`` (T,): root mean square distance of
    the pairs from it (Eq. 32), what the paper's Figs. 15 and 16 draw. ``sigma_rad`` (T,): standard error of
    the mean, propagated from the markers' uncertainties at that frame; the reference's own error is the
    same in all frames and goes into the zero. ``pairs`` (T,): how many.
    """

    mean_rad: Floats
    scatter_rad: Floats
    sigma_rad: Floats
    pairs: Floats


def pair_angles(markers: BodyMarkers, reference_px: Floats | None = None) -> PairAngles:
    """Pairwise angles against the reference places (K, 2), by default those of the first complete frame.

    If no frame shows every marker, the rig's places are the reference.

    Raises :class:`AnglesError` if the body has one marker only.
    """
    w, xy = markers.weight, markers.xy_px
    total, k = w.shape
    if k < 2:
        raise AnglesError(
            fault(
                "nodes",
                f"the body {markers.name} has one node, so no pair",
                "Use " + Setting("estimator", "rigid") + ", which takes its angle from its joint",
            )
        )
    if reference_px is None:
        complete = np.flatnonzero((w > 0).all(axis=1))
        reference_px = xy[complete[0]] if complete.size else markers.reference_px
    sum_sine, sum_cosine, count = np.zeros(total), np.zeros(total), np.zeros(total)
    gradient = np.zeros((total, k, 2))
    turns: list[tuple[Floats, NDArray[np.bool_]]] = []
    for i in range(k):
        for j in range(i + 1, k):
            both = (w[:, i] > 0) & (w[:, j] > 0)
            p, r = xy[:, j] - xy[:, i], reference_px[j] - reference_px[i]
            turn = np.arctan2(r[0] * p[:, 1] - r[1] * p[:, 0], p @ r)
            turns.append((turn, both))
            sum_sine += np.where(both, np.sin(turn), 0.0)
            sum_cosine += np.where(both, np.cos(turn), 0.0)
            count += both
            length2 = np.where(both, (p**2).sum(axis=1), np.inf)
            across = np.stack([-p[:, 1], p[:, 0]], axis=1) / length2[:, None]
            gradient[:, j] += across
            gradient[:, i] -= across
    some = count > 0
    mean = np.where(some, np.arctan2(sum_sine, sum_cosine), np.nan)
    square = np.zeros(total)
    for turn, both in turns:
        apart = np.angle(np.exp(1j * (turn - mean)))
        square += np.where(both, apart**2, 0.0)
    safe = np.maximum(count, 1)
    variance = np.where(w > 0, (gradient**2).sum(axis=2) / np.where(w > 0, w, 1.0), 0.0).sum(axis=1)
    return PairAngles(
        mean,
        np.where(some, np.sqrt(square / safe), np.nan),
        np.where(some, np.sqrt(variance) / safe, np.nan),
        count,
    )
