"""Real motion, filmed: the paper's two trials through film maker, tracker and angles, without settings.

The motion is the trials' own angles (38827 frames at 500 a second, ``../shared/data/myers_trials``); the film goes
from ``tracker film`` to ``tracker track`` through a pipe, without loss and without a file.

Usage: python -m tests.validation.validate_kinematics [FRAMES]
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from pydpend.kinematics import angles
from pydpend.nodes import read_nodes

ROOT = Path(__file__).parents[2]
TRIALS = ROOT.parent / "shared" / "data" / "myers_trials"
TRACKER = ROOT / "target" / "release" / "tracker"
WANTED_DEG = 0.02


def one(trial: Path, seed: int, frames: int | None, folder: Path) -> str:
    """One trial: a line of the table."""
    links = [np.load(trial / f"DPmean_data_RB{k}.npy") for k in (0, 1)]
    t_s = links[0][0]
    phi_rad = np.radians(np.stack([links[0][1], links[1][1]], axis=1))
    n = len(t_s) if frames is None else frames
    motion, nodes, truth = (folder / f"{trial.name}{end}" for end in (".csv", ".parquet", "_truth.parquet"))
    np.savetxt(
        motion,
        np.column_stack([t_s, phi_rad]),
        fmt="%.17g",
        delimiter=",",
        header="time_s,phi1_rad,phi2_rad",
        comments="",
    )
    film = [str(TRACKER), "film", "--preset", "clean", "--seed", str(seed), "--motion", str(motion), "-q"]
    film += ["--frame-count", str(n), "--truth", str(truth), "-o", "-"]
    with subprocess.Popen(film, stdout=subprocess.PIPE) as made:
        track = [str(TRACKER), "track", "-", "-o", str(nodes), "--quiet"]
        subprocess.run(track, stdin=made.stdout, check=True)
    score = json.loads(
        subprocess.run(
            [str(TRACKER), "score", str(nodes), str(truth), "--json"], stdout=subprocess.PIPE, check=False
        ).stdout
    )
    found = angles(read_nodes(nodes))
    error = np.degrees(found.phi_rad - phi_rad[:n])
    rms = np.sqrt(np.nanmean(error**2, axis=0))
    # A turn lost anywhere would be an error of 360 deg.
    turns = int((np.abs(error) > 180).sum())
    seen = 100 * np.isfinite(error).mean(axis=0)
    back = score["reacquisition"]
    return (
        f"| {trial.name} | {n} | {rms[0]:.4f}, {rms[1]:.4f} | {turns} | {seen[0]:.2f}, {seen[1]:.2f} % | "
        f"{100 * score['coverage']:.3f} % | {score['wrong']}, {score['switches']}, {score['false_positives']} | "
        f"{back['at_once']} of {back['cases']} | {'yes' if (rms < WANTED_DEG).all() and not turns else 'no'} |"
    )


def main() -> None:
    """Both trials, a line each."""
    frames = int(sys.argv[1]) if len(sys.argv) > 1 else None
    print(
        "| trial | frames | RMS phi1, phi2 deg | rows a turn off | angles given | coverage | wrong, switches, false | "
        "back at once | within 0.02 deg |\n|---|---|---|---|---|---|---|---|---|",
        flush=True,
    )
    with tempfile.TemporaryDirectory() as folder:
        for seed, trial in enumerate(("trial1", "trial2"), start=100):
            print(one(TRIALS / trial, seed, frames, Path(folder)), flush=True)


if __name__ == "__main__":
    main()
