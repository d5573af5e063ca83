"""Locks in a folder that several machines may see: one batch at a time, one process at a recording.

The system's lock (``flock``) ends with the process that holds it. Where a file system has none, the file's time of
change, renewed every `BEAT_S`, tells that somebody is there.
"""

from __future__ import annotations

import errno
import fcntl
import json
import os
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

BEAT_S = 5.0
"""Seconds between two signs of life."""

SILENT_S = 60.0
"""A file without a sign of life for so long belongs to nobody: NFS may show times of change 60 s late (``acregmax``)
where the file's own machine does not look, and this is looked at only without ``flock``."""

_NO_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP, errno.EINVAL)


class Taken(Exception):
    """A lock that another process holds; ``who`` is what it wrote of itself."""

    def __init__(self, who: dict[str, Any]) -> None:
        super().__init__(str(who))
        self.who = who


def now() -> str:
    """The time in words, UTC: ``2026-03-01T12:00:00Z``."""
    return time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())


def about_me(**more: Any) -> dict[str, Any]:
    """Who holds a lock."""
    return {"host": socket.gethostname(), "pid": os.getpid(), "since": now(), **more}


def written_in(path: Path) -> dict[str, Any]:
    """The words in a lock; empty where there are none."""
    try:
        found = json.loads(path.read_text("utf-8"))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


@contextmanager
def holding(path: Path, about: dict[str, Any]) -> Iterator[None]:
    """Holds the lock ``path``, which is gone afterwards. Raises Taken, or OSError if it cannot be written."""
    handle = _taken(path)
    stop = threading.Event()
    try:
        os.ftruncate(handle, 0)
        os.pwrite(handle, json.dumps(about).encode(), 0)
        beats = threading.Thread(target=_beat, args=(handle, stop), daemon=True)
        beats.start()
        yield
        stop.set()
        beats.join()
    finally:
        stop.set()
        with suppress(OSError):
            path.unlink(missing_ok=True)
        os.close(handle)


def _beat(handle: int, stop: threading.Event) -> None:
    while not stop.wait(BEAT_S):
        with suppress(OSError):
            os.utime(handle)


def _taken(path: Path) -> int:
    """The open file, locked. Raises Taken."""
    while True:
        handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise Taken(written_in(path)) from None
            except OSError as problem:
                if problem.errno not in _NO_LOCKS:
                    raise
                if written_in(path) and not is_silent(path):
                    raise Taken(written_in(path)) from None
            # Whoever held it before may have removed the file between our opening and our locking it.
            with suppress(FileNotFoundError):
                if os.path.samestat(os.fstat(handle), path.stat()):
                    return handle
        except BaseException:
            os.close(handle)
            raise
        os.close(handle)


def is_silent(path: Path) -> bool:
    """Whether a lock shows no sign of life, by the clock of the file system that it lies on."""
    beside = path.with_name(f".{path.name}.{os.getpid()}.clock")
    try:
        changed = path.stat().st_mtime
        beside.touch()
        return beside.stat().st_mtime - changed > SILENT_S
    except OSError:
        return not path.exists() or time.time() - path.stat().st_mtime > SILENT_S
    finally:
        with suppress(OSError):
            beside.unlink(missing_ok=True)
