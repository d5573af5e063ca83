"""The linkage's angles in every frame, given its shape; robust against bad markers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pydpend.errors import AnglesError, Setting, fault
from pydpend.kinematics.first_shape import FIT_FRAMES, first_shape, first_state, known_links, posed
from pydpend.kinematics.linkage import Given, Linkage, fit_shape
from pydpend.kinematics.markers import BodyMarkers
from pydpend.kinematics.names import ColumnNames
from pydpend.kinematics.pose import Pose, evenly
from pydpend.kinematics.scale import hidden_factor, inflation, partly_hidden, pooled_scale2, reject_limit
from pydpend.kinematics.shape import (
    GROUND,
    Frames,
    Shape,
    State,
    information,
    predicted,
    regular,
    remaining,
    shape_response,
)
from pydpend.kinematics.structure import Structure
from pydpend.kinematics.table import Floats

_STEPS = 6
"""Gauss-Newton steps per frame; from the rigid pose two are enough, from one marker four."""

_TIE = 0.8
"""Two markers whose misfits are within this ratio are both left out: which is wrong cannot be told."""

_SETTLED = 1e-7
"""A step of a frame's unknowns, rad or px, after which no more is taken: the next one would be its square."""

_CHUNK = 8192


@dataclass(frozen=True, eq=False)
class LinkageAngles:
    """Angles of the links in T frames by the linkage; NaN where they cannot be had.

    ``state``: angles (T, L), and places of the trees that hang on nothing. ``covariance_rad2`` (T, L, L): of the
    angles' noise. ``used`` (T, N): markers used, the first link's first; ``chi2``, ``dof`` (T,) of the residuals with
    the stated sigmas. ``sigma_scale`` (L,): factor by which the residuals make the stated sigmas larger, as each angle
    feels it; it is in ``covariance_rad2``.
    """

    linkage: Linkage
    state: State
    covariance_rad2: Floats
    used: NDArray[np.bool_]
    chi2: Floats
    dof: NDArray[np.int64]
    sigma_scale: Floats

    @property
    def theta_rad(self) -> Floats:
        """The angles (T, L)."""
        return self.state.theta

    @property
    def sigma_rad(self) -> Floats:
        """Their standard uncertainties (T, L)."""
        return np.asarray(np.sqrt(np.einsum("taa->ta", self.covariance_rad2)))


def fit_linkage(
    poses: list[Pose], structure: Structure, given: Mapping[str, Given] | None = None
) -> LinkageAngles:
    """Shape from the whole recording, then the angles of every frame.

    Raises :class:`~pydpend.errors.AnglesError` if the links turn too little to find the joints.
    """
    linkage = fit_joints(poses, structure, given)
    frames = Frames.of([p.markers for p in poses], linkage.shape)
    return _all_frames(linkage, frames, first_state(linkage.shape, frames, *posed(linkage.shape, poses)))


def fit_joints(poses: list[Pose], structure: Structure, given: Mapping[str, Given] | None = None) -> Linkage:
    """Joints and shape from the whole recording. Raises as `fit_linkage` does."""
    structure = structure.as_pendulum()
    shape = first_shape(poses, structure, {name: g.place_px for name, g in (given or {}).items()})
    clean = Frames.of([p.markers.without(~p.used) for p in poses], shape)
    state = first_state(shape, clean, *posed(shape, poses))
    known = known_links(shape, clean.w[:, : len(shape.of_link)] > 0) & np.isfinite(state.theta)
    rows = np.flatnonzero(known.all(axis=1))
    if not rows.size:
        problem = "there is no frame in which all of " + ", ".join(structure.links) + " can be told"
        raise AnglesError(fault("nodes", problem, "Name fewer links with " + Setting("bodies")))
    rows = rows[evenly(rows.size, FIT_FRAMES)]
    return fit_shape(clean.at(rows), shape, state.at(rows), given)[0]


def turns_by(linkage: Linkage, markers: list[BodyMarkers], link: str) -> tuple[Floats, Floats]:
    """Turns (T,) of a link in another recording by the shape of this one, and their standard uncertainties (T,)."""
    links = linkage.shape.structure.links
    frames = Frames.of([m for m in markers if m.name in links], linkage.shape)
    total = frames.w.shape[0]
    nothing = np.full((total, len(links)), np.nan)
    start = first_state(linkage.shape, frames, nothing, np.full((total, len(links), 2), np.nan))
    found, k = _all_frames(linkage, frames, start), links.index(link)
    return found.theta_rad[:, k], found.sigma_rad[:, k]


