"""Free decays of the paper's pendulum for the damping tests: simulated, then measured with noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from pydpend.energy import Motion
from pydpend.kinematics import LinkAngles
from pydpend.model import Damping, Model, derived
from pydpend.simulation import simulate

TRUTH = Damping(mu_v1=1.76e-5, mu_v2=5.08e-6, mu_q1=1.43e-5, mu_q2=3e-7, rmu1=4.5e-5, rmu2=3.7e-5)
"""The truth of the issue's table (SI)."""

ALL_TERMS = replace(TRUTH, tau_c1=1.2e-4, tau_c2=3e-5, strip_drag=1.2e-6)
"""With every law of ``full``."""


def released(
    seed: int,
    seconds: float = 60.0,
    rate_hz: float = 1000.0,
    damping: Damping = TRUTH,
    model: Model | None = None,
) -> Motion:
    """A release near (180, 180) deg, from when it is under way; offsets of up to 5 deg from the seed."""
    rng = np.random.default_rng([seed, 7])
    offset = np.radians(rng.uniform(1, 5, 2) * rng.choice([-1, 1], 2))
    t = np.arange(round(seconds * rate_hz) + 1) / rate_hz
    s = simulate(model or derived("A"), damping, [np.pi + offset[0], np.pi + offset[1], 0.0, 0.0], t)
    return Motion(s.t_s, s.phi_rad, s.w_rad_s, s.a_rad_s2)


def with_gaps(angles: LinkAngles, seed: int, missing: float = 0.2) -> LinkAngles:
    """The angles with gaps common to the links, of 80 ms on average and each twentieth of 0.2 to 0.6 s."""
    rng = np.random.default_rng([seed, 5])
    step = float(np.median(np.diff(angles.t_s)))
    gone = np.zeros(angles.t_s.size, dtype=bool)
    while gone.mean() < missing:
        length = rng.exponential(0.08) if rng.random() > 0.05 else rng.uniform(0.2, 0.6)
        first = rng.integers(0, gone.size)
        gone[first : first + max(1, round(length / step))] = True
    return replace(angles, phi_rad=np.where(gone[:, None], np.nan, angles.phi_rad))


def with_outliers(angles: LinkAngles, seed: int, share: float = 0.002, most_deg: float = 30.0) -> LinkAngles:
    """The angles with this share of samples off by up to ``most_deg``."""
    rng = np.random.default_rng([seed, 13])
    wild = rng.random(angles.phi_rad.shape) < share
    off = np.radians(rng.uniform(-most_deg, most_deg, angles.phi_rad.shape))
    return replace(angles, phi_rad=np.where(wild, angles.phi_rad + off, angles.phi_rad))


def measured(motion: Motion, seed: int, noise_deg: float, *, stated: bool = True) -> LinkAngles:
    """The angles with white noise of this size."""
    rng = np.random.default_rng([seed, 11])
    sigma = np.radians(noise_deg)
    phi = motion.phi_rad + rng.normal(0.0, sigma, motion.phi_rad.shape)
    return LinkAngles(motion.t_s, phi, np.full_like(phi, sigma if stated else np.nan), name=f"seed {seed}")
