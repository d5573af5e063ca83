"""Times that are dates, times of day or durations: seconds, or one line that says why not."""

from __future__ import annotations

import datetime
import zoneinfo
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from nptdms import ChannelObject, TdmsWriter
from pydpend.encoder import EncoderSignal, read_encoder
from pydpend.errors import AnglesError, EncoderError
from pydpend.instants import stamp_in
from pydpend.kinematics import LinkAngles, read_angles

from tests.unit.test_columns import HEAD, read


@pytest.mark.parametrize(
    ("first", "step", "what"),
    [
        (9e8, 0.002, "since 1970"),
        (5e9, 0.002, "since 1970"),
        (1714564800000.0, 2.0, "since 1970"),
        (1714564800000000.0, 2000.0, "since 1970"),
        (20240501120000.0, 1.0, "a date as 20240501120000"),
        (45413.5, 0.002 / 86400, "days since 1900 as spreadsheets store them"),
        (54000.25, 0.01 / 86400, "a modified Julian date, or days since 1900 as spreadsheets store them"),
        (60310.5, 0.01 / 86400, "a modified Julian date"),
        (60310.0, 1 / 86400, "a modified Julian date"),
        (739373.5, 0.01 / 86400, "MATLAB's datenum"),
        (739373.0, 1 / 86400, "MATLAB's datenum"),
        (2460310.5, 0.01 / 86400, "a Julian date"),
        (2460310.0, 1 / 86400, "a Julian date"),
    ],
)
def test_stamps_written_as_numbers_are_not_taken_for_seconds(
    tmp_path: Path, first: float, step: float, what: str
) -> None:
    times = first + step * np.arange(50)
    rows = "".join(f"{t!r},0.65\n" for t in times.tolist())
    path = tmp_path / "t.csv"
    path.write_text("time_s,voltage_v\n" + rows)
    with pytest.raises(EncoderError, match=f"line 2, column time_s: the time .* may be .*{what}"):
        read_encoder(path)
    path.write_text("time_s,phi1_rad\n" + rows)
    with pytest.raises(AnglesError, match=f"line 2, column time_s: the time .* may be .*{what}"):
        read_angles(path)
    pq.write_table(pa.table({"time_s": times, "voltage_v": np.zeros(50)}), tmp_path / "t.parquet")
    with pytest.raises(EncoderError, match=f"row 0, column time_s: the time .* may be .*{what}"):
        read_encoder(tmp_path / "t.parquet")


CLOCKS = {
    "one minute": (36355.0, 0.1, 100, 50, "100600"),
    "whole seconds": (36355.0, 1.0, 200, 5, "100600"),
    "many minutes": (36300.5, 0.5, 2000, 119, "100600"),
    "a new hour": (39595.0, 0.01, 1000, 500, "110000"),
    "the first hour": (55.0, 0.1, 100, 50, "100"),
    "not in step with the minute": (36355.07, 0.1, 100, 50, "100600.07"),
}
"""First time of day and step, s, rows, the row of the first new minute, and its time as hhmmss."""


def _hhmmss(t_s: float) -> str:
    minutes, seconds = divmod(round(t_s, 3), 60.0)
    return f"{int(minutes // 60):02d}{int(minutes % 60):02d}{seconds:06.3f}"


@pytest.mark.parametrize("kind", CLOCKS)
def test_hours_minutes_and_seconds_in_one_number_are_not_taken_for_seconds(tmp_path: Path, kind: str) -> None:
    first, step, count, row, shown = CLOCKS[kind]
    rows = "".join(f"{_hhmmss(first + k * step)},0.65\n" for k in range(count))
    message = (
        f"line {row + 2}, column time_s: the time {shown} s may be hours, minutes and seconds in one number, as "
        r"100559\.9 for 10:05:59\.9\. Write the times .* as times of day"
    )
    path = tmp_path / "t.csv"
    path.write_text("time_s,voltage_v\n" + rows)
    with pytest.raises(EncoderError, match=message):
        read_encoder(path)
    path.write_text("time_s,phi1_rad\n" + rows)
    with pytest.raises(AnglesError, match=message):
        read_angles(path)


