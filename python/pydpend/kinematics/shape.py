"""The geometry of a linkage, and where its markers are at given angles.

Every place on a tree of links is a sum of vectors, each turned with one link (or none: the ground): a marker of the
second link of a pendulum is at ``P + R(theta1) e + R(theta2) b``. Where a chain closes, two such sums are the same
point; their difference, the closure, is nought in every frame.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pydpend.kinematics.markers import BodyMarkers
from pydpend.kinematics.pose import rotate
from pydpend.kinematics.structure import Structure
from pydpend.kinematics.table import Floats

GROUND = -1
"""Stands for the ground where the index of a link could stand."""

CLOSURE = 1e3
"""Two sums of vectors that are one point count as a place measured so many times better than a marker: the angles then
keep to the closure to a thousandth of a marker's error, and the equations to ten digits."""


@dataclass(frozen=True, eq=False)
class Shape:
    """The geometry that stays the same in all frames, turned as in the rig's reference picture.

    Attributes
    ----------
    structure : pydpend.kinematics.Structure
        L links and J joints.
    vectors_px : ndarray of float, shape (Q, 2)
        All vectors in the world's directions (x right, y up), px.
    turns_with : ndarray of int, shape (Q,)
        Index of the link with which each turns; -1: the ground.
    markers : ndarray of float, shape (N, Q)
        Which vectors lead to each marker, by their signs; the first link's markers first.
    joints : ndarray of float, shape (J, Q)
        The same of each joint.
    closures : ndarray of float, shape (C, Q)
        The same of each place where a chain closes: from one way to the other.
    of_link : ndarray of int, shape (N,)
        The link on which each marker is.
    afloat : ndarray of int, shape (L,)
        Index of the tree that hangs on nothing of which a link is, -1 if it hangs from the ground.
    ends : tuple of (int, int, int)
        Of each joint, by its index, and each side of it (a link, or -1, the ground): the index of the vector that leads
        there from the side's origin; -1 if it is the origin. A link's origin is the joint from which it hangs.
    """

    structure: Structure
    vectors_px: Floats
    turns_with: NDArray[np.int64]
    markers: Floats
    joints: Floats
    closures: Floats
    of_link: NDArray[np.int64]
    afloat: NDArray[np.int64]
    ends: tuple[tuple[int, int, int], ...]

    @property
    def links(self) -> int:
        """The number of links."""
        return len(self.structure.links)

    @property
    def trees_afloat(self) -> int:
        """The number of trees that hang on nothing: their place is free in every frame."""
        return int(self.afloat.max(initial=GROUND)) + 1

    @property
    def unknowns(self) -> int:
        """The number of unknowns of a frame: an angle for each link, a place for each tree that hangs on nothing."""
        return self.links + 2 * self.trees_afloat

    @property
    def pivot_px(self) -> Floats:
        """The first joint's place where the links stand as in the reference picture, (2,), px."""
        return np.asarray(self.joints[0] @ self.vectors_px)

    def joint(self, name: str) -> int:
        """The index of a joint."""
        return [j.name for j in self.structure.joints].index(name)

    def local(self, q: int) -> Floats:
        """The place (2,) of one of the `ends` from its side's origin."""
        return np.zeros(2) if q < 0 else self.vectors_px[q]

    def local_markers(self, link: int) -> Floats:
        """The places (K, 2) of a link's markers from its origin."""
        mine = self.markers[self.of_link == link] * (self.turns_with == link)
        return np.asarray(mine @ self.vectors_px)

    def moved(self, step: Floats) -> Shape:
        """The shape with its vectors a step (2Q,) away."""
        return replace(self, vectors_px=self.vectors_px + step.reshape(-1, 2))

    def turned(self, theta: Floats) -> Floats:
        """The vectors at angles (T, L), (T, Q, 2)."""
        still = np.zeros((theta.shape[0], 1))
        angles = np.concatenate([theta, still], axis=1)[:, self.turns_with]
        return rotate(angles, self.vectors_px)

    def free_turns(self) -> list[Floats]:
        """Steps (2Q,) of the vectors that no frame can tell: turning a link, moving a tree that hangs on nothing."""
        out = []
        for link in range(self.links):
            turn = np.where((self.turns_with == link)[:, None], across(self.vectors_px), 0.0)
            out.append(turn.reshape(-1))
        for tree in range(self.trees_afloat):
            root = int(np.flatnonzero(self.afloat == tree)[0])
            for axis in np.eye(2):
                out.append(np.where((self.turns_with == root)[:, None], axis, 0.0).reshape(-1))
        return out


