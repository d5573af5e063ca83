"""A batch from its recordings to its results: what is missing is done, what failed is tried again, all is told."""

from __future__ import annotations

import json
import secrets
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar, Protocol, TypeAlias, Unpack

from pydpend.analyse.options import Options
from pydpend.analyse.stages import version
from pydpend.batching.agreement import TRIALS, write_agreement
from pydpend.batching.jobs import Found, Job, find_recordings, key_of, named, told
from pydpend.batching.journal import LOCK, BatchError, Journal, check_results, is_done, write_mark
from pydpend.batching.local import Local, workers_of
from pydpend.batching.lock import Taken, about_me, holding
from pydpend.batching.options import BatchKeywords, BatchOptions
from pydpend.batching.page import INDEX, write_index
from pydpend.batching.recording import RUNNING, Ended, Fault, failed, lock_of, stored_row
from pydpend.batching.row import State
from pydpend.batching.table import TABLE, write_table
from pydpend.documents import Table
from pydpend.errors import Setting, Text, WrongTypeError, fault, front_end
from pydpend.json_text import JsonResult, write_json
from pydpend.output import AnyPath, keeping, results_folder
from pydpend.rig import Rig
from pydpend.typed import typed

RIG = "rig.toml"
"""The rig of all recordings, where one is used."""

NAMES = "recordings.json"
"""Names of the recordings of the last call, in their order."""

PAGE_S = 60.0
"""Seconds between two writings of table and page while the batch goes on."""

PAGE_SHARE = 0.05
"""Part of the time that writing them may take."""


@dataclass(frozen=True)
class Advance:
    """A recording that ended, and how far the batch is.

    Attributes
    ----------
    done, of : int
        Recordings that ended, and all.
    failed : int
        How many of them failed.
    ended : Ended
        The recording.
    again : bool
        Whether it is tried again; it does not count as ended then.
    """

    done: int
    of: int
    failed: int
    ended: Ended
    again: bool = False


Event: TypeAlias = Advance | str
"""Progress of a batch: a recording that ended, or a sentence to be known."""

Tell: TypeAlias = Callable[[Event], object]


class Engine(Protocol):
    """The machines that analyse recordings."""

    def results(self, take: Callable[[], Job | None]) -> Iterator[tuple[Job, Ended]]:
        """Each job with how it ended, as they end. ``take`` gives the next one, None where there is none now."""

    def close(self) -> None:
        """Stops what is under way."""


@dataclass(frozen=True)
class Batch(JsonResult):
    """The results of a batch.

    Attributes
    ----------
    folder : pathlib.Path
        The folder with ``batch.parquet``, ``index.html`` and the run folders.
    message : str
        How many recordings are done and how many are not, in words.
    counts : dict of str to int
        Recordings by state: ``done``, ``partly``, ``failed``.
    kept : int
        How many were done by earlier calls.
    reasons : dict of str to str
        Why, of each recording that failed, by its name.
    commands : dict of str to str
        The command that repeats each of these.
    trials : str
        Whether recordings of one rig agree, in words; empty where none share a rig.
    """

    _error: ClassVar = BatchError
    _source: ClassVar = "the outcome of a batch"

    folder: Path
    message: str
    counts: dict[str, int]
    kept: int
    reasons: dict[str, str] = field(default_factory=dict)
    commands: dict[str, str] = field(default_factory=dict)
    trials: str = ""

    @property
    def is_whole(self) -> bool:
        """Whether every stage of every recording is done."""
        return not (self.counts[State.FAILED] or self.counts[State.PARTLY])

    def to_dict(self) -> dict[str, Any]:
        """The results as plain values.

        Returns
        -------
        dict
            The attributes by their names, and ``table`` and ``page``, the files.
        """
        return {
            "folder": str(self.folder),
            "message": self.message,
            "counts": self.counts,
            "kept": self.kept,
            "reasons": self.reasons,
            "commands": self.commands,
            "trials": self.trials,
            "table": str(self.folder / TABLE),
            "page": str(self.folder / INDEX),
        }

    @classmethod
    def of_table(cls, table: Table) -> Batch:
        """The inverse of `to_dict`, of a document that is read already.

        Parameters
        ----------
        table : pydpend.documents.Table
            What `to_json` gave.

        Returns
        -------
        Batch
            The results.

        Raises
        ------
        BatchError
            Naming the key that is missing or not what it must be.
        """
        counts, why, how = (table.table(key) for key in ("counts", "reasons", "commands"))
        return cls(
            Path(table.text("folder")),
            table.text("message"),
            {str(state): counts.whole(state) for state in State},
            table.whole("kept"),
            {name: why.text(name) for name in why},
            {name: how.text(name) for name in how},
            table.text("trials"),
        )


