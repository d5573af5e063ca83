"""Fitted ratios against the model's parts: how far apart they are, and which single cause would explain it.

The parts' uncertainties are the prior of the model's constants, the fitted ratios are the data. A cause is one number
(how much heavier the lower link is, by what factor the clock is off) that may be anything; what it leaves of the
contradiction is told by chi-square, and the causes are weighted by their marginal likelihood.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from pydpend.coefficients import ratios_of, unit
from pydpend.damping.consistency import Consistency, Explanation, LengthCheck, RatioCheck
from pydpend.damping.result_parts import Estimate
from pydpend.model import CONSTANTS, Model

Floats = NDArray[np.float64]

UNSTATED = 0.01
"""Standard uncertainty of each constant, relative, where a model states none: what calipers, a kitchen balance and a
drawing give."""

WIDE = 0.2
"""Standard deviation of a cause before the data, relative: parts are mistaken by a tenth, a clock by less."""

STEPS = 20
"""Gauss-Newton steps for one number; three are the rule."""

NAMES = {
    "psi": "psi_kg_m2",
    "lambda": "lambda_kg_m2",
    "sigma": "sigma_j",
    "kappa": "kappa_j",
    "a3": "a3_kg_m2",
}
"""Constants of the model by the names that a fit has for them."""

SHOWN = {"psi": "psi_kg_m2", "m1": "m1_kg", "m2": "m2_kg", "l1": "l1_m"}
"""Constants that a table shows with their parts' values and with what the motion makes of them."""

SHOWN_UNITS = {"psi": "kg m2", "m1": "kg", "m2": "kg", "l1": "m"}


@dataclass(frozen=True)
class Changed:
    """The pendulum if a cause is so: its constants, and recorded time over true time."""

    model: Model
    clock: float = 1.0


@dataclass(frozen=True, eq=False)
class Cause:
    """A cause as it was found to be."""

    name: str
    words: str
    changed: Changed
    factor: float
    chi2: float
    probability: float
    psi_sigma: float
    """Standard deviation of psi if it is so, kg m2."""


def _heavier_lower(model: Model, by: float) -> Changed:
    more = by - 1
    return Changed(
        replace(
            model,
            psi_kg_m2=model.psi_kg_m2 + more * model.m2_kg * model.l1_m**2 / 2,
            lambda_kg_m2=model.lambda_kg_m2 * by,
            sigma_j=model.sigma_j + more * model.m2_kg * model.g_m_s2 * model.l1_m,
            kappa_j=model.kappa_j * by,
            a3_kg_m2=model.a3_kg_m2 * by,
            m2_kg=model.m2_kg * by,
        )
    )


def _centre(model: Model) -> float:
    """Distance from the elbow to the lower link's centre of mass, m."""
    return model.kappa_j / (model.g_m_s2 * model.m2_kg)


def _heavier_lower_of_same_inertia(model: Model, by: float) -> Changed:
    whole = _heavier_lower(model, by).model
    turning = model.lambda_kg_m2 + (by - 1) * model.m2_kg * _centre(model) ** 2 / 2
    return Changed(replace(whole, lambda_kg_m2=turning))


def _lower_centre(model: Model, by: float) -> Changed:
    return Changed(
        replace(
            model,
            lambda_kg_m2=model.lambda_kg_m2 + (by**2 - 1) * model.m2_kg * _centre(model) ** 2 / 2,
            kappa_j=model.kappa_j * by,
            a3_kg_m2=model.a3_kg_m2 * by,
        )
    )


def _lower_inertia(model: Model, by: float) -> Changed:
    central = model.lambda_kg_m2 - model.m2_kg * _centre(model) ** 2 / 2
    return Changed(replace(model, lambda_kg_m2=model.lambda_kg_m2 + (by - 1) * central))


