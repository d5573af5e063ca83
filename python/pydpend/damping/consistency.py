"""Test of the given constants by a fit's ratios: g, clock and length, and the parts."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from pydpend.damping.result_parts import Estimate
from pydpend.documents import Table
from pydpend.errors import listed
from pydpend.json_text import plain

SMALLEST = 5e-4
"""Part of g below which a departure is no news: the air's buoyancy makes g look 0.04 % less to aluminium, 0.015 % to
steel."""

SIGMAS = 3.0
"""Standard errors beyond which g, clock or length are not what was given."""

UNLIKELY = 0.01
"""Probability below which the ratios contradict the parts."""

EARTH_M_S2 = (9.76, 9.84)
"""Gravity anywhere on the ground, m/s2: 9.764 on the highest mountain near the equator, 9.834 in the Arctic."""

NAMED = 0.05
"""Probability from which an explanation is named."""


@dataclass(frozen=True)
class LengthCheck:
    """The test that kappa l1 = a3 g, which any two rigid links pass (Eq. 4.3).

    Attributes
    ----------
    quotient : float
        kappa l1 / (a3 g) with the fitted kappa and a3 and the given l1 and g; 1 if all is as given.
    sigma : float
        Its standard error by the motion alone.
    stated : float
        What the stated uncertainty of l1 adds.
    given, measured : dict of str to float
        ``g_m_s2``, ``l1_m`` and ``clock`` (recorded time over true time): as given, and as the motion measures each if
        the other two are right.
    """

    quotient: float
    sigma: float
    stated: float
    given: dict[str, float]
    measured: dict[str, float]

    @property
    def off(self) -> bool:
        """Whether the motion says that one of the three is not what was given."""
        return abs(self.quotient - 1) > max(SIGMAS * self.sigma, SMALLEST)

    @property
    def contradicts(self) -> bool:
        """Whether the stated uncertainty of l1 does not explain it."""
        return self.off and abs(self.quotient - 1) > SIGMAS * (self.sigma**2 + self.stated**2) ** 0.5

    @property
    def possible(self) -> tuple[str, ...]:
        """Candidates among the three for what is wrong: gravity only within what there is of it on the ground."""
        low, high = EARTH_M_S2
        if low <= self.measured["g_m_s2"] <= high:
            return ("g_m_s2",) if not low <= self.given["g_m_s2"] <= high else ("g_m_s2", "clock", "l1_m")
        return ("clock", "l1_m")

    def words(self, name: str) -> str:
        """One of the three as the motion measures it."""
        given, found = self.given[name], self.measured[name]
        relative = (self.sigma**2 + (0.0 if name == "l1_m" else self.stated) ** 2) ** 0.5
        if name == "g_m_s2":
            by = f"(factor {found / given:.5f})"
            return f"g is {found:.5g} +- {found * relative:.1g} m/s2 in place of {given:.5g} {by}"
        if name == "l1_m":
            return (
                f"l1 is {1e3 * found:.5g} +- {1e3 * found * relative:.1g} mm in place of {1e3 * given:.5g} "
                f"(factor {found / given:.5f})"
            )
        way = "long" if found > 1 else "short"
        return (
            f"the recording's times are too {way} by the factor {found:.5f} +- {found * relative / 2:.1g} (the frame "
            "rate is that times the given one)"
        )

    @property
    def sentence(self) -> str:
        """The test in words."""
        if not self.off:
            low = self.words("g_m_s2").split(" in place of ")[0]
            return f"with the given l1 and clock {low} by the motion, as given ({self.given['g_m_s2']:.5g})"
        known = f"{self.quotient:.5f} +- {self.sigma:.1g}"
        head = f"kappa l1 / (a3 g) is {known} by the motion, and 1 for any rigid links: "
        which = [self.words(name) for name in self.possible]
        if not self.contradicts:
            apart = abs(self.quotient - 1) / max(self.stated, 1e-12)
            return (
                f"{head}{listed(which)}. The stated uncertainty of l1 may be all of it ({apart:.1f} of its standard "
                "deviations); the standard errors hold what each would change"
            )
        out = f"warning: {head}{listed(which)}"
        if "g_m_s2" not in self.possible:
            out += f". Gravity would be {self.measured['g_m_s2']:.4g} m/s2, which is nowhere on the ground"
        elif len(self.possible) == 1:
            out += f". The given {self.given['g_m_s2']:.4g} m/s2 is nowhere on the ground"
        return out

    def to_dict(self) -> dict[str, Any]:
        """The test as in ``fit.json``."""
        return {**asdict(self), "off": self.off, "contradicts": self.contradicts, "sentence": self.sentence}

    @classmethod
    def of_table(cls, table: Table) -> LengthCheck:
        """The inverse of `to_dict`."""
        given, measured = table.table("given"), table.table("measured")
        return cls(
            table.number("quotient"),
            table.number("sigma"),
            table.number("stated"),
            {name: given.number(name) for name in given},
            {name: measured.number(name) for name in measured},
        )


@dataclass(frozen=True)
class RatioCheck:
    """A fitted ratio beside that of the model's parts.

    Attributes
    ----------
    fitted, parts : Estimate
        The ratio over psi, with its standard errors.
    """

    fitted: Estimate
    parts: Estimate

    @property
    def sigmas(self) -> float:
        """How far they are apart, in standard deviations of both."""
        both = (self.fitted.sigma**2 + self.parts.sigma**2) ** 0.5
        return (self.fitted.value - self.parts.value) / both if both > 0 else 0.0

    def to_dict(self) -> dict[str, Any]:
        """The two as in ``fit.json``."""
        return {"fitted": self.fitted.to_dict(), "parts": self.parts.to_dict(), "sigmas": self.sigmas}

    @classmethod
    def of_table(cls, table: Table) -> RatioCheck:
        """The inverse of `to_dict`."""
        return cls(Estimate.of_table(table.table("fitted")), Estimate.of_table(table.table("parts")))


@dataclass(frozen=True)
class Explanation:
    """A single cause that would explain why ratios and parts contradict each other.

    Attributes
    ----------
    name : str
        Short name; ``parts`` is that all parts are as uncertain as stated, and nothing else is wrong.
    words : str
        The cause in words.
    factor : float
        By what the true quantity is larger than the given one; 1 for ``parts``.
    chi2 : float
        What is left of the contradiction, four ratios together.
    probability : float
        Its probability beside the others, all equally likely before.
    psi_kg_m2 : float
        The scale psi, if it is so.
    coefficients : dict of str to float
        The coefficients, if it is so; empty where nothing contradicts the parts.
    """

    name: str
    words: str
    factor: float
    chi2: float
    probability: float
    psi_kg_m2: float
    coefficients: dict[str, float]

    @property
    def sentence(self) -> str:
        """The explanation in words."""
        change = 100 * (self.factor - 1)
        much = f"{abs(change):.2f} %"
        if self.name == "parts":
            said = self.words
        elif self.name == "clock":
            said = f"{self.words} are {much} too {'long' if change > 0 else 'short'}"
        else:
            said = f"{self.words} is {much} {'more' if change > 0 else 'less'} than given"
        return f"{said} (probability {100 * self.probability:.0f} %; psi {self.psi_kg_m2:.4e} kg m2)"

    def to_dict(self) -> dict[str, Any]:
        """The explanation as in ``fit.json``."""
        out: dict[str, Any] = plain(asdict(self))
        return out

    @classmethod
    def of_table(cls, table: Table) -> Explanation:
        """The inverse of `to_dict`."""
        found = table.table("coefficients")
        return cls(
            table.text("name"),
            table.text("words"),
            table.number("factor"),
            table.number("chi2"),
            table.number("probability"),
            table.number("psi_kg_m2"),
            {name: found.number(name) for name in found},
        )


@dataclass(frozen=True)
class Consistency:
    """The fitted ratios against the model's parts.

    Attributes
    ----------
    length : LengthCheck or None
        The test of g, clock and l1; None for a single pendulum.
    ratios : dict of str to RatioCheck
        Each ratio over psi: fitted, and of the parts.
    chi2, probability : float
        Sum of squares of the contradiction of all ratios together, and the probability of one as large if the parts are
        as uncertain as stated.
    stated : bool
        Whether the model states uncertainties of its constants; where it does not, `parts.UNSTATED` is taken of each.
    constants : dict of str to tuple of Estimate
        psi, masses and l1: of the parts, and of parts and motion together.
    explanations : tuple of Explanation
        Single causes, the likeliest first.
    sigma : dict of str to float
        What the contradiction adds to each coefficient's standard error, SI (squares add up); empty where there is
        none.
    """

    length: LengthCheck | None
    ratios: dict[str, RatioCheck]
    chi2: float
    probability: float
    stated: bool
    constants: dict[str, tuple[Estimate, Estimate]]
    explanations: tuple[Explanation, ...]
    sigma: dict[str, float]

    @property
    def contradicts(self) -> bool:
        """Whether ratios and parts contradict each other beyond what is stated of both."""
        return self.probability < UNLIKELY

    @property
    def likely(self) -> tuple[Explanation, ...]:
        """The explanations that are named."""
        return tuple(e for e in self.explanations if e.probability >= NAMED)

    @property
    def sentences(self) -> tuple[str, ...]:
        """Everything in words; what begins with ``warning`` must be known before the numbers."""
        out = [] if self.length is None else [self.length.sentence]
        if not self.contradicts:
            return tuple(out)
        apart = ", ".join(
            f"{name}/psi {100 * (c.fitted.value / c.parts.value - 1):+.2f} % ({c.sigmas:+.1f} sigma)"
            for name, c in self.ratios.items()
        )
        of = "its stated uncertainties" if self.stated else "uncertainties of 1 %, since it states none"
        out.append(
            f"warning: the fitted ratios are not those of the model's parts with {of}: {apart}; together chi-square "
            f"{self.chi2:.1f} where {len(self.ratios)} would be usual"
        )
        if self.explanations:
            out.append("what would explain it: " + "; or ".join(e.sentence for e in self.likely))
            given, found = self.constants["psi"]
            out.append(
                f"psi is {found.value:.4e} +- {found.sigma:.1e} kg m2 by parts and motion together, in place of "
                f"{given.value:.4e} +- {given.sigma:.1e}. The coefficients are those of the given constants, and their "
                "standard errors hold what the explanations would change"
            )
        return tuple(out)

    def to_dict(self) -> dict[str, Any]:
        """The whole as in ``fit.json``."""
        return {
            "length": None if self.length is None else self.length.to_dict(),
            "ratios": {name: c.to_dict() for name, c in self.ratios.items()},
            "chi2": self.chi2,
            "probability": self.probability,
            "contradicts": self.contradicts,
            "stated": self.stated,
            "constants": {
                name: {"parts": a.to_dict(), "together": b.to_dict()}
                for name, (a, b) in self.constants.items()
            },
            "explanations": [e.to_dict() for e in self.explanations],
            "sigma": self.sigma,
            "sentences": list(self.sentences),
        }

    @classmethod
    def of_table(cls, table: Table) -> Consistency:
        """The inverse of `to_dict`."""
        ratios, constants, sigma = (table.table(key) for key in ("ratios", "constants", "sigma"))
        both = {name: constants.table(name) for name in constants}
        return cls(
            LengthCheck.of_table(table.table("length")) if "length" in table else None,
            {name: RatioCheck.of_table(ratios.table(name)) for name in ratios},
            table.number("chi2"),
            table.number("probability"),
            table.flag("stated"),
            {
                name: (Estimate.of_table(t.table("parts")), Estimate.of_table(t.table("together")))
                for name, t in both.items()
            },
            tuple(Explanation.of_table(t) for t in table.tables("explanations")),
            {name: sigma.number(name) for name in sigma},
        )