@typed("progress")
def batch(
    recordings: AnyPath | Sequence[AnyPath],
    output: AnyPath,
    options: Options | None = None,
    *,
    progress: Tell | None = None,
    **how: Unpack[BatchKeywords],
) -> Batch:
    """Analyses many recordings, each into a run folder of its own; done ones are not done again.

    Call it again after anything that stopped it, and only what is missing is done.

    Parameters
    ----------
    recordings : path or sequence of path
        Films, node tables or angles tables, or patterns of their names (``"trials/*.mraw"``); may be empty with a
        ``sheet``.
    output : path
        Folder of the results, made or gone on with.
    options : pydpend.analyse.Options, optional
        How each recording is analysed, without ``inputs``; the defaults if not given.
    progress : callable, optional
        Called with a `pydpend.batching.Advance` when a recording ended, and with a str that should be known.
    **how : optional
        Fields of `pydpend.batching.BatchOptions`: ``sheet``, ``keep``, ``one_rig``, ``workers``, ``scheduler``,
        ``scheduler_file``, ``retries``, ``time_limit_s``, ``reconnect_s``.

    Returns
    -------
    Batch
        What became of the recordings.

    Raises
    ------
    PydpendError
        If nothing can be done: a sheet or an option that makes no sense, a folder that is not a batch's or that another
        batch works in, a full disk, a scheduler that is not there. A recording that fails raises nothing.
    """
    called: object = progress
    if not (called is None or callable(called)):
        problem = f"{progress!r} cannot be called"
        raise WrongTypeError(fault(Setting("progress"), problem, "Give a function of one argument"))
    asked = BatchOptions(**how)
    many = (
        [recordings]
        if isinstance(recordings, (str, bytes)) or hasattr(recordings, "__fspath__")
        else recordings
    )
    call = _Call(Options() if options is None else options, asked, progress or (lambda event: None))
    return call.run(list(many), results_folder(output).absolute())


