"""The result of a damping fit."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pydpend import _tracker
from pydpend.coefficients import FULL, RATIOS, unit
from pydpend.documents import Table, parse_json
from pydpend.errors import FIT, FitError
from pydpend.fit_options import METHODS
from pydpend.fit_status import FitStatus, Verdict
from pydpend.json_text import JsonResult
from pydpend.tabular import TableResult, html_table

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
    names: Iterable[str], values: Mapping[str, float], sigma: Mapping[str, float]
) -> dict[str, Estimate]:
    """Coefficients or ratios with their units; without a standard error in ``sigma`` one was held fixed: 0."""
    return {n: Estimate(float(values[n]), float(sigma.get(n, 0.0)), unit(n)) for n in names}


@dataclass(frozen=True, eq=False)
class EnergyCurve:
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
        Energy taken out by each coefficient since the start, J, in the order of the fit's coefficients.
    """

    t_s: Floats
    energy_j: Floats
    model_j: Floats
    works_j: Floats


@dataclass(frozen=True, eq=False)
class Residuals:
    """What is left of one recording's angles when the fitted motion, its zeros and angle maps are taken off.

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


SHORT_S = 20.0
"""A motion shorter than this does not separate laws that differ by their dependence on speed or load, s."""


@dataclass(frozen=True)
class Identifiability:
    """What the data determine and what they do not.

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
        """What a motion that is `too_short` means, in words; empty for a longer one."""
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
    """What the data say of one term.

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
        """As in ``fit.json``."""
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
        """As in ``fit.json``; null for an end that was not found."""
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
    """

    values: dict[str, Estimate]
    rmu: dict[str, Estimate]
    weights: dict[str, list[float]]
    rank: int
    condition: float

    def to_dict(self) -> dict[str, Any]:
        """As in ``fit.json``."""
        return {
            "values": {k: v.to_dict() for k, v in self.values.items()},
            "rmu": {k: v.to_dict() for k, v in self.rmu.items()},
            "weights": self.weights,
            "rank": self.rank,
            "condition": self.condition,
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
        )

    @property
    def warning(self) -> str:
        """What may not be believed, in words."""
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
            "split nearest to these ratios is given. Do not compare single mu_c."
        )


