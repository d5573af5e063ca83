"""The markers that a user wants followed, as the compiled half takes them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias

from pydpend import _native
from pydpend.errors import ArgumentError, Setting, fault

Place: TypeAlias = tuple[float, float] | tuple[float, float, int] | str
"""Column and row in px, and the frame: ``(312, 201, 57)`` or ``"312,201@57"``."""
Places: TypeAlias = Place | Sequence[Place]
Pair: TypeAlias = tuple[str, str] | str
"""Two names of nodes: ``("n1", "n2")`` or ``"n1=n2"``."""
Pairs: TypeAlias = Pair | Sequence[Pair]
Numbers: TypeAlias = int | Sequence[int] | str


def _refused(name: str, value: object, advice: str) -> ArgumentError:
    return ArgumentError(fault(Setting(name, subject=True), f"{value!r} cannot be", advice))


def _places(given: Places | None) -> list[str]:
    if given is None:
        return []
    one = isinstance(given, str) or (len(given) > 0 and isinstance(given[0], (int, float)))
    return [_place(place) for place in ([given] if one else given)]


def _place(place: Any) -> str:
    if isinstance(place, str):
        return place
    try:
        x, y, *frame = place
        at = f"{float(x)!r},{float(y)!r}"
        return at if not frame else f"{at}@{int(*frame)}"
    except (TypeError, ValueError):
        raise _refused("marker", place, "Give (x, y) or (x, y, frame)") from None


def _numbers(given: Numbers) -> list[int]:
    try:
        values = given.split(",") if isinstance(given, str) else [given] if isinstance(given, int) else given
        numbers = [int(value) for value in values]
    except (TypeError, ValueError):
        raise _refused("also", given, "Give numbers of the picture, for example [2, 3]") from None
    if any(not 0 <= number < 1 << 31 for number in numbers):
        raise _refused("also", given, "Give numbers of the picture, for example [2, 3]")
    return numbers


def _pairs(given: Pairs) -> list[tuple[str, str]]:
    pair = isinstance(given, str) or (
        len(given) == 2 and all(isinstance(v, str) and "=" not in v for v in given)
    )
    out = []
    for one in [given] if pair else given:
        names = one.split("=") if isinstance(one, str) else tuple(one)
        if len(names) != 2 or not all(names):
            raise _refused("same", one, "Give two names of nodes, for example ('n1', 'n2')")
        out.append((str(names[0]), str(names[1])))
    return out


def wanted(
    marker: Places | None,
    markers: int | None,
    also: Numbers,
    same: Pairs,
) -> _native.Wanted:
    """The markers that are wanted, as the compiled half takes them, which knows what makes sense.

    Raises
    ------
    ArgumentError
        Naming the keyword that is no place, number or pair of names.
    """
    if markers is not None and not 0 <= markers < 1 << 31:
        raise _refused("markers", markers, "Give 1 or more")
    return _native.Wanted(marker=_places(marker), markers=markers, also=_numbers(also), same=_pairs(same))
