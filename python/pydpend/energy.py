"""The energy profile and the paper's damping fit to it (Section 7.1; Eqs. 35, 37, 38 corrected).

The energy taken out is linear in the coefficients: ``E(t) = E0 - sum_c c * W_c(t)`` with ``W_c`` the work of
law c for a coefficient of one along the measured motion. So bounded linear least squares finds the optimum.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import scipy
from numpy.typing import NDArray

from pydpend import _native
from pydpend.coefficients import TERMS, coefficients, parameters
from pydpend.errors import FitError, Setting, fault
from pydpend.fit_status import FitStatus
from pydpend.information import check_errors, invert, undetermined
from pydpend.model import Model

Floats = NDArray[np.float64]


class States(Protocol):
    """Angles, rates and accelerations: what `dp.states` and a simulation both give."""

    @property
    def t_s(self) -> Floats:
        """Times (T,), s."""
        ...

    @property
    def phi_rad(self) -> Floats:
        """Angles (T, L), rad."""
        ...

    @property
    def w_rad_s(self) -> Floats:
        """Rates (T, L), rad/s."""
        ...

    @property
    def a_rad_s2(self) -> Floats:
        """Accelerations (T, L), rad/s2."""
        ...


@dataclass(frozen=True, eq=False)
class Motion:
    """Angles, rates, accelerations, (T, 2) each; a plain `States`."""

    t_s: Floats
    phi_rad: Floats
    w_rad_s: Floats
    a_rad_s2: Floats


@dataclass(frozen=True, eq=False)
class EnergyProfile:
    """Energy of a motion and the works of the laws along it for coefficients of one."""

    t_s: Floats
    """(T,)"""
    energy_j: Floats
    """(T,)"""
    unit_works: Floats
    """Work of each of `names` since the start per unit of its coefficient, (T, C)."""
    names: tuple[str, ...]
    rectification: tuple[float, float]
    """Mean excess of each joint's normal force from acceleration noise that was taken off, relative."""
    sigma_j: Floats | None = None
    """Standard errors of the energies, independent of each other, (T,), where they are known."""


@dataclass(frozen=True, eq=False)
class EnergyFit:
    """Coefficients from an energy profile."""

    names: tuple[str, ...]
    values: Floats
    """(C,)"""
    covariance: Floats
    """(C, C), from the energies' standard errors, or from the residuals with their autocorrelation."""
    e0_j: Floats
    """Energy at the start of each profile, (R,)."""
    residual_j: Floats
    """Model minus measured, (T,), profiles one after the other."""
    status: FitStatus
    message: str
    chi2: float = float("nan")
    """Mean squared residual over standard error, where the energies have one."""


def energy_profile(
    states: States,
    model: Model,
    laws: str | Sequence[str] = "paper",
    *,
    sigma_a_rad_s2: tuple[float, float] | None = None,
) -> EnergyProfile:
    """E(t) by Eqs. 26-27 and the losses of Eqs. 35, 37, 38 with the normal forces of Eq. 34 (erratum 16).

    |N| is a norm, so noise of the accelerations raises its mean: with ``sigma_a_rad_s2`` (standard
    deviation of each link's acceleration) the first-order excess ``s^2/(2N)``, ``s`` the noise across N, is
    taken off.
    """
    names = coefficients(laws)
    state = np.ascontiguousarray(np.column_stack([states.phi_rad, states.w_rad_s]))
    a = np.ascontiguousarray(states.a_rad_s2)
    constants = parameters(model)
    powers = _native.unit_powers(constants, state, a)
    excess = (0.0, 0.0)
    if sigma_a_rad_s2 is not None:
        excess = _rectified(powers, state, constants, sigma_a_rad_s2)
    chosen = powers[:, [TERMS.index(name) for name in names]]
    works = scipy.integrate.cumulative_simpson(chosen, x=states.t_s, axis=0, initial=0.0)
    energy = model.energy(states.phi_rad, states.w_rad_s)
    return EnergyProfile(states.t_s, energy, works, names, excess)


def _rectified(
    powers: Floats, state: Floats, constants: dict[str, float], sigma: tuple[float, float]
) -> tuple[float, float]:
    """Takes the noise's excess off the load terms' powers, in place; returns its mean relative to N."""
    out = []
    levers = [constants["sigma"] / constants["g"], constants["m2"] * constants["l1"]]
    second = constants["kappa"] / constants["g"]
    rates = [state[:, 2], state[:, 3] - state[:, 2]]
    for j, name in enumerate(("rmu1", "rmu2")):
        column = powers[:, TERMS.index(name)]
        normal = np.divide(column, np.abs(rates[j]), out=np.full_like(column, np.inf), where=rates[j] != 0)
        # Of each link's noise vector, on average half the variance lies across N.
        across = 0.5 * ((levers[j] * sigma[0]) ** 2 + (second * sigma[1]) ** 2)
        # The expansion holds for noise well below N; where it is not, no more than half of N is taken off.
        relative = np.minimum(across / (2 * normal**2), 0.5)
        column *= 1 - relative
        out.append(float(np.mean(relative)))
    return out[0], out[1]


