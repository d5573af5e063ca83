"""The linkage estimator: the links share joints, so both angles are fitted together in every frame.

A marker of the upper link is at ``P + R(theta1) a_k``, one of the lower at ``P + R(theta1) e + R(theta2)
b_k``, with the pivot ``P``, the places ``a_k`` in the upper link and ``e`` of the elbow seen from the
pivot, and ``b_k`` in the lower link seen from the elbow. ``P``, ``a``, ``e``, ``b`` are the same in all
frames and are fitted to the whole recording; then each frame has only its two angles left, and the lower
link's markers lever the upper one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pydpend.errors import AnglesError, Setting, fault
from pydpend.kinematics.markers import BodyMarkers
from pydpend.kinematics.pose import Pose, evenly, rotate
from pydpend.kinematics.scale import pooled_scale2
from pydpend.kinematics.table import Floats
from pydpend.typed import typed

FIT_FRAMES = 4000
"""The shape is fitted to at most this many frames, evenly spread: its error is then far below a marker's."""

LARGEST_PIVOT_SIGMA_PX = 5.0
"""A pivot less sure than this is not known; the recording turns too little to find it."""

_CHUNK = 4096


@dataclass(frozen=True, eq=False)
class Shape:
    """The geometry that stays the same in all frames, turned as in the rig's reference picture.

    Attributes
    ----------
    pivot_px : ndarray of float, shape (2,)
        Pivot in the world's directions (x right, y up), px.
    upper_px : ndarray of float, shape (K1, 2)
        Markers of the upper link, seen from the pivot, px.
    elbow_px : ndarray of float, shape (2,)
        Elbow seen from the pivot, px.
    lower_px : ndarray of float, shape (K2, 2)
        Markers of the lower link, seen from the elbow, px; (0, 2) with one link.
    """

    pivot_px: Floats
    upper_px: Floats
    elbow_px: Floats
    lower_px: Floats

    @property
    def links(self) -> int:
        """1 or 2."""
        return 2 if self.lower_px.shape[0] else 1


@dataclass(frozen=True, eq=False)
class Linkage:
    """Joints and shape of the links with their uncertainties, as `find_linkage` fits them to a recording.

    Attributes
    ----------
    shape : pydpend.kinematics.Shape
        Pivot, elbow and markers, px; x right, y up.
    covariance_px2 : ndarray of float, shape (4, 4)
        Of (pivot x, y, elbow x, y), px^2; the elbow's part is along and across the upper link as turned in the
        reference picture.
    length_px, length_sigma_px : float
        Distance of pivot and elbow and its standard uncertainty, px; NaN with one link.
    sigma_scale : float
        Factor by which the residuals make the stated sigmas larger; it is in every uncertainty here.
    chi2 : float
        Sum of squared standardised residuals with the stated sigmas.
    dof : int
        Degrees of freedom of that sum.
    """

    shape: Shape
    covariance_px2: Floats
    length_px: float
    length_sigma_px: float
    sigma_scale: float
    chi2: float
    dof: int

    @property
    def pivot_sigma_px(self) -> Floats:
        """Standard uncertainties of the pivot's x and y, px, (2,)."""
        return np.sqrt(np.diag(self.covariance_px2)[:2])

    @typed()
    def metres_per_px(self, length_m: float, sigma_m: float = 0.0) -> tuple[float, float]:
        """The scale of the picture from the true distance of pivot and elbow.

        Parameters
        ----------
        length_m, sigma_m : float
            Distance of pivot and elbow and its standard uncertainty, m.

        Returns
        -------
        tuple of float
            The scale and its standard uncertainty, m per px.

        Raises
        ------
        AnglesError
            With one link, or for a length that is not above zero.
        """
        if self.shape.links < 2:
            raise AnglesError(fault("linkage", "with one link there is no elbow, so no length to scale by"))
        if not (np.isfinite(length_m) and length_m > 0 and np.isfinite(sigma_m) and sigma_m >= 0):
            raise AnglesError(fault("link length", f"{length_m} m with uncertainty {sigma_m} m cannot be"))
        scale = length_m / self.length_px
        return scale, scale * float(np.hypot(sigma_m / length_m, self.length_sigma_px / self.length_px))


