"""Bodies and joints of tracks that say nothing of either: `find_rig`.

Markers whose distances are constant are one body (`constant_distances`); bodies that share a point, and bodies with a
point that stays in place, have a joint there (`shared_points`), also where that closes a loop.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from pydpend.errors import RigError, Step, fault
from pydpend.kinematics.constant_distances import Complex, Distances, distances, grouped, trimmed_rms
from pydpend.kinematics.markers import to_image, to_world
from pydpend.kinematics.shared_points import Motion, shared_point
from pydpend.kinematics.table import Floats
from pydpend.nodes import Joint, Node, Nodes, Rig
from pydpend.typed import typed

STILL = 3.0
"""A marker that scatters by less than this many times its noise does not move."""

AT_ONE_PLACE = 5.0
"""Joints closer than this many times what they are uncertain by are one pin."""

LEAST_PX = 0.5
"""Joints this close are one pin in any case, px."""
BODIES = Step("pydpend import --body NAME=A,B", "dp.read_tracks(bodies={name: [a, b]})")
"""How the nodes of a body are named."""

PIVOT = Step("pydpend angles --pivot X,Y", "dp.angles(pivot=(x, y))")
"""How a pivot is pointed at."""


@typed()
def find_rig(nodes: Nodes) -> Nodes:
    """Tracks with bodies and joints, found from how the nodes move.

    Nodes whose distances are constant within their noise are one body, whatever bodies the nodes had; a slightly
    tilted camera or a lens, which changes all distances by the same few numbers, is allowed for. Joints are the points
    that two bodies share, of all pairs, so that loops are closed, and the points of a body that stay in place.

    Parameters
    ----------
    nodes : Nodes
        Tracks of N nodes, as `read_tracks` gives them.

    Returns
    -------
    Nodes
        With a rig of bodies ``link1``, ``link2``, ... from the ground outwards, joints ``pivot`` (of the ground) and
        ``joint1``, ...; its nodes in the order of the bodies. Nodes that stand still and are no link's pivot are the
        body ``still``, which comes last. `Nodes.notes` says what is doubtful, and which bodies only slide.

    Raises
    ------
    RigError
        Where nothing moves, or where no two nodes keep their distance and none goes round a point.
    """
    world = to_world(np.where(np.isfinite(nodes.xy_px), nodes.xy_px, 0.0), nodes.rig)
    seen = np.isfinite(nodes.xy_px).all(axis=2) & np.isfinite(nodes.sigma_px)
    places = np.where(seen, world[..., 0] + 1j * world[..., 1], np.nan)
    sigma = _sigmas(nodes.sigma_px, seen)
    names, notes = nodes.rig.names, []
    for n in np.flatnonzero(~seen.any(axis=0)):
        notes.append(f"{names[n]} is never seen and has no body")
    found = _distances(nodes.rig, places, sigma)
    noise = found.factor * sigma
    still = [
        n
        for n in np.flatnonzero(seen.any(axis=0)).tolist()
        if trimmed_rms(np.abs(_deviation(found.places[:, n]))) < STILL * noise[n]
    ]
    moving = [n for n in range(len(names)) if n not in still and seen[:, n].any()]
    if not moving:
        raise RigError(fault("nodes", "nothing moves", "Give tracks of a mechanism that moves"))
    part = replace(found, ratio=found.ratio[np.ix_(moving, moving)])
    groups = [[moving[k] for k in g] for g in grouped(part)]
    search = _Search(found.places, noise, groups)
    search.find()
    if all(len(g) == 1 for g in search.groups) and not search.joints:
        problem = "no two nodes keep their distance, and none goes round a point by 15 deg or more"
        advice = (
            "Say which nodes are one link with " + BODIES + ", or of a link of one node where it hangs with "
        )
        raise RigError(fault("nodes", problem, advice + PIVOT))
    search.pin(still, list(names))
    if found.camera is not None:
        notes.append(
            "distances change over the picture as by a camera that is tilted or has a lens: allowed for here, and part "
            "of the angles' uncertainty"
        )
    return _nodes(nodes, search, notes)


def _distances(rig: Rig, places: Complex, sigma: Floats) -> Distances:
    """The nodes' distances, about the middle of the picture."""
    corner = to_world(np.array([[0.0, 0.0], [float(v) for v in rig.image_px]]), rig)
    middle = corner.mean(axis=0)
    half = float(np.abs(corner[1] - corner[0]).max()) / 2
    return distances(places, sigma, complex(middle[0], middle[1]), half)


