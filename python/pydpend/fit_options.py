"""The options of a damping fit, in one class that is checked before any fit begins.

`fit_damping`, ``pydpend fit``, ``pydpend analyse`` and the keys of a run's stages all have it from here.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields, replace
from difflib import get_close_matches
from typing import Any, Self, TypedDict

from pydpend.coefficients import FREE, FULL, JOINT_OF, PAPER, check_once, coefficients
from pydpend.errors import FitOptionError, Message, Setting, Text, fault, listed, one_of
from pydpend.option_fields import choices_of, method_of, option
from pydpend.typed import typed, typed_class

METHODS = ("trajectory", "energy")
"""The equations of motion fitted to the angles, or the paper's energy profile."""

RATIOS = ("free", "fixed")
"""Whether the inertial ratios are fitted too; in Python also True and False."""

INTERVALS = ("covariance", "profile")
"""How each coefficient's uncertainty is told."""

UPPER = tuple(name for name in FREE if JOINT_OF[name] != "lower")
"""Members of `FREE` that a single pendulum has."""

OLD_NAMES = {"predict": "prediction", "compare": "comparison"}
"""Names that options had."""

ASK_FOR_NOTHING: tuple[object, ...] = (None, False, "", "covariance", "fixed")
"""Values that ask for nothing beyond what every method does: the energy fit takes the ratios from the model."""


class FitKeywords(TypedDict, total=False):
    """The fields of `FitOptions` besides method and laws, as keywords."""

    ratios: str | bool | None
    free: str | Sequence[str]
    clock: bool
    angle_maps: bool
    pinned: bool
    ten_coefficients: bool
    intervals: str
    comparison: bool | None
    prediction: bool | None
    start_s: float | None
    stop_s: float | None


