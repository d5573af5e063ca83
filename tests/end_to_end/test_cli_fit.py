"""`pydpend fit` and `pydpend predict` as a user runs them: results on short simulated decays, bad input in words."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from pydpend.cli import main
from pydpend.damping import DampingFit
from pydpend.energy import Motion
from pydpend.kinematics import LinkAngles
from pydpend.model import Damping, read_model
from pydpend.report import damping as report_damping
from pydpend.report.page import Heading
from pydpend.run_folder import StoredRun
from pydpend.simulation import simulate

from tests.support.free_decays import measured, released


def command(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    """Runs the real program."""
    return subprocess.run(
        [str(Path(sys.executable).with_name("pydpend")), *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
    )


def written(angles: LinkAngles, path: Path) -> Path:
    """A plain table of times and angles."""
    table = np.column_stack([angles.t_s, angles.phi_rad])
    head = ",".join(["time_s", *(f"phi{j + 1}_rad" for j in range(angles.links))])
    np.savetxt(path, table, delimiter=",", header=head, comments="", fmt="%.9g")
    return path


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two recordings of one pendulum and a fit to both."""
    at = tmp_path_factory.mktemp("fit")
    for seed in (21, 22):
        written(measured(released(seed, 6.0, 500.0), seed, 0.05, stated=False), at / f"{seed}.csv")
    done = command("fit", at / "21.csv", at / "22.csv", "--laws", "paper", "-o", at / "out", "--quiet")
    assert done.returncode == 0, done.stderr
    (at / "said.txt").write_text(done.stdout)
    return at


def test_a_fit_of_two_recordings_writes_everything(folder: Path) -> None:
    out = folder / "out"
    names = {p.name for p in out.iterdir()}
    assert {"fit.json", "coefficients.csv", "trials.json", "trials.png", "shares.png"} <= names
    assert {"energy-1.csv", "energy-2.csv", "energy-1.png", "energy-2.png"} <= names
    left = np.genfromtxt(out / "residuals-2.csv", delimiter=",", names=True)
    assert left.dtype.names == (
        "time_s", "phi1_residual_rad", "phi1_sigma_rad", "phi2_residual_rad", "phi2_sigma_rad"
    )  # fmt: skip
    # 2500 samples of 0.05 deg noise: their RMS scatters by 1/sqrt(2*2500) = 1.4 %; four of these
    assert np.degrees(left["phi2_residual_rad"].std()) == pytest.approx(0.05, rel=0.06)
    fit = json.loads((out / "fit.json").read_text())
    # 12000 angles: chi-square scatters by 0.013; four of these
    assert abs(fit["chi2"] - 1) < 0.052
    assert set(fit["prediction"]) == {"0.5", "1", "2"}
    # Each of the paper's laws made these data; drag of the upper link shows most.
    assert set(fit["terms"]) == set(fit["coefficients"])
    assert fit["terms"]["mu_q1"]["verdict"] == "asked_for"
    said = (folder / "said.txt").read_text()
    assert "mu_q1" in said
    assert "chi-square" in said
    assert "small oscillations" in said


def test_profile_intervals_are_written_and_said(folder: Path) -> None:
    options = ["--laws", "mu_q1,mu_q2", "--ratios", "fixed", "--intervals", "profile"]
    options += ["--no-prediction", "--no-comparison", "--no-figures", "--quiet"]
    done = command("fit", folder / "21.csv", "-o", folder / "profile", *options)
    assert done.returncode == 0, done.stderr
    fit = json.loads((folder / "profile" / "fit.json").read_text())
    for name, interval in fit["intervals"].items():
        assert interval["low"] < fit["coefficients"][name]["value"] < interval["high"]
        assert f"{name} is within {interval['low']:.4e} to" in done.stdout


def test_trials_agree_and_their_mean_lies_between(folder: Path) -> None:
    trials = json.loads((folder / "out" / "trials.json").read_text())
    assert "agree" in trials["message"]
    for spread in trials["coefficients"].values():
        assert min(spread["values"]) <= spread["mean"] <= max(spread["values"])
        assert 0.001 < spread["p_value"] <= 1