def first_shape(upper: Pose, lower: Pose | None) -> Shape:
    """Pivot and elbow from the poses alone, by linear least squares: the points that do not move, or not apart.

    Raises :class:`AnglesError` if the bodies hardly turn, so that every point will do.
    """
    theta, centre = upper.theta_rad, upper.centre_px
    rows = np.flatnonzero(np.isfinite(theta))
    rows = rows[evenly(rows.size, FIT_FRAMES)]
    turning = _matrix(theta[rows])
    ones = np.broadcast_to(-np.eye(2), turning.shape)
    found = _least_squares(np.concatenate([turning, ones], axis=2), -centre[rows], "pivot")
    q, pivot = found[:2], found[2:]
    template = upper.template_px - q
    if lower is None:
        return Shape(pivot, template, np.zeros(2), np.zeros((0, 2)))
    both = np.flatnonzero(np.isfinite(theta) & np.isfinite(lower.theta_rad))
    if not both.size:
        raise AnglesError(
            fault("nodes", "the two links are never seen in the same frame, so no elbow is found")
        )
    both = both[evenly(both.size, FIT_FRAMES)]
    apart = np.concatenate([_matrix(theta[both]), -_matrix(lower.theta_rad[both])], axis=2)
    found = _least_squares(apart, lower.centre_px[both] - centre[both], "elbow")
    return Shape(pivot, template, found[:2] - q, lower.template_px - found[2:])


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


def _across(v: Floats) -> Floats:
    """A quarter turn counter-clockwise: the derivative of R(theta) v by theta, for v already turned."""
    return np.stack([-v[..., 1], v[..., 0]], axis=-1)


@dataclass(frozen=True, eq=False)
class Frames:
    """The markers of all links in some frames: places (T, N, 2), weights (T, N), the upper link's first."""

    xy: Floats
    w: Floats

    @staticmethod
    def of(markers: list[BodyMarkers]) -> Frames:
        """All bodies side by side."""
        return Frames(
            np.concatenate([m.xy_px for m in markers], axis=1),
            np.concatenate([m.weight for m in markers], axis=1),
        )

    def at(self, rows: NDArray[np.int64] | slice) -> Frames:
        """Some of the frames."""
        return Frames(self.xy[rows], self.w[rows])


def predicted(shape: Shape, theta: Floats) -> tuple[Floats, Floats]:
    """The markers' places at angles ``theta`` (T, L), (T, N, 2), and the derivatives by them, (T, N, 2, L)."""
    upper = rotate(theta[:, :1], shape.upper_px[None])
    places = shape.pivot_px + upper
    slopes = np.zeros((theta.shape[0], upper.shape[1], 2, theta.shape[1]))
    slopes[..., 0] = _across(upper)
    if shape.links == 1:
        return places, slopes
    elbow = rotate(theta[:, 0], shape.elbow_px[None])
    lower = rotate(theta[:, 1:2], shape.lower_px[None])
    more = np.empty((theta.shape[0], lower.shape[1], 2, 2))
    more[..., 0] = _across(elbow)[:, None, :]
    more[..., 1] = _across(lower)
    places = np.concatenate([places, shape.pivot_px + elbow[:, None, :] + lower], axis=1)
    return places, np.concatenate([slopes, more], axis=1)


def information(w: Floats, slopes: Floats) -> Floats:
    """Fisher information on the angles, (T, L, L), rad^-2: its inverse is the Cramer-Rao bound."""
    links = slopes.shape[3]
    out = np.empty((w.shape[0], links, links))
    for a in range(links):
        weighted = slopes[..., a] * w[..., None]
        for b in range(a + 1):
            out[:, a, b] = out[:, b, a] = np.einsum("tkd,tkd->t", weighted, slopes[..., b])
    return out


