"""Simulation of the double pendulum with exact dry friction (paper Section 7; docs/reference/physics.md section 8).

The integrator is compiled (``crates/dynamics``): DOP853, an eighth-order pair with dense output, between
located events at which joints begin to stick or to slip.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from pydpend import _native
from pydpend.errors import SimulationError, fault
from pydpend.model import FORCES, LAW_TABLE, Damping, Model, parameters
from pydpend.tabular import TableResult, by_link, html_rows
from pydpend.typed import typed

Array = npt.NDArray[np.float64]

LAWS = FORCES
"""The columns of `Simulation.works_j`: one per coefficient of `Damping` that is a force."""

TOLERANCE = 3e-13
"""Local error allowed per step by default, in rad, relative rate, and share of the energy: 60 s of a free
drop without damping then keep their energy to a few 1e-11, with damping and stick-slip better
(docs/validation/physics.md)."""


@dataclass(frozen=True)
class Event:
    """A joint that begins to stick, to slip, or to slip the other way.

    Attributes
    ----------
    t_s : float
        Time, s.
    joint : int
        Joint 1 or 2.
    before, after : str
        ``stuck``, ``slip +`` or ``slip -`` (the sign of ``w1``, or of ``w2 - w1``).
    """

    t_s: float
    joint: int
    before: str
    after: str


@dataclass(frozen=True, eq=False, repr=False)
class Simulation(TableResult):
    """A motion at T times and its energies. Angles counter-clockwise positive, zero hanging.

    Attributes
    ----------
    t_s : ndarray of float, shape (T,)
        Time, s.
    phi_rad : ndarray of float, shape (T, 2)
        Angles, rad, not reduced to one turn.
    w_rad_s : ndarray of float, shape (T, 2)
        Rates, rad/s.
    a_rad_s2 : ndarray of float, shape (T, 2)
        Accelerations, rad/s2.
    normal_n : ndarray of float, shape (T, 2)
        Magnitude of the force in each joint, N (Eq. 34 corrected).
    dry_n_m : ndarray of float, shape (T, 2)
        Dry torque in each joint, N m: of sliding, or what holds a stuck joint. It acts on link 1 as
        ``-dry1 + dry2``, on link 2 as ``-dry2``.
    energy_j : ndarray of float, shape (T,)
        Total energy (Eq. 22), J.
    works_j : ndarray of float, shape (T, 11)
        Energy taken out since the start by each of ``pydpend.simulation.LAWS``, J.
    events : tuple of pydpend.simulation.Event
        Joints that begin to stick or to slip, in the order of time.
    status : str
        ``done``, or ``at rest`` when both joints stuck for good before the last time.
    message : str
        When that was, in words.
    balance : float
        Largest ``|E + W - E0|`` over the samples, relative to ``|E0|`` (to the energy's range where E0 is 0).
    """

    t_s: Array
    phi_rad: Array
    w_rad_s: Array
    a_rad_s2: Array
    normal_n: Array
    dry_n_m: Array
    energy_j: Array
    works_j: Array
    events: tuple[Event, ...] = field(repr=False)
    status: str
    message: str
    balance: float

    def __repr__(self) -> str:
        """A line for people."""
        span = f"{self.t_s[0]:g} to {self.t_s[-1]:g} s" if self.t_s.size else "no time"
        return (
            f"<Simulation: {self.t_s.size} times, {span}, {self.status}, energy balance {self.balance:.1e}>"
        )

    def _repr_html_(self) -> str:
        """The first rows, for a notebook."""
        return html_rows(repr(self)[1:-1], self.to_columns())

    def to_columns(self) -> dict[str, Array]:
        """The motion as columns of a table.

        Returns
        -------
        dict of str to ndarray, each of shape (T,)
            ``time_s``, then angles, rates, accelerations, joint forces and dry torques of both links (``phi1_rad``,
            ...), energy and works (``mu_v1_j``, ...), SI.
        """
        both = {
            "phi#_rad": self.phi_rad,
            "w#_rad_s": self.w_rad_s,
            "a#_rad_s2": self.a_rad_s2,
            "normal#_n": self.normal_n,
            "dry#_n_m": self.dry_n_m,
        }
        works = {f"{law}_j": self.works_j[:, k] for k, law in enumerate(LAWS)}
        return by_link({"time_s": self.t_s} | both | {"energy_j": self.energy_j} | works)


@typed()
def simulate(
    model: Model,
    damping: Damping,
    state: npt.ArrayLike,
    t_s: npt.ArrayLike,
    *,
    pinned: bool = False,
    smooth_width_rad_s: float | None = None,
    tolerance: float = TOLERANCE,
) -> Simulation:
    """The motion from a state, sampled at given times.

    The equations of motion of Eqs. 26-29 with the laws of `Damping` (docs/reference/physics.md section 8). Dry friction
    is exact, with stick and slip.

    Parameters
    ----------
    model : Model
        The pendulum.
    damping : Damping
        Coefficients of its laws.
    state : array-like, shape (4,)
        Angles phi1, phi2 (rad) and rates w1, w2 (rad/s) at ``t_s[0]``; counter-clockwise positive, zero hanging.
    t_s : array-like, shape (T,)
        Times, s, increasing.
    pinned : bool
        Whether joint 2 is held as it is (Section 3.1's second pin; w1 and w2 must be equal): a single pendulum.
    smooth_width_rad_s : float, optional
        Take ``tanh(rate / width)`` for the sign of dry friction, width in rad/s, under which joints creep and never
        stick (docs/reference/physics.md Eq. 6.9 gives its error).
    tolerance : float
        Local error allowed per step, in rad, relative rate, and share of the energy.

    Returns
    -------
    Simulation
        The motion with forces, energies and works at the T times.

    Raises
    ------
    SimulationError
        For a state that is not finite, times that do not increase, or a tolerance that is not reached.
    """
    t = np.atleast_1d(np.asarray(t_s, dtype=np.float64))
    how = _native.IntegratorSettings(tolerance=tolerance, width_rad_s=smooth_width_rad_s, pinned=pinned)
    run: _native.SimulatedMotion = _call(
        _native.simulate_motion, parameters(model, damping), _state(state).tolist(), t, how
    )
    energy = run.energy
    works = run.works[:, [name in LAWS for name in LAW_TABLE]]
    scale = abs(energy[0]) or float(np.ptp(energy)) or 1.0
    rest = run.at_rest
    return Simulation(
        t_s=t,
        phi_rad=run.state[:, :2],
        w_rad_s=run.state[:, 2:],
        a_rad_s2=run.a,
        normal_n=run.normal,
        dry_n_m=run.dry,
        energy_j=energy,
        works_j=works,
        events=tuple(Event(float(e[0]), int(e[1]) + 1, _named(e[2]), _named(e[3])) for e in run.events),
        status="at rest" if rest else "done",
        message=f"both joints stuck for good at {run.end_s:.6g} s" if rest else "",
        balance=float(np.max(np.abs(energy + works.sum(axis=1) - energy[0])) / scale),
    )


@dataclass(frozen=True, eq=False)
class Ensemble(TableResult):
    """K motions sampled at the same T times.

    Attributes
    ----------
    t_s : ndarray of float, shape (T,)
        Time, s.
    phi_rad : ndarray of float, shape (K, T, 2)
        Angles, rad.
    w_rad_s : ndarray of float, shape (K, T, 2)
        Rates, rad/s.
    energy_j : ndarray of float, shape (K, T)
        Total energy, J.
    at_rest : ndarray of bool, shape (K,)
        Whether each came to rest for good.
    """

    t_s: Array
    phi_rad: Array
    w_rad_s: Array
    energy_j: Array
    at_rest: npt.NDArray[np.bool_]

    def to_columns(self) -> dict[str, npt.NDArray[Any]]:
        """The motions one after the other as columns of a table, a row for each motion and time, (K T,)."""
        motions, times = self.energy_j.shape
        both = {"phi#_rad": self.phi_rad.reshape(-1, 2), "w#_rad_s": self.w_rad_s.reshape(-1, 2)}
        rows: dict[str, npt.NDArray[Any]] = {"motion": np.repeat(np.arange(motions), times)}
        return rows | by_link(
            {"time_s": np.tile(self.t_s, motions)} | both | {"energy_j": self.energy_j.ravel()}
        )


@typed()
def simulate_many(
    model: Model | Sequence[Model],
    damping: Damping | Sequence[Damping],
    states: npt.ArrayLike,
    t_s: npt.ArrayLike,
    *,
    pinned: bool = False,
    smooth_width_rad_s: float | None = None,
    tolerance: float = TOLERANCE,
) -> Ensemble:
    """The motions from many states, on all cores; the result does not depend on their number.

    Parameters
    ----------
    model : Model or sequence of Model
        The pendulum: one for all, or one for each state.
    damping : Damping or sequence of Damping
        Coefficients: one for all, or one for each state.
    states : array-like, shape (K, 4)
        Angles phi1, phi2 (rad) and rates w1, w2 (rad/s) at ``t_s[0]`` of each motion.
    t_s : array-like, shape (T,)
        Times, s, increasing.
    pinned, smooth_width_rad_s, tolerance : optional
        As in `simulate`.

    Returns
    -------
    pydpend.simulation.Ensemble
        Angles, rates and energies.

    Raises
    ------
    SimulationError
        Naming the run, as `simulate`.
    """
    x = np.ascontiguousarray(states, dtype=np.float64)
    if x.ndim != 2 or x.shape[1] != 4 or not np.all(np.isfinite(x)):
        raise SimulationError(
            fault("states", f"an array of shape {x.shape}", "Give finite numbers, shape (K, 4)")
        )
    t = np.atleast_1d(np.asarray(t_s, dtype=np.float64))
    models = [model] if isinstance(model, Model) else list(model)
    dampings = [damping] if isinstance(damping, Damping) else list(damping)
    for name, given in (("model", len(models)), ("damping", len(dampings))):
        if given not in (1, len(x)):
            raise SimulationError(
                fault(name, f"{given} for {len(x)} states", "Give one, or one for each state")
            )
    count = max(len(models), len(dampings))
    pairs = [
        parameters(models[i if len(models) > 1 else 0], dampings[i if len(dampings) > 1 else 0])
        for i in range(count)
    ]
    how = _native.IntegratorSettings(tolerance=tolerance, width_rad_s=smooth_width_rad_s, pinned=pinned)
    rows, energy, rest = _call(_native.simulate_ensemble, pairs, x, t, how)
    cube = rows.reshape(len(x), len(t), 4)
    return Ensemble(t, cube[:, :, :2], cube[:, :, 2:], energy.reshape(len(x), len(t)), rest)


def _state(state: npt.ArrayLike) -> Array:
    x = np.asarray(state, dtype=np.float64)
    if x.shape != (4,) or not np.all(np.isfinite(x)):
        raise SimulationError(
            fault("state", f"{x.tolist()}", "Give four finite numbers: phi1, phi2 (rad), w1, w2 (rad/s)")
        )
    return x


def _named(contact: float) -> str:
    return "stuck" if contact == 0 else "slip +" if contact > 0 else "slip -"


def _call(function: Callable[..., Any], *args: object, **keywords: object) -> Any:
    """Calls the compiled half; its refusals become SimulationError."""
    try:
        return function(*args, **keywords)
    except ValueError as error:
        raise SimulationError(str(error)) from error
