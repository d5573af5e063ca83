"""The direction in which the links would hang, by their own motion: equations of motion with every constant unknown.

With the link's turns ``a``, ``b`` from any direction, and ``d = b - a``, the free double pendulum obeys

    2 a'' + C b'' + C' b'^2 + S sin(a - a0) + friction = 0,    2 L b'' + C a'' - C' a'^2 + K sin(b - b0) + friction = 0

with ``C = P cos d + Q sin d`` and ``C'`` its derivative. These are linear in ``L, P, Q, S sin a0, S cos a0,
K sin b0, K cos b0`` and in viscous and dry friction, so that any stretch of free motion gives the angles ``a0, b0`` at
which the links hang, whatever the pendulum is made of and however the camera was held.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pydpend.kinematics.table import Floats

CENTRES = 800
"""Instants at which the equations are asked, at most."""

REACH_S = 0.15
"""Rates and accelerations come from cubics over at most this long on both sides, s."""

TURN_RAD = {1: 0.35, 2: 0.6}
"""And over no more than this turn of a link, by the number of links: as far as a cubic follows a swing (to about 1 %).
Where two links tumble the noise of shorter ones is worse than what longer ones miss: at 0.6 rad the errors of the lower
link's zero are half of those at 0.35 rad (40 drops of 3 to 12 s)."""

LEAST_SIDE = 2
"""Samples on each side of a cubic, at least: one more sample than it has coefficients."""

MODEL = 0.05
"""Part of the equations' size by which they may be missed: lens and tilt, air drag, dry friction, cubics."""

STILL = 0.03
"""Instants slower than this part of the largest rate say nothing of a motion: held, or hanging."""

SPEED_S = 0.15
"""Which those are is told by the angles' change over this long, s."""

REVERSALS = 2
"""With fewer turns back a motion may be one lift or one lowering by hand, and the picture must agree with its zero."""

UPRIGHT_RAD = np.radians(20.0)
"""To within this: a camera held in the hand is rolled by less."""

ZERO_AT = {1: (0,), 2: (3, 5)}
"""Columns of the equations in which the moments of gravity begin, by the number of links."""

LEAST_INSTANTS = 30
"""A stretch of free motion has at least this many instants."""

FREE_SHARE = 0.3
"""And at least this part of all instants in motion: the rest may be moved by hand."""

ROUNDS = 3
"""How often the instants that obey the equations are found again."""

KNOWN_RAD = np.radians(5.0)
"""A zero less sure than this is not known from the motion."""


TOLERANCE_RAD = np.radians([0.5, 5.0])
"""Least and most by which a rest may lie off the zero of a wide swing whose stated uncertainty is small: dry friction
lets a joint stop off its zero, and fast tumbling followed by cubics was seen to miss by 3 deg
(docs/validation/robustness.md)."""

SIGMAS = 6.0
"""Beyond so many standard uncertainties of the swing's zero another zero is not the same."""


@dataclass(frozen=True, eq=False)
class Swing:
    """The direction in which the links would hang, by their motion.

    ``zero_rad`` (L,): turns within (-pi, pi]; ``sigma_rad`` (L,): standard uncertainties; ``width_rad`` (L,): half of
    the range over which each link moves; ``share``: part of the instants in motion that obeys the equations;
    ``dry``: whether these are surest with dry friction, which lets a link stop off its zero;
    ``start_s``: the first of those instants.
    """

    zero_rad: Floats
    sigma_rad: Floats
    width_rad: Floats
    share: float
    dry: bool
    start_s: float

    def off(self, turn_rad: Floats) -> Floats:
        """The distance of turns (L,) from the swing's zero, rad, within (-pi, pi]."""
        return within_half_turn(turn_rad - self.zero_rad)

    def refutes(self, turn_rad: Floats, sigma_rad: Floats | float = 0.0) -> bool:
        """Whether the swing goes about another direction than the turns (L,), known to ``sigma_rad``."""
        near = np.clip(self.width_rad / 2, *TOLERANCE_RAD)
        allowed = np.maximum(SIGMAS * np.hypot(self.sigma_rad, sigma_rad), near)
        return bool((np.abs(self.off(turn_rad)) > allowed).any())


