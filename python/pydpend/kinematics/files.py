"""Reading and writing angles tables.

Owns: the file forms of :class:`~pydpend.kinematics.table.LinkAngles`: Parquet and CSV with units in the column
names, and the folder of ``.npy`` files in which the paper's authors published theirs.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from pydpend.argument_types import of_type
from pydpend.arrays import read_npy
from pydpend.columns import Columns, read_columns
from pydpend.documents import parse_json, read_text
from pydpend.errors import AnglesError, Setting, fault
from pydpend.instants import refuse_stamps, since_1970
from pydpend.kinds import expect
from pydpend.kinematics.table import CAMERA_NUMBERS, Floats, LinkAngles, camera_column, check_table
from pydpend.output import AnyPath, path_of, whole, write_text
from pydpend.units import is_of_time, unit_at_end, unit_called

META_KEY = "pydpend_angles"
"""Key of the JSON that :func:`write_angles` puts into a Parquet file's metadata."""


def read_angles(
    path: AnyPath,
    *,
    columns: Mapping[str, str] | None = None,
    hanging_rad: float | tuple[float, float] = 0.0,
    clockwise: bool = False,
    unwrap: bool = False,
    name: str | None = None,
) -> LinkAngles:
    """Angles from a table, or from a folder in the form in which the paper's authors published theirs.

    Parameters
    ----------
    path : path-like
        Parquet or CSV with ``time_s``, ``phi1_rad`` (or ``phi1_deg``) and, if there is a second link, ``phi2_*``;
        ``frame``, ``sigma1_*``, ``sigma2_*`` and the camera's ``camera1_phi1_rad`` to ``camera5_phi2_rad`` are
        optional; empty where not seen. Or a folder with
        ``DPmean_data_RB0.npy``, ... (rows: s, degrees) and, for the sigmas, ``DPstd_data_RB0.npy``, ....
    columns : dict of str to str, optional
        The file's columns where their names differ, ours first: ``{"time_s": "t_s", "phi1_rad": "theta1_rad"}``.
    hanging_rad : float or tuple of float
        What the file's angles read when the link hangs, rad (one number, or one per link); it is taken off.
    clockwise : bool
        Whether the file counts clockwise positive.
    unwrap : bool
        Whether the file keeps angles within one turn: neighbouring rows are then taken to be less than half a turn
        apart, also over gaps.
    name : str, optional
        Name of the angles; the file's if not given.

    Returns
    -------
    LinkAngles
        Angles, rad, counter-clockwise positive, zero hanging down. Times that are dates or s since 1970 are counted
        from the first; ``meta["notes"]`` says so of the latter, and of angles from a film that state no camera's part.

    Raises
    ------
    AnglesError
        Naming file, line (or row) and column.
    """
    path = path_of(path)
    # What a folder lacks is told below.
    # A folder of the authors' that lacks a file is no other folder of tables.
    is_theirs = path.is_dir() and any(path.glob("DP*.npy"))
    expect(path, ("angles", "tables") if is_theirs else ("angles",), AnglesError)
    label = name if name is not None else (path.name if path.is_dir() else path.stem)
    meta: dict[str, Any]
    if path.is_dir():
        if columns:
            raise AnglesError(
                fault(Setting("columns"), f"{path} is a folder of arrays without names", "Leave it out")
            )
        t, phi, sigma = _read_published(path)
        frame, meta, table, camera = None, {"source": str(path), "form": "published npy"}, None, None
    else:
        t, phi, sigma, frame, meta, table = _read_table(path, dict(columns or {}))
        camera = _read_camera(path, table, phi.shape[1])
        if camera is None and isinstance(meta.get("bodies"), list):
            meta = meta | {"notes": [*meta.get("notes", ()), NO_CAMERA_PART]}
        t, notes = _from_first(t, table, dict(columns or {}).get("time_s", "time_s"))
        if notes:
            meta = meta | {"notes": [*meta.get("notes", ()), *notes]}
    hanging = np.broadcast_to(np.asarray(hanging_rad, dtype=np.float64), (phi.shape[1],))
    phi = (phi - hanging) * (-1.0 if clockwise else 1.0)
    if camera is not None and clockwise:
        camera = -camera
    if unwrap:
        for k in range(phi.shape[1]):
            seen = np.isfinite(phi[:, k])
            phi[seen, k] = np.unwrap(phi[seen, k])
    ours = dict(columns or {})

    def place(row: int, column: str) -> str:
        theirs = ours.get(column, column)
        return f"row {row}, column {theirs}" if table is None else table.place(row, theirs)

    check_table(str(path), t, phi, sigma, frame, place)
    if table is None or not table.has_instants:
        refuse_stamps(str(path), t, AnglesError, lambda row: place(row, "time_s"))
    return LinkAngles(t, phi, sigma, frame, meta, label, camera)


