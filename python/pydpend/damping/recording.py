"""Recordings made ready for a fit, and what every fit says of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pydpend.damping.fitted_recording import FittedRecording
from pydpend.damping.noise import Noise, noise
from pydpend.damping.outliers import Outlier, without_outliers, words
from pydpend.damping.shooting import Track
from pydpend.decay import Decay, check_pendulum, find_decay
from pydpend.errors import FitError, fault
from pydpend.kinematics import LinkAngles, find_swing
from pydpend.model import Model
from pydpend.series import highpass_noise

Floats = NDArray[np.float64]

UNKNOWN_NOISE_RAD = 1e-3
"""Noise of angles with too many gaps to measure it."""


OFF_SIGMAS = 5.0
"""A fitted zero this many standard uncertainties from the given one, its own and the stated one together, is told."""

OFF_RAD = np.radians(0.5)
"""If it is off by at least this: lens and camera move the zeros of good recordings by a few tenths of a degree."""


@dataclass(frozen=True, eq=False)
class FittedZero:
    """The zero of the given angles as a fit found it: measured is true plus zero. All (links,), rad."""

    zero_rad: Floats
    sigma_rad: Floats
    """Standard error; NaN where the fit does not tell."""
    stated_rad: Floats
    """Standard uncertainty that the angles state of their zero; NaN where they do not."""

    @property
    def off(self) -> NDArray[np.bool_]:
        """Links whose given zero is wrong beyond what is stated of it."""
        allowed = OFF_SIGMAS * np.hypot(np.nan_to_num(self.sigma_rad), np.nan_to_num(self.stated_rad))
        return np.asarray(np.abs(self.zero_rad) > np.maximum(allowed, OFF_RAD))

    def notes(self, name: str) -> tuple[str, ...]:
        """In words that the given zero was wrong; empty if it was not."""
        if not self.off.any():
            return ()
        parts = [
            f"{abs(np.degrees(z)):.1f} deg" + (f" (phi{j})" if self.off.size > 1 else "")
            for j, (z, off) in enumerate(zip(self.zero_rad, self.off, strict=True), 1)
            if off
        ]
        return (
            f"{name}: the zero was off by {' and '.join(parts)}; the fit has its own, and the angles as "
            "given keep theirs",
        )


@dataclass(frozen=True, eq=False)
class Recording:
    """A recording made ready for a fit."""

    angles: LinkAngles
    """With `taken_off_rad` taken off, and outliers not seen."""
    decay: Decay
    noise: Noise
    track: Track
    outliers: tuple[Outlier, ...]
    """Samples that are left out."""
    taken_off_rad: Floats
    """(links,): zero of the given angles by their own swing, where theirs is far from that; else 0."""

    @property
    def span(self) -> tuple[float, float]:
        """Start and stop of what is fitted, s."""
        return self.decay.start_s, self.decay.stop_s

    def zero_of(self, zeros_rad: Floats, sigma_rad: Floats) -> FittedZero:
        """The zero of the given angles, from the zeros (2,) of `track` that a fit found, with standard errors (2,)."""
        links = self.angles.links
        stated = np.asarray((self.angles.meta.get("zero") or {}).get("sigma_rad", ()), dtype=np.float64)
        return FittedZero(
            zeros_rad[:links] + self.taken_off_rad,
            sigma_rad[:links],
            stated if stated.shape == (links,) else np.full(links, np.nan),
        )

    def described(self, zero: FittedZero) -> FittedRecording:
        """The recording's part of a fit's result, with the angle zeros found."""

        def degrees(values: ArrayLike) -> tuple[float, ...]:
            return tuple(np.degrees(values).tolist())

        return FittedRecording(
            name=self.angles.name,
            source=self.angles.meta.get("source"),
            start_s=self.decay.start_s,
            stop_s=self.decay.stop_s,
            samples=int(self.angles.t_s.size),
            noise_deg=degrees(self.noise.measured_rad),
            noise_source=tuple(self.noise.source),
            zeros_deg=degrees(zero.zero_rad),
            zeros_sigma_deg=degrees(zero.sigma_rad),
            zeros_stated_sigma_deg=degrees(zero.stated_rad),
            zeros_off=tuple(zero.off.tolist()),
            outliers=self.outliers,
        )

    def notes(self) -> list[str]:
        """Notes on how the free decay was found, and on links whose stated uncertainty was not believed."""
        out = [f"{self.angles.name}: {self.decay.message}"]
        out += words(self.angles.name, self.outliers, int(self.angles.t_s.size))
        for j, source in enumerate(self.noise.source[: self.angles.links]):
            if source == "measured":
                level = np.degrees(self.noise.measured_rad[j])
                out.append(
                    f"{self.angles.name}: phi{j + 1} weighted by its measured high-pass noise {level:.3g} deg "
                    "(no stated uncertainty agrees with it)"
                )
        return out


SAME = 1e-7
"""Times in s and angles in rad that agree everywhere within this are the same numbers, written to seven digits or more:
the noise of an angle is a thousand times more."""


def check_distinct(angles: Sequence[LinkAngles]) -> None:
    """Raises FitError for a recording given twice: it would count as two trials, with too small uncertainties."""
    for i, one in enumerate(angles):
        for other in angles[:i]:
            if one.phi_rad.shape == other.phi_rad.shape and all(
                np.allclose(a, b, rtol=0, atol=SAME, equal_nan=True)
                for a, b in ((one.t_s, other.t_s), (one.phi_rad, other.phi_rad))
            ):
                also = "" if one.name == other.name else f" (as {other.name} too)"
                raise FitError(
                    fault(one.name, f"the recording is given twice{also}", "Give each recording once")
                )


def prepare(
    angles: LinkAngles, model: Model, start_s: float | None = None, stop_s: float | None = None
) -> Recording:
    """Finds the free decay and the noise, leaves outliers out, and takes a zero off that the swing contradicts.

    Raises FitError where there is no decay to fit.
    """
    check_pendulum(angles)
    angles, outliers = without_outliers(angles)
    scatter = [highpass_noise(c) for c in angles.phi_rad.T]
    known = [v for v in scatter if np.isfinite(v)]
    swing = find_swing(
        angles.t_s, angles.phi_rad, max(known, default=UNKNOWN_NOISE_RAD), np.zeros(angles.links)
    )
    taken_off = np.zeros(angles.links)
    if swing is not None and swing.refutes(taken_off):
        taken_off = swing.zero_rad
        angles = replace(angles, phi_rad=angles.phi_rad - taken_off)
    decay = find_decay(angles, model, start_s, stop_s)
    level = noise(angles.t_s, angles.phi_rad, angles.sigma_rad, (decay.start_s, decay.stop_s))
    if not all(
        np.isfinite(s) or source == "stated"
        for s, source in zip(level.measured_rad, level.source, strict=True)
    ):
        raise FitError(
            fault(
                angles.name, "the angles have no 20 stretches of nine samples", "Give angles with fewer gaps"
            )
        )
    track = (angles.t_s, angles.phi_rad, level.sigma_rad)
    return Recording(angles, decay, level, track, outliers, taken_off)
