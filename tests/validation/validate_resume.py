"""Kills `tracker track` at random moments and goes on: the table must have the bytes of an uninterrupted run, and those
of any other number of threads.

Usage: python -m tests.validation.validate_resume [KILLS] [SEED]
"""

from __future__ import annotations

import hashlib
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

TRACKER = Path(__file__).parent.parent.parent / "target" / "release" / "tracker"
FILMS = {"h264.mp4": ["--x264-preset", "veryfast"], "mjpeg.avi": ["--codec", "mjpeg"], "photron.mraw": []}
FRAMES = 1500


def command(film: Path, out: Path, *more: str) -> list[str]:
    return [str(TRACKER), "track", str(film), "-o", str(out), "--quiet", *more]


def track(film: Path, out: Path, *more: str) -> str:
    """Tracks a film to its end: the table's digest. Status 1 is a marker hidden at the end."""
    done = subprocess.run(command(film, out, *more), stderr=subprocess.PIPE, text=True)
    if done.returncode > 1:
        raise RuntimeError(done.stderr)
    return hashlib.sha256(out.read_bytes()).hexdigest()


def killed(film: Path, out: Path, seconds: float) -> str:
    """Kills a run after some time; where it was by then."""
    state = out.with_name(out.name + ".partial")
    child = subprocess.Popen(command(film, out, "--resume"), stderr=subprocess.DEVNULL)
    time.sleep(seconds)
    child.kill()
    child.wait()
    if out.exists():
        return "done"
    writing = out.with_name(out.name + ".writing").exists()
    return "in the table" if writing else "in detection" if state.exists() else "before it began"


def sweep(folder: Path, kills: int, seed: int) -> int:
    rng = np.random.default_rng(seed)
    different = 0
    for name, options in FILMS.items():
        film = folder / name
        make = [
            str(TRACKER),
            "film",
            "--preset",
            "clean",
            "--frame-count",
            str(FRAMES),
            "-q",
            "-o",
            str(film),
        ]
        subprocess.run([*make, *options], check=True)
        begin = time.monotonic()
        whole = track(film, folder / "whole.parquet", "--force")
        seconds = time.monotonic() - begin
        for threads in ("1", "2", "8"):
            same = track(film, folder / f"{threads}.parquet", "--force", "--threads", threads) == whole
            different += not same
            print(f"{name}: {threads} threads: {'identical' if same else 'DIFFERENT'}", flush=True)
        identical, where = 0, []
        for k in range(kills):
            out = folder / f"{name}.{k}.parquet"
            where.append(killed(film, out, rng.uniform(0, seconds)))
            identical += track(film, out, "--resume") == whole
            left = [p.name for p in folder.iterdir() if p.name.startswith(out.name) and p != out]
            if left:
                print(f"{name}: left behind: {left}")
                different += 1
        different += kills - identical
        counts = ", ".join(f"{where.count(w)} {w}" for w in sorted(set(where)))
        print(f"{name}: {identical} of {kills} identical after a kill ({counts})", flush=True)
    return different


def main() -> None:
    kills, seed = (int(a) for a in (sys.argv[1:] + ["10", "2026"][len(sys.argv) - 1 :]))
    with tempfile.TemporaryDirectory() as folder:
        sys.exit(1 if sweep(Path(folder), kills, seed) else 0)


if __name__ == "__main__":
    main()
