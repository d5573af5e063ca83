"""Recordings of the encoder held at known angles, from which it is calibrated (Section 5.1)."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pydpend.columns import read_columns
from pydpend.encoder.scales import Unit, in_base
from pydpend.encoder.signal import EncoderSignal, read_encoder
from pydpend.errors import EncoderError, Setting, fault, listed
from pydpend.kinds import expect
from pydpend.output import path_of
from pydpend.series import correlation_time
from pydpend.typed import typed

ENDINGS = (".csv", ".tdms", ".npy", ".parquet", ".txt")
"""Endings of files that count as recordings in a folder of holds."""


@dataclass(frozen=True)
class Hold:
    """Readings of an encoder that is held at one known angle.

    Attributes
    ----------
    angle_rad : float
        The angle, rad; it counts as exact.
    mean_v, std_v : float
        Mean and standard deviation of the readings, V.
    n : int
        Number of readings.
    sigma_v : float
        Standard error of the mean, V; readings that hang together count as fewer.
    name : str
        Name of the hold, for messages.
    """

    angle_rad: float
    mean_v: float
    std_v: float
    n: int
    sigma_v: float
    name: str = "hold"


def hold_of(signal: EncoderSignal, angle_rad: float) -> Hold:
    """The hold of a recording made at one known angle. Raises :class:`EncoderError` unless it is in volts."""
    if signal.unit != "v":
        raise EncoderError(
            fault(
                signal.name, "a hold must be in volts", "Name the voltage's column with " + Setting("column")
            )
        )
    n = signal.value.size
    std = float(np.std(signal.value, ddof=1)) if n > 1 else 0.0
    together = correlation_time(signal.value - signal.value.mean())
    return Hold(
        angle_rad, float(signal.value.mean()), std, n, std * float(np.sqrt(together / n)), signal.name
    )


_ANGLE = re.compile(r"([+\-−mp]?)(\d+(?:[.,]\d+)?)\s*(deg|turns|turn|)$", re.IGNORECASE)


def angles_from_names(names: Sequence[str]) -> list[float] | None:
    """Angles in rad from file names that end in one (``hold_-360deg``, ``m720deg``, ``rest_0``, ``-2turns``).

    ``None`` unless every name has one and at least one has a sign, ``deg`` or ``turns``: ``hold_1`` to
    ``hold_7`` are numbers of files, not angles.
    """
    found = [_ANGLE.search(n) for n in names]
    if not all(found):
        return None
    out, sure = [], False
    for match in found:
        assert match is not None
        sign, digits, unit = match.groups()
        value = float(digits.replace(",", "."))
        sure |= bool(sign) or bool(unit)
        value *= -1.0 if sign in ("-", "−", "m", "M") else 1.0
        out.append(2 * np.pi * value if unit.lower().startswith("turn") else float(np.radians(value)))
    return out if sure else None


@typed()
def read_holds(
    paths: Sequence[str | Path] | str | Path,
    angles_deg: Sequence[float] | None = None,
    *,
    column: str | None = None,
    time_column: str | None = None,
    rate_hz: float | None = None,
    unit: Unit | None = None,
) -> list[Hold]:
    """Holds from one recording each, from all recordings in a folder, or from one table.

    Parameters
    ----------
    paths : path-like or sequence of path-like
        Recordings, folders of them, or one table with ``angle_deg`` (or ``angle_rad``) beside ``voltage_v``: all
        readings, or one row per hold with ``std_v`` and ``n``.
    angles_deg : sequence of float, optional
        Angles, deg, in the order of the files; if not given they are in the files' names (``hold_-360deg.csv``).
    column, time_column, rate_hz, unit : optional
        As in `read_encoder`.

    Returns
    -------
    list of pydpend.encoder.Hold
        What `calibrate` takes.

    Raises
    ------
    EncoderError
        If angles are missing or their number is not the files', or a file cannot be read.
    """
    files: list[Path] = []
    given = [paths] if isinstance(paths, (str, Path)) else paths
    for path in map(path_of, given):
        expect(path, ("encoder", "tables"), EncoderError)
        if path.is_dir():
            inside = [p for p in sorted(path.iterdir()) if p.suffix.lower() in ENDINGS]
            if not inside:
                raise EncoderError(
                    fault(str(path), "the folder has no hold recordings", "Give CSV, TDMS or NumPy files")
                )
            files += inside
        else:
            files.append(path)
    if not files:
        raise EncoderError(
            fault("calibration", "no hold recordings were given", "Name the files or their folder")
        )
    if len(files) == 1 and angles_deg is None:
        for name, value in (("time_column", time_column), ("rate_hz", rate_hz), ("unit", unit)):
            if value is not None:
                raise EncoderError(
                    fault(
                        Setting(name), f"{files[0]} is one table of holds, which has no times", "Leave it out"
                    )
                )
        return _holds_of_table(files[0], column or "voltage_v")
    if angles_deg is None:
        angles = angles_from_names([f.stem for f in files])
        if angles is None:
            without = [f for f in files if not _ANGLE.search(f.stem)]
            if without and len(without) < len(files):
                raise EncoderError(
                    fault(
                        listed((f.name for f in without), "and"),
                        f"the name has no angle at its end, as those of the other holds have ({len(files)} in all)",
                        "Rename it like hold_-360deg.csv, leave it out, or give "
                        + Setting("angles_deg")
                        + " in the files' order",
                    )
                )
            raise EncoderError(
                fault(
                    "calibration",
                    f"the angles of the {len(files)} holds are neither given nor in the files' names",
                    "Give "
                    + Setting("angles_deg")
                    + " in the files' order, or name the files like hold_-360deg.csv",
                )
            )
    else:
        angles = [float(np.radians(a)) for a in angles_deg]
    if len(angles) != len(files):
        raise EncoderError(
            fault(Setting("angles_deg"), f"{len(angles)} angles for {len(files)} holds", "Give one for each")
        )
    return [
        hold_of(read_encoder(f, column=column, time_column=time_column, rate_hz=rate_hz, unit=unit), a)
        for f, a in zip(files, angles, strict=True)
    ]


def _holds_of_table(path: Path, column: str) -> list[Hold]:
    table = read_columns(
        path, [column], ["angle_deg", "angle_rad", "std_v", "n"], error=EncoderError, naming=Setting("column")
    )
    if ("angle_deg" in table.values) == ("angle_rad" in table.values):
        raise EncoderError(
            fault(
                str(path),
                "one file is a calibration only if it has a column angle_deg or angle_rad",
                f"The columns are {', '.join(table.header)}; or give one recording per hold",
            )
        )
    angle = (
        table.values["angle_rad"] if "angle_rad" in table.values else np.radians(table.values["angle_deg"])
    )
    volts, base = in_base(table.values[column], str(path), column, table.units.get(column, ""), None)
    if base != "v":
        raise EncoderError(
            fault(
                str(path),
                "a hold must be in volts",
                "Name the voltage's column with " + Setting("column"),
                place=f"column {column}",
            )
        )
    bad = np.flatnonzero(~(np.isfinite(angle) & np.isfinite(volts)))
    if bad.size:
        raise EncoderError(
            fault(
                str(path),
                "an angle or a voltage is missing",
                "Remove the line",
                place=table.place(int(bad[0])),
            )
        )
    out = []
    for value in np.unique(angle):
        rows = np.flatnonzero(angle == value)
        name = f"{path.stem} at {np.degrees(value):g} deg"
        if rows.size == 1 and "std_v" in table.values:
            std = float(table.values["std_v"][rows[0]])
            n = int(table.values["n"][rows[0]]) if "n" in table.values else 1
            out.append(Hold(float(value), float(volts[rows[0]]), std, n, std / float(np.sqrt(n)), name))
        else:
            out.append(
                hold_of(
                    EncoderSignal(np.arange(rows.size, dtype=np.float64), volts[rows], "v", name),
                    float(value),
                )
            )
    return out
