"""Recordings made ready for a fit, and what every fit says of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pydpend.angles import LinkAngles
from pydpend.damping.noise import Noise, noise
from pydpend.damping.shooting import Track
from pydpend.decay import Decay, find_decay
from pydpend.errors import FitError, fault
from pydpend.model import Model

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Recording:
    """A recording made ready for a fit."""

    angles: LinkAngles
    decay: Decay
    noise: Noise
    track: Track

    @property
    def span(self) -> tuple[float, float]:
        """Start and stop of what is fitted, s."""
        return self.decay.start_s, self.decay.stop_s

    def described(self, zeros_rad: Floats) -> dict[str, Any]:
        """Its part of a fit's ``inputs``, with the angle zeros found, (2,)."""
        return {
            "name": self.angles.name,
            "source": self.angles.meta.get("source"),
            "start_s": self.decay.start_s,
            "stop_s": self.decay.stop_s,
            "samples": int(self.angles.t_s.size),
            "noise_deg": [float(v) for v in np.degrees(self.noise.measured_rad)],
            "noise_source": list(self.noise.source),
            "zeros_deg": [float(v) for v in np.degrees(zeros_rad)],
        }

    def notes(self) -> list[str]:
        """How its free decay was found, and links whose stated uncertainty was not believed."""
        out = [f"{self.angles.name}: {self.decay.message}"]
        for j, source in enumerate(self.noise.source[: self.angles.links]):
            if source == "measured":
                level = np.degrees(self.noise.measured_rad[j])
                out.append(
                    f"{self.angles.name}: phi{j + 1} weighted by its measured high-pass noise {level:.3g} deg "
                    "(no stated uncertainty agrees with it)"
                )
        return out


def prepare(
    angles: LinkAngles, model: Model, start_s: float | None = None, stop_s: float | None = None
) -> Recording:
    """Finds the free decay and the noise. Raises FitError where there is no decay to fit."""
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
    return Recording(angles, decay, level, (angles.t_s, angles.phi_rad, level.sigma_rad))