def shape_of(
    structure: Structure,
    joints_px: dict[tuple[str, int], Floats],
    markers_px: list[Floats],
    pivots: dict[str, Floats],
) -> Shape:
    """The shape from places in the links' own coordinates, which have the origin anywhere.

    ``joints_px[name, link]`` (2,): a joint as the link sees it; ``pivots[name]`` (2,): a joint of the ground.
    ``markers_px``: of each link (K, 2).
    """
    links = len(structure.links)
    vectors: list[Floats] = []
    turns: list[int] = []
    inner: list[dict[int, float]] = [{} for _ in range(links)]
    afloat = np.full(links, GROUND, dtype=np.int64)

    def vector(link: int, value: Floats) -> int:
        vectors.append(value)
        turns.append(link)
        return len(vectors) - 1

    origin: list[Floats] = [np.zeros(2)] * links
    trees = 0
    ends: list[tuple[int, int, int]] = []
    index = {j.name: i for i, j in enumerate(structure.joints)}
    at: dict[str, dict[int, float]] = {}
    for k in structure.outwards:
        joint, on = structure.inner[k], structure.on[k]
        if joint is None:
            afloat[k], trees = trees, trees + 1
            continue
        origin[k] = joints_px[joint.name, k]
        if on is None:
            carrier, q = GROUND, vector(GROUND, pivots[joint.name])
            inner[k] = {q: 1.0}
        else:
            carrier = structure.links.index(on)
            afloat[k] = afloat[carrier]
            q = vector(carrier, joints_px[joint.name, carrier] - origin[carrier])
            inner[k] = inner[carrier] | {q: 1.0}
        ends += [(index[joint.name], k, -1), (index[joint.name], carrier, q)]
        at[joint.name] = inner[k]
    rows = []
    for k, places in enumerate(markers_px):
        rows += [inner[k] | {vector(k, p - origin[k]): 1.0} for p in places]
    closures = []
    for joint in structure.loops:
        sides = [structure.links.index(b) for b in joint.bodies]
        meet = [vector(k, joints_px[joint.name, k] - origin[k]) for k in sides]
        if len(sides) == 1:
            sides.append(GROUND)
            meet.append(vector(GROUND, pivots[joint.name]))
        ends += [(index[joint.name], k, q) for k, q in zip(sides, meet, strict=True)]
        ways = [({} if k == GROUND else inner[k]) | {q: 1.0} for k, q in zip(sides, meet, strict=True)]
        closures.append({q: ways[0].get(q, 0.0) - ways[1].get(q, 0.0) for q in {*ways[0], *ways[1]}})
        at[joint.name] = ways[0]
    return Shape(
        structure,
        np.array(vectors),
        np.array(turns, dtype=np.int64),
        _dense(rows, len(vectors)),
        _dense([at[j.name] for j in structure.joints], len(vectors)),
        _dense(closures, len(vectors)),
        np.repeat(np.arange(links), [len(m) for m in markers_px]),
        afloat,
        tuple(ends),
    )


def _dense(rows: list[dict[int, float]], width: int) -> Floats:
    out = np.zeros((len(rows), width))
    for i, row in enumerate(rows):
        for q, sign in row.items():
            out[i, q] = sign
    return out


def across(v: Floats) -> Floats:
    """A quarter turn counter-clockwise: the derivative of R(theta) v by theta, for v already turned."""
    return np.stack([-v[..., 1], v[..., 0]], axis=-1)


@dataclass(frozen=True, eq=False)
class Frames:
    """Measurements of some frames: places (T, N + C, 2) of the markers, then of the closures, and their weights."""

    xy: Floats
    w: Floats

    @staticmethod
    def of(markers: list[BodyMarkers], shape: Shape) -> Frames:
        """All bodies side by side."""
        xy = np.concatenate([m.xy_px for m in markers], axis=1)
        w = np.concatenate([m.weight for m in markers], axis=1)
        seen = w > 0
        usual = float(np.median(w[seen])) if seen.any() else 1.0
        closures = np.full((w.shape[0], len(shape.closures)), CLOSURE**2 * usual)
        still = np.zeros((*closures.shape, 2))
        return Frames(np.concatenate([xy, still], axis=1), np.concatenate([w, closures], axis=1))

    def at(self, rows: NDArray[np.int64] | slice) -> Frames:
        """Some of the frames."""
        return Frames(self.xy[rows], self.w[rows])


@dataclass(frozen=True, eq=False)
class State:
    """The unknowns of frames: angles (T, L) from the reference picture, and places (T, F, 2) of the trees afloat."""

    theta: Floats
    place: Floats

    def at(self, rows: NDArray[np.int64] | slice) -> State:
        """Some of the frames."""
        return State(self.theta[rows], self.place[rows])

    def moved(self, step: Floats) -> State:
        """The unknowns a step (T, U) away."""
        links = self.theta.shape[1]
        return State(self.theta + step[:, :links], self.place + step[:, links:].reshape(self.place.shape))


