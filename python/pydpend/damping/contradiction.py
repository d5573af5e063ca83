"""Coefficients where the ratios contradict the model's parts: fitted again under each explanation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pydpend.coefficients import FULL, RATIOS, ratios_of
from pydpend.damping import parts, shooting
from pydpend.damping.consistency import NAMED, Consistency, Explanation
from pydpend.damping.parts import Cause
from pydpend.damping.shooting import Solution, Track
from pydpend.errors import FitError
from pydpend.model import LAW_TABLE, Model

Floats = NDArray[np.float64]

MOST = 4
"""Explanations under which the coefficients are fitted again, the likeliest."""

STEPS = 12
"""Gauss-Newton steps of such a fit: ratios and states are the solution's, and only the coefficients move."""


@dataclass(frozen=True, eq=False)
class Carried:
    """Words on a fit's ratios, and the part that a contradiction adds to the coefficients' covariance (C, C)."""

    consistency: Consistency | None
    covariance: Floats


def seconds_in(name: str) -> int:
    """The power of time by which a coefficient per kg m2 falls: 1 for N m s, 0 for N m s2, 2 for N m."""
    return {"N m s": 1, "N m": 2}.get(LAW_TABLE[name].unit, 0)


def carried(
    tracks: Sequence[Track],
    solution: Solution,
    model: Model,
    names: Sequence[str],
    ratio_covariance: Floats | None,
    huber: float,
) -> Carried:
    """The ratios of a solution against the model's parts.

    ``ratio_covariance`` (4, 4): of lambda, sigma, kappa and a3 over psi; None where they are not fitted. ``names``: the
    coefficients. ``huber``: the limit that the fit had.
    """
    none = np.zeros((len(names), len(names)))
    if ratio_covariance is None or not model.scale_known or model.links == 1 or model.g_m_s2 <= 0:
        return Carried(None, none)
    psi = solution.parameters["psi"]
    ratios = {n: solution.parameters[n] / psi for n in ratios_of(2)}
    # No pendulum has ratios below zero, which the fit's notes say: there is nothing to be held against the parts.
    if min(ratios.values()) <= 0:
        return Carried(None, none)
    consistency, found = parts.check(model, ratios, ratio_covariance)
    likely = [c for c in found if c.probability >= NAMED][:MOST]
    if not consistency.contradicts:
        if consistency.length is None or not consistency.length.off:
            return Carried(consistency, none)
        likely = list(parts.of_length(model, consistency.length))
    here = np.array([solution.parameters.get(n, 0.0) for n in names])
    again = [_coefficients(tracks, solution, cause, names, huber) for cause in likely]
    weights = np.array([c.probability for c in likely])
    weights = weights / min(1.0, weights.sum())
    spread = none.copy()
    for weight, cause, values in zip(weights, likely, again, strict=True):
        relative = cause.psi_sigma / cause.changed.model.psi_kg_m2
        spread += weight * (np.outer(values - here, values - here) + relative**2 * np.outer(values, values))
    told = {c.name: dict(zip(names, v.tolist(), strict=True)) for c, v in zip(likely, again, strict=True)}
    explained: tuple[Explanation, ...] = tuple(
        replace(e, coefficients=told.get(e.name, {})) for e in consistency.explanations
    )
    sigma = dict(zip(names, np.sqrt(np.diag(spread)).tolist(), strict=True))
    return Carried(replace(consistency, explanations=explained, sigma=sigma), spread)


def _coefficients(
    tracks: Sequence[Track], solution: Solution, cause: Cause, names: Sequence[str], huber: float
) -> Floats:
    """The coefficients if a cause is so, in true seconds.

    Where no fit comes to an end, those of the solution in proportion.
    """
    model, clock = cause.changed.model, cause.changed.clock
    grown = model.psi_kg_m2 / solution.parameters["psi"]
    # In recorded seconds gravity is smaller by the square of what these are too long.
    values = solution.parameters | {
        "psi": model.psi_kg_m2,
        "zeta": model.zeta_kg_m2,
        "m1": model.m1_kg,
        "m2": model.m2_kg,
        "l1": model.l1_m,
        "g": model.g_m_s2 / clock**2,
    }
    values |= {n: values[n] * grown for n in RATIOS}
    values |= {n: values.get(n, 0.0) * grown for n in names if not n.startswith("rmu")}
    free = [n for n in solution.names if n in RATIOS or n in LAW_TABLE]
    try:
        found = shooting.solve(
            tracks,
            solution.segments,
            values,
            solution.zeros_rad,
            free=free,
            bounded=[n for n in free if n in FULL],
            slack=list(solution.slack),
            learned=False,
            huber=huber,
            max_iterations=STEPS,
            clock="clock" in solution.names,
            clock_scale=solution.clock_scale,
        ).parameters
    except FitError:
        found = values
    return np.array([found.get(n, 0.0) * clock ** seconds_in(n) for n in names])
