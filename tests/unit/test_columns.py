"""Tables as spreadsheets, loggers and pandas write them: the right numbers or one line that names the line at fault."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from nptdms import ChannelObject, TdmsWriter
from pydpend.columns import Columns, read_columns
from pydpend.encoder import calibrate, read_encoder, read_holds
from pydpend.errors import AnglesError, EncoderError
from pydpend.kinematics import read_angles

HEAD = "time_s,voltage_v\n"


def read(tmp_path: Path, data: str | bytes, time: str | None = "time_s") -> Columns:
    path = tmp_path / "t.csv"
    path.write_bytes(data.encode() if isinstance(data, str) else data)
    return read_columns(path, ["time_s", "voltage_v"], error=EncoderError, time=time)


LONG = "x" * 200_000
"""Longer than the 131 072 characters that Python's csv takes by itself."""

READ: dict[str, str | bytes] = {
    "points": HEAD + "0.5,0.65\n1,1.65\n",
    "spaces after commas": "time_s, voltage_v\n0.5, 0.65\n1, 1.65\n",
    "semicolons and decimal commas": "time_s;voltage_v\n0,5;0,65\n1,0;1,65\n",
    "tabs and decimal commas": "time_s\tvoltage_v\n0,5\t0,65\n1\t1,65\n",
    "spaces and decimal commas": "time_s voltage_v\n0,5 0,65\n1 1,65\n",
    "quoted decimal commas": HEAD + '"0,5","0,65"\n"1,0","1,65"\n',
    "semicolons and points": "time_s;voltage_v\n0.5;0.65\n1;1.65\n",
    "decimal commas with three digits, one of them sure": "time_s;voltage_v\n0,500;0,650\n1,000;1,650\n",
    "decimal commas with exponents": "time_s;voltage_v\n5,0e-1;6,5E-1\n1;1,65\n",
    "numpy.savetxt": "# time_s voltage_v\n5.000000000000000000e-01 6.5e-01\n1.0e+00 1.65e+00\n",
    "aligned columns": "  time_s   voltage_v\n     0.5       0.65\n     1.0       1.65\n",
    "carriage returns alone": HEAD.replace("\n", "\r") + "0.5,0.65\r1,1.65\r",
    "carriage returns and line feeds": HEAD.replace("\n", "\r\n") + "0.5,0.65\r\n1,1.65\r\n",
    "UTF-16 with its mark": (HEAD + "0.5,0.65\n1,1.65\n").encode("utf-16"),
    "UTF-16 without": (HEAD + "0.5,0.65\n1,1.65\n").encode("utf-16-le"),
    "UTF-8 with its mark": (HEAD + "0.5,0.65\n1,1.65\n").encode("utf-8-sig"),
    "a long note": f"time_s,voltage_v,note\n0.5,0.65,{LONG}\n1,1.65,\n",
    "a long quoted note": f'time_s,voltage_v,note\n0.5,0.65,"{LONG},"\n1,1.65,\n',
    "a long note above": f"# {LONG}, it is\n" + HEAD + "0.5,0.65\n1,1.65\n",
    "a quoted note over two lines": 'time_s,voltage_v,note\n0.5,0.65,"a\nb"\n1,1.65,\n',
    "separators at the ends": "time_s,voltage_v,\n0.5,0.65,\n1,1.65,\n",
    "separators at the ends of rows": HEAD + "0.5,0.65,,\n1,1.65,\n",
    "comments": "# a, b\n% c\n" + HEAD + "# d\n0.5,0.65\n% e\n// f, g, h\n1,1.65\n",
    "units": HEAD + "s,V\n0.5,0.65\n1,1.65\n",
    "units in brackets": HEAD + "(s),[V]\n0.5,0.65\n1,1.65\n",
    "doubles of Fortran": HEAD.replace(",", " ") + " 5.0D-01 0.065D+01\n 1D+00 1.65d0\n",
    "doubles of Fortran with decimal commas": "time_s;voltage_v\n5,0D-01;0,65\n1;1,65D+00\n",
    "a typographic minus in exponents": HEAD + "5e\u22121,0.65\n1,1.65\n",
    "whole numbers in one row": "time_s,voltage_v,note\n0.5,0.65,12\n1,1.65,\n",
    "a sentence above with the names in it": "the columns time_s and voltage_v follow\n"
    + HEAD
    + "0.5,0.65\n1,1.65\n",
    "LabVIEW": "LabVIEW Measurement\t\nDecimal_Separator\t,\n***End_of_Header***\t\ntime_s\tvoltage_v\tComment\n"
    "0,5\t0,65\tbegun\n1\t1,65\n",
}


