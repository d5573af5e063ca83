"""Rigid pose of one body in every frame, by weighted least squares, robust against bad markers.

With the template ``p_k`` of a body and its centres ``x_k`` of standard uncertainty ``sigma_k``, the pose is
the angle ``theta`` and centre ``c`` that minimise ``sum_k |x_k - c - R(theta) p_k|^2 / sigma_k^2``. For
isotropic uncertainties that has a closed form (the planar case of Umeyama, IEEE PAMI 13 (1991) 376), and

    var(theta) = 1 / sum_k |p_k - p_mean|^2 / sigma_k^2

is the Cramer-Rao bound, with ``p_mean`` the weighted mean of the markers seen in that frame.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from pydpend.errors import AnglesError, fault
from pydpend.kinematics.markers import BodyMarkers
from pydpend.kinematics.scale import (
    PRIOR_DOF,
    hidden_factor,
    inflation,
    partly_hidden,
    pooled_scale2,
    reject_limit,
    suspects,
)
from pydpend.kinematics.table import Floats

LEAST_COVERED = 1.5
"""Suspects that miss by less than this factor are no worse than others: errors along the way of motion do as much."""

TEMPLATE_FRAMES = 10_000
"""The template is learned from at most this many frames, evenly spread: its noise is then 1 % of a marker's."""


@dataclass(frozen=True, eq=False)
class Pose:
    """Pose of one body in T frames; NaN where it cannot be had.

    ``theta_rad`` (T,): turn from the rig's reference picture, counter-clockwise positive, within (-pi, pi].
    ``centre_px`` (T, 2): the template's origin, world directions. ``sigma_rad`` (T,): standard uncertainty.
    ``template_px`` (K, 2): the body's shape, turned as in the rig's reference picture, its mean at the origin.
    ``used`` (T, K): markers used. ``chi2``, ``dof`` (T,): of the residuals with the stated sigmas.
    ``sigma_scale``: factor by which the residuals make the stated sigmas larger; it is in ``sigma_rad``.
    ``covered_factor``: by how much more the sigmas of markers were raised that may be covered at their edge.
    ``doubtful`` (T,): frames where a marker is wrong and it cannot be told which; they have no angle.
    """

    markers: BodyMarkers
    theta_rad: Floats
    centre_px: Floats
    sigma_rad: Floats
    template_px: Floats
    used: NDArray[np.bool_]
    chi2: Floats
    dof: NDArray[np.int64]
    sigma_scale: float
    covered_factor: float
    doubtful: NDArray[np.bool_]

    @property
    def is_alone(self) -> bool:
        """Whether the body has one marker only, and so no pose of its own."""
        return len(self.markers.nodes) == 1


def alone(markers: BodyMarkers) -> Pose:
    """A body of one marker in place of poses: its marker, and no angle in any frame."""
    total = markers.weight.shape[0]
    none = np.full(total, np.nan)
    return Pose(
        markers,
        none,
        np.full((total, 2), np.nan),
        none,
        np.zeros((1, 2)),
        markers.seen,
        np.zeros(total),
        np.zeros(total, dtype=np.int64),
        1.0,
        1.0,
        np.zeros(total, dtype=bool),
    )


@dataclass(frozen=True, eq=False)
class Fitted:
    """One closed-form solution for all frames: angle, centre, information on the angle, residuals, d2 (T, K).

    ``scatter`` over ``freedom`` (T, 2), along and across the turn, is the squared scale of the sigmas as the angle
    feels it: see :func:`pooled_scale2`.
    """

    theta: Floats
    centre: Floats
    information: Floats
    chi2: Floats
    count: NDArray[np.int64]
    d2: Floats
    scatter: Floats
    freedom: Floats


def rotate(theta: Floats, vectors: Floats) -> Floats:
    """Vectors (..., 2) turned counter-clockwise by ``theta`` (...)."""
    c, s = np.cos(theta), np.sin(theta)
    x, y = vectors[..., 0], vectors[..., 1]
    return np.stack([c * x - s * y, s * x + c * y], axis=-1)


