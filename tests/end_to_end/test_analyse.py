"""One call from the bundled film to a report: the numbers are the truth's, nothing is done twice."""

from __future__ import annotations

import hashlib
import json
import re
import shutil
import signal
import subprocess
import sys
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pydpend as dp
import pytest
from pydpend.analyse import Options, analyse, read_config, write_config
from pydpend.analyse.folder import RunFolder
from pydpend.cli import main, parser
from pydpend.errors import PydpendError
from pydpend.kinematics import read_angles
from pydpend.model import Damping, read_model
from pydpend.nodes import read_nodes
from pydpend.option_fields import flag_of
from pydpend.report import report_page
from pydpend.report.page import Table
from pydpend.simulation import simulate

from tests.support import drawn_nodes, two_links
from tests.unit.test_hanging import BAR, held

DEMO = Path(__file__).parent.parent.parent / "fixtures" / "demo"


def test_angles_are_the_truths(demo_run: Path) -> None:
    angles = read_angles(demo_run / "drop" / "angles.parquet")
    motion = pq.read_table(DEMO / "motion.parquet")
    truth = np.column_stack([motion["phi1_rad"].to_numpy(), motion["phi2_rad"].to_numpy()])
    error = angles.phi_rad - truth
    error -= 2 * np.pi * np.round(np.nanmedian(error, axis=0) / (2 * np.pi))
    # H.264 at this size costs 0.04 px a centre; a link of 100 px baseline and three markers or more then has
    # 0.02-0.03 deg. A lost turn or a swapped marker would be degrees.
    assert (np.degrees(np.sqrt(np.nanmean(error**2, axis=0))) < 0.05).all()
    assert np.nanmax(np.abs(np.degrees(error))) < 0.5
    assert np.isfinite(angles.phi_rad[-500:]).mean() > 0.9
    assert np.isfinite(angles.phi_rad).mean() > 0.95


def test_the_encoders_clock_and_gain_are_the_truths(demo_run: Path) -> None:
    found = json.loads((demo_run / "drop" / "comparison.json").read_text("utf-8"))
    truth = json.loads((DEMO / "truth.json").read_text("utf-8"))["encoder"]
    off = found["clocks"]["offset_s"] + truth["clock_offset_s"]
    assert abs(off) < 4 * found["clocks"]["offset_sigma_s"]
    assert abs(found["gain"] - 1) < 4 * found["gain_sigma"]
    # 2.5 mV of noise at 0.65 V a turn.
    assert found["rms_deg"] == pytest.approx(2.5e-3 / 0.65 * 360, rel=0.05)


def test_damping_is_the_truths(demo_run: Path) -> None:
    fit = json.loads((demo_run / "fit" / "fit.json").read_text("utf-8"))
    truth = json.loads((DEMO / "truth.json").read_text("utf-8"))["damping"]
    assert fit["status"] == "converged"
    for name, c in fit["coefficients"].items():
        # Four standard errors: one film in 15 000 would fail for each coefficient; the bundled one is fixed.
        assert abs(c["value"] - truth.get(name, 0.0)) < 4 * c["sigma"], name
    for name in ("mu_v2", "mu_q2", "tau_c2", "tau_c1", "mu_q1"):
        assert fit["coefficients"][name]["value"] == pytest.approx(truth[name], rel=0.05), name


def test_a_second_run_keeps_everything_and_a_change_only_what_it_does_not_touch(
    demo_run: Path, demo_options: Options
) -> None:
    assert set(analyse(demo_options, demo_run).stages.values()) == {"kept"}
    changed = analyse(replace(demo_options, laws="paper"), demo_run)
    assert {k: v for k, v in changed.stages.items() if v != "kept"} == {"fit": "done"}
    (demo_run / "drop" / "comparison.json").unlink()
    again = analyse(replace(demo_options, laws="paper"), demo_run)
    assert {k: v for k, v in again.stages.items() if v != "kept"} == {"drop/encoder": "done"}
    assert analyse(demo_options, demo_run).stages["fit"] == "done"


