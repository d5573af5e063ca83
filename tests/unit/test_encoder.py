"""The encoder's files, calibration and conversion: right numbers, honest intervals, bad input."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from nptdms import ChannelObject, TdmsWriter
from pydpend.encoder import (
    Calibration,
    EncoderSignal,
    Hold,
    calibrate,
    encoder_angles,
    hold_of,
    read_calibration,
    read_encoder,
    read_holds,
)
from pydpend.errors import EncoderError, PydpendError
from pydpend.series import correlation_time, highpass_noise

SLOPE = 0.65 / (2 * np.pi)
"""V per rad, as the paper's encoder."""
NOISE = 2.5e-3
TURNS = (-3, -2, -1, 0, 1, 2, 3)


def hold(turns: float, rng: np.random.Generator, n: int = 1500, off_v: float = 0.0) -> EncoderSignal:
    volts = 5.0 + 0.65 * turns + off_v + NOISE * rng.standard_normal(n)
    return EncoderSignal(np.arange(n) / 500.0, volts, "v", f"hold_{360 * turns:+d}deg")


def seven(seed: int = 0) -> Calibration:
    rng = np.random.default_rng(seed)
    return calibrate([hold_of(hold(k, rng), 2 * np.pi * k) for k in TURNS])


@pytest.mark.parametrize("hands_v", [0.0, 1e-3])
def test_intervals_hold_the_truth_in_95_of_100(hands_v: float) -> None:
    """1000 simulated calibrations; also with hands that miss the angle by 0.55 deg (1 mV), which noise
    hides.
    """
    offset = slope = 0
    for seed in range(1000):
        rng = np.random.default_rng(seed)
        # The mean of 1500 readings is what the line sees: drawn as such, the 1.5 million others are for nothing.
        holds = [
            Hold(
                2 * np.pi * k, 5 + 0.65 * k + hands_v * rng.standard_normal() + m, s, 1500, s / np.sqrt(1500)
            )
            for k, m, s in zip(
                TURNS,
                NOISE / np.sqrt(1500) * rng.standard_normal(7),
                NOISE * np.sqrt(rng.chisquare(1499, 7) / 1499),
                strict=True,
            )
        ]
        (a0, a1), (b0, b1) = calibrate(holds).interval_95
        offset += a0 <= 5.0 <= a1
        slope += b0 <= SLOPE <= b1
    # 95 % of 1000: the binomial standard deviation is 0.7 %; the issue asks for 93-97 %.
    assert 930 <= offset <= 970
    assert 930 <= slope <= 970


def test_seven_holds_from_their_readings() -> None:
    found = seven()
    assert found.offset_v == pytest.approx(5.0, abs=5 * NOISE / np.sqrt(7 * 1500))
    assert found.slope_v_per_rad == pytest.approx(SLOPE, rel=1e-4)
    assert found.noise_v == pytest.approx(NOISE, rel=0.03)
    # 2.5 mV at 0.65 V a turn is 1.385 deg (ERRATA 27).
    assert np.degrees(found.noise_rad) == pytest.approx(1.385, rel=0.03)
    assert found.linearity < 1e-4
    assert found.dof == 5
    assert len(found.residual_v) == 7
    # By chance half of the holds scatter by a little more than specified; that is no fault.
    assert max(h.std_v for h in found.holds) > NOISE
    assert found.noisy_holds == ()
    third = dataclasses.replace(found.holds[2], std_v=4e-3)
    loud = calibrate([third if i == 2 else h for i, h in enumerate(found.holds)])
    assert found.holds[2].name in loud.noisy_holds


def test_a_bent_line_and_loose_hands_are_said() -> None:
    rng = np.random.default_rng(1)
    holds = [hold_of(hold(k, rng, off_v=2e-3 * k * k), 2 * np.pi * k) for k in TURNS]
    found = calibrate(holds)
    assert any("not linear" in n for n in found.notes)
    assert found.linearity == pytest.approx(2e-3 * 5 / 3.9, rel=0.1)


def test_calibration_there_and_back(tmp_path: Path) -> None:
    found = seven()
    found.write(tmp_path / "encoder.json")
    again = read_calibration(tmp_path / "encoder.json")
    assert again.to_json() == found.to_json()
    assert json.loads(found.to_json())["volts_per_turn"] == pytest.approx(0.65, rel=1e-4)
    (tmp_path / "bad.json").write_text('{"offset_v": 5}')
    with pytest.raises(EncoderError, match=r"bad.json: there is no key holds. Make one with"):
        read_calibration(tmp_path / "bad.json")
    with pytest.raises(EncoderError, match="cannot be read"):
        read_calibration(tmp_path / "none.json")