SECONDS = {
    "within a minute's numbers": 100500.0 + 0.1 * np.arange(500),
    "over hundreds": 100555.0 + 0.1 * np.arange(2000),
    "from zero": 0.01 * np.arange(20000),
    "far apart": np.array([0.0, 50.0, 100.0, 150.0, 200.0]),
    "a gap of another length than 40 s": np.concatenate(
        [np.arange(0.0, 60.0, 0.5), np.arange(101.0, 150.0, 0.5)]
    ),
    "two": np.array([59.5, 100.0]),
    "one": np.array([59.5]),
    "above spreadsheets' days for hours": 45413.5 + 0.5 * np.arange(100),
    "as large as MATLAB's datenum": 739373.5 + 0.01 * np.arange(100),
    "as large as a Julian date": 2460310.5 + 0.01 * np.arange(100),
    "without some": np.array([0.0, np.nan, 1.0, 2.0, np.nan]),
}


@pytest.mark.parametrize("kind", SECONDS)
def test_seconds_are_no_stamps(kind: str) -> None:
    assert stamp_in(SECONDS[kind]) is None


def test_rows_without_a_time_do_not_hide_a_clock() -> None:
    times = np.array([np.nan, 58.0, 59.0, np.nan, 100.0, 101.0])
    found = stamp_in(times)
    assert found is not None
    assert found[0] == 4


@pytest.mark.parametrize(
    ("column", "unit_s"), [("time_s", 1.0), ("time_ms", 1e-3), ("t (us)", 1e-6), ("time [s]", 1.0)]
)
def test_seconds_since_1970_are_counted_from_the_first(tmp_path: Path, column: str, unit_s: float) -> None:
    """A float64 holds such a time to 0.24 us; in us it is scaled, which rounds once more."""
    times = 1714564800.25 + 0.002 * np.arange(50)
    path = tmp_path / "t.csv"
    rows = "".join(f"{t / unit_s!r},0.65\n" for t in times.tolist())
    path.write_text(f"{column},voltage_v\n{rows}")
    signal = read_encoder(path, time_column=column)
    np.testing.assert_allclose(signal.t_s, 0.002 * np.arange(50), atol=5e-7)
    assert signal.t_s[0] == 0.0
    note = "its times are s since 1970; they are counted in s from the first, 2024-05-01T12:00:00.250000 UTC"
    assert signal.notes[0] == note
    if unit_s == 1.0:
        path.write_text(f"{column},phi1_rad\n{rows}")
        angles = read_angles(path, columns={"time_s": column})
        np.testing.assert_array_equal(angles.t_s, signal.t_s)
        assert angles.meta["notes"] == [note]


def test_seconds_since_1970_need_a_unit(tmp_path: Path) -> None:
    """A clock's ticks may be as large: under a name without a unit they are not told apart."""
    path = tmp_path / "t.csv"
    rows = "".join(f"{1714564800 + 2 * k},0.65\n" for k in range(50))
    path.write_text("tick,voltage_v\n" + rows)
    with pytest.raises(EncoderError, match=r"line 2, column tick: .* since 1970 in a column time_s"):
        read_encoder(path, time_column="tick")
    path.write_text("tick,phi1_rad\n" + rows)
    with pytest.raises(AnglesError, match="since 1970 in a column time_s"):
        read_angles(path, columns={"time_s": "tick"})
    mixed = "time_s,voltage_v\n0.0,0.65\n1714564800.0,0.65\n"
    path.write_text(mixed)
    with pytest.raises(EncoderError, match="line 3, column time_s: the time 1714564800 s may be"):
        read_encoder(path)


