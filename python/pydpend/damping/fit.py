"""The one entry to damping fits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pydpend import energy
from pydpend.angles import LinkAngles
from pydpend.coefficients import RATIOS, coefficients, parameters, unit
from pydpend.damping.prediction import held_out
from pydpend.damping.result import DampingFit, EnergyCurve, Estimate
from pydpend.damping.shares import shares
from pydpend.damping.shooting import Progress
from pydpend.damping.trajectory import Recording, fit_trajectory, plausible_or_raise, prepare
from pydpend.damping.uncertainty import identifiability
from pydpend.errors import FitError, fault
from pydpend.model import Model

Floats = NDArray[np.float64]


def fit_damping(
    angles: LinkAngles | Sequence[LinkAngles],
    model: Model,
    method: str = "trajectory",
    laws: str | Sequence[str] = "full",
    *,
    start_s: float | None = None,
    stop_s: float | None = None,
    ratios: bool = True,
    free: Sequence[str] = (),
    clock: bool = False,
    angle_maps: bool = False,
    predict: bool = False,
    progress: Progress | None = None,
) -> DampingFit:
    """Damping coefficients of a double pendulum from its free motion.

    ``angles``: one recording or several (fitted jointly). ``method``: ``"trajectory"`` fits the equations
    of motion to the angles (docs/damping.md); ``"energy"`` is the paper's energy profile. ``laws``:
    ``"full"``, ``"paper"`` or names of coefficients. ``ratios``: whether lambda, sigma, kappa and a3 over
    psi are free too (trajectory only; the energy method uses the model's). ``free``: further parameters
    (``added_inertia``, ``tilt``, ``offset1``, ``offset2``); ``clock``: the camera clock's scale.
    ``angle_maps``: learn repeatable angle bias. ``predict``: also fit without each part in turn and predict
    it. The free decay is found unless ``start_s`` and ``stop_s`` state it.

    Raises FitError for recordings without a free decay and models the recordings refute.
    """
    names = coefficients(laws)
    recordings = [
        prepare(a, model, start_s, stop_s) for a in ([angles] if isinstance(angles, LinkAngles) else angles)
    ]
    if not recordings:
        raise FitError(fault("fit", "there is no recording", "Give at least one"))
    if method == "energy":
        return _energy(recordings, model, names)
    if method != "trajectory":
        raise FitError(fault("fit", f"method {method!r} is not known", "Use trajectory or energy"))

    def run(some: Sequence[Recording], quiet: bool = False) -> DampingFit:
        return fit_trajectory(
            some,
            model,
            names,
            ratios=ratios,
            free=free,
            clock=clock,
            angle_maps=angle_maps,
            progress=None if quiet else progress,
        )

    fit = run(recordings)
    if predict:
        prediction, note = held_out(recordings, lambda some: run(some, quiet=True))
        fit = replace(fit, prediction=prediction, notes=(*fit.notes, note))
    return fit


def _energy(recordings: Sequence[Recording], model: Model, names: Sequence[str]) -> DampingFit:
    """The paper's fit, to all recordings at once: common coefficients, an E0 each."""
    profiles, spans = [], []
    for r in recordings:
        plausible_or_raise(r, model)
        here = (r.angles.t_s >= r.span[0]) & (r.angles.t_s <= r.span[1])
        t, phi = r.angles.t_s[here], r.angles.phi_rad[here]
        motion = energy.smooth(t, phi)
        noise = (r.noise.measured_rad[0], r.noise.measured_rad[1])
        gain = energy.acceleration_gain(t)
        profiles.append(
            energy.energy_profile(motion, model, names, sigma_a_rad_s2=(noise[0] * gain, noise[1] * gain))
        )
        spans.append(float(t[-1] - t[0]))
    fit = energy.fit_profiles(profiles)
    values = dict(zip(names, fit.values.tolist(), strict=True))
    sigma = np.sqrt(np.diag(fit.covariance))
    works = np.sum([p.unit_works[-1] for p in profiles], axis=0)
    ratios = {
        "lambda": model.lambda_kg_m2,
        "sigma": model.sigma_j,
        "kappa": model.kappa_j,
        "a3": model.a3_kg_m2,
    }
    curves = tuple(
        EnergyCurve(p.t_s, p.energy_j, e0 - p.unit_works @ fit.values, p.unit_works * fit.values)
        for p, e0 in zip(profiles, fit.e0_j, strict=True)
    )
    excess = np.max([p.rectification for p in profiles], axis=0)
    return DampingFit(
        method="energy",
        status=fit.status,
        message=f"{fit.message}; RMS misfit {1e3 * np.sqrt(np.mean(fit.residual_j**2)):.3g} mJ",
        chi2=float("nan"),
        n=int(fit.residual_j.size),
        coefficients={n: Estimate(values[n], float(s), unit(n)) for n, s in zip(names, sigma, strict=True)},
        ratios={n: Estimate(ratios[n] / model.psi_kg_m2, 0.0, unit(n)) for n in RATIOS},
        shares=shares(names, values, fit.covariance, works),
        identifiability=identifiability(
            names, fit.covariance, values, [n for n in names if values[n] <= 0], sum(spans)
        ),
        parameters=parameters(model) | values,
        names=tuple(names),
        covariance=fit.covariance,
        inputs=tuple(
            {
                "name": r.angles.name,
                "source": r.angles.meta.get("source"),
                "start_s": r.span[0],
                "stop_s": r.span[1],
                "samples": int(r.angles.t_s.size),
                "noise_deg": [float(v) for v in np.degrees(r.noise.measured_rad)],
                "e0_j": float(e0),
            }
            for r, e0 in zip(recordings, fit.e0_j, strict=True)
        ),
        energy=curves,
        notes=(
            *(f"{r.angles.name}: {r.decay.message}" for r in recordings),
            f"acceleration noise raises |N| by {100 * excess[0]:.2g} and {100 * excess[1]:.2g} % on average; "
            "taken off",
        ),
    )
