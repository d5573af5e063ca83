"""Pivots that the caller points at, for links of one marker that hang from nothing found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from pydpend.errors import AnglesError, Setting, fault
from pydpend.kinematics.linkage import Given
from pydpend.kinematics.markers import BodyMarkers, to_world
from pydpend.nodes import Joint, Nodes

POINTED_AT_PX = 1.0
"""Standard uncertainty of a place that is pointed at in a picture, px."""


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
