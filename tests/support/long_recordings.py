"""Recordings of any length without the disk they would need, and what a run over one holds in memory."""

from __future__ import annotations

import os
import re
from pathlib import Path

TRACKER = Path(__file__).parent.parent.parent / "target" / "release" / "tracker"


def lengthened(recording: Path, frames: int) -> Path:
    """An 8-bit MRAW recording with black frames after its own, which a sparse file holds for nothing."""
    header = recording.with_suffix(".cih").read_text()
    declared = re.search(r"^Total Frame : (\d+)$", header, re.MULTILINE)
    assert declared, header
    one = recording.stat().st_size // int(declared[1])
    long = recording.with_name(f"{recording.stem}_{frames}.mraw")
    header = re.sub(r"^((?:Original )?Total Frame) : \d+$", rf"\1 : {frames}", header, flags=re.MULTILINE)
    long.with_suffix(".cih").write_text(header)
    long.write_bytes(recording.read_bytes())
    os.truncate(long, one * frames)
    return long


def resident(recording: Path, out: Path) -> int:
    """The most bytes that ``tracker track`` had in memory."""
    command = [str(TRACKER), "track", str(recording), "-o", str(out), "--quiet", "--threads", "2"]
    child = os.posix_spawn(TRACKER, command, os.environ)
    _, status, usage = os.wait4(child, 0)
    # Status 1: markers were not seen again before the end.
    assert os.waitstatus_to_exitcode(status) in (0, 1)
    return usage.ru_maxrss * 1024