@pytest.mark.parametrize("kind", READ)
def test_what_can_be_read_one_way_is_read(tmp_path: Path, kind: str) -> None:
    found = read(tmp_path, READ[kind])
    assert found.values["time_s"].tolist() == [0.5, 1.0]
    assert found.values["voltage_v"].tolist() == [0.65, 1.65]


REFUSED: dict[str, tuple[str | bytes, str]] = {
    "decimal commas between commas": (
        HEAD + "0,5,0,65\n1,0,1,65\n",
        "line 2: 4 fields parted by commas, the header",
    ),
    "a decimal comma in one row": (HEAD + "0.5,0.65\n1,1,65\n", "line 3: 3 fields parted by commas"),
    "whole times, volts with commas": (HEAD + "0,0,65\n1,1,65\n", "line 2: 3 fields"),
    "too few fields": (HEAD + "0.5\n", "line 2: 1 fields parted by commas"),
    "another separator below": (HEAD + "0.5;0.65\n", "line 2: 1 fields parted by commas"),
    "text with commas": ("time_s,voltage_v,note\n0.5,0.65,a, b\n", "put text that holds commas in quotes"),
    "thousands or decimals": (
        "time_s;voltage_v\n1;1,234\n2;2,345\n",
        "column voltage_v: '1,234' may be 1.234 or 1234",
    ),
    "quoted thousands or decimals": (HEAD + '1,"1,234"\n', "'1,234' may be 1.234 or 1234"),
    "both marks in a number": ("time_s;voltage_v\n1;1.234,5\n", "'1.234,5' has marks between thousands"),
    "many thousands": ("time_s;voltage_v\n1;1,234,567\n", "'1,234,567' has marks between thousands"),
    "a comma here, a point there": (
        "time_s;voltage_v\n0.5;0,65\n",
        "line 2, column time_s: '0.5' has a decimal point",
    ),
    "a comma first, a point later": (
        "time_s;voltage_v\n0;0,65\n1;1.65\n",
        "line 3, column voltage_v: '1.65' has a decimal point, '0,65' in line 2",
    ),
    "no header": ("0.5,0.65\n1,1.65\n", "line 1: there is no header line with the names time_s, voltage_v"),
    "no header, spaces": ("0.5 0.65\n1 1.65\n", "line 1: there is no header line"),
    "underscores": (HEAD + "0.5,1_0\n", "'1_0' is not a number"),
    "a dash for minus": (
        HEAD + "\u20130.5,0.65\n",
        "line 2, column time_s: '\u20130.5' begins with a dash (U+2013) that is no minus sign, so it is not a number. "
        "Write - for minus",
    ),
    "what may be a name": (HEAD + "0.5,5D3\n", "line 2, column voltage_v: '5D3' is not a number"),
    "two minus signs": (HEAD + "0.5,\u2212-5\n", "line 2, column voltage_v: '--5' is not a number"),
    "other scripts' digits": (HEAD + "0.5,\u0661\n", "is not a number"),
    "a unit in the field": (HEAD + "0.5,0.65 V\n", "line 2, column voltage_v: '0.65 V' is not a number"),
    "a unit with digits that is not known": (
        HEAD + "(s),V/m2\n0.5,0.65\n",
        "line 2, column voltage_v: the unit 'V/m2' is not known",
    ),
    "a unit that contradicts": (
        HEAD + "ms,V\n2,0.65\n",
        "line 2, column time_s: the unit is 'ms', and the column's name says 's'",
    ),
    "millivolts under volts": (HEAD + "s,mV\n2,650\n", "the unit is 'mV', and the column's name says 'v'"),
    "bars": (HEAD.replace(",", "|") + "0.5|0.65\n", "line 1: the fields are parted by '|', a separator"),
    "colons": (HEAD.replace(",", ":") + "0.5:0.65\n", "line 1: the fields are parted by ':', a separator"),
    "hours and minutes": (
        HEAD + "00:00,1\n00:01,2\n",
        "line 2, column time_s: '00:00' may be hours:minutes or",
    ),
    "minutes and seconds": (HEAD + "00:00.5,1\n", "line 2, column time_s: '00:00.5' may be hours:minutes or"),
    "hours and minutes later": (
        HEAD + "00:00:00,1\n00:01,2\n",
        "line 3, column time_s: '00:01' may be hours",
    ),
    "a quote that stays open": (HEAD + '0.5,"0.65\n1,1.65\n', "line 2: a quote is opened and not closed"),
    "a second block of LabVIEW": (
        "time_s\tvoltage_v\n0.5\t0.65\ntime_s\tvoltage_v\n1\t1.65\n",
        "line 3, column time_s: 'time_s' is not a number",
    ),
    "a name twice": (
        "time_s,voltage_v,voltage_v\n0.5,0.65,0.7\n",
        "line 1: the column voltage_v is there 2 times",
    ),
    "binary": (b"\x7fELF\0\0\1\0", "neither Parquet nor text"),
    "UTF-32": ((HEAD + "0.5,0.65\n").encode("utf-32"), "neither Parquet nor text"),
}