@typed_class()
@dataclass(frozen=True, kw_only=True)
class FitOptions:
    """The options of a damping fit.

    Every parameter is a flag of the same name in ``pydpend fit`` and ``pydpend analyse``, described by the same words.

    Parameters
    ----------
    method : str
        ``trajectory``: the equations of motion are fitted to the angles; ``energy``: the paper's energy
        profile.
    laws : str or sequence of str
        ``full``, ``paper`` or a list of coefficients with commas (``mu_v1,tau_c1``).
    ratios : str or bool, optional
        ``free``: the inertial ratios are fitted too (trajectory only, and its default); ``fixed``: the
        model's are believed.
    free : str or sequence of str
        Further parameters to fit, with commas: added_inertia, tilt, offset1, offset2 (trajectory only).
    clock : bool
        Fit the scale of the camera's clock too (trajectory only).
    angle_maps : bool
        Learn the repeatable angle-dependent bias of the tracking with the fit (trajectory only).
    pinned : bool
        The elbow is pinned: a single pendulum. A recording of one link needs a one-link model instead.
    ten_coefficients : bool
        Also the paper's ten (Table 6), with a warning; needs the energy method and the paper's laws.
    intervals : str
        ``covariance``: standard errors; ``profile``: 95 % intervals by profile likelihood too (takes much
        longer).
    comparison : bool, optional
        Leave each term out in turn, to say which the data ask for (trajectory only; the programs do it if not
        told).
    prediction : bool, optional
        Predict each recording from the others, or the last part of a single one from the rest (the latter
        trajectory only). The programs do it if not told, where it can be.
    start_s : float, optional
        Start of the free decay, s; found if not given.
    stop_s : float, optional
        End of the free decay, s; found if not given.

    Raises
    ------
    FitOptionError
        For a value that is not known, or an option of the other method.
    """

    method: str = option("trajectory", choices=METHODS)
    laws: str | Sequence[str] = option("full")
    ratios: str | bool | None = option(None, choices=RATIOS, of="trajectory")
    free: str | Sequence[str] = option("", of="trajectory")
    clock: bool = option(False, of="trajectory")
    angle_maps: bool = option(False, of="trajectory")
    pinned: bool = option(False)
    ten_coefficients: bool = option(False, of="energy")
    intervals: str = option("covariance", choices=INTERVALS, of="trajectory")
    comparison: bool | None = option(None, of="trajectory")
    prediction: bool | None = option(None)
    start_s: float | None = option(None)
    stop_s: float | None = option(None)

    def __post_init__(self) -> None:
        for name in ("laws", "free"):
            object.__setattr__(self, name, _with_commas(getattr(self, name)))
        if isinstance(self.ratios, bool):
            object.__setattr__(self, "ratios", RATIOS[0 if self.ratios else 1])
        for field in fields(FitOptions):
            value, known = getattr(self, field.name), choices_of(field)
            if known and value is not None and value not in known:
                raise FitOptionError(one_of(field.name, value, known))
        names = coefficients(self.laws)
        for name in self.freed:
            if name not in FREE:
                raise FitOptionError(one_of("free", name, FREE))
        check_once("free", self.freed)
        for field in fields(FitOptions):
            if method_of(field) and getattr(self, field.name) not in ASK_FOR_NOTHING:
                self._check_method(field.name, method_of(field))
        if self.ten_coefficients and names != PAPER:
            raise FitOptionError(
                fault(
                    Setting("ten_coefficients"),
                    "the paper's ten are of its six laws",
                    "Give " + Setting("laws", "paper"),
                )
            )
        self._check_span()
        if self.pinned:
            self.coefficients(single=True)

    @classmethod
    def of(cls, options: FitOptions | None, **keywords: Any) -> FitOptions:
        """Options with keywords in place of theirs.

        Parameters
        ----------
        options : FitOptions or None
            The options; the defaults if None.
        **keywords : optional
            Fields; those that are None change nothing.

        Returns
        -------
        FitOptions
            The options, without what a class that extends them has more.

        Raises
        ------
        FitOptionError
            For a keyword or a value that is not known, or an option of the other method.
        """
        for old, new in OLD_NAMES.items():
            if old in keywords:
                raise FitOptionError(fault(old, f"the option is called {new} now", "Rename it"))
        known = [field.name for field in fields(FitOptions)]
        for name in keywords:
            if name not in known:
                near = get_close_matches(name.lower(), known, 1, 0.6)
                advice = f"Did you mean {near[0]}?" if near else f"Known are {listed(known, 'and')}"
                raise FitOptionError(fault(name, "it is no option of a damping fit", advice))
        given = {name: value for name, value in keywords.items() if value is not None}
        return FitOptions(**given) if options is None else replace(options.fit, **given)

    @property
    def fit(self) -> FitOptions:
        """Options of a fit alone, of a class that has more."""
        return FitOptions(**{field.name: getattr(self, field.name) for field in fields(FitOptions)})

    @property
    def is_trajectory(self) -> bool:
        """Whether the equations of motion are fitted."""
        return self.method == METHODS[0]

    @property
    def frees_ratios(self) -> bool:
        """Whether the inertial ratios are fitted too."""
        return self.is_trajectory and self.ratios != RATIOS[1]

    @property
    def freed(self) -> tuple[str, ...]:
        """The further parameters to fit."""
        return tuple(name.strip() for name in _with_commas(self.free).split(",") if name.strip())

    @typed()
    def coefficients(self, *, single: bool) -> tuple[str, ...]:
        """The coefficients to fit.

        Parameters
        ----------
        single : bool
            Whether the recordings are of a single pendulum: those of the upper joint then.

        Returns
        -------
        tuple of str
            Names of coefficients of `Damping`.

        Raises
        ------
        FitOptionError
            For what was named and a single pendulum has not.
        """
        names = coefficients(self.laws)
        return self._of_one_link(names) if single else names

    def bare(self) -> Self:
        """The options without what is found beside the coefficients: intervals, comparison, prediction, the ten.

        Returns
        -------
        FitOptions
            The options.
        """
        return replace(
            self, intervals=INTERVALS[0], comparison=False, prediction=False, ten_coefficients=False
        )

    def as_programs_do(self) -> Self:
        """The options with the comparison and the prediction that nobody spoke of, where the method has them.

        Returns
        -------
        FitOptions
            The options.
        """
        return replace(
            self,
            comparison=self.is_trajectory if self.comparison is None else self.comparison,
            prediction=self.is_trajectory if self.prediction is None else self.prediction,
        )

    def key(self) -> dict[str, Any]:
        """The key of a fit: all that its result depends on besides its recordings and its model.

        Returns
        -------
        dict
            Each field's value by its name.
        """
        return asdict(self.fit)

    def check_own_prediction(self) -> None:
        """Checks that a part of the recordings that are fitted can be predicted from the rest, if that is asked for.

        Raises
        ------
        FitOptionError
            If the method leaves no part out.
        """
        if self.prediction:
            self._check_method("prediction", METHODS[0])

    def _check_method(self, name: str, owner: str) -> None:
        if owner == self.method:
            return
        method = Message.of(Setting("method", owner))
        needed = method + " and " + Setting("laws", "paper") if name == "ten_coefficients" else method
        problem = f"is an option of the {owner} fit, and the method is {self.method}"
        raise FitOptionError(fault(Setting(name), problem, "Leave it out, or give " + needed))

    def _check_span(self) -> None:
        for name in ("start_s", "stop_s"):
            value = getattr(self, name)
            if value is not None and not math.isfinite(value):
                raise FitOptionError(
                    fault(Setting(name), f"{value} is not a time", "Give a number of seconds")
                )
        if self.start_s is not None and self.stop_s is not None and not self.start_s < self.stop_s:
            problem: Text = f"{self.start_s:g} s is not before " + Setting("stop_s") + f", {self.stop_s:g} s"
            advice = "Give the start of the decay, then its end"
            raise FitOptionError(fault(Setting("start_s"), problem, advice))

    def _of_one_link(self, names: tuple[str, ...]) -> tuple[str, ...]:
        upper = tuple(name for name in names if JOINT_OF[name] == "upper")
        if self.laws not in ("full", "paper") and len(upper) < len(names):
            lower = next(name for name in names if name not in upper)
            known = ", ".join(name for name in FULL if JOINT_OF[name] == "upper")
            raise FitOptionError(
                fault(Setting("laws"), _not_of_one_link(lower), f"Give paper, full or some of {known}")
            )
        if self.angle_maps:
            problem = "maps are of two links, and this is a single pendulum"
            raise FitOptionError(fault(Setting("angle_maps"), problem, "Leave it out"))
        for name in self.freed:
            if name not in UPPER:
                advice = f"Give {listed(UPPER)}, or leave it out"
                raise FitOptionError(fault(Setting("free"), _not_of_one_link(name), advice))
        return upper


def _not_of_one_link(name: str) -> str:
    return f"{name} is of the elbow or the lower link, and a single pendulum has neither"


def _with_commas(names: str | Sequence[str]) -> str:
    return names if isinstance(names, str) else ",".join(names)
