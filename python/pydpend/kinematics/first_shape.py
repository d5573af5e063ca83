"""A first shape of a linkage from the poses of its bodies, and the state of the frames in which a body has none."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pydpend.errors import AnglesError, Setting, fault
from pydpend.kinematics.markers import BodyMarkers
from pydpend.kinematics.pose import Pose, evenly, rotate, solve
from pydpend.kinematics.shape import GROUND, Frames, Shape, State, shape_of
from pydpend.kinematics.structure import Structure
from pydpend.kinematics.table import Floats

FIT_FRAMES = 4000
"""The shape is fitted to at most this many frames, evenly spread: its error is then far below a marker's."""


@dataclass(frozen=True, eq=False)
class _Body:
    """A link's coordinates in T frames: their turn (T,) and origin (T, 2), and the origin in the reference picture."""

    theta: Floats
    origin: Floats
    reference: Floats


def first_shape(
    poses: list[Pose], structure: Structure, given_px: Mapping[str, Floats] | None = None
) -> Shape:
    """Joints from the poses alone, by linear least squares: the points that do not move apart, or not at all.

    A link of one marker hangs from the middle of the circle on which that goes about the link on which it hangs.
    ``given_px``: places (2,) of joints of the ground.

    Raises :class:`AnglesError` if links hardly turn, so that every point will do, or if a link of one marker hangs from
    nothing known.
    """
    given = given_px or {}
    total = poses[0].theta_rad.size
    ground = _Body(np.zeros(total), np.zeros((total, 2)), np.zeros(2))
    bodies: list[_Body] = [ground] * len(poses)
    seen_by: dict[tuple[str, int], Floats] = {}
    pivots: dict[str, Floats] = {}
    places: list[Floats] = [p.template_px for p in poses]
    for k in structure.outwards:
        pose, joint, on = poses[k], structure.inner[k], structure.on[k]
        carrier = GROUND if on is None else structure.links.index(on)
        there = ground if on is None else bodies[carrier]
        if pose.is_alone:
            # A pendulum's pivot that nobody found could be anywhere: any short path is a circle's.
            if joint is None or (on is None and np.isnan(joint.x_px) and joint.name not in given):
                raise no_joint(pose.markers.name)
            about = given.get(joint.name)
            about = _circle(pose.markers, there, about)
            bodies[k], places[k] = _hung(pose.markers, there, about)
            seen_by[joint.name, k] = np.zeros(2)
        else:
            bodies[k] = _Body(pose.theta_rad, pose.centre_px, pose.markers.reference_px.mean(axis=0))
            if joint is None:
                continue
            seen_by[joint.name, k], about = _common(bodies[k], there, joint.name, given.get(joint.name))
        if carrier == GROUND:
            pivots[joint.name] = about
        else:
            seen_by[joint.name, carrier] = about
    for joint in structure.loops:
        sides = [structure.links.index(b) for b in joint.bodies]
        there = ground if len(sides) == 1 else bodies[sides[1]]
        seen_by[joint.name, sides[0]], about = _common(bodies[sides[0]], there, joint.name, None)
        if len(sides) == 1:
            pivots[joint.name] = about
        else:
            seen_by[joint.name, sides[1]] = about
    return shape_of(structure, seen_by, places, pivots)


def no_joint(link: str) -> AnglesError:
    """The error for a link of one marker that hangs from nothing known."""
    return AnglesError(
        fault(
            "nodes",
            f"the link {link} has one marker and no joint was found",
            "Give "
            + Setting("pivot", "X,Y")
            + " (px in the picture), or leave the link out with "
            + Setting("bodies"),
        )
    )


def _common(one: _Body, other: _Body, what: str, given: Floats | None) -> tuple[Floats, Floats]:
    """The point that two bodies share, as each of them sees it."""
    rows = np.flatnonzero(np.isfinite(one.theta) & np.isfinite(other.theta))
    if not rows.size:
        raise AnglesError(
            fault("nodes", f"the two links of {what} are never seen in the same frame, so it is not found")
        )
    rows = rows[evenly(rows.size, FIT_FRAMES)]
    turning = [_matrix(body.theta[rows]) for body in (one, other)]
    if given is not None:
        back = rotate(-one.theta[rows], given - one.origin[rows])
        return np.median(back, axis=0), given
    apart = np.concatenate([turning[0], -turning[1]], axis=2)
    found = _least_squares(apart, other.origin[rows] - one.origin[rows], what)
    return found[:2], found[2:]


def _circle(markers: BodyMarkers, there: _Body, given: Floats | None) -> Floats:
    """The middle of the circle on which a marker goes, in the coordinates of the body about which it goes.

    Taubin's fit (IEEE PAMI 13 (1991) 1115) in the form of a singular value decomposition; ``given`` goes before it.
    """
    if given is not None:
        return given
    seen = markers.seen[:, 0] & np.isfinite(there.theta)
    rows = np.flatnonzero(seen)
    rows = rows[evenly(rows.size, FIT_FRAMES)] if rows.size else rows
    if rows.size < 3:
        raise no_joint(markers.name)
    local = rotate(-there.theta[rows], markers.xy_px[rows, 0] - there.origin[rows])
    middle = local.mean(axis=0)
    off = local - middle
    square = (off**2).sum(axis=1)
    size = float(np.sqrt(square.mean()))
    if not size > 0:
        raise no_joint(markers.name)
    design = np.column_stack([(square - square.mean()) / (2 * size), off])
    a = np.linalg.svd(design, full_matrices=False)[2][2]
    curved = a[0] / (2 * size)
    if not abs(curved) * size > 1e-6:
        raise no_joint(markers.name)
    return np.asarray(middle - a[1:] / (2 * curved))


