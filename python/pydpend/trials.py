"""Several recordings of one pendulum: each fitted alone, all together, and whether they agree (Table 6, Fig. 20)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from pydpend.damping import DampingFit, fit_damping
from pydpend.damping.result import clean
from pydpend.damping.shooting import Progress
from pydpend.errors import FitError, fault
from pydpend.fit_options import FitOptions
from pydpend.json_text import JsonResult
from pydpend.kinematics import LinkAngles
from pydpend.model import Model

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Spread:
    """One coefficient or ratio over the trials."""

    values: Floats
    """(R,)"""
    sigmas: Floats
    """(R,), each trial's own standard error."""
    mean: float
    """Weighted with the spread between trials (random effects, DerSimonian-Laird)."""
    sigma: float
    """Standard error of the mean, spread included."""
    spread: float
    """Standard deviation between trials beyond their own errors."""
    deviation: float
    """Plain standard deviation of the values, as in Table 6."""
    p_value: float
    """Probability of trials this different if they had one common value."""
    unit: str


@dataclass(frozen=True, eq=False)
class Trials(JsonResult):
    """Fits of several recordings."""

    each: tuple[DampingFit, ...]
    joint: DampingFit
    spreads: dict[str, Spread]
    message: str

    def to_dict(self) -> dict[str, Any]:
        """Numbers only."""
        out: dict[str, Any] = clean(
            {
                "message": self.message,
                "coefficients": {
                    k: {
                        "values": s.values,
                        "sigmas": s.sigmas,
                        "mean": s.mean,
                        "sigma": s.sigma,
                        "spread": s.spread,
                        "deviation": s.deviation,
                        "p_value": s.p_value,
                        "unit": s.unit,
                    }
                    for k, s in self.spreads.items()
                },
            }
        )
        return out


def combine(values: Floats, sigmas: Floats, unit: str) -> Spread:
    """Mean and spread of independent estimates (R,) by random effects."""
    weight = 1 / sigmas**2
    fixed = float(np.sum(weight * values) / np.sum(weight))
    q = float(np.sum(weight * (values - fixed) ** 2))
    r = values.size
    scale = float(np.sum(weight) - np.sum(weight**2) / np.sum(weight))
    between = max(0.0, (q - (r - 1)) / scale) if r > 1 and scale > 0 else 0.0
    weight = 1 / (sigmas**2 + between)
    return Spread(
        values,
        sigmas,
        float(np.sum(weight * values) / np.sum(weight)),
        float(1 / np.sqrt(np.sum(weight))),
        float(np.sqrt(between)),
        float(np.std(values, ddof=1)) if r > 1 else float("nan"),
        float(scipy.special.chdtrc(r - 1, q)) if r > 1 else float("nan"),
        unit,
    )


def fit_trials(
    recordings: Sequence[LinkAngles],
    model: Model,
    options: FitOptions | None = None,
    *,
    progress: Progress | None = None,
    alone: Callable[[int], object] | None = None,
) -> Trials:
    """Fits all recordings jointly (common damping and inertias) and each alone.

    ``alone`` is called with each recording's place, from 0, before it is fitted alone. Raises FitError for fewer than
    two recordings and as `fit_damping` does.
    """
    if len(recordings) < 2:
        raise FitError(fault("trials", "there is one recording", "Give at least two"))
    chosen = FitOptions() if options is None else options
    joint = fit_damping(recordings, model, options=chosen, progress=progress)
    each = []
    for k, recording in enumerate(recordings):
        if alone is not None:
            alone(k)
        each.append(fit_damping(recording, model, options=chosen.bare()))
    return summary(each, joint)


def summary(each: Sequence[DampingFit], joint: DampingFit) -> Trials:
    """Mean, spread and consistency of finished fits."""
    spreads = {}
    for group in ("coefficients", "ratios"):
        for name, estimate in getattr(joint, group).items():
            pairs = np.array([(getattr(f, group)[name].value, getattr(f, group)[name].sigma) for f in each])
            if (pairs[:, 1] > 0).all():
                spreads[name] = combine(pairs[:, 0], pairs[:, 1], estimate.unit)
    differing = [name for name, s in spreads.items() if s.p_value < 0.01]
    message = (
        f"the trials differ beyond their errors in {', '.join(differing)}: use the spread between trials"
        if differing
        else "the trials agree within their errors"
    )
    return Trials(tuple(each), joint, spreads, message)