def remaining(w: Floats, slopes: Floats, inverse: Floats) -> tuple[Floats, Floats]:
    """Part of each marker's variance that a fit of the angles leaves, (T, N, 2, 2).

    Also ``slopes @ inverse`` (T, N, 2, L), with ``inverse`` (T, L, L) that of :func:`information`.
    """
    spread = np.matmul(slopes, inverse[:, None])
    return np.eye(2) - np.matmul(spread, np.swapaxes(slopes, 2, 3)) * w[..., None, None], spread


def fit_shape(markers: list[BodyMarkers], shape: Shape, theta: Floats) -> tuple[Linkage, Floats]:
    """Fits shape and angles together to all given frames (weights 0 leave a marker out).

    Gauss-Newton with each frame's angles eliminated (Schur complement), so the cost grows with the number of
    frames only linearly. ``theta`` (T, L) must be finite and near; returns the linkage and better angles.
    """
    frames = Frames.of(markers)
    k1, k2 = shape.upper_px.shape[0], shape.lower_px.shape[0]
    size = 2 + 2 * k1 + (2 + 2 * k2 if k2 else 0)
    links = shape.links
    theta = theta.copy()
    inverse = np.zeros((size, size))
    chi2 = 0.0
    for _ in range(6):
        normal, right, chi2 = np.zeros((size, size)), np.zeros(size), 0.0
        held: list[tuple[slice, Floats, Floats]] = []
        for start in range(0, theta.shape[0], _CHUNK):
            rows = slice(start, min(start + _CHUNK, theta.shape[0]))
            part = frames.at(rows)
            places, slopes = predicted(shape, theta[rows])
            residual = np.where((part.w > 0)[..., None], part.xy - places, 0.0)
            chi2 += float((part.w * (residual**2).sum(axis=2)).sum())
            root = np.sqrt(part.w)[..., None]
            jg = (_shape_slopes(theta[rows], k1, k2, size) * root[..., None]).reshape(
                places.shape[0], -1, size
            )
            ja = (slopes * root[..., None]).reshape(places.shape[0], -1, links)
            r = (residual * root).reshape(places.shape[0], -1)
            v = regular(np.einsum("tia,tib->tab", ja, ja))
            cross = np.matmul(np.swapaxes(jg, 1, 2), ja)
            back = np.linalg.solve(v, np.swapaxes(cross, 1, 2))
            pull = np.linalg.solve(v, np.einsum("tia,ti->ta", ja, r)[..., None])[..., 0]
            flat = jg.reshape(-1, size)
            wide = cross.transpose(1, 0, 2).reshape(size, -1)
            # Sums over frames by einsum's own loops: BLAS would share them out over threads, for nothing.
            normal += np.einsum("ig,ih->gh", flat, flat) - np.einsum(
                "gi,ih->gh", wide, back.reshape(-1, size)
            )
            right += np.einsum("ig,i->g", flat, r.reshape(-1)) - np.einsum("tga,ta->g", cross, pull)
            held.append((rows, pull, back))
        # Turning all places of a link and its angle the other way changes nothing: hold that turn at zero.
        for free in _free_turns(shape, size):
            normal += np.outer(free, free) * (np.trace(normal) / size / (free @ free))
        inverse = np.linalg.inv(normal)
        step = inverse @ right
        for rows, pull, back in held:
            theta[rows] += pull - np.einsum("tag,g->ta", back, step)
        shape = _moved(shape, step, k1, k2)
        if np.abs(step).max() < 1e-5:
            break
    dof = 2 * int(np.count_nonzero(frames.w)) - links * theta.shape[0] - (size - links)
    scale2 = _scale2(shape, frames, theta, size - links, dof)
    covariance = inverse * scale2
    pick = [0, 1] + ([2 + 2 * k1, 3 + 2 * k1] if k2 else [])
    small = covariance[np.ix_(pick, pick)]
    worst = float(np.sqrt(np.diag(small)[:2].max()))
    if worst > LARGEST_PIVOT_SIGMA_PX:
        raise AnglesError(
            fault(
                "nodes",
                f"the pivot is known to {worst:.1f} px only: the links turn too little",
                "Use " + Setting("estimator", "rigid") + ", or a recording in which they swing more",
            )
        )
    length, sigma = float("nan"), float("nan")
    if k2:
        length = float(np.hypot(*shape.elbow_px))
        along = shape.elbow_px / length
        sigma = float(np.sqrt(along @ small[2:, 2:] @ along))
    return Linkage(shape, small, length, sigma, float(np.sqrt(scale2)), chi2, dof), theta