def joint_places(linked: LinkageAngles, markers: list[BodyMarkers]) -> tuple[Floats, Floats]:
    """Places (T, J, 2) of the joints in the world, px, and the greater of their coordinates' uncertainties (T, J)."""
    shape = linked.linkage.shape
    frames, total = Frames.of(markers, shape), len(linked.theta_rad)
    first = {j: link for j, link, _ in reversed(shape.ends) if link != GROUND}
    on = np.array([first[j] for j in range(len(shape.joints))], dtype=np.int64)
    joints = replace(shape, markers=shape.joints, closures=shape.closures[:0], of_link=on)
    places, sigma = np.full((total, len(on), 2), np.nan), np.full((total, len(on)), np.nan)
    known = np.isfinite(linked.theta_rad)
    needed = np.stack([((shape.joints[j] != 0) @ _turning(shape)) > 0 for j in range(len(on))])
    for start in range(0, total, _CHUNK):
        rows = slice(start, min(start + _CHUNK, total))
        state = State(np.nan_to_num(linked.theta_rad[rows]), np.nan_to_num(linked.state.place[rows]))
        w = frames.w[rows].copy()
        w[:, : len(shape.of_link)] = np.where(linked.used[rows], w[:, : len(shape.of_link)], 0.0)
        inverse = np.asarray(np.linalg.inv(regular(information(w, predicted(shape, state)[1]))))
        at, slopes = predicted(joints, state)
        variance = np.einsum("tjdu,tuv,tjdv->tjd", slopes, inverse, slopes, optimize=True).max(axis=2)
        told = np.stack([known[rows][:, need].all(axis=1) for need in needed], axis=1)
        scale = linked.linkage.sigma_scale
        places[rows] = np.where(told[..., None], at, np.nan)
        sigma[rows] = np.where(told, scale * np.sqrt(variance + _fixed(linked.linkage) ** 2), np.nan)
    return places, sigma


def _turning(shape: Shape) -> Floats:
    """Which vectors turn with which links, (Q, L)."""
    return np.asarray(shape.turns_with[:, None] == np.arange(shape.links), dtype=np.float64)


def _fixed(linkage: Linkage) -> Floats:
    """The part (J,) of the joints' uncertainties by the vectors that lead there, px: one error of all frames."""
    shape = linkage.shape
    rows = np.stack([np.kron(shape.joints, axis) for axis in np.eye(2)], axis=1)
    variance = np.einsum("jdq,qr,jdr->jd", rows, linkage.covariance_px2, rows)
    return np.asarray(np.sqrt(np.maximum(variance.max(axis=1), 0.0)) / linkage.sigma_scale)


def mean_response(linked: LinkageAngles, markers: list[BodyMarkers]) -> Floats:
    """How the angles follow the vectors of the shape on the mean over the frames, (L, 2Q)."""
    shape = linked.linkage.shape
    rows = np.flatnonzero(np.isfinite(linked.theta_rad).all(axis=1))
    rows = rows[evenly(rows.size, FIT_FRAMES)] if rows.size else rows
    frames, state = Frames.of(markers, shape).at(rows), linked.state.at(rows)
    w = frames.w.copy()
    w[:, : len(shape.of_link)] = np.where(linked.used[rows], w[:, : len(shape.of_link)], 0.0)
    _, slopes = predicted(shape, state)
    inverse = np.asarray(np.linalg.inv(regular(information(w, slopes))))
    return np.asarray(shape_response(shape, state.theta, w, slopes, inverse)[:, : shape.links].mean(axis=0))


