"""One click an object on the films with truth: what is followed, and whether it is right.

``python -m tests.validation.clicks TRACKER [--films FOLDER] [--part 0.5] [NAME ...]`` points at each object of the
first set of objects that a person would accept, at its true place in a frame: the one that is
``part`` of the way through those in which it has a true place. It runs ``tracker track`` with those clicks and prints a
row a film, judged by the films' own scorer. Last come the counts; the exit status is 1 if
one is wrong with exit status 0.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

FILMS = Path(__file__).parent.parent.parent.parent / "shared" / "films"
# Processor time of one run, s.
LIMIT_S = 300


def scorer(films: Path) -> Any:
    """The module that judges a table, which lies beside the films."""
    spec = importlib.util.spec_from_file_location("score", films / "score.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def clicks(truth: dict[str, dict[int, tuple[float, float]]], objects: list[str], part: float) -> list[str]:
    """``X,Y@FRAME`` of each object, in px and frames of the recording."""
    places = []
    for name in objects:
        frames = sorted(truth[name])
        frame = frames[round(part * (len(frames) - 1))]
        x, y = truth[name][frame]
        places.append(f"{x:.0f},{y:.0f}@{frame}")
    return places


def run(tracker: str, folder: Path, score: Any, part: float, set_index: int = 0) -> tuple[str, str]:
    """Kind of the result (right, silent, said, refused, unfinished) and a row of it."""
    meta = json.loads((folder / "meta.json").read_text())
    truth = score.truth(folder / "truth.csv")
    film = folder / meta["film"]
    optional = set(meta.get("optional") or [])
    sets = meta.get("alternatives") or [[name for name in truth if name not in optional]]
    objects = sets[min(set_index, len(sets) - 1)]
    places = clicks(truth, objects, part)
    with tempfile.TemporaryDirectory() as out:
        table = Path(out) / "table.csv"
        command = [tracker, "track", str(film), "-o", str(table)]
        command += ["--fps", str(meta.get("fps_true") or 100)] if film.is_dir() else []
        command += [word for place in places for word in ("--marker", place)]
        before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
        done = subprocess.run(
            command,
            capture_output=True,
            text=True,
            check=False,
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (LIMIT_S, LIMIT_S + 5)),
        )
        spent = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
        row = f"exit {done.returncode} {spent:5.1f} s  {' '.join(places)[:60]:60s} "
        if done.returncode < 0:
            return "unfinished", row
        if not table.exists():
            said = [line for line in done.stderr.splitlines() if line.startswith("error")] or [""]
            return "refused", row + said[-1][:400]
        nodes, _ = score.table(str(table))
        kept = [name for name in truth if name in objects or name in optional or meta.get("alternatives")]
        meta["alternatives"] = [objects] if not meta.get("alternatives") else meta["alternatives"]
        judged = score.judge(nodes, {name: truth[name] for name in kept}, meta)
    right = judged["verdict"] == "right"
    kind = "right" if right else "silent" if done.returncode == 0 else "said"
    names = ("verdict", "coverage", "swap_pct", "false_pct", "nodes", "extra_moving", "median_error_px")
    return kind, row + json.dumps({name: judged[name] for name in names})


def main() -> int:
    """Runs all films."""
    parser = argparse.ArgumentParser(description="One click an object on the films with truth.")
    parser.add_argument("tracker")
    parser.add_argument("names", nargs="*")
    parser.add_argument("--films", type=Path, default=FILMS)
    parser.add_argument("--part", type=float, default=0.5)
    parser.add_argument("--set", type=int, default=0)
    given = parser.parse_intermixed_args()
    score = scorer(given.films)
    names = given.names or sorted(p.parent.name for p in given.films.glob("*/meta.json"))
    count: dict[str, int] = {}
    for name in names:
        kind, row = run(given.tracker, given.films / name, score, given.part, given.set)
        count[kind] = count.get(kind, 0) + 1
        print(f"{name:16s} {kind:10s} {row}", flush=True)
    print(", ".join(f"{n} {kind}" for kind, n in sorted(count.items())))
    return int("silent" in count)


if __name__ == "__main__":
    sys.exit(main())
