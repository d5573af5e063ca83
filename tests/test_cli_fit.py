"""`pydpend fit` and `pydpend predict` as a user runs them: results on short simulated decays, bad input in words."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from pydpend.angles import LinkAngles

from tests.free_decays import measured, released


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
    np.savetxt(path, table, delimiter=",", header="time_s,phi1_rad,phi2_rad", comments="", fmt="%.9g")
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
    assert fit["terms"]["mu_q1"]["verdict"] == "asked for"
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
    gaps[(np.arange(len(gaps)) % 150) > 20] = np.nan  # 0.26 s of 0.3 s not seen
    holed = LinkAngles(good.t_s, gaps, np.full_like(gaps, np.nan))
    cases = {
        "no free decay": (written(still, tmp_path / "still.csv"), []),
        "at least one second": (folder / "21.csv", ["--stop", "0.7"]),
        "fewer gaps": (written(holed, tmp_path / "gaps.csv"), []),
        "is not a coefficient": (folder / "21.csv", ["--laws", "mu_x"]),
        "Check the units": (folder / "21.csv", ["--model", str(_thousandfold(tmp_path))]),
        "goes up and down": (folder / "21.csv", ["--model", "published"]),
        "Use covariance": (folder / "21.csv", ["--method", "energy", "--intervals", "profile"]),
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
    assert "pydpend fit" in done.stderr


def _thousandfold(folder: Path) -> Path:
    """The paper's constants with weights in mJ."""
    path = folder / "milli.toml"
    path.write_text(
        "[constants]\npsi_kg_m2 = 3.431e-3\nlambda_kg_m2 = 4.193e-4\na3_kg_m2 = 1.4257e-3\nsigma_j = 450.2\n"
        "kappa_j = 81.36\nl1_m = 0.1719\n"
    )
    return path
