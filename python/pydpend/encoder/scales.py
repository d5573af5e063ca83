"""An encoder's times in s and values in V or rad, whatever units its columns have."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pydpend.errors import EncoderError, Setting, fault
from pydpend.units import UnitOf, unit_at_end, unit_called

Floats = NDArray[np.float64]
Unit = Literal["v", "rad", "deg"]


def in_seconds(t: Floats, source: str, column: str, stated: str) -> Floats:
    """Times (T,) of a column in s. ``stated``: the unit that a row under the header gives, "" without one.

    Raises EncoderError for a unit that is not one of time.
    """
    spelled, unit = _spelled(source, column, stated)
    if not spelled:
        return t
    if unit is None or unit.quantity != "time":
        raise EncoderError(
            fault(
                source,
                f"{spelled!r} is no known unit of time",
                "Name the right column with "
                + Setting("time_column")
                + ", or write its unit as s, ms, us or ns",
                place=f"column {column}",
            )
        )
    return unit.to_base(t)


def in_base(
    value: Floats, source: str, column: str, stated: str, given: Unit | None
) -> tuple[Floats, Literal["v", "rad"]]:
    """Values (T,) of a column in V or rad, and which.

    ``stated`` as in :func:`in_seconds`; ``given``: the unit that the caller gives, which stands where the column's
    name ends in no unit of voltage or angle.

    Raises EncoderError for another unit, and where two contradict.
    """
    spelled, unit = _spelled(source, column, stated)
    place = f"column {column}"
    known = unit is not None and unit.quantity != "time"
    if given is not None:
        asked = unit_called(given)
        assert asked is not None
        if known and unit != asked:
            raise EncoderError(
                fault(
                    Setting("unit"),
                    f"the unit is to be {given}, the column's is {spelled!r}",
                    "Leave it out or name another column",
                    place=place,
                )
            )
        unit = asked
    elif spelled and not known:
        raise EncoderError(
            fault(
                source,
                f"{spelled!r} is no known unit of voltage or angle",
                "Give " + Setting("unit") + " if it is no unit, or write V, mV, rad, mrad or deg",
                place=place,
            )
        )
    if unit is None:
        return value, "v"
    return unit.to_base(value), "v" if unit.quantity == "voltage" else "rad"


def _spelled(source: str, column: str, stated: str) -> tuple[str, UnitOf | None]:
    """The spelling of a column's unit, and the unit. Refuses a stated unit that contradicts the column's name."""
    named, of_name = unit_at_end(column)
    if not stated:
        return named, of_name
    unit = unit_called(stated)
    if unit is not None and of_name is not None and unit != of_name:
        raise EncoderError(
            fault(
                source,
                f"the unit is {stated!r}, and the column's name says {named!r}",
                "Name the column or its unit rightly",
                place=f"column {column}",
            )
        )
    return stated, unit
