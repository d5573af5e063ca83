"""Whether a caller gave the object that a function takes, or a path or another object in its place."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import NamedTuple

from pydpend.errors import Message, Setting, WrongTypeError, fault, listed
from pydpend.kinds import Kind, misplaced


class _Source(NamedTuple):
    """Where an object comes from: the call that reads it from a path, and what the file is then."""

    call: str
    kinds: tuple[Kind, ...]


SOURCES: Mapping[str, _Source] = {
    "Calibration": _Source("dp.read_calibration({})", ("calibration",)),
    "EncoderSignal": _Source("dp.read_encoder({})", ("encoder",)),
    "Hold": _Source("dp.read_holds([{}])", ("encoder", "tables")),
    "LinkAngles": _Source("dp.read_angles({})", ("angles",)),
    "Model": _Source("dp.read_model({})", ("model",)),
    "Nodes": _Source("dp.read_nodes({})", ("nodes",)),
}
"""Objects that are read from files, by the name of their class."""


def of_type(name: str, value: object, *wanted: type, like: tuple[str, ...] = ()) -> None:
    """Raises WrongTypeError for an argument of none of the types that are wanted.

    ``like``: attributes that make an object of another type as good as one of them.
    """
    if isinstance(value, wanted) or (like and all(hasattr(value, attribute) for attribute in like)):
        return
    needed = listed(kind.__name__ for kind in wanted)
    source = next((SOURCES[kind.__name__] for kind in wanted if kind.__name__ in SOURCES), None)
    if source is not None and isinstance(value, (str, bytes, os.PathLike)):
        path = os.fsdecode(value)
        said = misplaced(path, source.kinds)
        if said is not None:
            raise WrongTypeError(Setting(name, subject=True) + ": " + said)
        raise WrongTypeError(
            fault(
                Setting(name),
                f"{path!r} is a path, and {needed} is needed",
                Message.of(f"Read it first, with {source.call.format(repr(path))}"),
            )
        )
    advice = "" if source is None else f"{source.call.format('path')} gives one"
    raise WrongTypeError(
        fault(Setting(name), f"{needed} is needed, and this is of type {type(value).__name__}", advice)
    )