@pytest.mark.parametrize("kind", REFUSED)
def test_what_can_be_read_two_ways_is_refused_by_its_line(tmp_path: Path, kind: str) -> None:
    data, message = REFUSED[kind]
    with pytest.raises(EncoderError) as caught:
        read(tmp_path, data)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


THOUSANDS_BY_POINTS = {
    "semicolons": (";", "0;1.000\n1;1.031\n2;969\n", 2, "'1.000' may be 1.000 or 1000: .* '969' in line 4"),
    "tabs": ("\t", "0\t969\n1\t1.031\n", 3, "'1.031' may be 1.031 or 1031: .* '969' in line 2"),
    "commas": (",", "0,1.000\n1,969\n", 2, "'1.000' may be 1.000 or 1000"),
    "spaces": (" ", "0 1.000\n1 969\n", 2, "'1.000' may be 1.000 or 1000"),
    "both signs": (";", "0;0\n1;+31\n2;-1.031\n3;12.344\n", 4, "'-1.031' may be -1.031 or -1031: .* '0' in"),
    "a field without a value": (
        ";",
        "0;1.031\n1;\n2;nan\n3;inf\n4;9\n",
        2,
        "'1.031' may be .* '9' in line 6",
    ),
    "times with decimal points": (";", "0.5;1.031\n1.0;1.250\n1.5;969\n", 2, "'1.031' may be 1.031 or 1031"),
    "millions": (";", "0;2.500.000\n1;-2.578.448\n", 2, r"'2\.500\.000' has marks between thousands"),
    "millions below": (";", "0;999.000\n1;-1.000.000\n", 3, r"'-1\.000\.000' has marks between thousands"),
}


@pytest.mark.parametrize("kind", THOUSANDS_BY_POINTS)
def test_points_that_may_part_thousands_are_refused(tmp_path: Path, kind: str) -> None:
    delimiter, rows, line, message = THOUSANDS_BY_POINTS[kind]
    path = tmp_path / "t.csv"
    path.write_text(f"time_s{delimiter}voltage_mv\n{rows}")
    with pytest.raises(EncoderError, match=rf"line {line}, column voltage_mv: {message}.*\. Write "):
        read_encoder(path, column="voltage_mv")
    path.write_text(f"time_s{delimiter}phi1_deg\n{rows}")
    with pytest.raises(AnglesError, match=f"line {line}, column phi1_deg: {message}") as caught:
        read_angles(path)
    assert "unwrap" not in str(caught.value)


def test_times_whose_points_may_part_thousands_are_refused(tmp_path: Path) -> None:
    with pytest.raises(EncoderError, match=r"line 3, column time_s: '1\.000' may be 1\.000 or 1000"):
        read(tmp_path, "time_s;voltage_v\n998;1\n1.000;2\n1.002;3\n")


