"""How the angles of each estimator, and their zero, follow the camera's numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pydpend.kinematics.body_view import BodyView, chunks
from pydpend.kinematics.camera import central_differences
from pydpend.kinematics.first_shape import FIT_FRAMES
from pydpend.kinematics.linkage import Given, eliminated, inverted, normal_priors
from pydpend.kinematics.linkage_frames import LinkageAngles
from pydpend.kinematics.markers import BodyMarkers, body_markers
from pydpend.kinematics.pairwise import pair_angles
from pydpend.kinematics.pose import evenly, solve
from pydpend.kinematics.shape import Frames, Shape, State, information, predicted, regular, shape_response
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


def linkage_slopes(
    views: Sequence[BodyView], linked: LinkageAngles, given: Mapping[str, Given] | None = None
) -> Floats:
    """Derivatives (T, L, 5) of the linkage's angles by the camera's numbers, its shape fitted again.

    ``given``: joints that are known. The mean over the frames is that of the rigid poses': where the shape stands in
    the reference picture is theirs.
    """
    shape, theta = linked.linkage.shape, linked.theta_rad
    frames = Frames.of([view.markers for view in views], shape)
    w = frames.w.copy()
    w[:, : len(shape.of_link)] = np.where(linked.used, w[:, : len(shape.of_link)], 0.0)
    posed = np.stack([np.isfinite(view.theta_rad) for view in views], axis=1)
    rows = np.flatnonzero((np.isfinite(theta) & posed).all(axis=1))
    rows = rows[evenly(rows.size, FIT_FRAMES)]
    normal = normal_priors(shape, given)
    right = np.zeros((len(normal), CAMERA_NUMBERS))
    for part in chunks(rows.size):
        some = rows[part]
        _, slopes = predicted(shape, linked.state.at(some))
        told = eliminated(shape, w[some], theta[some], slopes, _all_moves(views, shape, some))
        normal, right = normal + told.normal, right + told.right
    follows = inverted(shape, normal) @ right
    out = np.full((*theta.shape, CAMERA_NUMBERS), np.nan)
    for part in chunks(theta.shape[0]):
        state = State(np.nan_to_num(theta[part]), np.nan_to_num(linked.state.place[part]))
        _, slopes = predicted(shape, state)
        inverse = np.asarray(np.linalg.inv(regular(information(w[part], slopes))))
        moves = _all_moves(views, shape, part) * w[part][..., None, None]
        direct = inverse @ np.einsum("tkdu,tkdc->tuc", slopes, moves)
        response = shape_response(shape, state.theta, w[part], slopes, inverse)
        out[part] = (direct + response @ follows)[:, : shape.links]
    out = np.where(np.isfinite(theta)[..., None], out, np.nan)
    rigid = rigid_slopes(views)
    both = np.isfinite(rigid) & np.isfinite(out)
    apart = np.where(both, out - rigid, 0.0).sum(axis=0) / np.maximum(both.sum(axis=0), 1)
    return np.asarray(out - apart)


def _all_moves(views: Sequence[BodyView], shape: Shape, rows: NDArray[np.int64] | slice) -> Floats:
    """Derivatives (n, N + C, 2, 5) of all places of some frames by the camera's numbers; closures stay."""
    moves = np.concatenate([view.moves(rows) for view in views], axis=1)
    still = np.zeros((len(moves), len(shape.closures), 2, CAMERA_NUMBERS))
    return np.concatenate([moves, still], axis=1)


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
