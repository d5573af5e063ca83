"""Reading and writing angles tables.

Owns: the file forms of :class:`~pydpend.kinematics.table.LinkAngles`: Parquet and CSV with units in the column
names, and the folder of ``.npy`` files in which the paper's authors published theirs.
"""

from __future__ import annotations

import csv
import itertools
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from pydpend.arrays import read_npy
from pydpend.columns import Columns, read_columns
from pydpend.documents import parse_json, read_text
from pydpend.errors import AnglesError, Setting, fault
from pydpend.instants import refuse_stamps, since_1970
from pydpend.kinds import expect
from pydpend.kinematics.names import OURS, ColumnNames, LinkJoint, noise_beside, numbered_names, stems_of
from pydpend.kinematics.table import CAMERA_NUMBERS, Floats, LinkAngles, check_table
from pydpend.output import AnyPath, path_of, whole, write_text
from pydpend.typed import typed
from pydpend.units import is_of_time, unit_at_end, unit_called

META_KEY = "pydpend_angles"
"""Key of the JSON that :func:`write_angles` puts into a Parquet file's metadata."""


@typed()
def read_angles(
    path: AnyPath,
    *,
    columns: Mapping[str, str] | None = None,
    hanging_rad: float | Sequence[float] = 0.0,
    clockwise: bool = False,
    unwrap: bool = False,
    name: str | None = None,
) -> LinkAngles:
    """Angles from a table, or from a folder in the form in which the paper's authors published theirs.

    Parameters
    ----------
    path : path-like
        Parquet or CSV with ``time_s`` and the links' angles: numbered ``phi1_rad`` (or ``phi1_deg``), ``phi2_*``, ...,
        or named ``phi_crank_rad``, ...; ``frame``, ``sigma1_*`` or ``sigma_phi_crank_*`` and the camera's
        ``camera1_phi1_rad`` to ``camera5_phi2_rad`` are optional; empty where not seen. Or a folder with
        ``DPmean_data_RB0.npy``, ... (rows: s, degrees) and, for the sigmas, ``DPstd_data_RB0.npy``, ....
    columns : dict of str to str, optional
        The file's columns where their names differ, ours first: ``{"time_s": "t_s", "phi1_rad": "theta1_rad"}``.
    hanging_rad : float or sequence of float
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
    if path.is_dir():
        if columns:
            raise AnglesError(
                fault(Setting("columns"), f"{path} is a folder of arrays without names", "Leave it out")
            )
        read = _read_published(path)
    else:
        read = _read_table(path, dict(columns or {}))
    t, phi, camera, meta, table = read.t_s, read.phi_rad, read.camera_rad, read.meta, read.table
    if table is not None:
        if camera is None and isinstance(meta.get("bodies"), list):
            meta = meta | {"notes": [*meta.get("notes", ()), NO_CAMERA_PART]}
        t, notes = _from_first(t, table, dict(columns or {}).get("time_s", "time_s"))
        if notes:
            meta = meta | {"notes": [*meta.get("notes", ()), *notes]}
    hanging = np.asarray(hanging_rad, dtype=np.float64)
    if hanging.shape not in ((), (phi.shape[1],)):
        problem = f"{hanging.size} angles for {phi.shape[1]} link(s)"
        raise AnglesError(fault(Setting("hanging_rad"), problem, "Give one number, or one per link"))
    if not np.isfinite(hanging).all():
        problem = f"{hanging_rad} is no angle at which links hang"
        raise AnglesError(fault(Setting("hanging_rad"), problem, "Give finite numbers"))
    phi = (phi - hanging) * (-1.0 if clockwise else 1.0)
    if camera is not None and clockwise:
        camera = -camera
    if unwrap:
        for k in range(phi.shape[1]):
            seen = np.isfinite(phi[:, k])
            phi[seen, k] = np.unwrap(phi[seen, k])

    def place(row: int, column: str) -> str:
        theirs = read.theirs.get(column, column)
        return f"row {row}, column {theirs}" if table is None else table.place(row, theirs)

    check_table(str(path), (t, phi, read.sigma_rad, read.frame), ColumnNames(read.names), place)
    if table is None or not table.has_instants:
        refuse_stamps(str(path), t, AnglesError, lambda row: place(row, "time_s"))
    return LinkAngles(
        t,
        phi,
        read.sigma_rad,
        read.frame,
        meta,
        label,
        camera,
        read.names,
        read.joints,
        read.covariance_rad2,
    )


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
"""Note on angles from a film without the camera's part."""