def _own(model: Model) -> tuple[float, float]:
    """Constants psi and sigma of the upper link without the lower one's mass at the elbow."""
    psi = model.psi_kg_m2 - model.m2_kg * model.l1_m**2 / 2
    return psi, model.sigma_j - model.m2_kg * model.g_m_s2 * model.l1_m


def _heavier_upper(model: Model, by: float) -> Changed:
    psi, sigma = _own(model)
    return Changed(
        replace(
            model,
            psi_kg_m2=model.psi_kg_m2 + (by - 1) * psi,
            sigma_j=model.sigma_j + (by - 1) * sigma,
            m1_kg=model.m1_kg * by,
        )
    )


def _upper_inertia(model: Model, by: float) -> Changed:
    return Changed(replace(model, psi_kg_m2=model.psi_kg_m2 + (by - 1) * _own(model)[0]))


def _longer(model: Model, by: float) -> Changed:
    length = model.l1_m * by
    return Changed(
        replace(
            model,
            psi_kg_m2=model.psi_kg_m2 + model.m2_kg * (length**2 - model.l1_m**2) / 2,
            sigma_j=model.sigma_j + model.m2_kg * model.g_m_s2 * (length - model.l1_m),
            a3_kg_m2=model.a3_kg_m2 * by,
            l1_m=length,
        )
    )


def _gravity(model: Model, by: float) -> Changed:
    return Changed(
        replace(model, g_m_s2=model.g_m_s2 * by, sigma_j=model.sigma_j * by, kappa_j=model.kappa_j * by)
    )


def _clock(model: Model, by: float) -> Changed:
    return Changed(model, by)


Change = Callable[[Model, float], Changed]

CAUSES: tuple[tuple[str, str, Change], ...] = (
    ("clock", "the recorded times", _clock),
    ("g", "g", _gravity),
    ("l1", "l1", _longer),
    ("lower mass", "the mass of the lower link", _heavier_lower),
    (
        "lower mass, same inertia",
        "the mass of the lower link (its inertia about its centre as given)",
        _heavier_lower_of_same_inertia,
    ),
    ("lower centre", "the distance of the lower link's centre of mass from the elbow", _lower_centre),
    ("lower inertia", "the inertia of the lower link about its centre", _lower_inertia),
    ("upper mass", "the mass of the upper link", _heavier_upper),
    ("upper inertia", "the inertia of the upper link about the pivot", _upper_inertia),
)
"""Causes, the quantity that a factor is of, and the change that it makes."""


PARTS = "parts"
AS_STATED: tuple[str, str, Change] = (
    PARTS,
    "every part is off by a little more than is stated",
    lambda model, _: Changed(model),
)
"""No single cause."""

OF_LENGTH = {"clock": "clock", "g": "g_m_s2", "l1": "l1_m"}
"""Causes that `LengthCheck.possible` speaks of, by its names."""

IMPOSSIBLE = 20.0
"""Loss of log-likelihood of a cause that cannot be."""


def predicted(changed: Changed) -> Floats:
    """Logarithms of the ratios lambda, sigma, kappa, a3 over psi (4,) in recorded time."""
    model = changed.model
    values = np.array([model.lambda_kg_m2, model.sigma_j, model.kappa_j, model.a3_kg_m2]) / model.psi_kg_m2
    values[1:3] /= changed.clock**2
    out: Floats = np.log(np.maximum(values, 1e-300))
    return out


def prior(model: Model) -> tuple[Floats, bool]:
    """Covariance (9, 9) of the model's constants, and whether it is stated; else `UNSTATED` of each."""
    known = model.covariance
    if known is not None and np.diag(known)[0] > 0:
        return known, True
    return np.diag((UNSTATED * model.constants()) ** 2), False


def slopes(model: Model) -> Floats:
    """Derivatives (4, 9) of the logarithms of the ratios by the constants."""
    out = np.zeros((4, len(CONSTANTS)))
    constants = model.constants()
    for row, name in enumerate(("lambda_kg_m2", "sigma_j", "kappa_j", "a3_kg_m2")):
        out[row, CONSTANTS.index(name)] = 1 / constants[CONSTANTS.index(name)]
        out[row, 0] = -1 / constants[0]
    return out