def predicted(shape: Shape, state: State) -> tuple[Floats, Floats]:
    """Places (T, N + C, 2) of markers and closures, and their derivatives by the unknowns, (T, N + C, 2, U)."""
    turned = shape.turned(state.theta)
    turning = across(turned)
    rows = np.concatenate([shape.markers, shape.closures])
    places = np.zeros((len(turned), len(rows), 2))
    slopes = np.zeros((*places.shape, shape.unknowns))
    # Few vectors lead to each place: sums over those alone are a fifth of the work of a product of matrices.
    for m, q in np.argwhere(rows):
        places[:, m] += rows[m, q] * turned[:, q]
        link = shape.turns_with[q]
        if link != GROUND:
            slopes[:, m, :, link] += rows[m, q] * turning[:, q]
    for tree in range(shape.trees_afloat):
        on = np.flatnonzero(shape.afloat[shape.of_link] == tree)
        places[:, on] += state.place[:, None, tree]
        for axis in range(2):
            slopes[:, on, axis, shape.links + 2 * tree + axis] = 1.0
    return places, slopes


def shape_slopes(shape: Shape, theta: Floats) -> Floats:
    """Derivatives of all places by the vectors, (T, N + C, 2, 2Q)."""
    rows = np.concatenate([shape.markers, shape.closures])
    c, s = np.cos(theta), np.sin(theta)
    still = np.ones((theta.shape[0], 1))
    c = np.concatenate([c, still], axis=1)[:, shape.turns_with]
    s = np.concatenate([s, 0 * still], axis=1)[:, shape.turns_with]
    out = np.empty((theta.shape[0], len(rows), 2, len(shape.vectors_px), 2))
    out[:, :, 0, :, 0] = out[:, :, 1, :, 1] = rows * c[:, None]
    out[:, :, 1, :, 0] = rows * s[:, None]
    out[:, :, 0, :, 1] = -out[:, :, 1, :, 0]
    return out.reshape(*out.shape[:3], -1)


def shape_response(shape: Shape, theta: Floats, w: Floats, slopes: Floats, inverse: Floats) -> Floats:
    """How the unknowns of frames follow the vectors, (T, U, 2Q), the markers staying where they are seen.

    ``w`` (T, N + C), ``slopes`` (T, N + C, 2, U) and ``inverse`` (T, U, U), of :func:`information`, at angles (T, L).
    """
    rows = np.concatenate([shape.markers, shape.closures])
    pull = np.einsum("mq,tmdu->tqdu", rows, slopes * w[..., None, None])
    still = np.zeros((theta.shape[0], 1))
    angles = np.concatenate([theta, still], axis=1)[:, shape.turns_with]
    c, s = np.cos(angles)[..., None], np.sin(angles)[..., None]
    back = np.stack([c * pull[:, :, 0] + s * pull[:, :, 1], c * pull[:, :, 1] - s * pull[:, :, 0]], axis=2)
    by_unknown = np.moveaxis(back, 3, 1).reshape(theta.shape[0], slopes.shape[3], -1)
    return np.asarray(-np.matmul(inverse, by_unknown))


def information(w: Floats, slopes: Floats) -> Floats:
    """Fisher information on the unknowns, (T, U, U): its inverse is the Cramer-Rao bound."""
    unknowns = slopes.shape[3]
    out = np.empty((w.shape[0], unknowns, unknowns))
    for a in range(unknowns):
        weighted = slopes[..., a] * w[..., None]
        for b in range(a + 1):
            out[:, a, b] = out[:, b, a] = np.einsum("tkd,tkd->t", weighted, slopes[..., b])
    return out


def remaining(w: Floats, slopes: Floats, inverse: Floats) -> tuple[Floats, Floats]:
    """Part of each marker's variance that a fit of the unknowns leaves, (T, N, 2, 2).

    Also ``slopes @ inverse`` (T, N, 2, U), with ``inverse`` (T, U, U) that of :func:`information`.
    """
    spread = np.matmul(slopes, inverse[:, None])
    return np.eye(2) - np.matmul(spread, np.swapaxes(slopes, 2, 3)) * w[..., None, None], spread


DAMPED = 1e-11
"""Part by which diagonals are raised, so that a frame whose markers leave unknowns open has finite steps: with closures
a million times the weight of a marker, covariances are 1e-5 of themselves too small by it."""


def regular(v: Floats) -> Floats:
    """The matrices (T, U, U) with 1 on the diagonal where no marker tells of an unknown, and hardly singular."""
    diagonal = np.einsum("taa->ta", v)
    out = v.copy()
    np.einsum("taa->ta", out)[...] = np.where(diagonal > 0, diagonal * (1 + DAMPED), 1.0)
    return out