def _sigmas(stated: NDArray[np.float32], seen: NDArray[np.bool_]) -> Floats:
    """Each node's usual standard uncertainty, px; 1 for one that is never seen."""
    return np.array(
        [float(np.median(s[m])) if m.any() else 1.0 for s, m in zip(stated.T, seen.T, strict=True)]
    )


def _deviation(z: Complex) -> Complex:
    z = z[np.isfinite(z)]
    return np.asarray(z - (np.median(z.real) + 1j * np.median(z.imag)))


@dataclass(eq=False)
class _Pin:
    """A joint: the groups that it holds (-1 is the ground), and its place on each."""

    on: dict[int, complex]
    sigma_px: float


GROUND = -1


@dataclass(eq=False)
class _Search:
    """Groups of nodes (bodies) and their joints. ``noise``: true standard uncertainty of each node, px."""

    places: Complex
    noise: Floats
    groups: list[list[int]]
    joints: list[_Pin] = field(default_factory=list)
    still: list[int] = field(default_factory=list)
    unmarked: list[tuple[int, int]] = field(default_factory=list)
    """Ends of links that have no node of their own."""

    def __post_init__(self) -> None:
        flat = self.places[np.isfinite(self.places)]
        self.size_px = float(np.abs(flat - flat.mean()).max())
        self.motions = [self._motion(g) for g in self.groups]

    def _motion(self, group: list[int]) -> Motion:
        return Motion.of(self.places[:, group], float(np.sqrt(np.mean(self.noise[group] ** 2))))

    def find(self) -> None:
        """The joints of all pairs, and links that show in nothing but the node at their end."""
        self._test_all()
        reached = self._grounded()
        for k in range(len(self.groups)):
            if k not in reached and len(self.groups[k]) > 1 and not self._hangs(k):
                self._part(k)
        self._test_all()

    def _test_all(self) -> None:
        ground = Motion.ground(len(self.places))
        known = [j for j in self.joints if j.sigma_px < 0]
        candidates: list[_Pin] = []
        for k, motion in enumerate(self.motions):
            found = shared_point(ground, motion, self.size_px)
            if found is not None and found.is_joint:
                candidates.append(_Pin({GROUND: found.on[0], k: found.on[1]}, found.sigma_px))
        for k in range(len(self.groups)):
            for i in range(k):
                if any({i, k} <= set(j.on) for j in known):
                    continue
                shared = shared_point(self.motions[i], self.motions[k], self.size_px)
                if shared is not None and shared.is_joint:
                    candidates.append(_Pin({i: shared.on[0], k: shared.on[1]}, shared.sigma_px))
        self.joints = list(known)
        for joint in candidates:
            if not self._is_there(joint):
                self.joints.append(joint)

    def _is_there(self, joint: _Pin) -> bool:
        """Whether other joints hold the two at that very pin already."""
        one, other = joint.on
        return any(
            self._same(a, joint, one) and self._same(b, joint, other)
            for a in self.joints
            for b in self.joints
            if one in a.on
            and other in b.on
            and {c for c in a.on if c != one} & {c for c in b.on if c != other}
        )

    def _same(self, a: _Pin, b: _Pin, body: int) -> bool:
        limit = max(LEAST_PX, AT_ONE_PLACE * float(np.hypot(abs(a.sigma_px), abs(b.sigma_px))))
        return abs(a.on[body] - b.on[body]) < limit

    def _grounded(self) -> set[int]:
        """Bodies that joints tie to the ground, over others or not."""
        reached = {GROUND}
        while True:
            more = {k for j in self.joints if reached & set(j.on) for k in j.on} - reached
            if not more:
                return reached - {GROUND}
            reached |= more

    def _hangs(self, k: int) -> bool:
        return any(k in j.on for j in self.joints)

    def _part(self, k: int) -> None:
        """A node of a body that goes round a fixed point ends a link of its own that shows in nothing else."""
        ground = Motion.ground(len(self.places))
        group = self.groups[k]
        for node in group:
            alone = self._motion([node])
            found = shared_point(ground, alone, self.size_px)
            if found is None or not found.is_joint:
                continue
            rest = [n for n in group if n != node]
            other = shared_point(ground, self._motion(rest), self.size_px) if len(rest) == 1 else None
            between = other is not None and other.is_joint
            self.groups[k], self.motions[k] = rest, self._motion(rest)
            self.groups.append([node])
            self.motions.append(alone)
            if between:
                # Both ends go round points of the ground: what keeps them apart has no node of its own.
                self.unmarked.append((node, rest[0]))
                return
            whole = self._motion(group)
            kept = [group.index(n) for n in rest]
            on_rest = whole.template[group.index(node)] - whole.template[kept].mean()
            # Below 0: it is known from the node itself and not to be tested again.
            self.joints.append(
                _Pin({len(self.groups) - 1: 0j, k: complex(on_rest)}, -float(self.noise[node]))
            )
            return

    def pin(self, still: list[int], names: list[str]) -> None:
        """Gives nodes that stand on a pivot to its link; the others are of the ground."""
        for n in still:
            z = self.places[:, n]
            at = complex(np.nanmean(z))
            for joint in self.joints:
                if GROUND not in joint.on or abs(joint.on[GROUND] - at) > max(
                    LEAST_PX, AT_ONE_PLACE * float(np.hypot(joint.sigma_px, self.noise[n]))
                ):
                    continue
                k = next(b for b in joint.on if b != GROUND)
                self.groups[k].append(n)
                self.motions[k] = self._motion(self.groups[k])
                break
            else:
                self.still.append(n)

    def order(self) -> list[int]:
        """The bodies from the ground outwards; those that hang on nothing last."""
        out: list[int] = []
        front = [GROUND]
        while front:
            nearer = [k for j in self.joints if set(front) & set(j.on) for k in j.on]
            front = [k for k in dict.fromkeys(nearer) if k != GROUND and k not in out]
            out += front
        return out + [k for k in range(len(self.groups)) if k not in out]

    def place(self, joint: _Pin, row: int) -> complex:
        """The joint's place in a frame, px; not a number where none of its bodies is seen there."""
        if GROUND in joint.on:
            return joint.on[GROUND]
        for k, u in sorted(joint.on.items(), key=lambda pair: -self.motions[pair[0]].spread2):
            m = self.motions[k]
            alone = m.spread2 == 0 and u == 0
            z = complex(m.place[row] if alone else m.place[row] + m.turn[row] * u)
            if np.isfinite(z):
                return z
        return complex(np.nan, np.nan)

    def slides(self, k: int) -> str | None:
        """The direction in which a body that does not turn moves along a line, in words."""
        m = self.motions[k]
        seen = np.isfinite(m.turn)
        if m.spread2 == 0 or seen.sum() < 2:
            return None
        turn = np.angle(m.turn[seen] / m.turn[seen][0])
        if trimmed_rms(turn - np.median(turn)) > STILL * m.sigma / np.sqrt(m.spread2):
            return None
        off = _deviation(m.place[seen])
        _, _, axes = np.linalg.svd(np.stack([off.real, off.imag], axis=1), full_matrices=False)
        across = off.real * axes[1, 0] + off.imag * axes[1, 1]
        if trimmed_rms(across) > STILL * m.sigma / np.sqrt(m.template.size):
            return "does not turn"
        angle = np.degrees(np.arctan2(axes[0, 1], axes[0, 0]))
        angle = (angle + 90) % 180 - 90
        return f"does not turn and slides along a line at {angle:.2f} deg from the picture's horizontal"