def test_another_frame_rate_is_tracked_anew(demo_run: Path, tmp_path: Path) -> None:
    rig = str(demo_run / "drop" / "zero_rig.toml")
    film = Options(inputs=(str(DEMO / "hanging.mp4"),), rig=rig, overlay=False)
    analyse(film, tmp_path / "run")
    first = read_nodes(tmp_path / "run" / "hanging" / "nodes.parquet")
    assert analyse(replace(film, fps=250.0), tmp_path / "run").stages["hanging/track"] == "done"
    second = read_nodes(tmp_path / "run" / "hanging" / "nodes.parquet")
    assert second.t_s[-1] == pytest.approx(4 * first.t_s[-1])


def test_a_players_rate_is_said_with_its_factor(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    t = np.arange(60) / 30
    phi = np.stack([0.4 * np.sin(3 * t), 0.5 * np.sin(2 * t)], axis=1)
    film = dp.film(
        "clean", tmp_path / "slow.mp4", motion=(t, phi), frames=60, rate_hz=30.0, x264_preset="ultrafast"
    )
    rig = tmp_path / "rig.toml"
    rig.write_text(film.rig_toml(), encoding="utf-8")
    words = [
        "analyse",
        str(tmp_path / "slow.mp4"),
        "--rig",
        str(rig),
        "--no-overlay",
        "-o",
        str(tmp_path / "run"),
    ]
    main(words)
    said = "if it was filmed at 240 frames per s, every rate is 8 times too small"
    assert [said in line for line in capsys.readouterr().err.splitlines()].count(True) == 1
    assert said in (tmp_path / "run" / "report.html").read_text("utf-8")


def command(options: Options, folder: Path) -> list[str]:
    config = folder.with_suffix(".toml")
    config.write_text(write_config(options), encoding="utf-8")
    return [
        str(Path(sys.executable).with_name("pydpend")),
        "analyse",
        "--config",
        str(config),
        "-o",
        str(folder),
    ]


def stopped_in(words: list[str], stage: int, how: signal.Signals) -> tuple[int, str]:
    """Starts the command, sends the signal as soon as it says that it is in the stage; exit status and words."""
    with subprocess.Popen(words, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True) as process:
        assert process.stderr is not None
        said = ""
        for line in process.stderr:
            said += line
            if line.startswith(f"[{stage}/") and line.endswith("...\n"):
                process.send_signal(how)
        return process.wait(), said


def assert_whole(folder: Path) -> None:
    """Every file that the record names is there, as it says, and can be read."""
    record = json.loads((folder / "run.json").read_text("utf-8"))
    for stage in record["stages"].values():
        for name, sha256 in stage["files"].items():
            path = folder / name
            assert hashlib.sha256(path.read_bytes()).hexdigest() == sha256, name
            if path.suffix == ".parquet":
                pq.read_table(path)
            elif path.suffix == ".json":
                json.loads(path.read_text("utf-8"))
    known = {name for stage in record["stages"].values() for name in stage["files"]}
    for path in folder.rglob("*"):
        name = path.relative_to(folder).as_posix()
        # Besides what is recorded: what the tracker goes on with, and the stage that was stopped.
        if path.is_file() and name not in known | {"run.json", "report.html", "README.txt"}:
            assert name.startswith(("unfinished/", "drop/nodes.parquet")), name


def test_stopped_in_every_stage_and_gone_on_with(
    demo_run: Path, demo_options: Options, tmp_path: Path
) -> None:
    folder = tmp_path / "demo"
    words = command(demo_options, folder)
    stages = list(json.loads((demo_run / "run.json").read_text("utf-8"))["stages"])
    count = len(stages)
    begun = 0
    for stage in range(1, count + 2):
        # Killed in each; where compiled code runs for long, by Ctrl-C too.
        title = "" if stage > count else stages[stage - 1]
        both = title.endswith(("/track", "/overlay")) or title == "fit"
        for how, status in ((signal.SIGKILL, -signal.SIGKILL), (signal.SIGINT, 130))[: 1 + both]:
            code, said = stopped_in(words, stage, how)
            assert code == status, said
            assert "Traceback" not in said
            assert said.count(": kept") == begun, said
            begun = stage - 1
            assert_whole(folder)
    done = subprocess.run(words, stderr=subprocess.PIPE, text=True, check=True)
    assert done.stderr.count(": kept") == count
    for name in ("drop/nodes.parquet", "drop/angles.parquet", "drop/comparison.json", "fit/fit.json"):
        once, again = (hashlib.sha256((at / name).read_bytes()).hexdigest() for at in (demo_run, folder))
        assert once == again, name


def test_the_page_has_every_part(demo_run: Path) -> None:
    page = report_page(demo_run)
    ids = {s.id for s in page.sections}
    assert {"answer", "r0-angles", "r0-nodes", "r0-encoder", "damping", "identifiability", "reproduce"} <= ids
    html = (demo_run / "report.html").read_text("utf-8")
    assert "http://" not in html.replace("http://www.w3.org", "")
    assert len(html) < 25e6


def test_a_stage_that_cannot_be_done_says_why_and_the_rest_is_there(tmp_path: Path) -> None:
    table = tmp_path / "still.csv"
    rows = [f"{i / 500},0.0,0.0" for i in range(2000)]
    table.write_text("time_s,phi1_rad,phi2_rad\n" + "\n".join(rows) + "\n", encoding="utf-8")
    assert main(["analyse", str(table), "-o", str(tmp_path / "run"), "--quiet"]) == 1
    record = json.loads((tmp_path / "run" / "run.json").read_text("utf-8"))
    assert "fit" in record["facts"]["not_done"]
    assert any(w.startswith("Damping fit: ") for w in report_page(tmp_path / "run").warnings)


def test_a_fit_that_did_not_converge_is_said(demo_run: Path, demo_options: Options, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    shutil.copytree(demo_run, folder)
    fit = folder / "fit" / "fit.json"
    fit.write_text(fit.read_text("utf-8").replace('"converged"', '"stalled"', 1), encoding="utf-8")
    record = folder / "run.json"
    content = json.loads(record.read_text("utf-8"))
    content["stages"]["fit"]["files"]["fit/fit.json"] = hashlib.sha256(fit.read_bytes()).hexdigest()
    record.write_text(json.dumps(content), encoding="utf-8")
    outcome = analyse(demo_options, folder)
    assert set(outcome.stages.values()) == {"kept"}
    assert (outcome.status, outcome.message) == ("partly", "the damping fit did not converge")
    assert report_page(folder).warnings[0].startswith("The damping fit did not converge")


def test_config_there_and_back(tmp_path: Path, demo_options: Options) -> None:
    path = tmp_path / "run.toml"
    path.write_text(write_config(demo_options), encoding="utf-8")
    assert read_config(path) == demo_options
    path.write_text("inputz = []\n", encoding="utf-8")
    with pytest.raises(PydpendError, match="inputz is not an option"):
        read_config(path)
    path.write_text("fps = 'fast'\n", encoding="utf-8")
    with pytest.raises(PydpendError, match="key fps"):
        read_config(path)


def test_a_config_says_whatever_a_flag_can(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    trajectory: dict[str, object] = {
        "inputs": ("a b.mp4", 'c"d.csv'), "rig": "r.toml", "fps": 1000.5, "encoder": "e.csv", "column": "V 1",
        "time_column": "t 1", "rate_hz": 1000.0, "unit": "deg", "bodies": "b0,b1", "mirrored": True, "clockwise": True,
        "unwrap": True,
        "calibration": "holds", "model": "m.toml", "laws": "mu_v1,tau_c1", "ratios": "fixed", "free": "tilt,offset1",
        "clock": True, "intervals": "profile", "comparison": False, "prediction": False, "start_s": 1.5, "stop_s": 9.0,
        "angle_maps": True, "zero": "-178,-182", "link_length_m": 0.17, "estimator": "linkage",
        "columns": "time_s=t", "hanging_deg": -180.0, "overlay": False, "threads": 3, "pixel_aspect": "4:3",
        "marker": ("3,4@5", "6.5,7"), "markers": 2, "also": "2,3", "same": ("n1=n2",), "decoder": "opencv",
        "interlaced": "as-frames", "allow_protocol": True, "frames": "0..9", "threshold": 120.0, "polarity": "dark",
        "axis": ("upper=pivot-elbow", "lower=n3-n4"), "pivot": ("upper=1,2", "lower=3,4"), "scale": ("n0-n1=0.1",),
        "origin": "pivot", "points": "n0,n1", "centroid": "contour", "region": "0,1,20,30",
        "min_area_px": 5.0, "max_area_px": 500.0, "edits": "film.edits.toml",
    }  # fmt: skip
    energy: dict[str, object] = {"method": "energy", "laws": "paper", "ten_coefficients": True}
    single: dict[str, object] = {"pinned": True}
    plain = Options()
    for given in (trajectory, energy, single):
        assert all(value != getattr(plain, name) for name, value in given.items())
        words = ["analyse", "--write-config"]
        for name, value in given.items():
            if name == "inputs":
                words += list(value) if isinstance(value, tuple) else []
            elif isinstance(value, tuple):
                words += [f"{flag_of(name)}={one}" for one in value]
            elif isinstance(value, bool):
                words.append(flag_of(name) if value else flag_of(name).replace("--", "--no-", 1))
            else:
                words.append(f"{flag_of(name)}={value}")
        assert main(words) == 0
        (tmp_path / "run.toml").write_text(capsys.readouterr().out, encoding="utf-8")
        # A dict of options of several types: what each may be is what the test is about.
        assert read_config(tmp_path / "run.toml") == Options(**given)  # type: ignore[arg-type]
    assert set(trajectory) | set(energy) | set(single) == {f.name for f in fields(Options)}
    # Every other flag says how to run, not what.
    flags = set(vars(parser().parse_args(["analyse"]))) - {"command", "run"}
    how = {"output", "config", "write_config", "dry_run", "json", "quiet"}
    assert flags == set(trajectory) | set(energy) | set(single) | how


def test_whatever_a_fit_can_be_told_an_analysis_can() -> None:
    fit, analysis = (
        set(vars(parser().parse_args(words))) for words in (["fit", "a", "-o", "b"], ["analyse"])
    )
    # Under another name, or of how to run; figures are always drawn, and a run folder is gone on with.
    other = {"angles", "no_figures", "force"}
    assert fit - analysis == other
    assert "inputs" in analysis


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"ratios": "loose"}, "ratios: 'loose' is not known. Give free or fixed"),
        ({"free": "tilt,wind"}, "free: 'wind' is not known. Give offset1, offset2, added_inertia or tilt"),
        ({"ten_coefficients": True}, "give method='energy' and laws='paper'"),
        (
            {"method": "energy", "intervals": "profile"},
            "intervals: is an option of the trajectory fit, and the method is energy",
        ),
        ({"method": "energy", "angle_maps": True}, "angle_maps: is an option of the trajectory fit"),
    ],
)
def test_options_that_make_no_sense_are_named(wrong: dict[str, object], words: str) -> None:
    with pytest.raises(PydpendError) as caught:
        # A dict of options of several types, wrong on purpose.
        Options(**wrong)  # type: ignore[arg-type]
    assert words in str(caught.value)


