"""How the places and the turn of a body follow the five numbers of the camera, and what its residuals say of them.

All is linear about the camera that was used: a body's places in the plane move by ``M_k(t) dz``, its pose and its shape
with them, and what these cannot take up is left in the residuals.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pydpend._native import plane_slopes
from pydpend.kinematics.markers import BodyMarkers, world_turn
from pydpend.kinematics.pose import TEMPLATE_FRAMES, Pose, evenly, rotate
from pydpend.kinematics.table import CAMERA_NUMBERS, Floats

if TYPE_CHECKING:
    from pydpend.nodes import Nodes

_CHUNK = 8192

KEY_STEP_PX = 1.0
"""A frame tells something of the camera if some marker has moved by this since the last one that did: while nothing
moves, the same error is seen again and again."""

ROUNDS = 6
"""Most times that shape and poses are fitted in turn: one is enough where all frames show the same markers."""

SETTLED = 1e-4
"""Change of the shape's derivatives, relative, at which they have settled: a ten-thousandth of the camera's part."""


@dataclass(frozen=True, eq=False)
class Evidence:
    """Information of a body's residuals on the camera's numbers, with the stated sigmas.

    ``information`` (5, 5) and ``score`` (5,): second and first derivatives of half of ``chi2``, which has ``dof``
    degrees of freedom.
    """

    information: Floats
    score: Floats
    chi2: float
    dof: int

    def chi2_at(self, step: Floats) -> float:
        """Squared residuals with the camera's numbers a ``step`` (5,) away."""
        return float(self.chi2 + 2 * step @ self.score + step @ self.information @ step)