def within_half_turn(angle_rad: Floats) -> Floats:
    """Angles less whole turns, within (-pi, pi]."""
    return np.asarray(np.pi - (np.pi - angle_rad) % (2 * np.pi))


@dataclass(frozen=True, eq=False)
class _Local:
    """Angles, rates and accelerations (n, L) at n instants, with the standard errors of the last two (n,)."""

    t_s: Floats
    phi: Floats
    w: Floats
    a: Floats
    w_sigma: Floats
    a_sigma: Floats
    reach_s: Floats

    def at(self, keep: NDArray[np.bool_]) -> _Local:
        return _Local(*(getattr(self, f)[keep] for f in self.__dataclass_fields__))


def find_swing(t_s: Floats, phi_rad: Floats, noise_rad: float, down_rad: Floats) -> Swing | None:
    """The zero of the free motion in turns ``phi_rad`` (T, L), NaN where not seen; ``None`` if it does not say.

    ``noise_rad``: standard deviation of one angle. ``down_rad`` (L,): turn at which each link points down in the
    picture, NaN where not known. Nothing is said of more than two links. What a hand moves obeys no such equations and
    is left out; only a single lift of one link looks like half a swing, and is told from it by the picture.
    """
    local = _local(t_s, phi_rad, noise_rad) if phi_rad.shape[1] in ZERO_AT else None
    if local is None:
        return None
    equations = _equations(local)
    found = [
        _swing(local, equations, down_rad),
        _swing(local, _with_dry_friction(local, equations), down_rad, True),
    ]
    if phi_rad.shape[1] == 1:
        found.append(_swing(local, _creeping(local), down_rad))
    known = [swing for swing in found if swing is not None]
    # Equations that few instants obey are no surer for it.
    return min(known, key=lambda swing: float(swing.sigma_rad.max()) / swing.share, default=None)


def _swing(
    local: _Local, equations: tuple[Floats, Floats, Floats], down_rad: Floats, dry: bool = False
) -> Swing | None:
    """The swing by one form of the equations, ``dry``: that with dry friction."""
    links = local.phi.shape[1]
    design, wanted, noise = equations
    best: NDArray[np.bool_] | None = None
    for part in _stretches(local.t_s.size):
        x = _solve(design[part], wanted[part], noise[part])
        if x is None or not _physical(x, links):
            continue
        inside = _obeyed(design, wanted, noise, x)
        if best is not None and inside.sum() <= best.sum():
            continue
        upright = np.abs(within_half_turn(_zero(x, links) - down_rad)) < UPRIGHT_RAD
        if _reversals(local.w[inside]) >= REVERSALS or upright.all():
            best = inside
    if best is None:
        return None
    for _ in range(ROUNDS):
        if best.sum() < max(LEAST_INSTANTS, FREE_SHARE * best.size):
            return None
        x = _solve(design[best], wanted[best], noise[best])
        if x is None or not _physical(x, links):
            return None
        kept, best = best, _obeyed(design, wanted, noise, x)
    assert x is not None
    return _result(local.at(kept), design[kept], wanted[kept], noise[kept], x, float(kept.mean()), dry)


def _reversals(w: Floats) -> int:
    """The number of reversals of the link that turns round most often, among instants in the order of time."""
    most = 0
    for rate in w.T:
        sign = np.sign(rate[np.abs(rate) > STILL * np.abs(w).max(initial=0.0)])
        most = max(most, int((np.diff(sign) != 0).sum()))
    return most


def _zero(x: Floats, links: int) -> Floats:
    """The turns at which the links hang, from the solution of the equations."""
    return np.array([np.arctan2(x[at + 1], x[at]) for at in ZERO_AT[links]])


