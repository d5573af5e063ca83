"""The distance of each marker from its place on its rigid body."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pydpend.kinematics.markers import body_markers
from pydpend.kinematics.pose import fit_pose, rotate
from pydpend.kinematics.table import Floats

if TYPE_CHECKING:
    from pydpend.nodes import Nodes


def misfits(nodes: Nodes) -> Floats:
    """Distance of each node's centre from its template in the body's fitted pose, (T, N), px.

    NaN where the node is not seen, where its body has no pose in that frame, and for a body of one node. The pose
    is fitted to the node itself too, so a distance is smaller than the centre's error, the more so the fewer nodes
    the body shows; with two it is half the error of their distance. Raises
    :class:`~pydpend.errors.AnglesError` for a seen centre without a standard uncertainty.
    """
    out = np.full(nodes.status.shape, np.nan)
    for name in nodes.rig.bodies:
        index = nodes.rig.indices(name)
        if not (np.count_nonzero(nodes.seen[:, index], axis=1) >= 2).any():
            continue
        (markers,) = body_markers(nodes, [name])
        pose = fit_pose(markers)
        expected = pose.centre_px[:, None, :] + rotate(pose.theta_rad[:, None], pose.template_px)
        distance = np.hypot(*np.moveaxis(markers.xy_px - expected, -1, 0))
        out[:, index] = np.where(markers.seen, distance, np.nan)
    return out
