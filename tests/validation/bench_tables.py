"""What the tables and the door to Python cost: ``python -m tests.validation.bench_tables [PART...]``.

Parts: ``memory`` (resident size of 2000 and 40 000 frames; 6 GB of disk), ``door`` (``dp.track`` against the binary,
a progress bar), ``read`` (10 million rows against pyarrow), ``ctrl-c``.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any

import pyarrow.parquet as pq
import pydpend as dp
from pydpend.progress import Bar

from tests.support.drawn_nodes import some_nodes
from tests.support.long_recordings import TRACKER, lengthened, resident


def film(folder: Path, name: str, frames: int, **more: Any) -> Path:
    """The preset ``clean`` at the size of a camera's picture."""
    out = folder / name
    dp.film({**dp.Film("clean").scene, "image_px": [1280, 1024]}, out, frames=frames, **more)
    return out


def memory(folder: Path) -> None:
    short = film(folder, "short.mp4", 2000, x264_preset="veryfast")
    long = folder / "long.mp4"
    loop: list[str | Path] = ["ffmpeg", "-v", "error", "-stream_loop", "19", "-i", short, "-c", "copy", long]
    subprocess.run(loop, check=True)
    raw = film(folder, "short.mraw", 2000, bits=8)
    for name, pair in (("H.264", (short, long)), ("MRAW", (raw, lengthened(raw, 40_000)))):
        sizes = [resident(path, folder / f"{path.name}.parquet") / 1e6 for path in pair]
        print(f"{name}: {sizes[0]:.1f} MB, {sizes[1]:.1f} MB, {sizes[1] / sizes[0] - 1:+.1%}", flush=True)


def in_turn(turns: int, *work: Callable[[], object]) -> list[list[float]]:
    """Seconds of each piece of work, taken in turn."""
    seconds: list[list[float]] = [[] for _ in work]
    for _ in range(turns):
        for one, kept in zip(work, seconds, strict=True):
            began = time.perf_counter()
            one()
            kept.append(time.perf_counter() - began)
    return seconds


def door(folder: Path) -> None:
    path = film(folder, "door.mp4", 2000, x264_preset="veryfast")
    out = folder / "door.parquet"

    def binary() -> None:
        # Status 1: a marker is hidden at the end.
        done = subprocess.run(
            [TRACKER, "track", path, "-o", out, "--force", "--quiet"], stderr=subprocess.DEVNULL
        )
        assert done.returncode in (0, 1)

    python, other = in_turn(5, lambda: dp.track(path, output=out, force=True, progress=False), binary)
    print(
        f"dp.track over the binary, 2000 frames of H.264: {median(python) / median(other):.3f} of medians, "
    )
    print(f"  {min(python) / min(other):.3f} of the best; {median(python):.2f} s", flush=True)
    bar, spent = Bar(), 0.0

    def timed(stage: str, done: int, total: int | None) -> None:
        nonlocal spent
        began = time.perf_counter()
        bar(stage, done, total)
        spent += time.perf_counter() - began

    # What a callback can cost at most is the time inside it: the run goes on beside it.
    dp.track(path, progress=timed)
    first, spent, began = spent, 0.0, time.perf_counter()
    dp.track(path, progress=timed)
    wall = time.perf_counter() - began
    bar.close()
    print(f"time inside the bar's callback: {spent * 1e3:.1f} ms of {wall:.2f} s, {spent / wall:.2%}; ")
    print(f"  {first * 1e3:.1f} ms the first time, with the bar's import", flush=True)


def read(folder: Path) -> None:
    path = folder / "ten_million.parquet"
    nodes = some_nodes(3_333_336)
    nodes.write(path)
    # What Nodes holds; each node's body comes from the rig.
    columns = [name for name in pq.read_schema(path).names if name != "body"]
    ours, theirs = in_turn(5, lambda: dp.read_nodes(path), lambda: pq.read_table(path, columns=columns))
    print(
        f"read_nodes of {nodes.status.size} rows over pyarrow: {median(ours) / median(theirs):.2f} of medians, "
    )
    print(f"  {min(ours) / min(theirs):.2f} of the best; {median(ours):.2f} s", flush=True)


def ctrl_c(folder: Path) -> None:
    path = film(folder, "stop.mraw", 1500, bits=8)
    waits = []
    for k in range(10):
        sent = 0.0

        def send() -> None:
            nonlocal sent
            sent = time.perf_counter()
            os.kill(os.getpid(), signal.SIGINT)

        threading.Timer(0.1 + 0.03 * k, send).start()
        try:
            dp.track(path, progress=False)
            time.sleep(1)
        except KeyboardInterrupt:
            waits.append(time.perf_counter() - sent)
    print(
        f"from SIGINT to KeyboardInterrupt: {min(waits):.2f} to {max(waits):.2f} s, {len(waits)} runs",
        flush=True,
    )


PARTS = {"memory": memory, "door": door, "read": read, "ctrl-c": ctrl_c}


def main() -> None:
    for part in sys.argv[1:] or PARTS:
        with tempfile.TemporaryDirectory() as folder:
            PARTS[part](Path(folder))


if __name__ == "__main__":
    main()
