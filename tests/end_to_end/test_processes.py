"""Worker processes: whoever used pydpend may fork, spawn or thread, and every public function answers there.

A fork copies thread pools and none of their threads, and work given to such a pool never ends: so each way runs in a
process of its own with a time limit.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pydpend as dp
import pytest

LIMIT_S = 120
"""The calls take some seconds; a worker that hangs takes for ever."""


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A film, its pictures and truth, its node table, and angles of a simulated free decay."""
    here = tmp_path_factory.mktemp("workers")
    dp.film("clean", here / "film.mp4", here / "truth.parquet", seed=1, frames=40)
    (here / "pictures").mkdir()
    dp.film("clean", here / "pictures" / "%05d.png", seed=1, frames=40)
    dp.track(here / "film.mp4", output=here / "nodes.parquet", progress=False)
    times = np.arange(0, 4, 2e-3)
    run = dp.simulate(dp.derived("A"), dp.Damping(mu_v1=3e-4, mu_v2=1e-4), [1.5, 0.5, 0, 0], times)
    sigma = np.full(run.phi_rad.shape, 1e-3)
    noisy = run.phi_rad + 1e-3 * np.random.default_rng(1).standard_normal(run.phi_rad.shape)
    dp.write_angles(dp.LinkAngles(times, noisy, sigma, None, {}, "decay"), here / "angles.parquet")
    return here


@pytest.mark.parametrize("how", ["fork", "spawn", "forkserver", "executor", "nested", "loky", "threads"])
def test_workers_answer_where_the_parent_did(files: Path, how: str) -> None:
    # All by the way that hangs most easily, for the others one of each pool.
    calls = [] if how == "fork" else ["read_nodes,track_pictures,simulate_many,fit_damping"]
    script = Path(__file__).parent.parent / "support" / "worker_calls.py"
    done = subprocess.run(
        [sys.executable, "-W", "ignore", script, files, how, *calls],
        capture_output=True,
        text=True,
        timeout=LIMIT_S,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-2000:]
