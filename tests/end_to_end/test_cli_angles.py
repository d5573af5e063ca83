"""`pydpend angles`, `calibrate` and `compare` from files to files, and their errors in one line."""

from __future__ import annotations

import dataclasses
import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydpend.cli import main
from pydpend.kinematics import LinkAngles, read_angles, write_angles

from tests.support import two_links
from tests.unit.test_hanging import held

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


def test_a_hold_is_refused_with_the_flag_that_helps_and_the_vertical_is_stored_with_its_uncertainty(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    t, phi = held((40.0,), 2.0)
    dataclasses.replace(two_links.film(t, phi, 74), meta=META).write(tmp_path / "held.parquet")
    line = ["angles", str(tmp_path / "held.parquet"), "-o", str(tmp_path / "a.parquet")]
    assert main(line) == 2
    error = capsys.readouterr().err
    assert "held still at about 39 deg from the picture's vertical" in error
    assert "Give --zero vertical for the picture's vertical" in error
    assert error.count("\n") == 1
    assert main([*line, "--zero", "vertical=oops"]) == 2
    assert "vertical=0.5" in capsys.readouterr().err
    # Three markers on no straight line say to 2.8 deg which way their link points.
    for zero, sigma in (("vertical", 3.0), ("vertical=3", 4.2)):
        assert main([*line, "--zero", zero, "--force"]) == 0
        assert f"zero from the picture's vertical (+- {sigma:.2g} deg)" in capsys.readouterr().out
        stored = read_angles(tmp_path / "a.parquet").meta["zero"]
        assert np.degrees(stored["sigma_rad"]) == pytest.approx([sigma], abs=0.06)


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the angles of a swing, a calibration, and node tables with faults."""
    folder = tmp_path_factory.mktemp("lab")
    t = np.arange(1500) / 500
    phi = np.stack([2.5 * np.sin(4 * t) + 0.8 * t**2, 12 * np.sin(2 * t)], axis=1)
    write_angles(LinkAngles(t, phi, np.full(phi.shape, 1e-3)), folder / "angles.parquet")
    nodes = dataclasses.replace(two_links.film(t, phi, 72), meta=META)
    hidden = np.zeros((t.size, 9), dtype=bool)
    hidden[:, 3:] = True
    dataclasses.replace(two_links.film(t, phi, 72, hidden=hidden), meta=META).write(folder / "never.parquet")
    hidden[:] = False
    hidden[400:900, 3:] = True
    dataclasses.replace(two_links.film(t, phi, 72, hidden=hidden), meta=META).write(folder / "gap.parquet")
    nodes.write(folder / "nodes.parquet")
    rng = np.random.default_rng(72)
    for k in (-1, 0, 1):
        write_encoder(
            folder / f"hold_{360 * k}deg.csv",
            np.arange(400) / 500,
            5 + 0.65 * k + 2.5e-3 * rng.standard_normal(400),
        )
    holds = [str(folder / f"hold_{360 * k}deg.csv") for k in (-1, 0, 1)]
    assert main(["calibrate", *holds, "-o", str(folder / "encoder.json")]) == 0
    return folder


def readings(lab: Path, tmp_path: Path, change: Callable[[list[str]], list[str]]) -> Path:
    """The encoder's file of the lab's swing, its lines (the header first) changed."""
    angles = read_angles(lab / "angles.parquet")
    noise = 2.5e-3 * np.random.default_rng(73).standard_normal(angles.t_s.size)
    volts = 5 + 0.65 / (2 * np.pi) * angles.phi_rad[:, 0] + noise
    lines = [f"{a:.6f},{b:.6f}" for a, b in zip(angles.t_s, volts, strict=True)]
    file = tmp_path / "daq.csv"
    file.write_text("\n".join(change(["time_s,voltage_v", *lines])) + "\n")
    return file


def replaced(
    line: int, time: str | None = None, volts: str | None = None
) -> Callable[[list[str]], list[str]]:
    """Changes one line of the file, counted from 1."""

    def change(lines: list[str]) -> list[str]:
        a, b = lines[line - 1].split(",")
        return [
            *lines[: line - 1],
            f"{a if time is None else time},{b if volts is None else volts}",
            *lines[line:],
        ]

    return change


@pytest.mark.parametrize(
    ("change", "status", "message"),
    [
        (replaced(101, volts="five"), 2, "daq.csv, line 101, column voltage_v: 'five' is not a number"),
        (
            replaced(101, volts=""),
            1,
            "1 of 1500 samples have no value and were left out (the first: line 101, column v",
        ),
        (replaced(101, volts="NaN"), 1, "1 of 1500 samples have no value and were left out"),
        (
            replaced(101, time="0.196"),
            2,
            "daq.csv, line 101, column time_s: the time 0.196 s does not come after 0.196",
        ),
        (replaced(101, time=""), 2, "daq.csv, line 101, column time_s: there is no time"),
        (replaced(101, time="0.1987"), 0, "uneven steps"),
        (
            replaced(101, volts="12.5"),
            1,
            "1 readings beyond the range of 0 to 10 V (the first at 0.198 s); they are left",
        ),
        (
            replaced(101, volts="10.0"),
            1,
            "1 readings at a rail of 0 to 10 V, the angle is cut off there (the first at 0.198",
        ),
        (lambda lines: lines[:100] + lines[150:], 0, "1 gaps, the longest 0.102 s, after 0.196 s"),
        (lambda lines: lines[:1], 2, "daq.csv: there are no samples"),
        (
            lambda lines: ["zeit,volt", *lines[1:]],
            2,
            "daq.csv: there is no column time_s. The columns are zeit, volt",
        ),
        (
            lambda lines: [*lines[:100], "0.2", *lines[101:]],
            2,
            "daq.csv, line 101: 1 fields parted by commas, the header in line 1 has 2",
        ),
    ],
)
def test_an_encoder_file_with_faults(
    lab: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    change: Callable[[list[str]], list[str]],
    status: int,
    message: str,
) -> None:
    file = readings(lab, tmp_path, change)
    command = ["compare", str(lab / "angles.parquet"), str(file), "--calibration", str(lab / "encoder.json")]
    assert main([*command, "-o", str(tmp_path / "out"), "--format", "svg", "--json"]) == status
    out, error = capsys.readouterr()
    assert message in error
    if status == 2:
        assert error.count("\n") == 1
    else:
        found = json.loads(out)
        assert any(message in note for note in found["notes"])
        assert found["gain"] == pytest.approx(1.0, abs=5 * found["gain_sigma"])


@pytest.mark.parametrize(
    ("arguments", "status", "message"),
    [
        (["angles", "never.parquet", "-o", "a.csv"], 2, "no node of the body lower is ever seen"),
        (
            ["angles", "nodes.parquet", "-o", "a.csv", "--bodies", "upper,middle"],
            2,
            "there is no body 'middle'",
        ),
        (
            ["angles", "nodes.parquet", "-o", "a.txt", "--zero=0,0"],
            2,
            "a.txt: the ending '.txt' is not known",
        ),
        (
            ["angles", "nodes.parquet", "-o", "a.csv", "--zero=0,0", "--figure", "a.jpg"],
            2,
            "jpg is not a figure format",
        ),
        (
            ["angles", "gap.parquet", "-o", "a.csv", "--zero=0,0"],
            2,
            "frames 400 to 899, body lower: not seen for 1.002 s",
        ),
        (
            ["angles", "gap.parquet", "-o", "a.csv", "--zero=0,0", "--gaps", "stop"],
            1,
            "left out from there on",
        ),
        (
            ["calibrate", "hold_0deg.csv", "-o", "c.json", "--angles-deg", "0"],
            2,
            "1 hold (hold_0deg) is not enough",
        ),
        (
            ["calibrate", "hold_0deg.csv", "hold_360deg.csv", "-o", "c.json", "--angles-deg", "90,90"],
            2,
            "all 2 holds (hold_0deg, hold_360deg) are at one angle, 90 deg",
        ),
        (
            ["calibrate", "hold_0deg.csv", "-o", "c.json"],
            2,
            "hold_0deg.csv: one file is a calibration only if it has",
        ),
        (
            ["compare", "angles.parquet", "hold_0deg.csv", "-o", "d"],
            2,
            "it is in volts and there is no calibration",
        ),
        (
            ["compare", "angles.parquet", "hold_0deg.csv", "--calibration", "encoder.json", "-o", "d"],
            2,
            "no 1 s of common motion was found",
        ),
    ],
)
def test_commands_that_cannot_be_done_or_only_in_part(
    lab: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    arguments: list[str],
    status: int,
    message: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    for file in lab.iterdir():
        (tmp_path / file.name).symlink_to(file)
    assert main(arguments) == status
    error = capsys.readouterr().err
    assert message in error
    assert "Traceback" not in error
    assert status == 1 or error.count("\n") == 1


def test_the_program_itself(lab: Path, tmp_path: Path) -> None:
    program = [sys.executable, "-c", "import sys; from pydpend.cli import main; sys.exit(main())"]
    out = tmp_path / "angles.csv"
    done = subprocess.run(
        [*program, "angles", str(lab / "nodes.parquet"), "-o", str(out), "--zero=0,0", "--json"],
        capture_output=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["frames"] == 1500
    assert read_angles(out).phi_rad.shape == (1500, 2)
    failed = subprocess.run(
        [*program, "angles", str(lab / "never.parquet"), "-o", str(out), "--force"],
        capture_output=True,
        check=False,
    )
    assert failed.returncode == 2
    assert failed.stderr.startswith(b"pydpend: nodes: no node of the body lower is ever seen")


@pytest.mark.parametrize("ending", ["png", "svg", "pdf"])
def test_figure_12_in_every_format(tmp_path: Path, ending: str) -> None:
    from pydpend.plots.angles import methods_figure
    from pydpend.plots.style import save

    theta = np.linspace(0, 5, 300)
    xy = two_links.places(np.stack([theta, theta], axis=1))[:, 3:] * [1, -1]
    save(methods_figure(xy, 0.05), tmp_path / f"methods.{ending}")
    assert (tmp_path / f"methods.{ending}").stat().st_size > 5000


def test_a_zero_recording_that_was_a_hold_is_noted_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    still = np.arange(300) / 250, np.full((300, 2), np.radians(25.0))
    for name, motion in (("swing", held((50.0, 50.0), 3.0)), ("hold", still)):
        nodes = dataclasses.replace(two_links.film(motion[0], motion[1], 41), meta=META)
        nodes.write(tmp_path / f"{name}.parquet")
    command = ["angles", str(tmp_path / "swing.parquet"), "--zero", str(tmp_path / "hold.parquet")]
    assert main([*command, "-o", str(tmp_path / "a.csv")]) == 1
    said = capsys.readouterr()
    assert said.err.count("warning: the swing goes about a direction about 2") == 1
    assert said.err.count("the swing goes about") == 1
    assert "zero from reference recording (+- 2" in said.out
