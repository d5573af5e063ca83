"""The linkage estimator: links share joints, so all angles are fitted together in every frame.

The vectors of the shape (`shape`) are the same in all frames and are fitted to the whole recording; then each frame has
only its angles left, and the markers of a link lever the angles of those from which it hangs. Where a chain closes, the
angles keep to that.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pydpend.errors import AnglesError, Setting, fault
from pydpend.kinematics.scale import pooled_scale2
from pydpend.kinematics.shape import (
    GROUND,
    Frames,
    Shape,
    State,
    information,
    predicted,
    regular,
    remaining,
    shape_slopes,
)
from pydpend.kinematics.table import Floats
from pydpend.typed import typed

LARGEST_JOINT_SIGMA_PX = 5.0
"""A joint less sure than this is not known; the recording turns too little to find it."""

_CHUNK = 4096

_STEPS = 8
"""Most steps of the fit: from poses two or three are enough, from a circle through a short arc more."""


@dataclass(frozen=True, eq=False)
class Given:
    """A joint of the ground that the caller knows: place (2,) in the world and standard uncertainty, px."""

    place_px: Floats
    sigma_px: float


@dataclass(frozen=True, eq=False)
class Linkage:
    """Joints and shape of the links with their uncertainties, as `find_linkage` fits them to a recording.

    Attributes
    ----------
    shape : pydpend.kinematics.Shape
        Joints and markers, px; x right, y up.
    covariance_px2 : ndarray of float, shape (2Q, 2Q)
        Of the shape's Q vectors, px^2; those of a link as turned in the reference picture.
    sigma_scale : float
        Factor by which the residuals make the stated sigmas larger; it is in every uncertainty here.
    chi2 : float
        Sum of squared standardised residuals with the stated sigmas.
    dof : int
        Degrees of freedom of that sum.
    """

    shape: Shape
    covariance_px2: Floats
    sigma_scale: float
    chi2: float
    dof: int

    def _distance(self, row: Floats) -> tuple[float, float]:
        """Length of a sum of vectors of one link, by their signs (Q,), and its standard uncertainty, px."""
        v = row @ self.shape.vectors_px
        length = float(np.hypot(*v))
        slope = np.outer(row, v / length if length > 0 else v).reshape(-1)
        return length, float(np.sqrt(slope @ self.covariance_px2 @ slope))

    @typed()
    def vector_sigma_px(self, vector: int) -> Floats:
        """Standard uncertainties of one of the shape's vectors.

        Parameters
        ----------
        vector : int
            Its index.

        Returns
        -------
        ndarray of float, shape (2,)
            Of its x and y, px.
        """
        return np.asarray(np.sqrt(np.diag(self.covariance_px2)[2 * vector : 2 * vector + 2]))

    @property
    def pivot_sigma_px(self) -> Floats:
        """Standard uncertainties of the first joint's x and y, px, (2,); NaN where it is not of the ground."""
        q = next((q for j, link, q in self.shape.ends if j == 0 and link == GROUND), None)
        return np.full(2, np.nan) if q is None else self.vector_sigma_px(q)

    @property
    def lengths(self) -> dict[tuple[str, str], tuple[float, float]]:
        """Distances of two joints of one link and their standard uncertainties, px, by the joints' names.

        Of the joint from which a link hangs to each other one, as ``{("pivot", "elbow"): (190.0, 0.01)}``.
        """
        names = [j.name for j in self.shape.structure.joints]
        out = {}
        for k in range(self.shape.links):
            inner = self.shape.structure.inner[k]
            for j, link, q in self.shape.ends:
                if inner is not None and link == k and q >= 0:
                    out[inner.name, names[j]] = self._distance(np.eye(len(self.shape.vectors_px))[q])
        return out

    @property
    def length_px(self) -> float:
        """Distance of pivot and elbow: of the first two joints of one link, px; NaN where none has two."""
        return next(iter(self.lengths.values()), (float("nan"), float("nan")))[0]

    @property
    def length_sigma_px(self) -> float:
        """Standard uncertainty of that distance, px."""
        return next(iter(self.lengths.values()), (float("nan"), float("nan")))[1]

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
            Where no link has two joints, or for a length that is not above zero.
        """
        if not self.lengths:
            raise AnglesError(fault("linkage", "no link has two joints, so there is no length to scale by"))
        if not (np.isfinite(length_m) and length_m > 0 and np.isfinite(sigma_m) and sigma_m >= 0):
            raise AnglesError(fault("link length", f"{length_m} m with uncertainty {sigma_m} m cannot be"))
        scale = length_m / self.length_px
        return scale, scale * float(np.hypot(sigma_m / length_m, self.length_sigma_px / self.length_px))


def fit_shape(
    frames: Frames, shape: Shape, state: State, given: Mapping[str, Given] | None = None
) -> tuple[Linkage, State]:
    """Fits shape and states together to all given frames (weights 0 leave a marker out).

    Gauss-Newton with each frame's unknowns eliminated (Schur complement), so the cost grows with the number of
    frames only linearly. ``state`` must be finite and near. ``given``: joints of the ground that are known, by name.
    """
    theta, place = state.theta.copy(), state.place.copy()
    inverse: Floats = np.zeros((0, 0))
    chi2 = 0.0
    markers = len(shape.of_link)
    for _ in range(_STEPS):
        normal, right, chi2 = _priors(shape, given or {})
        held: list[tuple[slice, Floats, Floats]] = []
        for start in range(0, theta.shape[0], _CHUNK):
            rows = slice(start, min(start + _CHUNK, theta.shape[0]))
            part, now = frames.at(rows), State(theta[rows], place[rows])
            places, slopes = predicted(shape, now)
            residual = np.where((part.w > 0)[..., None], part.xy - places, 0.0)
            chi2 += float((part.w[:, :markers] * (residual[:, :markers] ** 2).sum(axis=2)).sum())
            told = eliminated(shape, part.w, now.theta, slopes, residual[..., None])
            normal, right = normal + told.normal, right + told.right[:, 0]
            held.append((rows, told.pull[..., 0], told.back))
        inverse = inverted(shape, normal)
        step = inverse @ right
        for rows, pull, back in held:
            now = State(theta[rows], place[rows]).moved(pull - np.einsum("tag,g->ta", back, step))
            theta[rows], place[rows] = now.theta, now.place
        shape = shape.moved(step)
        if np.abs(step).max() < 1e-5:
            break
    state = State(theta, place)
    parameters = 2 * len(shape.vectors_px) - len(shape.free_turns())
    seen = int(np.count_nonzero(frames.w)) if shape.unknowns else 0
    dof = 2 * seen - shape.unknowns * theta.shape[0] - parameters
    scale2 = _scale2(shape, frames, state, parameters, dof)
    linkage = Linkage(shape, inverse * scale2, float(np.sqrt(scale2)), chi2, dof)
    _check_joints(linkage)
    return linkage, state


@dataclass(frozen=True, eq=False)
class Eliminated:
    """Normal equations of the vectors from some frames, their own unknowns eliminated, for C sets of residuals.

    ``normal`` (2Q, 2Q), ``right`` (2Q, C); ``pull`` (T, U, C) and ``back`` (T, U, 2Q): a frame's unknowns move by
    ``pull - back @ step`` where the vectors move by a step.
    """

    normal: Floats
    right: Floats
    pull: Floats
    back: Floats


def eliminated(shape: Shape, w: Floats, theta: Floats, slopes: Floats, residual: Floats) -> Eliminated:
    """The equations of frames with weights (T, N + C) and residuals (T, N + C, 2, C) at angles (T, L)."""
    total, size = theta.shape[0], 2 * len(shape.vectors_px)
    root = np.sqrt(w)[..., None, None]
    jg = (shape_slopes(shape, theta) * root).reshape(total, -1, size)
    ja = (slopes * root).reshape(total, -1, shape.unknowns)
    r = (residual * root).reshape(total, ja.shape[1], -1)
    v = regular(np.einsum("tia,tib->tab", ja, ja))
    cross = np.matmul(np.swapaxes(jg, 1, 2), ja)
    back = np.linalg.solve(v, np.swapaxes(cross, 1, 2))
    pull = np.linalg.solve(v, np.matmul(np.swapaxes(ja, 1, 2), r))
    flat = jg.reshape(-1, size)
    wide = cross.transpose(1, 0, 2).reshape(size, -1)
    # Sums over frames by einsum's own loops: BLAS would share them out over threads, for nothing.
    normal = np.einsum("ig,ih->gh", flat, flat) - np.einsum("gi,ih->gh", wide, back.reshape(-1, size))
    right = np.einsum("ig,ic->gc", flat, r.reshape(len(flat), -1)) - np.einsum("tga,tac->gc", cross, pull)
    return Eliminated(normal, right, np.asarray(pull), np.asarray(back))


def inverted(shape: Shape, normal: Floats) -> Floats:
    """The inverse of the normal equations of the vectors, (2Q, 2Q)."""
    held = normal.copy()
    # Turning all places of a link and its angle the other way changes nothing: hold that turn at zero.
    for free in shape.free_turns():
        held += np.outer(free, free) * (np.trace(held) / len(held) / (free @ free))
    return np.asarray(np.linalg.inv(held))


def normal_priors(shape: Shape, given: Mapping[str, Given] | None) -> Floats:
    """Knowledge of joints beforehand, in the normal equations of the vectors, (2Q, 2Q)."""
    return _priors(shape, given or {})[0]


def _priors(shape: Shape, given: Mapping[str, Given]) -> tuple[Floats, Floats, float]:
    """Normal matrix, right side and chi-square of what is known of joints beforehand."""
    size = 2 * len(shape.vectors_px)
    normal, right, chi2 = np.zeros((size, size)), np.zeros(size), 0.0
    for name, known in given.items():
        j = shape.joint(name)
        q = next(q for i, link, q in shape.ends if i == j and link == GROUND)
        off = known.place_px - shape.vectors_px[q]
        for axis in range(2):
            normal[2 * q + axis, 2 * q + axis] += known.sigma_px**-2
            right[2 * q + axis] += off[axis] * known.sigma_px**-2
        chi2 += float((off**2).sum()) * known.sigma_px**-2
    return normal, right, chi2


def _check_joints(linkage: Linkage) -> None:
    """Raises AnglesError for a joint that is hardly known."""
    joints = linkage.shape.structure.joints
    for j, _, q in linkage.shape.ends:
        if q < 0:
            continue
        worst = float(linkage.vector_sigma_px(q).max())
        if not worst <= LARGEST_JOINT_SIGMA_PX:
            advice = "Use " + Setting("estimator", "rigid")
            if (np.bincount(linkage.shape.of_link) == 1).any():
                advice = "Give " + Setting("pivot", "X,Y") + " (px in the picture)"
            raise AnglesError(
                fault(
                    "nodes",
                    f"the {joints[j].name} is known to {worst:.1f} px only: the links turn too little",
                    advice + ", or a recording in which they swing more",
                )
            )


def _scale2(shape: Shape, frames: Frames, state: State, parameters: int, dof: int) -> float:
    """The sigmas' squared scale as the joints feel it: each residual counts with its marker's share of the weight."""
    total, markers = state.theta.shape[0], len(shape.of_link)
    scatter, freedom = np.zeros(total), np.zeros(total)
    for start in range(0, total, _CHUNK):
        rows = slice(start, min(start + _CHUNK, total))
        part = frames.at(rows)
        places, slopes = predicted(shape, state.at(rows))
        inverse = np.asarray(np.linalg.inv(regular(information(part.w, slopes))))
        w = part.w[:, :markers]
        left, _ = remaining(w, slopes[:, :markers], inverse)
        share = w * (np.count_nonzero(w, axis=1) / w.sum(axis=1))[:, None]
        residual = part.xy[:, :markers] - places[:, :markers]
        scatter[rows] = (share * w * (residual**2).sum(axis=2)).sum(axis=1)
        freedom[rows] = (share * np.einsum("tkdd->tk", left)).sum(axis=1)
    return pooled_scale2(scatter, freedom, parameters, dof + parameters)
