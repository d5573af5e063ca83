"""The part of the page that holds the fitted ratios against the parts of the pendulum."""

from __future__ import annotations

from pydpend.coefficients import RATIO_UNITS
from pydpend.damping import DampingFit
from pydpend.report.page import Block, Heading, Listing, Table
from pydpend.report.words import quantity, sentence, signed, with_squares

WORDS = {
    "psi": "half the inertia about the upper joint",
    "m1": "mass on the upper joint without the lower link",
    "m2": "mass on the lower joint",
    "l1": "distance of the joints",
}
"""Words that people read for the constants of the parts."""


def ratio_unit(name: str) -> str:
    """Unit of a ratio over psi, as a page has it."""
    return "" if RATIO_UNITS[name] == "1" else with_squares(RATIO_UNITS[name])


def against_parts(fit: DampingFit) -> list[Block]:
    """Ratios and constants, of the motion and of the parts; nothing where the ratios were not held against any."""
    told = fit.consistency
    if told is None:
        return []
    ratios = tuple(
        (
            f"{name}/psi",
            quantity(c.fitted.value, c.fitted.sigma, ratio_unit(name)),
            quantity(c.parts.value, c.parts.sigma, ratio_unit(name)),
            signed(c.sigmas, 2),
        )
        for name, c in told.ratios.items()
    )
    constants = tuple(
        (
            WORDS[name],
            name,
            quantity(parts.value, parts.sigma, with_squares(parts.unit)),
            quantity(both.value, both.sigma, with_squares(both.unit)),
        )
        for name, (parts, both) in told.constants.items()
    )
    return [
        Heading("The motion against the parts"),
        Table(("ratio", "motion", "parts", "apart, in sigmas"), ratios, numbers=frozenset({1, 2, 3})),
        Table(("constant", "symbol", "parts", "parts and motion"), constants, numbers=frozenset({2, 3})),
        Listing(tuple(sentence(s.removeprefix("warning: ")) for s in told.sentences)),
    ]
