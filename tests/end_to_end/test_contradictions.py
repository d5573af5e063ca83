"""Inputs that contradict themselves or each other are refused in one line: given twice, of the wrong name, too few."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from pydpend import energy
from pydpend.analyse.folder import Digests
from pydpend.analyse.options import Options
from pydpend.analyse.recordings import recordings
from pydpend.damping import fit_damping
from pydpend.encoder import (
    EncoderSignal,
    Hold,
    calibrate,
    compare,
    encoder_angles,
    read_calibration,
    read_encoder,
    read_holds,
)
from pydpend.errors import EncoderError, FitError, FitOptionError, PydpendError
from pydpend.fit_options import FitOptions
from pydpend.kinematics import LinkAngles, read_angles
from pydpend.model import derived

from tests.support.free_decays import measured, released
from tests.unit.test_compare import made

DEMO = Path(__file__).parents[2] / "fixtures" / "demo"


def command(*arguments: str | Path) -> str:
    """What the real program says on stderr when it refuses: one line, exit status 2."""
    done = subprocess.run(
        [str(Path(sys.executable).with_name("pydpend")), *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2, done.stdout + done.stderr
    assert done.stderr.count("\n") == 1, done.stderr
    return done.stderr


@pytest.mark.parametrize("below", ["", "deeper"])
@pytest.mark.parametrize("name", ["fit", "predict", "compare", "analyse"])
def test_results_do_not_go_into_a_file(name: str, below: str, tmp_path: Path) -> None:
    angles, file = tmp_path / "angles.csv", tmp_path / "file"
    angles.write_text("time_s,phi1_rad\n0,0\n1,0\n")
    file.write_text("mine")
    further: dict[str, list[str]] = {
        "predict": ["--fit", "nowhere"],
        "compare": [str(DEMO / "encoder.csv")],
    }
    more = further.get(name, [])
    said = command(name, angles, *more, "-o", file / below if below else file)
    assert f"{file}: " in said
    assert "folder" in said
    assert file.read_text() == "mine"


def test_the_column_of_the_times_is_no_encoder() -> None:
    for times in (None, "time_s"):
        with pytest.raises(EncoderError, match="'time_s' is the column of the times"):
            read_encoder(DEMO / "encoder.csv", column="time_s", time_column=times)
    assert read_encoder(DEMO / "encoder.csv", column="voltage_v").value.size > 1000


@pytest.mark.parametrize("single", [False, True])
def test_a_name_given_twice_is_refused(single: bool) -> None:
    for laws, free in (("full", "tilt,tilt"), ("full", ("offset1", "tilt", "offset1")), ("mu_v1,mu_v1", ())):
        with pytest.raises(FitOptionError, match="is given twice"):
            FitOptions(laws=laws, free=free).coefficients(single=single)
    FitOptions(laws="mu_v1,mu_q1", free="tilt,offset1").coefficients(single=single)


def test_a_recording_given_twice_is_refused_by_a_fit() -> None:
    one = measured(released(3, 3.0, 250.0), 3, 0.05)
    rounded = LinkAngles(one.t_s, np.round(one.phi_rad, 8), one.sigma_rad, name="copy")
    for other in (one, rounded):
        with pytest.raises(FitError, match="the recording is given twice"):
            fit_damping([one, other], derived("A"))


@pytest.mark.parametrize("how", ["name", "copy", "link"])
def test_a_recording_given_twice_is_refused_by_a_run(how: str, tmp_path: Path) -> None:
    other = tmp_path / "other.mp4"
    if how == "copy":
        shutil.copy(DEMO / "drop.mp4", other)
    elif how == "link":
        other.symlink_to(DEMO / "drop.mp4")
    else:
        other = DEMO / "drop.mp4"
    with pytest.raises(PydpendError, match="the recording is given twice"):
        recordings(Options(inputs=(str(DEMO / "drop.mp4"), str(other))), Digests())
    assert (
        len(recordings(Options(inputs=(str(DEMO / "drop.mp4"), str(DEMO / "hanging.mp4"))), Digests())) == 2
    )


def holds(turns: tuple[float, ...], off_v: dict[int, float], noise_v: float = 2.5e-3) -> list[Hold]:
    """Holds of 1500 readings at ``turns``, exact but for ``off_v`` by their number."""
    error = noise_v / np.sqrt(1500)
    return [
        Hold(2 * np.pi * k, 5 + 0.65 * k + off_v.get(i, 0.0), noise_v, 1500, error, f"hold_{360 * k:+g}deg")
        for i, k in enumerate(turns)
    ]


@pytest.mark.parametrize("turns", [(-1, 0, 2, 3), (-1, 0, 1, 2, 3), (-3, -2, -1, 0, 1, 2, 3)])
def test_a_hold_of_another_angle_is_refused_and_named(turns: tuple[int, ...]) -> None:
    """The last recording is that of two turns, whatever its name says."""
    with pytest.raises(EncoderError, match=rf"do not lie on a line.*without hold_\+{360 * turns[-1]}deg"):
        calibrate(holds(turns, {len(turns) - 1: 0.65 * (2 - turns[-1]) or -0.65}))


def test_three_holds_that_contradict_each_other_are_refused() -> None:
    with pytest.raises(EncoderError, match="do not lie on a line") as refused:
        calibrate(holds((0, 2, 3), {2: -0.65}))
    # Which of three is wrong cannot be told.
    assert "without" not in str(refused.value)


def test_few_holds_whose_hands_were_not_exact_have_the_uncertainty_of_their_scatter(tmp_path: Path) -> None:
    """3 mV, 1.7 deg, is 47 standard errors of a hold's mean but 0.1 % of the span: no contradiction."""
    exact, off = calibrate(holds((-2, -1, 1, 2), {})), calibrate(holds((-2, -1, 1, 2), {1: 3e-3}))
    assert not exact.from_scatter
    assert off.from_scatter
    assert any("more than their noise" in note for note in off.notes)
    assert off.sigma[1] > 20 * exact.sigma[1]
    low, high = off.interval_95[1]
    assert low < 0.65 / (2 * np.pi) < high
    off.write(tmp_path / "c.json")
    assert read_calibration(tmp_path / "c.json").interval_95 == off.interval_95


