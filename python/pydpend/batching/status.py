"""How far a batch is, read from its folder by whoever sees it: another shell, another machine."""

from __future__ import annotations

import calendar
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from pydpend.batching.journal import LOCK, BatchError, is_done, read_journal, read_mark
from pydpend.batching.lock import is_silent, written_in
from pydpend.batching.recording import RUNNING
from pydpend.batching.row import State
from pydpend.batching.run import NAMES, in_words
from pydpend.documents import Table, read_json
from pydpend.json_text import JsonResult
from pydpend.output import AnyPath, path_of


@dataclass(frozen=True)
class Status(JsonResult):
    """How far a batch is."""

    _error: ClassVar = BatchError
    _source: ClassVar = "the status of a batch"

    message: str
    recordings: int
    counts: dict[str, int]
    """Recordings by state."""
    works: str
    """Host and process of the call that works at it; empty if none does."""
    running: dict[str, str]
    """Recordings under way, and who is at each since when."""
    failed: dict[str, str]
    """Why, of each recording that failed."""
    left_s: float | None
    """Time left, s, at the rate so far; None if it is not known."""

    def to_dict(self) -> dict[str, Any]:
        """The status as plain values."""
        return {
            "message": self.message,
            "recordings": self.recordings,
            "counts": self.counts,
            "works": self.works,
            "running": self.running,
            "failed": self.failed,
            "left_s": self.left_s,
        }

    @classmethod
    def of_table(cls, table: Table) -> Status:
        """The inverse of `to_dict`, of a document that is read already."""
        counts, running, failed = (table.table(key) for key in ("counts", "running", "failed"))
        return cls(
            table.text("message"),
            table.whole("recordings"),
            {str(state): counts.whole(state) for state in State},
            table.text("works"),
            {name: running.text(name) for name in running},
            {name: failed.text(name) for name in failed},
            table.number("left_s") if "left_s" in table else None,
        )


def status(results: AnyPath) -> Status:
    """How far the batch in a folder is. Raises BatchError if the folder is no batch's."""
    folder = path_of(results)
    mark = read_mark(folder)
    names = read_json(folder / NAMES, BatchError, "Call the batch again").texts("names")
    journal = read_journal(folder)
    ended = {name: journal[name] for name in names if name in journal}
    counts = {str(state): sum(e.row["state"] == state for e in ended.values()) for state in State}
    works = _who(folder / LOCK)
    running = {}
    for lock in sorted((folder / RUNNING).glob("*.json")) if works else ():
        if who := _who(lock):
            running[lock.stem] = who
    called = calendar.timegm(time.strptime(str(mark["called"]), "%Y-%m-%dT%H:%M:%SZ"))
    now_done = sum(str(e.row.get("began", "")) >= str(mark["called"]) for e in ended.values())
    missing = len(names) - len(ended)
    rate = now_done / max(time.time() - called, 1.0)
    said = in_words(counts, len(names))
    return Status(
        said if works or not missing else f"{said}; nobody works at it: give the same command again",
        len(names),
        counts,
        works,
        running,
        {name: str(e.row["reason"]) for name, e in ended.items() if not is_done(e)},
        round(missing / rate, 1) if works and rate > 0 else None,
    )


def _who(lock: Path) -> str:
    """Who holds a lock, in words; empty if nobody does."""
    about = written_in(lock)
    if not about or is_silent(lock):
        return ""
    return f"{about.get('host', '?')}, process {about.get('pid', '?')}, since {about.get('since', '?')}"
