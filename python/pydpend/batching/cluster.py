"""Recordings on the workers of a dask.distributed scheduler.

Only paths and results of some kilobytes go over the network. Few more recordings than there are workers are handed out
at a time, so that the scheduler's memory does not grow with their number. A worker does a recording in a process of its
own beside it (`pydpend.batching.helpers`), so that one that crashes takes no worker along.
"""

from __future__ import annotations

import socket
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from itertools import count
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any

from pydpend.batching.helpers import of_this_process
from pydpend.batching.jobs import Job
from pydpend.batching.journal import BatchError
from pydpend.batching.lock import written_in
from pydpend.batching.options import BatchOptions
from pydpend.batching.recording import Ended, Fault, failed
from pydpend.errors import Text, fault

AHEAD = 2
"""Recordings handed out for each that can be done at a time, so that no worker waits for the next."""

LOOK_S = 2.0
"""Seconds between two looks at whether scheduler and workers are there."""

ATTEMPT_S = 5.0
"""Seconds that one attempt to reach the scheduler may take."""

NO_WORKERS_S = 30.0
"""Seconds without any worker after which it is said."""

GONE = ("lost", "cancelled")
"""States of what a scheduler that was restarted does not know."""


def work(values: Mapping[str, Any], limit_s: float | None, lock: str) -> dict[str, Any]:
    """A recording done on a worker: how it ended. Stopped when the batch that asked for it is gone."""
    from distributed import get_worker

    job = Job.of(values)
    name = f"{get_worker().address} on {socket.gethostname()}"
    path = Path(lock)

    def goes_on() -> bool:
        # A folder that is not seen at the moment says nothing.
        return (
            not path.parent.is_dir()
            or written_in(path).get("token", job.token if path.exists() else "") == job.token
        )

    return of_this_process().do(job, limit_s, name, goes_on).to_dict()


class _Lost(Exception):
    """The scheduler is gone, or knows nothing of what it was given."""


class Cluster:
    """The workers of a scheduler."""

    def __init__(self, how: BatchOptions, lock: Path, tell: Callable[[str], object]) -> None:
        try:
            import distributed
        except ImportError:
            advice = "Install it: pip install 'pydpend[batch]'"
            raise BatchError(fault("scheduler", "dask.distributed is not installed", advice)) from None
        self._dask: Any = distributed
        self._how = how
        self._lock = lock
        self._tell = tell
        self._under_way: dict[Any, Job] = {}
        self._ended: SimpleQueue[Any] = SimpleQueue()
        self._numbers = count()
        self._client = self._connected("there is no scheduler")
        self._at_a_time = 0
        self._looked = self._worked = time.monotonic()

    def _connected(self, problem: str) -> Any:
        """A connection to the scheduler. Raises BatchError if there is none in time."""
        named = self._how.scheduler or str(self._how.scheduler_file)
        end = time.monotonic() + self._how.reconnect_s
        while True:
            # Again and again: a scheduler that is started anew may be at another address, which its file tells.
            left = max(1.0, min(ATTEMPT_S, end - time.monotonic()))
            try:
                if self._how.scheduler:
                    return self._dask.Client(self._how.scheduler, timeout=left, set_as_default=False)
                file = Path(str(self._how.scheduler_file))
                if not file.exists():
                    raise OSError(f"there is no file {file}")
                return self._dask.Client(scheduler_file=str(file), timeout=left, set_as_default=False)
            except (OSError, TimeoutError, ValueError) as error:
                if isinstance(error, ValueError) or time.monotonic() + 1.0 >= end:
                    raise BatchError(_no_scheduler(named, problem, error)) from None
            time.sleep(1.0)

    def results(self, take: Callable[[], Job | None]) -> Iterator[tuple[Job, Ended]]:
        """Each job with how it ended, as they end. ``take`` gives the next one, None where there is none now."""
        again: deque[Job] = deque()
        while True:
            try:
                self._look()
                while len(self._under_way) < AHEAD * self._at_a_time + 1:
                    job = again.popleft() if again else take()
                    if job is None:
                        break
                    self._hand_out(job)
                if not self._under_way:
                    return
                found = self._next()
            except _Lost:
                again.extend(self._under_way.values())
                self._under_way.clear()
                self._reconnect()
                continue
            if found is not None:
                yield found

    def _hand_out(self, job: Job) -> None:
        try:
            future = self._client.submit(
                work,
                job.to_dict(),
                self._how.time_limit_s,
                str(self._lock),
                # One name for all, or the scheduler keeps a record of each.
                key=(f"pydpend-{job.token}", next(self._numbers)),
                pure=False,
            )
        except Exception as problem:
            self._under_way[object()] = job
            raise _Lost from problem
        self._under_way[future] = job
        future.add_done_callback(self._ended.put)

    def _next(self) -> tuple[Job, Ended] | None:
        """A job that ended; None if none did for a while. Raises _Lost."""
        try:
            future = self._ended.get(timeout=LOOK_S)
        except Empty:
            return None
        if future not in self._under_way:
            return None
        if future.status in GONE:
            raise _Lost
        job = self._under_way.pop(future)
        try:
            return job, Ended.of(future.result(timeout=self._how.reconnect_s))
        except self._dask.scheduler.KilledWorker as killed:
            worker = getattr(killed.last_worker, "address", "?")
            return job, failed(job, Fault.LOST, f"its workers were lost, the last one {worker}")
        except Exception as problem:
            if self._client.status != "running":
                self._under_way[future] = job
                raise _Lost from problem
            said = f"a worker could not do it: {type(problem).__name__}: {problem}"
            return job, failed(job, Fault.LOST, said)
        finally:
            future.release()

    def _look(self) -> None:
        """Looks after scheduler and workers. Raises _Lost."""
        now = time.monotonic()
        if self._at_a_time and now - self._looked < LOOK_S:
            return
        self._looked = now
        if any(getattr(future, "status", "lost") in GONE for future in self._under_way):
            raise _Lost
        try:
            self._at_a_time = sum(self._client.nthreads().values())
        except Exception as problem:
            raise _Lost from problem
        if self._at_a_time:
            self._worked = now
        elif now - self._worked > NO_WORKERS_S:
            self._worked = now
            self._tell("the scheduler has no workers; they are waited for")

    def _reconnect(self) -> None:
        self._tell("the scheduler is lost; it is waited for")
        self._drop()
        self._client = self._connected("the scheduler is gone")
        self._at_a_time = 0

    def _drop(self) -> None:
        """Ends the connection."""
        with suppress(Exception):
            self._client.close(timeout=1)

    def close(self) -> None:
        """Takes back what is handed out; workers stop what they do when the batch's lock is gone."""
        with suppress(Exception):
            self._client.cancel([future for future in self._under_way if hasattr(future, "status")])
        self._drop()


def _no_scheduler(named: str, problem: str, error: Exception) -> Text:
    said = " ".join(str(error).split())
    advice = "Start it, and give the same command again: what is done is kept"
    return fault(named, f"{problem} ({said})" if said else problem, advice)