def test_seconds_since_midnight_are_seconds(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    path.write_text(HEAD + "".join(f"{43200 + k / 500:.3f},0.65\n" for k in range(500)))
    assert read_encoder(path).t_s[-1] == 43200.998


STAMPS = {
    "UTC": ("2024-05-01T12:00:00.250Z", "2024-05-01T12:00:00.251Z"),
    "no zone": ("2024-05-01 12:00:00.250", "2024-05-01 12:00:00.251"),
    "an offset": ("2024-05-01T12:00:00.250+02:00", "2024-05-01T12:00:00.251+02:00"),
    "the end of summer time": ("2024-10-27T02:59:59.999500+02:00", "2024-10-27T02:00:00.000500+01:00"),
    "nanoseconds": ("2024-05-01T12:00:00.249999900", "2024-05-01T12:00:00.250999900"),
    "a time of day": ("12:00:00.250", "12:00:00.251"),
    "pandas' duration": ("0 days 00:00:00.250000", "0 days 00:00:00.251000"),
}


@pytest.mark.parametrize("kind", STAMPS)
def test_dates_in_text_become_seconds(tmp_path: Path, kind: str) -> None:
    first, second = STAMPS[kind]
    found = read(tmp_path, HEAD + f"{first},0.65\n{second},1.65\n")
    # A float64 holds times of day to 1e-11 s.
    assert np.diff(found.values["time_s"]) == pytest.approx([0.001], abs=1e-10)
    if "day" not in kind and "duration" not in kind:
        assert found.values["time_s"][0] == 0.0
        assert found.first_stamp == first


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        (
            "2024-05-01T12:00:00Z,1\n2024-05-01T12:00:01,2\n",
            "line 3, column time_s: some dates have an offset",
        ),
        (
            "2024-05-01T12:00:00,1\n05/01/2024 12:00:01,2\n",
            "line 3, column time_s: '05/01/2024 12:00:01' is no date",
        ),
        ("05/01/2024 12:00:01,2\n", "line 2, column time_s: '05/01/2024 12:00:01' is not a number"),
        ("2024-05-01T12:00:00,1\n3.5,2\n", "'3.5' is no date and time"),
        ("12:00:00,1\n3.5,2\n", "'3.5' is no time as hours:minutes:seconds"),
        ("0,2024-05-01T12:00:00\n", "line 2, column voltage_v: '2024-05-01T12:00:00' is not a number"),
    ],
)
def test_dates_that_say_no_instant_are_refused(tmp_path: Path, rows: str, message: str) -> None:
    with pytest.raises(EncoderError) as caught:
        read(tmp_path, HEAD + rows)
    assert message in str(caught.value)


def test_clocks_that_go_back_are_refused(tmp_path: Path) -> None:
    """Local time without its zone, over the end of summer time: the hour that comes twice is not guessed at."""
    path = tmp_path / "t.csv"
    path.write_text(HEAD + "2024-10-27T02:59:59,1\n2024-10-27T02:00:00,2\n")
    with pytest.raises(EncoderError, match="line 3, column time_s: the time -3599 s does not come after 0 s"):
        read_encoder(path)


TIMES = pd.to_datetime(["2024-05-01T12:00:00.250", "2024-05-01T12:00:00.251", "2024-05-01T12:00:00.252"])
ARROW = {
    "timestamp[ns]": pa.array(TIMES.astype("datetime64[ns]")),
    "timestamp[us]": pa.array(TIMES.astype("datetime64[us]")),
    "timestamp[ms]": pa.array(TIMES.astype("datetime64[ms]")),
    "timestamp[ns, tz]": pa.array(TIMES.astype("datetime64[ns]").tz_localize("Europe/Berlin")),
    "time64[us]": pa.array([t.time() for t in TIMES], pa.time64("us")),
    "time32[ms]": pa.array([t.time() for t in TIMES], pa.time32("ms")),
    "duration[us]": pa.array(TIMES - TIMES[0], pa.duration("us")),
    "float": pa.array([0.0, 0.001, 0.002]),
    "decimal": pa.array([0, 0.001, 0.002]).cast(pa.decimal128(10, 6)),
}