def test_a_single_pendulum(tmp_path: Path) -> None:
    """Of one link, with its model: its own laws, and nothing on the page of a lower one."""
    bar = tmp_path / "bar.toml"
    bar.write_text("[constants]\npsi_kg_m2 = 4.38e-3\nsigma_j = 0.47088\nm1_kg = 0.4\n", encoding="utf-8")
    truth = Damping(mu_v1=5e-5, mu_q1=4e-5)
    made = simulate(read_model(bar), truth, [np.pi - 0.06, 0.0, 0.0, 0.0], np.arange(6001) / 500)
    phi = made.phi_rad[:, 0] + np.random.default_rng(3).normal(0.0, np.radians(0.02), made.t_s.size)
    for name, rows in (("one", slice(0, 3500)), ("two", slice(2500, 6001))):
        table = np.column_stack([made.t_s[rows], phi[rows]])
        np.savetxt(tmp_path / f"{name}.csv", table, delimiter=",", header="time_s,phi1_rad", comments="")
    inputs = tuple(str(tmp_path / f"{name}.csv") for name in ("one", "two"))
    outcome = analyse(
        Options(inputs=inputs, model=str(bar), laws="mu_v1,mu_q1", comparison=False, start_s=0.0),
        tmp_path / "run",
    )
    assert outcome.status == "done", outcome.stages
    fit = json.loads((tmp_path / "run" / "fit" / "fit.json").read_text("utf-8"))
    for name, c in fit["coefficients"].items():
        assert abs(c["value"] - getattr(truth, name)) < 4 * c["sigma"], name
    html = (tmp_path / "run" / "report.html").read_text("utf-8")
    assert "phi1" in html
    assert "phi2" not in html
    assert "lower" not in html.split("<script")[0]
    # Without its masses there is a page all the same, and it says what is missing.
    alone = analyse(Options(inputs=inputs[:1]), tmp_path / "alone")
    assert (alone.status, alone.message) == ("done", "every stage that applies is done (not: Damping fit)")
    assert "need the model of one link" in alone.reasons["fit"]


