"""`pydpend states` on angles and on nodes."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pyarrow.csv as csv
import pyarrow.parquet as pq
import pydpend as dp
import pytest
from pydpend.cli import main

from tests.support import linkages
from tests.unit.test_ring_down import swing


def test_the_states_of_a_single_pendulum_with_its_period_and_q(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    dp.write_angles(swing(30, 20.0, 0.2, a=0.03), tmp_path / "a.parquet")
    out = str(tmp_path / "s.csv")
    assert main(["states", str(tmp_path / "a.parquet"), "-o", out]) == 0
    said = capsys.readouterr().out
    assert "period of small ones 1.1" in said
    assert "damping of the amplitude: viscous 0.0" in said
    assert "Q 9" in said
    table = csv.read_csv(out)
    assert table.column_names[:4] == ["time_s", "phi1_rad", "w1_rad_s", "a1_rad_s2"]
    assert main(["states", str(tmp_path / "a.parquet"), "-o", out, "--force", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["swing"]["q"] == pytest.approx(np.pi / 0.033, rel=0.03)


def test_the_states_of_named_links(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    made = linkages.four_bar(31, 600)
    found = dp.angles(made.nodes(31), "linkage", zero="vertical")
    dp.write_angles(found, tmp_path / "a.parquet")
    out = str(tmp_path / "s.parquet")
    assert main(["states", str(tmp_path / "a.parquet"), "-o", out]) == 0
    table = pq.read_table(out)
    rate = np.gradient(made.phi_rad[:, 1], made.t_s)
    error = (table["w_coupler_rad_s"].to_numpy() - rate)[20:-20]
    assert np.sqrt(np.mean(error**2)) < 0.05
    assert "sigma_a_rocker_rad_s2" in table.column_names
    assert main(["states", str(tmp_path / "a.parquet"), "-o", out, "--force", "--link", "crank"]) == 0
    assert "no period is told" in capsys.readouterr().err


def test_the_states_of_points_in_metres(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    made = linkages.four_bar(32, 800)
    made.nodes(32).write(tmp_path / "n.parquet")
    out = str(tmp_path / "p.parquet")
    command = ["states", str(tmp_path / "n.parquet"), "-o", out, "--points", "n1,B"]
    assert main([*command, "--scale", "A-D=0.2100", "--scale", "n0-n1=0.0470"]) == 0
    assert "scale 1 +- " in capsys.readouterr().out
    table = pq.read_table(out)
    assert {"x_n1_m", "vy_B_m_s", "ax_n1_m_s2", "sigma_vx_B_m_s", "speed_B_m_s"} <= set(table.column_names)
    pin = made.joints[2][2] / 1000
    speed = np.hypot(*np.gradient(pin, made.t_s, axis=0).T)
    error = (table["speed_B_m_s"].to_numpy() - speed)[30:-30]
    assert np.sqrt(np.mean(error**2)) < 0.01 * speed.mean()
    pull = (table["x_B_m"].to_numpy() - (pin[:, 0] - 0.18)) / table["sigma_x_B_m"].to_numpy()
    assert np.sqrt(np.mean(pull[30:-30] ** 2)) < 2.5
    assert main([*command, "--force", "--scale", "n0-n1=0.05", "--scale", "A-D=0.2100,1e-6"]) == 0
    for line, message in (
        (["--scale", "n0n1"], "'n0n1' does not name two points and their distance"),
        (["--link", "crank"], "is a node table, which has no angles"),
        (["--origin", "n1"], "n1 moves by"),
    ):
        assert main([*command, "--force", *line]) == 2
        assert message in capsys.readouterr().err
