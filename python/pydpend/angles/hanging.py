"""What zero follows from what the caller says: a rest that hangs, another recording, or given angles.

Owns: telling a rest that hangs from one held upside down, by where the joints are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from pydpend.angles.linkage import Shape
from pydpend.angles.markers import BodyMarkers, body_markers, to_image
from pydpend.angles.pose import rotate, solve
from pydpend.angles.table import Floats, LinkAngles
from pydpend.angles.unwrap import unwrap
from pydpend.angles.zero import Rest, find_rest, zero_of
from pydpend.errors import AnglesError, Setting, fault

if TYPE_CHECKING:
    from pydpend.nodes import Nodes


@dataclass(frozen=True, eq=False)
class Raw:
    """Turns from the rig's reference frame before unwrapping, (T, L), and what they came from."""

    theta: Floats
    sigma: Floats
    templates: list[Floats]
    shape: Shape | None
    meta: dict[str, Any]


def zero_for(
    nodes: Nodes,
    phi: Floats,
    raw: Raw,
    markers: list[BodyMarkers],
    zero: Literal["rest", "reference_frame"] | Sequence[float] | float | Nodes,
    bodies: Sequence[str] | None,
    mirrored: bool,
    label: str,
) -> tuple[Floats, dict[str, Any]]:
    """What to take off the turns ``phi`` (T, L) to have angles, (L,), and where that comes from."""
    links = phi.shape[1]
    if isinstance(zero, str):
        if zero == "reference_frame":
            return np.zeros(links), {"from": "reference frame"}
        if zero != "rest":
            raise AnglesError(
                fault(
                    Setting("zero"),
                    f"{zero!r} is not known",
                    "Give rest, reference_frame or the links' angles",
                )
            )
        rests = find_rest(LinkAngles(nodes.t_s, phi, raw.sigma, name=label))
        kept = [r for r in rests if _hangs(r.phi_rad, _down(raw, nodes, markers, mirrored))]
        value, sigma = zero_of(kept, label)
        return value, {
            "from": "rest",
            "sigma_rad": sigma.tolist(),
            "rests": [_rest_meta(r, r in kept) for r in rests],
        }
    if isinstance(zero, (int, float, np.floating, Sequence, np.ndarray)):
        given = np.atleast_1d(np.asarray(zero, dtype=np.float64))
        if given.shape != (links,) or not np.isfinite(given).all():
            raise AnglesError(
                fault(
                    Setting("zero"), f"{zero!r} for {links} link(s)", "Give one finite angle in rad per link"
                )
            )
        return -given, {"from": "given", "reference_frame_rad": given.tolist()}
    return _zero_from_reference(zero, raw, markers, bodies, mirrored)


def _rest_meta(rest: Rest, hanging: bool) -> dict[str, Any]:
    return {"start_s": rest.start_s, "stop_s": rest.stop_s, "hanging": hanging}


def _zero_from_reference(
    reference: Nodes, raw: Raw, markers: list[BodyMarkers], bodies: Sequence[str] | None, mirrored: bool
) -> tuple[Floats, dict[str, Any]]:
    """The zero from another recording: its rest, with this recording's templates."""
    others = body_markers(reference, bodies, mirrored)
    if [m.nodes for m in others] != [m.nodes for m in markers]:
        raise AnglesError(
            fault(
                "reference recording", "its nodes are not those of this recording", "Track both with one rig"
            )
        )
    poses = [solve(m.xy_px, m.weight, p) for m, p in zip(others, raw.templates, strict=True)]
    turns = np.stack([unwrap(reference.t_s, p.theta)[0] for p in poses], axis=1)
    sigma = np.stack([p.information**-0.5 for p in poses], axis=1)
    rests = find_rest(LinkAngles(reference.t_s, turns, sigma, name="reference recording"))
    kept = [r for r in rests if _hangs(r.phi_rad, _down(raw, reference, markers, mirrored))]
    value, sigma = zero_of(kept, "reference recording")
    return value, {"from": "reference recording", "sigma_rad": sigma.tolist()}


def _down(raw: Raw, nodes: Nodes, markers: list[BodyMarkers], mirrored: bool) -> list[Floats | None]:
    """For each link the vector from its upper joint along it, in the reference frame; ``None`` if not
    known.
    """
    shape = raw.shape
    if shape is not None:
        if shape.links == 1:
            return [shape.upper_px.mean(axis=0)]
        return [shape.elbow_px, _if_long(shape.lower_px)]
    places = {j.bodies: np.array([j.x_px, j.y_px]) * to_image(np.ones(2), mirrored) for j in nodes.rig.joints}
    pivot = next((p for b, p in places.items() if tuple(b) == (markers[0].name,)), None)
    elbow = next((p for b, p in places.items() if len(b) == 2), None)
    if len(markers) == 1:
        return [None if pivot is None else _if_long(markers[0].reference_px - pivot)]
    return [
        None if pivot is None or elbow is None else elbow - pivot,
        None if elbow is None else _if_long(markers[1].reference_px - elbow),
    ]


def _if_long(places: Floats) -> Floats | None:
    """Their mean, if it is far enough from the joint to say which way the link points."""
    mean = places.mean(axis=0)
    return mean if np.hypot(*mean) > 0.2 * np.sqrt((places**2).sum(axis=1).mean()) else None


def _hangs(theta: Floats, down: list[Floats | None]) -> bool:
    """Whether every link points down to within 60 degrees; a link whose direction is not known may."""
    for turn, vector in zip(theta, down, strict=True):
        if vector is not None:
            x, y = rotate(np.asarray(turn), vector)
            if -y < 0.5 * np.hypot(x, y):
                return False
    return True
