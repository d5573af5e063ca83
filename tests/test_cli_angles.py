"""`pydpend angles`, `calibrate` and `compare` from files to files, and their errors in one line."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydpend.angles import read_angles
from pydpend.cli import main

from tests import two_links

META: dict[str, Any] = {
    "schema_version": 1,
    "tool": "tests",
    "source": {
        "name": "drop.mp4",
        "container": "mp4",
        "codec": "h264",
        "width": 1280,
        "height": 1024,
        "depth_bits": 8,
        "rate_origin": "user",
        "time_base": [1, 500],
        "warnings": [],
    },
    "settings": {},
    "ending": {"kind": "complete"},
}


def write_encoder(path: Path, t: np.ndarray, volts: np.ndarray) -> None:
    np.savetxt(
        path, np.stack([t, volts], axis=1), delimiter=",", header="time_s,voltage_v", comments="", fmt="%.6f"
    )


def test_from_nodes_and_holds_to_the_comparison(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    t, phi = two_links.drop(8.0, 500.0, 70, rest_s=1.0)
    nodes = dataclasses.replace(two_links.film(t, phi, 70), meta=META)
    nodes.write(tmp_path / "drop.parquet")
    rng = np.random.default_rng(70)
    holds = tmp_path / "cal"
    holds.mkdir()
    for k in range(-3, 4):
        volts = 5 + 0.65 * k + 2.5e-3 * rng.standard_normal(500)
        write_encoder(holds / f"hold_{360 * k}deg.csv", np.arange(500) / 500, volts)
    te = np.arange(0, 10, 0.002)
    angle = np.interp(te + 0.25, t, phi[:, 0])
    write_encoder(
        tmp_path / "encoder.csv", te, 5 + 0.65 / (2 * np.pi) * angle + 2.5e-3 * rng.standard_normal(te.size)
    )

    angles, line, out = (
        str(tmp_path / "angles.parquet"),
        str(tmp_path / "encoder.json"),
        str(tmp_path / "out"),
    )
    figure = str(tmp_path / "angles.svg")
    assert main(["angles", str(tmp_path / "drop.parquet"), "-o", angles, "--figure", figure, "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["zero"]["from"] == "rest"
    assert summary["frames_with_angle"] == [t.size, t.size]
    np.testing.assert_allclose(read_angles(angles).phi_rad, phi, atol=0.005)
    assert (tmp_path / "angles.svg").read_text().lstrip().startswith("<?xml")

    assert main(["calibrate", str(holds), "-o", line, "--figure", str(tmp_path / "line.pdf")]) == 0
    assert "V per turn" in capsys.readouterr().out
    assert main(["compare", angles, str(tmp_path / "encoder.csv"), "--calibration", line, "-o", out]) == 0
    assert "explained by the encoder's noise" in capsys.readouterr().out
    found = json.loads((tmp_path / "out" / "compare.json").read_text())
    assert found["clocks"]["offset_s"] == pytest.approx(0.25, abs=5 * found["clocks"]["offset_sigma_s"])
    assert {p.name for p in (tmp_path / "out").iterdir()} == {
        "compare.json",
        "residuals.parquet",
        "compare.png",
        "angles.png",
        "calibration.png",
    }


def test_errors_are_one_line_and_exit_status_2(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    t = np.arange(800) / 500
    phi = np.stack([8 * np.sin(3 * t), 12 * np.sin(2 * t)], axis=1)
    dataclasses.replace(two_links.film(t, phi, 71), meta=META).write(tmp_path / "moving.parquet")
    bad = tmp_path / "bad.csv"
    bad.write_text("time_s,voltage_v\n0,5\n0.002,x\n")
    one = tmp_path / "hold_0deg.csv"
    write_encoder(one, np.arange(10) / 500, np.full(10, 5.0))
    out = str(tmp_path / "out.json")
    for command, message in (
        (["angles", str(tmp_path / "moving.parquet"), "-o", str(tmp_path / "a.csv")], "no stretch of 0.5 s"),
        (["angles", str(tmp_path / "none.parquet"), "-o", str(tmp_path / "a.csv")], "none.parquet"),
        (["calibrate", str(bad), str(one), "--angles-deg", "0,360", "-o", out], "line 3, column voltage_v"),
        (["calibrate", str(one), str(one), "--angles-deg", "0,0", "-o", out], "at one angle"),
        (["calibrate", str(one), str(one), "--angles-deg", "0;360", "-o", out], "list of numbers"),
    ):
        assert main(command) == 2
        error = capsys.readouterr().err
        assert message in error
        assert error.count("\n") == 1
    given = ["angles", str(tmp_path / "moving.parquet"), "-o", str(tmp_path / "a.csv"), "--zero=0,0"]
    assert main(given) == 0
    np.testing.assert_allclose(read_angles(tmp_path / "a.csv").phi_rad, phi, atol=0.02)


@pytest.mark.parametrize("ending", ["png", "svg", "pdf"])
def test_figure_12_in_every_format(tmp_path: Path, ending: str) -> None:
    from pydpend.plots.angles import methods_figure
    from pydpend.plots.style import save

    theta = np.linspace(0, 5, 300)
    xy = two_links.places(np.stack([theta, theta], axis=1))[:, 3:] * [1, -1]
    save(methods_figure(xy, 0.05), tmp_path / f"methods.{ending}")
    assert (tmp_path / f"methods.{ending}").stat().st_size > 5000
