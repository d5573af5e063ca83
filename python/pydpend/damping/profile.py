"""The paper's fit of an energy profile (Section 7.1), with states that know the equations of motion.

The motion is smoothed piece by piece: in each second the state at its start is fitted to the angles with the
equations of motion, the losses being those found so far. Pieces share no state, so the errors of their
energies are independent of each other, and each is known from the piece's own information. The energies at
the middle of the pieces are then fitted by ``E0 - sum c W_c``, and the losses are handed back until nothing
changes. A local polynomial or a Kalman smoother, which know no mechanics, leave fifty times the error in E.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pydpend.coefficients import TERMS, parameters
from pydpend.damping import shooting
from pydpend.damping.shares import cumulative
from pydpend.damping.shooting import Cameras, Progress, Segments, Track
from pydpend.energy import EnergyFit, EnergyProfile, fit_profiles
from pydpend.errors import FitError, fault
from pydpend.fit_status import FitStatus
from pydpend.model import Model

Floats = NDArray[np.float64]

DOUBLINGS = 2
"""From pieces of `shooting.PIECE_S` to a second in two doublings. The information on the energy grows with the square
of their length; beyond a second the motion near the upright forgets its state."""
ROUNDS = 5
"""Most Gauss-Newton steps at the end; one or two are enough."""
CLOSE = 0.1
"""Standard errors that a coefficient may still move by."""
UNTIED = (1e3, 1e3, 1e3, 1e3)
"""Slack at which a piece knows nothing of the next, rad and rad/s."""


@dataclass(frozen=True, eq=False)
class Smoothed:
    """A recording's motion in pieces, and its energy profile."""

    segments: Segments
    zeros_rad: Floats
    covariance: Floats
    """Of each piece's state, (K, 4, 4)."""
    chi2: float
    """Of the angles."""
    doubled: Segments
    """The pieces two by two, for the next round."""


@dataclass(frozen=True, eq=False)
class FittedEnergy:
    """An energy fit and what it was made from."""

    fit: EnergyFit
    few: list[EnergyProfile]
    """The profiles that were fitted, at the middle of the pieces."""
    whole: list[EnergyProfile]
    """The profiles at every sample."""
    smoothed: Smoothed
    camera_sigma: Floats
    """The cameras' part of each coefficient's standard error, SI."""


def smooth(
    tracks: Sequence[Track], segments: Segments, zeros: Floats, constants: dict[str, float]
) -> Smoothed:
    """The motion with given losses, each segment by itself. Raises FitError when there is none."""
    found = shooting.solve(tracks, segments, constants, zeros, slack=UNTIED, learned=False, max_iterations=30)
    return Smoothed(found.segments, found.zeros_rad, found.state_covariance, found.chi2, found.merged(2))