def test_the_demo_s_calibration_stays_as_it_is() -> None:
    for chosen in (slice(None), slice(0, 4), slice(0, 3)):
        files = sorted((DEMO / "calibration").glob("*.csv"))[chosen]
        found = calibrate(read_holds(files))
        # Four standard uncertainties of the demo's own.
        assert abs(found.slope_v_per_rad * 2 * np.pi - 0.65) < 4 * found.sigma[1] * 2 * np.pi
        assert found.linearity < 1e-3


def test_the_hold_without_an_angle_is_named(tmp_path: Path) -> None:
    for turn in ("-360", "+0", "+360"):
        shutil.copy(DEMO / "calibration" / f"hold_{turn}deg.csv", tmp_path)
    shutil.copy(DEMO / "calibration" / "hold_+720deg.csv", tmp_path / "hold_+720deg (1).csv")
    with pytest.raises(EncoderError, match=r"^hold_\+720deg \(1\)\.csv: the name has no angle at its end"):
        read_holds([tmp_path])


def test_a_calibration_is_written_into_no_table(tmp_path: Path) -> None:
    table = Path(shutil.copy(DEMO / "encoder.csv", tmp_path / "enc.csv"))
    before = table.read_bytes()
    assert "a calibration is a .json" in command("calibrate", DEMO / "calibration", "-o", table)
    assert table.read_bytes() == before


def test_a_recording_compared_with_itself_is_refused() -> None:
    video, encoder, _ = made(0)
    with pytest.raises(EncoderError, match="it is the same recording"):
        compare(video, video)
    rounded = LinkAngles(video.t_s, np.round(video.phi_rad, 8), video.sigma_rad)
    with pytest.raises(EncoderError, match="it is the same recording"):
        compare(video, rounded)
    assert 0.5 < compare(video, encoder).share_encoder < 1.5


def test_times_as_readings_are_no_encoder_of_the_link() -> None:
    """Times and a ramp under other names: nothing in their motion is the link's."""
    signal = read_encoder(DEMO / "encoder.csv")
    line = calibrate(holds((-1, 0, 1, 2), {}))
    video = read_angles(DEMO / "motion.parquet")
    for value in (signal.t_s, np.linspace(0.5, 9.5, signal.t_s.size)):
        ramp = EncoderSignal(signal.t_s, value, "v", "ramp")
        with pytest.raises(EncoderError, match=r"ramp: by its motion.*it is no encoder of link 1"):
            compare(video, encoder_angles(ramp, line))


def test_an_energy_fit_with_fewer_energies_than_unknowns_is_refused() -> None:
    states = released(0, seconds=2.0)
    profile = energy.energy_profile(states, derived("A"), "paper")
    few = np.linspace(0, profile.t_s.size - 1, 8).astype(int)

    def taken(count: int) -> energy.EnergyProfile:
        rows = few[:count]
        return energy.EnergyProfile(
            profile.t_s[rows], profile.energy_j[rows], profile.unit_works[rows], profile.names, (0.0, 0.0)
        )

    for count in (5, 6, 7):
        with pytest.raises(FitError, match=rf"{count} energies do not determine 6 coefficients"):
            energy.fit_profiles([taken(count)])
    energy.fit_profiles([taken(8)])
