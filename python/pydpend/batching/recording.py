"""One recording of a batch, analysed in the process that calls: its run folder, its row, and what went wrong.

Whatever happens to a recording is a value (`Ended`), because a failed one stops nobody.
"""

from __future__ import annotations

import errno
import importlib
import json
import os
import shutil
import socket
import time
from collections.abc import Mapping
from contextlib import nullcontext
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from pydpend.analyse import Options, analyse
from pydpend.analyse.folder import RunFolder, RunFolderError
from pydpend.analyse.stages import version
from pydpend.batching.jobs import Job, key_of
from pydpend.batching.lock import Taken, about_me, holding, now
from pydpend.batching.row import Light, State, relative_to_results, row_of_run
from pydpend.errors import PydpendError, RigError, speaking
from pydpend.json_text import write_json
from pydpend.worded import Words

ROW = "row.json"
"""A recording's row in its run folder, and the key of what it was made from."""

RUNNING = "running"
"""Folder of a lock for each recording under way."""

MARK = "batch.json"
"""File by which a worker sees that a folder is the batch's."""

FULL_BYTES = 16 << 20
"""Free space on the disk of the results, bytes, below which a failed write is the disk's fault and not the recording's:
what a small film's run folder takes, with its page."""

WAIT_S = 0.5
"""Seconds between two looks at a lock that another process holds."""


class Fault(Words):
    """The kinds of what can go wrong with a recording."""

    NONE = "", ""
    REFUSED = "refused", "refused"
    """pydpend's own error: the same again would come of it."""
    CRASHED = "crashed", "crashed"
    TOO_LONG = "too_long", "ended at the time limit"
    SYSTEM = "system", "the system did not give or take a file"
    LOST = "lost", "worker lost"
    UNSEEN = "unseen", "not seen by the worker"
    REPLACED = "replaced", "replaced meanwhile"
    DISK = "disk", "the disk is full"
    """Nobody's fault: the batch stops."""
    STOPPED = "stopped", "stopped"

    @property
    def may_pass(self) -> bool:
        """Whether trying again may help."""
        return self in (Fault.CRASHED, Fault.SYSTEM, Fault.LOST, Fault.UNSEEN, Fault.REPLACED)


@dataclass(frozen=True)
class Ended:
    """How a recording ended: its row, and what went wrong."""

    row: dict[str, Any]
    fault: Fault = Fault.NONE
    kept: bool = False
    """Whether an earlier call had done it already."""
    reason: str = field(default="")

    def to_dict(self) -> dict[str, Any]:
        """Plain values."""
        return asdict(self)

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> Ended:
        """The inverse of `to_dict`."""
        return cls(values["row"], Fault(values["fault"]), values["kept"], values["reason"])


def identity(job: Job) -> dict[str, Any]:
    """The columns of a row that are known before anything is done."""
    return {
        "name": job.name,
        "path": job.path,
        "command": job.command(),
        "options": json.dumps(job.options, sort_keys=True),
        "key": job.key,
        **{f"sheet_{name}": value for name, value in job.kept.items()},
    }


def failed(job: Job, kind: Fault, reason: str) -> Ended:
    """A recording without a result."""
    row = identity(job) | {"state": State.FAILED, "light": Light.RED, "reason": reason, "warnings": []}
    return Ended(row | {"version": job.version}, kind, reason=reason)


def analyse_job(job: Job, worker: str) -> Ended:
    """Analyses a recording in this process; ``worker`` names it in what is said."""
    try:
        unseen = _unseen(job, worker)
        if unseen is not None:
            return failed(job, Fault.UNSEEN, unseen)
        with speaking(_front_end(job)) if job.front_end else nullcontext(), _alone(job):
            return _kept(job) or _analysed(job, worker)
    except PydpendError as problem:
        return failed(job, _is_full(job, problem) or Fault.REFUSED, str(problem))
    except OSError as problem:
        named = "" if problem.filename is None else f"{os.fsdecode(problem.filename)}: "
        reason = f"{named}{problem.strerror or problem} (worker {worker})"
        return failed(job, _is_full(job, problem) or Fault.SYSTEM, reason)


def _front_end(job: Job) -> Any:
    module, _, name = job.front_end.partition(":")
    return getattr(importlib.import_module(module), name)()