POINTS: dict[str, tuple[str, list[float]]] = {
    "three decimals everywhere": ("1;1.031\n2;1.250\n3;2.000\n", [1.031, 1.25, 2.0]),
    "three decimals below one": ("1;0.123\n2;1.250\n3;2\n", [0.123, 1.25, 2.0]),
    "zero with its decimals": ("1;0.000\n2;1.250\n3;2\n", [0.0, 1.25, 2.0]),
    "decimals without last zeros": ("1;1.031\n2;1.25\n3;2\n", [1.031, 1.25, 2.0]),
    "as many before the point as no thousands have": ("1;1031.250\n2;1.250\n3;2\n", [1031.25, 1.25, 2.0]),
    "whole numbers above a thousand": ("1;1.031\n2;1.125\n3;1969\n", [1.031, 1.125, 1969.0]),
    "an exponent": ("1;1.031e0\n2;1.125\n3;2\n", [1.031, 1.125, 2.0]),
    "a time that tells": ("0.5;1.031\n1;1.125\n1.5;2\n", [1.031, 1.125, 2.0]),
    "whole numbers": ("1;1\n2;10\n3;100\n", [1.0, 10.0, 100.0]),
}


@pytest.mark.parametrize("kind", POINTS)
def test_points_that_are_decimal_are_read(tmp_path: Path, kind: str) -> None:
    rows, values = POINTS[kind]
    assert read(tmp_path, "time_s;voltage_v\n" + rows).values["voltage_v"].tolist() == values


CUT = {
    "an empty note": "time_s,voltage_v,note\n2,5,64567\n3,5,65432\n",
    "a short decimal as a note": "time_s,voltage_v,note\n0,5,65\n1,4,35\n",
    "one decimal as a comment": "time_s,voltage_v,Comment\n0,5,6\n1,4,3\n",
    "a note in one row": "time_s,voltage_v,note\n0,5,begin\n1,4,35\n",
    "both cut": "a,time_s,voltage_v,flag\n0,0020,5,3219\n0,0040,5,3301\n",
    "a flag": "time_s,voltage_v,flag\n1,5,32\n2,5,33\n",
    "whole seconds cut": "time_s,voltage_v,flag\n0,125,5\n1,125,5\n",
    "seconds cut that rise within": "time_s,voltage_v,x\n0,125,5\n0,250,6\n0,375,5\n",
    "times cut": "time_s,voltage_v,note\n0,002,5\n1,004,5\n",
    "leading zeros behind times with points": "time_s,voltage_v,note\n0.001,5,0025\n0.002,5,0031\n",
    "leading zeros": "time_s,voltage_v,temperature\n1,5,02\n2,5,13\n",
    "many decimals": "time_s,voltage_v,x\n1,-5,6432\n2,+4,643\n3,5,64\n",
}


@pytest.mark.parametrize("kind", CUT)
def test_decimal_commas_are_not_cut_where_the_header_has_a_column_more(tmp_path: Path, kind: str) -> None:
    with pytest.raises(EncoderError, match=r"line \d: the commas may be decimal marks: "):
        read(tmp_path, CUT[kind])