class _Call:
    """One call of `batch`."""

    def __init__(self, base: Options, how: BatchOptions, tell: Tell) -> None:
        self.base = base
        self.how = how
        self.tell = tell
        self.token = secrets.token_hex(8)
        self.began = time.monotonic()
        self.kept = self.ended = self.failed = self.of = 0
        self.over: set[str] = set()

    def run(self, given: Sequence[AnyPath], results: Path) -> Batch:
        self.results = results
        found = find_recordings(given, self.base, self.how, self.tell)
        with ExitStack() as held:
            try:
                (results / RUNNING).mkdir(exist_ok=True)
                held.enter_context(holding(results / LOCK, about_me(token=self.token)))
            except Taken as taken:
                raise BatchError(_told_of(results, taken)) from None
            except OSError as problem:
                raise BatchError(_unwritable(results, problem)) from problem
            held.enter_context(keeping(self._read(found)))
            check_results(results)
            self.journal = Journal(results)
            held.callback(self.journal.close)
            return self._run(found)

    def _read(self, found: Sequence[Found]) -> list[AnyPath]:
        """Files that are read, so that none is written over."""
        files: list[AnyPath] = [one.path for one in found if one.path.is_file()]
        return [*files, *([self.how.sheet] if self.how.sheet else [])]

    def _run(self, found: Sequence[Found]) -> Batch:
        known = {str(e.row["path"]): str(name) for name, e in self.journal.ended.items()}
        recordings = named(found, known)
        self.names = [name for name, _ in recordings]
        at_a_time, threads = workers_of(len(recordings), self.base.threads, self.how.workers)
        self.of = len(recordings)
        self._write_names(self._rig_of())
        others = len(set(self.journal.ended) - set(self.names))
        if others:
            self.tell(f"{others} recordings of earlier calls are not named now; their run folders stay")
        write_mark(self.results, {"token": self.token, "version": version(), "recordings": len(recordings)})
        engine = self._engine(at_a_time)
        self.threads = 1 if self.how.on_cluster else threads
        try:
            rig = self._common_rig(recordings, engine)
            # The recording that the rig is of has it by itself.
            origin = self._rig_of() if rig != self.base.rig else ""
            self._work([self._job(n, one, "" if n == origin else rig) for n, one in recordings], engine)
        except BaseException:
            engine.close()
            self._write()
            raise
        engine.close()
        return self._write()

    def _engine(self, at_a_time: int) -> Engine:
        if not self.how.on_cluster:
            return Local(at_a_time, self.how.time_limit_s)
        from pydpend.batching.cluster import Cluster

        return Cluster(self.how, self.results / LOCK, self.tell)

    def _job(self, name: str, one: Found, rig: str) -> Job:
        own_rig = "rig" in told(one.options) and one.options.rig != self.base.rig
        common = "" if own_rig else rig
        try:
            key = key_of(one.path, one.options, common)
        except OSError:
            key = ""
        front = type(front_end())
        return Job(
            name=name,
            path=str(one.path),
            options={k: list(v) if isinstance(v, tuple) else v for k, v in told(one.options).items()},
            results=str(self.results),
            kept=dict(one.kept),
            key=key,
            token=self.token,
            version=version(),
            common_rig=common,
            threads=self.threads,
            front_end=getattr(front, "made_by", ""),
        )

    def _rig_of(self) -> str:
        """The name of the recording in which the rig of all was found; empty if there is none."""
        try:
            return str(json.loads((self.results / NAMES).read_text("utf-8"))["rig_of"])
        except (OSError, ValueError, KeyError, TypeError):
            return ""

    def _write_names(self, rig_of: str) -> None:
        write_json(self.results / NAMES, {"names": self.names, "rig_of": rig_of})

    def _common_rig(self, recordings: Sequence[tuple[str, Found]], engine: Engine) -> str:
        """The rig of all recordings, found in the first that has one; empty where each has its own."""
        if not self.how.one_rig:
            return ""
        if self.base.rig is not None:
            Rig.read(self.base.rig)
            return str(self.base.rig)
        rig, origin = self.results / RIG, self._rig_of()
        known = [pair for pair in recordings if pair[0] == origin]
        if not rig.exists() or known:
            for name, one in known or recordings:
                if self._gives_rig(self._job(name, one, ""), rig, engine):
                    self._write_names(name)
                    break
        return str(rig) if rig.exists() else ""

    def _gives_rig(self, job: Job, rig: Path, engine: Engine) -> bool:
        """Whether a recording has a rig, which is then written. It is analysed unless that is done already."""
        if not job.key:
            return False
        if is_done(self._done_before(job)) and rig.exists():
            return True
        self._work([job], engine)
        nodes = next(job.run.glob("*/nodes.parquet"), None)
        if nodes is None or not is_done(self.journal.ended.get(job.name)):
            return False
        from pydpend.nodes import read_nodes

        read_nodes(nodes).rig.write(rig)
        self.tell(f"the rig of all recordings is that of {job.path}: {rig}")
        return True

    def _done_before(self, job: Job) -> Ended | None:
        """How an earlier call did the recording from the same, if its results are still there."""
        row = stored_row(job)
        return None if row is None else Ended(row, kept=True)

    def _work(self, jobs: Sequence[Job], engine: Engine) -> None:
        """Does what is not done."""
        todo: deque[Job] = deque()
        for job in jobs:
            if job.name in self.over:
                continue
            before = self._done_before(job)
            if before is not None:
                self.kept += 1
                self._end(before)
            elif not job.key:
                lacks = "it is no file" if Path(job.path).exists() else "there is no such file"
                self._end(failed(job, Fault.REFUSED, f"{job.path}: {lacks}. Check the name"))
            else:
                todo.append(job)
        tries = dict.fromkeys((job.name for job in todo), 0)
        written = time.monotonic()
        for job, ended in engine.results(lambda: todo.popleft() if todo else None):
            if ended.fault is Fault.STOPPED:
                continue
            if ended.fault is Fault.DISK:
                raise BatchError(_full(self.results, ended.reason))
            self._tidy(job, ended)
            tries[job.name] += 1
            if ended.fault.may_pass and tries[job.name] <= self.how.retries:
                self.tell(Advance(self.ended, self.of, self.failed, ended, again=True))
                todo.append(self._renewed(job))
                continue
            ended.row["tries"] = tries[job.name]
            self._end(ended)
            if time.monotonic() - written > PAGE_S:
                begun = time.monotonic()
                self._write()
                took = time.monotonic() - begun
                written = time.monotonic() + max(0.0, took / PAGE_SHARE - PAGE_S)

    def _tidy(self, job: Job, ended: Ended) -> None:
        """Takes away the lock of a recording whose process was killed, unless another one has it."""
        if not is_done(ended):
            with suppress(Taken, OSError), holding(lock_of(job), {}):
                pass

    def _renewed(self, job: Job) -> Job:
        """The job with the recording as it is now."""
        try:
            key = key_of(Path(job.path), job.analyse_options(), job.common_rig)
        except OSError:
            return job
        return replace(job, key=key)

    def _end(self, ended: Ended) -> None:
        try:
            self.journal.add(ended)
        except OSError as problem:
            raise BatchError(_unwritable(self.results, problem)) from problem
        self.over.add(ended.row["name"])
        self.ended += 1
        self.failed += not is_done(ended)
        self.tell(Advance(self.ended, self.of, self.failed, ended))

    def _write(self) -> Batch:
        """Writes table, page and trials of what has ended, and sums it up."""
        found = [self.journal.ended[name] for name in self.names if name in self.journal.ended]
        rows = [ended.row for ended in found]
        try:
            write_table(self.results, rows)
            trials = write_agreement(self.results, rows)
            write_index(self.results, rows, len(self.names), trials)
        except OSError as problem:
            raise BatchError(_unwritable(self.results, problem)) from problem
        counts = {str(state): sum(row["state"] == state for row in rows) for state in State}
        lost = [ended.row for ended in found if not is_done(ended)]
        return Batch(
            self.results,
            in_words(counts, len(self.names), self.kept),
            counts,
            self.kept,
            {row["name"]: row["reason"] for row in lost},
            {row["name"]: row["command"] for row in lost},
            "; ".join(one["message"] for one in trials["rigs"]) if trials else "",
        )


