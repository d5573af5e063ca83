"""The damping laws of a fit: names, units, groups, and the model as the compiled part wants it."""

from __future__ import annotations

from collections.abc import Sequence

from pydpend import _native
from pydpend.errors import FitOptionError, Setting, fault
from pydpend.model import LAW_TABLE, UNITS, Model, constants

PAPER = tuple(name for name, law in LAW_TABLE.items() if law.is_of_the_paper)
"""The paper's laws (Table 5 corrected): viscous, quadratic and load-proportional dry friction at each
joint."""

FULL = tuple(name for name, law in LAW_TABLE.items() if law.share is not None)
"""All laws that only dissipate: the paper's, a constant dry torque at each joint, and drag of the lower link in its
true relative wind."""

FREE = tuple(name for name in LAW_TABLE if name not in FULL)
"""Parameters that a fit may free too: a constant torque in each joint, inertia of the air that moves along, the angle
of the stand."""

LAW_OF = {name: law.share for name, law in LAW_TABLE.items() if law.share is not None}
"""Share of the energy in which each of `FULL` counts: the paper's viscous, quadratic (here: all drag), Coulomb (all
dry)."""

JOINT_OF = {name: law.joint for name, law in LAW_TABLE.items()}
"""Joint and link in whose share each coefficient counts: ``upper``, ``lower`` or ``both``."""

TERMS = tuple(LAW_TABLE)
"""Columns of the compiled half's powers."""

_RATIOS = _native.ratios()

RATIOS = tuple(ratio.name for ratio in _RATIOS)
"""Constants whose ratio to psi free motion determines; psi itself is a common factor that it does not."""

RATIO_UNITS = {ratio.name: ratio.unit for ratio in _RATIOS}

WORDS = {law.name: law.words for law in LAW_TABLE.values()} | {ratio.name: ratio.words for ratio in _RATIOS}
"""Words that people read for each coefficient and ratio."""


def ratios_of(links: int) -> tuple[str, ...]:
    """The ratios that a pendulum of so many links has."""
    return tuple(ratio.name for ratio in _RATIOS if links == 2 or ratio.is_of_one_link)


def coefficients(laws: str | Sequence[str]) -> tuple[str, ...]:
    """The coefficients of ``laws``: ``"paper"``, ``"full"``, or names (a sequence or comma-separated).

    Raises FitOptionError for a name that is none.
    """
    if isinstance(laws, str):
        if laws in ("paper", "full"):
            return PAPER if laws == "paper" else FULL
        laws = [name.strip() for name in laws.split(",") if name.strip()]
    unknown = [name for name in laws if name not in FULL]
    if unknown or not laws:
        raise FitOptionError(
            fault(
                Setting("laws"),
                f"{unknown[0]!r} is not a coefficient" if unknown else "there are none",
                f"Use paper, full, or some of {', '.join(FULL)}",
            )
        )
    check_once("laws", laws)
    return tuple(name for name in FULL if name in laws)


def check_once(setting: str, names: Sequence[str]) -> None:
    """Raises FitOptionError if a name stands twice in a setting."""
    for i, name in enumerate(names):
        if name in names[:i]:
            raise FitOptionError(fault(Setting(setting), f"{name} is given twice", "Give each name once"))


OVER_PSI = {"N m s": "1/s", "N m s2": "1", "N m": "1/s2"}
"""Units of coefficients over psi."""

OF_LOAD = ("rmu1", "rmu2")
"""Coefficients of the laws in which the bearings' load is, and with it the masses."""


def unit(name: str, *, scale_known: bool = True) -> str:
    """Unit of a coefficient or ratio; of a coefficient over psi where the scale is not known."""
    if name in RATIOS:
        return RATIO_UNITS[name]
    return UNITS[name] if scale_known else OVER_PSI.get(UNITS[name], UNITS[name])


def parameters(model: Model) -> dict[str, float]:
    """The model's constants under the compiled part's names, SI."""
    # A link of no stated extent gets a millimetre, so that strip drag is that of its end alone.
    return constants(model) | {"lower_outer": max(model.lower_outer_m, model.lower_inner_m + 1e-3)}