def _nodes(nodes: Nodes, search: _Search, notes: list[str]) -> Nodes:
    """The nodes with the rig that was found."""
    order = search.order()
    title = {k: f"link{i + 1}" for i, k in enumerate(order)}
    members = {title[k]: search.groups[k] for k in order}
    lost = [
        n
        for n in range(len(nodes.rig.names))
        if n not in {m for g in members.values() for m in g} | set(search.still)
    ]
    if search.still or lost:
        members["still"] = search.still + lost
    seen = np.isfinite(search.places)
    row = int(np.argmax(_joints_seen(search) + seen.mean(axis=1) / 2))
    at = _reference(search, row)
    for k in order:
        # From the joint that is nearest to the ground.
        inner = min(
            (j for j in search.joints if k in j.on), key=lambda j: _nearest(j, k, order), default=None
        )
        if inner is not None:
            start = search.place(inner, row)
            members[title[k]] = sorted(search.groups[k], key=lambda n: abs(at[n] - start))
    index = [n for group in members.values() for n in group]
    joints, count = [], {"pivot": 0, "joint": 0}
    for joint in sorted(
        search.joints, key=lambda j: [order.index(k) if k != GROUND else -1 for k in sorted(j.on)]
    ):
        z = search.place(joint, row)
        stem = "pivot" if GROUND in joint.on else "joint"
        count[stem] += 1
        name = stem if stem == "pivot" and count[stem] == 1 else f"{stem}{count[stem]}"
        bodies = tuple(title[k] for k in sorted((k for k in joint.on if k != GROUND), key=order.index))
        x, y = to_image(np.array([z.real, z.imag]), nodes.rig)
        joints.append(Joint(name, bodies, float(x), float(y)))
    owner = {n: body for body, group in members.items() for n in group}
    xy = to_image(np.stack([at.real, at.imag], axis=1), nodes.rig)
    rig = replace(
        nodes.rig,
        nodes=tuple(Node(nodes.rig.names[n], owner[n], *map(float, xy[n])) for n in index),
        bodies=tuple(members),
        joints=tuple(joints),
        reference_frame=int(nodes.frame[row]) if seen[row].all() else None,
    )
    rig.to_toml()  # refuses what is no rig
    for pair in search.unmarked:
        one, other = (nodes.rig.names[n] for n in pair)
        notes.append(
            f"{one} and {other} keep their distance: the link between them has no node of its own and is left out"
        )
    notes += [f"{title[k]} {words}" for k in order if (words := search.slides(k)) is not None]
    hung = {b for j in joints for b in j.bodies}
    notes += [
        f"{b} ({', '.join(nodes.rig.names[n] for n in members[b])}) shares no point with another body or the ground"
        for b in members
        if b not in hung and b != "still"
    ]
    if "still" in members:
        notes.append("still is no link: leave it out by naming the others (bodies)")
    return _reordered(nodes, rig, index, notes)


