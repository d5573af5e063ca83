"""A scheduler of dask.distributed and two workers on this machine, and a batch to which everything happens."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import polars as pl
from pydpend.analyse import Options, analyse
from pydpend.batching import BatchError
from pydpend.batching.status import Status, status

from tests.support.small_films import small_film, small_films

SPOILT = Path(__file__).parent / "spoilt_helpers"
OF_THE_CALL = ("run.json", "README.txt", "report.html", "row.json")
"""Files of a run folder that hold the command and durations."""

LIMIT_S = 15
"""Time limit of a recording: those that end take a second or a few on a busy machine."""


class SmallCluster:
    """The scheduler and its workers, in whose folder all of it lies."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.file = folder / "scheduler.json"
        self.environment = {**os.environ, "PYTHONPATH": str(SPOILT)}
        self.running: list[subprocess.Popen[bytes]] = []
        """Scheduler and workers."""
        self.start()

    def _run(self, *words: str) -> subprocess.Popen[bytes]:
        with (self.folder / "dask.txt").open("ab") as said:
            started = subprocess.Popen(
                [sys.executable, "-m", *words],
                env=self.environment,
                cwd=self.folder,
                stdout=said,
                stderr=said,
            )
        if words[0].startswith("distributed"):
            self.running.append(started)
        return started

    def start(self) -> None:
        """Starts a scheduler and two workers."""
        file = ["--scheduler-file", str(self.file)]
        host = ["--host", "127.0.0.1", "--no-dashboard"]
        self.scheduler = self._run("distributed.cli.dask_scheduler", *host, "--port", "0", "--no-show", *file)
        for _ in range(2):
            self._run("distributed.cli.dask_worker", *file, *host, "--nthreads", "1", "--memory-limit", "0")

    def lose_scheduler(self) -> None:
        """Kills the scheduler, and takes its workers away as who manages jobs does."""
        self.scheduler.kill()
        self.stop()
        self.file.unlink()

    def batch(self, *words: str) -> subprocess.Popen[bytes]:
        """Starts ``pydpend batch`` on it."""
        return self._run("pydpend", "batch", *words, "--scheduler-file", str(self.file))

    def stop(self) -> None:
        """Ends scheduler and workers."""
        for one in self.running:
            one.terminate()
        for one in self.running:
            with suppress(subprocess.TimeoutExpired):
                one.wait(5)
            one.kill()
            one.wait()
        self.running.clear()


def until(holds: Callable[[], bool], limit_s: float = 180.0) -> None:
    """Waits; a hang fails."""
    end = time.monotonic() + limit_s
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.1)


def alive(pid: int) -> bool:
    """Whether a process is there and no zombie."""
    try:
        return Path(f"/proc/{pid}/stat").read_text("ascii").rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


def parent_of(pid: int) -> int:
    """The process that started a process."""
    return int(Path(f"/proc/{pid}/stat").read_text("ascii").rpartition(")")[2].split()[1])


def everything_happens(folder: Path, count: int) -> pl.DataFrame:
    """The table of a batch of so many films while a worker is killed, the scheduler restarted, and films are bad.

    Checked on the way: the recording of a killed worker ends with it; the folder tells how far it is.
    """
    films, results = folder / "films", folder / "results"
    some = small_films(films, count)
    for name in ("crash", "endless"):
        shutil.copy(some[0], films / f"{name}.mp4")
    order = [films / "endless.mp4", films / "crash.mp4", *some]
    cluster = SmallCluster(folder)
    plain = ("--zero", "vertical", "--no-overlay", "--time-limit", str(LIMIT_S), "-o", str(results))
    going = cluster.batch(*map(str, order), *plain)
    try:

        def told() -> Status | None:
            try:
                return status(results)
            except (BatchError, OSError):
                return None

        def done(least: int) -> Callable[[], bool]:
            return lambda: (found := told()) is not None and sum(found.counts.values()) >= least

        until(lambda: (found := told()) is not None and "endless" in found.running)
        # Replaced while it is queued: the last of all.
        small_film(some[-1], 999)
        child = int(json.loads((results / "running/endless.json").read_text("utf-8"))["pid"])
        helper = parent_of(child)
        worker = parent_of(helper)
        os.kill(worker, signal.SIGKILL)
        until(lambda: not alive(child) and not alive(helper))
        until(done(count // 4))
        cluster.lose_scheduler()
        cluster.start()
        assert going.wait(600 + 2 * count) == 1, (folder / "dask.txt").read_text("utf-8")[-3000:]
    finally:
        cluster.stop()
        going.kill()
        going.wait()
    return pl.read_parquet(results / "batch.parquet")


def check(folder: Path, rows: pl.DataFrame, count: int, compared: int) -> None:
    """Nothing is lost and nothing wrong: each film has its row, and ``compared`` of them are what serial runs give."""
    films, results = folder / "films", folder / "results"
    found = {row["name"]: row for row in rows.to_dicts()}
    names = [f"f{k:03}" for k in range(count)]
    assert list(found) == ["endless", "crash", *names]
    assert [name for name in names if found[name]["state"] == "failed"] == []
    assert "SIGABRT" in found["crash"]["reason"]
    assert found["crash"]["tries"] == 2
    assert found["endless"]["reason"] == f"it took longer than the time limit, {LIMIT_S} s"
    last = films / f"{names[-1]}.mp4"
    assert found[names[-1]]["film_sha256"] == hashlib.sha256(last.read_bytes()).hexdigest()
    workers = {row["worker"] for row in found.values() if row["worker"]}
    assert len(workers) >= 2
    assert all(worker.startswith("tcp://127.0.0.1:") for worker in workers)
    for name in [*names[: compared - 1], names[-1]]:
        alone = folder / "alone" / name
        analyse(Options(inputs=(str(films / f"{name}.mp4"),), zero="vertical", overlay=False), alone)
        assert contents(results / "runs" / name) == contents(alone)


def contents(run: Path) -> dict[str, bytes]:
    """The files of a run folder that hold what was found."""
    files = (p for p in run.rglob("*") if p.is_file() and p.name not in OF_THE_CALL)
    return {p.relative_to(run).as_posix(): p.read_bytes() for p in files}
