"""Everything that is said of a solution of the trajectory fit: its errors, its misfit, its ratios, its motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pydpend.coefficients import FREE, FULL, RATIOS, ratios_of
from pydpend.damping import camera, maps, plausible, shooting
from pydpend.damping.contradiction import carried
from pydpend.damping.parts import length_check
from pydpend.damping.recording import FittedZero, Recording
from pydpend.damping.result import DampingFit
from pydpend.damping.result_parts import Estimate, estimates
from pydpend.damping.shares import energy_curve, shares, unit_works, with_measured
from pydpend.damping.shooting import Progress, Solution, Track
from pydpend.damping.uncertainty import covariance, identifiability
from pydpend.errors import listed
from pydpend.information import check_errors
from pydpend.model import UNITS, Model

Floats = NDArray[np.float64]

RIGHT = 0.2
"""Slack over the noise of a segment's state up to which the model is right to within the noise."""

WRONG = 1.0
"""Slack over the noise of a segment's state beyond which the model is not right, whatever chi-square is."""


@dataclass(frozen=True, eq=False)
class Found:
    """A solution and what it is of."""

    recordings: Sequence[Recording]
    tracks: Sequence[Track]
    """The angles with the bias maps taken off, the cameras' part not."""
    model: Model
    names: Sequence[str]
    """The coefficients."""
    wanted: Sequence[str]
    """All that was free."""
    solution: Solution
    bias: maps.Maps | None
    huber: float


def tightened(
    tracks: Sequence[Track],
    solution: Solution,
    wanted: Sequence[str],
    progress: Progress | None,
) -> Solution:
    """The fit with no slack beyond the noise's own: what the model must be able to do if it is right.

    ``tracks``: the angles with the cameras' part taken off.
    """
    return shooting.solve(
        tracks,
        solution.segments,
        solution.parameters,
        solution.zeros_rad,
        free=wanted,
        bounded=[n for n in wanted if n in FULL],
        slack=list(np.minimum(solution.slack, 0.05 * solution.own_sigma)),
        huber=1e3,
        learned=False,
        max_iterations=12,
        clock_scale=solution.clock_scale,
        progress=progress,
    )


def judge(found: Found, progress: Progress | None = None, *, checked: bool = True) -> DampingFit:
    """The result of a solution. Without ``checked`` its ratios are not held against the model's parts."""
    recordings, solution, names = found.recordings, found.solution, found.names
    relative = solution.slack / solution.own_sigma
    model_error = bool(relative.max() > RIGHT)
    tracks = solution.square(found.tracks)
    strict = tightened(tracks, solution, found.wanted, progress) if model_error else solution
    whole = covariance(solution, model_error=model_error)
    zeros = [_zero(r, k, solution, whole) for k, r in enumerate(recordings)]
    seen = [camera.found_numbers(solution, whole, k) for k in range(len(recordings))]
    of_camera = camera.of_camera(solution, whole, model_error=model_error)
    kept, cov = _scaled(solution, whole, names)
    links = recordings[0].angles.links
    values = {n: solution.parameters.get(n, 0.0) for n in FULL} | {
        n: solution.parameters[n] / solution.parameters["psi"] for n in RATIOS
    }
    c_rows = [kept.index(n) for n in names]
    r_rows = [kept.index(n) for n in ratios_of(links) if n in kept]
    of_ratios = cov[np.ix_(r_rows, r_rows)] if checked and r_rows else None
    held_against = carried(tracks, solution, found.model, names, of_ratios, found.huber)
    cov[np.ix_(c_rows, c_rows)] += held_against.covariance
    sigma = dict(zip(kept, np.sqrt(np.diag(cov)), strict=True))
    path = shooting.trace(tracks, solution.segments, solution.parameters, solution.clock_scale)
    fitted = fitted_model(found.model, solution)
    known = found.model.scale_known
    held = [n for n in names if values[n] <= 0.0]
    duration = float(np.sum(np.diff(solution.segments.times_s, axis=1)))
    return DampingFit(
        method="trajectory",
        status=solution.status,
        message=_message(solution, strict, relative),
        within_noise=_within_noise(solution, strict, relative),
        chi2=strict.chi2,
        n=int(solution.counts.sum()),
        coefficients=estimates(names, values, sigma, scale_known=known),
        ratios=estimates(ratios_of(links), values, sigma),
        shares=shares(names, values, cov[np.ix_(c_rows, c_rows)], unit_works(tracks, path, names)),
        identifiability=identifiability(kept, cov, values, held, duration, scale_known=known),
        parameters=solution.parameters,
        names=kept,
        covariance=cov,
        inputs=tuple(
            replace(
                r.described(zero),
                **plausible.tail_of(r.track, r.span, fitted),
                camera_numbers=numbers,
                camera_numbers_sigma=numbers_sigma,
            )
            for r, zero, (numbers, numbers_sigma) in zip(recordings, zeros, seen, strict=True)
        ),
        energy=tuple(
            with_measured(curve, r, solution.zeros_rad[k], fitted) if checked else curve
            for k, r in enumerate(recordings)
            for curve in (energy_curve(tracks, path, names, values, fitted, k),)
        ),
        residuals=shooting.residuals_of(tracks, path, solution.zeros_rad),
        chi2_slack=solution.chi2,
        slack=_slack_told(solution, relative),
        iterations=solution.iterations,
        modes_hz=plausible.modes_hz(fitted)[:links],
        maps=None if found.bias is None else found.bias.result(),
        scale_known=known,
        freed=_freed(solution, whole),
        camera_sigma={n: of_camera[n] for n in names if n in of_camera},
        consistency=held_against.consistency,
        notes=(
            *_notes(recordings, solution),
            *camera.words({n: sigma[n] for n in names}, of_camera),
            *(note for r, zero in zip(recordings, zeros, strict=True) for note in zero.notes(r.angles.name)),
            *_distance(found.model, values, of_ratios),
            *(() if held_against.consistency is None else held_against.consistency.sentences),
        ),
    )