def _unseen(job: Job, worker: str) -> str | None:
    """The sentence on what a worker lacks, with its name; None if it lacks nothing."""
    if version() != job.version:
        return f"worker {worker} has pydpend {version()}, and the batch {job.version}. Install the same"
    try:
        mark = json.loads((Path(job.results) / MARK).read_text("utf-8"))
    except (OSError, ValueError):
        mark = {}
    if mark.get("token") != job.token:
        return f"worker {worker} does not see the folder {job.results}. Give a folder that all machines see"
    if not Path(job.path).exists():
        return (
            f"worker {worker} does not see {job.path}. Check the name, and that its folder is mounted there"
        )
    return None


def lock_of(job: Job) -> Path:
    """The lock of a recording under way."""
    return Path(job.results) / RUNNING / f"{job.name}.json"


class _alone:
    """Only this process works at the recording meanwhile; another one is waited for."""

    def __init__(self, job: Job) -> None:
        self._path = lock_of(job)
        self._about = about_me(name=job.name, token=job.token)

    def __enter__(self) -> None:
        while True:
            held = holding(self._path, self._about)
            try:
                held.__enter__()
            except Taken:
                time.sleep(WAIT_S)
                continue
            self._held = held
            return

    def __exit__(self, *problem: Any) -> None:
        self._held.__exit__(*problem)


def _kept(job: Job) -> Ended | None:
    """The row of an earlier call, if it was made from the same and its folder is there."""
    row = stored_row(job)
    return None if row is None else Ended(row, kept=True)


def stored_row(job: Job) -> dict[str, Any] | None:
    """The row in a run folder, if it was made from what the job asks for."""
    try:
        row = json.loads((job.run / ROW).read_text("utf-8"))
    except (OSError, ValueError):
        return None
    if not isinstance(row, dict) or not job.key or row.get("key") != job.key:
        return None
    report = Path(job.results) / str(row.get("report"))
    return row | identity(job) if report.is_file() else None


def _analysed(job: Job, worker: str) -> Ended:
    begun, began = time.monotonic(), now()
    options = job.analyse_options()
    if key_of(Path(job.path), options, job.common_rig) != job.key:
        return failed(job, Fault.REPLACED, "the recording or a file of its options was replaced meanwhile")
    outcome, rig, warning = _with_rig(job, options)
    row = row_of_run(outcome)
    relative_to_results(row, job.run, Path(job.results))
    if warning:
        row["warnings"] = [warning, *row["warnings"]]
        if row["state"] == State.DONE:
            row |= {"light": Light.YELLOW, "reason": warning}
    row |= identity(job)
    row |= {
        "rig": rig,
        "rig_file": {"common": job.common_rig, "given": options.rig}.get(rig),
        "worker": worker,
        "began": began,
        "tries": 1,
    }
    row["seconds"] = round(time.monotonic() - begun, 3)
    if key_of(Path(job.path), options, job.common_rig) != job.key:
        return failed(job, Fault.REPLACED, "the recording was replaced while it was analysed")
    write_json(job.run / ROW, row)
    return Ended(row)


def _with_rig(job: Job, options: Options) -> tuple[Any, str, str]:
    """The outcome, where its rig is from, and a warning where the batch's rig does not fit."""
    _clear(job)
    if not job.common_rig:
        return analyse(options, job.run), "given" if options.rig else "found", ""
    try:
        return analyse(replace(options, rig=job.common_rig), job.run), "common", ""
    except RigError as problem:
        outcome = analyse(replace(options, rig=None), job.run)
        said = f"The batch's rig does not fit, so markers have names of their own here: {problem}"
        return outcome, "own", said


def _clear(job: Job) -> None:
    """Takes away a run folder that its process left before it was one."""
    try:
        RunFolder.open(job.run)
    except RunFolderError:
        if any(p.name != ROW and not p.name.startswith(".pydpend-") for p in job.run.iterdir()):
            raise
        shutil.rmtree(job.run)


def _is_full(job: Job, problem: Exception) -> Fault | None:
    """Whether a write failed because the disk of the results is full."""
    number = getattr(problem, "errno", None)
    said = str(problem)
    full = [os.strerror(code) for code in (errno.ENOSPC, errno.EDQUOT)]
    if number not in (errno.ENOSPC, errno.EDQUOT) and not any(words in said for words in full):
        return None
    if number == errno.EDQUOT or full[1] in said:
        return Fault.DISK
    return Fault.DISK if shutil.disk_usage(job.results).free < FULL_BYTES else None


def worker_name() -> str:
    """The name of this machine and process."""
    return f"{socket.gethostname()}:{os.getpid()}"
