"""Laws that were left out of a fit and would explain what it leaves of the angles."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pydpend.coefficients import FREE, FULL, JOINT_OF, OF_LOAD, WORDS
from pydpend.damping.result_parts import Estimate
from pydpend.documents import Table
from pydpend.errors import Setting

Floats = NDArray[np.float64]

CERTAIN = 5.0
"""Standard errors from zero beyond which a law that was left out is named."""

EXPLAINED = 0.5
"""Part of chi-square's excess over 1 that a wider fit may leave of what it explains."""


BIAS = ("angle_maps",)
"""The wider fit with maps of the angles' bias in place of further laws."""


@dataclass(frozen=True)
class Omitted:
    """A wider fit beside one that does not describe the angles to within their noise.

    Attributes
    ----------
    tried : tuple of str
        Laws that were added, all at once; ``angle_maps`` for maps of the angles' bias.
    found : dict of str to Estimate
        Those of them that are beyond `CERTAIN` standard errors from zero.
    chi2, before : float
        Chi-square without slack, with them and without.
    within_noise : bool
        Whether the wider fit describes the angles to within their noise.
    coefficients : dict of str to Estimate
        The coefficients of the fit itself as the wider one has them.
    sigma : dict of str to float
        What that adds to each coefficient's standard error, SI (squares add up); empty where nothing is explained.
    """

    tried: tuple[str, ...]
    found: dict[str, Estimate]
    chi2: float
    before: float
    within_noise: bool
    coefficients: dict[str, Estimate]
    sigma: dict[str, float]

    @property
    def explains(self) -> bool:
        """Whether the laws that were found are most of what is wrong."""
        excess = max(self.before - 1, 0.0)
        named = bool(self.found) or self.tried == BIAS
        return named and (self.within_noise or self.chi2 - 1 < EXPLAINED * excess)

    @property
    def sentence(self) -> str:
        """The laws in words; a warning where they explain it."""
        if not self.explains:
            return (
                "no law that was left out and no bias of the angles explains what is beyond the noise "
                f"({', '.join(self.tried)} tried last: "
                f"chi-square {self.chi2:.3g} in place of {self.before:.3g}): it is in the angles, or of a law that is "
                "not known here, and the standard errors know of it only what differs between blocks of a second"
            )
        if self.tried == BIAS:
            return (
                "warning: what is beyond the noise is explained by a bias of the angles that repeats with them (of the "
                f"tracking, or of the camera): with maps of it chi-square is {self.chi2:.3g} in place of "
                f"{self.before:.3g}. The standard errors hold what it changes; "
                + str(Setting("angle_maps", True))
                + " learns it"
            )
        named = ", ".join(
            f"{n} {e.value:.3g} +- {e.sigma:.1g} {e.unit} ({WORDS.get(n, n)})" for n, e in self.found.items()
        )
        return (
            f"warning: what is beyond the noise is explained by a law that was left out: {named}; with it chi-square "
            f"is {self.chi2:.3g} in place of {self.before:.3g}. The standard errors hold what it changes; fit it too"
        )

    def to_dict(self) -> dict[str, Any]:
        """The wider fit as in ``fit.json``."""
        return {
            "tried": list(self.tried),
            "found": {n: e.to_dict() for n, e in self.found.items()},
            "chi2": self.chi2,
            "before": self.before,
            "within_noise": self.within_noise,
            "coefficients": {n: e.to_dict() for n, e in self.coefficients.items()},
            "sigma": self.sigma,
            "explains": self.explains,
            "sentence": self.sentence,
        }

    @classmethod
    def of_table(cls, table: Table) -> Omitted:
        """The inverse of `to_dict`."""
        found, coefficients, sigma = (table.table(key) for key in ("found", "coefficients", "sigma"))
        return cls(
            table.texts("tried"),
            {n: Estimate.of_table(found.table(n)) for n in found},
            table.number_or_nan("chi2"),
            table.number_or_nan("before"),
            table.flag("within_noise"),
            {n: Estimate.of_table(coefficients.table(n)) for n in coefficients},
            {n: sigma.number(n) for n in sigma},
        )


def left_out(
    names: Sequence[str], freed: Sequence[str], *, links: int, scale_known: bool, maps: bool = False
) -> list[tuple[str, ...]]:
    """Laws that a fit of ``names`` left out, in groups to add: those that only dissipate, then the others too.

    Maps of the angles' bias are the last, of two links and where there are none (``maps``).
    """
    able = [n for n in FULL if n not in names and (scale_known or n not in OF_LOAD)]
    # A tilt turns both angles alike, as their free zeros do.
    further = [n for n in FREE if n not in (*freed, "tilt")]
    if links == 1:
        able, further = ([n for n in some if JOINT_OF[n] == "upper"] for some in (able, further))
    groups = [tuple(some) for some in (able, [*able, *further]) if some]
    return groups if maps or links == 1 else [*groups, BIAS]


@dataclass(frozen=True)
class Wider:
    """A wider fit's numbers."""

    chi2: float
    within_noise: bool
    coefficients: dict[str, Estimate]
    freed: dict[str, Estimate]


def explained(
    names: Sequence[str],
    values: dict[str, Estimate],
    chi2: float,
    groups: Sequence[tuple[str, ...]],
    fit: Callable[[tuple[str, ...]], Wider | None],
) -> Omitted | None:
    """The first group of laws that explains a fit's misfit; the last where none does, None where there is none.

    ``fit``: the fit with a group added, None where it fails.
    """
    last = None
    for group in groups:
        wider = fit(group)
        if wider is None:
            continue
        every = wider.coefficients | wider.freed
        found = {n: every[n] for n in group if n in every and abs(every[n].value) > CERTAIN * every[n].sigma}
        last = Omitted(
            group,
            found,
            wider.chi2,
            chi2,
            wider.within_noise,
            {n: wider.coefficients[n] for n in names},
            {},
        )
        if last.explains:
            sigma = {
                n: float(np.hypot(last.coefficients[n].value - values[n].value, last.coefficients[n].sigma))
                for n in names
            }
            return replace(last, sigma=sigma)
    return last
