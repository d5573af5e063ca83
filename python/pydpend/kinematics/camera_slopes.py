"""How the angles of each estimator, and their zero, follow the camera's numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pydpend.kinematics.body_view import BodyView, chunks
from pydpend.kinematics.camera import central_differences
from pydpend.kinematics.linkage import FIT_FRAMES, Frames, Shape, fit_shape
from pydpend.kinematics.linkage_frames import LinkageAngles, angles_of
from pydpend.kinematics.markers import BodyMarkers, body_markers
from pydpend.kinematics.pairwise import pair_angles
from pydpend.kinematics.pose import evenly, solve
from pydpend.kinematics.table import CAMERA_NUMBERS, Floats

NEAR_ZERO_RAD = np.radians(0.3)
"""Frames of a recording at rest in which a link is this near to its zero say what the camera does to the zero."""


def rigid_slopes(views: Sequence[BodyView]) -> Floats:
    """Derivatives (T, L, 5) of the turns of each body's pose."""
    return np.stack([view.turns() for view in views], axis=1)


def _moved(view: BodyView, rows: slice | NDArray[np.int64], number: int, step: float) -> BodyMarkers:
    """Some frames of a body as a camera with another number shows them."""
    m = view.markers
    return replace(
        m,
        xy_px=m.xy_px[rows] + step * view.moves(rows)[..., number],
        weight=view.weight[rows],
        reference_px=m.reference_px + step * view.reference_moves[..., number],
    )


def pairwise_slopes(views: Sequence[BodyView]) -> Floats:
    """Derivatives (T, L, 5) of the mean turns of the pairs, by central differences."""
    return np.stack([_pairwise(view) for view in views], axis=1)


def _pairwise(view: BodyView) -> Floats:
    """Slopes of one body's angle, (T, 5)."""
    w = view.weight
    complete = np.flatnonzero((w > 0).all(axis=1))[:1]
    parts = []
    for rows in chunks(w.shape[0]):

        def turned(number: int, step: float, rows: slice = rows) -> Floats:
            moved = _moved(view, rows, number, step)
            reference = moved.reference_px
            if complete.size:
                reference = _moved(view, complete, number, step).xy_px[0]
            return pair_angles(moved, reference).mean_rad[:, None]

        parts.append(central_differences(turned)[:, 0])
    return np.concatenate(parts)


def linkage_slopes(views: Sequence[BodyView], weight: Floats, linked: LinkageAngles) -> Floats:
    """Derivatives (T, L, 5) of the linkage's angles, its shape fitted again, by central differences.

    ``weight`` (T, N): of all markers, the upper link's first. The mean over the frames is that of the rigid poses':
    where the shape stands in the reference picture is theirs.
    """
    theta = linked.theta_rad
    posed = np.stack([np.isfinite(view.theta_rad) for view in views], axis=1)
    rows = np.flatnonzero((np.isfinite(theta) & posed).all(axis=1))
    rows = rows[evenly(rows.size, FIT_FRAMES)]
    shapes: dict[tuple[int, bool], Shape] = {}

    def shape_of(number: int, step: float) -> Shape:
        key = (number, step > 0)
        if key not in shapes:
            moved = [_moved(view, rows, number, step) for view in views]
            shapes[key] = fit_shape(moved, linked.linkage.shape, theta[rows])[0].shape
        return shapes[key]

    out = np.full((*theta.shape, CAMERA_NUMBERS), np.nan)
    for part in chunks(theta.shape[0]):

        def turned(number: int, step: float, part: slice = part) -> Floats:
            frames = Frames.of([_moved(view, part, number, step) for view in views])
            used = Frames(frames.xy, np.where(linked.used[part], weight[part], 0.0))
            return angles_of(shape_of(number, step), used, theta[part])

        out[part] = central_differences(turned)
    rigid = rigid_slopes(views)
    both = np.isfinite(rigid) & np.isfinite(out)
    apart = np.where(both, out - rigid, 0.0).sum(axis=0) / np.maximum(both.sum(axis=0), 1)
    return np.asarray(out - apart)


def zero_slopes(
    zero: object,
    meta: dict[str, Any],
    value_rad: Floats,
    t_s: Floats,
    slopes: Floats,
    views: Sequence[BodyView],
    mirrored: bool,
) -> Floats:
    """Derivatives (L, 5) of the zero that was taken off, `value_rad` (L,), with what its ``meta`` says of it.

    The picture's vertical is as uncertain as the camera's roll; with it the mean over the frames is taken off.
    """
    if isinstance(zero, str) and meta["from"] == "rest":
        still = np.zeros(t_s.size, dtype=bool)
        for rest in meta["rests"]:
            still |= rest["hanging"] & (t_s >= rest["start_s"]) & (t_s <= rest["stop_s"])
        return _mean(slopes[still])
    if isinstance(zero, str) and zero != "reference_frame":
        return _mean(slopes)
    if meta["from"] == "reference recording":
        return _mean_at_rest(zero, value_rad, views, mirrored)
    return np.zeros(slopes.shape[1:])


def _mean_at_rest(reference: Any, value_rad: Floats, views: Sequence[BodyView], mirrored: bool) -> Floats:
    """The zero's derivatives (L, 5) where it is the rest of another recording."""
    names = [view.markers.name for view in views]
    out = np.zeros((len(views), CAMERA_NUMBERS))
    for k, (view, other) in enumerate(zip(views, body_markers(reference, names, mirrored), strict=True)):
        theta = solve(other.xy_px, other.weight, view.template_px).theta
        near = np.abs(np.angle(np.exp(1j * (theta - value_rad[k])))) < NEAR_ZERO_RAD
        theta = np.where(near, theta, np.nan)
        seen = BodyView(
            reference, other, theta, view.template_px, mirrored=mirrored, template_moves=view.template_moves
        )
        out[k] = _mean(seen.turns()[:, None])[0]
    return out


def _mean(slopes: Floats) -> Floats:
    """Mean over the frames, (L, 5); 0 of none."""
    known = np.isfinite(slopes)
    return np.asarray(np.where(known, slopes, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1))
