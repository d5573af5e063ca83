"""The kind of a file or folder by what is in it, for both programs.

`tracker::kind` of the compiled half decides; what that does not know may be another program's tracks (`track_forms`).
"""

from __future__ import annotations

import os
import shlex
from dataclasses import replace
from pathlib import Path
from typing import Literal, TypeAlias

from pydpend import _native
from pydpend.errors import IMPORT, Message, PydpendError, Setting, fault
from pydpend.track_forms import NOUNS, Form, form_of

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
    "tracks",
]
"""Of each but ``tracks``, another program's, `Kind` in ``crates/tracker/src/kind`` says what it is."""


def kind_of(path: str | os.PathLike[str]) -> Kind:
    """The kind of a file or folder; ``unknown`` where nobody can tell, or there is none."""
    kind: Kind = _native.kind_of(os.fspath(path))
    return kind if tracks_form(path) is None else "tracks"


def tracks_form(path: str | os.PathLike[str]) -> Form | None:
    """The form of another program's tracks; None for what is none, and for node tables."""
    if _native.kind_of(os.fspath(path)) not in ("unknown", "spreadsheet"):
        return None
    return form_of(path)


def misplaced(path: str | os.PathLike[str], wanted: tuple[Kind, ...]) -> Message | None:
    """The kind of a file and the next step with it, if it is of a known kind and of none that is wanted.

    Where nothing is wanted, a command is.
    """
    form = tracks_form(path)
    if form is None:
        said: Message | None = _native.misplaced(os.fspath(path), list(wanted))
        return said
    if "tracks" in wanted:
        return None
    name = os.fspath(path)
    out = shlex.quote(str(Path(name).with_suffix(".parquet")))
    command = IMPORT.command.format(file=shlex.quote(name), out=out)
    call = IMPORT.call.format(name=repr(name))
    return fault(name, f"it is {NOUNS[form]}", "Next: " + replace(IMPORT, command=command, call=call))


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