def solve(xy: Floats, w: Floats, template: Floats) -> Fitted:
    """Closed-form poses. ``xy`` (T, K, 2), ``w`` (T, K) with 0 for "not there", ``template`` (K, 2)."""
    # Frames last, so that sums over the few markers run along whole rows.
    x, y, w = (np.ascontiguousarray(part.T) for part in (xy[..., 0], xy[..., 1], w))
    count = np.count_nonzero(w > 0, axis=0)
    total = np.where(count > 0, w.sum(axis=0), 1.0)
    mean = [(w * part).sum(axis=0) / total for part in (x, y)]
    origin = [part @ w / total for part in template.T]
    dx, dy = x - mean[0], y - mean[1]
    px, py = (part[:, None] - o for part, o in zip(template.T, origin, strict=True))
    theta = np.arctan2((w * (px * dy - py * dx)).sum(axis=0), (w * (px * dx + py * dy)).sum(axis=0))
    arm2 = px**2 + py**2
    turning = w * arm2
    information = turning.sum(axis=0)
    some = np.where(information > 0, information, 1.0)
    c, s = np.cos(theta), np.sin(theta)
    turned_x, turned_y = c * px - s * py, s * px + c * py
    left_x, left_y = dx - turned_x, dy - turned_y
    chi2 = (w * (left_x**2 + left_y**2)).sum(axis=0)
    # Along the direction in which the marker moves when the body turns, a residual has lost one more part of
    # its variance to the fit than across it: w/W + w arm^2/I against w/W.
    arm = np.sqrt(np.where(arm2 > 0, arm2, 1.0))
    radial = (left_x * turned_x + left_y * turned_y) / arm
    tangential = (left_y * turned_x - left_x * turned_y) / arm
    free_radial = 1.0 - w / total
    free_tangential = free_radial - turning / some
    d2 = _part(w, radial, free_radial) + _part(w, tangential, free_tangential)
    share = turning * (count / some)
    scatter = np.stack([(share * w * r**2).sum(axis=0) for r in (tangential, radial)], axis=1)
    freedom = np.stack([(share * f).sum(axis=0) for f in (free_tangential, free_radial)], axis=1)
    good = (count >= 2) & (information > 0)
    centre = np.stack(
        [mean[0] - (c * origin[0] - s * origin[1]), mean[1] - (s * origin[0] + c * origin[1])], axis=1
    )
    return Fitted(
        np.where(good, theta, np.nan),
        np.where(good[:, None], centre, np.nan),
        np.where(good, information, np.nan),
        chi2,
        count,
        d2.T,
        scatter,
        freedom,
    )


def _part(w: Floats, residual: Floats, left: Floats) -> Floats:
    """Squared residual over its own variance; 0 where the fit leaves it no freedom."""
    free = left > 1e-6
    return np.where(free, w * residual**2 / np.where(free, left, 1.0), 0.0)


def fit_pose(markers: BodyMarkers) -> Pose:
    """The pose of one body in every frame, its template learned from the whole recording.

    The template starts as the rig's, is refined by medians (which a few bad markers do not move) and then by
    means, so its own noise falls with the square root of the recording's length instead of staying in every
    angle as a constant. Markers that do not fit are left out; frames where two markers are left that disagree
    have no angle.

    Raises :class:`AnglesError` if the body never shows two markers in one frame.
    """
    w = markers.weight
    if not (np.count_nonzero(w > 0, axis=1) >= 2).any():
        raise AnglesError(
            fault(
                "nodes",
                f"the body {markers.name} never shows two of its nodes in one frame",
                "A body of one marker has its angle from its joint: leave the nodes that are never seen out of the rig",
            )
        )
    template, scale2 = _template(markers)
    hidden = partly_hidden(w)
    markers, covered = _less_sure(markers, template, scale2, suspects(w, hidden))
    used, doubtful, fitted = _reject(markers, template, scale2)
    dof = np.maximum(2 * fitted.count - 3, 0)
    good = np.isfinite(fitted.theta) & ~doubtful
    told = good & (dof > 0)
    # A moving marker's centre errs more along its way than across it, and the way along is what turns the body. But
    # pixels that are not square show in the distances first; and two markers have nothing but their distance.
    whole, parameters, counted = told & ~hidden, 2 * template.shape[0] - 3, float(dof[told].sum())
    along, both = (
        pooled_scale2(fitted.scatter[whole, :n], fitted.freedom[whole, :n], parameters, counted)
        for n in (1, 2)
    )
    n = 1 if along > both and fitted.freedom[told, 0].any() else 2
    scale2 = along if n == 1 else both
    factor = hidden_factor(fitted.scatter[:, :n], fitted.freedom[:, :n], hidden & told, scale2)
    each2 = np.where(hidden, factor**2, 1.0) * scale2
    sigma = np.sqrt(each2 / fitted.information) * inflation(fitted.chi2 / each2, dof)
    theta = np.where(good, fitted.theta, np.nan)
    centre = np.where(good[:, None], fitted.centre, np.nan)
    sigma = np.where(good, sigma, np.nan)
    return Pose(
        markers,
        theta,
        centre,
        sigma,
        template,
        used,
        fitted.chi2,
        dof,
        float(np.sqrt(scale2)),
        covered,
        doubtful,
    )


