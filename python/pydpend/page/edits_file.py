"""The file of decisions of one film, written line by line as a person decides (docs/reference/edits.md)."""

from __future__ import annotations

import getpass
import json
import os
import tempfile
import tomllib
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from pydpend.errors import ArgumentError, fault

ENTRY = "[[edit]]"
"""The line with which each decision begins."""

KEYS = ("what", "node", "with", "frame", "frames", "at_px", "sigma_px")
"""Keys of a decision in the order in which they are written, without who and when."""


class ChangedElsewhere(ArgumentError):
    """The file is not as this page left it: another page or a person with an editor has changed it."""


@dataclass
class EditsFile:
    """Decisions of people in their file, which is whole on the disk after each of them.

    Parameters
    ----------
    path : Path
        The file; made with the first decision.
    film : str
        The film's name without its folder.
    sha256 : str or None
        By which it is known.
    """

    path: Path
    film: str
    sha256: str | None

    def __post_init__(self) -> None:
        self.text = self._read()

    def _read(self) -> str:
        try:
            return self.path.read_text("utf-8")
        except FileNotFoundError:
            return ""
        except UnicodeDecodeError as problem:
            raise ArgumentError(fault(str(self.path), "it is no text in UTF-8", "Move it away")) from problem

    def entries(self) -> list[dict[str, Any]]:
        """The decisions, each as its keys and values. Raises ArgumentError where the file is no TOML."""
        try:
            found = tomllib.loads(self.text).get("edit", [])
        except tomllib.TOMLDecodeError as problem:
            said = fault(str(self.path), f"it is no TOML ({problem})", "Correct it, or move it away")
            raise ArgumentError(said) from problem
        return [dict(entry) for entry in found]

    def head(self) -> str:
        """The beginning of the file, which says what film it is about."""
        known = "" if self.sha256 is None else f"sha256 = {_quoted(self.sha256)}\n"
        return (
            f"# Decisions of people about {self.film.encode('unicode_escape').decode()}, one entry each.\n"
            "# Tracking makes them again when it is given this file; without it none is made.\n"
            f"schema = 1\n\n[film]\nname = {_quoted(self.film)}\n{known}"
        )

    def entry(self, decision: dict[str, Any]) -> str:
        """One decision as the file has it, by whoever is at work, now."""
        now = datetime.now(UTC).replace(microsecond=0)
        lines = [f"{key} = {_value(decision[key])}" for key in KEYS if decision.get(key) is not None]
        lines += [f"by = {_quoted(_who())}", f"when = {now.isoformat().replace('+00:00', 'Z')}"]
        return "\n".join((ENTRY, *lines, ""))

    def append(self, decision: dict[str, Any]) -> None:
        """Adds a decision; on the disk when this returns. Raises ChangedElsewhere, and OSError for a full disk."""
        before = self.text or self.head()
        self._write(before + ("" if before.endswith("\n") else "\n") + "\n" + self.entry(decision))

    def undo(self) -> bool:
        """Takes the last decision out; whether there was one."""
        lines = self.text.splitlines(keepends=True)
        starts = [i for i, line in enumerate(lines) if line.strip() == ENTRY]
        if not starts:
            return False
        self._write("".join(lines[: starts[-1]]).rstrip("\n") + "\n")
        return True

    def _write(self, text: str) -> None:
        if self._read() != self.text:
            self.text = self._read()
            problem = "another page or program has changed it since"
            raise ChangedElsewhere(
                fault(str(self.path), problem, "Look at what is there now and decide again")
            )
        # A new file takes the name when it is whole and on the disk, so that a kill leaves the old one or the new one.
        handle, name = tempfile.mkstemp(prefix=".edits-", dir=self.path.parent)
        try:
            with os.fdopen(handle, "w", encoding="utf-8") as file:
                file.write(text)
                file.flush()
                os.fsync(file.fileno())
            os.chmod(name, 0o644)
            os.replace(name, self.path)
        except BaseException:
            Path(name).unlink(missing_ok=True)
            raise
        folder = os.open(self.path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)
        self.text = text


def _who() -> str:
    try:
        return getpass.getuser()
    except (OSError, KeyError, ImportError):
        return "unknown"


def _quoted(text: str) -> str:
    """A TOML basic string: JSON's escapes are TOML's, and what UTF-8 cannot hold is written out."""
    return json.dumps(text.encode("utf-8", "replace").decode(), ensure_ascii=False).replace("\x7f", "\\u007f")


def _value(value: Any) -> str:
    if isinstance(value, str):
        return _quoted(value)
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_value(v) for v in value) + "]"
    return repr(value)
