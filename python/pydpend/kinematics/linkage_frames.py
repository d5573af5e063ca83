"""The linkage's angles in every frame, given its shape; robust against bad markers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pydpend.errors import Setting
from pydpend.kinematics.linkage import (
    FIT_FRAMES,
    Frames,
    Linkage,
    Shape,
    first_shape,
    fit_shape,
    information,
    predicted,
    regular,
    remaining,
)
from pydpend.kinematics.pose import Pose, evenly, rotate
from pydpend.kinematics.scale import hidden_factor, inflation, partly_hidden, pooled_scale2, reject_limit
from pydpend.kinematics.table import Floats

_STEPS = 6
"""Gauss-Newton steps per frame; from the rigid pose two are enough, from one marker four."""

_TIE = 0.8
"""Two markers whose misfits are within this ratio are both left out: which is wrong cannot be told."""

_CHUNK = 8192


@dataclass(frozen=True, eq=False)
class LinkageAngles:
    """Angles of both links in T frames by the linkage; NaN where they cannot be had.

    ``theta_rad``, ``sigma_rad`` (T, L); ``used`` (T, N): markers used, the upper link's first; ``chi2``,
    ``dof`` (T,) of the residuals with the stated sigmas. ``sigma_scale`` (L,): factor by which the residuals make
    the stated sigmas larger, as each angle feels it; it is in ``sigma_rad``.
    """

    linkage: Linkage
    theta_rad: Floats
    sigma_rad: Floats
    used: NDArray[np.bool_]
    chi2: Floats
    dof: NDArray[np.int64]
    sigma_scale: Floats


def fit_linkage(upper: Pose, lower: Pose | None) -> LinkageAngles:
    """Shape from the whole recording, then the angles of every frame.

    Raises :class:`~pydpend.errors.AnglesError` if the links turn too little to find the joints.
    """
    poses = [upper] if lower is None else [upper, lower]
    shape = first_shape(upper, lower)
    theta = np.stack([p.theta_rad for p in poses], axis=1)
    rows = np.flatnonzero(np.isfinite(theta).all(axis=1))
    rows = rows[evenly(rows.size, FIT_FRAMES)]
    clean = [p.markers.without(~p.used) for p in poses]
    linkage, _ = fit_shape([m.at(rows) for m in clean], shape, theta[rows])
    frames = Frames.of([p.markers for p in poses])
    start = _start(linkage.shape, frames, theta)
    return _all_frames(linkage, frames, start)


def angles_of(shape: Shape, frames: Frames, start: Floats) -> Floats:
    """Angles (T, L) of frames by the linkage of a shape, from angles nearby; NaN where these are."""
    known = np.isfinite(start)
    return np.where(known, _solve(shape, frames, start).theta, np.nan)


def checked_sigma(linked: LinkageAngles, poses: list[Pose]) -> tuple[Floats, list[str]]:
    """The linkage's standard errors held against the rigid poses, and a note where they had to grow.

    A camera that shakes, play in a joint or a lens moves the linkage's angles but hardly the rigid ones. If
    the linkage is right, the two differ with variance ``sigma_rigid^2 - sigma_linkage^2`` (Hausman,
    Econometrica 46 (1978) 1251). What they differ by beyond that is the linkage's error and goes into its
    sigma.
    """
    alone = float(np.sqrt(np.mean([p.sigma_scale**2 for p in poses])))
    sigma = linked.sigma_rad.copy()
    notes = []
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
                f"phi{k + 1} by the linkage is off by {np.degrees(np.sqrt(bias2)):.2g} deg beyond its noise of "
                f"{np.degrees(before):.2g} deg (the camera moves, a joint has play or the lens distorts); its sigma "
                f"includes that, {Setting('estimator', 'rigid')} is free of it"
            )
    return sigma, notes


def _start(shape: Shape, frames: Frames, theta: Floats) -> Floats:
    """Fills angles that the rigid pose could not give: one marker and a joint have a direction too."""
    theta = theta.copy()
    k1 = shape.upper_px.shape[0]
    if shape.links == 2:
        # No upper marker: the elbow is where the lower link's pose puts it.
        rows = np.flatnonzero(
            np.isnan(theta[:, 0]) & ~np.isnan(theta[:, 1]) & ~(frames.w[:, :k1] > 0).any(axis=1)
        )
        if rows.size:
            w = frames.w[rows, k1:]
            back = frames.xy[rows, k1:] - rotate(theta[rows, 1][:, None], shape.lower_px[None])
            elbow = np.einsum("tk,tkd->td", w, back) / w.sum(axis=1)[:, None] - shape.pivot_px
            theta[rows, 0] = _turn(elbow, np.broadcast_to(shape.elbow_px, elbow.shape), np.ones(rows.size))
    rows = np.flatnonzero(np.isnan(theta[:, 0]))
    theta[rows, 0] = _about(frames.xy[rows, :k1] - shape.pivot_px, shape.upper_px, frames.w[rows, :k1])
    if shape.links == 2:
        rows = np.flatnonzero(np.isnan(theta[:, 1]) & ~np.isnan(theta[:, 0]))
        elbow = shape.pivot_px + rotate(theta[rows, 0], shape.elbow_px[None])
        theta[rows, 1] = _about(frames.xy[rows, k1:] - elbow[:, None, :], shape.lower_px, frames.w[rows, k1:])
    return theta


def _about(seen: Floats, template: Floats, w: Floats) -> Floats:
    """The turn about a known point that brings the template onto the seen places; NaN without any."""
    if not seen.shape[0]:
        return np.zeros(0)
    sine = (w * (template[None, :, 0] * seen[..., 1] - template[None, :, 1] * seen[..., 0])).sum(axis=1)
    cosine = (w * (template[None] * seen).sum(axis=2)).sum(axis=1)
    return np.where((w > 0).any(axis=1), np.arctan2(sine, cosine), np.nan)


def _turn(seen: Floats, template: Floats, w: Floats) -> Floats:
    return _about(seen[:, None, :], template[0][None, :], w[:, None]) if seen.shape[0] else np.zeros(0)


def _all_frames(linkage: Linkage, frames: Frames, start: Floats) -> LinkageAngles:
    total, links = start.shape
    theta, sigma = np.full((total, links), np.nan), np.full((total, links), np.nan)
    used = np.zeros(frames.w.shape, dtype=bool)
    chi2, dof = np.zeros(total), np.zeros(total, dtype=np.int64)
    scatter, freedom = np.zeros((total, links)), np.zeros((total, links))
    k1 = linkage.shape.upper_px.shape[0]
    hidden = partly_hidden(frames.w[:, :k1])
    if links == 2:
        hidden |= partly_hidden(frames.w[:, k1:])
    limit = reject_limit(hidden) * linkage.sigma_scale**2
    for first in range(0, total, _CHUNK):
        rows = np.arange(first, min(first + _CHUNK, total))
        part = Frames(frames.xy[rows], frames.w[rows].copy())
        angle = start[rows]
        active = np.arange(rows.size)
        while active.size:
            found = _solve(linkage.shape, part.at(active), angle[active])
            angle[active], d2, now = found.theta, found.d2, rows[active]
            sigma[now], chi2[now], dof[now] = found.sigma, found.chi2, found.dof
            scatter[now], freedom[now] = found.scatter, found.freedom
            worst = d2.max(axis=1)
            bad = worst > limit[now]
            active, d2, worst = active[bad], d2[bad], worst[bad]
            drop = d2 >= _TIE * worst[:, None]
            part.w[active] = np.where(drop, 0.0, part.w[active])
            angle[active] = np.where(np.isnan(angle[active]), start[rows[active]], angle[active])
        theta[rows], used[rows] = angle, part.w > 0
    parameters = 2 * (1 + frames.w.shape[1] + (links - 1)) - links
    seen = np.isfinite(sigma)
    scale = np.empty(links)
    for a in range(links):
        whole, part = seen[:, a] & ~hidden, seen[:, a] & hidden
        scale2 = pooled_scale2(scatter[whole, a], freedom[whole, a], parameters, float(dof[seen[:, a]].sum()))
        factor = hidden_factor(scatter[:, a], freedom[:, a], part, scale2)
        scale[a] = np.sqrt(scale2)
        each = scale[a] * np.where(hidden, factor, 1.0)
        sigma[:, a] *= each * inflation(chi2 / each**2, dof)
    theta = np.where(seen, theta, np.nan)
    return LinkageAngles(linkage, theta, sigma, used, chi2, dof, scale)


@dataclass(frozen=True, eq=False)
class _Solved:
    """Angles (T, L) of some frames and how well the markers agree with them.

    Also normalised misfits d2 (T, N), chi2 and dof (T,), standard errors (T, L), and what
    :func:`~pydpend.kinematics.pose.pooled_scale2` is made of, for each angle (T, L).
    """

    theta: Floats
    d2: Floats
    chi2: Floats
    dof: NDArray[np.int64]
    sigma: Floats
    scatter: Floats
    freedom: Floats


def _solve(shape: Shape, frames: Frames, theta: Floats) -> _Solved:
    links = theta.shape[1]
    theta = np.where(np.isnan(theta), 0.0, theta)
    k1 = shape.upper_px.shape[0]
    for _ in range(_STEPS):
        places, slopes = predicted(shape, theta)
        residual = np.where((frames.w > 0)[..., None], frames.xy - places, 0.0)
        v = regular(information(frames.w, slopes))
        weighted = residual * frames.w[..., None]
        pull = np.stack([np.einsum("tkd,tkd->t", weighted, slopes[..., a]) for a in range(links)], axis=1)
        step = np.linalg.solve(v, pull[..., None])[..., 0]
        theta = theta + np.clip(step, -0.5, 0.5)
        if np.abs(step).max(initial=0.0) < 1e-10:
            break
    places, slopes = predicted(shape, theta)
    residual = np.where((frames.w > 0)[..., None], frames.xy - places, 0.0)
    v = regular(information(frames.w, slopes))
    inverse = np.asarray(np.linalg.inv(v))
    left, spread = remaining(frames.w, slopes, inverse)
    determinant = left[..., 0, 0] * left[..., 1, 1] - left[..., 0, 1] * left[..., 1, 0]
    trace = left[..., 0, 0] + left[..., 1, 1]
    rx, ry = residual[..., 0], residual[..., 1]
    exact = (left[..., 1, 1] * rx**2 - 2 * left[..., 0, 1] * rx * ry + left[..., 0, 0] * ry**2) / np.where(
        determinant > 1e-6, determinant, 1.0
    )
    # With no freedom in one direction the residual lies in the other one.
    d2 = frames.w * np.where(determinant > 1e-6, exact, (rx**2 + ry**2) / np.maximum(trace, 1e-6))
    seen = frames.w > 0
    chi2 = (frames.w * (residual**2).sum(axis=2)).sum(axis=1)
    count = seen.sum(axis=1)
    # The upper angle needs an upper marker or two lower ones; the lower angle a lower one and the upper.
    upper = seen[:, :k1].any(axis=1) | (seen[:, k1:].sum(axis=1) >= 2)
    known = np.stack([upper, upper & seen[:, k1:].any(axis=1)], axis=1)[:, :links]
    dof = np.maximum(2 * count - known.sum(axis=1), 0)
    variance = np.einsum("taa->ta", inverse)
    sigma = np.where(known, np.sqrt(variance), np.nan)
    # What a centre's error does to each angle is w (slopes inverse) times it: only that part of a residual counts.
    share = (frames.w * count[:, None])[..., None] / variance[:, None]
    felt = np.einsum("tkda,tkd->tka", spread, residual)
    scatter = (share * frames.w[..., None] * felt**2).sum(axis=1)
    freedom = (share * np.einsum("tkda,tkde,tkea->tka", spread, left, spread)).sum(axis=1)
    return _Solved(theta, d2, chi2, dof, sigma, scatter, freedom)