def length_check(model: Model, ratios: dict[str, float], covariance: Floats) -> LengthCheck:
    """The test of g, clock and l1 from the ratios over psi with their covariance (lambda, sigma, kappa, a3)."""
    per_length = ratios["kappa"] / ratios["a3"]
    quotient = per_length * model.l1_m / model.g_m_s2
    slope = np.array([0.0, 0.0, 1 / ratios["kappa"], -1 / ratios["a3"]])
    sigma = float(np.sqrt(slope @ covariance @ slope))
    stated = model.sigmas()["l1_m"] / model.l1_m
    given = {"g_m_s2": model.g_m_s2, "l1_m": model.l1_m, "clock": 1.0}
    measured = {
        "g_m_s2": model.g_m_s2 * quotient,
        "l1_m": model.l1_m / quotient,
        "clock": float(quotient**-0.5),
    }
    return LengthCheck(float(quotient), sigma, float(stated), given, measured)


def _pulled(model: Model, pull: Floats) -> Model:
    """The model with its constants moved by ``pull`` (9,), masses and length kept positive."""
    moved = model.constants() + pull
    least = np.where(np.isin(CONSTANTS, ("zeta_kg_m2",)), -np.inf, 0.2 * model.constants())
    return replace(
        model,
        **dict(zip(CONSTANTS, np.maximum(moved, least).tolist(), strict=True)),
        covariance=None,
    )


def _found(model: Model, data: Floats, weight: Floats, change: Change) -> tuple[float, float, float]:
    """The factor of a cause, the standard deviation of its logarithm, and the cost with its prior."""

    def cost(x: float) -> tuple[float, Floats]:
        left: Floats = data - predicted(change(model, float(np.exp(x))))
        return float(left @ weight @ left + (x / WIDE) ** 2), left

    x, step = 0.0, 1e-5
    best, left = cost(x)
    information = 1 / WIDE**2
    for _ in range(STEPS):
        slope = (cost(x - step)[1] - cost(x + step)[1]) / (2 * step)
        information = float(slope @ weight @ slope) + 1 / WIDE**2
        move = float(slope @ weight @ left - x / WIDE**2) / information
        move = float(np.clip(move, -0.3, 0.3))
        tried, at = cost(x + move)
        if not tried < best:
            break
        x, best, left = x + move, tried, at
    return float(np.exp(x)), information**-0.5, best


def causes(model: Model, ratios: dict[str, float], covariance: Floats) -> tuple[Cause, ...]:
    """Causes with their probabilities, the likeliest first; ``covariance``: of the ratios over psi, (4, 4)."""
    values = np.array([ratios[n] for n in ratios_of(2)])
    known, _ = prior(model)
    slope = slopes(model)
    weight = np.asarray(
        np.linalg.inv(slope @ known @ slope.T + covariance / np.outer(values, values)), dtype=np.float64
    )
    data: Floats = np.log(values)
    gain = known @ slope.T @ weight
    rest = float((known - gain @ slope @ known)[0, 0])
    length = length_check(model, ratios, covariance)

    def judged(name: str, words: str, change: Change) -> tuple[Cause, float]:
        """A cause as it would be, and the logarithm of its marginal likelihood."""
        factor, spread, cost = _found(model, data, weight, change) if name != PARTS else (1.0, 0.0, 0.0)
        changed = change(model, factor)
        left = data - predicted(changed)
        chi2 = float(left @ weight @ left)
        likely = -chi2 / 2 if name == PARTS else -cost / 2 + float(np.log(spread / WIDE))
        # Gravity that is nowhere on the ground is not gravity; where it was given so, it is what is wrong.
        if length.contradicts and name in OF_LENGTH and OF_LENGTH[name] not in length.possible:
            likely -= IMPOSSIBLE
        further = change(model, factor * (1 + 1e-4)).model.psi_kg_m2 - changed.model.psi_kg_m2
        sigma = float(np.hypot(np.sqrt(max(rest, 0.0)), further / 1e-4 * spread))
        moved = Changed(_pulled(changed.model, gain @ left), changed.clock)
        return Cause(name, words, moved, factor, chi2, 0.0, sigma), likely

    known_masses = model.m2_kg > 0 and model.g_m_s2 > 0
    every = (AS_STATED, *(CAUSES if known_masses else CAUSES[:2]))
    found, evidence = zip(*(judged(*cause) for cause in every), strict=True)
    chance = np.exp(np.array(evidence) - max(evidence))
    named = [replace(c, probability=float(p)) for c, p in zip(found, chance / chance.sum(), strict=True)]
    return tuple(sorted(named, key=lambda c: -c.probability))