def _hung(markers: BodyMarkers, there: _Body, about: Floats) -> tuple[_Body, Floats]:
    """The coordinates of a link of one marker that hangs at a point of another, and its marker in them, (1, 2)."""
    joint = there.origin + rotate(there.theta, np.broadcast_to(about, there.origin.shape))
    reference = there.reference + about
    arm = np.where(markers.seen, markers.xy_px[:, 0] - joint, np.nan)
    stands = markers.reference_px[0] - reference
    length = float(np.nanmedian(np.hypot(*arm.T)))
    theta = np.arctan2(arm[:, 1], arm[:, 0]) - np.arctan2(stands[1], stands[0])
    theta = np.angle(np.exp(1j * theta))
    known = np.isfinite(theta)
    return _Body(theta, np.where(known[:, None], joint, np.nan), reference), (
        length * stands / max(float(np.hypot(*stands)), 1e-12)
    )[None]


def _least_squares(design: Floats, wanted: Floats, what: str) -> Floats:
    a, b = design.reshape(-1, design.shape[2]), wanted.reshape(-1)
    found, _, _, singular = np.linalg.lstsq(a, b, rcond=None)
    if a.shape[0] < 4 or singular[-1] < 1e-3 * singular[0]:
        raise AnglesError(
            fault(
                "nodes",
                f"the links turn too little against each other to find the {what}",
                "Use "
                + Setting("estimator", "rigid")
                + ", or a recording in which they swing by some degrees",
            )
        )
    return np.asarray(found)


def _matrix(theta: Floats) -> Floats:
    c, s = np.cos(theta), np.sin(theta)
    return np.stack([np.stack([c, -s], axis=-1), np.stack([s, c], axis=-1)], axis=-2)


def known_links(shape: Shape, seen: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(T, L): whether the markers that are ``seen`` (T, N) tell of each link where it is.

    It takes two points of a link: markers, or joints of the ground or of links that are known.
    """
    count = np.stack([seen[:, shape.of_link == k].sum(axis=1) for k in range(shape.links)], axis=1)
    located = np.zeros((seen.shape[0], len(shape.joints)), dtype=bool)
    known = count >= 2
    for _ in range(shape.links + 1):
        for j, link, _ in shape.ends:
            located[:, j] |= True if link == GROUND else known[:, link]
        points = count.copy()
        for j, link, _ in shape.ends:
            if link != GROUND:
                points[:, link] += located[:, j]
        before, known = known, known | (points >= 2)
        if (before == known).all():
            break
    return known


def posed(shape: Shape, poses: list[Pose]) -> tuple[Floats, Floats]:
    """Turns (T, L) and origins (T, L, 2) of the links by their poses; NaN where they have none."""
    theta = np.stack([p.theta_rad for p in poses], axis=1)
    origin = np.full((*theta.shape, 2), np.nan)
    for k, pose in enumerate(poses):
        if not pose.is_alone:
            # The mean of the template's places in the link's own coordinates is where the pose's centre is.
            centre = shape.local_markers(k).mean(axis=0)
            origin[:, k] = pose.centre_px - rotate(
                pose.theta_rad, np.broadcast_to(centre, pose.centre_px.shape)
            )
    return theta, origin


def first_state(shape: Shape, frames: Frames, theta: Floats, origin: Floats) -> State:
    """The state of all frames by the links' turns (T, L) and origins (T, L, 2).

    Where a link has none (NaN), by its markers and the joints of what is known.
    """
    theta, origin = theta.copy(), origin.copy()
    usual = float(np.median(frames.w[:, : len(shape.of_link)][frames.w[:, : len(shape.of_link)] > 0]))
    for _ in range(shape.links + 1):
        joint = _located(shape, theta, origin)
        missing = 0
        for k in range(shape.links):
            rows = np.flatnonzero(np.isnan(theta[:, k]))
            if not rows.size:
                continue
            mine = np.flatnonzero(shape.of_link == k)
            meets = [(j, q) for j, link, q in shape.ends if link == k]
            joints = np.array([j for j, _ in meets], dtype=np.int64)
            places = np.concatenate([frames.xy[np.ix_(rows, mine)], joint[np.ix_(rows, joints)]], axis=1)
            told = np.isfinite(places).all(axis=2)
            weight = np.concatenate(
                [frames.w[np.ix_(rows, mine)], np.full((rows.size, len(meets)), usual)], axis=1
            )
            weight = np.where(told, weight, 0.0)
            template = np.concatenate(
                [shape.local_markers(k), np.array([shape.local(q) for _, q in meets]).reshape(-1, 2)]
            )
            found = solve(np.where(told[..., None], places, 0.0), weight, template)
            theta[rows, k], origin[rows, k] = found.theta, found.centre
            missing += int(np.isnan(found.theta).sum())
        if not missing:
            break
    roots = [int(np.flatnonzero(shape.afloat == tree)[0]) for tree in range(shape.trees_afloat)]
    return State(theta, origin[:, roots])


def _located(shape: Shape, theta: Floats, origin: Floats) -> Floats:
    """Places (T, J, 2) of the joints by the ground or a link that is known; NaN where none is."""
    out = np.full((theta.shape[0], len(shape.joints), 2), np.nan)
    for j, link, q in shape.ends:
        if link == GROUND:
            out[:, j] = shape.local(q)
            continue
        here = origin[:, link] + rotate(
            theta[:, link], np.broadcast_to(shape.local(q), origin[:, link].shape)
        )
        out[:, j] = np.where(np.isfinite(out[:, j]), out[:, j], here)
    return out
