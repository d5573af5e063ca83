"""NI TDMS files, as LabVIEW and DAQ software write them, through npTDMS."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from nptdms import TdmsFile
from nptdms.log import log_manager
from nptdms.timestamp import TimestampArray
from numpy.typing import NDArray

from pydpend.encoder.scales import in_seconds
from pydpend.errors import EncoderError, Setting, fault

Floats = NDArray[np.float64]
T = TypeVar("T")

DAMAGED = "the TDMS file is damaged: its segments do not hold what their headers say"
NOT_WHOLE = "the TDMS file is not whole, or not as the format has it: readings may be missing"


def read_tdms(
    path: Path, channel: str | None, time_channel: str | None, rate_hz: float | None
) -> tuple[Floats, Floats, tuple[str, str], list[str]]:
    """Times in s, values, the channel's name and its unit, "" if it states none, and notes.

    A channel of time stamps gives seconds from its first.

    Raises :class:`EncoderError` if they cannot be had.
    """
    with path.open("rb") as opened, _heard(path) as said:
        # Stamps come as whole seconds and fractions: as datetime64 they would be cut to microseconds.
        file = _asked(path, lambda: TdmsFile.open(opened, raw_timestamps=True))
        t, value, data, notes = _read(path, file, channel, time_channel, rate_hz)
    return t, value, (str(data.name), _unit_string(data)), [*notes, *said]


@contextmanager
def _heard(path: Path) -> Iterator[list[str]]:
    """The words of npTDMS on a file meanwhile, which it would print, as notes."""
    said: list[str] = []

    class Ear(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            if record.name == "nptdms.scaling":
                # Its values would be the converter's steps and not volts.
                raise EncoderError(
                    fault(str(path), "a channel has a scale of a kind that is not known", "Export it as CSV")
                )
            if NOT_WHOLE not in said:
                said.append(NOT_WHOLE)

    ear, console = Ear(), log_manager.console_handler
    level = console.level
    console.setLevel(logging.CRITICAL + 1)
    logger = logging.getLogger("nptdms")
    logger.addHandler(ear)
    try:
        yield said
    finally:
        logger.removeHandler(ear)
        console.setLevel(level)


def _asked(path: Path, ask: Callable[[], T]) -> T:
    try:
        return ask()
    except EncoderError:
        raise
    except Exception as problem:  # npTDMS raises what its parser happens to meet, and Exception itself
        raise EncoderError(fault(str(path), DAMAGED, "Copy it again")) from problem


def _read(
    path: Path, file: TdmsFile, channel: str | None, time_channel: str | None, rate_hz: float | None
) -> tuple[Floats, Floats, Any, list[str]]:
    notes = []
    if file.file_status.incomplete_final_segment:
        notes.append("the TDMS file ends in the middle of a segment: the recording was cut off")
    channels = {f"{group.name}/{c.name}": c for group in file.groups() for c in group.channels()}
    data = _pick(path, channels, channel, "encoder", time_channel)
    value = _numbers(path, data)
    if time_channel is not None:
        times = _pick(path, channels, time_channel, "time", None)
        t = _times(path, times, notes)
        if t.size != value.size:
            raise EncoderError(
                fault(
                    str(path),
                    f"{t.size} times for {value.size} values",
                    "Name the right channels with " + Setting("column") + " and " + Setting("time_column"),
                )
            )
        return t, value, data, notes
    if rate_hz is not None:
        return np.arange(value.size, dtype=np.float64) / rate_hz, value, data, notes
    step = _property(path, data, "wf_increment", None)
    if step is None or not step > 0:
        raise EncoderError(
            fault(
                str(path),
                "the channel has no waveform increment (wf_increment)"
                if step is None
                else f"its waveform increment (wf_increment) is {step:g} s",
                "Name the channel of the times with "
                + Setting("time_column")
                + ", or give "
                + Setting("rate_hz"),
                place=f"channel {data.name}",
            )
        )
    start = _property(path, data, "wf_start_offset", 0.0) or 0.0
    return start + np.arange(value.size, dtype=np.float64) * step, value, data, notes


def _unit_string(channel: Any) -> str:
    stated = channel.properties.get("unit_string", "")
    return stated.strip() if isinstance(stated, str) else ""


def _property(path: Path, channel: Any, key: str, absent: float | None) -> float | None:
    """A property in seconds, a finite number."""
    value = channel.properties.get(key, absent)
    if value is None:
        return None
    number = isinstance(value, (int, float, np.number)) and not isinstance(value, (bool, np.timedelta64))
    if not number or not np.isfinite(value):
        raise EncoderError(
            fault(
                str(path),
                f"{key} is {value}, not a number of seconds",
                "Name the channel of the times with "
                + Setting("time_column")
                + ", or give "
                + Setting("rate_hz"),
                place=f"channel {channel.name}",
            )
        )
    return float(value)


def _pick(path: Path, channels: dict[str, Any], name: str | None, what: str, other: str | None) -> Any:
    listed = ", ".join(channels) or "(none)"
    if name is None:
        left = [k for k in channels if other is None or (k != other and k.split("/", 1)[1] != other)]
        known = [k for k in left if k.split("/", 1)[1] in ("voltage_v", "phi1_rad", "phi1_deg")]
        left = known if len(known) == 1 else left
        if len(left) == 1:
            return channels[left[0]]
        raise EncoderError(fault(str(path), f"it has {len(left)} channels", f"Name the {what}'s: {listed}"))
    found = [k for k in channels if name in (k, k.split("/", 1)[1])]
    if len(found) != 1:
        raise EncoderError(
            fault(
                str(path),
                f"{len(found)} channels are called {name!r}",
                f"Name the {what}'s as one of {listed}",
            )
        )
    return channels[found[0]]


def _samples(path: Path, channel: Any) -> Any:
    size = path.stat().st_size
    if len(channel) > size:
        # What npTDMS sets aside is as much as the file says, and a sample takes a byte at the least.
        raise EncoderError(
            fault(
                str(path),
                f"the TDMS file is damaged ({len(channel)} samples in a file of {size} bytes)",
                "Copy it again",
                place=f"channel {channel.name}",
            )
        )
    return _asked(path, lambda: channel[:])


def _times(path: Path, channel: Any, notes: list[str]) -> Floats:
    samples = _samples(path, channel)
    if not isinstance(samples, TimestampArray):
        return in_seconds(
            _as_numbers(path, channel, samples), str(path), str(channel.name), _unit_string(channel)
        )
    if samples.size == 0:
        return np.zeros(0)
    whole = np.asarray(samples.seconds, dtype=np.int64)
    fraction = np.asarray(samples.second_fractions, dtype=np.uint64)
    first = samples.as_datetime64("us")[0]
    notes.append(f"its times are stamps; they are counted in s from the first, {first} UTC")
    # Whole seconds and fractions apart: together they do not fit a float64 to the resolution of the stamps.
    return np.asarray((whole - whole[0]) + (fraction.astype(np.float64) - float(fraction[0])) * 2.0**-64)


def _numbers(path: Path, channel: Any) -> Floats:
    return _as_numbers(path, channel, _samples(path, channel))


def _as_numbers(path: Path, channel: Any, samples: Any) -> Floats:
    array = np.asarray(samples)
    if array.dtype.kind not in "fiu":
        stamps = isinstance(samples, TimestampArray) or array.dtype.kind == "M"
        what = "time stamps" if stamps else "truth values" if array.dtype.kind == "b" else "text"
        raise EncoderError(
            fault(
                str(path),
                f"the channel holds {what}, not numbers",
                "Name another",
                place=f"channel {channel.name}",
            )
        )
    return np.asarray(array, dtype=np.float64)
