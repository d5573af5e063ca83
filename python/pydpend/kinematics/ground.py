"""The ground: which of one or two links turns about a point that stays, where the rig has no pivot."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pydpend.errors import AnglesError, Setting, fault
from pydpend.kinematics.pose import Pose, rotate
from pydpend.kinematics.structure import Structure

FIXED = 0.02
"""A point stays if it moves by less than this part of what the link moves, root mean square: a lens that moves the
corners by 3 % makes up to 1 % of it. In tenths of a second of a drop the upper link's pivot misses by at most 0.5 %,
and that point of the lower link which moves least by at least 5.7 % (docs/validation/robustness.md)."""

NOISE = 3.0
"""Whether it stays is not known from a motion of which `FIXED` is less than so many standard uncertainties of a centre:
the pivot misses by up to two of them."""


LEAST_FRAMES = 10
"""Frames with an angle that are needed to say anything: a point and the place that turns about it are four numbers."""


LEAST_TURN = 1e-3
"""Singular values of the equations for the point, least over largest: about the turn in rad below which any point will
do."""


def check_ground(structure: Structure, poses: Sequence[Pose], label: str) -> list[str]:
    """Notes on the order of one or two links where the rig has no pivot that tells which of them is the upper one.

    Raises :class:`AnglesError` where the motion says that it is the other one.
    """
    links = structure.links
    if len(links) > 2 or any(len(joint.bodies) == 1 for joint in structure.joints):
        return []
    fixed = [_fixed(pose) for pose in poses]
    if fixed[0]:
        return []
    if len(links) == 2 and fixed[1]:
        raise AnglesError(
            fault(
                label,
                f"{links[1]} turns about a point that stays, and {links[0]}, which would be phi1, does not",
                "Name the links from the pivot outwards, with "
                + Setting("bodies")
                + f": {links[1]}, {links[0]}",
            )
        )
    order = " and ".join(f"phi{k + 1} is {name}" for k, name in enumerate(links))
    if fixed[0] is False:
        seen = f"{links[0]} turns about no point that stays, and may hang from a link that was not found"
    else:
        seen = f"{links[0]} turns too little to show one"
    return [f"the rig has no pivot, and {seen}: {order}, and phi1 need not be the upper link's"]


def check_order(structure: Structure, label: str) -> None:
    """Raises :class:`AnglesError` where the rig's pivot says that the second of two links is the upper one."""
    if len(structure.links) != 2:
        return
    first, second = structure.links
    pivots = {joint.bodies[0]: joint.name for joint in structure.joints if len(joint.bodies) == 1}
    if second in pivots and first not in pivots:
        problem = f"the rig's {pivots[second]} is of {second}, and {first}, which would be phi1, turns about no place"
        advice = "Name the links from the pivot outwards, with " + Setting("bodies") + f": {second}, {first}"
        raise AnglesError(fault(label, problem, advice))


def _fixed(pose: Pose) -> bool | None:
    """Whether a link turns about a point that stays; None if it turns too little to say so."""
    seen = np.isfinite(pose.theta_rad) & np.isfinite(pose.centre_px).all(axis=1)
    if seen.sum() < LEAST_FRAMES:
        return None
    theta, centre = pose.theta_rad[seen], pose.centre_px[seen]
    # The point q of the body and the place p: centre + R q = p.
    turned = [rotate(theta, np.array(axis)) for axis in ((1.0, 0.0), (0.0, 1.0))]
    still = np.broadcast_to(-np.eye(2), (theta.size, 2, 2))
    design = np.concatenate([np.stack(turned, axis=2), still], axis=2).reshape(-1, 4)
    found, _, _, singular = np.linalg.lstsq(design, -centre.reshape(-1), rcond=None)
    if singular[-1] < LEAST_TURN * singular[0]:
        return None
    missed = (design @ found + centre.reshape(-1)).reshape(-1, 2)
    misses = float(np.sqrt((missed**2).sum(axis=1).mean()))
    moved = float(np.sqrt(((centre - centre.mean(axis=0)) ** 2).sum(axis=1).mean()))
    sigma = float(np.median(pose.markers.weight[pose.markers.weight > 0])) ** -0.5
    if misses < NOISE * sigma:
        return True if NOISE * sigma < FIXED * moved else None
    return misses < FIXED * moved
