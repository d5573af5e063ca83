"""Free decays of which something is wrong: the model, the clock, the laws or the angles, with the truth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from pydpend.damping import DampingFit
from pydpend.kinematics import LinkAngles
from pydpend.model import Damping, Model, derived

from tests.support.free_decays import TRUTH, measured, released, with_gaps, with_outliers

SECONDS, RATE_HZ, NOISE_DEG = 20.0, 500.0, 0.05

HEAVY = {"m_9": 1.1 * 116, "I_9": 1.1 * 245000}
"""Table 8's lower arm a tenth heavier."""

LONG = {"l_u": 1.01 * 171.9}
"""Table 8's upper arm a hundredth longer."""


@dataclass(frozen=True)
class Kind:
    """A kind of wrong input."""

    about: str
    true: Model
    given: Model
    truth: Damping
    spoil: Callable[[LinkAngles, int], LinkAngles]
    named: Callable[[DampingFit], bool]
    """Whether a fit names the cause."""

    def angles(self, seed: int) -> LinkAngles:
        """The angles of a seed."""
        motion = released(seed, SECONDS, RATE_HZ, self.truth, self.true)
        return self.spoil(measured(motion, seed, NOISE_DEG), seed)


def _as_it_is(angles: LinkAngles, _: int) -> LinkAngles:
    return angles


def _fast(angles: LinkAngles, _: int) -> LinkAngles:
    return replace(angles, t_s=1.001 * angles.t_s)


def _of_length(name: str, factor: float) -> Callable[[DampingFit], bool]:
    """Whether g, clock or l1 is named, with its factor to a tenth of what it is off."""

    def named(fit: DampingFit) -> bool:
        length = None if fit.consistency is None else fit.consistency.length
        if length is None or not length.off or name not in length.possible:
            return False
        return abs(length.measured[name] / length.given[name] - factor) < 0.1 * abs(factor - 1)

    return named


def _heavy(fit: DampingFit) -> bool:
    told = fit.consistency
    return told is not None and told.contradicts and any(e.name == "lower mass" for e in told.likely)


def _nothing_said(fit: DampingFit) -> bool:
    """Whether nothing is warned of: there is no cause."""
    return not any(note.startswith("warning: ") for note in fit.notes) and bool(fit.within_noise)


def _torque(fit: DampingFit) -> bool:
    return fit.omitted is not None and fit.omitted.explains and "tau_c1" in fit.omitted.found


def kinds() -> dict[str, Kind]:
    """The kinds by name."""
    right = derived("A")
    gravity = replace(right, g_m_s2=1.02 * 9.81, sigma_j=1.02 * right.sigma_j, kappa_j=1.02 * right.kappa_j)
    dry = replace(TRUTH, tau_c1=2e-3)
    return {
        "right": Kind("nothing wrong", right, right, TRUTH, _as_it_is, _nothing_said),
        "clock": Kind("clock 0.1 % fast", right, right, TRUTH, _fast, _of_length("clock", 1.001)),
        "gravity": Kind(
            "g given 2 % too large", right, gravity, TRUTH, _as_it_is, _of_length("g_m_s2", 1 / 1.02)
        ),
        "mass": Kind(
            "lower arm 10 % heavier than given", derived("A", given=HEAVY), right, TRUTH, _as_it_is, _heavy
        ),
        "length": Kind(
            "l1 1 % longer than given",
            derived("A", given=LONG),
            right,
            TRUTH,
            _as_it_is,
            _of_length("l1_m", 1.01),
        ),
        "law": Kind("tau_c1 of 2e-3 N m left out", right, right, dry, _as_it_is, _torque),
        "gaps": Kind(
            "20 % missing, gaps of 80 ms, some of 0.2-0.6 s", right, right, TRUTH, with_gaps, _nothing_said
        ),
        "outliers": Kind(
            "0.2 % of samples off by up to 30 deg",
            right,
            right,
            TRUTH,
            with_outliers,
            lambda fit: bool(fit.inputs[0].outliers),
        ),
    }
