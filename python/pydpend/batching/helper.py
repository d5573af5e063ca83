"""The process that analyses recordings for another, each in a fork of its own: ``python -m pydpend.batching.helper``.

It loads once what every recording needs and computes nothing itself. A recording that crashes its process, or is ended
at its time limit, leaves the next one alone. One line of JSON in is a job, one line out is how it ended. When nobody is
left at the other end, the recording under way is ended too.
"""

from __future__ import annotations

import importlib
import json
import os
import select
import signal
import sys
import tempfile
import threading
import time
import warnings
from collections.abc import Mapping
from contextlib import suppress
from typing import IO, Any

LOADED = (
    *("pydpend.batching.recording", "pydpend.tracking", "pydpend.kinematics", "pydpend.damping"),
    *(
        "pydpend.encoder",
        "pydpend.plots.damping",
        "pydpend.plots.encoder",
        "pydpend.report",
        "pydpend.trials",
    ),
    *(
        "scipy.special",
        "scipy.optimize",
        "scipy.signal",
        "matplotlib.figure",
        "matplotlib.backends.backend_agg",
    ),
    *("matplotlib.backends.backend_svg", "pyarrow.parquet", "jinja2"),
)
"""Modules that most recordings need."""

LOADED_IF_THERE = ("pandas",)
"""Modules that pyarrow looks for at its first table."""

GRACE_S = 3.0
"""Seconds that a recording has to keep what it has when it is to stop."""

LAST_WORDS = 400
"""Characters of what a crashed process wrote that are told."""


def main() -> None:
    """Does jobs until there are no more."""
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    # What libraries print is no answer.
    os.dup2(2, 1)
    for name in LOADED:
        importlib.import_module(name)
    for name in LOADED_IF_THERE:
        with suppress(ImportError):
            importlib.import_module(name)
    for line in sys.stdin:
        asked = json.loads(line)
        answers.write(json.dumps(_in_a_fork(asked["job"], asked["limit_s"], asked["worker"])) + "\n")
        answers.flush()


def _in_a_fork(job: Mapping[str, Any], limit_s: float | None, worker: str) -> dict[str, Any]:
    """How a job ended in a process of its own."""
    from pydpend.batching.jobs import Job
    from pydpend.batching.recording import Fault, failed

    given = Job.of(job)
    with tempfile.TemporaryFile() as words:
        found, status, why = _forked(given, worker, limit_s, words)
        if found:
            answer: dict[str, Any] = json.loads(found)
            return answer
        if why == "time":
            reason = f"it took longer than the time limit, {limit_s:g} s"
            return failed(given, Fault.TOO_LONG, reason).to_dict()
        words.seek(0)
        said = words.read().decode("utf-8", "replace").strip()[-LAST_WORDS:]
    last = f"; it said last: {' '.join(said.split())}" if said else ""
    return failed(given, Fault.CRASHED, f"its process {_ending(status)}{last}").to_dict()


def _ending(status: int) -> str:
    if os.WIFSIGNALED(status):
        number = os.WTERMSIG(status)
        known = {signal.SIGKILL: ", as the system does where memory runs out"}.get(signal.Signals(number), "")
        return f"was ended by {signal.Signals(number).name}{known}"
    return f"ended with status {os.waitstatus_to_exitcode(status)}"


def _forked(given: Any, worker: str, limit_s: float | None, words: IO[bytes]) -> tuple[bytes, int, str]:
    """The answer of a fork that does the job, its exit status, and ``time`` if it was ended at the limit."""
    reads, writes = os.pipe()
    ours, lifeline = os.pipe()
    with warnings.catch_warnings():
        # This process has no threads but those that libraries start when they are loaded.
        warnings.simplefilter("ignore", DeprecationWarning)
        child = os.fork()
    if child == 0:
        os.close(reads)
        os.close(lifeline)
        for stream in (1, 2):
            os.dup2(words.fileno(), stream)
        _do(given, worker, writes, ours)
    os.close(writes)
    os.close(ours)
    try:
        found, why = _watched(child, reads, limit_s)
    finally:
        os.close(reads)
        os.close(lifeline)
    return found, os.waitpid(child, 0)[1], why


def _watched(child: int, reads: int, limit_s: float | None) -> tuple[bytes, str]:
    end = None if limit_s is None else time.monotonic() + limit_s
    found = b""
    while True:
        left = None if end is None else max(0.0, end - time.monotonic())
        ready = select.select([reads, sys.stdin], [], [], left)[0]
        if reads in ready:
            part = os.read(reads, 1 << 16)
            if not part:
                return found, ""
            found += part
        elif sys.stdin in ready:
            # No job comes before the answer to this one: the other end is gone.
            _stop(child, reads)
            os._exit(0)
        else:
            os.kill(child, signal.SIGKILL)
            return b"", "time"


def _stop(child: int, reads: int) -> None:
    """Ends a recording, with time to keep what it has."""
    os.kill(child, signal.SIGINT)
    select.select([reads], [], [], GRACE_S)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)


def _do(given: Any, worker: str, writes: int, ours: int) -> None:
    """The fork's part: does the job and ends the process."""
    status = 1
    try:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        threading.Thread(target=_end_with_parent, args=(ours,), daemon=True).start()
        from pydpend.batching.recording import analyse_job

        data = json.dumps(analyse_job(given, worker).to_dict()).encode()
        while data:
            data = data[os.write(writes, data) :]
        status = 0
    except KeyboardInterrupt:
        status = 130
    except BaseException:
        sys.excepthook(*sys.exc_info())
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)


def _end_with_parent(ours: int) -> None:
    """Ends this process when the one that forked it is gone."""
    os.read(ours, 1)
    os.kill(os.getpid(), signal.SIGKILL)


if __name__ == "__main__":
    main()