def test_a_zero_by_the_vertical_and_how_far_it_was_off_are_in_the_report(tmp_path: Path) -> None:
    """A bar held and let go, the camera rolled by 20 deg, which is more than five times what is stated."""
    t, phi = held((40.0,), 6.0, damping=Damping(mu_v1=2e-4, tau_c1=1e-3))
    roll = np.radians(20.0)
    nodes = two_links.film(t, phi + roll, 75, reference_rad=(roll, roll))
    replace(nodes, meta=drawn_nodes.META).write(tmp_path / "held.parquet")
    constants = f"psi_kg_m2 = {BAR.psi_kg_m2}\nsigma_j = {BAR.sigma_j}\nm1_kg = {BAR.m1_kg}"
    (tmp_path / "bar.toml").write_text(f"[constants]\n{constants}\n", encoding="utf-8")
    options = Options(
        inputs=(str(tmp_path / "held.parquet"),), zero="vertical=1", model=str(tmp_path / "bar.toml"), comparison=False,
        prediction=False, laws="mu_v1,tau_c1", start_s=1.1,
    )  # fmt: skip
    outcome = analyse(options, tmp_path / "run")
    assert outcome.status == "done", outcome
    page = report_page(tmp_path / "run")
    assert any("the swing goes about a direction about" in w for w in page.warnings), page.warnings
    rows = [row for block in page.sections[0].blocks if isinstance(block, Table) for row in block.rows]
    # The roll that the swing shows, beside the 3 deg that are stated of 1.
    (said,) = [row[1] for row in rows if row[0] == "zero of the angles"]
    assert re.fullmatch(r"the picture.s vertical, ± (19|20) deg", said), said
    fit = json.loads((tmp_path / "run" / "fit" / "fit.json").read_text("utf-8"))
    assert fit["inputs"][0]["zeros_deg"][0] == pytest.approx(20, abs=3.0)
    found = fit["coefficients"]["mu_v1"]
    assert abs(found["value"] - 2e-4) < 4 * found["sigma"]


