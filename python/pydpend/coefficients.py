"""Which damping laws a fit has: names, units, groups, and the model as the compiled part wants it."""

from __future__ import annotations

from collections.abc import Sequence

from pydpend.errors import FitOptionError, Setting, fault
from pydpend.model import UNITS, Model, constants

PAPER = ("mu_v1", "mu_v2", "mu_q1", "mu_q2", "rmu1", "rmu2")
"""The paper's laws (Table 5 corrected): viscous, quadratic and load-proportional dry friction at each
joint."""

FULL = (*PAPER, "tau_c1", "tau_c2", "strip_drag")
"""The paper's, a constant dry torque at each joint, and drag of the lower link in its true relative wind."""

RATIOS = ("lambda", "sigma", "kappa", "a3")
"""Constants whose ratio to psi free motion determines; psi itself is a common factor that it does not."""


def ratios_of(links: int) -> tuple[str, ...]:
    """The ratios that a pendulum of so many links has."""
    return RATIOS if links == 2 else ("sigma",)


RATIO_UNITS = {"lambda": "1", "sigma": "1/s2", "kappa": "1/s2", "a3": "1"}

LAW_OF = {
    "mu_v1": "viscous",
    "mu_v2": "viscous",
    "mu_q1": "drag",
    "mu_q2": "drag",
    "strip_drag": "drag",
    "rmu1": "dry",
    "rmu2": "dry",
    "tau_c1": "dry",
    "tau_c2": "dry",
}
"""Law in whose share each coefficient counts: the paper's viscous, quadratic (here: all drag), Coulomb (all
dry)."""

JOINT_OF = {name: "lower" if name.endswith("2") or name == "strip_drag" else "upper" for name in FULL}
"""Joint and link in whose share each coefficient counts."""


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


def unit(name: str) -> str:
    """Unit of a coefficient or ratio."""
    return UNITS.get(name) or RATIO_UNITS[name]


def parameters(model: Model) -> dict[str, float]:
    """The model's constants under the compiled part's names, SI."""
    # A link of no stated extent gets a millimetre, so that strip drag is that of its end alone.
    return constants(model) | {"lower_outer": max(model.lower_outer_m, model.lower_inner_m + 1e-3)}