@dataclass(frozen=True, eq=False, repr=False)
class DampingFit(JsonResult, TableResult):
    """Damping coefficients with everything needed to judge them (Section 7.1; docs/damping.md).

    Attributes
    ----------
    method : str
        ``trajectory`` or ``energy``.
    status : pydpend.fit_status.FitStatus
        How the fit ended.
    message : str
        How it ended and how well the model describes the angles, in words.
    chi2 : float
        Mean squared standardised residual with only the noise's own slack at the joints: 1 for a model that is right.
        NaN where it is not defined (energy fit).
    n : int
        Number of measured values used.
    coefficients : dict of str to pydpend.damping.Estimate
        Coefficients of `Damping` with standard uncertainties and units, SI.
    ratios : dict of str to pydpend.damping.Estimate
        lambda, sigma, kappa and a3 over psi.
    shares : dict of str to dict of str to pydpend.damping.Estimate
        ``law`` and ``joint``: fraction of the dissipated energy, each with its uncertainty.
    identifiability : pydpend.damping.Identifiability
        What the data determine.
    parameters : dict of str to float
        All parameters of the equations of motion at the solution, SI (psi as stated by the model).
    names : tuple of str
        Names of the P rows of `covariance`: coefficients and ratios.
    covariance : ndarray of float, shape (P, P)
        Their covariance, SI.
    inputs : tuple of dict
        Each recording: name, the span used, samples, noise, angle zeros.
    energy : tuple of pydpend.damping.EnergyCurve
        Energies of each recording; ``energy.csv`` in the fit's folder.
    residuals : tuple of pydpend.damping.Residuals
        Residuals of each recording; ``residuals.csv`` in the fit's folder.
    within_noise : bool or None
        Whether the model describes the angles to within their noise; where it does not, the standard errors carry its
        errors. None where the fit does not tell (energy).
    prediction : dict of str to dict
        Window in s: root mean square per link, deg, of data the fit did not see.
    terms : tuple of pydpend.damping.Term
        What the data say of each term, if the terms were compared.
    intervals : dict of str to pydpend.damping.Interval
        95 % intervals of the coefficients by profile likelihood, if asked for.
    chi2_slack : float
        The same mean square as `chi2` with the slack of `slack`.
    slack : dict of str to float
        Jump allowed at the joints per state component, and relative to what noise alone would need.
    iterations : int
        Number of steps.
    modes_hz : tuple of float
        Small oscillations of the fitted pendulum about hanging, Hz; those measured at the end of each recording are in
        `inputs`.
    maps : dict or None
        Angle-bias maps, if asked for.
    ten : pydpend.damping.result.TenCoefficients or None
        The paper's ten coefficients, if asked for.
    notes : tuple of str
        What was left out or should be known.
    """

    method: str
    status: FitStatus
    message: str
    chi2: float
    n: int
    coefficients: dict[str, Estimate]
    ratios: dict[str, Estimate]
    shares: dict[str, dict[str, Estimate]]
    identifiability: Identifiability
    parameters: dict[str, float]
    names: tuple[str, ...]
    covariance: Floats
    inputs: tuple[dict[str, Any], ...]
    energy: tuple[EnergyCurve, ...] = field(default=(), repr=False)
    residuals: tuple[Residuals, ...] = field(default=(), repr=False)
    within_noise: bool | None = None
    prediction: dict[str, dict[str, Any]] = field(default_factory=dict)
    terms: tuple[Term, ...] = ()
    intervals: dict[str, Interval] = field(default_factory=dict)
    chi2_slack: float = math.nan
    slack: dict[str, float] = field(default_factory=dict)
    iterations: int = 0
    modes_hz: tuple[float, ...] = ()
    maps: dict[str, Any] | None = None
    ten: TenCoefficients | None = None
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        """A line for people."""
        chi2 = f", chi-square {self.chi2:.3f}" if math.isfinite(self.chi2) else ""
        return f"<DampingFit {self.method}: {self.status}, {len(self.coefficients)} coefficients{chi2}>"

    def _repr_html_(self) -> str:
        """The coefficients with their standard errors, for a notebook."""
        rows = ((n, f"{e.value:.4e}", f"{e.sigma:.1e}", e.unit) for n, e in self.coefficients.items())
        return html_table(repr(self)[1:-1], ("coefficient", "value", "standard error", "unit"), rows)

    def to_columns(self) -> dict[str, NDArray[Any]]:
        """The coefficients, then the ratios over psi, as columns of a table.

        Returns
        -------
        dict of str to ndarray
            ``name``, ``value``, ``sigma`` and ``unit``, a row per coefficient or ratio.
        """
        found = [*self.coefficients.items(), *((f"{n}/psi", e) for n, e in self.ratios.items())]
        return {
            "name": np.array([name for name, _ in found], dtype=object),
            "value": np.array([e.value for _, e in found]),
            "sigma": np.array([e.sigma for _, e in found]),
            "unit": np.array([e.unit for _, e in found], dtype=object),
        }

    def to_dict(self) -> dict[str, Any]:
        """The fit as plain values: ``fit.json``.

        Returns
        -------
        dict
            Numbers, texts, lists and tables; None for what is not defined. Energies and residuals are not in it.
        """
        out = {
            "method": self.method,
            "status": str(self.status),
            "message": self.message,
            "within_noise": self.within_noise,
            "chi2": self.chi2,
            "n": self.n,
            "coefficients": {k: v.to_dict() for k, v in self.coefficients.items()},
            "ratios": {k: v.value for k, v in self.ratios.items()},
            "ratio_sigmas": {k: v.sigma for k, v in self.ratios.items()},
            "shares": {
                group: {k: {"value": v.value, "sigma": v.sigma} for k, v in shares.items()}
                for group, shares in self.shares.items()
            },
            "prediction": self.prediction,
            "identifiability": {
                "condition": self.identifiability.condition,
                "correlations": self.identifiability.correlations,
                "duration_s": self.identifiability.duration_s,
                "too_short": self.identifiability.too_short,
                "sentences": list(self.identifiability.sentences),
            },
            "terms": {t.name: t.to_dict() for t in self.terms},
            "intervals": {name: i.to_dict() for name, i in self.intervals.items()},
            "inputs": list(self.inputs),
            "version": _tracker.VERSION,
            "chi2_slack": self.chi2_slack,
            "slack": self.slack,
            "iterations": self.iterations,
            "modes_hz": list(self.modes_hz),
            "parameters": self.parameters,
            "covariance": {"names": list(self.names), "matrix": self.covariance.tolist()},
            "maps": self.maps,
            "ten_coefficients": None if self.ten is None else self.ten.to_dict(),
            "notes": list(self.notes),
        }
        cleaned: dict[str, Any] = clean(out)
        return cleaned

    @classmethod
    def from_json(cls, text: str, source: str = "fit.json") -> DampingFit:
        """A fit from the text of its ``fit.json``. Energies and residuals are in tables of their own, and empty here.

        Parameters
        ----------
        text : str
            What `to_json` gave.
        source : str
            Name of the text, for messages.

        Returns
        -------
        DampingFit
            The fit.

        Raises
        ------
        FitError
            Naming the key, for a text that is none.
        """
        return cls.of_table(parse_json(text, source, FitError, "Give the fit.json that " + FIT + " wrote"))

    @classmethod
    def of_table(cls, given: Table) -> DampingFit:
        """A fit from its document, as `from_json`.

        Parameters
        ----------
        given : pydpend.documents.Table
            What was read of a ``fit.json``.

        Returns
        -------
        DampingFit
            The fit.

        Raises
        ------
        FitError
            Naming the key, for a document that is none.
        """
        status, method = given.text("status"), given.text("method")
        if status not in list(FitStatus):
            given.refuse("status", f"{status!r} is not known")
        if method not in METHODS:
            given.refuse("method", f"{method!r} is not known")
        coefficients, ratios = given.table("coefficients"), given.table("ratios")
        sigmas, shares, told = (
            given.table("ratio_sigmas"),
            given.table("shares"),
            given.table("identifiability"),
        )
        for name in (*coefficients, *ratios):
            if name not in (*FULL, *RATIOS):
                given.refuse("coefficients", f"{name} is no coefficient and no ratio")
        names = given.table("covariance").texts("names")
        terms, intervals, numbers = (given.table(key) for key in ("terms", "intervals", "slack"))
        correlations, parameters = told.table("correlations"), given.table("parameters")
        prediction = given.table("prediction")
        sentences = told.texts("sentences")
        short = told.number("duration_s") < SHORT_S
        return cls(
            method=method,
            status=FitStatus(status),
            message=given.text("message"),
            chi2=given.number_or_nan("chi2"),
            n=given.whole("n"),
            coefficients={n: Estimate.of_table(coefficients.table(n)) for n in coefficients},
            ratios={n: Estimate(ratios.number(n), sigmas.number_or_nan(n), unit(n)) for n in ratios},
            shares={
                group: {n: _share_of(shares.table(group).table(n)) for n in shares.table(group)}
                for group in shares
            },
            identifiability=Identifiability(
                told.number_or_nan("condition"),
                {pair: correlations.number(pair) for pair in correlations},
                told.number("duration_s"),
                sentences[1:] if short else sentences,
            ),
            parameters={n: parameters.number(n) for n in parameters},
            names=names,
            covariance=given.table("covariance").array("matrix", len(names), len(names)),
            inputs=tuple(_input_of(table) for table in given.tables("inputs")),
            within_noise=given.flag("within_noise") if "within_noise" in given else None,
            prediction={w: _window_of(prediction.table(w)) for w in prediction},
            terms=tuple(Term.of_table(n, terms.table(n)) for n in terms),
            intervals={n: Interval.of_table(intervals.table(n)) for n in intervals},
            chi2_slack=given.number_or_nan("chi2_slack"),
            slack={n: numbers.number_or_nan(n) for n in numbers},
            iterations=given.whole("iterations"),
            modes_hz=tuple(given.array("modes_hz", -1).tolist()),
            maps=given.table("maps").values if "maps" in given else None,
            ten=TenCoefficients.of_table(given.table("ten_coefficients"))
            if "ten_coefficients" in given
            else None,
            notes=given.texts("notes"),
        )


