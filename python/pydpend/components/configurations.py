"""The two pendulums of the paper: configuration A (Section 4.1, Eqs. 20, 21) and B (Section 8.1)."""

from __future__ import annotations

from dataclasses import dataclass

from pydpend.components.parts import Balls, Cage, Part, Races, Rigid
from pydpend.components.quantity import Quantity
from pydpend.components.table8 import IDENTICAL, assumed_places, section_8_1, table_8
from pydpend.errors import ModelError, fault

# A: the inner races turn with the upper link. Upper bearings: outer race in the stand.
_A_UPPER = Races(inner=1, outer=0, at_elbow=False)
_A_LOWER = Races(inner=1, outer=2, at_elbow=True)
# B: the other way round.
_B_UPPER = Races(inner=0, outer=1, at_elbow=False)
_B_LOWER = Races(inner=2, outer=1, at_elbow=True)

_A = (
    Part("1", "encoder", None, "I_1", Rigid(1)),
    Part("2", "flexible coupling", "m_2", "I_2", Rigid(1)),
    Part("3a", "upper bearing inner race", "m_31", "I_31", Rigid(1), count=2),
    Part("3b", "upper bearing ball spacer", "m_32", "I_32", Cage(_A_UPPER), count=2),
    Part("3c", "upper bearing balls", "m_33", "I_33", Balls(_A_UPPER, 7), count=2),
    Part("4", "upper shaft", "m_4", "I_4", Rigid(1, "r_4"), carried=1),
    Part("5", "upper arm", "m_5", "I_5", Rigid(1, "r_5"), count=2, carried=1),
    Part("6", "lower shaft", "m_6", "I_6", Rigid(1, "l_u"), carried=1),
    Part("7", "dowel pin", "m_7", "I_7", Rigid(1, "l_u"), carried=1),
    Part("8a", "lower bearing inner race", "m_81", "I_81", Rigid(1, "l_u"), carried=1),
    Part("8b", "lower bearing ball spacer", "m_82", "I_82", Cage(_A_LOWER), carried=1),
    Part("8c", "lower bearing balls", "m_83", "I_83", Balls(_A_LOWER, 7), carried=1),
    Part("8d", "lower bearing outer race", "m_84", "I_84", Rigid(2), carried=2),
    Part("9", "lower arm", "m_9", "I_9", Rigid(2, "r_9"), carried=2),
)
_A_TRACKERS = (
    Part("10", "upper trackers", "m_10", "I_10", Rigid(1, "r_10"), count=3, carried=1),
    Part("11", "lower trackers", "m_11", "I_11", Rigid(2, "r_11", "r_11_rms"), count=6, carried=2),
    Part("12", "upper arm tape", "m_12", "I_12", Rigid(1, "r_12"), carried=1),
    Part("13", "lower arm tape", "m_13", "I_13", Rigid(2, "r_13"), carried=2),
)
_B = (
    Part("1", "upper arm", "m_1", "I_1", Rigid(1, "r_1"), carried=1),
    Part("2a", "upper bearing outer race", None, "I_21", Rigid(1), count=2),
    Part("2b", "upper bearing ball spacer", None, "I_22", Cage(_B_UPPER), count=2),
    Part("2c", "upper bearing balls", "m_23", "I_23", Balls(_B_UPPER, 9), count=2),
    Part("3", "lower screw", "m_3", "I_3", Rigid(2), carried=2),
    Part("4", "lower hex nut", "m_4", "I_4", Rigid(2), carried=2),
    Part("5", "lower small spacer", "m_5", "I_5", Rigid(2), count=2, carried=2),
    Part("6", "lower large spacer", "m_6", "I_6", Rigid(2), carried=2),
    Part("7a", "lower bearing inner race", "m_71", "I_71", Rigid(2), count=2, carried=2),
    Part("7b", "lower bearing ball spacer", "m_72", "I_72", Cage(_B_LOWER), count=2, carried=1),
    Part("7c", "lower bearing balls", "m_73", "I_73", Balls(_B_LOWER, 9), count=2, carried=1),
    Part("7d", "lower bearing outer race", "m_74", "I_74", Rigid(1, "l_u"), count=2, carried=1),
    Part("8", "lower arm", "m_8", "I_8", Rigid(2, "r_8"), carried=2),
)


@dataclass(frozen=True)
class Configuration:
    """A pendulum as a list of parts and the quantities that they name."""

    name: str
    parts: tuple[Part, ...]
    quantities: dict[str, Quantity]
    identical: tuple[tuple[str, ...], ...] = ()
    """Groups of symbols that are one part measured once: fully correlated."""
    length: str = "l_u"
    """The symbol of the distance from pivot to elbow."""
    lower_arm: tuple[str, str, str] | None = None
    """Symbols of the lower arm's mass, inertia and centre: the equal uniform bar gives the extent of its
    drag."""


def configuration(name: str, *, trackers: bool = False) -> Configuration:
    """Configuration "A" or "B". ``trackers`` adds A's trackers and tape (items 10 to 13) at assumed places."""
    if name == "A":
        quantities = table_8()
        if not trackers:
            return Configuration("A", _A, quantities, IDENTICAL, lower_arm=("m_9", "I_9", "r_9"))
        quantities |= assumed_places()
        return Configuration(
            "A with trackers and tape",
            _A + _A_TRACKERS,
            quantities,
            IDENTICAL,
            lower_arm=("m_9", "I_9", "r_9"),
        )
    if name == "B":
        return Configuration("B", _B, section_8_1(), lower_arm=("m_8", "I_8", "r_8"))
    raise ModelError(fault(f"configuration {name!r}", "not known", "The paper has 'A' and 'B'"))