@pytest.mark.parametrize("kind", ARROW)
def test_dates_in_parquet_become_seconds(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "t.parquet"
    phi = np.zeros(3)
    pq.write_table(pa.table({"time_s": ARROW[kind], "voltage_v": phi, "phi1_rad": phi}), path)
    found = read_encoder(path, column="voltage_v")
    # A time of day of 43 200 s has a resolution of 7e-12 s.
    assert np.diff(found.t_s) == pytest.approx([0.001, 0.001], abs=2e-11)
    assert np.diff(read_angles(path).t_s) == pytest.approx([0.001, 0.001], abs=2e-11)
    if kind.startswith("timestamp"):
        assert found.t_s[0] == 0.0
        assert "counted in s from the first, 2024-05-01T1" in found.notes[0]
    swapped = tmp_path / "s.parquet"
    if not kind.startswith(("float", "decimal")):
        pq.write_table(pa.table({"time_s": np.arange(3.0), "voltage_v": ARROW[kind]}), swapped)
        with pytest.raises(EncoderError, match=r"column voltage_v: the column is of type .* not numbers"):
            read_encoder(swapped)


def test_stamps_in_tdms_become_seconds_to_their_resolution(tmp_path: Path) -> None:
    path = tmp_path / "t.tdms"
    first = np.datetime64("2026-01-01T00:00:00.250", "us")
    stamps = first + np.arange(5) * np.timedelta64(20, "us")

    def made(name: str, **properties: object) -> ChannelObject:
        return ChannelObject("g", name, np.arange(5) / 10, properties=properties)

    with TdmsWriter(path) as writer:
        writer.write_segment(
            [
                ChannelObject("g", "when", stamps),
                made("voltage_v", wf_increment=np.datetime64("2026-01-01T00:00:00")),
                made("late", wf_increment=0.001, wf_start_offset="soon"),
                made("still", wf_increment=0.0),
            ]
        )
    found = read_encoder(path, column="voltage_v", time_column="when")
    # The file keeps 2^-64 s, a float64 of 1e-4 s 1e-20 s.
    assert found.t_s == pytest.approx(np.arange(5) * 20e-6, abs=1e-12)
    assert "counted in s from the first, 2026-01-01T00:00:00.250000 UTC" in found.notes[0]
    for channel, message in (
        ("when", "channel when: the channel holds time stamps, not numbers"),
        ("voltage_v", r"channel voltage_v: wf_increment is 2026-01-01T00:00:00.* not a number of seconds"),
        ("late", "channel late: wf_start_offset is soon, not a number of seconds"),
        ("still", r"channel still: its waveform increment \(wf_increment\) is 0 s"),
    ):
        with pytest.raises(EncoderError, match=message):
            read_encoder(path, column=channel, time_column="late" if channel == "when" else None)


def test_dates_given_as_arrays_become_seconds() -> None:
    for unit in ("ms", "us", "ns"):
        found = EncoderSignal(TIMES.to_numpy().astype(f"datetime64[{unit}]"), np.zeros(3))
        assert found.t_s == pytest.approx([0.0, 0.001, 0.002], abs=1e-15)
    berlin = zoneinfo.ZoneInfo("Europe/Berlin")
    night = [datetime.datetime(2024, 10, 27, 2, 59, 59, tzinfo=berlin, fold=fold) for fold in (0, 1)]
    utc = np.array([stamp.astimezone(datetime.UTC) for stamp in night])
    assert LinkAngles(utc, np.zeros((2, 1)), np.zeros((2, 1)) + 1e-3).t_s.tolist() == [0.0, 3600.0]
    spans = np.array([datetime.timedelta(milliseconds=k) for k in (5, 6)], dtype="timedelta64[us]")
    assert EncoderSignal(spans, np.zeros(2)).t_s == pytest.approx([0.005, 0.006], abs=1e-15)