def _less_sure(
    markers: BodyMarkers, template: Floats, scale2: float, suspect: NDArray[np.bool_]
) -> tuple[BodyMarkers, float]:
    """The sigmas of suspect markers (T, K) made as large as these markers miss the pose of the others, on the whole.

    A marker that is covered at its edge still looks like one, and its centre is off by many of its sigmas; in one frame
    with little else to see that does not show, in all of them it does.
    """
    rows = np.flatnonzero(suspect.any(axis=1))
    others = markers.without(suspect).at(rows)
    fitted = solve(others.xy_px, others.weight, template)
    total = others.weight.sum(axis=1, keepdims=True)
    with np.errstate(divide="ignore", invalid="ignore"):
        arm2 = ((template - (others.weight @ template / total)[:, None]) ** 2).sum(axis=2)
        # Variance of where the others put a marker, each coordinate, in units of the marker's own.
        there = markers.weight[rows] * (1 / total + arm2 / 2 / fitted.information[:, None])
    miss = others.xy_px - fitted.centre[:, None] - rotate(fitted.theta[:, None], template[None])
    told = suspect[rows] & np.isfinite(there)
    miss2 = markers.weight[rows][told] * (miss[told] ** 2).sum(axis=1) / scale2 - 2 * there[told]
    count = 1 / (1 + there[told]) ** 2
    factor2 = (float((count * miss2).sum()) + PRIOR_DOF) / (2 * float(count.sum()) + PRIOR_DOF)
    if factor2 < LEAST_COVERED**2:
        return markers, 1.0
    weight = np.where(suspect, markers.weight / factor2, markers.weight)
    return replace(markers, weight=weight), float(np.sqrt(factor2))


def _template(markers: BodyMarkers) -> tuple[Floats, float]:
    """The template and the square of the sigmas' scale, from frames spread over the recording."""
    frames = np.flatnonzero(np.count_nonzero(markers.seen, axis=1) >= 2)
    some = markers.at(frames[evenly(frames.size, TEMPLATE_FRAMES)])
    template = _first_template(some)
    scale2 = 1.0
    for _ in range(2):
        scale2 = _robust_scale2(solve(some.xy_px, some.weight, template))
        used, _, fitted = _reject(some, template, scale2)
        template = _mean_template(some, np.where(used, some.weight, 0.0), template, fitted)
    return template, scale2


def evenly(total: int, most: int) -> NDArray[np.int64]:
    """At most ``most`` of ``total`` indices, evenly spread."""
    return np.unique(np.linspace(0, total - 1, min(total, most)).astype(np.int64))


def _first_template(markers: BodyMarkers) -> Floats:
    template: Floats = markers.reference_px - markers.reference_px.mean(axis=0)
    xy, w = markers.xy_px, markers.weight
    for _ in range(3):
        fitted = solve(xy, w, template)
        back: Floats = rotate(-fitted.theta[:, None], xy - fitted.centre[:, None, :])
        back = np.where((w > 0)[..., None], back, np.nan)
        known = (w > 0).any(axis=0)
        better = template.copy()
        better[known] = np.asarray(np.nanmedian(back[:, known], axis=0))
        template = _aligned(better, markers.reference_px)
    return template


def _mean_template(markers: BodyMarkers, w: Floats, template: Floats, fitted: Fitted) -> Floats:
    good = np.isfinite(fitted.theta)
    back = rotate(-fitted.theta[good][:, None], markers.xy_px[good] - fitted.centre[good][:, None, :])
    weight = w[good]
    total = weight.sum(axis=0)
    mean = np.einsum("tk,tkd->kd", weight, back) / np.where(total > 0, total, 1.0)[:, None]
    return _aligned(np.where((total > 0)[:, None], mean, template), markers.reference_px)