def fit_profiles(profiles: Sequence[EnergyProfile], *, bounded: bool = True) -> EnergyFit:
    """The coefficients (not negative), common to all profiles, that bring the works nearest to the energies.

    Each profile has a free E0. The covariance takes the residuals' autocorrelation from their integrated correlation
    time.

    Each profile has a free E0. The covariance takes the residuals' autocorrelation from their integrated correlation
    time.

    Raises FitError when the profiles do not have the same laws, or do not determine them.
    """
    names = profiles[0].names
    if any(p.names != names for p in profiles):
        raise FitError(
            fault("energy fit", "the profiles have different laws", "Make them with the same laws")
        )
    design, scale = _design(profiles)
    n, p = design.shape
    if n <= p:
        raise FitError(
            fault(
                "energy fit",
                f"{n} energies do not determine {len(names)} coefficients and the energy at the "
                "start of each recording",
                "Fit fewer laws, give a longer decay or go over to " + Setting("method", "trajectory"),
            )
        )
    energy = np.concatenate([p.energy_j for p in profiles])
    known = [p.sigma_j for p in profiles if p.sigma_j is not None]
    sigma = np.concatenate(known) if len(known) == len(profiles) else np.ones(energy.size)
    laws = len(names)
    low = np.concatenate([np.zeros(laws), np.full(len(profiles), -np.inf)]) if bounded else -np.inf
    weighted = design / sigma[:, None]
    size = np.linalg.norm(weighted, axis=0)
    if not np.isfinite(size).all() or not (size > 0).all():
        at = int(np.flatnonzero(~(np.isfinite(size) & (size > 0)))[0])
        column = (*names, "the energy at the start")[min(at, laws)]
        raise FitError(undetermined(f"what {column} does to the energies is {size[at]:g}"))
    result = scipy.optimize.lsq_linear(
        weighted / size, energy / sigma, bounds=(low, np.inf), method="bvls", tol=1e-14, max_iter=100
    )
    x = result.x / size / scale
    residual = design @ (result.x / size) - energy
    chi2 = float(np.sum((residual / sigma) ** 2)) / max(n - p, 1)
    growth = max(1.0, chi2)
    if not known:
        edges = np.cumsum([q.t_s.size for q in profiles])[:-1]
        growth = chi2 * max(correlation_time(r) for r in np.split(residual, edges))
    covariance = growth * invert(weighted.T @ weighted / np.outer(size, size)) / np.outer(size, size)
    covariance = covariance / np.outer(scale, scale)
    check_errors(list(names), covariance[:laws, :laws])
    held = [name for name, v in zip(names, x, strict=False) if bounded and v <= 0]
    return EnergyFit(
        names,
        np.maximum(x[:laws], 0.0) if bounded else x[:laws],
        covariance[:laws, :laws],
        x[laws:],
        residual,
        FitStatus.CONVERGED if result.success else FitStatus.ITERATION_LIMIT,
        f"held at zero: {', '.join(held)}" if held else "no coefficient at its bound",
        chi2 if known else float("nan"),
    )


def fit_lbfgsb(profiles: Sequence[EnergyProfile], *, tight: bool = True) -> tuple[Floats, float]:
    """The paper's optimiser on the same problem, scaled: coefficients (C,) and the sum of squares in J^2.

    With scipy's default tolerances (``tight=False``) it stops early.

    With scipy's default tolerances (``tight=False``) it stops early.
    """
    design, scale = _design(profiles)
    energy = np.concatenate([p.energy_j for p in profiles])
    laws = len(profiles[0].names)

    def cost(x: Floats) -> tuple[float, Floats]:
        r = design @ x - energy
        return float(r @ r), 2 * (design.T @ r)

    start = np.concatenate([np.zeros(laws), [p.energy_j[0] for p in profiles]])
    bounds: list[tuple[float | None, float | None]] = [(0.0, None)] * laws + [(None, None)] * len(profiles)
    options: Any = {"maxiter": 100_000, "maxfun": 200_000}
    if tight:
        options |= {"ftol": 0.0, "gtol": 1e-15, "maxcor": 30}
    result = scipy.optimize.minimize(cost, start, jac=True, method="L-BFGS-B", bounds=bounds, options=options)
    residual = design @ result.x - energy
    return (result.x / scale)[:laws], float(residual @ residual)


def _design(profiles: Sequence[EnergyProfile]) -> tuple[Floats, Floats]:
    """Columns -W_c and an indicator for each E0, each scaled to unit RMS, and the scales."""
    works = -np.concatenate([p.unit_works for p in profiles])
    which = np.repeat(np.arange(len(profiles)), [p.t_s.size for p in profiles])
    design = np.column_stack([works, which[:, None] == np.arange(len(profiles))])
    scale = np.sqrt(np.mean(design**2, axis=0))
    scale[scale == 0] = 1.0
    return design / scale, scale


def correlation_time(residual: Floats) -> float:
    """Integrated autocorrelation time in samples (1 for white residuals).

    The sum of correlations up to the first one below 0.05, at most a tenth of the record.

    The sum of correlations up to the first one below 0.05, at most a tenth of the record.
    """
    r = residual - residual.mean()
    n = r.size
    power = np.abs(np.fft.rfft(r, 2 * n)) ** 2
    correlation = np.fft.irfft(power)[: n // 10 + 1]
    if correlation[0] <= 0:
        return 1.0
    correlation = correlation / correlation[0]
    below = np.flatnonzero(correlation < 0.05)
    last = int(below[0]) if below.size else correlation.size
    return float(max(1.0, 1.0 + 2.0 * correlation[1:last].sum()))


__all__ = [
    "EnergyFit",
    "EnergyProfile",
    "Motion",
    "States",
    "correlation_time",
    "energy_profile",
    "fit_lbfgsb",
    "fit_profiles",
]
