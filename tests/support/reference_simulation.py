"""An independent simulation for the tests: scipy's DOP853 and events, equations typed from the errata.

Slow, and nothing of it is shared with the compiled integrator.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise, product
from typing import Any

import numpy as np
import numpy.typing as npt
from pydpend.errors import SimulationError, fault
from pydpend.model import Damping, Model
from scipy.integrate import solve_ivp

Array = npt.NDArray[np.float64]

LAWS = ("mu_v1", "mu_v2", "mu_q1", "mu_q2", "rmu1", "rmu2", "tau_c1", "tau_c2", "strip_drag")
"""The columns of `Simulation.works_j`: one per coefficient of `Damping`."""


@dataclass(frozen=True)
class Event:
    """A joint that begins to stick or to slip."""

    t_s: float
    joint: int
    """1 or 2."""
    change: str
    """``stick``, ``slip +``, ``slip -`` (the sign of the joint's rate), ``reverse +`` or ``reverse -``."""


@dataclass(frozen=True)
class Simulation:
    """A motion and its energies. Angles counter-clockwise positive, zero hanging."""

    t_s: Array
    """(T,)"""
    phi_rad: Array
    """(T, 2)"""
    w_rad_s: Array
    """(T, 2)"""
    a_rad_s2: Array
    """(T, 2)"""
    normal_n: Array
    """Normal force at each joint, (T, 2), Eq. 34 corrected."""
    energy_j: Array
    """(T,)"""
    works_j: Array
    """Energy taken out since the start by each of `LAWS`, (T, 9)."""
    events: tuple[Event, ...] = field(repr=False)
    status: str
    """``done``, or ``at rest`` when both joints stuck for good before the last time."""
    message: str
    balance: float
    """Largest ``|E + W - E0|`` over the samples, relative to the larger of E0 and the energy's range."""


def reference(
    model: Model,
    damping: Damping,
    state: npt.ArrayLike,
    t_s: npt.ArrayLike,
    *,
    pinned: bool = False,
    rtol: float = 1e-9,
) -> Simulation:
    """The motion from ``state`` (phi1, phi2, w1, w2) at ``t_s[0]``, at each of ``t_s``.

    ``pinned`` holds joint 2 as it is (Section 3.1's second pin; w1 and w2 must be equal). Dry friction is
    exact: each joint sticks and slips at located events.

    Raises SimulationError for a state that is not finite or times that do not increase.
    """
    t = np.atleast_1d(np.asarray(t_s, dtype=np.float64))
    y0 = np.asarray(state, dtype=np.float64)
    _check(t, y0, pinned)
    y = np.concatenate([y0, np.zeros(len(LAWS))])
    system = _System(model, damping, pinned)
    rows = np.empty((len(t), len(y)))
    rows[0] = y
    events: list[Event] = []
    now, done = float(t[0]), 1
    mode = system.resolve(y, (None, None))
    modes_at = [mode] * len(t)
    status = "done"
    while done < len(t):
        if system.frozen(mode, y):
            rows[done:] = y
            for i in range(done, len(t)):
                modes_at[i] = mode
            status = "at rest"
            break
        wanted = t[done:]
        solve: Any = solve_ivp
        found = solve(
            lambda _, x, m=mode: system.rates(x, m),
            (now, float(t[-1])),
            y,
            method="DOP853",
            t_eval=wanted,
            events=system.events(mode),
            rtol=rtol,
            atol=rtol * 1e-2,
        )
        if not found.success:
            raise SimulationError(fault("simulation", found.message, place=f"t = {now:g} s"))
        if len(found.t):
            rows[done : done + len(found.t)] = found.y.T
        for i in range(done, done + len(found.t)):
            modes_at[i] = mode
        done += len(found.t)
        if found.status != 1:
            break
        which = next(i for i, e in enumerate(found.t_events) if len(e))
        now, y = float(found.t_events[which][0]), found.y_events[which][0].copy()
        joint = system.watched(mode)[which]
        if mode[0] == 0.0:
            y[2] = 0.0
        if joint == 0 and mode[0] is not None and mode[0] != 0.0:
            y[2] = 0.0
        if mode[1] == 0.0 or (joint == 1 and mode[1] is not None):
            y[3] = y[2]
        new = system.resolve(y, mode, joint)
        events.append(Event(now, joint + 1, _change(mode[joint], new[joint])))
        mode = new
    a = np.empty((len(t), 2))
    n = np.empty((len(t), 2))
    for i, row in enumerate(rows):
        a[i], n[i], _ = system.motion(row, modes_at[i])
    energy = model.energy(rows[:, :2], rows[:, 2:4])
    works = rows[:, 4:]
    scale = max(abs(energy[0]), np.ptp(energy), 1e-300)
    return Simulation(
        t_s=t,
        phi_rad=rows[:, :2],
        w_rad_s=rows[:, 2:4],
        a_rad_s2=a,
        normal_n=n,
        energy_j=energy,
        works_j=works,
        events=tuple(events),
        status=status,
        message="" if status == "done" else f"both joints stuck at {now:.6g} s",
        balance=float(np.max(np.abs(energy + works.sum(axis=1) - energy[0])) / scale),
    )


def _check(t: Array, y0: Array, pinned: bool) -> None:
    if y0.shape != (4,) or not np.all(np.isfinite(y0)):
        raise SimulationError(
            fault("state", f"{y0.tolist()}", "Give four finite numbers: phi1, phi2 (rad), w1, w2 (rad/s)")
        )
    if t.ndim != 1 or len(t) < 1 or not np.all(np.isfinite(t)):
        raise SimulationError(fault("t_s", "not a list of finite times"))
    if np.any(np.diff(t) <= 0):
        i = int(np.argmax(np.diff(t) <= 0)) + 1
        raise SimulationError(
            fault("t_s", f"{t[i]:g} s does not come after {t[i - 1]:g} s", place=f"index {i}")
        )
    if pinned and y0[2] != y0[3]:
        raise SimulationError(fault("state", "w1 and w2 differ", "A pinned joint 2 needs them equal"))


def _change(old: float | None, new: float | None) -> str:
    if new == 0.0:
        return "stick"
    sign = "+" if (new or 0.0) > 0 else "-"
    return f"slip {sign}" if old == 0.0 else f"reverse {sign}"


# A joint's mode: None no dry friction, +1 or -1 sliding that way, 0 stuck.
Mode = tuple[float | None, float | None]


class _System:
    def __init__(self, model: Model, damping: Damping, pinned: bool) -> None:
        self.model, self.pinned = model, pinned
        self.d = damping
        self.dry = (damping.rmu1 > 0 or damping.tau_c1 > 0, damping.rmu2 > 0 or damping.tau_c2 > 0 or pinned)
        g = model.g_m_s2
        self.first = (model.sigma_j / g, model.kappa_j / g) if g > 0 else (0.0, 0.0)

    def normals(self, y: Array, a: Array) -> Array:
        """Normal forces at both joints for accelerations ``a`` (Eqs. 33, 34 corrected, errata 15, 16)."""
        m = self.model
        f = np.cos(y[:2]) * a - np.sin(y[:2]) * y[2:4] ** 2
        h = np.sin(y[:2]) * a + np.cos(y[:2]) * y[2:4] ** 2
        s, k = self.first
        b1 = m.m2_kg * m.l1_m
        return np.array(
            [
                np.hypot(s * f[0] + k * f[1], s * h[0] + k * h[1] + (m.m1_kg + m.m2_kg) * m.g_m_s2),
                np.hypot(b1 * f[0] + k * f[1], b1 * h[0] + k * h[1] + m.m2_kg * m.g_m_s2),
            ]
        )

    def strip(self, y: Array) -> Array:
        """Force of the strip drag on (link 1, link 2) for a coefficient of one, opposing."""
        m = self.model
        lo, hi = m.lower_inner_m, m.lower_outer_m
        arm = m.l1_m * np.cos(y[0] - y[1])
        u, w = arm * y[2], y[3]
        cuts = [lo, hi]
        if (u + lo * w) * (u + hi * w) < 0:
            cuts = [lo, -u / w, hi]
        force, moment = np.float64(0), np.float64(0)
        for a, b in pairwise(cuts):
            sign = np.sign(u + (a + b) / 2 * w)
            i = [(b**n - a**n) / n for n in (1, 2, 3, 4)]
            force += sign * (u * u * i[0] + 2 * u * w * i[1] + w * w * i[2])
            moment += sign * (u * u * i[1] + 2 * u * w * i[2] + w * w * i[3])
        scale = 4 / (hi**3 * abs(hi) - lo**3 * abs(lo))
        return np.array([force * arm * scale, moment * scale])

    def smooth(self, y: Array) -> Array:
        """Sum of the forces that are smooth in the state."""
        m, d = self.model, self.d
        s = m.a3_kg_m2 * np.sin(y[0] - y[1])
        q = np.array(
            [
                -s * y[3] ** 2 - m.sigma_j * np.sin(y[0]) - d.mu_v1 * y[2] + d.mu_v2 * (y[3] - y[2]),
                s * y[2] ** 2 - m.kappa_j * np.sin(y[1]) - d.mu_v2 * (y[3] - y[2]),
            ]
        )
        q -= [d.mu_q1 * abs(y[2]) * y[2], d.mu_q2 * abs(y[3]) * y[3]]
        if d.strip_drag:
            q -= d.strip_drag * self.strip(y)
        return q

    def motion(self, y: Array, mode: Mode) -> tuple[Array, Array, Array]:
        """Accelerations, normal forces and dry torques (opposing the rate) in a mode."""
        mass = self.model.mass_matrix(y[:2])
        q = self.smooth(y)
        d = self.d
        stuck = [mode[0] == 0.0, mode[1] == 0.0]
        sign = [0.0 if s is None else s for s in mode]
        a = np.zeros(2)
        torque = np.zeros(2)
        n = np.zeros(2)
        for _ in range(60):
            n = self.normals(y, a)
            torque = np.array([(d.rmu1 * n[0] + d.tau_c1) * sign[0], (d.rmu2 * n[1] + d.tau_c2) * sign[1]])
            # unknowns a1, a2, and the torques of stuck joints
            lhs = np.zeros((4, 4))
            lhs[:2, :2] = mass
            lhs[:2, 2:] = [[1.0, -1.0], [0.0, 1.0]]
            lhs[2] = [1.0, 0.0, 0.0, 0.0] if stuck[0] else [0.0, 0.0, 1.0, 0.0]
            lhs[3] = [-1.0, 1.0, 0.0, 0.0] if stuck[1] else [0.0, 0.0, 0.0, 1.0]
            rhs = [q[0], q[1], 0.0 if stuck[0] else torque[0], 0.0 if stuck[1] else torque[1]]
            new = np.linalg.solve(lhs, rhs)
            change = np.max(np.abs(new[:2] - a))
            a, torque = new[:2], new[2:]
            if change <= 1e-15 * (1 + np.max(np.abs(a))):
                break
        return a, self.normals(y, a), torque

    def capacity(self, n: Array) -> Array:
        """What dry friction can hold at each joint."""
        d = self.d
        hold = np.array([d.rmu1 * n[0] + d.tau_c1, d.rmu2 * n[1] + d.tau_c2])
        if self.pinned:
            hold[1] = np.inf
        return hold

    def rates(self, y: Array, mode: Mode) -> Array:
        """Derivative of (phi, w, works)."""
        d = self.d
        a, n, _ = self.motion(y, mode)
        rel = y[3] - y[2]
        s = [0.0 if m is None else m for m in mode]
        strip = float(self.strip(y) @ y[2:4]) if d.strip_drag else 0.0
        powers = [
            d.mu_v1 * y[2] ** 2,
            d.mu_v2 * rel**2,
            d.mu_q1 * abs(y[2]) ** 3,
            d.mu_q2 * abs(y[3]) ** 3,
            d.rmu1 * n[0] * s[0] * y[2],
            d.rmu2 * n[1] * s[1] * rel,
            d.tau_c1 * s[0] * y[2],
            d.tau_c2 * s[1] * rel,
            d.strip_drag * strip,
        ]
        return np.concatenate([y[2:4], a, powers])

    def watched(self, mode: Mode) -> list[int]:
        """Joints whose events are looked for, in the order of `events`."""
        return [j for j in (0, 1) if mode[j] is not None and not (j == 1 and self.pinned)]

    def events(self, mode: Mode) -> Any:
        out: list[object] = []
        for j in self.watched(mode):

            def g(_: float, y: Array, j: int = j) -> float:
                if mode[j] == 0.0:
                    _a, n, torque = self.motion(y, mode)
                    return float(self.capacity(n)[j] - abs(torque[j]))
                rate = y[2] if j == 0 else y[3] - y[2]
                return float((mode[j] or 0.0) * rate)

            g.terminal, g.direction = True, -1.0  # type: ignore[attr-defined]
            out.append(g)
        return out

    def resolve(self, y: Array, mode: Mode, joint: int | None = None) -> Mode:
        """The mode that agrees with its own forces: joints at rest stick if they can, else slip."""
        rate = [y[2], y[3] - y[2]]
        choices: list[tuple[float | None, ...]] = []
        for j in (0, 1):
            if not self.dry[j]:
                choices.append((None,))
            elif j == 1 and self.pinned:
                choices.append((0.0,))
            elif rate[j] != 0.0 and mode[j] != 0.0:
                choices.append((float(np.sign(rate[j])),))
            else:
                choices.append((0.0, 1.0, -1.0))
        best, worst = None, float("inf")
        for c in product(*choices):
            candidate = (c[0], c[1])
            a, n, torque = self.motion(y, candidate)
            hold = self.capacity(n)
            gap = 0.0
            accel = [a[0], a[1] - a[0]]
            for j in (0, 1):
                if len(choices[j]) == 1:
                    continue
                if candidate[j] == 0.0:
                    over = float(abs(torque[j]) - hold[j])
                    # the joint that has just broken loose must not be put back
                    if joint == j and mode[j] == 0.0:
                        over = np.inf
                    gap = max(gap, over)
                else:
                    gap = max(gap, float(-(candidate[j] or 0.0) * accel[j]))
            if gap <= 0:
                return candidate
            if gap < worst:
                best, worst = candidate, gap
        assert best is not None
        return best

    def frozen(self, mode: Mode, y: Array) -> bool:
        """Both joints stuck: nothing will ever change."""
        return mode[0] == 0.0 and mode[1] == 0.0 and not np.any(y[2:4])
