"""The direction of the links in the picture: where they would hang if the camera stood upright."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pydpend.errors import AnglesError, Setting, fault
from pydpend.kinematics.markers import BodyMarkers, to_world
from pydpend.kinematics.shape import Shape
from pydpend.kinematics.structure import Structure
from pydpend.kinematics.swing import within_half_turn
from pydpend.kinematics.table import Floats

if TYPE_CHECKING:
    from pydpend.nodes import Nodes

ROLL_SIGMA_DEG = 1.0
"""Standard uncertainty of the camera's roll, deg, where none is given: a camera on a tripod set up by eye."""

OFF_CENTRE = 0.2
"""A link's markers say which way it points if their mean is further from its joint than this part of their RMS
distance."""


@dataclass(frozen=True, eq=False)
class Down:
    """For each link the turn from the reference picture at which it points down in the picture.

    ``turn_rad`` (L,): within (-pi, pi], NaN where the link's joint is not known. ``sigma_rad`` (L,): how uncertain the
    link's own direction is. That of a link with two joints is the line through them; that of the last one leads from
    its joint to the mean of its markers, as sure as these lie on a line. ``links``: their names. ``lines``: what their
    directions are those of, as ``pivot-elbow``, or ``pivot-markers`` for the mean of a link's markers.
    """

    turn_rad: Floats
    sigma_rad: Floats
    links: tuple[str, ...]
    lines: tuple[str, ...]

    def off(self, turn_rad: Floats) -> Floats:
        """The distance of turns (L,) from the picture's vertical, rad, within (-pi, pi]; NaN where it is not known."""
        return within_half_turn(turn_rad - self.turn_rad)


def picture_down(shape: Shape | None, nodes: Nodes, markers: list[BodyMarkers], mirrored: bool) -> Down:
    """The turns at which the links point down, by the joints found from the motion, or else by those of the rig."""
    lines = _lines(shape, nodes, markers, mirrored)
    found = [direction(v) for v, _ in lines]
    links = tuple(m.name for m in markers)
    turn, sigma = (np.array(values) for values in zip(*found, strict=True))
    return Down(turn, sigma, links, tuple(name for _, name in lines))


def vertical_zero(down: Down, roll_sigma_rad: float, label: str) -> tuple[Floats, Floats]:
    """The zero (L,) by the picture's vertical and its standard uncertainty (L,), rad.

    Raises :class:`AnglesError` if a link's direction is not known.
    """
    unknown = np.flatnonzero(np.isnan(down.turn_rad))
    if unknown.size:
        raise AnglesError(
            fault(
                label,
                f"the joint of link {down.links[unknown[0]]} is not known, so the picture does not say when it hangs",
                "Put the joint into the rig, name two points of the link with "
                + Setting("axis")
                + ", or give "
                + Setting("zero")
                + " with the links' angles in the rig's reference picture or a recording in which they hang at rest",
            )
        )
    return down.turn_rad, np.hypot(roll_sigma_rad, down.sigma_rad)


def direction(places: Floats | None) -> tuple[float, float]:
    """Turn that brings the mean of ``places`` (K, 2), seen from the joint, to point down, and its uncertainty."""
    if places is None:
        return np.nan, np.nan
    mean = places.mean(axis=0)
    length = float(np.hypot(*mean))
    if not length > OFF_CENTRE * float(np.sqrt((places**2).sum(axis=1).mean())):
        return np.nan, np.nan
    across = places @ np.array([-mean[1], mean[0]]) / length
    count = places.shape[0]
    sigma = float(np.sqrt((across**2).sum() / max(count - 1, 1) / count)) / length
    return float(within_half_turn(np.asarray(-np.pi / 2 - np.arctan2(mean[1], mean[0])))), sigma


def _lines(
    shape: Shape | None, nodes: Nodes, markers: list[BodyMarkers], mirrored: bool
) -> list[tuple[Floats | None, str]]:
    """The places (K, 2) that say where each link points, seen from its upper joint, and what line that is."""
    if shape is not None:
        return [_along(shape, k) for k in range(shape.links)]
    rig = nodes.rig
    structure = Structure.of(rig, [m.name for m in markers])
    at = {j.name: to_world(np.array([j.x_px, j.y_px]), rig, mirrored) for j in structure.joints}
    out: list[tuple[Floats | None, str]] = []
    for body, inner in zip(markers, structure.inner, strict=True):
        outer = [j.name for j in structure.joints if body.name in j.bodies and j is not inner]
        if inner is None:
            out.append((None, ""))
        elif outer:
            out.append(((at[outer[0]] - at[inner.name])[None], f"{inner.name}-{outer[0]}"))
        else:
            out.append((body.reference_px - at[inner.name], f"{inner.name}-markers"))
    return out


def _along(shape: Shape, link: int) -> tuple[Floats | None, str]:
    """The next joint of a link, or its markers, seen from the joint from which it hangs, and the line's name."""
    inner = shape.structure.inner[link]
    if inner is None:
        return None, ""
    outer = [(j, q) for j, k, q in shape.ends if k == link and q >= 0]
    if not outer:
        return shape.local_markers(link), f"{inner.name}-markers"
    j, q = outer[0]
    return shape.vectors_px[[q]], f"{inner.name}-{shape.structure.joints[j].name}"
