"""Whether a model's constants can be this pendulum's, before anything is fitted with them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from pydpend.damping.shooting import Track
from pydpend.errors import FitError, Step, fault
from pydpend.model import Model

Floats = NDArray[np.float64]

WOBBLE = 0.015
"""RMS by which the energy goes up and down, relative to its largest value, that no free decay shows. Table 8's
constants, whose ratios are up to 10 % off, give 0.0024 on the paper's trials; psi off by 10 % gives 0.008."""

ZERO_OFF_RAD = np.radians(20.0)
"""The angles' zeros may be off by this much before the constants are doubted."""

TOLD_CHI2 = 1.5
"""Chi-square with the constants fixed that is worth telling."""

SCALE = 5.0
"""Factor between the recording's and the model's frequencies that no motion of that pendulum has; units off by a
thousand give 30."""


def modes_hz(model: Model) -> tuple[float, float]:
    """Frequencies of the two small oscillations about hanging, Hz."""
    mass = model.mass_matrix(np.zeros(2))
    stiffness = np.diag([model.sigma_j, model.kappa_j])
    squared = np.linalg.eigvals(np.linalg.solve(mass, stiffness)).real
    low, high = np.sort(np.sqrt(np.maximum(squared, 0.0)) / (2 * np.pi))
    return float(low), float(high)


@dataclass(frozen=True)
class Wobble:
    """The rise and fall of a measured motion's energy, relative to its largest value."""

    rms: float
    """RMS distance from the nearest curve that only falls."""
    rise: float
    """The largest rise."""

    @property
    def too_large(self) -> bool:
        """Whether no free decay shows as much."""
        return self.rms > WOBBLE


def wobble(track: Track, span: tuple[float, float], model: Model) -> Wobble:
    """The energy's ups and downs.

    With the angles' zeros that make them smallest where the given ones make them too large.

    With the angles' zeros that make them smallest where the given ones make them too large.

    Local cubics over 24 ms give the rates; means over 0.2 s take the noise off.
    """
    t, phi, _ = track
    keep = (t >= span[0]) & (t <= span[1]) & np.isfinite(phi).all(axis=1)
    t, phi = t[keep], phi[keep]
    dt = float(np.median(np.diff(t)))
    half = max(2, round(0.012 / dt))
    u = np.arange(-half, half + 1)
    weights = np.linalg.pinv(np.vander(u, 4, increasing=True).astype(np.float64))
    smooth = np.column_stack([np.convolve(c, weights[0][::-1], "valid") for c in phi.T])
    rate = np.column_stack([np.convolve(c, weights[1][::-1], "valid") for c in phi.T]) / dt
    even = np.abs(t[2 * half :] - t[: -2 * half] - 2 * half * dt) < 0.5 * dt
    links = phi.shape[1]
    if links == 1:
        smooth, rate = (np.column_stack([c, 0 * c]) for c in (smooth, rate))
    smooth, rate = smooth[even], rate[even]
    width = max(1, round(0.2 / dt))
    count = smooth.shape[0] // width
    if count < 2:
        return Wobble(0.0, 0.0)

    def energies(zeros: Floats) -> Floats:
        energy = model.energy(smooth - np.pad(zeros, (0, 2 - links)), rate)
        out: Floats = energy[: count * width].reshape(count, width).mean(axis=1)
        return out / max(float(out.max()), 1e-300)

    def rising(zeros: Floats) -> Floats:
        energy = energies(zeros)
        out: Floats = energy - scipy.optimize.isotonic_regression(energy, increasing=False).x
        return out

    def judged(zeros: Floats) -> Wobble:
        energy = energies(zeros)
        rise = energy - np.minimum.accumulate(energy)
        return Wobble(float(np.sqrt(np.mean(rising(zeros) ** 2))), float(rise.max()))

    given = judged(np.zeros(links))
    if not given.too_large:
        return given
    found = scipy.optimize.least_squares(
        rising, np.zeros(links), bounds=(-ZERO_OFF_RAD, ZERO_OFF_RAD), x_scale=0.05
    )
    return judged(found.x)


def typical_hz(track: Track, span: tuple[float, float]) -> float:
    """RMS acceleration over RMS rate of the upper link, as a frequency, Hz.

    Between the modes when the links swing, and of their size when they tumble. From local parabolas over 48 ms; NaN
    when too little is seen.

    Between the modes when the links swing, and of their size when they tumble. From local parabolas over 48 ms; NaN
    when too little is seen.
    """
    t, phi, _ = track
    keep = (t >= span[0]) & (t <= span[1]) & np.isfinite(phi[:, 0])
    if keep.sum() < 50:
        return float("nan")
    t, x = t[keep], phi[keep, 0]
    dt = float(np.median(np.diff(t)))
    half = max(2, round(0.024 / dt))
    u = np.arange(-half, half + 1)
    weights = np.linalg.pinv(np.vander(u, 3, increasing=True).astype(np.float64))
    rate = np.convolve(x, weights[1][::-1], "valid") / dt
    acceleration = 2 * np.convolve(x, weights[2][::-1], "valid") / dt**2
    even = np.abs(t[2 * half :] - t[: -2 * half] - 2 * half * dt) < 0.5 * dt
    if not even.any():
        return float("nan")
    rms = float(np.sqrt(np.mean(rate[even] ** 2)))
    return float(np.sqrt(np.mean(acceleration[even] ** 2))) / rms / (2 * np.pi) if rms > 0 else float("nan")


