"""The kind of a file or folder by what is in it, for both programs.

`tracker::kind` of the compiled half decides; what that does not know may be another program's tracks (`track_forms`).
"""

from __future__ import annotations

import os
import re
import shlex
from dataclasses import replace
from pathlib import Path
from typing import Literal, TypeAlias

from pydpend import _native
from pydpend.errors import IMPORT, Message, PydpendError, Setting, Step, fault
from pydpend.terminal import is_plain, shell_word
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
    "edits",
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
        return _pastable(_native.misplaced(os.fspath(path), list(wanted)), os.fspath(path))
    if "tracks" in wanted:
        return None
    name = os.fspath(path)
    out = shell_word(str(Path(name).with_suffix(".parquet")))
    command = IMPORT.command.format(file=shell_word(name), out=out)
    call = IMPORT.call.format(name=repr(name))
    return fault(name, f"it is {NOUNS[form]}", "Next: " + replace(IMPORT, command=command, call=call))


def _pastable(said: Message | None, name: str) -> Message | None:
    """The message with the next step in a form that can be pasted, whatever the file is called."""
    if said is None or is_plain(name):
        return said
    return Message(tuple(_pasted(part, name) if isinstance(part, Step) else part for part in said.parts))


_SHELL_WORD = re.compile(r"'(?:[^']|'\\'')*'")
_PYTHON_TEXT = re.compile(r'"(?:[^"\\]|\\.)*"')


def _pasted(step: Step, name: str) -> Step:
    """The step with the name in forms that a shell and Python read, which its plain quotes are not."""
    stem = os.path.splitext(name)[0]
    # A name that is not UTF-8 comes back with its bytes lost.
    lossy = os.fsencode(stem).decode("utf-8", "replace")

    def word(match: re.Match[str]) -> str:
        (bare,) = shlex.split(match[0])
        return shell_word(stem + bare[len(lossy) :] if bare.startswith(lossy) else bare)

    call = _PYTHON_TEXT.sub(lambda _: repr(name), step.call)
    return replace(step, command=_SHELL_WORD.sub(word, step.command), call=call)


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
