"""Parts of a damping fit's result: estimates, energies, residuals, identifiability, terms and intervals."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pydpend.coefficients import unit
from pydpend.documents import Table
from pydpend.fit_status import Verdict
from pydpend.json_text import number
from pydpend.tabular import TableResult

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Estimate:
    """A number with its standard uncertainty and unit.

    Attributes
    ----------
    value, sigma : float
        The number and its standard uncertainty, in `unit`.
    unit : str
        Unit; ``"1"`` for a ratio or a share.
    """

    value: float
    sigma: float
    unit: str

    def to_dict(self) -> dict[str, Any]:
        """Value, sigma and unit; null where not finite."""
        return {"value": number(self.value), "sigma": number(self.sigma), "unit": self.unit}

    @classmethod
    def of_table(cls, table: Table) -> Estimate:
        """The inverse of `to_dict`."""
        return cls(table.number("value"), table.number_or_nan("sigma"), table.text("unit"))


def estimates(
    names: Iterable[str],
    values: Mapping[str, float],
    sigma: Mapping[str, float],
    *,
    scale_known: bool = True,
) -> dict[str, Estimate]:
    """Coefficients or ratios with their units; without a standard error in ``sigma`` one was held fixed: 0."""
    return {
        n: Estimate(float(values[n]), float(sigma.get(n, 0.0)), unit(n, scale_known=scale_known))
        for n in names
    }


@dataclass(frozen=True, eq=False)
class EnergyCurve(TableResult):
    """Energy of one recording's motion at T times and what the laws take out of it (Fig. 19).

    Attributes
    ----------
    t_s : ndarray of float, shape (T,)
        Time, s.
    energy_j : ndarray of float, shape (T,)
        Energy (Eq. 22), J.
    model_j : ndarray of float, shape (T,)
        Initial energy minus the works of all laws, J.
    works_j : ndarray of float, shape (T, C)
        Energy taken out by each coefficient since the start, J.
    names : tuple of str
        The C coefficients.
    measured_j : ndarray of float, shape (T,), optional
        Energy of the measured angles, smoothed without the equations of motion, J; NaN where a link was not seen.
    """

    t_s: Floats
    energy_j: Floats
    model_j: Floats
    works_j: Floats
    names: tuple[str, ...]
    measured_j: Floats | None = None

    def to_columns(self) -> dict[str, Floats]:
        """The curve as columns of a table: ``energy.csv`` in the fit's folder.

        Returns
        -------
        dict of str to ndarray, each of shape (T,)
            ``time_s``, ``energy_j``, ``model_j``, if known ``measured_j``, each coefficient's work (``mu_v1_j``, ...).
        """
        first = {"time_s": self.t_s, "energy_j": self.energy_j, "model_j": self.model_j}
        first |= {} if self.measured_j is None else {"measured_j": self.measured_j}
        return first | {f"{name}_j": self.works_j[:, k] for k, name in enumerate(self.names)}

    @classmethod
    def of_columns(cls, columns: Mapping[str, Floats]) -> EnergyCurve:
        """The inverse of `to_columns`."""
        first = ("time_s", "energy_j", "model_j", "measured_j")
        names = tuple(n.removesuffix("_j") for n in columns if n.endswith("_j") and n not in first)
        works = [columns[f"{name}_j"] for name in names]
        t = columns["time_s"]
        stacked = np.column_stack(works) if works else np.zeros((t.size, 0))
        return cls(t, columns["energy_j"], columns["model_j"], stacked, names, columns.get("measured_j"))


@dataclass(frozen=True, eq=False)
class Residuals(TableResult):
    """The rest of one recording's angles when the fitted motion, its zeros and angle maps are taken off.

    Attributes
    ----------
    t_s : ndarray of float, shape (T,)
        Time of the samples that were fitted, s.
    residual_rad : ndarray of float, shape (T, L)
        Measured minus fitted, rad; NaN where not seen.
    sigma_rad : ndarray of float, shape (T, L)
        Standard deviation that each was weighted by, rad.
    """

    t_s: Floats
    residual_rad: Floats
    sigma_rad: Floats

    def to_columns(self) -> dict[str, Floats]:
        """The residuals as columns of a table: ``residuals.csv`` in the fit's folder.

        Returns
        -------
        dict of str to ndarray, each of shape (T,)
            ``time_s``, and of each link ``phi1_residual_rad`` and ``phi1_sigma_rad``.
        """
        out = {"time_s": self.t_s}
        for j in range(self.residual_rad.shape[1]):
            out[f"phi{j + 1}_residual_rad"] = self.residual_rad[:, j]
            out[f"phi{j + 1}_sigma_rad"] = self.sigma_rad[:, j]
        return out

    @classmethod
    def of_columns(cls, columns: Mapping[str, Floats]) -> Residuals:
        """The inverse of `to_columns`."""
        links = [j for j in (1, 2) if {f"phi{j}_residual_rad", f"phi{j}_sigma_rad"} <= set(columns)]
        left, sigma = (
            np.column_stack([columns[f"phi{j}_{w}_rad"] for j in links]) for w in ("residual", "sigma")
        )
        return cls(columns["time_s"], left, sigma)


SHORT_S = 20.0
"""A motion shorter than this does not separate laws that differ by their dependence on speed or load, s."""


@dataclass(frozen=True)
class Identifiability:
    """The coefficients that the data determine, and those they do not.

    Attributes
    ----------
    condition : float
        Condition number of the correlation-scaled information matrix of coefficients and ratios.
    correlations : dict of str to float
        ``"a/b"``: correlation, for pairs beyond 0.9.
    duration_s : float
        Length of the motion that was fitted, s.
    remarks : tuple of str
        What the numbers say of single coefficients and of all, in words.
    """

    condition: float
    correlations: dict[str, float]
    duration_s: float
    remarks: tuple[str, ...]

    @property
    def too_short(self) -> bool:
        """Whether the motion lasts too short a time to tell laws of like shape apart."""
        return self.duration_s < SHORT_S

    @property
    def warning(self) -> str:
        """The meaning of a motion that is `too_short`, in words; empty for a longer one."""
        if not self.too_short:
            return ""
        return (
            f"The motion fitted lasts {self.duration_s:.1f} s: too short to separate laws that differ by their "
            "dependence on speed or load; trust the shares and the prediction, not single coefficients."
        )

    @property
    def sentences(self) -> tuple[str, ...]:
        """Everything in words."""
        return ((self.warning,) if self.too_short else ()) + self.remarks


@dataclass(frozen=True)
class Term:
    """The evidence of the data on one term.

    Attributes
    ----------
    name : str
        Its coefficient.
    gain : float
        Twice the gain in log-likelihood that it brings beside all others, over the residuals' chi-square.
    prediction : float
        How much worse the rest is predicted without it: change of the mean square, relative.
    prediction_z : float
        The same over its standard error, from the windows.
    partner : str
        The term it is most correlated with.
    correlation : float
        Their correlation.
    verdict : pydpend.fit_status.Verdict
        What follows from these numbers.
    """

    name: str
    gain: float
    prediction: float
    prediction_z: float
    partner: str
    correlation: float
    verdict: Verdict

    def to_dict(self) -> dict[str, Any]:
        """The term as in ``fit.json``."""
        return {**asdict(self), "verdict": str(self.verdict), "sentence": self.sentence}

    @classmethod
    def of_table(cls, name: str, table: Table) -> Term:
        """The inverse of `to_dict`."""
        verdict = table.text("verdict")
        if verdict not in list(Verdict):
            table.refuse("verdict", f"{verdict!r} is not known")
        return cls(
            name,
            table.number("gain"),
            table.number("prediction"),
            table.number("prediction_z"),
            table.text("partner"),
            table.number("correlation"),
            Verdict(verdict),
        )

    @property
    def sentence(self) -> str:
        """The verdict in words."""
        said = f"is {self.verdict.words}"
        if self.verdict is Verdict.INSEPARABLE:
            said = f"{self.verdict.words} from {self.partner} (correlation {self.correlation:+.2f})"
        return (
            f"{self.name} {said}: without it twice the log-likelihood falls by {self.gain:.1f} and the mean square "
            f"of the prediction of unused data changes by {100 * self.prediction:+.2f} % "
            f"({self.prediction_z:+.1f} standard errors)"
        )


@dataclass(frozen=True)
class Interval:
    """A coefficient's 95 % interval by profile likelihood (`damping.intervals`).

    Attributes
    ----------
    low, high : float
        Its ends, in `unit`: low is 0 where the data do not exclude that; NaN for an end that was not found.
    unit : str
        Unit of the coefficient.
    values : tuple of float
        Values at which everything else was fitted again, rising; the estimate is one.
    rises : tuple of float
        How much twice the negative log-likelihood is above the estimate's, in units in which a standard error is 1.
    note : str
        What should be known of an end; empty if nothing.
    """

    low: float
    high: float
    unit: str
    values: tuple[float, ...]
    rises: tuple[float, ...]
    note: str

    def to_dict(self) -> dict[str, Any]:
        """The interval as in ``fit.json``; null for an end that was not found."""
        return asdict(self)

    @classmethod
    def of_table(cls, table: Table) -> Interval:
        """The inverse of `to_dict`."""
        values, rises = (tuple(table.array(key, -1).tolist()) for key in ("values", "rises"))
        ends = (table.number_or_nan("low"), table.number_or_nan("high"))
        return cls(*ends, table.text("unit"), values, rises, table.text("note"))

    def sentence(self, name: str) -> str:
        """The interval in words."""
        ends = " to ".join(f"{v:.4e}" if math.isfinite(v) else "?" for v in (self.low, self.high))
        said = f"{name} is within {ends} {self.unit} (95 %, profile likelihood)"
        return f"{said}: {self.note}" if self.note else said


@dataclass(frozen=True)
class TenCoefficients:
    """The paper's ten (Table 6), and how little they mean.

    Attributes
    ----------
    values : dict of str to Estimate
        ``mu_v1`` ... ``mu_q2`` and ``mu_c1_1`` (first of joint 1) ... ``mu_c3_2``; the standard errors are those of ten
        free ones.
    rmu : dict of str to Estimate
        ``rmu1``, ``rmu2``, m: what the three of each joint dissipate together, as r mu.
    weights : dict of str to list of float
        With which the three mu_c of a joint add up to it.
    rank : int
        Of the ten, how many combinations the energies determine.
    condition : float
        Condition number of the ten works, scaled.
    chi2 : float
        Chi-square of the energies; beyond 1 it is in the standard errors. NaN where the energies' errors are not known.
    """

    values: dict[str, Estimate]
    rmu: dict[str, Estimate]
    weights: dict[str, list[float]]
    rank: int
    condition: float
    chi2: float = math.nan

    def to_dict(self) -> dict[str, Any]:
        """The ten as in ``fit.json``."""
        return {
            "values": {k: v.to_dict() for k, v in self.values.items()},
            "rmu": {k: v.to_dict() for k, v in self.rmu.items()},
            "weights": self.weights,
            "rank": self.rank,
            "condition": self.condition,
            "chi2": number(self.chi2),
            "warning": self.warning,
        }

    @classmethod
    def of_table(cls, table: Table) -> TenCoefficients:
        """The inverse of `to_dict`."""
        values, rmu, weights = (table.table(key) for key in ("values", "rmu", "weights"))
        return cls(
            {name: Estimate.of_table(values.table(name)) for name in values},
            {name: Estimate.of_table(rmu.table(name)) for name in rmu},
            {name: weights.array(name, 3).tolist() for name in weights},
            table.whole("rank"),
            table.number("condition"),
            table.number_or_nan("chi2"),
        )

    @property
    def _misfit(self) -> str:
        if not self.chi2 > 1.5:
            return ""
        return (
            f" Chi-square of the energies is {self.chi2:.3g}, where noise alone gives 1: the standard errors are "
            f"larger by {self.chi2**0.5:.3g} for that, and know nothing else of what is wrong with the model."
        )

    @property
    def warning(self) -> str:
        """The warning of numbers that may not be believed, in words."""
        sums = "; ".join(
            f"{name} = {' '.join(f'{w:+.3g} mu_c{i}_{name[-1]}' for i, w in enumerate(self.weights[name], 1))} "
            f"= {e.value:.3g} +- {e.sigma:.1g} m"
            for name, e in self.rmu.items()
        )
        return (
            f"of the ten coefficients these energies determine {self.rank} combinations (condition number "
            f"{self.condition:.2g}). The six mu_c are r mu of two joints times known masses and lengths, so only these "
            f"sums are physical: {sums}. The split of a joint's sum among its three is arbitrary: it may depart from "
            "the model's ratios by noise or where the model is wrong, and where the energies do not determine it, the "
            f"split nearest to these ratios is given. Do not compare single mu_c.{self._misfit}"
        )