def _moving(t: Floats, phi: Floats, noise: float) -> NDArray[np.int64]:
    """Rows at which a link moves."""
    lag = max(1, round(SPEED_S / float(np.median(np.diff(t)))))
    if t.size <= lag:
        return np.zeros(0, dtype=np.int64)
    change = np.abs(phi[lag:] - phi[:-lag])
    speed = np.where(np.isfinite(change), change, 0.0).max(axis=1) / (t[lag:] - t[:-lag])
    least = max(STILL * float(speed.max()), 4 * np.sqrt(2) * noise / SPEED_S)
    return np.asarray(np.flatnonzero(speed > least) + lag // 2)


def _local(t: Floats, phi: Floats, noise: float) -> _Local | None:
    """Cubics about instants spread over the motion, as long as that allows."""
    if t.size < 2 * LEAST_SIDE + 1:
        return None
    step = float(np.median(np.diff(t)))
    most = max(LEAST_SIDE, round(REACH_S / step))
    moving = _moving(t, phi, noise)
    if moving.size < LEAST_INSTANTS:
        return None
    centres = np.unique(moving[np.linspace(0, moving.size - 1, CENTRES).astype(np.int64)])
    sides: list[int] = []
    side = most
    while side > LEAST_SIDE:
        sides.append(side)
        side = max(LEAST_SIDE, round(side / 1.4))
    out: list[tuple[Floats, ...]] = []
    left = centres
    for side in [*sides, LEAST_SIDE]:
        fits = (left >= side) & (left < t.size - side)
        here = left[fits]
        rows = here[:, None] + np.arange(-side, side + 1)
        u = (t[rows] - t[here, None]) / (side * step)
        whole = np.abs(u[:, [0, -1]] + [1, -1]).max(axis=1) < 0.5 / side + 0.3
        values = phi[rows]
        whole &= np.isfinite(values).all(axis=(1, 2))
        turned = np.ptp(np.where(np.isfinite(values), values, 0.0), axis=1).max(axis=1)
        whole &= (turned < TURN_RAD[phi.shape[1]]) | (side == LEAST_SIDE)
        if whole.any():
            powers = u[whole, :, None] ** np.arange(4)
            normal = np.linalg.inv(powers.transpose(0, 2, 1) @ powers)
            c = normal @ (powers.transpose(0, 2, 1) @ values[whole])
            scale = side * step
            w_error = noise * np.sqrt(normal[:, 1, 1]) / scale
            a_error = noise * 2 * np.sqrt(normal[:, 2, 2]) / scale**2
            out.append(
                (
                    t[here[whole]],
                    c[:, 0],
                    c[:, 1] / scale,
                    2 * c[:, 2] / scale**2,
                    w_error,
                    a_error,
                    np.full(a_error.size, scale),
                )
            )
        left = left[~np.isin(left, here[whole])]
    if not out:
        return None
    joined = [np.concatenate(parts) for parts in zip(*out, strict=True)]
    order = np.argsort(joined[0])
    return _Local(*(v[order] for v in joined))


def _equations(x: _Local) -> tuple[Floats, Floats, Floats]:
    """For each instant the equations' rows (n, L, unknowns), their right sides (n, L) and noises (n, L)."""
    a, w1, a1 = x.phi[:, 0], x.w[:, 0], x.a[:, 0]
    if x.phi.shape[1] == 1:
        rows = np.stack([np.sin(a), -np.cos(a), w1], axis=1)[:, None, :]
        return rows, -2 * a1[:, None], 2 * x.a_sigma[:, None]
    b, w2, a2 = x.phi[:, 1], x.w[:, 1], x.a[:, 1]
    c, s, o = np.cos(b - a), np.sin(b - a), np.zeros(a.size)
    upper = np.stack(
        [o, c * a2 - s * w2**2, s * a2 + c * w2**2, np.sin(a), -np.cos(a), o, o, w1, w1 - w2], axis=1
    )
    lower = np.stack(
        [2 * a2, c * a1 + s * w1**2, s * a1 - c * w1**2, o, o, np.sin(b), -np.cos(b), o, w2 - w1], axis=1
    )
    return (
        np.stack([upper, lower], axis=1),
        np.stack([-2 * a1, o], axis=1),
        np.stack([2 * x.a_sigma, 2 * x.a_sigma], axis=1),
    )


def _with_dry_friction(x: _Local, equations: tuple[Floats, Floats, Floats]) -> tuple[Floats, Floats, Floats]:
    """The equations with dry friction, which has the sign of a joint's rate."""
    rows, wanted, noise = equations
    w1 = np.sign(x.w[:, 0])
    if x.phi.shape[1] == 1:
        return np.concatenate([rows, w1[:, None, None]], axis=2), wanted, noise
    w2, o = np.sign(x.w[:, 1] - x.w[:, 0]), np.zeros(w1.size)
    dry = np.stack([np.stack([w1, -w2], axis=1), np.stack([o, w2], axis=1)], axis=1)
    return np.concatenate([rows, dry], axis=2), wanted, noise


def _creeping(x: _Local) -> tuple[Floats, Floats, Floats]:
    """The equation of one link over its friction instead of its inertia.

    For a link that creeps to where it hangs, whose acceleration is lost in the noise.
    """
    a = x.phi[:, 0]
    rows = np.stack([np.sin(a), -np.cos(a), x.a[:, 0]], axis=1)[:, None, :]
    return rows, -x.w, x.w_sigma[:, None]


def _stretches(n: int) -> list[slice]:
    """The whole, halves, quarters and eighths, overlapping by half."""
    out = []
    for parts in (1, 2, 4, 8):
        size = n // parts
        if size < LEAST_INSTANTS:
            break
        out += [slice(k * size // 2, k * size // 2 + size) for k in range(2 * parts - 1)]
    return out


def _solve(design: Floats, wanted: Floats, noise: Floats) -> Floats | None:
    """Weighted least squares over all links' equations, the columns scaled."""
    weight = 1 / np.hypot(noise, _size(wanted))[..., None]
    m = (design * weight).reshape(-1, design.shape[2])
    y = (wanted * weight[..., 0]).reshape(-1)
    scale = np.sqrt((m**2).sum(axis=0))
    if not (scale > 0).all():
        return None
    found, _, rank, _ = np.linalg.lstsq(m / scale, y, rcond=1e-7)
    return np.asarray(found / scale) if rank == scale.size else None


def _size(wanted: Floats) -> float:
    """By how much the equations may be missed."""
    return MODEL * float(np.sqrt(np.mean(wanted[:, 0] ** 2)))


def _obeyed(design: Floats, wanted: Floats, noise: Floats, x: Floats) -> NDArray[np.bool_]:
    left = np.abs(design @ x - wanted)
    return np.asarray((left < 3 * np.hypot(noise, _size(wanted))).all(axis=1))


def _physical(x: Floats, links: int) -> bool:
    """Whether such a pendulum can exist: it has a mass, and friction does not drive it (or the other way round)."""
    if links == 1:
        moment = float(np.hypot(x[0], x[1]))
        return bool(moment > 0 and x[2] > -0.2 * np.sqrt(2 * moment))
    inertia, p, q = x[:3]
    upper, lower = float(np.hypot(x[3], x[4])), float(np.hypot(x[5], x[6]))
    if not (inertia > 0 and p**2 + q**2 < 4 * inertia and lower > 0):
        return False
    return bool(x[7] > -0.2 * np.sqrt(2 * upper) and x[8] > -0.2 * np.sqrt(2 * inertia * lower))


def _result(
    local: _Local, design: Floats, wanted: Floats, noise: Floats, x: Floats, share: float, dry: bool
) -> Swing | None:
    links = local.phi.shape[1]
    weight = 1 / np.hypot(noise, _size(wanted))
    m = (design * weight[..., None]).reshape(-1, x.size)
    scale = np.sqrt((m**2).sum(axis=0))
    left = ((design @ x - wanted) * weight).reshape(-1)
    freedom = max(left.size - x.size, 1)
    # Cubics that overlap, and errors of the model, hang together over about a reach.
    step = float(np.median(np.diff(local.t_s)))
    together = max(1.0, 2 * float(np.median(local.reach_s)) / max(step, 1e-12))
    variance = together * float((left**2).sum()) / freedom
    inverse = np.linalg.inv((m / scale).T @ (m / scale)) / np.outer(scale, scale) * variance
    sigma = np.empty(links)
    for k, at in enumerate(ZERO_AT[links]):
        c, s = x[at], x[at + 1]
        slope = np.array([-s, c]) / (c * c + s * s)
        sigma[k] = float(np.sqrt(slope @ inverse[at : at + 2, at : at + 2] @ slope))
    if not (sigma < KNOWN_RAD).all():
        return None
    return Swing(_zero(x, links), sigma, np.ptp(local.phi, axis=0) / 2, share, dry, float(local.t_s[0]))