def in_words(counts: dict[str, int], of: int, kept: int = 0) -> str:
    """How many recordings are done, in words."""
    said = [f"{counts[State.DONE]} of {of} recordings done"]
    said += [f"{counts[State.PARTLY]} partly"] if counts[State.PARTLY] else []
    said += [f"{counts[State.FAILED]} failed"] if counts[State.FAILED] else []
    missing = of - sum(counts.values())
    said += [f"{missing} not yet"] if missing else []
    said += [f"{kept} of them by earlier calls"] if kept else []
    return ", ".join(said)


def _told_of(results: Path, taken: Taken) -> Text:
    who = taken.who
    words = f"another batch works in this folder (host {who.get('host', '?')}, process {who.get('pid', '?')}"
    words += f", since {who.get('since', '?')})"
    return fault(str(results), words, "Wait for it, end it, or give another folder with -o")


def _unwritable(results: Path, problem: OSError) -> Text:
    named = problem.filename or results
    return fault(str(named), f"cannot be written ({problem.strerror})", "Make room or give another folder")


def _full(results: Path, reason: str) -> Text:
    advice = "Make room and give the same command again: what is done is kept"
    return fault(str(results), f"the disk is full ({reason})", advice)


__all__ = ["TRIALS", "Advance", "Batch", "batch", "in_words"]