def _from_first(t: Floats, table: Columns, column: str) -> tuple[Floats, list[str]]:
    """Times of a column that are s since 1970 as s from the first, and a note on that; others as they are."""
    known = not table.has_instants and is_of_time(column, table.units.get(column, ""))
    stamped = since_1970(t) if known else None
    if stamped is None:
        return t, []
    return stamped[0], [f"its times are s since 1970; they are counted in s from the first, {stamped[1]}"]


NO_CAMERA_PART = (
    "the table states the angles' noise only: what the camera's aim and lens do to them is not known (it was written "
    "before that was stated; make it from the node table again)"
)
"""What is said of angles from a film without the camera's part."""


def _read_camera(path: Path, table: Columns, links: int) -> Floats | None:
    """The camera's columns (T, L, 5) of a table; None where it has none.

    Raises :class:`AnglesError` where some are missing.
    """
    names = [camera_column(number, link) for link in range(links) for number in range(CAMERA_NUMBERS)]
    there = [name for name in names if name in table.values]
    if not there:
        return None
    missing = [name for name in names if name not in table.values]
    if missing:
        raise AnglesError(
            fault(
                str(path),
                f"{there[0]} is there and {missing[0]} is not",
                "Keep all columns of the camera's part, or none",
            )
        )
    return np.stack([table.values[name] for name in names], axis=1).reshape(table.rows, links, CAMERA_NUMBERS)


_TableParts = tuple[Floats, Floats, Floats, "NDArray[np.int64] | None", dict[str, Any], Columns]


def _check_units(path: Path, table: Columns, theirs: Mapping[str, str]) -> None:
    """Refuses a column whose name ends in another unit than that of pydpend's column which it stands for."""
    for ours, name in theirs.items():
        _, wanted = unit_at_end(ours)
        if name not in table.values or wanted is None or (ours == "time_s" and table.has_instants):
            continue
        for spelled, unit in (unit_at_end(name), (u := table.units.get(name, ""), unit_called(u))):
            if spelled and unit != wanted:
                raise AnglesError(
                    fault(
                        str(path),
                        f"its unit is {spelled!r}, and {ours} is in {wanted.name}",
                        "Convert it, or name another column with " + Setting("columns"),
                        place=f"column {name}",
                    )
                )


def _read_table(path: Path, columns: dict[str, str]) -> _TableParts:
    ours = ["time_s", "frame"] + [
        f"{q}{k}_{u}" for k in (1, 2) for q in ("phi", "sigma") for u in ("rad", "deg")
    ]
    for key in columns:
        if key not in ours:
            raise AnglesError(
                fault(
                    str(path),
                    Setting("columns") + f" names {key!r}, which is not one of pydpend's",
                    f"pydpend's are {', '.join(ours)}",
                )
            )
    theirs = {c: columns.get(c, c) for c in ours}
    table = read_columns(
        path,
        [theirs["time_s"], *(columns[c] for c in columns if c != "time_s")],
        [theirs[c] for c in ours if c not in columns and c != "time_s"]
        + [camera_column(number, link) for link in (0, 1) for number in range(CAMERA_NUMBERS)],
        error=AnglesError,
        time=theirs["time_s"],
        naming=Setting("columns"),
    )
    _check_units(path, table, theirs)
    if table.rows == 0:
        raise AnglesError(fault(str(path), "the table has a header and no rows", "Give one row per instant"))

    def column(quantity: str, link: int) -> Floats | None:
        rad, deg = (theirs[f"{quantity}{link}_{unit}"] for unit in ("rad", "deg"))
        if rad in table.values and deg in table.values:
            raise AnglesError(fault(str(path), f"both {rad} and {deg} are there", "Keep one of them"))
        if rad in table.values:
            return table.values[rad]
        return np.radians(table.values[deg]) if deg in table.values else None

    found = [column("phi", k) for k in (1, 2)]
    if found[0] is None:
        raise AnglesError(
            fault(
                str(path),
                "there is no column phi1_rad or phi1_deg",
                f"The columns are {', '.join(table.header)}; say which holds the angle with "
                + Setting("columns"),
            )
        )
    phis = [f for f in found if f is not None]
    absent = np.full(table.rows, np.nan)
    sigmas = [column("sigma", k + 1) for k in range(len(phis))]
    frame = None
    if theirs["frame"] in table.values:
        raw = table.values[theirs["frame"]]
        bad = np.flatnonzero(~np.isfinite(raw) | (raw != np.rint(raw)))
        if bad.size:
            raise AnglesError(
                fault(
                    str(path),
                    f"{raw[bad[0]]} is not a frame's index",
                    "Give whole numbers, or leave the column out",
                    place=table.place(int(bad[0]), theirs["frame"]),
                )
            )
        frame = raw.astype(np.int64)
    return (
        table.values[theirs["time_s"]],
        np.column_stack(phis),
        np.column_stack([absent if s is None else s for s in sigmas]),
        frame,
        _read_meta(path, table),
        table,
    )


