"""How far the two sides of a joint are apart where each body is placed by its own markers."""

from __future__ import annotations

from typing import Any

import numpy as np

from pydpend.kinematics.first_shape import posed
from pydpend.kinematics.linkage import Linkage
from pydpend.kinematics.pose import Pose, rotate
from pydpend.kinematics.shape import GROUND
from pydpend.kinematics.table import Floats

LARGE_GAP = 1.5
"""A gap whose RMS is so many times what the markers' noise explains is told: over many frames none is so by chance."""


def joint_gaps(linkage: Linkage, poses: list[Pose]) -> tuple[list[dict[str, Any]], list[str]]:
    """Of each joint between bodies that have poses, or with the ground, the RMS of its gap, and notes on large ones.

    ``rms_px``: of the two coordinates' distance; ``expected_px``: what the noise of the poses explains.
    """
    shape = linkage.shape
    theta, origin = posed(shape, poses)
    out, notes = [], []
    for j, joint in enumerate(shape.structure.joints):
        sides = [(k, shape.local(q)) for i, k, q in shape.ends if i == j]
        if any(k != GROUND and poses[k].is_alone for k, _ in sides):
            continue
        places = [
            np.broadcast_to(p, origin[:, 0].shape) if k == GROUND else _point(theta, origin, k, p)
            for k, p in sides
        ]
        gap2 = ((places[0] - places[1]) ** 2).sum(axis=1)
        expected2 = sum(_variance(poses[k], theta[:, k], origin[:, k], p) for k, p in sides if k != GROUND)
        both = np.isfinite(gap2) & np.isfinite(expected2)
        if not both.any():
            continue
        rms, expected = (float(np.sqrt(np.mean(v[both]))) for v in (gap2, np.asarray(expected2)))
        closes = joint in shape.structure.loops
        out.append({"name": joint.name, "closes_loop": closes, "rms_px": rms, "expected_px": expected})
        if rms > LARGE_GAP * expected:
            notes.append(
                f"the two sides of {joint.name} are {rms:.3g} px apart (RMS), and the markers' noise explains "
                f"{expected:.3g} px: the joint has play, the links are not in one plane or the lens distorts"
            )
    return out, notes


def _point(theta: Floats, origin: Floats, link: int, local: Floats) -> Floats:
    """A point of a link in each frame by its pose, (T, 2)."""
    return np.asarray(origin[:, link] + rotate(theta[:, link], np.broadcast_to(local, origin[:, link].shape)))


def _variance(pose: Pose, theta: Floats, origin: Floats, local: Floats) -> Floats:
    """Variance (T,) of a point of a body by its pose: the sum of both coordinates'."""
    w = pose.markers.without(~pose.used).weight
    total = np.where(w.sum(axis=1) > 0, w.sum(axis=1), np.nan)
    middle = (w[..., None] * pose.markers.xy_px).sum(axis=1) / total[:, None]
    point = origin + rotate(theta, np.broadcast_to(local, origin.shape))
    arm2 = ((point - middle) ** 2).sum(axis=1)
    return np.asarray(2 * pose.sigma_scale**2 / total + arm2 * pose.sigma_rad**2)
