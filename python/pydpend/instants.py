"""Dates, times of day and durations as seconds.

A stamp becomes seconds from the first one: differences are taken in whole ticks, so nothing of the resolution is lost
to the size of the date. A duration is seconds already.
"""

from __future__ import annotations

import datetime
import re
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from pydpend.errors import PydpendError, fault

Floats = NDArray[np.float64]

_TICKS_PER_S = {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}

_DATE = re.compile(r"\d{4}-\d{2}-\d{2}")
_CLOCK = re.compile(
    r"(?:(?P<days>[+-]?\d+) days? )?(?P<sign>[+-]?)(?P<h>\d{1,4}):(?P<m>[0-5]\d)"
    r":(?P<s>[0-5]\d)(?:[.,](?P<f>\d{1,9})\d*)?"
)
"""A time of day or a duration as pandas writes it: ``12:00:00.25``, ``0 days 00:00:01.5``."""

_TWO_PARTS = re.compile(r"[+-]?\d{1,4}:\d\d(?:[.,]\d+)?")
"""Hours and minutes or minutes and seconds."""

_LONGEST_S = 1e8
"""Three years: no recording is as long, and stamps (s since 1970, 20240501120000) are above."""
_SINCE_1970_S = (946_684_800.0, 4_102_444_800.0)
"""Seconds since 1970 of the years 2000 to 2100: the clock of a computer, in a column that is in s."""
_DAYS = (
    (3e4, 5.3e4, "days since 1900 as spreadsheets store them"),
    (5.3e4, 6e4, "a modified Julian date, or days since 1900 as spreadsheets store them"),
    (6e4, 7.5e4, "a modified Julian date (days since 1858-11-17)"),
    (723_960.0, 753_960.0, "days since the year 0, MATLAB's datenum"),
    (2_445_000.5, 2_475_000.5, "a Julian date (days since 4713 BC)"),
)
"""Lowest and highest count of days, and what it may be, of the years 1982 to 2064.

Modified Julian dates count 15 018 more than spreadsheets do. Below 53 000 they are before 2004, and a spreadsheet's
days are likelier; from there to 60 000 (2004 to 2023, a spreadsheet's 2045 to 2064) they may be either.
"""
_DAYS_SPAN = 0.1
"""A recording of days as numbers spans less, 2.4 hours; seconds that span less are no swing."""
_CLOCK_STEP_S = 10.0
"""A swing is sampled more often; times that are further apart may be anything."""

STAMP_ADVICE = (
    "Write the times in s from the first, as dates (2024-05-01T12:00:00.250), as times of day (12:00:00.250) "
    "or as s since 1970 in a column time_s"
)
"""Advice about stamps that are written as numbers."""


class NotInstants(ValueError):
    """Values that are no dates, times or durations, or mixed ones. ``row`` is the first at fault."""

    def __init__(self, row: int, problem: str) -> None:
        super().__init__(problem)
        self.row = row


def is_instant(field: str) -> bool:
    """Whether a field of a text begins as a date, or is a time of day or a duration."""
    return bool(_DATE.match(field) or _CLOCK.fullmatch(field) or _TWO_PARTS.fullmatch(field))


def stamp_in(t_s: Floats) -> tuple[int, str] | None:
    """The first row of times (T,) that are stamps and not seconds, and what they may be; ``None`` for seconds."""
    t = np.abs(t_s)
    late = np.flatnonzero(t > _LONGEST_S)
    if late.size:
        return int(late[0]), "s, ms, us or ns since 1970 or a date as 20240501120000"
    there = t[np.isfinite(t)]
    if there.size > 1 and np.ptp(there) < _DAYS_SPAN:
        for low, high, what in _DAYS:
            if low < there.min() <= high:
                return 0, what
    minute = _first_minute(t_s)
    if minute is None:
        return None
    return minute, "hours, minutes and seconds in one number, as 100559.9 for 10:05:59.9"


def _first_minute(t_s: Floats) -> int | None:
    """The row at which the first new minute of times (T,) as hhmmss begins; ``None`` for times in s.

    Such times never have 60 to 99 in their last two places, of the minutes or the seconds, and go on by their usual
    step where a minute begins, if they are read as a clock; in s they jump by 40 there.
    """
    rows = np.flatnonzero(np.isfinite(t_s))
    hundreds, seconds = np.divmod(t_s[rows], 100.0)
    hours, minutes = np.divmod(hundreds, 100.0)
    if np.any(hundreds < 0.0) or np.any(seconds >= 60.0) or np.any(minutes >= 60.0):
        return None
    is_new = np.diff(hundreds) > 0
    if not is_new.any() or is_new.all():
        return None
    steps = np.diff((hours * 60.0 + minutes) * 60.0 + seconds)
    usual = float(np.median(steps[~is_new]))
    # Half a step: a gap in times that are in s would have to be 40 s to within that.
    goes_on = np.abs(steps[is_new] - usual) <= usual / 2
    if not 0.0 < usual < _CLOCK_STEP_S or 2 * np.count_nonzero(goes_on) < goes_on.size:
        return None
    return int(rows[1:][is_new][0])


def refuse_stamps(name: str, t_s: Floats, error: type[PydpendError], place: Callable[[int], str]) -> None:
    """Raises ``error`` for times (T,) of the file ``name`` that are stamps; ``place`` says where a row stands."""
    found = stamp_in(t_s)
    if found is not None:
        row, what = found
        raise error(fault(name, f"the time {t_s[row]:.14g} s may be {what}", STAMP_ADVICE, place=place(row)))