def profile(
    tracks: Sequence[Track],
    smoothed: Smoothed,
    constants: dict[str, float],
    model: Model,
    names: Sequence[str],
    recording: int,
    *,
    corrected: bool,
) -> tuple[EnergyProfile, EnergyProfile]:
    """Energy and works at the middle of the pieces, with the energies' standard errors, and at every sample.

    Rates and accelerations enter |w|, w^2, |w|^3 and |N|, so their noise shifts the means: found by the
    unscented transform of each piece's covariance and taken off, when ``corrected``.
    """
    segments = smoothed.segments

    def along(states: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        path = shooting.trace(tracks, replace(segments, states=states), constants)
        t, works, x = cumulative(tracks, path, names, recording)
        load = path.unit_power[path.recording == recording][:, [TERMS.index("rmu1"), TERMS.index("rmu2")]]
        return t, model.energy(x[:, :2], x[:, 2:]), works, load.mean(axis=0) if t.size else load

    t, energy, works, load = along(segments.states)
    if t.size == 0:
        raise FitError(fault("energy fit", "no second has enough samples", "Give angles with fewer gaps"))
    excess = np.zeros(2)
    root = np.linalg.cholesky(smoothed.covariance)
    if corrected:
        shift_e, shift_w = np.zeros_like(energy), np.zeros_like(works)
        # The eight sigma points of four dimensions, two standard deviations out.
        for step in (sign * root[:, :, axis] for axis in range(4) for sign in (2.0, -2.0)):
            _, e, w, heavy = along(segments.states + step)
            shift_e += (e - energy) / 8
            shift_w += (w - works) / 8
            excess += np.divide(heavy - load, load, out=np.zeros(2), where=load > 0) / 8
        works, energy = works - shift_w, energy - shift_e
    whole = EnergyProfile(t, energy, works, tuple(names), (float(excess[0]), float(excess[1])))
    mine = np.flatnonzero(segments.rows[:, 0] == recording)
    middle = np.searchsorted(t, segments.times_s[mine].mean(axis=1)).clip(0, t.size - 1)
    # What a piece does not know of its energy at its start it does not know in its middle either.
    moved = (
        segments.states[mine, None, :]
        + np.moveaxis(root[mine], 2, 1) * np.array([[[1.0]], [[-1.0]]])[:, None]
    )
    ends = model.energy(moved[..., :2], moved[..., 2:])
    sigma = np.sqrt(((ends[0] - ends[1]) ** 2).sum(axis=-1)) / 2
    few = EnergyProfile(
        t[middle], energy[middle], works[middle], tuple(names), whole.rectification, sigma_j=sigma
    )
    return few, whole


def fit_energy(
    tracks: Sequence[Track],
    spans: Sequence[tuple[float, float]],
    model: Model,
    names: Sequence[str],
    cameras: Cameras | None = None,
    progress: Progress | None = None,
) -> FittedEnergy:
    """Coefficients common to all recordings, from their energy profiles.

    What the ``cameras`` do to them is added to their covariance.
    """
    constants = parameters(model)
    segments = shooting.cut(tracks, spans, shooting.PIECE_S)
    zeros = np.zeros((len(tracks), 2))
    values = np.zeros(len(names))

    def along(
        given: Floats, *, corrected: bool = False, angles: Sequence[Track] = tracks
    ) -> tuple[list[EnergyProfile], list[EnergyProfile], Smoothed]:
        """Profiles at the middle of the pieces and at every sample when the pieces lose by ``given``."""
        now = constants | dict(zip(names, given.tolist(), strict=True))
        smoothed = smooth(angles, segments, zeros, now)
        both = [
            profile(angles, smoothed, now, model, names, r, corrected=corrected) for r in range(len(angles))
        ]
        return [few for few, _ in both], [whole for _, whole in both], smoothed

    for round_ in range(DOUBLINGS + 1):
        few, _, smoothed = along(values)
        fit = fit_profiles(few)
        values, zeros = fit.values, smoothed.zeros_rad
        # Short pieces hardly know of losses, but cannot lose their way; each says enough for twice its length.
        segments = smoothed.doubled if round_ < DOUBLINGS else smoothed.segments
        if progress is not None:
            progress(round_ + 1, DOUBLINGS + 1 + ROUNDS, fit.chi2)
    # The energies and works themselves depend a little on the losses that the pieces were followed with.
    few, _, _ = along(values)
    steps = np.sqrt(np.diag(fit.covariance))
    moved = [along(values + row)[0] for row in np.diag(steps)]
    slopes = [
        np.column_stack(
            [
                (_start(m[r], values + row) - _start(f, values)) / h
                for m, row, h in zip(moved, np.diag(steps), steps, strict=True)
            ]
        )
        for r, f in enumerate(few)
    ]

    def linear(now: Sequence[EnergyProfile]) -> list[EnergyProfile]:
        return [
            replace(f, energy_j=_start(f, values) - slope @ values, unit_works=slope)
            for f, slope in zip(now, slopes, strict=True)
        ]

    for round_ in range(ROUNDS):
        fit = fit_profiles(linear(few))
        change = float((np.abs(fit.values - values) / np.sqrt(np.diag(fit.covariance))).max())
        values = fit.values
        few, _, _ = along(values)
        if progress is not None:
            progress(DOUBLINGS + 2 + round_, DOUBLINGS + 1 + ROUNDS, fit.chi2)
        if change < CLOSE:
            break
    # What another camera would have made of them: one standard deviation of each number at a time.
    moved_by = np.zeros((0, len(names)))
    if cameras is not None:
        here = fit_profiles(linear(few)).values
        moved_by = np.array(
            [
                fit_profiles(linear(along(values, angles=a)[0])).values - here
                for a in cameras.one_by_one(tracks)
            ]
        )
    few, whole, smoothed = along(values, corrected=True)
    few = linear(few)
    fit = fit_profiles(few)
    of_cameras = moved_by.T @ moved_by
    fit = replace(fit, covariance=fit.covariance + of_cameras)
    if change >= CLOSE:
        fit = replace(fit, status=FitStatus.ITERATION_LIMIT)
    return FittedEnergy(fit, few, whole, smoothed, np.sqrt(np.diag(of_cameras)))


def _start(profile: EnergyProfile, values: Floats) -> Floats:
    """The energies with the losses up to then put back: the energy at the start, were all exact."""
    out: Floats = profile.energy_j + profile.unit_works @ values
    return out
