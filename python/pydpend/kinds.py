"""The kind of a file or folder by what is in it; `tracker::kind` of the compiled half decides, for both programs."""

from __future__ import annotations

import os
from typing import Literal, TypeAlias

from pydpend import _native
from pydpend.errors import Message, PydpendError, Setting

Kind: TypeAlias = Literal[
    "film",
    "pictures",
    "nodes",
    "truth",
    "angles",
    "encoder",
    "tables",
    "calibration",
    "rig",
    "scene",
    "model",
    "config",
    "run",
    "fit",
    "page",
    "spreadsheet",
    "npz",
    "compressed",
    "unknown",
]
"""Of each, `Kind` in ``crates/tracker/src/kind.rs`` says what it is."""


def kind_of(path: str | os.PathLike[str]) -> Kind:
    """The kind of a file or folder; ``unknown`` where nobody can tell, or there is none."""
    kind: Kind = _native.kind_of(os.fspath(path))
    return kind


def misplaced(path: str | os.PathLike[str], wanted: tuple[Kind, ...]) -> Message | None:
    """The kind of a file and the next step with it, if it is of a known kind and of none that is wanted.

    Where nothing is wanted, a command is.
    """
    said: Message | None = _native.misplaced(os.fspath(path), list(wanted))
    return said


def expect(
    path: str | os.PathLike[str],
    wanted: tuple[Kind, ...],
    error: type[PydpendError],
    setting: str | None = None,
) -> None:
    """Raises ``error`` for a file that is of a known kind and of none that is wanted, with what is done with it.

    ``setting``: the option that names the file.
    """
    said = misplaced(path, wanted)
    if said is not None:
        raise error(said if setting is None else Setting(setting, subject=True) + ": " + said)