def _scale2(shape: Shape, frames: Frames, theta: Floats, parameters: int, dof: int) -> float:
    """The sigmas' squared scale as the joints feel it: each residual counts with its marker's share of the weight."""
    scatter, freedom = np.zeros(theta.shape[0]), np.zeros(theta.shape[0])
    for start in range(0, theta.shape[0], _CHUNK):
        rows = slice(start, min(start + _CHUNK, theta.shape[0]))
        part = frames.at(rows)
        places, slopes = predicted(shape, theta[rows])
        inverse = np.asarray(np.linalg.inv(regular(information(part.w, slopes))))
        left, _ = remaining(part.w, slopes, inverse)
        share = part.w * (np.count_nonzero(part.w, axis=1) / part.w.sum(axis=1))[:, None]
        scatter[rows] = (share * part.w * ((part.xy - places) ** 2).sum(axis=2)).sum(axis=1)
        freedom[rows] = (share * np.einsum("tkdd->tk", left)).sum(axis=1)
    return pooled_scale2(scatter, freedom, parameters, dof + parameters)


def _shape_slopes(theta: Floats, k1: int, k2: int, size: int) -> Floats:
    """Derivatives of all places by (pivot, upper places, elbow, lower places), (T, N, 2, size)."""
    out = np.zeros((theta.shape[0], k1 + k2, 2, size))
    out[..., 0, 0] = 1.0
    out[..., 1, 1] = 1.0
    first = _matrix(theta[:, 0])
    for k in range(k1):
        out[:, k, :, 2 + 2 * k : 4 + 2 * k] = first
    if k2:
        second = _matrix(theta[:, 1])
        at = 2 + 2 * k1
        out[:, k1:, :, at : at + 2] = first[:, None]
        for k in range(k2):
            out[:, k1 + k, :, at + 2 + 2 * k : at + 4 + 2 * k] = second
    return out


def _free_turns(shape: Shape, size: int) -> list[Floats]:
    k1 = shape.upper_px.shape[0]
    first = np.zeros(size)
    first[2 : 2 + 2 * k1] = _across(shape.upper_px).reshape(-1)
    if shape.links == 1:
        return [first]
    first[2 + 2 * k1 : 4 + 2 * k1] = _across(shape.elbow_px)
    second = np.zeros(size)
    second[4 + 2 * k1 :] = _across(shape.lower_px).reshape(-1)
    return [first, second]


def _moved(shape: Shape, step: Floats, k1: int, k2: int) -> Shape:
    at = 2 + 2 * k1
    return Shape(
        shape.pivot_px + step[:2],
        shape.upper_px + step[2:at].reshape(k1, 2),
        shape.elbow_px + (step[at : at + 2] if k2 else 0.0),
        shape.lower_px + (step[at + 2 :].reshape(k2, 2) if k2 else 0.0),
    )


def regular(v: Floats) -> Floats:
    """The matrices with 1 on the diagonal where an angle has no marker at all."""
    diagonal = np.einsum("taa->ta", v)
    out = v.copy()
    np.einsum("taa->ta", out)[...] = np.where(diagonal > 0, diagonal, 1.0)
    return out
