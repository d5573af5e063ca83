"""Pivots that the caller points at, for links of one marker that hang from nothing found, held against the motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from pydpend.errors import AnglesError, Setting, fault
from pydpend.kinematics.linkage import Given, Linkage
from pydpend.kinematics.linkage_frames import fit_joints
from pydpend.kinematics.markers import BodyMarkers, sigma_to_image, to_image, to_world
from pydpend.kinematics.pose import Pose
from pydpend.kinematics.shape import GROUND
from pydpend.kinematics.structure import Structure
from pydpend.nodes import Joint, Nodes, Rig

POINTED_AT_PX = 1.0
"""Standard uncertainty of a place that is pointed at in a picture, px."""

ELSEWHERE_PX = 3.0
"""A given pivot may always be this far from the one found, px: a place read off a picture by eye is, now and then."""

ELSEWHERE_SIGMAS = 5.0
"""A given pivot farther from the one found than so many standard uncertainties of their difference is another point:
chance makes one in a hundred thousand."""

STAYS = 3.0
"""A point of a link stays in place if the markers miss it by less than this many times what they miss joints between
links by."""


def with_pivots(
    nodes: Nodes,
    markers: list[BodyMarkers],
    pivot: Sequence[float] | Mapping[str, Sequence[float]] | None,
    mirrored: bool,
) -> tuple[Nodes, dict[str, Given]]:
    """Nodes whose rig has the given pivots, and these in world directions, by the joints' names.

    Raises :class:`AnglesError` for what is no place, a link that is not there, or one that has its joint.
    """
    if pivot is None:
        return nodes, {}
    names = [m.name for m in markers]
    by_link = dict(pivot) if isinstance(pivot, Mapping) else {_only(nodes, markers): pivot}
    joints, given = list(nodes.rig.joints), {}
    for link, place in by_link.items():
        if link not in names:
            raise AnglesError(
                fault(Setting("pivot"), f"there is no link {link!r}", f"The links are {', '.join(names)}")
            )
        x, y, sigma = _numbers(place)
        own = next((j for j in joints if j.bodies == (link,)), None)
        if own is None:
            taken = {j.name for j in joints}
            name = next(n for n in ("pivot", f"pivot_{link}", f"pivot of {link}") if n not in taken)
            own = Joint(name, (link,), x, y)
            joints.insert(0, own)
        world = to_world(np.array([x, y]), nodes.rig, mirrored)
        given[own.name] = Given(world, sigma)
    return replace(nodes, rig=replace(nodes.rig, joints=tuple(joints))), given


def check_pivots(
    before: Rig, nodes: Nodes, poses: list[Pose], given: Mapping[str, Given], mirrored: bool
) -> list[str]:
    """Notes on given pivots that no angle needs.

    ``before``: the rig without them; ``nodes``: with them. Raises :class:`AnglesError` for a pivot that lies farther
    from where the motion puts it than both are uncertain by, or of a link that hangs from another link.
    """
    names = [p.markers.name for p in poses]
    whole = _found(poses, Structure.of(before, names)) if given else None
    notes = []
    for joint in (j for j in nodes.rig.joints if j.name in given):
        link = joint.bodies[0]
        pose = poses[names.index(link)]
        inner = None if whole is None else whole.shape.structure.inner[names.index(link)]
        alone = _found([pose], Structure((link,), (joint,), (joint,), (None,), (), (0,)))
        found, at = alone, joint
        if whole is not None and inner is not None:
            grounded = len(inner.bodies) == 1
            if alone is None or not (grounded or alone.sigma_scale < STAYS * whole.sigma_scale):
                found, at = whole, inner
        if found is not None:
            _check_place(found, at, pose, nodes.rig, given[joint.name], mirrored)
        if not pose.is_alone:
            notes.append(f"{_needless(pose)}; the given one serves the picture's vertical and the linkage")
    return notes


def _found(poses: list[Pose], structure: Structure) -> Linkage | None:
    """The joints by the motion alone; ``None`` where that does not tell them."""
    try:
        return fit_joints(poses, structure)
    except AnglesError:
        return None


def _needless(pose: Pose) -> str:
    """The words for a link whose angle is by its own markers."""
    return f"the angle of {pose.markers.name} is by its {len(pose.markers.nodes)} markers and needs no pivot"


def _check_place(found: Linkage, joint: Joint, pose: Pose, rig: Rig, given: Given, mirrored: bool) -> None:
    """Raises AnglesError for a given pivot away from a joint that was found, or where that is one between links."""
    shape, link = found.shape, pose.markers.name
    j = shape.joint(joint.name)
    place = shape.joints[j] @ shape.vectors_px
    there, said = (
        ", ".join(f"{v:.1f}" for v in to_image(xy, rig, mirrored)) for xy in (place, given.place_px)
    )
    q = next((q for i, side, q in shape.ends if i == j and side == GROUND), None)
    if q is None:
        other = next(b for b in joint.bodies if b != link)
        problem = (
            f"the pivot of {link} was given at ({said}), but {link} hangs from {other}, at ({there}) in the reference "
            "picture, and at no fixed place"
        )
    else:
        sigma = found.vector_sigma_px(q)
        off = float(np.hypot(*(place - given.place_px)))
        least = float(np.hypot(sigma.max(), given.sigma_px))
        if off <= max(ELSEWHERE_PX, ELSEWHERE_SIGMAS * least):
            return
        own = " and ".join(f"{v:.2g}" for v in sigma_to_image(sigma, rig))
        problem = (
            f"the pivot of {link} was given at ({said}) +- {given.sigma_px:.3g} px, and by the motion it is at "
            f"({there}) +- {own} px, {off:.3g} px from there"
        )
    advice = "Leave " + Setting("pivot") + " out"
    if pose.is_alone:
        advice = advice + ", or say how well the place is known: x, y and its standard uncertainty, px"
    else:
        advice = advice + f": {_needless(pose)}"
    raise AnglesError(fault(Setting("pivot"), problem, advice))


def _only(nodes: Nodes, markers: list[BodyMarkers]) -> str:
    """The link that is meant by a place without a name: the only one of one marker without a joint, or the first."""
    hung = {b for j in nodes.rig.joints for b in j.bodies}
    single = [m.name for m in markers if len(m.nodes) == 1 and m.name not in hung]
    return single[0] if len(single) == 1 else markers[0].name


def _numbers(place: Sequence[float]) -> tuple[float, float, float]:
    try:
        values = [float(v) for v in place]
    except (TypeError, ValueError):
        values = []
    if len(values) == 2:
        values.append(POINTED_AT_PX)
    if len(values) != 3 or not np.isfinite(values).all() or not values[2] > 0:
        raise AnglesError(
            fault(
                Setting("pivot"),
                f"{place!r} is no place",
                "Give x and y, px in the picture, and if known their standard uncertainty: 320.5,80 or 320.5,80,0.3",
            )
        )
    return values[0], values[1], values[2]