def test_each_file_of_a_fit_or_a_prediction_stops_the_next(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Two recordings with figures; what is there is asked before anything is fitted."""
    two = ["fit", str(folder / "21.csv"), str(folder / "22.csv"), "--laws", "paper", "-o", str(tmp_path)]
    one = ["predict", str(folder / "21.csv"), "--fit", str(folder / "out"), "-o", str(tmp_path)]
    made = {p.name for p in (folder / "out").iterdir()}
    assert len(made) == 11
    for words, names in ((two, made), (one, {"predict.json", "windows.csv", "windows.png"})):
        for name in names:
            (tmp_path / name).write_text("mine")
            assert main([*words, "--quiet"]) == 2
            assert (
                f"{tmp_path / name}: it is there already. Choose another name, or replace it with --force"
                in (capsys.readouterr().err)
            )
            assert (tmp_path / name).read_text() == "mine"
            (tmp_path / name).unlink()
    (tmp_path / "windows.csv").write_text("mine")
    assert main([*one, "--quiet", "--windows", "1", "--force"]) == 0
    assert (tmp_path / "windows.csv").read_text().startswith("window_s,")


def test_prediction_of_an_unseen_recording_is_its_noise(folder: Path) -> None:
    written(measured(released(23, 6.0, 500.0), 23, 0.05), folder / "23.csv")
    done = command("predict", folder / "23.csv", "--fit", folder / "out", "-o", folder / "p", "--quiet")
    assert done.returncode == 0, done.stderr
    out = json.loads((folder / "p" / "predict.json").read_text())
    for window in ("0.5", "1", "2"):
        # noise 0.05 deg, less what the fitted states take up, more what the coefficients' errors add
        assert all(0.045 < v < 0.06 for v in out["in_window"][window]["rms_deg"]), window
    assert {"windows.csv", "windows.png"} <= {p.name for p in (folder / "p").iterdir()}


def test_bad_input_is_refused_in_words(folder: Path, tmp_path: Path) -> None:
    still = LinkAngles(np.arange(2000) / 500, np.zeros((2000, 2)), np.full((2000, 2), 1e-3))
    good = measured(released(21, 6.0, 500.0), 21, 0.05, stated=False)
    gaps = good.phi_rad.copy()
    gaps[(np.arange(len(gaps)) % 400) > 20] = np.nan  # 0.76 s of 0.8 s not seen
    holed = LinkAngles(good.t_s, gaps, np.full_like(gaps, np.nan))
    cases = {
        "no free decay": (written(still, tmp_path / "still.csv"), []),
        "at least one second": (folder / "21.csv", ["--stop", "0.7"]),
        "fewer gaps": (written(holed, tmp_path / "gaps.csv"), []),
        "is not a coefficient": (folder / "21.csv", ["--laws", "mu_x"]),
        "Check the units": (folder / "21.csv", ["--model", str(_thousandfold(tmp_path))]),
        "goes up and down": (folder / "21.csv", ["--model", "published"]),
        "--intervals: is an option": (
            folder / "21.csv",
            ["--method", "energy", "--intervals", "profile"],
        ),
        "not pinned": (folder / "21.csv", ["--pinned"]),
    }
    for words, (path, options) in cases.items():
        done = command("fit", path, "-o", tmp_path / "none", "--quiet", *options)
        assert done.returncode == 2, (words, done.stdout)
        assert words in done.stderr, done.stderr
        assert "Traceback" not in done.stderr
        assert not (tmp_path / "none").exists()
    done = command("predict", folder / "21.csv", "--fit", tmp_path, "-o", tmp_path / "none")
    assert done.returncode == 2
    assert "it is a folder of tables, not a damping fit" in done.stderr


def test_a_single_pendulum_with_a_model_of_one_link(folder: Path, tmp_path: Path) -> None:
    bar = tmp_path / "bar.toml"
    bar.write_text('[[part]]\nname = "bar"\nbody = 1\nmass_kg = 0.4\ninertia_kg_m2 = 3e-3\nplace_m = 0.12\n')
    constants = tmp_path / "constants.toml"
    constants.write_text("[constants]\npsi_kg_m2 = 4.38e-3\nsigma_j = 0.47088\nm1_kg = 0.4\n")
    model = read_model(bar)
    # 2 psi = 3e-3 + 0.4 * 0.12^2 kg m2 and sigma = 0.4 * 9.81 * 0.12 J
    assert model.links == 1
    assert read_model(constants).constants() == pytest.approx(model.constants(), rel=1e-12)
    truth = Damping(mu_v1=5e-5, mu_q1=4e-5, rmu1=6e-5)
    # What stands for a lower link hangs at rest.
    made = simulate(model, truth, [np.pi - 0.06, 0.0, 0.0, 0.0], np.arange(8001) / 500)
    motion = Motion(made.t_s, made.phi_rad, made.w_rad_s, made.a_rad_s2)
    both = measured(motion, 31, 0.02, stated=False)
    one = written(LinkAngles(both.t_s, both.phi_rad[:, :1], both.sigma_rad[:, :1]), tmp_path / "one.csv")
    options = ["--laws", "paper", "--no-figures", "--quiet"]
    done = command("fit", one, "--model", bar, "-o", tmp_path / "out", *options)
    assert done.returncode == 0, done.stderr
    fit = json.loads((tmp_path / "out" / "fit.json").read_text())
    assert fit["coefficients"].keys() == {"mu_v1", "mu_q1", "rmu1"}
    for name, found in fit["coefficients"].items():
        assert abs(found["value"] - getattr(truth, name)) < 3.5 * found["sigma"], name
        # Stated uncertainties that say nothing would pass the line above.
        assert found["sigma"] < 0.5 * getattr(truth, name), name
    # 8000 angles: chi-square scatters by 0.016; four of these
    assert abs(fit["chi2"] - 1) < 0.064
    cases: dict[str, tuple[str | Path, ...]] = {
        "angles of one link": ("fit", one, "--model", "derived"),
        "angles of two links": ("fit", folder / "21.csv", "--model", bar),
        "no elbow to pin": ("fit", one, "--model", bar, "--pinned"),
        "but the fit is of one. Give a table of one link": ("predict", folder / "21.csv", "--fit", tmp_path / "out"),
    }  # fmt: skip
    for words, arguments in cases.items():
        done = command(*arguments, "-o", tmp_path / "none", "--quiet")
        assert done.returncode == 2, (words, done.stdout)
        assert words in done.stderr, done.stderr
        assert not (tmp_path / "none").exists()


def test_the_papers_ten_coefficients_come_with_a_warning(tmp_path: Path) -> None:
    angles = written(measured(released(11, 16.0, 500.0), 11, 0.05, stated=False), tmp_path / "a.csv")
    options: list[str | Path] = [
        "--method",
        "energy",
        "--ten-coefficients",
        "--no-figures",
        "--quiet",
        "-o",
        tmp_path / "out",
    ]
    done = command("fit", angles, "--laws", "paper", *options)
    assert done.returncode == 0, done.stderr
    assert "only these sums are physical" in done.stdout
    assert "of ten: mu_c3_2" in done.stdout
    fit = json.loads((tmp_path / "out" / "fit.json").read_text())
    ten = fit["ten_coefficients"]
    assert len(ten["values"]) == 10
    assert min(v["value"] for v in ten["values"].values()) >= 0
    assert 6 <= ten["rank"] <= 10
    assert "arbitrary" in ten["warning"]
    # The six are the ten with four conditions, so the sums differ by less than the errors of the ten; four of these.
    for name, found in ten["rmu"].items():
        six = fit["coefficients"][name]["value"]
        assert abs(found["value"] - six) < 4 * found["sigma"], name
        assert found["sigma"] < 0.5 * six
        added = zip(ten["weights"][name], (1, 2, 3), strict=True)
        total = sum(w * ten["values"][f"mu_c{i}_{name[-1]}"]["value"] for w, i in added)
        assert total == pytest.approx(found["value"], rel=1e-9)
    stored = DampingFit.from_json((tmp_path / "out" / "fit.json").read_text())
    run = StoredRun(tmp_path, "", "", {}, {}, {}, {}, (), {}, ())
    headings = [
        block.text
        for section in report_damping.sections(run, stored, {})
        for block in section.blocks
        if isinstance(block, Heading)
    ]
    assert headings == ["Constants of the motion", "The paper's ten coefficients"]
    refused = command("fit", angles, *options)
    assert refused.returncode == 2
    assert "--laws paper" in refused.stderr


def _thousandfold(folder: Path) -> Path:
    """The paper's constants with weights in mJ."""
    path = folder / "milli.toml"
    path.write_text(
        "[constants]\npsi_kg_m2 = 3.431e-3\nlambda_kg_m2 = 4.193e-4\na3_kg_m2 = 1.4257e-3\nsigma_j = 450.2\n"
        "kappa_j = 81.36\nl1_m = 0.1719\n"
    )
    return path