def test_angles_of_anyone_are_enough_and_json_and_dry_run_tell_what_is_done(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["analyse", str(DEMO / "motion.parquet"), "-o", str(tmp_path / "run"), "--json"]
    assert main([*words, "--dry-run"]) == 0
    assert json.loads(capsys.readouterr().out) == {
        "motion/angles": "to do",
        "motion/states": "to do",
        "fit": "to do",
    }
    assert not (tmp_path / "run").exists()
    assert main([*words, "--quiet"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["status"] == "done"
    assert told["stages"] == {"motion/angles": "done", "motion/states": "done", "fit": "done"}
    assert (tmp_path / "run" / "README.txt").read_text("utf-8").startswith("A run of pydpend")
    assert main([*words, "--dry-run", "--laws", "paper"]) == 0
    assert json.loads(capsys.readouterr().out) == {
        "motion/angles": "kept",
        "motion/states": "kept",
        "fit": "to do",
    }


def test_a_folder_with_other_things_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "holiday.txt").write_text("x", encoding="utf-8")
    assert main(["analyse", str(DEMO / "motion.parquet"), "-o", str(tmp_path)]) == 2
    assert "not a run of pydpend" in capsys.readouterr().err
    with pytest.raises(PydpendError, match="not a run"):
        RunFolder.open(tmp_path)


def test_no_such_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["analyse", str(tmp_path / "none.mp4"), "-o", str(tmp_path / "run")]) == 2
    assert "no such file" in capsys.readouterr().err
    assert not (tmp_path / "run").exists()
