"""Several recordings of one pendulum: each fitted alone, all together, and whether they agree (Table 6, Fig. 20)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, ClassVar

import numpy as np
import scipy
from numpy.typing import NDArray

from pydpend.damping import DampingFit, fit_damping
from pydpend.damping.result_parts import Estimate
from pydpend.damping.shooting import Progress
from pydpend.documents import Table
from pydpend.errors import FIT, FitError, fault
from pydpend.fit_options import FitOptions
from pydpend.json_text import JsonResult, plain
from pydpend.kinematics import LinkAngles
from pydpend.model import Model
from pydpend.tabular import TableResult

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Spread:
    """One coefficient or ratio over R recordings.

    Attributes
    ----------
    values, sigmas : ndarray of float, shape (R,)
        Each recording's value and its own standard error, in `unit`.
    mean, sigma : float
        Mean, weighted with the spread between recordings (random effects, DerSimonian-Laird), and its standard error.
    spread : float
        Standard deviation between recordings beyond their own errors.
    deviation : float
        Plain standard deviation of the values, as in Table 6; NaN of a single one.
    p_value : float
        Probability of recordings this different if they had one common value; NaN of a single one.
    unit : str
        Unit; ``"1"`` for a ratio.
    """

    values: Floats
    sigmas: Floats
    mean: float
    sigma: float
    spread: float
    deviation: float
    p_value: float
    unit: str

    def to_dict(self) -> dict[str, Any]:
        """The spread as in ``trials.json``."""
        out: dict[str, Any] = plain(asdict(self))
        return out

    @classmethod
    def of_table(cls, table: Table) -> Spread:
        """The inverse of `to_dict`."""
        values, sigmas = table.array("values", -1), table.array("sigmas", -1)
        if values.shape != sigmas.shape:
            table.refuse("sigmas", f"{sigmas.size} uncertainties for {values.size} values")
        numbers = (table.number_or_nan("mean"), table.number_or_nan("sigma"), table.number_or_nan("spread"))
        chances = (table.number_or_nan("deviation"), table.number_or_nan("p_value"))
        return cls(values, sigmas, *numbers, *chances, table.text("unit"))


@dataclass(frozen=True, eq=False, repr=False)
class Trials(JsonResult, TableResult):
    """Fits of several recordings of one pendulum.

    Attributes
    ----------
    each : tuple of DampingFit
        The fit of each recording alone.
    joint : DampingFit
        The fit of all together.
    spreads : dict of str to Spread
        Each coefficient and ratio over the recordings.
    message : str
        Whether they agree, in words.
    """

    _error: ClassVar = FitError
    _source: ClassVar = "trials.json"
    _advice: ClassVar = "Give the trials.json that " + FIT + " wrote"

    each: tuple[DampingFit, ...]
    joint: DampingFit
    spreads: dict[str, Spread]
    message: str

    def __repr__(self) -> str:
        """A line for people."""
        return f"<Trials of {len(self.each)} recordings, {len(self.spreads)} quantities: {self.message}>"

    def to_dict(self) -> dict[str, Any]:
        """The trials as plain values: ``trials.json``.

        Returns
        -------
        dict
            ``message``, ``coefficients`` over the recordings, and the fits (``joint``, ``each``) as in ``fit.json``.
        """
        return {
            "message": self.message,
            "coefficients": {name: spread.to_dict() for name, spread in self.spreads.items()},
            "joint": self.joint.to_dict(),
            "each": [fit.to_dict() for fit in self.each],
        }

    @classmethod
    def of_table(cls, table: Table) -> Trials:
        """The trials from a ``trials.json`` that is read already. The fits have no energies and residuals.

        Parameters
        ----------
        table : pydpend.documents.Table
            What `to_json` gave.

        Returns
        -------
        Trials
            The trials.

        Raises
        ------
        FitError
            Naming the key that is missing or not what it must be.
        """
        given = table.table("coefficients")
        return cls(
            tuple(DampingFit.of_table(fit) for fit in table.tables("each")),
            DampingFit.of_table(table.table("joint")),
            {name: Spread.of_table(given.table(name)) for name in given},
            table.text("message"),
        )

    def to_columns(self) -> dict[str, NDArray[Any]]:
        """The coefficients over the recordings as columns of a table, a row each.

        Returns
        -------
        dict of str to ndarray
            ``name``, ``value1``, ``sigma1`` and so on of each recording, ``mean``, ``sigma``, ``spread``,
            ``deviation``, ``p_value`` and ``unit``.
        """
        found = list(self.spreads.values())
        out: dict[str, NDArray[Any]] = {"name": np.array(list(self.spreads), dtype=object)}
        for k in range(len(self.each)):
            out[f"value{k + 1}"] = np.array([s.values[k] for s in found])
            out[f"sigma{k + 1}"] = np.array([s.sigmas[k] for s in found])
        for name in ("mean", "sigma", "spread", "deviation", "p_value"):
            out[name] = np.array([getattr(s, name) for s in found])
        return out | {"unit": np.array([s.unit for s in found], dtype=object)}


def alone(fit: DampingFit) -> dict[str, Spread]:
    """The coefficients of a fit of one recording as trials have them; there is no mean."""
    return each_alone(fit.coefficients)


def each_alone(estimates: Mapping[str, Estimate]) -> dict[str, Spread]:
    """Estimates of one recording as trials have them; there is no mean."""
    none = float("nan")
    return {
        name: Spread(np.array([e.value]), np.array([e.sigma]), none, none, none, none, none, e.unit)
        for name, e in estimates.items()
    }


def combine(values: Floats, sigmas: Floats, unit: str, shared: Floats | None = None) -> Spread:
    """Mean and spread of estimates (R,) by random effects.

    ``shared`` (R,): what of each standard error is one error of all, which their mean keeps; else they are independent.
    """
    weight = 1 / sigmas**2
    fixed = float(np.sum(weight * values) / np.sum(weight))
    q = float(np.sum(weight * (values - fixed) ** 2))
    r = values.size
    scale = float(np.sum(weight) - np.sum(weight**2) / np.sum(weight))
    between = max(0.0, (q - (r - 1)) / scale) if r > 1 and scale > 0 else 0.0
    weight = 1 / (sigmas**2 + between)
    common = np.zeros(r) if shared is None else np.minimum(shared, sigmas)
    apart = np.sum(weight**2 * (sigmas**2 + between - common**2))
    return Spread(
        values,
        sigmas,
        float(np.sum(weight * values) / np.sum(weight)),
        float(np.hypot(np.sqrt(apart), np.sum(weight * common)) / np.sum(weight)),
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
    before_each: Callable[[int], object] | None = None,
) -> Trials:
    """Fits all recordings jointly (common damping and inertias) and each alone.

    ``before_each`` is called with each recording's place, from 0, before it is fitted alone. Raises FitError for fewer
    than two recordings and as `fit_damping` does.
    """
    if len(recordings) < 2:
        raise FitError(fault("trials", "there is one recording", "Give at least two"))
    chosen = FitOptions() if options is None else options
    joint = fit_damping(recordings, model, options=chosen, progress=progress)
    each = []
    for k, recording in enumerate(recordings):
        if before_each is not None:
            before_each(k)
        each.append(fit_damping(recording, model, options=chosen.bare()))
    return summary(each, joint)


def summary(each: Sequence[DampingFit], joint: DampingFit) -> Trials:
    """Mean, spread and consistency of finished fits."""
    spreads = {}
    # Fits that say nothing of their cameras' numbers may be of one camera.
    one_camera = len({given.camera_numbers for given in joint.inputs}) == 1
    for group in ("coefficients", "ratios"):
        for name, estimate in getattr(joint, group).items():
            pairs = np.array([(getattr(f, group)[name].value, getattr(f, group)[name].sigma) for f in each])
            if (pairs[:, 1] > 0).all():
                of_camera = np.array([f.camera_sigma.get(name, 0.0) if one_camera else 0.0 for f in each])
                of_parts = np.array(
                    [0.0 if f.consistency is None else f.consistency.sigma.get(name, 0.0) for f in each]
                )
                of_laws = np.array(
                    [0.0 if f.omitted is None else f.omitted.sigma.get(name, 0.0) for f in each]
                )
                shared = np.sqrt(of_camera**2 + of_parts**2 + of_laws**2) if group == "coefficients" else None
                spreads[name] = combine(pairs[:, 0], pairs[:, 1], estimate.unit, shared)
    differing = [name for name, s in spreads.items() if s.p_value < 0.01]
    message = (
        f"the trials differ beyond their errors in {', '.join(differing)}: use the spread between trials"
        if differing
        else "the trials agree within their errors"
    )
    return Trials(tuple(each), joint, spreads, message)