def write_csv(path: Path, signal: EncoderSignal, header: str = "time_s,voltage_v") -> None:
    rows = "".join(f"{t!r},{v!r}\n" for t, v in zip(signal.t_s.tolist(), signal.value.tolist(), strict=True))
    path.write_text(header + "\n" + rows)


@pytest.mark.parametrize("paths", ["", [""]])
def test_an_empty_name_is_no_folder_of_holds(paths: str | list[str]) -> None:
    with pytest.raises(PydpendError, match="the name is empty"):
        read_holds(paths)


def test_holds_from_a_folder_by_name_by_given_angles_and_from_one_table(tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    folder, numbered = tmp_path / "cal", tmp_path / "numbered"
    folder.mkdir()
    numbered.mkdir()
    table = "angle_deg,voltage_v\n"
    for i, k in enumerate(TURNS):
        signal = hold(k, rng, 300)
        write_csv(folder / f"hold_{360 * k:+d}deg.csv", signal)
        write_csv(numbered / f"hold_{i + 1}.csv", signal)
        table += "".join(f"{360 * k},{v!r}\n" for v in signal.value.tolist())
    (tmp_path / "all.csv").write_text(table)
    by_name = calibrate(read_holds([folder]))
    given = calibrate(read_holds(sorted(numbered.iterdir()), [360.0 * k for k in TURNS]))
    one = calibrate(read_holds([tmp_path / "all.csv"]))
    for other in (given, one):
        assert other.slope_v_per_rad == pytest.approx(by_name.slope_v_per_rad, rel=1e-12)
        assert other.sigma == pytest.approx(by_name.sigma)
    with pytest.raises(EncoderError, match="neither given nor in the files' names"):
        read_holds([numbered])
    with pytest.raises(EncoderError, match="2 angles for 7 holds"):
        read_holds([folder], [0.0, 1.0])
    empty = tmp_path / "empty"
    empty.mkdir()
    with pytest.raises(EncoderError, match="no hold recordings"):
        read_holds([empty])


def test_calibrations_that_cannot_be() -> None:
    rng = np.random.default_rng(3)
    one = hold_of(hold(0, rng), 0.0)
    with pytest.raises(EncoderError, match=r"1 hold \(hold_\+0deg\) is not enough"):
        calibrate([one])
    with pytest.raises(EncoderError, match=r"all 2 holds \(.*\) are at one angle, 0 deg"):
        calibrate([one, hold_of(hold(0, rng), 0.0)])
    with pytest.raises(EncoderError, match="does not change with the angle"):
        calibrate([one, hold_of(hold(0, rng), 2 * np.pi)])
    with pytest.raises(EncoderError, match=r"hold_\+3600deg: its mean, 11.* at a rail"):
        calibrate([one, hold_of(hold(10, rng), 20 * np.pi)])
    with pytest.raises(EncoderError, match="must be in volts"):
        hold_of(EncoderSignal(np.arange(3.0), np.zeros(3), "rad"), 0.0)
    two = calibrate([one, hold_of(hold(1, rng), 2 * np.pi)])
    assert any("noise within them" in n for n in two.notes)
    assert two.sigma[0] == pytest.approx(NOISE / np.sqrt(1500), rel=0.3)


def test_volts_to_angles_with_rails_and_values_beyond() -> None:
    t = np.arange(3000) / 500.0
    phi = 16 * np.pi * np.sin(t)
    volts = np.clip(5.0 + SLOPE * phi, 0.0, 10.0) + NOISE * np.random.default_rng(4).standard_normal(t.size)
    volts[7], volts[9] = -3.0, 14.0
    found = encoder_angles(EncoderSignal(t, volts), seven())
    cut = np.abs(SLOPE * phi) > 5.0
    good = np.isfinite(found.phi_rad[:, 0])
    # A reading cut off at a rail escapes only if its noise is beyond four sigmas: 6e-5 of them.
    assert good[cut].sum() <= 1
    assert found.meta["readings_beyond_range"] == 2
    assert found.meta["readings_at_rails"] > 100
    assert any("at a rail" in n for n in found.meta["notes"])
    error = (found.phi_rad[:, 0] - phi)[good]
    assert (error / found.sigma_rad[good, 0]).std() == pytest.approx(1.0, abs=0.06)
    with pytest.raises(EncoderError, match="no calibration"):
        encoder_angles(EncoderSignal(t, volts))
    with pytest.raises(EncoderError, match="cannot be used"):
        encoder_angles(EncoderSignal(t, np.full(t.size, 10.0)), seven())


def test_single_turn_encoder_is_unwrapped_over_many_turns() -> None:
    rng = np.random.default_rng(5)
    per_rad = 10.0 / (2 * np.pi)

    def wrapped(phi: np.ndarray) -> np.ndarray:
        return np.asarray(np.mod(3.0 + per_rad * phi, 10.0))

    holds = []
    for degrees in (-150, -60, 0, 60, 150, 300):
        volts = wrapped(np.full(500, np.radians(degrees))) + NOISE * rng.standard_normal(500)
        holds.append(
            hold_of(EncoderSignal(np.arange(500) / 500, volts, "v", str(degrees)), np.radians(degrees))
        )
    line = calibrate(holds, wraps=True)
    assert line.slope_v_per_rad == pytest.approx(per_rad, rel=1e-4)
    t = np.arange(5000) / 500
    phi = 40 * np.sin(0.8 * t)
    volts = wrapped(phi) + NOISE * rng.standard_normal(t.size)
    jump = np.flatnonzero(np.abs(np.diff(volts)) > 5)[3]
    volts[jump] = 5.5  # a reading while the output falls from one rail to the other
    found = encoder_angles(EncoderSignal(t, volts), line)
    error = found.phi_rad[:, 0] - phi
    error -= 2 * np.pi * np.rint(np.nanmedian(error) / (2 * np.pi))
    assert np.nanmax(np.abs(error)) < 0.02
    assert found.meta["readings_while_jumping"] == 1


def test_gaps_of_an_encoder_of_many_turns_and_of_one() -> None:
    t = np.arange(4000) / 500
    phi = 25 * np.sin(0.9 * t)
    there = (t < 1.0) | (t > 1.4)
    # Ten rad in the gap: an angle over many turns is what it is, one of a single turn may have lost one.
    many = encoder_angles(EncoderSignal(t[there], phi[there], "rad"))
    np.testing.assert_array_equal(many.phi_rad[:, 0], phi[there])
    wrapped = np.angle(np.exp(1j * phi))
    with pytest.raises(
        EncoderError, match=r"after 0.998 s: no readings for 0.404 s.*turn of a single-turn encoder"
    ):
        encoder_angles(EncoderSignal(t[there], wrapped[there], "rad"))
    short = (t < 1.0) | (t > 1.05)
    counted = encoder_angles(EncoderSignal(t[short], wrapped[short], "rad"))
    np.testing.assert_allclose(counted.phi_rad[:, 0], phi[short], atol=1e-9)


def test_other_files_say_the_same(tmp_path: Path) -> None:
    signal = hold(1, np.random.default_rng(6), 200)
    write_csv(tmp_path / "a.csv", signal)
    write_csv(tmp_path / "b.csv", signal, "Logger;v2\n\nSekunden,Spannung [V]")
    german = [f"{t:.3f};{v:.17g}".replace(".", ",") for t, v in zip(signal.t_s, signal.value, strict=True)]
    (tmp_path / "i.csv").write_text(
        "\n".join(["Messung 3;", "Zeit;Kanal 1", "s;V", *german]) + "\n", encoding="latin-1"
    )
    np.save(tmp_path / "c.npy", np.stack([signal.t_s, signal.value]))
    np.save(tmp_path / "d.npy", signal.value)
    with TdmsWriter(tmp_path / "e.tdms") as writer:
        writer.write_segment(
            [
                ChannelObject(
                    "DAQ", "voltage_v", signal.value, {"wf_increment": 0.002, "wf_start_offset": 0.0}
                ),
                ChannelObject("DAQ", "trigger", np.zeros(200)),
                ChannelObject("DAQ", "label", np.array(["x", "y"])),
            ]
        )
    others = [
        read_encoder(tmp_path / "a.csv"),
        read_encoder(tmp_path / "b.csv", column="Spannung [V]", time_column="Sekunden"),
        read_encoder(tmp_path / "i.csv", column="Kanal 1", time_column="Zeit"),
        read_encoder(tmp_path / "c.npy"),
        read_encoder(tmp_path / "d.npy", rate_hz=500.0),
        read_encoder(tmp_path / "e.tdms"),
        read_encoder(tmp_path / "e.tdms", column="DAQ/voltage_v", rate_hz=500.0),
    ]
    for other in others:
        np.testing.assert_array_equal(other.value, signal.value)
        np.testing.assert_allclose(other.t_s, signal.t_s, atol=1e-12)
        assert other.unit == "v"
    degrees = tmp_path / "f.csv"
    degrees.write_text("time_s,phi1_deg\n0,0\n1,180\n")
    assert read_encoder(degrees).value[1] == pytest.approx(np.pi)
    with pytest.raises(EncoderError, match=r"channel trigger: the channel has no waveform increment"):
        read_encoder(tmp_path / "e.tdms", column="trigger")
    with pytest.raises(EncoderError, match="0 channels are called 'volts'"):
        read_encoder(tmp_path / "e.tdms", column="volts")
    with pytest.raises(EncoderError, match="holds text, not numbers"):
        read_encoder(tmp_path / "e.tdms", column="label", rate_hz=1.0)
    with TdmsWriter(tmp_path / "h.tdms") as writer:
        writer.write_segment([ChannelObject("DAQ", "voltage_v", signal.value, {"wf_increment": 0.002})])
    whole = (tmp_path / "h.tdms").read_bytes()
    (tmp_path / "h.tdms").write_bytes(whole[:-800])
    assert read_encoder(tmp_path / "h.tdms").t_s.size == 100
    assert "cut off" in read_encoder(tmp_path / "h.tdms").notes[0]
    (tmp_path / "g.tdms").write_bytes(whole[:60])
    with pytest.raises(EncoderError, match="0 channels"):
        read_encoder(tmp_path / "g.tdms")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is empty"),
        ("time_s,voltage_v\n", "no samples"),
        ("time_s,voltage_v\ns,V\ns,V\n0,5\n", r"line 3, column time_s: 's' is not a number"),
        ("time_s,voltage_v\n0,V\n", r"line 2, column voltage_v: 'V' is not a number"),
        ("time_s,voltage_v\n0,5\n0.002,five\n", r"line 3, column voltage_v: 'five' is not a number"),
        (
            "time_s,voltage_v\n0,5\n0.002,5\n0.002,5\n",
            r"line 4, column time_s: the time 0.002 s does not come after",
        ),
        ("time_s,voltage_v\n0,5\n0.004,5\n0.002,5\n", r"line 4, column time_s:"),
        ("time_s,voltage_v\n0,5\n,5\n", r"line 3, column time_s: there is no time"),
        ("time_s,voltage_v\n0,\n1,\n", "no sample has a value"),
        ("time_s,volts\n0,5\n", "which column is the encoder's"),
        ("zeit,voltage_v\n0,5\n", "no column time_s"),
    ],
)
def test_bad_files_are_refused_with_line_and_column(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "encoder.csv"
    file.write_text(text)
    with pytest.raises(EncoderError, match=message) as caught:
        read_encoder(file)
    assert "encoder.csv" in str(caught.value)


def test_what_is_left_out_is_said(tmp_path: Path) -> None:
    file = tmp_path / "encoder.csv"
    file.write_text("time_s,voltage_v\n0,5\n0.002,nan\n0.004,5\n0.006,5\n0.0085,5\n0.1,5\n0.102,5\n0.104,5\n")
    found = read_encoder(file)
    assert found.t_s.size == 7
    assert (
        "1 of 8 samples have no value and were left out (the first: line 3, column voltage_v)"
        in found.notes[0]
    )
    assert "2 gaps, the longest 0.0915 s" in found.notes[1]
    assert "uneven steps" in found.notes[2]


def test_statistics_of_white_and_of_slow_series() -> None:
    rng = np.random.default_rng(7)
    white = rng.standard_normal(20_000)
    assert correlation_time(white) == pytest.approx(1.0, abs=0.1)
    slow = np.zeros(20_000)
    for i in range(1, slow.size):
        slow[i] = 0.9 * slow[i - 1] + white[i]
    # An AR(1) of 0.9 has (1 + 0.9) / (1 - 0.9) = 19.
    assert correlation_time(slow) == pytest.approx(19.0, rel=0.25)
    smooth = 5 * np.sin(np.arange(20_000) / 80)
    assert highpass_noise(smooth + 0.3 * white) == pytest.approx(0.3, rel=0.02)