def _aligned(template: Floats, reference: Floats) -> Floats:
    """The template with its mean at the origin and turned as the reference is: this fixes what 0 means."""
    p = template - template.mean(axis=0)
    q = reference - reference.mean(axis=0)
    turn = np.arctan2((p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]).sum(), (p * q).sum())
    return rotate(np.full(p.shape[0], turn), p)


def _robust_scale2(fitted: Fitted) -> float:
    """Median of chi2 over its median by chance: outliers and short recordings do not move it much."""
    dof = 2 * fitted.count - 3
    frames = dof > 0
    if np.count_nonzero(frames) < 30:
        return 1.0
    middle = 2 * scipy.special.gammaincinv(np.arange(1, int(dof.max()) + 1) / 2, 0.5)
    return max(float(np.median(fitted.chi2[frames] / middle[dof[frames] - 1])), 1e-12)


def _reject(
    markers: BodyMarkers, template: Floats, scale2: float
) -> tuple[NDArray[np.bool_], NDArray[np.bool_], Fitted]:
    """Leaves out, one by one, the marker that fits worst, as long as it fits too badly."""
    used = markers.seen.copy()
    limit = reject_limit(partly_hidden(markers.weight)) * max(scale2, 1e-12)
    full = solve(markers.xy_px, markers.weight, template)
    doubtful = np.zeros(used.shape[0], dtype=bool)
    frames = np.flatnonzero((full.d2 > limit[:, None]).any(axis=1))
    d2 = full.d2[frames]
    while frames.size:
        count = np.count_nonzero(used[frames], axis=1)
        # Two markers that do not agree on their distance: one is wrong, and nothing says which.
        doubtful[frames[count <= 2]] = True
        frames, d2 = frames[count > 2], d2[count > 2]
        if not frames.size:
            break
        three = count[count > 2] == 3
        if three.any():
            drop, open_question = _one_of_three(markers, template, used, frames[three], scale2)
            used[frames[three], drop] = False
            doubtful[frames[three][open_question]] = True
        rest = frames[~three]
        used[rest, np.argmax(d2[~three], axis=1)] = False
        frames = rest
        again = solve(markers.xy_px[frames], np.where(used[frames], markers.weight[frames], 0.0), template)
        bad = (again.d2 > limit[frames, None]).any(axis=1)
        frames, d2 = frames[bad], again.d2[bad]
    changed = np.flatnonzero((used != markers.seen).any(axis=1))
    if changed.size:
        again = solve(markers.xy_px[changed], np.where(used[changed], markers.weight[changed], 0.0), template)
        for part in fields(Fitted):
            getattr(full, part.name)[changed] = getattr(again, part.name)
    return used, doubtful, full


def _one_of_three(
    markers: BodyMarkers, template: Floats, used: NDArray[np.bool_], frames: NDArray[np.int64], scale2: float
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """The index of the marker to leave out of three, and the frames in which that stays an open question.

    With three markers two different ones can explain the same disagreement. So all answers are tried: if two
    fit and their angles differ by more than five standard errors, nothing tells which is right.
    """
    xy = markers.xy_px[frames]
    w = np.where(used[frames], markers.weight[frames], 0.0)
    index = np.argsort(~used[frames], axis=1, kind="stable")[:, :3]
    rows = np.arange(frames.size)
    theta, variance, worst = (np.empty((frames.size, 3)) for _ in range(3))
    for j in range(3):
        pair = w.copy()
        pair[rows, index[:, j]] = 0.0
        fitted = solve(xy, pair, template)
        theta[:, j], worst[:, j] = fitted.theta, fitted.d2.max(axis=1)
        variance[:, j] = scale2 / fitted.information
    best = np.argmin(worst, axis=1)
    fits = worst <= reject_limit(np.zeros(1, dtype=bool)) * scale2
    apart = np.abs(np.angle(np.exp(1j * (theta - theta[rows, best][:, None]))))
    differs = apart > 5.0 * np.sqrt(variance + variance[rows, best][:, None])
    return index[rows, best], ~fits.any(axis=1) | (fits & differs).any(axis=1)