def _read_meta(path: Path, table: Columns) -> dict[str, Any]:
    text = table.metadata.get(META_KEY)
    side = path.with_name(path.name + ".json")
    if text is None and table.lines is not None and side.is_file():
        text = read_text(side, AnglesError)
    if text is None:
        return {"source": str(path)}
    where = f"metadata {META_KEY} of {path}" if table.lines is None else str(side)
    return parse_json(text, where, AnglesError, "Write the table again").values


def _read_published(folder: Path) -> tuple[Floats, Floats, Floats]:
    """``DPmean_data_RB{k}.npy`` and ``DPstd_data_RB{k}.npy`` of a folder: s, rad, rad."""
    t: Floats | None = None
    phis: list[Floats] = []
    sigmas: list[Floats] = []
    for k in (0, 1):
        mean = folder / f"DPmean_data_RB{k}.npy"
        if not mean.is_file():
            break
        when, degrees = _read_pair(mean)
        if t is None:
            t = when
        elif not np.array_equal(t, when):
            raise AnglesError(
                fault(
                    str(mean), "its times are not those of DPmean_data_RB0.npy", "Give one recording's files"
                )
            )
        phis.append(np.radians(degrees))
        spread = folder / f"DPstd_data_RB{k}.npy"
        if spread.is_file():
            when, degrees = _read_pair(spread)
            if not np.array_equal(t, when):
                raise AnglesError(
                    fault(
                        str(spread),
                        "its times are not those of DPmean_data_RB0.npy",
                        "Give one recording's files",
                    )
                )
            sigmas.append(np.radians(degrees))
        else:
            sigmas.append(np.full(t.size, np.nan))
    if t is None:
        raise AnglesError(
            fault(
                str(folder),
                "the folder has no DPmean_data_RB0.npy",
                "Give an angles table (Parquet or CSV) or a folder in the authors' form",
            )
        )
    return t, np.column_stack(phis), np.column_stack(sigmas)


def _read_pair(path: Path) -> tuple[Floats, Floats]:
    rows = "Row 0 is the time in s, row 1 the angle in degrees"
    array = read_npy(path, AnglesError, rows)
    if array.ndim != 2 or array.shape[0] != 2 or array.dtype.kind not in "fiu":
        found = f"{array.shape}" if array.dtype.kind in "fiu" else f"{array.dtype}"
        raise AnglesError(
            fault(str(path), f"expected an array of numbers of shape (2, T), found {found}", rows)
        )
    return array[0].astype(np.float64), array[1].astype(np.float64)


def written_files(path: AnyPath) -> tuple[Path, ...]:
    """The files that `write_angles` writes for the name of one."""
    table = path_of(path)
    return (table, table.with_name(table.name + ".json")) if table.suffix == ".csv" else (table,)


def write_angles(angles: LinkAngles, path: AnyPath) -> None:
    """Writes the table as Parquet or CSV, by the ending; empty (null) where a link was not seen.

    ``meta`` and ``name`` go into the Parquet metadata, or beside a CSV into ``PATH.json``. Numbers read back bit for
    bit. The file appears whole or not at all.

    Parameters
    ----------
    angles : LinkAngles
        The angles.
    path : path-like
        The file, .parquet or .csv; one that is there is replaced.

    Raises
    ------
    AnglesError
        For another ending or a path that cannot be written.
    """
    of_type("angles", angles, LinkAngles)
    path = path_of(path)
    meta = json.dumps({**angles.meta, "name": angles.name}, sort_keys=True)
    columns = angles.to_columns()
    if path.suffix not in (".parquet", ".csv"):
        raise AnglesError(
            fault(str(path), f"the ending {path.suffix!r} is not known", "Use .parquet or .csv")
        )
    try:
        with whole(path) as new:
            if path.suffix == ".parquet":
                table = pa.table({k: pa.array(v, from_pandas=True) for k, v in columns.items()})
                # A file, because pyarrow looks for addresses in names.
                with new.open("wb") as file:
                    pq.write_table(
                        table.replace_schema_metadata({META_KEY: meta}), file, use_dictionary=False
                    )
            else:
                with new.open("w", encoding="utf-8", newline="") as text:
                    text.write(",".join(columns) + "\n")
                    for row in zip(*(v.tolist() for v in columns.values()), strict=True):
                        text.write(",".join("" if v != v else repr(v) for v in row) + "\n")
                # Where the CSV is, its metadata are too.
                write_text(written_files(path)[1], meta + "\n")
    except OSError as problem:
        raise AnglesError(
            fault(str(path), f"the file cannot be written ({problem.strerror})", "Check the folder")
        ) from problem