def test_decimal_commas_are_not_cut_without_times(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    path.write_text("voltage_v,comment\n5,64567\n5,65432\n")
    with pytest.raises(
        EncoderError, match="line 2: the commas may be decimal marks: 5,64567 may be one number"
    ):
        read_encoder(path, column="voltage_v", rate_hz=500.0)


WHOLE = {
    "a temperature": ("time_s,voltage_v,temperature\n0,5,21\n1,6,22\n", [5.0, 6.0]),
    "flags": ("time_s,voltage_v,flag\n0,5,0\n1,6,1\n", [5.0, 6.0]),
    "notes": ("time_s,voltage_v,note\n0,5,begin\n1,6,\n", [5.0, 6.0]),
    "counts beside points": ("time_s,voltage_v,raw\n0,5.0,20480\n1,6,24576\n", [5.0, 6.0]),
    "points in another column": ("time_s,voltage_v,raw,x\n0,5,20480,0.5\n1,6,24576,1\n", [5.0, 6.0]),
    "frames before": ("frame,time_s,voltage_v\n7,0,5\n8,1,6\n", [5.0, 6.0]),
    "millivolts as the last": ("time_s,voltage_v\n0,5000\n1,6000\n", [5000.0, 6000.0]),
    "semicolons": ("time_s;voltage_v;raw\n0;5;20480\n1;6;24576\n", [5.0, 6.0]),
}


@pytest.mark.parametrize("kind", WHOLE)
def test_tables_of_whole_numbers_are_read(tmp_path: Path, kind: str) -> None:
    text, volts = WHOLE[kind]
    assert read(tmp_path, text).values["voltage_v"].tolist() == volts


def test_times_of_whole_seconds_are_not_cut_of_their_decimals(tmp_path: Path) -> None:
    """``0,125,5`` under ``t (s),voltage_v,flag``: 0.125 s and 5 V, or 0 s and 125 V. Milliseconds are whole often."""
    path = tmp_path / "t.csv"
    for time in ("t (s)", "Time [s]", "time", "t"):
        path.write_text(f"a,{time},voltage_v,temperature\n9,0,125,21\n9,1,250,22\n")
        with pytest.raises(
            EncoderError, match="line 2: the commas may be decimal marks: 0,125 may be one number"
        ):
            read_encoder(path, column="voltage_v", time_column=time)
    for time, milli in (("time_ms", 1e-3), ("t (us)", 1e-6)):
        path.write_text(f"{time},voltage_v,flag\n0,125,5\n1,126,5\n")
        found = read_encoder(path, column="voltage_v", time_column=time)
        assert found.t_s == pytest.approx([0.0, milli])
        assert found.value.tolist() == [125.0, 126.0]


def test_whole_numbers_of_64_bits_and_truth_values_in_parquet(tmp_path: Path) -> None:
    path = tmp_path / "t.parquet"
    stamps = pa.array([1714564800000000001, 1714564800002000001], pa.int64())
    pq.write_table(pa.table({"time_s": stamps, "voltage_v": pa.array([True, False])}), path)
    with pytest.raises(EncoderError, match=r"column time_s: it has whole numbers above 2\^53"):
        read_encoder(path)
    with pytest.raises(EncoderError, match="column voltage_v: the column is of type bool, not numbers"):
        read_encoder(path, column="voltage_v", rate_hz=500.0)
    np.save(tmp_path / "t.npy", np.array([True, False]))
    with pytest.raises(EncoderError, match="an array of bool, not of numbers"):
        read_encoder(tmp_path / "t.npy", rate_hz=500.0)


@pytest.mark.parametrize("delimiter", [",", ";"])
def test_volts_of_a_calibration_are_never_cut(tmp_path: Path, delimiter: str) -> None:
    """Seven holds of 0.65 V a turn with decimal commas: 0.65, or refused; once it was 0.6427 without a word."""
    rows = [f"{turn * 360}{delimiter}{5 + 0.65 * turn:.4f}".replace(".", ",") for turn in range(-3, 4)]
    table = tmp_path / "cal.csv"
    table.write_text(f"angle_deg{delimiter}voltage_v\n" + "\n".join(rows) + "\n")
    if delimiter == ",":
        with pytest.raises(EncoderError, match=r"cal.csv, line 2: 3 fields parted by commas"):
            read_holds([table])
    else:
        found = calibrate(read_holds([table]))
        assert found.slope_v_per_rad * 2 * np.pi == pytest.approx(0.65, abs=1e-12)


def test_a_name_twice_in_parquet(tmp_path: Path) -> None:
    path = tmp_path / "t.parquet"
    twice = pa.Table.from_arrays([pa.array([0.0])] * 3, ["time_s", "phi1_rad", "phi1_rad"])
    pq.write_table(twice, path)
    with pytest.raises(AnglesError, match="the column phi1_rad is there 2 times"):
        read_angles(path)


def test_a_tdms_file_that_is_cut_says_so_and_nothing_else(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "t.tdms"
    with TdmsWriter(path) as writer:
        for _ in range(2):
            data = ChannelObject("g", "voltage_v", np.arange(100) / 10, properties={"wf_increment": 0.001})
            writer.write_segment([data])
    whole = path.read_bytes()
    path.write_bytes(whole[:-37])
    found = read_encoder(path)
    assert 100 < found.value.size < 200
    assert any("the recording was cut off" in note for note in found.notes)
    path.write_bytes(whole[:60] + bytes(40) + whole[100:])
    with pytest.raises(EncoderError) as caught:
        read_encoder(path)
    assert "\n" not in str(caught.value)
    # npTDMS prints what it meets.
    assert capfd.readouterr() == ("", "")


def test_a_typographic_minus_is_a_minus(tmp_path: Path) -> None:
    for minus in ("\u2212", "-"):
        found = read(tmp_path, f"time_s;voltage_v\n{minus}1;{minus}0,65\n1;{minus}6,5e{minus}2\n")
        assert found.values["time_s"].tolist() == [-1.0, 1.0]
        assert found.values["voltage_v"].tolist() == [-0.65, -0.065]