def of_length(model: Model, length: LengthCheck) -> tuple[Cause, ...]:
    """Changes of g, clock and l1, each by as much as the motion measures, with a probability of 1/2 each.

    A wrong clock and a wrong g change the coefficients alike, so that the three are two cases.
    """
    out = []
    for name, words, change in CAUSES[:3]:
        key = OF_LENGTH[name]
        if key in length.possible:
            factor = length.measured[key] / length.given[key]
            share = 1 / min(2, len(length.possible))
            out.append(Cause(name, words, change(model, factor), factor, 0.0, share, 0.0))
    return tuple(out)


def check(
    model: Model, ratios: dict[str, float], covariance: Floats
) -> tuple[Consistency, tuple[Cause, ...]]:
    """The ratios over psi of a double pendulum with their covariance (4, 4), against the model's parts.

    Returns what is to be said, and the causes from which the coefficients' changes are to be found where it
    contradicts.
    """
    names = ratios_of(2)
    found = causes(model, ratios, covariance)
    known, stated = prior(model)
    slope = slopes(model)
    values = np.array([ratios[n] for n in names])
    of_parts = np.array([getattr(model, NAMES[n]) for n in names]) / model.psi_kg_m2
    sigma = np.sqrt(np.diag(slope @ known @ slope.T)) * of_parts
    fitted = np.sqrt(np.diag(covariance))
    chi2 = next(c.chi2 for c in found if c.name == "parts")
    probability = float(scipy.special.chdtrc(len(names), chi2))
    return (
        Consistency(
            length_check(model, ratios, covariance),
            {
                n: RatioCheck(
                    Estimate(float(values[k]), float(fitted[k]), unit(n)),
                    Estimate(float(of_parts[k]), float(sigma[k]), unit(n)),
                )
                for k, n in enumerate(names)
            },
            chi2,
            probability,
            stated,
            {n: _together(model, known, found, n) for n in SHOWN},
            tuple(
                Explanation(c.name, c.words, c.factor, c.chi2, c.probability, c.changed.model.psi_kg_m2, {})
                for c in found
            ),
            {},
        ),
        found,
    )


def _together(model: Model, known: Floats, found: tuple[Cause, ...], name: str) -> tuple[Estimate, Estimate]:
    """A constant as the parts have it, and as parts and motion have it together."""
    key = SHOWN[name]
    at = CONSTANTS.index(key)
    kind = SHOWN_UNITS[name]
    weights = np.array([c.probability for c in found])
    values = np.array([getattr(c.changed.model, key) for c in found])
    mean = float(weights @ values)
    own = (
        np.array([c.psi_sigma for c in found])
        if name == "psi"
        else np.full(values.size, known[at, at] ** 0.5)
    )
    sigma = float(np.sqrt(weights @ (own**2 + (values - mean) ** 2)))
    return Estimate(getattr(model, key), float(known[at, at] ** 0.5), kind), Estimate(mean, sigma, kind)