def check_model(track: Track, span: tuple[float, float], model: Model, name: str, chi2: float | None) -> None:
    """Refuses constants under which the measured motion gains energy, or whose frequencies are of another scale.

    Raises FitError in plain words.
    """
    low, high = modes_hz(model)
    swings = " and ".join(f"{f:.3g}" for f in modes_hz(model)[: model.links])
    typical = typical_hz(track, span)
    if np.isfinite(typical) and (low > SCALE * typical or high < typical / SCALE):
        factor = (low / typical) ** 2 if low > typical else (high / typical) ** 2
        raise FitError(
            fault(
                name,
                f"the model {model.name!r} swings at {swings} Hz, the recording at "
                f"about {typical:.2g} Hz: "
                f"sigma/psi is off by about {factor:.2g}",
                "Check the units of the model (kg, m, s) and of the times",
            )
        )
    seen = wobble(track, span, model)
    if seen.too_large:
        words = ""
        if chi2 is not None and chi2 > TOLD_CHI2:
            words = f", and with these constants fixed chi-square is {chi2:.3g}, where noise alone gives 1"
        raise FitError(
            fault(
                name,
                f"the constants of the model {model.name!r} are not this pendulum's: the energy of the "
                "measured "
                f"motion goes up and down by {100 * seen.rms:.2g} % RMS of its largest value (the largest rise is "
                f"{100 * seen.rise:.2g} %) although nothing drives it"
                f"{words} "
                f"(its small oscillations would be at {swings} Hz)",
                "Use constants derived from the parts"
                + (" (" + DERIVED + ")" if model.links == 2 else "")
                + " or your own; no damping fitted with these would mean anything",
            )
        )


DERIVED = Step("--model derived", "dp.derived('A')")
"""The constants of the paper's pendulum, derived from its parts."""

LOST = 1000.0
"""Chi-square of loosely tied pieces beyond which nothing was found: wrong constants that are let through give tens."""


def check_followed(names: Sequence[str], chi2: float) -> None:
    """Checks that pieces of a motion with states of their own follow the angles of the recordings ``names``.

    Raises FitError where they do not: their chi-square is beyond `LOST`.
    """
    if chi2 > LOST:
        raise FitError(
            fault(
                ", ".join(names),
                f"no motion of this pendulum comes near the angles (chi-square {chi2:.0f} even in pieces that are tied "
                "loosely)",
                "Give angles with fewer gaps, or check the model",
            )
        )


SMALL_DEG = 20.0
"""Swing up to which an oscillation is called small: its frequency is 0.8 % below that of none."""

TAIL_S = 8.0
"""Length of the end of the motion in which its small oscillations are looked at, s."""


def tail_of(track: Track, span: tuple[float, float], model: Model) -> dict[str, Any]:
    """The end of a motion for `FittedRecording`: its swing of each link, deg, and its modes if that is small."""
    t, phi, _ = track
    last = phi[(t >= span[1] - TAIL_S) & (t <= span[1])]
    last = last[np.isfinite(last).all(axis=1)]
    if len(last) < 2:
        return {"tail_modes_hz": (), "tail_swing_deg": ()}
    swing = np.degrees(np.ptp(last, axis=0) / 2)
    modes = tail_modes_hz(track, span, model) if swing.max() <= SMALL_DEG else ()
    return {"tail_modes_hz": modes, "tail_swing_deg": tuple(swing.tolist())}


def tail_modes_hz(track: Track, span: tuple[float, float], model: Model) -> tuple[float, ...]:
    """Frequencies of the last small oscillations as measured, Hz; empty when less of the motion was seen.

    Damped sines common to the links, fitted to the last 8 s from the model's frequencies.

    Damped sines common to the links, fitted to the last 8 s from the model's frequencies.

    They lie below the small-swing limit by the amplitude that is left (1.3e-3 of it at 8 deg).
    """
    t, phi, _ = track
    keep = (t >= span[1] - TAIL_S) & (t <= span[1]) & np.isfinite(phi).all(axis=1)
    t, phi = t[keep] - span[1], phi[keep]
    if t.size < 200 or np.ptp(t) < 0.5 * TAIL_S:
        return ()
    start = np.array(modes_hz(model)[: phi.shape[1]])

    def parts(x: Floats) -> Floats:
        f, rate = x.reshape(2, -1)
        angle = 2 * np.pi * np.outer(t, f)
        fall = np.exp(-np.outer(t, rate))
        return np.column_stack([np.ones(t.size), fall * np.cos(angle), fall * np.sin(angle)])

    def misfit(x: Floats) -> Floats:
        basis = parts(x)
        left: Floats = phi - basis @ np.linalg.lstsq(basis, phi, rcond=None)[0]
        return left.ravel()

    found = scipy.optimize.least_squares(
        misfit, np.concatenate([start, np.full(start.size, 0.1)]), x_scale=0.1
    )
    return tuple(found.x[: start.size].tolist())