def checked_sigma(linked: LinkageAngles, poses: list[Pose]) -> tuple[Floats, list[str]]:
    """The linkage's covariance (T, L, L) held against the rigid poses, and a note where it had to grow.

    A camera that shakes, play in a joint or a lens moves the linkage's angles but hardly the rigid ones. If
    the linkage is right, the two differ with variance ``sigma_rigid^2 - sigma_linkage^2`` (Hausman,
    Econometrica 46 (1978) 1251). What they differ by beyond that is the linkage's error and goes into its
    sigma.
    """
    alone = float(np.sqrt(np.mean([p.sigma_scale**2 for p in poses if not p.is_alone] or [1.0])))
    sigma = linked.sigma_rad.copy()
    notes = []
    names = ColumnNames(linked.linkage.shape.structure.links)
    for k, pose in enumerate(poses):
        apart = np.angle(np.exp(1j * (linked.theta_rad[:, k] - pose.theta_rad)))
        known = np.isfinite(apart) & np.isfinite(sigma[:, k])
        if np.count_nonzero(known) < 30:
            continue
        difference = apart[known] - np.median(apart[known])
        rigid2 = pose.sigma_rad[known] ** 2
        own2 = (sigma[known, k] / linked.sigma_scale[k] * alone) ** 2
        # Frames that stand out have a half-hidden marker, which spoils the rigid angle, not the linkage's.
        usual = np.abs(difference) < 4 * 1.4826 * np.median(np.abs(difference))
        variance = float((difference[usual] ** 2).mean())
        bias2 = variance - float((rigid2 - own2)[usual].mean())
        if bias2 > 4 * variance * np.sqrt(2 / np.count_nonzero(usual)):
            before = float(np.sqrt(np.median(sigma[known, k] ** 2)))
            sigma[:, k] = np.sqrt((sigma[:, k] / linked.sigma_scale[k] * alone) ** 2 + bias2)
            notes.append(
                f"{names.stem(k)} by the linkage is off by {np.degrees(np.sqrt(bias2)):.2g} deg beyond its noise of "
                f"{np.degrees(before):.2g} deg (the camera moves, a joint has play or the lens distorts); its sigma "
                f"includes that, {Setting('estimator', 'rigid')} is free of it"
            )
    grown = sigma / linked.sigma_rad
    return linked.covariance_rad2 * grown[:, :, None] * grown[:, None, :], notes


def _all_frames(linkage: Linkage, frames: Frames, start: State) -> LinkageAngles:
    shape = linkage.shape
    total, links, markers = len(start.theta), shape.links, len(shape.of_link)
    theta, place = start.theta.copy(), start.place.copy()
    covariance = np.full((total, links, links), np.nan)
    known = np.zeros((total, links), dtype=bool)
    used = np.zeros((total, markers), dtype=bool)
    chi2, dof = np.zeros(total), np.zeros(total, dtype=np.int64)
    scatter, freedom = np.zeros((total, links)), np.zeros((total, links))
    joints = np.zeros((total, links, links))
    hidden = np.zeros(total, dtype=bool)
    for k in range(links):
        hidden |= partly_hidden(frames.w[:, :markers][:, shape.of_link == k])
    limit = reject_limit(hidden) * linkage.sigma_scale**2
    for first in range(0, total, _CHUNK):
        rows = np.arange(first, min(first + _CHUNK, total))
        part = Frames(frames.xy[rows], frames.w[rows].copy())
        active = np.arange(rows.size)
        while active.size:
            now = rows[active]
            found = _solve(shape, part.at(active), State(theta[now], place[now]))
            theta[now], place[now], d2 = found.state.theta, found.state.place, found.d2
            covariance[now], known[now] = found.covariance, found.known
            chi2[now], dof[now] = found.chi2, found.dof
            scatter[now], freedom[now] = found.scatter, found.freedom
            worst = d2.max(axis=1)
            bad = worst > limit[now]
            active, d2, worst = active[bad], d2[bad], worst[bad]
            drop = d2 >= _TIE * worst[:, None]
            part.w[active, :markers] = np.where(drop, 0.0, part.w[active, :markers])
            again = rows[active]
            theta[again] = np.where(np.isnan(theta[again]), start.theta[again], theta[again])
        used[rows] = part.w[:, :markers] > 0
        joints[rows] = _by_joints(linkage, part, State(theta[rows], place[rows]))
    parameters = 2 * len(shape.vectors_px) - len(shape.free_turns())
    factor = np.empty((total, links))
    scale = np.empty(links)
    for a in range(links):
        whole, part_hidden = known[:, a] & ~hidden, known[:, a] & hidden
        counted = float(dof[known[:, a]].sum())
        scale2 = pooled_scale2(scatter[whole, a], freedom[whole, a], parameters, counted)
        more = hidden_factor(scatter[:, a], freedom[:, a], part_hidden, scale2)
        scale[a] = np.sqrt(scale2)
        each = scale[a] * np.where(hidden, more, 1.0)
        factor[:, a] = each * inflation(chi2 / each**2, dof)
    covariance = covariance * factor[:, :, None] * factor[:, None, :] + joints
    theta = np.where(known, theta, np.nan)
    covariance = np.where(known[:, :, None] & known[:, None, :], covariance, np.nan)
    return LinkageAngles(linkage, State(theta, place), covariance, used, chi2, dof, scale)


