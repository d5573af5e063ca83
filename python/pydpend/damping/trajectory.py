"""The trajectory fit: multiple shooting on the equations of motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pydpend.coefficients import FULL, parameters, ratios_of
from pydpend.damping import camera, maps, plausible, shooting
from pydpend.damping.intervals import profile_intervals, refusal
from pydpend.damping.judged import Found, judge
from pydpend.damping.recording import Recording
from pydpend.damping.result import DampingFit
from pydpend.damping.shooting import Progress
from pydpend.errors import FitError, fault
from pydpend.fit_options import FitOptions
from pydpend.fit_status import FitStatus
from pydpend.model import Model

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
    checked: bool = True,
    progress: Progress | None = None,
) -> DampingFit:
    """Fits coefficients to one or several recordings that have them in common.

    ``names``: the coefficients; what ``options`` frees besides is fitted too. ``checked``: whether the ratios are held
    against the model's parts.

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
            checked=checked,
            progress=progress,
        )
    used = tracks if bias is None else maps.corrected(tracks, bias)
    found = Found(recordings, used, model, names, wanted, solution, bias, huber)
    fit = judge(found, progress, checked=checked)
    if options.intervals != "profile":
        return fit
    if refused := refusal(solution):
        return replace(fit, notes=(*fit.notes, refused))
    intervals = profile_intervals(used, solution, fit.coefficients, huber=huber, progress=progress)
    return replace(fit, intervals=intervals)


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
