"""The result of a damping fit."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from pydpend import _native
from pydpend.coefficients import FULL, RATIOS, unit
from pydpend.damping.consistency import Consistency
from pydpend.damping.fitted_recording import AngleMaps, FittedRecording, Window
from pydpend.damping.omitted import Omitted
from pydpend.damping.result_parts import (
    SHORT_S,
    EnergyCurve,
    Estimate,
    Identifiability,
    Interval,
    Residuals,
    TenCoefficients,
    Term,
    estimates,
)
from pydpend.documents import Table
from pydpend.errors import FIT, FitError, fault
from pydpend.fit_options import METHODS
from pydpend.fit_status import FitStatus
from pydpend.json_text import JsonResult, plain
from pydpend.tabular import TableResult, html_table
from pydpend.typed import typed

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class DampingFit(JsonResult, TableResult):
    """Damping coefficients with everything needed to judge them (Section 7.1; docs/explanation/damping.md).

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
    inputs : tuple of pydpend.damping.FittedRecording
        Each recording: name, the span used, samples, noise, angle zeros.
    energy : tuple of pydpend.damping.EnergyCurve
        Energies of each recording; ``energy.csv`` in the fit's folder.
    residuals : tuple of pydpend.damping.Residuals
        Residuals of each recording; ``residuals.csv`` in the fit's folder.
    within_noise : bool or None
        Whether the model describes the angles to within their noise; where it does not, the standard errors carry its
        errors. None where the fit does not tell (energy).
    prediction : dict of str to pydpend.damping.Window
        By length of window in s: errors of the prediction of data the fit did not see.
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
    maps : pydpend.damping.AngleMaps or None
        Angle-bias maps, if asked for.
    ten : pydpend.damping.result.TenCoefficients or None
        The paper's ten coefficients, if asked for.
    scale_known : bool
        Whether the coefficients are in N m s and the like; else they are over psi, in 1/s, 1 and 1/s2 (`scaled`).
    camera_sigma : dict of str to float
        What of each coefficient's standard error is the cameras', SI: its square is a part of the whole's. Empty where
        no angles state the camera's part.
    consistency : pydpend.damping.Consistency or None
        The ratios against the model's parts: g, clock and length, contradictions and what explains them (trajectory fit
        of two links with free ratios).
    omitted : pydpend.damping.Omitted or None
        Laws that were left out and would explain a misfit beyond the noise (trajectory fit).
    freed : dict of str to pydpend.damping.Estimate
        Further parameters that were fitted too (``free``).
    notes : tuple of str
        What was left out or should be known.
    """

    _error: ClassVar = FitError
    _source: ClassVar = "fit.json"
    _advice: ClassVar = "Give the fit.json that " + FIT + " wrote"

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
    inputs: tuple[FittedRecording, ...]
    energy: tuple[EnergyCurve, ...] = field(default=(), repr=False)
    residuals: tuple[Residuals, ...] = field(default=(), repr=False)
    within_noise: bool | None = None
    prediction: dict[str, Window] = field(default_factory=dict)
    terms: tuple[Term, ...] = ()
    intervals: dict[str, Interval] = field(default_factory=dict)
    chi2_slack: float = math.nan
    slack: dict[str, float] = field(default_factory=dict)
    iterations: int = 0
    modes_hz: tuple[float, ...] = ()
    maps: AngleMaps | None = None
    ten: TenCoefficients | None = None
    scale_known: bool = True
    camera_sigma: dict[str, float] = field(default_factory=dict)
    consistency: Consistency | None = None
    omitted: Omitted | None = None
    freed: dict[str, Estimate] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        """A line for people."""
        chi2 = f", chi-square {self.chi2:.3f}" if math.isfinite(self.chi2) else ""
        return f"<DampingFit {self.method}: {self.status}, {len(self.coefficients)} coefficients{chi2}>"

    def _repr_html_(self) -> str:
        """The coefficients with their standard errors, for a notebook."""
        rows = ((n, f"{e.value:.4e}", f"{e.sigma:.1e}", e.unit) for n, e in self.coefficients.items())
        return html_table(repr(self)[1:-1], ("coefficient", "value", "standard error", "unit"), rows)

    @typed()
    def scaled(self, psi_kg_m2: float, sigma_kg_m2: float = 0.0) -> DampingFit:
        """The coefficients of a fit over psi in N m s, N m s2 and N m, now that psi is known.

        A mass and a length tell it: with a lower link of mass m whose centre is d from the elbow, psi is
        ``m g d / ratios["kappa"].value``.

        Parameters
        ----------
        psi_kg_m2 : float
            Half the moment of inertia of the upper link, with the lower one's mass at the elbow, kg m2.
        sigma_kg_m2 : float
            Its standard uncertainty, which goes into every coefficient's.

        Returns
        -------
        DampingFit
            The fit with its coefficients, their covariance and its parameters in SI. Shares, ratios, predictions and
            energies (`energy`, over psi) stay as they are.

        Raises
        ------
        FitError
            If the fit has a scale already, or psi is not positive.
        """
        if self.scale_known or not (math.isfinite(psi_kg_m2) and psi_kg_m2 > 0 and sigma_kg_m2 >= 0):
            problem = (
                "the fit is not over psi" if self.scale_known else f"psi is {psi_kg_m2} +- {sigma_kg_m2}"
            )
            raise FitError(fault("scaled", problem, "Give a positive psi to a fit without masses"))
        values = {n: psi_kg_m2 * e.value for n, e in self.coefficients.items()}
        factor = np.array([psi_kg_m2 if n in self.coefficients else 1.0 for n in self.names])
        common = np.array(
            [sigma_kg_m2 * self.coefficients[n].value if n in values else 0.0 for n in self.names]
        )
        covariance = self.covariance * np.outer(factor, factor) + np.outer(common, common)
        sigma = dict(zip(self.names, np.sqrt(np.diag(covariance)).tolist(), strict=True))
        scales = {"psi", "zeta", *RATIOS, *values}
        return replace(
            self,
            coefficients=estimates(values, values, sigma),
            covariance=covariance,
            parameters={n: v * psi_kg_m2 if n in scales else v for n, v in self.parameters.items()},
            intervals={},
            scale_known=True,
            notes=(*self.notes, f"psi of {psi_kg_m2:.4g} +- {sigma_kg_m2:.1g} kg m2 was given afterwards"),
        )

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
            "prediction": {window: errors.by_link() for window, errors in self.prediction.items()},
            "identifiability": {
                "condition": self.identifiability.condition,
                "correlations": self.identifiability.correlations,
                "duration_s": self.identifiability.duration_s,
                "too_short": self.identifiability.too_short,
                "sentences": list(self.identifiability.sentences),
            },
            "terms": {t.name: t.to_dict() for t in self.terms},
            "intervals": {name: i.to_dict() for name, i in self.intervals.items()},
            "inputs": [each.to_dict() for each in self.inputs],
            "version": _native.VERSION,
            "chi2_slack": self.chi2_slack,
            "slack": self.slack,
            "iterations": self.iterations,
            "modes_hz": list(self.modes_hz),
            "parameters": self.parameters,
            "covariance": {"names": list(self.names), "matrix": self.covariance.tolist()},
            "maps": None if self.maps is None else self.maps.to_dict(),
            "ten_coefficients": None if self.ten is None else self.ten.to_dict(),
            "scale_known": self.scale_known,
            "camera_sigmas": self.camera_sigma,
            "consistency": None if self.consistency is None else self.consistency.to_dict(),
            "omitted": None if self.omitted is None else self.omitted.to_dict(),
            "freed": {k: v.to_dict() for k, v in self.freed.items()},
            "notes": list(self.notes),
        }
        values: dict[str, Any] = plain(out)
        return values

    @classmethod
    def of_table(cls, table: Table) -> DampingFit:
        """The fit from a ``fit.json`` that is read already. Energies and residuals are empty.

        Parameters
        ----------
        table : pydpend.documents.Table
            What `to_json` gave.

        Returns
        -------
        DampingFit
            The fit.

        Raises
        ------
        FitError
            Naming the key that is missing or not what it must be.
        """
        status, method = table.text("status"), table.text("method")
        if status not in list(FitStatus):
            table.refuse("status", f"{status!r} is not known")
        if method not in METHODS:
            table.refuse("method", f"{method!r} is not known")
        coefficients, ratios = table.table("coefficients"), table.table("ratios")
        sigmas, shares, told = (
            table.table("ratio_sigmas"),
            table.table("shares"),
            table.table("identifiability"),
        )
        for name in (*coefficients, *ratios):
            if name not in (*FULL, *RATIOS):
                table.refuse("coefficients", f"{name} is no coefficient and no ratio")
        names = table.table("covariance").texts("names")
        terms, intervals, numbers = (table.table(key) for key in ("terms", "intervals", "slack"))
        correlations, parameters = told.table("correlations"), table.table("parameters")
        prediction = table.table("prediction")
        sentences = told.texts("sentences")
        short = told.number("duration_s") < SHORT_S
        return cls(
            method=method,
            status=FitStatus(status),
            message=table.text("message"),
            chi2=table.number_or_nan("chi2"),
            n=table.whole("n"),
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
            covariance=table.table("covariance").array("matrix", len(names), len(names)),
            inputs=tuple(FittedRecording.of_table(each) for each in table.tables("inputs")),
            within_noise=table.flag("within_noise") if "within_noise" in table else None,
            prediction={w: Window.of_links(prediction.table(w)) for w in prediction},
            terms=tuple(Term.of_table(n, terms.table(n)) for n in terms),
            intervals={n: Interval.of_table(intervals.table(n)) for n in intervals},
            chi2_slack=table.number_or_nan("chi2_slack"),
            slack={n: numbers.number_or_nan(n) for n in numbers},
            iterations=table.whole("iterations"),
            modes_hz=tuple(table.array("modes_hz", -1).tolist()),
            maps=AngleMaps.of_table(table.table("maps")) if "maps" in table else None,
            ten=TenCoefficients.of_table(table.table("ten_coefficients"))
            if "ten_coefficients" in table
            else None,
            scale_known=table.flag("scale_known") if "scale_known" in table else True,
            camera_sigma=_numbers_of(table, "camera_sigmas"),
            consistency=Consistency.of_table(table.table("consistency")) if "consistency" in table else None,
            omitted=Omitted.of_table(table.table("omitted")) if "omitted" in table else None,
            freed={n: Estimate.of_table(t) for n, t in _tables_of(table, "freed").items()},
            notes=table.texts("notes"),
        )


def _tables_of(table: Table, key: str) -> dict[str, Table]:
    """Tables by their names; empty in a file written before there were any."""
    if key not in table:
        return {}
    found = table.table(key)
    return {name: found.table(name) for name in found}


def _numbers_of(table: Table, key: str) -> dict[str, float]:
    """A table of numbers; empty in a file written before there was one."""
    if key not in table:
        return {}
    numbers = table.table(key)
    return {name: numbers.number(name) for name in numbers}


def _share_of(table: Table) -> Estimate:
    """A share of the energy; NaN where nothing was lost."""
    return Estimate(table.number_or_nan("value"), table.number_or_nan("sigma"), "1")
