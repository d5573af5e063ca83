"""Recordings on this machine, as many at a time as its cores and memory allow."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from pathlib import Path

from pydpend.batching.helpers import Helpers
from pydpend.batching.jobs import Job
from pydpend.batching.recording import Ended, worker_name

RECORDING_BYTES = 1 << 30
"""Memory for one recording, bytes: 0.37 GiB were measured for 5001 frames of 640 x 640 px with film and page,
and pictures and tables of longer films are larger."""


def cores() -> int:
    """Cores that this process may use, by its affinity and its control group's share of time."""
    here = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    try:
        quota, period = Path("/sys/fs/cgroup/cpu.max").read_text("ascii").split()
        return max(1, min(here, int(quota) // int(period)))
    except (OSError, ValueError):
        return here


def free_memory() -> int | None:
    """Bytes of memory that this process may still take; None if nobody says."""
    found = []
    try:
        for line in Path("/proc/meminfo").read_text("ascii").splitlines():
            if line.startswith("MemAvailable:"):
                found.append(1024 * int(line.split()[1]))
        limit = Path("/sys/fs/cgroup/memory.max").read_text("ascii").strip()
        found.append(int(limit))
    except (OSError, ValueError):
        pass
    return min(found, default=None)


def workers_of(recordings: int, threads: int | None, asked: int | None) -> tuple[int, int]:
    """Recordings at a time, and threads for each.

    A core for each recording while there are enough recordings; with fewer, each has several threads.
    """
    here = cores()
    if asked is None:
        asked = max(1, here // (threads or 1))
        memory = free_memory()
        if memory is not None:
            asked = max(1, min(asked, memory // RECORDING_BYTES))
    at_a_time = max(1, min(asked, recordings))
    return at_a_time, threads or max(1, here // at_a_time)


class Local:
    """Helpers of this process."""

    def __init__(self, workers: int, limit_s: float | None) -> None:
        self.workers = workers
        self._limit_s = limit_s
        self._helpers = Helpers()
        self._threads = ThreadPoolExecutor(workers)

    def results(self, take: Callable[[], Job | None]) -> Iterator[tuple[Job, Ended]]:
        """Each job with how it ended, as they end. ``take`` gives the next one, None where there is none now."""
        under_way: dict[Future[Ended], Job] = {}
        while True:
            while len(under_way) < self.workers and (job := take()) is not None:
                under_way[self._threads.submit(self._helpers.do, job, self._limit_s, worker_name())] = job
            if not under_way:
                return
            for future in wait(under_way, return_when=FIRST_COMPLETED).done:
                yield under_way.pop(future), future.result()

    def close(self) -> None:
        """Stops what is under way."""
        self._helpers.close()
        self._threads.shutdown(wait=True, cancel_futures=True)
