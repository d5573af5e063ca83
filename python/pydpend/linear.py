"""Small oscillations, Poincaré sections and the largest Lyapunov exponent (docs/physics.md sections 10 and 11)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pydpend import _tracker
from pydpend.errors import SimulationError, fault
from pydpend.model import Damping, Model, parameters

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Modes:
    """The two modes of small oscillation about hanging, slow one first."""

    frequency_hz: Array
    """Damped frequency, (2,); 0 for a mode damped beyond oscillating."""
    shape: Array
    """Amplitude of (phi1, phi2) of each mode, (2 modes, 2), the larger one being 1."""
    damping_ratio: Array
    """Of the viscous terms alone, (2,): the others are of second order or dry, and no linear term."""


def modes(model: Model, damping: Damping | None = None) -> Modes:
    """Modes of ``M a + C w + K phi = 0``: mass matrix at rest, viscous moments, weight moments.

    1.108 and 2.267 Hz for ``derived("A")``: the decisive test on the last seconds of any recording (Table 7 would
    give 1.17 and 5.68 Hz).
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
class Section:
    """Passages of a link through an angle."""

    t_s: Array
    """(K,)"""
    phi_rad: Array
    """(K, 2), not reduced to one turn."""
    w_rad_s: Array
    """(K, 2)"""


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
    """States at which ``link`` (1 or 2) passes ``angle_rad`` (mod 2 pi) with its rate of the sign ``direction``
    (0: either), during ``duration_s`` from ``state``. Raises SimulationError as `simulate` does."""
    if link not in (1, 2) or direction not in (-1, 0, 1):
        raise SimulationError(
            fault("poincare", f"link {link}, direction {direction}", "Links are 1 and 2, directions -1, 0, 1")
        )
    if not (np.isfinite(duration_s) and duration_s > 0):
        raise SimulationError(fault("poincare", f"duration {duration_s} s", "It must be positive"))
    try:
        rows = _tracker.poincare_section(
            parameters(model, damping),
            [float(x) for x in np.asarray(state, dtype=np.float64).ravel()],
            duration_s,
            link=link - 1,
            angle_rad=angle_rad,
            direction=float(direction),
            tolerance=tolerance,
        )
    except ValueError as error:
        raise SimulationError(str(error)) from error
    return Section(rows[:, 0], rows[:, 1:3], rows[:, 3:])


@dataclass(frozen=True, eq=False)
class Exponent:
    """The largest Lyapunov exponent."""

    per_s: float
    sigma_per_s: float
    """Standard error, from batches of intervals long against their correlation."""
    growth_per_s: Array
    """Rate of growth in each interval."""


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
    """Largest Lyapunov exponent of the motion from ``state``: mean growth of an exactly carried tangent vector.

    Without dry friction (its jumps have no tangent). The error is that of the mean over 20 batches. Raises
    SimulationError for dry friction, a bad state, or fewer than 40 intervals.
    """
    counted = int(duration_s / interval_s)
    if counted < 40:
        raise SimulationError(
            fault("lyapunov", f"{counted} intervals", "duration_s / interval_s must be at least 40")
        )
    try:
        growth = _tracker.tangent_growth(
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
