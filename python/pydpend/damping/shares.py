"""The share of the energy that each law and each joint takes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pydpend.coefficients import JOINT_OF, LAW_OF, TERMS
from pydpend.damping.recording import Recording
from pydpend.damping.result_parts import EnergyCurve, Estimate
from pydpend.damping.shooting import Trace, Track
from pydpend.errors import AnglesError
from pydpend.kinematics import LinkAngles
from pydpend.link_states import states
from pydpend.model import Model

Floats = NDArray[np.float64]


def unit_works(tracks: Sequence[Track], path: Trace, names: Sequence[str]) -> Floats:
    """Work of each of ``names`` along the motion per unit of its coefficient, summed over recordings, (C,), J."""
    total = np.zeros(len(names))
    for r in range(len(tracks)):
        t, works, _ = cumulative(tracks, path, names, r)
        if t.size:
            total += works[-1]
    return total


def cumulative(
    tracks: Sequence[Track], path: Trace, names: Sequence[str], recording: int
) -> tuple[Floats, Floats, Floats]:
    """Times (M,), works since the start per unit of each coefficient (M, C), and states (M, 4) of one recording."""
    here = path.recording == recording
    t = tracks[recording][0][path.sample[here]]
    powers = path.unit_power[here][:, [TERMS.index(name) for name in names]]
    if t.size == 0:
        return t, powers, path.state[here]
    step = np.diff(t)
    # Over a gap between chains nothing is known; its energy is not counted.
    step[step > 20 * np.median(step)] = 0.0
    # The trapezoid with its first Euler-Maclaurin correction.
    slope = np.gradient(powers, t, axis=0) if t.size > 1 else np.zeros_like(powers)
    pieces = (
        0.5 * (powers[1:] + powers[:-1]) * step[:, None] - np.diff(slope, axis=0) * step[:, None] ** 2 / 12
    )
    works = np.vstack([np.zeros(len(names)), np.cumsum(pieces, axis=0)])
    return t, works, path.state[here]


def shares(
    names: Sequence[str], values: Mapping[str, float], cov: Floats, works: Floats
) -> dict[str, dict[str, Estimate]]:
    """Fractions of the dissipated energy, with uncertainties from the coefficients' covariance (C, C).

    By ``law`` (viscous, drag, dry; the paper's 9/22/69 %), by ``joint`` (upper, lower; 81/19 %) and by
    ``coefficient``.

    By ``law`` (viscous, drag, dry; the paper's 9/22/69 %), by ``joint`` (upper, lower; 81/19 %) and by
    ``coefficient``.
    """
    c = np.array([values[name] for name in names])
    total = float(c @ works)
    groups = {
        "law": [LAW_OF[name] for name in names],
        "joint": [JOINT_OF[name] for name in names],
        "coefficient": list(names),
    }
    out: dict[str, dict[str, Estimate]] = {}
    for group, labels in groups.items():
        out[group] = {}
        for label in dict.fromkeys(labels):
            member = np.array([x == label for x in labels], dtype=np.float64)
            if total <= 0:
                out[group][label] = Estimate(float("nan"), float("nan"), "1")
                continue
            fraction = float(c @ (works * member)) / total
            slope = works * (member - fraction) / total
            out[group][label] = Estimate(fraction, float(np.sqrt(max(float(slope @ cov @ slope), 0.0))), "1")
    return out


def with_measured(curve: EnergyCurve, recording: Recording, zeros_rad: Floats, model: Model) -> EnergyCurve:
    """The curve with the energy of the measured angles (Fig. 19), smoothed without the equations of motion.

    As it is where the angles are too few to be smoothed. ``zeros_rad`` (2,): of the angles.
    """
    t, phi, sigma = recording.track
    if not curve.t_s.size:
        return curve
    near = slice(*np.searchsorted(t, (curve.t_s[0], curve.t_s[-1] + 1e-9)))
    links = phi.shape[1]
    try:
        angles = LinkAngles(t[near], phi[near] - zeros_rad[:links], sigma[near])
        moved = states(angles)
    except AnglesError:
        return curve
    pad = ((0, 0), (0, 2 - links))
    energy = model.energy(np.pad(moved.phi_rad, pad), np.pad(moved.w_rad_s, pad))
    energy = np.where(np.isfinite(phi[near]).all(axis=1), energy, np.nan)
    at = np.searchsorted(t[near], curve.t_s).clip(0, energy.size - 1)
    return replace(curve, measured_j=energy[at])


def energy_curve(
    tracks: Sequence[Track],
    path: Trace,
    names: Sequence[str],
    values: Mapping[str, float],
    model: Model,
    recording: int,
) -> EnergyCurve:
    """Energy of the fitted motion of one recording, and its start minus the works (Fig. 19)."""
    t, unit, state = cumulative(tracks, path, names, recording)
    works = unit * np.array([values[name] for name in names])
    energy = model.energy(state[:, :2], state[:, 2:])
    lost = works.sum(axis=1)
    # The curve starts where it fits best, not at the first sample's noise.
    e0 = float(np.mean(energy + lost)) if t.size else float("nan")
    return EnergyCurve(t, energy, e0 - lost, works, tuple(names))
