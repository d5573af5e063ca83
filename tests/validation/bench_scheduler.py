"""Scheduler's part in a batch: recordings of empty work, ``python -m tests.validation.bench_scheduler``.

Scheduler, worker and batch share this process, so that its processor time and memory are those of all three.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import distributed
import pydpend.batching.cluster as cluster
from pydpend.batching.jobs import Job
from pydpend.batching.options import BatchOptions


def nothing(values: Mapping[str, Any], limit_s: float | None, lock: str) -> dict[str, Any]:
    """The answer to a recording without the work."""
    return {
        "row": {"name": values["name"], "curve": [[0] * 96] * 2},
        "fault": "",
        "kept": False,
        "reason": "",
    }


def resident_mib() -> float:
    """Memory of this process."""
    lines = Path("/proc/self/status").read_text("ascii").splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmRSS")) / 1024


def main() -> None:
    """Prints what the scheduler holds as recordings go by."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--recordings", type=int, default=5000)
    count = asked.parse_args().recordings
    cluster.work = nothing
    local: Any = distributed.LocalCluster
    with local(
        n_workers=1, threads_per_worker=4, processes=False, dashboard_address=None, protocol="inproc"
    ) as small:
        engine = cluster.Cluster(BatchOptions(scheduler=small.scheduler_address), Path("lock"), print)
        jobs = (Job(f"f{k:06}", f"/shared/f{k:06}.mp4", {}, "/shared") for k in range(count))
        for done, _ in enumerate(engine.results(lambda: next(jobs, None)), 1):
            if done == 100 or done % max(1, count // 10) == 0:
                held = small.scheduler
                print(
                    f"{done} recordings: {time.process_time():.1f} s of processor time, {resident_mib():.0f} MiB, "
                    f"{len(held.tasks)} tasks in {len(held.task_groups)} group, {len(held.transition_log)} in its log"
                )
        engine.close()


if __name__ == "__main__":
    main()