def since_1970(t_s: Floats) -> tuple[Floats, str] | None:
    """Times (T,) that all are s since 1970, as s from the first one, and that one as a date; ``None`` for others.

    Only for times that are known to be in s: counts of a clock in ms may be as large.
    """
    low, high = _SINCE_1970_S
    if t_s.size == 0 or not np.all((t_s >= low) & (t_s <= high)):
        return None
    first = np.datetime64(round(float(t_s[0]) * 1e6), "us")
    return t_s - t_s[0], f"{first} UTC"


def seconds_of_text(fields: Sequence[str]) -> tuple[Floats, str]:
    """Seconds of dates, times of day or durations written as text (T,), and the first date, "" where there is none.

    Dates with times are ISO 8601, with an offset from UTC in every field or in none, and are counted from the first.
    NaN where a field is empty.

    Raises NotInstants with the row of the first field that is neither.
    """
    filled = [i for i, f in enumerate(fields) if f]
    out = np.full(len(fields), np.nan)
    if not filled:
        return out, ""
    first = fields[filled[0]]
    if not _DATE.match(first):
        for i in filled:
            out[i] = _clock_s(fields[i], i)
        return out, ""
    zoned = _has_offset(first)
    kind = pa.timestamp("ns", "UTC" if zoned else None)
    texts = [fields[i].replace(",", ".") for i in filled]
    try:
        stamps = pa.array(texts).cast(kind)
    except pa.ArrowInvalid:
        for i, text in zip(filled, texts, strict=True):
            try:
                pa.array([text]).cast(kind)
            except pa.ArrowInvalid as problem:
                if _DATE.match(text) and _has_offset(text) != zoned:
                    raise NotInstants(i, "some dates have an offset from UTC and some have none") from problem
                raise NotInstants(i, f"{fields[i]!r} is no date and time as ISO 8601 writes it") from problem
        raise
    out[filled] = _since_first(stamps.cast(pa.int64()).to_numpy(), 10**9)
    return out, first


def _has_offset(text: str) -> bool:
    return bool(re.search(r"(Z|[+-]\d\d:?\d\d|[+-]\d\d)$", text[10:]))


def _clock_s(field: str, row: int) -> float:
    found = _CLOCK.fullmatch(field)
    if found is None and _TWO_PARTS.fullmatch(field):
        raise NotInstants(row, f"{field!r} may be hours:minutes or minutes:seconds")
    if found is None:
        raise NotInstants(row, f"{field!r} is no time as hours:minutes:seconds")
    part = {k: int(v or 0) for k, v in found.groupdict(default="0").items() if k in ("days", "h", "m", "s")}
    fraction = (found["f"] or "").ljust(9, "0")
    within = part["h"] * 3600 + part["m"] * 60 + part["s"] + int(fraction) / 1e9
    return part["days"] * 86400 + (-within if found["sign"] == "-" else within)


def seconds_of_arrow(column: pa.ChunkedArray) -> tuple[Floats, str] | None:
    """Seconds of an Arrow column of dates, times of day or durations (T,), NaN where it is null, and the first stamp.

    ``None`` for a column of anything else.
    """
    kind = column.type
    if pa.types.is_date(kind):
        column = column.cast(pa.timestamp("ms"))
        kind = column.type
    if not (pa.types.is_timestamp(kind) or pa.types.is_time(kind) or pa.types.is_duration(kind)):
        return None
    whole = column.cast(pa.int32() if kind in (pa.time32("s"), pa.time32("ms")) else pa.int64())
    there = np.asarray(column.is_valid().to_numpy(), dtype=np.bool_)
    ticks = np.asarray(whole.drop_null().to_numpy(), dtype=np.int64)
    out = np.full(there.size, np.nan)
    per_s = _TICKS_PER_S[kind.unit]
    if pa.types.is_timestamp(kind) and ticks.size:
        out[there] = _since_first(ticks, per_s)
        return out, f"{np.datetime64(int(ticks[0]), kind.unit)}{' UTC' if kind.tz else ''}"
    out[there] = _quotient(ticks, per_s)
    return out, ""


def times_given(t_s: object, error: type[PydpendError]) -> Floats:
    """Seconds of an array of numbers or dates that a caller gives as ``t_s``. Raises ``error`` for anything else."""
    try:
        given = np.asarray(t_s)
        if t_s is None or given.dtype.kind == "c":
            raise TypeError
        return seconds_of_numpy(given)
    except (TypeError, ValueError):
        raise error(fault("t_s", "it holds no times", "Give an array of seconds or of dates")) from None


def seconds_of_numpy(values: NDArray[Any]) -> Floats:
    """Numbers as they are; ``datetime64`` and ``datetime`` as seconds from the first, ``timedelta64`` as seconds.

    NaT is NaN.
    """
    if values.dtype.kind == "O" and values.size and isinstance(values.flat[0], datetime.datetime):
        first = values.flat[0]
        return np.array([(stamp - first).total_seconds() for stamp in values.flat]).reshape(values.shape)
    if values.dtype.kind not in "mM":
        return np.ascontiguousarray(values, dtype=np.float64)
    fine = values.astype(f"{values.dtype.kind}8[ns]")
    out = np.full(values.shape, np.nan)
    there = ~np.isnat(fine)
    ticks = fine[there].astype(np.int64)
    out[there] = _since_first(ticks, 10**9) if values.dtype.kind == "M" else _quotient(ticks, 10**9)
    return out


def _since_first(ticks: NDArray[np.int64], per_s: int) -> Floats:
    if ticks.size == 0:
        return np.zeros(0)
    whole, rest = np.divmod(ticks, per_s)
    return np.asarray((whole - whole[0]) + (rest - rest[0]) / per_s, dtype=np.float64)


def _quotient(ticks: NDArray[np.int64], per_s: int) -> Floats:
    whole, rest = np.divmod(ticks, per_s)
    return np.asarray(whole + rest / per_s, dtype=np.float64)
