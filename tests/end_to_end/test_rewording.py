"""Nothing reads its own words: with every message in other words pages and exit statuses are the same."""

from __future__ import annotations

import dataclasses
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pydpend as dp
import pytest
from pydpend.kinematics import LinkAngles, write_angles
from pydpend.model import Damping, derived
from pydpend.simulation import simulate

from tests.support import drawn_nodes, two_links
from tests.support.free_decays import ALL_TERMS, measured, released

ROOT = Path(__file__).parent.parent.parent
DEMO = ROOT / "fixtures" / "demo"


def noisy(path: Path, seed: int, damping: Damping, seconds: float) -> str:
    """A free decay, measured."""
    write_angles(measured(released(seed, seconds, 250.0, damping), seed, 0.05), path)
    return str(path)


def prepared(at: Path) -> list[list[str]]:
    """The commands, and what they read: whatever takes another way by what came of it."""
    t, phi = two_links.drop(3.0, 500.0, 70, rest_s=1.0)
    hidden = np.zeros((t.size, 9), dtype=bool)
    hidden[800:1200, 3:] = True
    film = two_links.film(t, phi, 70, hidden=hidden)
    dataclasses.replace(film, meta=drawn_nodes.META).write(at / "gap.parquet")
    whole = two_links.film(t, phi, 70)
    dataclasses.replace(whole, meta=drawn_nodes.META).write(at / "whole.parquet")
    angles = dp.read_angles(DEMO / "motion.parquet")
    volts = np.genfromtxt(DEMO / "encoder.csv", delimiter=",", names=True)
    lines = [",".join(volts.dtype.names or ())]
    lines += [
        ",".join("" if k == 50 and v == row[-1] else repr(float(v)) for v in row)
        for k, row in enumerate(volts)
    ]
    (at / "lacking.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    write_angles(angles, at / "motion.parquet")
    line = np.linspace(0.0, 1.0, 50)
    straight = LinkAngles(line, np.column_stack([line, line]), np.full((50, 2), 1e-3))
    write_angles(straight, at / "straight.parquet")
    times = np.arange(0.0, 3.0, 2e-3)
    creeping = simulate(derived("A"), Damping(mu_v1=1.0, mu_v2=0.2), [1.5, 1.2, 0.0, 0.0], times)
    noise = np.random.default_rng(1).normal(0.0, 3e-4, creeping.phi_rad.shape)
    write_angles(LinkAngles(times, creeping.phi_rad + noise, np.full_like(noise, 3e-4)), at / "creeping.csv")
    # One marker: no link, so no angle.
    drop = drawn_nodes.some_nodes()
    columns = {name: getattr(drop, name)[:, :1] for name in ("xy_px", "sigma_px", "area_px", "status")}
    rig = dataclasses.replace(drop.rig, nodes=drop.rig.nodes[:1], bodies=("upper",), joints=())
    dataclasses.replace(drop, rig=rig, **columns).write(at / "dot.parquet")
    one = str(at / "dot.parquet")
    first, second = (noisy(at / f"{k}.parquet", k, ALL_TERMS, 5.0) for k in (21, 22))
    quiet = ["--quiet"]
    compared = ["compare", str(at / "motion.parquet")]
    calibration = ["--calibration", str(DEMO / "calibration")]
    unasked = ["--no-comparison", "--no-prediction", *quiet]
    return [
        ["angles", str(at / "gap.parquet"), "-o", "OUT/gap.csv", "--gaps", "stop", "--zero", "0,0"],
        ["angles", str(at / "whole.parquet"), "-o", "OUT/whole.csv"],
        [*compared, str(at / "lacking.csv"), *calibration, "-o", "OUT/lacking"],
        [*compared, str(DEMO / "encoder.csv"), *calibration, "-o", "OUT/compared"],
        # Converged, with laws that are wrong; not converged.
        ["fit", first, "--laws", "mu_v1,mu_v2", "-o", "OUT/few", *unasked],
        ["fit", str(at / "creeping.csv"), "--start", "0", "--stop", "2.9", "--laws", "mu_v1", "-o", "OUT/c", *unasked],
        ["analyse", first, second, "-o", "OUT/two", *quiet, "--intervals", "profile", "--laws", "paper"],
        ["analyse", str(at / "whole.parquet"), "-o", "OUT/nodes", "--laws", "mu_v1,mu_v2", *unasked],
        ["analyse", first, "-o", "OUT/energy", "--method", "energy", "--laws", "mu_v1,mu_v2", *quiet],
        ["analyse", str(at / "straight.parquet"), "-o", "OUT/straight", *quiet],
        ["analyse", one, "-o", "OUT/dot", *quiet],
        ["analyse", one, "-o", "OUT/dot", *quiet],
    ]  # fmt: skip


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], dict[str, Any]]:
    """What comes of the commands with the program's words and with others."""
    at = tmp_path_factory.mktemp("words")
    (at / "commands.json").write_text(json.dumps(prepared(at)), encoding="utf-8")
    found = []
    for words in ("plain", "other"):
        (at / words).mkdir()
        done = subprocess.run(
            [sys.executable, "-m", "tests.support.reworded", words, str(at)],
            cwd=ROOT,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr[-3000:]
        found.append(json.loads(done.stdout))
    return found[0], found[1]


def test_exit_statuses_do_not_depend_on_words(both: tuple[dict[str, Any], dict[str, Any]]) -> None:
    plain, other = both
    assert plain["statuses"] == other["statuses"], (plain["said"], other["said"])
    # Both kinds of end are among them.
    assert plain["statuses"] == [1, 0, 1, 0, 0, 1, 0, 0, 0, 1, 0, 0], plain["said"]


def test_pages_do_not_depend_on_words(both: tuple[dict[str, Any], dict[str, Any]]) -> None:
    plain, other = both
    assert plain["pages"] == other["pages"]
    warnings = {name: page[0] for name, page in plain["pages"].items()}
    assert warnings["two"] >= 1
    assert warnings["straight"] >= 1


def test_the_words_are_others(both: tuple[dict[str, Any], dict[str, Any]]) -> None:
    plain, other = both
    for a, b in zip(plain["said"], other["said"], strict=True):
        assert a != b
