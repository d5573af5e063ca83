"""What a damping fit can be told: the words that an option may be, and the method that it is of.

`fit_damping`, ``pydpend fit`` and ``pydpend analyse`` all ask here, before any fit begins.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

from pydpend.coefficients import FULL, JOINT_OF, PAPER, check_once, coefficients
from pydpend.errors import FitOptionError, Message, Setting, Text, fault, listed, one_of

METHODS = ("trajectory", "energy")
"""The equations of motion fitted to the angles, or the paper's energy profile."""

RATIOS = ("free", "fixed")
"""Whether the inertial ratios are fitted too, as ``pydpend fit`` and ``pydpend analyse`` say it."""

INTERVALS = ("covariance", "profile")
"""How each coefficient's uncertainty is told."""

FREE = ("added_inertia", "tilt", "offset1", "offset2")
"""Parameters that may be fitted too: inertia of the air that moves along, the angle of the stand, a constant torque in
each joint."""

UPPER = ("tilt", "offset1")
"""Those of `FREE` that a single pendulum has."""

METHOD_OF: Mapping[str, str] = {
    "ratios": "trajectory",
    "free": "trajectory",
    "clock": "trajectory",
    "angle_maps": "trajectory",
    "intervals": "trajectory",
    "predict": "trajectory",
    "compare": "trajectory",
    "comparison": "trajectory",
    "ten_coefficients": "energy",
}
"""Options that only one method has. All others (laws, start_s, stop_s, pinned) are of both."""

NOTHING: tuple[object, ...] = (None, False, (), [], "", "covariance", "fixed")
"""Values that ask for nothing beyond what every method does: the energy fit takes the ratios from the model."""


def check_fit(
    method: str, laws: str | Sequence[str], options: Mapping[str, object], *, single: bool = False
) -> tuple[str, ...]:
    """The coefficients of ``laws``. Raises FitOptionError for an option that is wrong, or of the other method.

    ``options``: as the caller names them. ``single``: the recordings are of a single pendulum.
    """
    if method not in METHODS:
        raise FitOptionError(one_of("method", method, METHODS))
    names = coefficients(laws)
    intervals = options.get("intervals", INTERVALS[0])
    if intervals not in INTERVALS:
        raise FitOptionError(one_of("intervals", intervals, INTERVALS))
    free = free_names(options.get("free"))
    for name in free:
        if name not in FREE:
            raise FitOptionError(one_of("free", name, FREE))
    check_once("free", free)
    for option, value in options.items():
        owner = METHOD_OF.get(option, method)
        if owner != method and value not in NOTHING:
            raise FitOptionError(
                fault(
                    Setting(option),
                    f"is an option of the {owner} fit, and the method is {method}",
                    "Leave it out, or give " + _add(option, owner),
                )
            )
    if options.get("ten_coefficients") and names != PAPER:
        raise FitOptionError(
            fault(
                Setting("ten_coefficients"),
                "the paper's ten are of its six laws",
                "Give " + Setting("laws", "paper"),
            )
        )
    _check_span(options.get("start_s"), options.get("stop_s"))
    return _of_one_link(names, laws, options) if single else names


def _add(option: str, owner: str) -> Message:
    method = Message.of(Setting("method", owner))
    return method + " and " + Setting("laws", "paper") if option == "ten_coefficients" else method


def free_names(free: object) -> list[str]:
    """``free`` as names: a sequence, or words with commas."""
    if isinstance(free, str):
        return [name.strip() for name in free.split(",") if name.strip()]
    return list(free) if isinstance(free, Iterable) else []


def _check_span(start_s: object, stop_s: object) -> None:
    for name, value in (("start_s", start_s), ("stop_s", stop_s)):
        if isinstance(value, (int, float)) and not math.isfinite(value):
            raise FitOptionError(fault(Setting(name), f"{value} is not a time", "Give a number of seconds"))
    if isinstance(start_s, (int, float)) and isinstance(stop_s, (int, float)) and not start_s < stop_s:
        problem: Text = f"{start_s:g} s is not before " + Setting("stop_s") + f", {stop_s:g} s"
        raise FitOptionError(fault(Setting("start_s"), problem, "Give the start of the decay, then its end"))


def _of_one_link(
    names: tuple[str, ...], laws: str | Sequence[str], options: Mapping[str, object]
) -> tuple[str, ...]:
    """The coefficients that a single pendulum has. What was named and it has not is refused."""
    upper = tuple(name for name in names if JOINT_OF[name] == "upper")
    known = [name for name in FULL if JOINT_OF[name] == "upper"]
    if laws not in ("full", "paper") and len(upper) < len(names):
        lower = next(name for name in names if name not in upper)
        raise FitOptionError(
            fault(
                Setting("laws"),
                f"{lower} is of the elbow or the lower link, and a single pendulum has neither",
                f"Give paper, full or some of {', '.join(known)}",
            )
        )
    if options.get("angle_maps"):
        raise FitOptionError(
            fault(
                Setting("angle_maps"),
                "maps are of two links, and this is a single pendulum",
                "Leave it out",
            )
        )
    for name in free_names(options.get("free")):
        if name not in UPPER:
            raise FitOptionError(
                fault(
                    Setting("free"),
                    f"{name} is of the elbow or the lower link, and a single pendulum has neither",
                    f"Give {listed(UPPER)}, or leave it out",
                )
            )
    return upper
