"""Small oscillations, Poincaré sections, largest Lyapunov exponent (docs/reference/physics.md sections 10 and 11)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pydpend import _native
from pydpend.errors import SimulationError, fault
from pydpend.model import Damping, Model, parameters
from pydpend.tabular import TableResult, by_link
from pydpend.typed import typed

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Modes:
    """The two modes of small oscillation about hanging, slow one first.

    Attributes
    ----------
    frequency_hz : ndarray of float, shape (2,)
        Damped frequency, Hz; 0 for a mode damped beyond oscillating.
    shape : ndarray of float, shape (2, 2)
        Amplitude of (phi1, phi2) of each mode, a row each, the larger one being 1.
    damping_ratio : ndarray of float, shape (2,)
        Of the viscous terms alone: the others are of second order or dry, and no linear term.
    """

    frequency_hz: Array
    shape: Array
    damping_ratio: Array


@typed()
def modes(model: Model, damping: Damping | None = None) -> Modes:
    """Modes of ``M a + C w + K phi = 0``: mass matrix at rest, viscous moments, weight moments.

    1.108 and 2.267 Hz for ``derived("A")``: the decisive test on the last seconds of any recording (Table 7 would give
    1.17 and 5.68 Hz). docs/reference/physics.md section 10.

    Parameters
    ----------
    model : Model
        The pendulum.
    damping : Damping, optional
        Its coefficients, of which the viscous ones count; none if not given.

    Returns
    -------
    pydpend.linear.Modes
        Frequencies (Hz), shapes and damping ratios.
    """
    d = damping or Damping()
    mass = model.mass_matrix([0.0, 0.0])
    stiff = np.diag([model.sigma_j, model.kappa_j])
    viscous = np.array([[d.mu_v1 + d.mu_v2, -d.mu_v2], [-d.mu_v2, d.mu_v2]])
    inverse = np.linalg.inv(mass)
    state = np.block([[np.zeros((2, 2)), np.eye(2)], [-inverse @ stiff, -inverse @ viscous]])
    values, vectors = np.linalg.eig(state)
    # One of each conjugate pair; overdamped modes have real eigenvalues and are taken as they come.
    order = sorted(range(4), key=lambda i: (round(float(abs(values[i])), 9), -float(values[i].imag)))[::2]
    frequency = np.array([abs(values[i].imag) / (2 * np.pi) for i in order])
    ratio = np.array([-values[i].real / abs(values[i]) for i in order])
    shape = np.empty((2, 2))
    for k, i in enumerate(order):
        v = vectors[:2, i]
        v = v / v[np.argmax(np.abs(v))]
        shape[k] = v.real
    return Modes(frequency, shape, ratio)


@dataclass(frozen=True, eq=False)
class Section(TableResult):
    """K passages of a link through an angle.

    Attributes
    ----------
    t_s : ndarray of float, shape (K,)
        Time, s.
    phi_rad : ndarray of float, shape (K, 2)
        Angles, rad, not reduced to one turn.
    w_rad_s : ndarray of float, shape (K, 2)
        Rates, rad/s.
    """

    t_s: Array
    phi_rad: Array
    w_rad_s: Array

    def to_columns(self) -> dict[str, Array]:
        """The passages as columns of a table: ``time_s``, ``phi1_rad``, ``w1_rad_s``, ..., each (K,)."""
        return by_link({"time_s": self.t_s, "phi#_rad": self.phi_rad, "w#_rad_s": self.w_rad_s})


@typed()
def poincare(
    model: Model,
    damping: Damping,
    state: npt.ArrayLike,
    duration_s: float,
    *,
    link: int = 1,
    angle_rad: float = 0.0,
    direction: int = 1,
    tolerance: float = 1e-11,
) -> Section:
    """States at which a link passes an angle: a Poincaré section (docs/reference/physics.md section 11).

    Parameters
    ----------
    model : Model
        The pendulum.
    damping : Damping
        Its coefficients.
    state : array-like, shape (4,)
        Angles phi1, phi2 (rad) and rates w1, w2 (rad/s) at time 0.
    duration_s : float
        How long the motion is followed, s.
    link : {1, 2}
        The link.
    angle_rad : float
        The angle (mod 2 pi), rad, counter-clockwise positive, zero hanging.
    direction : {-1, 0, 1}
        Sign of the link's rate as it passes; 0 is either.
    tolerance : float
        Local error allowed per step, as in `simulate`.

    Returns
    -------
    pydpend.linear.Section
        Times and states of the passages.

    Raises
    ------
    SimulationError
        As `simulate`, and for a link, direction or duration that cannot be.
    """
    if link not in (1, 2) or direction not in (-1, 0, 1):
        raise SimulationError(
            fault("poincare", f"link {link}, direction {direction}", "Links are 1 and 2, directions -1, 0, 1")
        )
    if not (np.isfinite(duration_s) and duration_s > 0):
        raise SimulationError(fault("poincare", f"duration {duration_s} s", "It must be positive"))
    try:
        rows = _native.poincare_section(
            parameters(model, damping),
            [float(x) for x in np.asarray(state, dtype=np.float64).ravel()],
            duration_s,
            _native.IntegratorSettings(tolerance=tolerance),
            link=link - 1,
            angle_rad=angle_rad,
            direction=float(direction),
        )
    except ValueError as error:
        raise SimulationError(str(error)) from error
    return Section(rows[:, 0], rows[:, 1:3], rows[:, 3:])


@dataclass(frozen=True, eq=False)
class Exponent:
    """The largest Lyapunov exponent.

    Attributes
    ----------
    per_s : float
        The exponent, 1/s.
    sigma_per_s : float
        Standard error, 1/s, from batches of intervals long against their correlation.
    growth_per_s : ndarray of float, shape (K,)
        Rate of growth in each interval, 1/s.
    """

    per_s: float
    sigma_per_s: float
    growth_per_s: Array


@typed()
def lyapunov(
    model: Model,
    damping: Damping,
    state: npt.ArrayLike,
    *,
    duration_s: float = 400.0,
    skip_s: float = 20.0,
    interval_s: float = 0.5,
    tolerance: float = 1e-10,
) -> Exponent:
    """Largest Lyapunov exponent of a motion: mean growth of an exactly carried tangent vector.

    docs/reference/physics.md section 11.

    Parameters
    ----------
    model : Model
        The pendulum.
    damping : Damping
        Its coefficients, without dry friction (its jumps have no tangent).
    state : array-like, shape (4,)
        Angles phi1, phi2 (rad) and rates w1, w2 (rad/s) at time 0.
    duration_s, skip_s : float
        How long growth is counted, and for how long before that it is not, s.
    interval_s : float
        Length of the intervals, s.
    tolerance : float
        Local error allowed per step, as in `simulate`.

    Returns
    -------
    pydpend.linear.Exponent
        The exponent; its error is that of the mean over 20 batches.

    Raises
    ------
    SimulationError
        For dry friction, a bad state, or fewer than 40 intervals.
    """
    counted = int(duration_s / interval_s)
    if counted < 40:
        raise SimulationError(
            fault("lyapunov", f"{counted} intervals", "duration_s / interval_s must be at least 40")
        )
    try:
        growth = _native.tangent_growth(
            parameters(model, damping),
            [float(x) for x in np.asarray(state, dtype=np.float64).ravel()],
            interval_s,
            int(np.ceil(skip_s / interval_s)),
            counted,
            tolerance,
        )
    except ValueError as error:
        raise SimulationError(str(error)) from error
    batches = growth[: len(growth) // 20 * 20].reshape(20, -1).mean(axis=1)
    return Exponent(float(growth.mean()), float(batches.std(ddof=1) / np.sqrt(20)), growth)
