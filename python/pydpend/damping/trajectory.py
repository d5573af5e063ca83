"""The trajectory fit: multiple shooting on the equations of motion, and everything said about its result."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pydpend.coefficients import FULL, RATIOS, parameters, ratios_of
from pydpend.damping import camera, maps, plausible, shooting
from pydpend.damping.intervals import profile_intervals, refusal
from pydpend.damping.recording import FittedZero, Recording
from pydpend.damping.result import DampingFit
from pydpend.damping.result_parts import estimates
from pydpend.damping.shares import energy_curve, shares, unit_works
from pydpend.damping.shooting import Progress, Solution, Track
from pydpend.damping.uncertainty import covariance, identifiability
from pydpend.errors import FitError, fault
from pydpend.fit_options import FitOptions
from pydpend.fit_status import FitStatus
from pydpend.information import check_errors
from pydpend.model import Model

Floats = NDArray[np.float64]

SEGMENT_S = 1.0
"""Length of the segments. On the paper's trials one second makes the trials' coefficients agree better and
predicts 2-s windows of the other trial better than 0.25 or 0.5 s (docs/validation/damping.md)."""
FLOOR = 0.05
"""Smallest slack, relative to what a segment's own samples determine its state to: information is then
shared over 1/0.05 = 20 segments. Tighter, a segment near the upright answers to the rounding of its own integration."""
HUBER = 3.5


def fit_trajectory(
    recordings: Sequence[Recording],
    model: Model,
    names: Sequence[str],
    options: FitOptions,
    *,
    segment_s: float = SEGMENT_S,
    max_iterations: int = 60,
    progress: Progress | None = None,
) -> DampingFit:
    """Fits coefficients to one or several recordings that have them in common.

    ``names``: the coefficients; what ``options`` frees besides is fitted too.

    Where segments of ``segment_s`` do not converge, shorter ones are taken, down to `shooting.PIECE_S`. Raises FitError
    for constants the recordings refute, and where nothing is determined.
    """
    tracks = [r.track for r in recordings]
    length = length_of(recordings, segment_s)
    ratios, angle_maps = options.frees_ratios, options.angle_maps
    if not ratios:
        _refuse(recordings, model, None)
    else:
        for r in recordings:
            plausible_or_raise(r, model)
    wanted = [*(ratios_of(recordings[0].angles.links) if ratios else ()), *names, *options.freed]
    bounded = [n for n in wanted if n in FULL]
    bias = None
    settled = shooting.settled(
        tracks,
        [r.span for r in recordings],
        length,
        parameters(model),
        np.zeros((len(tracks), 2)),
        free=wanted,
        bounded=bounded,
        progress=progress,
    )
    segments, start, zeros = settled.segments, settled.parameters, settled.zeros_rad
    plausible.check_followed([r.angles.name for r in recordings], settled.chi2)
    if len(segments) < 4:
        raise FitError(
            fault(
                ", ".join(r.angles.name for r in recordings),
                f"only {len(segments)} segments of {length:.2g} s have enough samples of both links",
                "Give angles with fewer gaps",
            )
        )
    # Where the angles' errors are not the noise between neighbours, all residuals would be outliers.
    huber = HUBER * max(1.0, settled.chi2) ** 0.5
    cameras = camera.cameras_of(recordings)
    for pass_ in range(3 if angle_maps else 1):
        solution = shooting.solve(
            tracks if bias is None else maps.corrected(tracks, bias),
            segments,
            start,
            zeros,
            free=wanted,
            bounded=bounded,
            slack=FLOOR,
            clock=options.clock,
            huber=huber,
            max_iterations=max_iterations,
            cameras=cameras,
            progress=progress,
        )
        if angle_maps:
            bias = maps.learn(solution.square(tracks), solution)
            segments, start, zeros = solution.segments, solution.parameters, solution.zeros_rad
            cameras = solution.cameras
            if pass_ == 2:
                break
    if solution.status is not FitStatus.CONVERGED and length > 1.01 * shooting.PIECE_S:
        return fit_trajectory(
            recordings,
            model,
            names,
            options,
            segment_s=max(shooting.PIECE_S, length / 2),
            max_iterations=max_iterations,
            progress=progress,
        )
    used = tracks if bias is None else maps.corrected(tracks, bias)
    fit = _judge(recordings, used, model, names, wanted, solution, bias, progress)
    if options.intervals != "profile":
        return fit
    if refused := refusal(solution):
        return replace(fit, notes=(*fit.notes, refused))
    found = profile_intervals(used, solution, fit.coefficients, huber=huber, progress=progress)
    return replace(fit, intervals=found)


def plausible_or_raise(recording: Recording, model: Model) -> None:
    """Refuses a model the recording refutes, with the chi-square of its constants held fixed."""
    try:
        plausible.check_model(recording.track, recording.span, model, recording.angles.name, None)
    except FitError:
        _refuse([recording], model, 10.0)
        raise


def _refuse(recordings: Sequence[Recording], model: Model, first_s: float | None) -> None:
    for r in recordings:
        chi2 = None
        if first_s is not None:
            span = (r.span[0], min(r.span[1], r.span[0] + first_s))
            try:
                fixed = shooting.solve(
                    [r.track],
                    shooting.cut([r.track], [span], SEGMENT_S),
                    parameters(model),
                    np.zeros((1, 2)),
                    free=FULL,
                    bounded=FULL,
                    slack=1.0,
                    learned=False,
                    max_iterations=15,
                )
                chi2 = fixed.chi2
            except FitError:
                chi2 = None
        plausible.check_model(r.track, r.span, model, r.angles.name, chi2)


def length_of(recordings: Sequence[Recording], segment_s: float) -> float:
    """A short motion is cut finer, so that the joints still say how well it is described."""
    longest = max(float(np.median(np.diff(r.angles.t_s))) for r in recordings)
    shortest = min(r.span[1] - r.span[0] for r in recordings)
    return max(min(segment_s, shortest / 12), 12 * longest)


def tightened(
    tracks: Sequence[Track],
    solution: Solution,
    wanted: Sequence[str],
    bounded: Sequence[str],
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
        bounded=bounded,
        slack=list(np.minimum(solution.slack, 0.05 * solution.own_sigma)),
        huber=1e3,
        learned=False,
        max_iterations=12,
        clock_scale=solution.clock_scale,
        progress=progress,
    )


def _judge(
    recordings: Sequence[Recording],
    tracks: Sequence[Track],
    model: Model,
    names: Sequence[str],
    wanted: Sequence[str],
    solution: Solution,
    bias: maps.Maps | None,
    progress: Progress | None,
) -> DampingFit:
    relative = solution.slack / solution.own_sigma
    model_error = bool(relative.max() > 0.2)
    bounded = [n for n in wanted if n in FULL]
    tracks = solution.square(tracks)
    strict = tightened(tracks, solution, wanted, bounded, progress) if model_error else solution
    cov = covariance(solution, model_error=model_error)
    zeros = [_zero(r, k, solution, cov) for k, r in enumerate(recordings)]
    seen = [camera.found_numbers(solution, cov, k) for k in range(len(recordings))]
    of_camera = camera.of_camera(solution, cov, model_error=model_error)
    rows = [i for i, n in enumerate(solution.names) if n in names or n in RATIOS]
    kept = tuple(solution.names[i] for i in rows)
    cov = cov[np.ix_(rows, rows)]
    check_errors(list(kept), cov)
    psi = solution.parameters["psi"]
    scale = np.array([1 / psi if n in RATIOS else 1.0 for n in kept])
    cov = cov * np.outer(scale, scale)
    sigma = dict(zip(kept, np.sqrt(np.diag(cov)), strict=True))
    values = {n: solution.parameters.get(n, 0.0) for n in FULL} | {
        n: solution.parameters[n] / psi for n in RATIOS
    }
    links = recordings[0].angles.links
    path = shooting.trace(tracks, solution.segments, solution.parameters, solution.clock_scale)
    c_rows = [kept.index(n) for n in names]
    c_cov = cov[np.ix_(c_rows, c_rows)]
    fitted = fitted_model(model, solution.parameters)
    held = [n for n in names if values[n] <= 0.0]
    duration = float(np.sum(np.diff(solution.segments.times_s, axis=1)))
    return DampingFit(
        method="trajectory",
        status=solution.status,
        message=_message(solution, strict, relative),
        within_noise=_within_noise(solution, strict, relative),
        chi2=strict.chi2,
        n=int(solution.counts.sum()),
        coefficients=estimates(names, values, sigma),
        ratios=estimates(ratios_of(links), values, sigma),
        shares=shares(names, values, c_cov, unit_works(tracks, path, names)),
        identifiability=identifiability(kept, cov, values, held, duration),
        parameters=solution.parameters,
        names=kept,
        covariance=cov,
        inputs=tuple(
            replace(
                r.described(zero),
                tail_modes_hz=tuple(plausible.tail_modes_hz(r.track, r.span, fitted)),
                camera_numbers=numbers,
                camera_numbers_sigma=numbers_sigma,
            )
            for r, zero, (numbers, numbers_sigma) in zip(recordings, zeros, seen, strict=True)
        ),
        energy=tuple(energy_curve(tracks, path, names, values, fitted, k) for k in range(len(recordings))),
        residuals=shooting.residuals_of(tracks, path, solution.zeros_rad),
        chi2_slack=solution.chi2,
        slack={
            f"{quantity}": float(s)
            for quantity, s in zip(
                ("phi1_rad", "phi2_rad", "w1_rad_s", "w2_rad_s"), solution.slack, strict=True
            )
        }
        | {
            f"{quantity}_over_noise": float(s)
            for quantity, s in zip(("phi1", "phi2", "w1", "w2"), relative, strict=True)
        },
        iterations=solution.iterations,
        modes_hz=plausible.modes_hz(fitted)[:links],
        maps=None if bias is None else bias.result(),
        camera_sigma={n: of_camera[n] for n in names if n in of_camera},
        notes=(
            *_notes(recordings, solution),
            *camera.words({n: sigma[n] for n in names}, of_camera),
            *(note for r, zero in zip(recordings, zeros, strict=True) for note in zero.notes(r.angles.name)),
        ),
    )


def _zero(recording: Recording, index: int, solution: Solution, cov: Floats) -> FittedZero:
    """A recording's angle zero with its standard error."""
    sigma = np.full(2, np.nan)
    for j in (0, 1):
        name = f"zero{j + 1}[{index}]"
        if name in solution.names:
            at = solution.names.index(name)
            sigma[j] = np.sqrt(cov[at, at])
    return recording.zero_of(solution.zeros_rad[index], sigma)


def fitted_model(model: Model, values: dict[str, float]) -> Model:
    """The model with the fitted constants."""
    return replace(
        model,
        lambda_kg_m2=values["lambda"],
        a3_kg_m2=values["a3"],
        sigma_j=values["sigma"],
        kappa_j=values["kappa"],
        covariance=None,
        name=f"{model.name}, fitted",
    )


def _within_noise(solution: Solution, strict: Solution, relative: Floats) -> bool:
    """Whether what is left of the angles is no more than their noise."""
    # Chi-square scatters by sqrt(2/n); a few of these, or three percent, are no evidence against the model.
    n = float(solution.counts.sum())
    return bool(relative.max() <= 0.2 or strict.chi2 < 1 + max(0.03, 4 * (2 / n) ** 0.5))


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
    return tuple(out)
