"""Units in the names of columns, in a row under them and in TDMS: s, V and rad, or one line that says what is wrong."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from nptdms import ChannelObject, TdmsWriter
from pydpend.encoder import read_encoder, read_holds
from pydpend.errors import AnglesError, EncoderError
from pydpend.kinematics import read_angles

UNITS = {
    # text, time's column, encoder's column, times in s, values in V or rad, which
    "row ms, mV": ("t,U\nms,mV\n0,650\n2,1650\n", "t", "U", [0.65, 1.65], "v"),
    "row [ms], (V)": ("t;U\n[ms];(V)\n0;0,65\n2;1,65\n", "t", "U", [0.65, 1.65], "v"),
    "row us, deg": ("t,phi\nµs,°\n0,90\n2000,180\n", "t", "phi", [np.pi / 2, np.pi], "rad"),
    "row ns, mrad": ("t,phi\nns,mrad\n0,500\n2000000,1500\n", "t", "phi", [0.5, 1.5], "rad"),
    "row under names": (
        "time_ms,voltage_mv\nms,mV\n0,650\n2,1650\n",
        "time_ms",
        "voltage_mv",
        [0.65, 1.65],
        "v",
    ),
    "names": ("time_ms,voltage_mv\n0,650\n2,1650\n", "time_ms", "voltage_mv", [0.65, 1.65], "v"),
    "capitals": ("TIME_MS,VOLTAGE_MV\n0,650\n2,1650\n", "TIME_MS", "VOLTAGE_MV", [0.65, 1.65], "v"),
    "brackets": ("t (ms),U [mV]\n0,650\n2,1650\n", "t (ms)", "U [mV]", [0.65, 1.65], "v"),
    "slashes": ("t/ms,U / V\n0,0.65\n2,1.65\n", "t/ms", "U / V", [0.65, 1.65], "v"),
    "camel case": ("timeMs,voltageMv\n0,650\n2,1650\n", "timeMs", "voltageMv", [0.65, 1.65], "v"),
    "mrad": ("time_us,phi1_mrad\n0,500\n2000,1500\n", "time_us", "phi1_mrad", [0.5, 1.5], "rad"),
    "deg in brackets": (
        "time_s,phi1 (deg)\n0,90\n0.002,180\n",
        "time_s",
        "phi1 (deg)",
        [np.pi / 2, np.pi],
        "rad",
    ),
    "degrees": (
        "time_s,angle_degrees\n0,90\n0.002,180\n",
        "time_s",
        "angle_degrees",
        [np.pi / 2, np.pi],
        "rad",
    ),
    "degree sign": ("time_s,angle°\n0,90\n0.002,180\n", "time_s", "angle°", [np.pi / 2, np.pi], "rad"),
    "none": ("Zeit,Kanal (1)\n0,0.65\n0.002,1.65\n", "Zeit", "Kanal (1)", [0.65, 1.65], "v"),
}


@pytest.mark.parametrize("kind", UNITS)
def test_units_in_names_and_under_the_header_are_scaled(tmp_path: Path, kind: str) -> None:
    text, time, column, value, unit = UNITS[kind]
    path = tmp_path / "t.csv"
    path.write_text(text, encoding="utf-8")
    found = read_encoder(path, column=column, time_column=time)
    assert found.t_s == pytest.approx([0.0, 0.002], abs=1e-15)
    assert found.value == pytest.approx(value, abs=1e-15)
    assert found.unit == unit
    if "\n0," not in text or text.count("\n") != 3:
        return
    names = [n.strip() for n in text.split("\n")[0].split(",")]
    rows = np.array([[float(f) for f in line.split(",")] for line in text.split("\n")[1:3]])
    pq.write_table(pa.table(dict(zip(names, rows.T, strict=True))), tmp_path / "t.parquet")
    same = read_encoder(tmp_path / "t.parquet", column=column, time_column=time)
    assert same.t_s.tolist() == found.t_s.tolist()
    assert same.value.tolist() == found.value.tolist()


@pytest.mark.parametrize(
    ("header", "message"),
    [
        ("t,U\ns,counts", "line 2, column U: the unit 'counts' is not known"),
        ("t,U\nfortnights,V", "line 2, column t: the unit 'fortnights' is not known"),
        ("t,U\nV,s", "column t: 'V' is no known unit of time"),
        ("t,U\ns,ms", "column U: 'ms' is no known unit of voltage or angle"),
        ("t,U\ns,MV", "the unit 'MV' is not known"),
        ("t (ticks),U", r"column t \(ticks\): 'ticks' is no known unit of time"),
        ("t,U [counts]", "'counts' is no known unit of voltage or angle"),
        ("t,omega_rad/s", "'s' is no known unit of voltage or angle"),
    ],
)
def test_units_that_are_not_known_are_refused(tmp_path: Path, header: str, message: str) -> None:
    path = tmp_path / "t.csv"
    path.write_text(header + "\n0,0.65\n2,1.65\n")
    time, column = header.split("\n")[0].split(",")
    with pytest.raises(EncoderError, match=message):
        read_encoder(path, column=column, time_column=time)


def test_a_unit_that_is_given_and_another_in_the_name_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    path.write_text("time_s,voltage_mv,v_min\n0,650,0.65\n2,1650,1.65\n")
    with pytest.raises(EncoderError, match="the unit is to be v, the column's is 'mv'"):
        read_encoder(path, column="voltage_mv", unit="v")
    assert read_encoder(path, column="v_min", unit="v").value.tolist() == [0.65, 1.65]


def test_holds_and_angles_have_their_units_too(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    path.write_text("angle_deg,U_mV\n0,5000\n360,5650\n")
    assert [hold.mean_v for hold in read_holds([path], column="U_mV")] == [5.0, 5.65]
    path.write_text("time_s,phi1_rad\nms,rad\n0,0.5\n2,0.6\n")
    with pytest.raises(AnglesError, match="line 2, column time_s: the unit is 'ms'"):
        read_angles(path)
    path.write_text("time_ms,theta_deg\n0,0.5\n2,0.6\n")
    with pytest.raises(AnglesError, match="column time_ms: its unit is 'ms', and time_s is in s"):
        read_angles(path, columns={"time_s": "time_ms", "phi1_deg": "theta_deg"})


def test_units_of_tdms_channels(tmp_path: Path) -> None:
    path = tmp_path / "t.tdms"
    with TdmsWriter(path) as writer:
        writer.write_segment(
            [
                ChannelObject("g", "t_ms", np.array([0.0, 2.0])),
                ChannelObject("g", "U", np.array([650.0, 1650.0]), {"unit_string": "mV"}),
                ChannelObject("g", "on", np.array([True, False])),
            ]
        )
    found = read_encoder(path, column="U", time_column="t_ms")
    assert found.t_s.tolist() == [0.0, 0.002]
    assert found.value.tolist() == [0.65, 1.65]
    with pytest.raises(EncoderError, match="channel on: the channel holds truth values, not numbers"):
        read_encoder(path, column="on", time_column="t_ms")