@dataclass(frozen=True, eq=False)
class _Read:
    """The parts of a table; ``theirs``: the file's name of each of our columns where it differs."""

    t_s: Floats
    phi_rad: Floats
    sigma_rad: Floats
    names: tuple[str, ...]
    meta: dict[str, Any]
    frame: NDArray[np.int64] | None = None
    joints: tuple[LinkJoint, ...] = ()
    camera_rad: Floats | None = None
    covariance_rad2: Floats | None = None
    table: Columns | None = None
    theirs: dict[str, str] = field(default_factory=dict)


def _read_camera(path: Path, table: Columns, stems: list[str]) -> Floats | None:
    """The camera's columns (T, L, 5) of a table; None where it has none.

    Raises :class:`AnglesError` where some are missing.
    """
    names = [f"camera{number + 1}_{stem}_rad" for stem in stems for number in range(CAMERA_NUMBERS)]
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
    columns = np.stack([table.values[name] for name in names], axis=1)
    return columns.reshape(table.rows, len(stems), CAMERA_NUMBERS)


def _read_covariance(
    path: Path, table: Columns, stems: list[str], sigma_rad: list[Floats | None]
) -> Floats | None:
    """The covariance (T, L, L) of the links' noise; None where a table has none.

    Raises :class:`AnglesError` where some are missing.
    """
    names = {
        (a, b): f"covariance_{stems[a]}_{stems[b]}_rad2"
        for a, b in itertools.combinations(range(len(stems)), 2)
    }
    missing = [name for name in names.values() if name not in table.values]
    sigmas = [s for s in sigma_rad if s is not None]
    if len(missing) == len(names) or len(sigmas) < len(stems):
        return None
    if missing:
        there = next(name for name in names.values() if name in table.values)
        raise AnglesError(
            fault(str(path), f"{there} is there and {missing[0]} is not", "Keep all covariances, or none")
        )
    out = np.zeros((table.rows, len(stems), len(stems)))
    for k, s in enumerate(sigmas):
        out[:, k, k] = s**2
    for (a, b), name in names.items():
        out[:, a, b] = out[:, b, a] = table.values[name]
    return out


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


def _read_table(path: Path, columns: dict[str, str]) -> _Read:
    for key in columns:
        if key != "time_s" and not OURS.fullmatch(key):
            raise AnglesError(
                fault(
                    str(path),
                    Setting("columns") + f" names {key!r}, which is not one of pydpend's",
                    "pydpend's are time_s, frame, phi1_rad, phi1_deg, sigma1_rad, sigma1_deg, phi2_rad, ..., or "
                    "with a link's name phi_NAME_rad, sigma_phi_NAME_rad",
                )
            )
    table = read_columns(
        path,
        [columns.get("time_s", "time_s"), *(columns[c] for c in columns if c != "time_s")],
        lambda header: [c for c in header if OURS.fullmatch(c) and c not in columns],
        error=AnglesError,
        time=columns.get("time_s", "time_s"),
        naming=Setting("columns"),
    )
    ours = [c for c in table.header if c in table.values and OURS.fullmatch(c) and c not in columns]
    theirs = {c: c for c in ours} | {"time_s": "time_s"} | columns
    _check_units(path, table, theirs)
    if table.rows == 0:
        raise AnglesError(fault(str(path), "the table has a header and no rows", "Give one row per instant"))
    stems = _stems(path, table, list(theirs))

    def column(stem: str, sigma: bool) -> Floats | None:
        rad, deg = (noise_beside(stem, unit) if sigma else f"{stem}_{unit}" for unit in ("rad", "deg"))
        if rad in theirs and deg in theirs:
            raise AnglesError(
                fault(str(path), f"both {theirs[rad]} and {theirs[deg]} are there", "Keep one of them")
            )
        if rad in theirs:
            return table.values[theirs[rad]]
        return np.radians(table.values[theirs[deg]]) if deg in theirs else None

    phis = [column(stem, sigma=False) for stem in stems]
    sigmas = [column(stem, sigma=True) for stem in stems]
    absent = np.full(table.rows, np.nan)
    meta = _read_meta(path, table)
    names, joints = _names(stems, meta.pop("links", None), meta.pop("joints", None))
    named = ColumnNames(names)
    for k, stem in enumerate(stems):
        unit = "rad" if f"{stem}_rad" in theirs else "deg"
        theirs[named.phi(k)] = theirs[f"{stem}_{unit}"]
        noise = next((c for u in ("rad", "deg") if (c := noise_beside(stem, u)) in theirs), None)
        if noise is not None:
            theirs[named.sigma(k)] = theirs[noise]
    return _Read(
        table.values[theirs["time_s"]],
        np.column_stack([absent if p is None else p for p in phis]),
        np.column_stack([absent if s is None else s for s in sigmas]),
        names,
        meta,
        _frames(path, table, theirs.get("frame")),
        joints,
        _read_camera(path, table, stems),
        _read_covariance(path, table, stems, sigmas),
        table,
        theirs,
    )