class BodyView:
    """One body in the frames of a recording, seen through the camera of its rig.

    ``theta_rad`` (T,) and ``weight`` (T, K) are of the poses; weights are 0 where a marker was not used.
    ``template_moves`` (K, 2, 5), the shape's derivatives, are found from these frames if they are not given.
    """

    def __init__(
        self,
        nodes: Nodes,
        markers: BodyMarkers,
        theta_rad: Floats,
        template_px: Floats,
        *,
        mirrored: bool,
        template_moves: Floats | None = None,
    ) -> None:
        rig = nodes.rig
        at = {(n.body, n.name): i for i, n in enumerate(rig.nodes)}
        self.index = [at[markers.name, name] for name in markers.nodes]
        self.nodes, self.markers, self.rig = nodes, markers, rig.to_json()
        self.theta_rad, self.template_px = theta_rad, template_px
        self.turn = world_turn(mirrored)
        self.weight = np.where(np.isfinite(theta_rad)[:, None], markers.weight, 0.0)
        reference = np.array([[rig.nodes[i].x_px, rig.nodes[i].y_px] for i in self.index], dtype=np.float64)
        self.reference_moves = self._slopes(reference[None])[0]
        if template_moves is None:
            rows = np.flatnonzero(np.count_nonzero(self.weight, axis=1) >= 2)
            template_moves = self.shape_moves(rows[evenly(rows.size, TEMPLATE_FRAMES)])
        self.template_moves = template_moves

    @classmethod
    def of(cls, nodes: Nodes, pose: Pose, mirrored: bool) -> BodyView:
        """A body with its poses in a recording."""
        used = pose.markers.without(~pose.used)
        if pose.is_alone:
            # It has no shape that could tell of the camera, and no turn of its own.
            seen = np.where(used.seen[:, 0], 0.0, np.nan)
            still = np.zeros((1, 2, CAMERA_NUMBERS))
            return cls(nodes, used, seen, pose.template_px, mirrored=mirrored, template_moves=still)
        return cls(nodes, used, pose.theta_rad, pose.template_px, mirrored=mirrored)

    def _slopes(self, recorded_px: Floats) -> Floats:
        """Derivatives (n, K, 2, 5) of world places by the numbers, at recorded places (n, K, 2); 0 where not seen."""
        flat = np.ascontiguousarray(np.nan_to_num(recorded_px).reshape(-1, 2))
        return plane_slopes(self.rig, flat).reshape(*recorded_px.shape, CAMERA_NUMBERS) * self.turn[:, None]

    def moves(self, rows: NDArray[np.int64] | slice) -> Floats:
        """Derivatives (n, K, 2, 5) of the markers' places in some frames."""
        return self._slopes(self.nodes.xy_px[rows][:, self.index])

    def moved(self, step: Floats) -> BodyMarkers:
        """The body's markers as a camera shows them whose numbers are a ``step`` (5,) away."""
        parts = [self.moves(rows) @ step for rows in chunks(self.theta_rad.size)]
        return replace(
            self.markers,
            xy_px=np.where(self.markers.seen[..., None], self.markers.xy_px + np.concatenate(parts), 0.0),
            reference_px=self.markers.reference_px + self.reference_moves @ step,
        )

    def _response(self, rows: NDArray[np.int64] | slice, shape_moves: Floats) -> tuple[Floats, Floats]:
        """How turns (n, 5) and residuals (n, K, 2, 5) in some frames follow the camera's numbers."""
        w, theta = self.weight[rows], np.nan_to_num(self.theta_rad[rows])
        moved = self.moves(rows) - _rotate_all(
            theta, np.broadcast_to(shape_moves, (w.shape[0], *shape_moves.shape))
        )
        total = np.where(w.any(axis=1), w.sum(axis=1), 1.0)
        template = self.template_px
        arm = rotate(theta[:, None], template - (w @ template / total[:, None])[:, None])
        across = np.stack([-arm[..., 1], arm[..., 0]], axis=-1)
        off = moved - (np.einsum("tk,tkdc->tdc", w, moved) / total[:, None, None])[:, None]
        turning = np.einsum("tk,tkd->t", w, arm**2)
        weighted = w[..., None] * across
        turns = np.einsum("tkd,tkdc->tc", weighted, off) / np.where(turning > 0, turning, 1.0)[:, None]
        return turns, off - across[..., None] * turns[:, None, None, :]

    def shape_moves(self, rows: NDArray[np.int64]) -> Floats:
        """Derivatives (K, 2, 5) of the shape as it is learned from some frames, turned as the reference picture is."""
        moves = np.zeros_like(self.reference_moves)
        w, theta = self.weight[rows], self.theta_rad[rows]
        total = w.sum(axis=0)
        for _ in range(ROUNDS):
            _, left = self._response(rows, moves)
            back = _rotate_all(-theta, left)
            step = np.einsum("tk,tkdc->kdc", w, back) / np.where(total > 0, total, 1.0)[:, None, None]
            moves = moves + step
            if np.abs(step).max() < SETTLED * np.abs(moves).max():
                break
        p = self.template_px
        q = self.markers.reference_px
        q = q - q.mean(axis=0)
        dq = self.reference_moves - self.reference_moves.mean(axis=0)
        moves = moves - moves.mean(axis=0)
        # The turn that lays the shape on the reference places must stay none.
        off = np.einsum("kc,k->c", moves[:, 0], q[:, 1]) - np.einsum("kc,k->c", moves[:, 1], q[:, 0])
        off += np.einsum("kc,k->c", dq[:, 1], p[:, 0]) - np.einsum("kc,k->c", dq[:, 0], p[:, 1])
        across = np.stack([-p[:, 1], p[:, 0]], axis=1)
        return np.asarray(moves + across[..., None] * (off / float((p * q).sum())))

    def turns(self) -> Floats:
        """Derivatives (T, 5) of the turn from the reference picture; NaN where there is none."""
        theta = self.theta_rad
        out = np.full((theta.size, CAMERA_NUMBERS), np.nan)
        for rows in chunks(theta.size):
            out[rows] = self._response(rows, self.template_moves)[0]
        return np.where(np.isfinite(theta)[:, None], out, np.nan)

    def evidence(self, centre_px: Floats) -> Evidence:
        """Information of residuals about poses at ``centre_px`` (T, 2), with the shape from the frames that count."""
        if self.template_px.shape[0] == 1:
            return Evidence(np.zeros((CAMERA_NUMBERS, CAMERA_NUMBERS)), np.zeros(CAMERA_NUMBERS), 0.0, 0)
        rows = self._key_frames(centre_px)
        moves = self.shape_moves(rows)
        information, score = np.zeros((CAMERA_NUMBERS, CAMERA_NUMBERS)), np.zeros(CAMERA_NUMBERS)
        chi2, count = 0.0, 0
        for some in chunks(rows.size):
            now = rows[some]
            _, left = self._response(now, moves)
            w = self.weight[now]
            places = centre_px[now, None] + rotate(self.theta_rad[now, None], self.template_px)
            residual = np.where((w > 0)[..., None], self.markers.xy_px[now] - places, 0.0)
            weighted = w[..., None, None] * left
            information += np.einsum("tkda,tkdb->ab", weighted, left)
            score += np.einsum("tkda,tkd->a", weighted, residual)
            chi2 += float((w[..., None] * residual**2).sum())
            count += 2 * int(np.count_nonzero(w)) - 3 * w.shape[0]
        shape = 2 * self.template_px.shape[0] - 3
        return Evidence(information, score, chi2, max(count - shape, 0))

    def _key_frames(self, centre_px: Floats) -> NDArray[np.int64]:
        """Frames between which some marker has moved, at most `TEMPLATE_FRAMES`."""
        rows = np.flatnonzero(np.count_nonzero(self.weight, axis=1) >= 2)
        rows = rows[evenly(rows.size, TEMPLATE_FRAMES)] if rows.size else rows
        places = centre_px[rows, None] + rotate(self.theta_rad[rows, None], self.template_px)
        kept: list[int] = []
        last = np.full(places.shape[1:], np.inf)
        for row, now in zip(rows.tolist(), places, strict=True):
            if np.abs(now - last).max() >= KEY_STEP_PX:
                kept.append(row)
                last = now
        return np.array(kept, dtype=np.int64)


def _rotate_all(theta: Floats, vectors: Floats) -> Floats:
    """Vectors (n, K, 2, C) turned by ``theta`` (n,)."""
    c, s = np.cos(theta)[:, None, None], np.sin(theta)[:, None, None]
    x, y = vectors[:, :, 0], vectors[:, :, 1]
    return np.stack([c * x - s * y, s * x + c * y], axis=2)


def chunks(total: int) -> Iterator[slice]:
    """Slices that together are ``total`` rows."""
    for first in range(0, total, _CHUNK):
        yield slice(first, min(first + _CHUNK, total))
