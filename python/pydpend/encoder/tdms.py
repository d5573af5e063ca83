"""NI TDMS files, as LabVIEW and DAQ software write them, through npTDMS."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from nptdms import TdmsFile
from numpy.typing import NDArray

from pydpend.errors import EncoderError, fault

Floats = NDArray[np.float64]


def read_tdms(
    path: Path, channel: str | None, time_channel: str | None, rate_hz: float | None
) -> tuple[Floats, Floats, str, list[str]]:
    """Times in s, values, the channel's name and notes. Raises :class:`EncoderError` if they cannot be had."""
    try:
        file = TdmsFile.read(path)
    except Exception as problem:  # npTDMS raises what its parser happens to meet in a damaged file
        raise EncoderError(
            fault(str(path), f"the TDMS file is damaged ({problem})", "Copy it again")
        ) from problem
    notes = []
    if file.file_status.incomplete_final_segment:
        notes.append("the TDMS file ends in the middle of a segment: the recording was cut off")
    channels = {f"{group.name}/{c.name}": c for group in file.groups() for c in group.channels()}
    data = _pick(path, channels, channel, "encoder", time_channel)
    value = _numbers(path, data)
    if time_channel is not None:
        t = _numbers(path, _pick(path, channels, time_channel, "time", None))
        if t.size != value.size:
            raise EncoderError(
                fault(str(path), f"{t.size} times for {value.size} values", "Name the right channel")
            )
        return t, value, str(data.name), notes
    step = data.properties.get("wf_increment")
    if rate_hz is not None:
        return np.arange(value.size, dtype=np.float64) / rate_hz, value, str(data.name), notes
    if not isinstance(step, (int, float)) or not step > 0:
        raise EncoderError(
            fault(
                str(path),
                "the channel has no waveform increment (wf_increment)",
                "Name the channel of the times, or give rate_hz",
                place=f"channel {data.name}",
            )
        )
    start = float(data.properties.get("wf_start_offset", 0.0))
    return start + np.arange(value.size, dtype=np.float64) * float(step), value, str(data.name), notes


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


def _numbers(path: Path, channel: Any) -> Floats:
    try:
        return np.asarray(channel[:], dtype=np.float64)
    except (TypeError, ValueError) as problem:
        raise EncoderError(
            fault(
                str(path),
                "the channel does not hold numbers",
                "Name another",
                place=f"channel {channel.name}",
            )
        ) from problem