def _stems(path: Path, table: Columns, ours: list[str]) -> list[str]:
    """The angles' names in a table with some of our columns. Raises :class:`AnglesError` if there are none."""
    try:
        stems, lacking = stems_of(ours), 1
    except ValueError as problem:
        stems, lacking = [], problem.args[0]
    if stems:
        return stems
    later = ", and there are later ones" if lacking > 1 else ""
    raise AnglesError(
        fault(
            str(path),
            f"there is no column phi{lacking}_rad or phi{lacking}_deg{later}",
            f"The columns are {', '.join(table.header)}; say which holds the angle with "
            + Setting("columns"),
        )
    )


def _names(stems: list[str], links: object, joints: object) -> tuple[tuple[str, ...], tuple[LinkJoint, ...]]:
    """The links' names, by the columns or else by the metadata, and the joints between them, by the metadata."""
    names = tuple(s.removeprefix("phi_") for s in stems)
    if stems[0] == "phi1":
        known = (
            isinstance(links, list) and len(links) == len(stems) and all(isinstance(n, str) for n in links)
        )
        names = tuple(links) if known and isinstance(links, list) else numbered_names(len(stems))
    found = [j for j in joints if isinstance(j, dict)] if isinstance(joints, list) else []
    between = [(str(j.get("name")), j.get("links")) for j in found]
    return names, tuple(
        LinkJoint(name, (ends[0], ends[1]))
        for name, ends in between
        if isinstance(ends, list) and len(ends) == 2 and set(ends) <= set(names)
    )


def _frames(path: Path, table: Columns, column: str | None) -> NDArray[np.int64] | None:
    """Indices in the recording (T,), if the table has them."""
    if column is None:
        return None
    raw = table.values[column]
    bad = np.flatnonzero(~np.isfinite(raw) | (raw != np.rint(raw)))
    if bad.size:
        raise AnglesError(
            fault(
                str(path),
                f"{raw[bad[0]]} is not a frame's index",
                "Give whole numbers, or leave the column out",
                place=table.place(int(bad[0]), column),
            )
        )
    return raw.astype(np.int64)


def _read_meta(path: Path, table: Columns) -> dict[str, Any]:
    text = table.metadata.get(META_KEY)
    side = path.with_name(path.name + ".json")
    if text is None and table.lines is not None and side.is_file():
        text = read_text(side, AnglesError)
    if text is None:
        return {"source": str(path)}
    where = f"metadata {META_KEY} of {path}" if table.lines is None else str(side)
    return parse_json(text, where, AnglesError, "Write the table again").values


def _read_published(folder: Path) -> _Read:
    """``DPmean_data_RB{k}.npy`` and ``DPstd_data_RB{k}.npy`` of a folder: s, rad, rad."""
    t: Floats | None = None
    phis: list[Floats] = []
    sigmas: list[Floats] = []
    for k in itertools.count():
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
    meta = {"source": str(folder), "form": "published npy"}
    return _Read(t, np.column_stack(phis), np.column_stack(sigmas), numbered_names(len(phis)), meta)


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


@typed()
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
    path = path_of(path)
    told = {"links": list(angles.link_names), "joints": [asdict(j) for j in angles.joints]}
    meta = json.dumps({**angles.meta, **told, "name": angles.name}, sort_keys=True)
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
                        table.replace_schema_metadata({META_KEY: meta}),
                        file,
                        use_dictionary=False,
                        write_page_checksum=True,
                    )
            else:
                with new.open("w", encoding="utf-8", newline="") as text:
                    csv.writer(text, lineterminator="\n").writerow(columns)
                    for row in zip(*(v.tolist() for v in columns.values()), strict=True):
                        text.write(",".join("" if v != v else repr(v) for v in row) + "\n")
                # Where the CSV is, its metadata are too.
                write_text(written_files(path)[1], meta + "\n")
    except OSError as problem:
        raise AnglesError(
            fault(str(path), f"the file cannot be written ({problem.strerror})", "Check the folder")
        ) from problem