def _distance(model: Model, ratios: dict[str, float], covariance: Floats | None) -> tuple[str, ...]:
    """The distance of the joints that follows from the ratios, where no constants were given."""
    if model.scale_known or model.links == 1 or covariance is None:
        return ()
    if min(ratios["a3"], ratios["kappa"]) <= 0:
        return ()
    length = length_check(
        replace(model, l1_m=model.g_m_s2 * ratios["a3"] / ratios["kappa"]), ratios, covariance
    )
    return (
        f"the joints are {1e3 * length.measured['l1_m']:.5g} +- {1e3 * length.measured['l1_m'] * length.sigma:.1g} mm "
        f"apart by the motion, if g is {model.g_m_s2:g} m/s2 and the clock is right: measure that",
    )


def _scaled(solution: Solution, whole: Floats, names: Sequence[str]) -> tuple[tuple[str, ...], Floats]:
    """Names and covariance of the coefficients and ratios, the latter over psi."""
    rows = [i for i, n in enumerate(solution.names) if n in names or n in RATIOS]
    kept = tuple(solution.names[i] for i in rows)
    cov = whole[np.ix_(rows, rows)]
    check_errors(list(kept), cov)
    scale = np.array([1 / solution.parameters["psi"] if n in RATIOS else 1.0 for n in kept])
    return kept, cov * np.outer(scale, scale)


def _freed(solution: Solution, whole: Floats) -> dict[str, Estimate]:
    """Further parameters that were free, with their standard errors."""
    sigma = np.sqrt(np.maximum(np.diag(whole), 0.0))
    return {
        n: Estimate(float(solution.parameters.get(n, 0.0)), float(sigma[i]), UNITS[n])
        for i, n in enumerate(solution.names)
        if n in FREE
    }


def _slack_told(solution: Solution, relative: Floats) -> dict[str, float]:
    """The slack of each component of the state, and over what the noise needs."""
    absolute = zip(("phi1_rad", "phi2_rad", "w1_rad_s", "w2_rad_s"), solution.slack, strict=True)
    over = zip(("phi1", "phi2", "w1", "w2"), relative, strict=True)
    return {n: float(s) for n, s in absolute} | {f"{n}_over_noise": float(s) for n, s in over}


def _zero(recording: Recording, index: int, solution: Solution, cov: Floats) -> FittedZero:
    """A recording's angle zero with its standard error."""
    sigma = np.full(2, np.nan)
    for j in (0, 1):
        name = f"zero{j + 1}[{index}]"
        if name in solution.names:
            at = solution.names.index(name)
            sigma[j] = np.sqrt(cov[at, at])
    return recording.zero_of(solution.zeros_rad[index], sigma)


def fitted_model(model: Model, solution: Solution) -> Model:
    """The model with the fitted constants; the given one where no pendulum has them."""
    values = solution.parameters
    if not_positive(solution):
        return model
    return replace(
        model,
        lambda_kg_m2=values["lambda"],
        a3_kg_m2=values["a3"],
        sigma_j=values["sigma"],
        kappa_j=values["kappa"],
        covariance=None,
        name=f"{model.name}, fitted",
    )


def not_positive(solution: Solution) -> list[str]:
    """Names of the fitted inertias and moments of gravity that are zero or below."""
    return [n for n in RATIOS if n in solution.names and solution.parameters[n] <= 0]


def _within_noise(solution: Solution, strict: Solution, relative: Floats) -> bool:
    """Whether what is left of the angles is no more than their noise."""
    # Chi-square scatters by sqrt(2/n); a few of these, or three percent, are no evidence against the model.
    n = float(solution.counts.sum())
    small = strict.chi2 < 1 + max(0.03, 4 * (2 / n) ** 0.5)
    return bool(relative.max() <= RIGHT or (small and relative.max() <= WRONG))


def _message(solution: Solution, strict: Solution, relative: Floats) -> str:
    words = f"{solution.status.words} in {solution.iterations} steps; chi-square {strict.chi2:.3f}"
    if _within_noise(solution, strict, relative):
        return words + ": the model describes the angles to within their noise"
    return (
        words + f" without slack, {solution.chi2:.3f} with the slack that makes the joints' chi-square 1 (up "
        f"to {relative.max():.1f} times the noise of a segment's state): the model or the angles have errors "
        "beyond the noise, and the standard errors carry them"
    )


def _notes(recordings: Sequence[Recording], solution: Solution) -> tuple[str, ...]:
    out = [*(note for r in recordings for note in r.notes()), *camera.without(recordings)]
    if solution.stuck:
        out.append(
            f"a joint stuck in {solution.stuck} of {len(solution.segments)} segments; followed by events"
        )
    if wrong := not_positive(solution):
        out.append(
            f"{listed(wrong)} came out at zero or below, which no pendulum has: these coefficients mean nothing. Check "
            "the model, the zeros and which part of the recording is a free decay"
        )
    return tuple(out)
