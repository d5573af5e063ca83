"""Units of time, voltage and angle as tables write them: at the end of a column's name or in a row under the header.

Owns: which spellings are known and how many of a unit make a second, a volt or a radian.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

Quantity = Literal["time", "voltage", "angle"]


@dataclass(frozen=True)
class UnitOf:
    """A unit of a quantity. ``per_base``: how many make a second, a volt or a radian."""

    name: str
    quantity: Quantity
    per_base: float

    def to_base(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values of this unit in s, V or rad."""
        import numpy as np

        if self.name == "deg":
            return np.asarray(np.radians(values), dtype=np.float64)
        return values if self.per_base == 1.0 else values / self.per_base


_SPELLINGS: tuple[tuple[UnitOf, str], ...] = (
    (UnitOf("s", "time", 1.0), "s sec secs second seconds"),
    (UnitOf("ms", "time", 1e3), "ms msec millisecond milliseconds"),
    (UnitOf("us", "time", 1e6), "us usec µs microsecond microseconds"),
    (UnitOf("ns", "time", 1e9), "ns nsec nanosecond nanoseconds"),
    (UnitOf("min", "time", 1 / 60), "min mins minute minutes"),
    (UnitOf("h", "time", 1 / 3600), "h hr hrs hour hours"),
    (UnitOf("V", "voltage", 1.0), "v volt volts"),
    (UnitOf("mV", "voltage", 1e3), "mv millivolt millivolts"),
    (UnitOf("uV", "voltage", 1e6), "uv µv microvolt microvolts"),
    (UnitOf("kV", "voltage", 1e-3), "kv kilovolt kilovolts"),
    (UnitOf("rad", "angle", 1.0), "rad rads radian radians"),
    (UnitOf("mrad", "angle", 1e3), "mrad milliradian milliradians"),
    (UnitOf("deg", "angle", 180 / math.pi), "deg degs degree degrees °"),
    (UnitOf("turn", "angle", 1 / (2 * math.pi)), "turn turns rev revs revolution revolutions"),
)
_KNOWN = {spelling: unit for unit, spellings in _SPELLINGS for spelling in spellings.split()}

_BRACKETED = re.compile(r"[(\[<{]\s*([^()\[\]<>{}]*?)\s*[)\]>}]\s*$")
_ENDING = re.compile(r"(?:^|[_\s./,:-]|(?=°))([A-Za-zµ]+|°)$")
_CAMEL = re.compile(r"[a-z0-9](Ms|Us|Ns|Sec|Mv|MV|mV|Deg|Rad|Mrad|Degrees|Radians|Volts|Seconds)$")


def unit_called(text: str) -> UnitOf | None:
    """The unit of a spelling, brackets about it or not; ``None`` for one that is not known."""
    bare = text.strip().strip("()[]<>{}").strip().replace("\u03bc", "µ")
    # A megavolt is no millivolt.
    return None if bare == "MV" else _KNOWN.get(bare.lower())


def is_of_time(column: str, stated: str = "") -> bool:
    """Whether a column's name, or the unit ``stated`` for it, says in what unit of time it is."""
    unit = unit_called(stated) if stated else unit_at_end(column)[1]
    return unit is not None and unit.quantity == "time"


def unit_at_end(name: str) -> tuple[str, UnitOf | None]:
    """The spelling of the unit in a column's name, "" if it names none, and that unit, ``None`` if it is not known.

    A unit stands in brackets (``time (ms)``, ``U [mV]``) or behind a separator (``time_ms``, ``t/ms``), or is the whole
    name. What stands in brackets and begins with a letter is a unit, known or not.
    """
    name = name.strip().replace("\u03bc", "µ")
    bracketed = _BRACKETED.search(name)
    if bracketed is not None:
        spelled = bracketed[1]
        unit = unit_called(spelled)
        return (spelled, unit) if unit is not None or spelled[:1].isalpha() else ("", None)
    for pattern in (_ENDING, _CAMEL):
        found = pattern.search(name)
        spelled = "" if found is None else found[1]
        # Names are often all in capitals: TIME_MS, VOLTAGE_MV.
        unit = _KNOWN.get(spelled.lower())
        if unit is not None:
            return spelled, unit
    return "", None