def _input_of(table: Table) -> dict[str, Any]:
    """What a fit says of one recording, checked as far as it is used."""
    table.text("name")
    for key in ("start_s", "stop_s"):
        table.number(key)
    for key, kind in (("zeros_deg", float), ("zeros_sigma_deg", float), ("zeros_off", bool)):
        if key in table and not all(isinstance(v, kind) or v is None for v in table.items(key)):
            table.refuse(key, "a list of numbers or truth values is expected")
    return table.values


def _share_of(table: Table) -> Estimate:
    """A share of the energy; NaN where nothing was lost."""
    return Estimate(table.number_or_nan("value"), table.number_or_nan("sigma"), "1")


def _window_of(table: Table) -> dict[str, Any]:
    """The prediction's errors in windows of one length, checked."""
    return {key: table.whole(key) if key == "n" else table.number(key) for key in table}


def number(value: float) -> float | None:
    """The number, or None where it is not finite (JSON has no NaN)."""
    return float(value) if math.isfinite(value) else None


def clean(value: Any) -> Any:
    """Arrays as lists, numbers as Python's, not-finite ones as None, all the way down."""
    if isinstance(value, dict):
        return {str(k): clean(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [clean(v) for v in value]
    if isinstance(value, np.ndarray):
        return clean(value.tolist())
    if isinstance(value, bool | np.bool_):
        return bool(value)
    if isinstance(value, int | np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return number(float(value))
    return value
