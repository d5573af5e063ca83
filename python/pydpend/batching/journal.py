"""The journal of a batch: a line for each recording that ended, the last one for a name holds.

Lines are only added, so that whoever sees the folder can read it at any time, and a line that a killed process left
half is no line. Written by the one that holds the batch's lock.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import IO, Any

from pydpend.batching.lock import now
from pydpend.batching.recording import MARK, RUNNING, Ended, Fault
from pydpend.batching.row import State
from pydpend.documents import read_json
from pydpend.errors import PydpendError, fault
from pydpend.json_text import write_json
from pydpend.output import whole

JOURNAL = "journal.jsonl"
LOCK = "batch.lock"
FORM = 1
"""Form of the folder; one of a newer is refused."""


class BatchError(PydpendError):
    """A batch that cannot be done, or a folder that is none."""


def read_journal(results: Path) -> dict[str, Ended]:
    """How each recording ended last, by its name, in the order in which they ended."""
    out: dict[str, Ended] = {}
    try:
        with (results / JOURNAL).open("rb") as file:
            for line in file:
                try:
                    ended = Ended.of(json.loads(line))
                    name = str(ended.row["name"])
                except (ValueError, KeyError, TypeError):
                    continue  # a killed process left it half
                out.pop(name, None)
                out[name] = ended
    except FileNotFoundError:
        return {}
    return out


def write_mark(results: Path, about: Mapping[str, Any]) -> None:
    """Writes ``batch.json``, by which workers know the folder."""
    write_json(results / MARK, {"form": FORM, "called": now(), **about})


def read_mark(results: Path) -> dict[str, Any]:
    """``batch.json``. Raises BatchError if the folder is no batch's."""
    if not (results / MARK).is_file():
        problem = f"is no folder of a batch (it has no {MARK})"
        raise BatchError(fault(str(results), problem, "Name the folder that was given with -o"))
    found = read_json(results / MARK, BatchError, "Use a new folder")
    found.whole("form", 1, FORM)
    return found.values


def check_results(results: Path) -> None:
    """Raises BatchError for a folder that holds other things than a batch."""
    if (results / MARK).exists():
        read_mark(results)
    elif any(p.name not in (LOCK, RUNNING) for p in results.iterdir()):
        raise BatchError(fault(str(results), "is not empty and not of a batch", "Give a new folder with -o"))


class Journal:
    """The journal, open for adding lines."""

    def __init__(self, results: Path) -> None:
        self.ended = read_journal(results)
        self._path = results / JOURNAL
        # What earlier lines of the same recordings said is left out, and a half line at the end.
        with whole(self._path) as new:
            new.write_bytes(b"".join(_line(ended) for ended in self.ended.values()))
        self._file: IO[bytes] = self._path.open("ab", buffering=0)

    def add(self, ended: Ended) -> None:
        """Writes how a recording ended. Raises OSError."""
        name = ended.row["name"]
        former = self.ended.get(name)
        if former is not None and ended.row["state"] != State.FAILED and former.row == ended.row:
            return
        line = _line(ended)
        begun = self._file.tell()
        written = self._file.write(line)
        if written != len(line):
            self._file.truncate(begun)
            raise OSError(28, "No space left on device", str(self._path))
        self.ended.pop(name, None)
        self.ended[name] = ended

    def close(self) -> None:
        """Ends the writing."""
        self._file.close()


def _line(ended: Ended) -> bytes:
    return json.dumps(ended.to_dict()).encode() + b"\n"


def is_done(ended: Ended | None) -> bool:
    """Whether a recording has a result."""
    return ended is not None and ended.fault is Fault.NONE