def _by_joints(linkage: Linkage, frames: Frames, state: State) -> Floats:
    """The part (T, L, L) of the angles' covariance by how well joints and shape are known: one error of all frames."""
    shape, links = linkage.shape, linkage.shape.links
    theta = np.nan_to_num(state.theta)
    _, slopes = predicted(shape, State(theta, np.nan_to_num(state.place)))
    inverse = np.asarray(np.linalg.inv(regular(information(frames.w, slopes))))
    moves = shape_response(shape, theta, frames.w, slopes, inverse)[:, :links]
    return np.asarray(np.matmul(moves @ linkage.covariance_px2, np.swapaxes(moves, 1, 2)))


@dataclass(frozen=True, eq=False)
class _Solved:
    """States of some frames and how well the markers agree with them.

    ``known`` (T, L): which angles the markers tell. Also normalised misfits d2 (T, N), chi2 and dof (T,), the angles'
    covariance (T, L, L) with the stated sigmas, and what :func:`~pydpend.kinematics.scale.pooled_scale2` is made of,
    for each angle (T, L).
    """

    state: State
    known: NDArray[np.bool_]
    d2: Floats
    chi2: Floats
    dof: NDArray[np.int64]
    covariance: Floats
    scatter: Floats
    freedom: Floats


def _solve(shape: Shape, frames: Frames, start: State) -> _Solved:
    links, markers, unknowns = shape.links, len(shape.of_link), shape.unknowns
    state = State(np.nan_to_num(start.theta), np.nan_to_num(start.place))
    for _ in range(_STEPS):
        places, slopes = predicted(shape, state)
        residual = np.where((frames.w > 0)[..., None], frames.xy - places, 0.0)
        v = regular(information(frames.w, slopes))
        weighted = residual * frames.w[..., None]
        pull = np.stack([np.einsum("tkd,tkd->t", weighted, slopes[..., a]) for a in range(unknowns)], axis=1)
        step = np.linalg.solve(v, pull[..., None])[..., 0]
        step[:, :links] = np.clip(step[:, :links], -0.5, 0.5)
        state = state.moved(step)
        if np.abs(step).max(initial=0.0) < _SETTLED:
            break
    places, slopes = predicted(shape, state)
    inverse = np.asarray(np.linalg.inv(regular(information(frames.w, slopes))))
    # The closures hold the angles; what disagrees is told by the markers.
    w, slopes = frames.w[:, :markers], slopes[:, :markers]
    seen = w > 0
    residual = np.where(seen[..., None], frames.xy[:, :markers] - places[:, :markers], 0.0)
    left, spread = remaining(w, slopes, inverse)
    determinant = left[..., 0, 0] * left[..., 1, 1] - left[..., 0, 1] * left[..., 1, 0]
    trace = left[..., 0, 0] + left[..., 1, 1]
    rx, ry = residual[..., 0], residual[..., 1]
    exact = (left[..., 1, 1] * rx**2 - 2 * left[..., 0, 1] * rx * ry + left[..., 0, 0] * ry**2) / np.where(
        determinant > 1e-6, determinant, 1.0
    )
    # With no freedom in one direction the residual lies in the other one.
    d2 = w * np.where(determinant > 1e-6, exact, (rx**2 + ry**2) / np.maximum(trace, 1e-6))
    chi2 = (w * (residual**2).sum(axis=2)).sum(axis=1)
    count = seen.sum(axis=1)
    known = known_links(shape, seen)
    # A closure takes two unknowns from a frame.
    told = known.sum(axis=1) + 2 * shape.trees_afloat - 2 * len(shape.closures)
    dof = np.maximum(2 * count - told, 0)
    covariance = inverse[:, :links, :links]
    variance = np.einsum("taa->ta", covariance)
    # What a centre's error does to each angle is w (slopes inverse) times it: only that part of a residual counts.
    share = (w * count[:, None])[..., None] / variance[:, None]
    spread = spread[..., :links]
    felt = np.einsum("tkda,tkd->tka", spread, residual)
    scatter = (share * w[..., None] * felt**2).sum(axis=1)
    freedom = (share * np.einsum("tkda,tkde,tkea->tka", spread, left, spread)).sum(axis=1)
    return _Solved(state, known, d2, chi2, dof, covariance, scatter, freedom)
