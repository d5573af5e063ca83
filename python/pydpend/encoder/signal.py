"""Recordings of an encoder: :class:`EncoderSignal`, and reading it from CSV, Parquet, NI TDMS or NumPy."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pydpend.arrays import MAGIC, read_npy
from pydpend.columns import Columns, read_columns
from pydpend.documents import unreadable
from pydpend.encoder.scales import Unit, in_base, in_seconds
from pydpend.errors import EncoderError, Setting, fault
from pydpend.instants import refuse_stamps, seconds_of_numpy, since_1970, times_given
from pydpend.kinds import expect
from pydpend.output import AnyPath, path_of
from pydpend.tabular import TableResult
from pydpend.typed import typed, typed_class
from pydpend.units import is_of_time

Floats = NDArray[np.float64]

TIME_COLUMN = "time_s"
KNOWN_COLUMNS = ("voltage_v", "phi1_rad", "phi1_deg")


@typed_class("t_s")
@dataclass(frozen=True, eq=False, repr=False)
class EncoderSignal(TableResult):
    """A recording of an encoder: T readings over time.

    Parameters
    ----------
    t_s : ndarray of float or datetime64, shape (T,)
        Time on the encoder's clock, s, increasing. Dates become seconds from the first.
    value : ndarray of float, shape (T,)
        Readings, V, or rad if `unit` is ``"rad"``. Samples without a value are not in it.
    unit : {"v", "rad"}
        Unit of the readings.
    name : str
        Name of the recording, for messages and legends.
    notes : tuple of str
        What was left out, gaps and uneven steps.
    left_out : int
        Number of samples that were left out.

    Raises
    ------
    EncoderError
        For shapes that do not go together, times that do not increase, and values that are no numbers.
    """

    t_s: Floats
    value: Floats
    unit: Literal["v", "rad"] = "v"
    name: str = "encoder"
    notes: tuple[str, ...] = ()
    left_out: int = 0

    def __repr__(self) -> str:
        """A line for people."""
        span = f"{self.t_s[0]:g} to {self.t_s[-1]:g} s"
        return f"<EncoderSignal {self.name}: {self.t_s.size} readings in {self.unit}, {span}>"

    def __post_init__(self) -> None:
        t = times_given(self.t_s, EncoderError)
        value = np.ascontiguousarray(self.value, dtype=np.float64)
        if t.ndim != 1 or t.shape != value.shape or t.size == 0:
            raise EncoderError(
                fault(
                    self.name,
                    f"times of shape {t.shape} and values of shape {value.shape}",
                    "Both must be (T,)",
                )
            )
        if not np.isfinite(t).all() or (np.diff(t) <= 0).any():
            raise EncoderError(fault(self.name, "its times do not increase", "Sort the samples by time"))
        if np.isnan(value).any() or np.isinf(value).any():
            raise EncoderError(fault(self.name, "a value is not a number", "Leave such samples out"))
        object.__setattr__(self, "t_s", t)
        object.__setattr__(self, "value", value)

    @property
    def step_s(self) -> float:
        """Median time between samples, s; NaN for a single one."""
        return float(np.median(np.diff(self.t_s))) if self.t_s.size > 1 else float("nan")

    def to_columns(self) -> dict[str, Floats]:
        """The readings as columns of a table, named as `read_encoder` knows them.

        Returns
        -------
        dict of str to ndarray, each of shape (T,)
            ``time_s``, and ``voltage_v`` or ``phi1_rad``.
        """
        return {TIME_COLUMN: self.t_s, "voltage_v" if self.unit == "v" else "phi1_rad": self.value}


@typed()
def read_encoder(
    path: AnyPath,
    *,
    column: str | None = None,
    time_column: str | None = None,
    rate_hz: float | None = None,
    unit: Unit | None = None,
) -> EncoderSignal:
    """An encoder's recording; the kind of file is found from its content.

    Units are those of the row under the header or at the end of a column's name (``time_ms``, ``U [mV]``,
    ``phi1 (deg)``): s, ms, us, ns, min, h; V, mV; rad, mrad, deg, turns. Times without one are s; values without one
    are `unit`'s, else V. Times given as dates, or as s since 1970 in a column that states its unit, become seconds from
    the first.

    Parameters
    ----------
    path : path-like
        CSV and Parquet: columns by name; notes above the header do no harm. NI TDMS: a channel; the time is
        `time_column`'s channel or else the waveform's own increment. NumPy's .npy: (T,), or (T, 2) or (2, T) with the
        time first.
    column : str, optional
        Column of the readings (``voltage_v``, ``phi1_rad`` or ``phi1_deg`` if not given); in TDMS ``channel`` or
        ``group/channel``.
    time_column : str, optional
        Column of the times (``time_s`` if not given).
    rate_hz : float, optional
        Samples per s, where the file has no times.
    unit : {"v", "rad", "deg"}, optional
        Unit of values whose column states none.

    Returns
    -------
    EncoderSignal
        Readings in V or rad. A sample without a value is left out and noted, as are gaps and uneven steps.

    Raises
    ------
    EncoderError
        Naming file, line and column: for text that is no number, times that are missing, repeated or falling, times
        that are stamps written as numbers, units that are not known or contradict each other, and columns that are
        not there.

    Warns
    -----
    RecordingWarning
        If text ends inside its last line, whose number may be cut off.
    """
    path = path_of(path)
    expect(path, ("encoder", "angles"), EncoderError)
    if rate_hz is not None and time_column is not None:
        raise EncoderError(
            fault(
                Setting("rate_hz"),
                "the times are also to be a column's",
                "Leave it or " + Setting("time_column") + " out",
            )
        )
    if rate_hz is not None and not (np.isfinite(rate_hz) and rate_hz > 0):
        raise EncoderError(
            fault(Setting("rate_hz"), f"a rate of {rate_hz} Hz cannot be", "Give the samples per second")
        )
    try:
        with path.open("rb") as file:
            magic = file.read(6)
    except OSError as problem:
        raise EncoderError(unreadable(path, problem)) from problem
    if column is not None and column == (time_column or (None if rate_hz is not None else TIME_COLUMN)):
        raise EncoderError(
            fault(Setting("column"), f"{column!r} is the column of the times", "Name the encoder's readings")
        )
    table: Columns | None = None
    notes: list[str] = []
    when, stated = time_column or TIME_COLUMN, ""
    if magic[:4] == b"TDSm":
        from pydpend.encoder.tdms import read_tdms

        t, value, (label, stated), notes = read_tdms(path, column, time_column, rate_hz)
    elif magic == MAGIC:
        for option, given in (("column", column), ("time_column", time_column)):
            if given is not None:
                raise EncoderError(
                    fault(Setting(option), f"{path} is an array without names", "Leave it out")
                )
        t, value, label = _read_numpy(path, rate_hz)
    else:
        t, value, label, table = _read_table(path, column, time_column, rate_hz)
        if table.doubt:
            notes.append(table.doubt)
        if table.first_stamp:
            notes.append(f"its times are dates; they are counted in s from the first, {table.first_stamp}")
        stated = table.units.get(label, "")
        if when in table.values and rate_hz is None and not table.has_instants:
            t = in_seconds(t, str(path), when, table.units.get(when, ""))
            stamped = since_1970(t) if is_of_time(when, table.units.get(when, "")) else None
            if stamped is not None:
                t, first = stamped
                notes.append(f"its times are s since 1970; they are counted in s from the first, {first}")
    value, base = in_base(value, str(path), label, stated, unit)
    return _checked(path, t, value, label, when, base, table, notes)


def _read_table(
    path: Path, column: str | None, time_column: str | None, rate_hz: float | None
) -> tuple[Floats, Floats, str, Columns]:
    when = [] if rate_hz is not None and time_column is None else [time_column or TIME_COLUMN]
    required = [*when, *([column] if column else [])]
    optional = () if column else KNOWN_COLUMNS
    if not required:
        raise EncoderError(
            fault(
                str(path),
                "without times its columns are not told apart",
                "Name the encoder's with " + Setting("column"),
            )
        )
    table = read_columns(
        path,
        required,
        optional,
        error=EncoderError,
        time=when[0] if when else None,
        naming=Setting("column" if column else "time_column"),
    )
    found = [column] if column else [c for c in KNOWN_COLUMNS if c in table.values]
    if len(found) != 1:
        raise EncoderError(
            fault(
                str(path),
                f"which column is the encoder's? ({', '.join(found) or 'none that is known'})",
                f"Name one of {', '.join(table.header)} with " + Setting("column"),
            )
        )
    value = table.values[found[0]]
    t = table.values[when[0]] if when else np.arange(value.size) / float(rate_hz or 1.0)
    return t, value, found[0], table


def _read_numpy(path: Path, rate_hz: float | None) -> tuple[Floats, Floats, str]:
    array = seconds_of_numpy(read_npy(path, EncoderError, "Save plain numbers with numpy.save"))
    if array.ndim == 1 and rate_hz is not None:
        return np.arange(array.size) / rate_hz, array, "value"
    if array.ndim == 2 and array.shape[0] == 2 and array.shape[1] != 2:
        array = array.T
    if array.ndim != 2 or array.shape[1] != 2:
        raise EncoderError(
            fault(
                str(path),
                f"an array of shape {array.shape}",
                "Save (T, 2) with the time in s first, or (T,) and give " + Setting("rate_hz"),
            )
        )
    return array[:, 0].copy(), array[:, 1].copy(), "value"


def _checked(
    path: Path,
    t: Floats,
    value: Floats,
    label: str,
    when: str,
    unit: Literal["v", "rad"],
    table: Columns | None,
    notes: list[str],
) -> EncoderSignal:
    def place(row: int, column: str) -> str:
        return table.place(row, column) if table is not None else f"sample {row}"

    if t.size == 0:
        raise EncoderError(fault(str(path), "there are no samples", "Give a recording with samples"))
    bad = np.flatnonzero(~np.isfinite(t))
    if bad.size:
        raise EncoderError(
            fault(str(path), "there is no time", "Give every sample a time", place=place(int(bad[0]), when))
        )
    if table is None or not table.has_instants:
        refuse_stamps(str(path), t, EncoderError, lambda row: place(row, when))
    bad = np.flatnonzero(np.diff(t) <= 0) + 1
    if bad.size:
        i = int(bad[0])
        raise EncoderError(
            fault(
                str(path),
                f"the time {t[i]:.9g} s does not come after {t[i - 1]:.9g} s ({bad.size} such)",
                "Sort by time and remove repeats, or give "
                + Setting("rate_hz")
                + " if the stamps are coarse",
                place=place(i, when),
            )
        )
    keep = np.isfinite(value)
    if not keep.any():
        raise EncoderError(
            fault(str(path), "no sample has a value", "Check " + Setting("column"), place=f"column {label}")
        )
    if not keep.all():
        first = int(np.flatnonzero(~keep)[0])
        notes.append(
            f"{int((~keep).sum())} of {keep.size} samples have no value and were left out "
            f"(the first: {place(first, label)})"
        )
    t, value = t[keep], value[keep]
    if t.size > 2:
        steps = np.diff(t)
        step = float(np.median(steps))
        holes = steps > 1.5 * step
        if holes.any():
            notes.append(
                f"{int(holes.sum())} gaps, the longest {steps.max():.4g} s, after {t[np.argmax(steps)]:.6g} s"
            )
        even = steps[~holes]
        if even.size and np.ptp(even) > 0.01 * step:
            notes.append(
                f"uneven steps, {even.min():.4g} to {even.max():.4g} s; the times are used as they are"
            )
    return EncoderSignal(t, value, unit, path.stem, tuple(notes), int((~keep).sum()))
