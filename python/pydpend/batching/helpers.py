"""Helpers of this process: each runs `pydpend.batching.helper` and does one recording at a time."""

from __future__ import annotations

import atexit
import json
import os
import select
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress

from pydpend.batching.jobs import Job
from pydpend.batching.recording import Ended, Fault, failed

BLAS_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
"""Variables by which libraries of linear algebra are told how many threads to use."""

LOOK_S = 1.0
"""Seconds between two looks at whether a recording is to go on."""

PATIENCE_S = 10.0
"""Seconds within which a helper ends when it is to."""


class Helper:
    """One helper."""

    def __init__(self, threads: int) -> None:
        environment = {**os.environ, **dict.fromkeys(BLAS_THREADS, str(threads))}
        # The package is found there as it is here, whatever made it importable.
        environment["PYTHONPATH"] = os.pathsep.join(p for p in sys.path if p)
        self._process = subprocess.Popen(
            [sys.executable, "-m", "pydpend.batching.helper"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=environment,
            # Ctrl-C reaches the caller alone, who then ends the helpers.
            start_new_session=True,
        )

    def do(self, job: Job, limit_s: float | None, worker: str, goes_on: Callable[[], bool]) -> Ended:
        """How the recording ended. ``goes_on`` is asked again and again; without it the recording is stopped."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        asked = {"job": job.to_dict(), "limit_s": limit_s, "worker": worker}
        try:
            self._process.stdin.write(json.dumps(asked).encode() + b"\n")
            self._process.stdin.flush()
        except OSError:
            return failed(job, Fault.CRASHED, "its helper process is gone")
        while not select.select([self._process.stdout], [], [], LOOK_S)[0]:
            if not goes_on():
                self.close()
                return failed(job, Fault.STOPPED, "the batch was stopped")
        line = self._process.stdout.readline()
        if not line:
            self.close()
            if not goes_on():
                return failed(job, Fault.STOPPED, "the batch was stopped")
            return failed(job, Fault.CRASHED, "its helper process was ended from outside")
        return Ended.of(json.loads(line))

    @property
    def is_there(self) -> bool:
        """Whether it can do another one."""
        return self._process.poll() is None

    def let_go(self) -> None:
        """Tells it that there is no more to do; a recording under way is stopped."""
        if self._process.stdin is not None:
            with suppress(OSError):
                self._process.stdin.close()

    def wait(self, limit_s: float) -> None:
        """Waits until it is gone, and ends it by force after ``limit_s``."""
        try:
            self._process.wait(limit_s)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def close(self) -> None:
        """Ends it, and the recording under way."""
        self.let_go()
        self.wait(PATIENCE_S)
        if self._process.stdout is not None:
            self._process.stdout.close()


class Helpers:
    """Helpers for as many recordings at a time as are asked for, each used again."""

    def __init__(self) -> None:
        self._free: list[tuple[int, Helper]] = []
        self._all: set[Helper] = set()
        self._lock = threading.Lock()
        self._is_open = True
        atexit.register(self.close)

    def do(
        self,
        job: Job,
        limit_s: float | None,
        worker: str,
        goes_on: Callable[[], bool] = lambda: True,
    ) -> Ended:
        """How a recording ended, done by a helper of its own meanwhile."""
        threads = int(job.options.get("threads") or job.threads)
        helper = self._take(threads)
        if helper is None:
            return failed(job, Fault.STOPPED, "the batch was stopped")
        ended = helper.do(job, limit_s, worker, lambda: self._is_open and goes_on())
        with self._lock:
            if helper.is_there and self._is_open:
                self._free.append((threads, helper))
            else:
                self._all.discard(helper)
                helper.let_go()
        return ended

    def _take(self, threads: int) -> Helper | None:
        with self._lock:
            if not self._is_open:
                return None
            for place, (count, helper) in enumerate(self._free):
                if count == threads and helper.is_there:
                    del self._free[place]
                    return helper
            helper = Helper(threads)
            self._all.add(helper)
            return helper

    def close(self) -> None:
        """Ends all of them, and what they do."""
        with self._lock:
            self._is_open = False
            mine, self._all = list(self._all), set()
            idle = [helper for _, helper in self._free]
            self._free.clear()
        for helper in mine:
            helper.let_go()
        end = time.monotonic() + PATIENCE_S
        for helper in mine:
            helper.wait(max(0.0, end - time.monotonic()))
        for helper in idle:
            helper.close()
        atexit.unregister(self.close)


_OWN_LOCK = threading.Lock()
_OWN: list[Helpers] = []


def of_this_process() -> Helpers:
    """The helpers of this process, for workers of a scheduler."""
    with _OWN_LOCK:
        if not _OWN:
            _OWN.append(Helpers())
        return _OWN[0]