def _nearest(joint: _Pin, body: int, order: list[int]) -> int:
    """How near to the ground the other body of a joint is."""
    return min(-1 if k == GROUND else order.index(k) for k in joint.on if k != body)


def _joints_seen(search: _Search) -> Floats:
    """Number of joints whose place is known in each frame, (T,)."""
    known = [sum(np.isfinite(search.motions[k].place) for k in j.on if k != GROUND) for j in search.joints]
    return np.asarray(sum(known), dtype=np.float64) if known else np.zeros(len(search.places))


def _reference(search: _Search, row: int) -> Complex:
    """Place of every node in a frame: as seen, by its body, or as it was first seen; (N,)."""
    out = search.places[row].copy()
    for group, motion in zip(search.groups, search.motions, strict=True):
        for k, u in zip(group, motion.template, strict=True):
            if not np.isfinite(out[k]):
                out[k] = motion.place[row] + motion.turn[row] * u
    for n in np.flatnonzero(~np.isfinite(out)):
        first = np.flatnonzero(np.isfinite(search.places[:, n]))
        out[n] = search.places[first[0], n] if first.size else int(n) / out.size
    return np.asarray(out)


def _reordered(nodes: Nodes, rig: Rig, index: Iterable[int], notes: list[str]) -> Nodes:
    """The nodes in the rig's order, with what was found among the notes."""
    order = list(index)
    settings = dict(nodes.meta.get("settings") or {})
    own = dict(settings.get("import") or {})
    before = [n for n in own.get("notes", []) if "no bodies are given" not in n]
    own["notes"] = [*before, *notes]
    settings["import"] = own
    return replace(
        nodes,
        xy_px=nodes.xy_px[:, order],
        sigma_px=nodes.sigma_px[:, order],
        area_px=nodes.area_px[:, order],
        status=nodes.status[:, order],
        rig=rig,
        meta={**nodes.meta, "settings": settings},
    )
