"""Results in the forms that other people's programs ask for: nodes as C3D, TRC, DLTdv's xypts CSV, MAT, NetCDF, Excel.

Angles, states and other tables are `pydpend.table_exports`' part.

C3D and TRC are three-dimensional and in a length: x right, y up from the lowest row of pixels, z zero, in mm if a
scale is given and else in px, which the file then says. What is not seen is what each form has for it.
"""

from __future__ import annotations

import os
import struct
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pydpend.errors import ArgumentError, Setting, TableError, fault
from pydpend.nodes import STATUS_WORDS, Nodes
from pydpend.output import path_of, whole
from pydpend.table_exports import TABLE_WRITERS, write_excel, write_netcdf
from pydpend.tabular import TableResult
from pydpend.typed import typed

LEAST_EVEN = 1e-6
"""A rate is one number, so steps of time may differ by so much of a step; time stamps in whole ticks do not."""


SCALED = (".c3d", ".trc")
"""Endings of the forms that have a unit of length."""

LAST_C3D_FRAME = 65534
"""C3D's header numbers frames from 1 with 16 bits, and 65535 stands for "more": what readers then do differs (ezc3d 1.7
gives the first 65535 frames, c3d 0.6 fails)."""


RESIDUAL_STEPS = 127
"""C3D's residuals have seven bits."""


@typed()
def export(
    result: Nodes | TableResult, path: str | os.PathLike[str], *, px_per_m: float | None = None
) -> None:
    """Writes nodes, angles, states or another table for another program, by the ending of the file.

    Nodes: `.c3d`, `.trc`, `.csv` (DLTdv's xypts), `.mat`, `.nc` (NetCDF as movement has poses) and `.xlsx`. Angles,
    states and other tables: `.csv`, `.mat`, `.nc`, `.xlsx`, `.parquet`, and `.mot` or `.sto` (OpenSim's, in rad).

    Parameters
    ----------
    result : Nodes, LinkAngles, LinkStates or another result that is a table
        The result.
    path : path-like
        The file; one that is there is replaced when the new one is whole.
    px_per_m : float, optional
        Scale of the image, px per m; C3D and TRC are then in mm. The others are in px.

    Raises
    ------
    ArgumentError
        If the ending is not known or the scale makes no sense.
    TableError
        If the form cannot hold the table (C3D and TRC need one rate, C3D ends at frame 65534 counted from 1, a sheet of
        Excel at row 1048576), a library for it is not installed, or the file cannot be written.
    """
    target = path_of(path)
    known: tuple[str, ...] = tuple(WRITERS if isinstance(result, Nodes) else TABLE_WRITERS)
    ending = target.suffix.lower()
    if ending not in known:
        raise ArgumentError(
            fault(str(target), f"the ending is none of {', '.join(known)}", "Choose one of them")
        )
    if px_per_m is not None and not (np.isfinite(px_per_m) and px_per_m > 0):
        raise ArgumentError(
            fault(Setting("px_per_m"), f"{px_per_m} is no scale", "Give pixels per metre, above 0")
        )
    if isinstance(result, Nodes):
        result.check()
        if ending == ".c3d":
            _numbered(result, str(target))
    try:
        with whole(target) as new:
            if isinstance(result, Nodes):
                WRITERS[ending](result, new, px_per_m, target.name)
            else:
                TABLE_WRITERS[ending](result, new, target.name)
    except OSError as error:
        raise TableError(
            fault(str(target), f"it cannot be written ({error})", "Choose another folder")
        ) from error


def rate_hz(nodes: Nodes, name: str) -> float:
    """The one rate of a table whose times are evenly spaced."""
    if len(nodes) < 2:
        raise TableError(fault(name, "one frame has no rate", "Write it as .mat"))
    steps = np.diff(nodes.t_s)
    step = float(np.median(steps))
    uneven = np.flatnonzero(np.abs(steps - step) > LEAST_EVEN * step)
    if uneven.size:
        row = int(uneven[0])
        raise TableError(
            fault(name, f"after frame {nodes.frame[row]} the step is {steps[row]} s, else {step} s; this form has "
                  "one rate", "Write it as .mat, which holds the times")
        )  # fmt: skip
    return 1 / step


def _upright(nodes: Nodes, px_per_m: float | None) -> tuple[NDArray[np.float64], str]:
    """(T, N, 3): x right, y up, z 0, and the unit; pixels are square ones."""
    out = np.zeros((*nodes.status.shape, 3))
    width, height = nodes.rig.pixel_aspect
    out[..., 0] = nodes.xy_px[..., 0] * (width / height)
    out[..., 1] = nodes.rig.image_px[1] - 1 - nodes.xy_px[..., 1]
    out[..., 2] = np.where(nodes.seen, 0.0, np.nan)
    return (out, "px") if px_per_m is None else (out * (1000 / px_per_m), "mm")


def _numbered(nodes: Nodes, name: str) -> None:
    """Refuses frames that C3D has no number for."""
    first = int(nodes.frame[0]) + 1 if len(nodes) else 1
    last = first + len(nodes) - 1
    if last > LAST_C3D_FRAME:
        raise TableError(
            fault(
                name,
                f"its frames would have the numbers {first} to {last}, and those of C3D end at {LAST_C3D_FRAME}",
                "Write it as .trc, .csv or .mat, which have no such end",
            )
        )


def _c3d(nodes: Nodes, path: Path, px_per_m: float | None, name: str) -> None:
    try:
        import ezc3d
    except ImportError:
        raise TableError(
            fault(name, "C3D is written by ezc3d, which is not installed", "pip install 'pydpend[export]'")
        ) from None
    places, unit = _upright(nodes, px_per_m)
    scale = 1.0 if px_per_m is None else 1000 / px_per_m
    points = np.ones((4, places.shape[1], places.shape[0]))
    points[:3] = places.transpose(2, 1, 0)
    file = ezc3d.c3d()
    parameters = file["parameters"]["POINT"]
    parameters["RATE"]["value"] = [rate_hz(nodes, name)]
    parameters["LABELS"]["value"] = list(nodes.rig.names)
    parameters["UNITS"]["value"] = [unit]
    file["data"]["points"] = points
    # The residual is the length of the uncertainty in whole steps, of which ezc3d cuts the decimals off; 0 is C3D's
    # word for a point that was filled in, -1 for one that is not there.
    step = float(np.max(nodes.sigma_px, where=nodes.seen, initial=0.0)) * scale / RESIDUAL_STEPS or 1.0
    steps = np.maximum(np.rint(nodes.sigma_px * (scale / step)), 1)
    residuals = np.where(nodes.seen, (steps + 0.25) * step, -1.0)
    parameters["SCALE"]["value"] = [-step]
    file["data"]["meta_points"]["residuals"] = residuals.T[None]
    file["header"]["points"]["first_frame"] = int(nodes.frame[0])
    # ezc3d takes names in UTF-8 only, and the folder's may be none.
    with tempfile.TemporaryDirectory() as folder:
        plain = Path(folder) / "nodes.c3d"
        file.write(str(plain))
        data = bytearray(plain.read_bytes())
    # ezc3d has the step in POINT:SCALE alone, and the header has it too.
    data[12:16] = struct.pack("<f", -step)
    path.write_bytes(data)


def _trc(nodes: Nodes, path: Path, px_per_m: float | None, name: str) -> None:
    places, unit = _upright(nodes, px_per_m)
    rate = f"{rate_hz(nodes, name):.9g}"
    names = nodes.rig.names
    count, first = len(nodes), int(nodes.frame[0]) + 1
    head = [
        f"PathFileType\t4\t(X/Y/Z)\t{name}",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
        f"{rate}\t{rate}\t{count}\t{len(names)}\t{unit}\t{rate}\t{first}\t{count}",
        "Frame#\tTime\t" + "\t\t\t".join(names),
        "\t\t" + "\t".join(f"X{i}\tY{i}\tZ{i}" for i in range(1, len(names) + 1)),
        "",
    ]
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write("\n".join(head) + "\n")
        for t in range(count):
            # Frames count from 1 here; what is not seen is left empty.
            cells = ("" if np.isnan(v) else repr(v) for v in places[t].ravel().tolist())
            file.write(f"{nodes.frame[t] + 1}\t{float(nodes.t_s[t])!r}\t" + "\t".join(cells) + "\n")


def _dltdv(nodes: Nodes, path: Path, px_per_m: float | None, name: str) -> None:
    """Pixels as MATLAB has them: the first is 1, and DLTdv counts rows from the lowest. A row per video frame."""
    names = [f"pt{i}_cam1_{axis}" for i in range(1, len(nodes.rig.nodes) + 1) for axis in "XY"]
    rows = np.full((int(nodes.frame[-1]) + 1 if len(nodes) else 0, len(names)), np.nan)
    rows[nodes.frame, 0::2] = nodes.xy_px[..., 0] + 1
    rows[nodes.frame, 1::2] = nodes.rig.image_px[1] - nodes.xy_px[..., 1]
    # Digits that give each number back.
    lines = (",".join("nan" if v != v else repr(v) for v in row) for row in rows.tolist())
    path.write_text("\n".join([",".join(names), *lines]) + "\n", "utf-8")


def _mat(nodes: Nodes, path: Path, px_per_m: float | None, name: str) -> None:
    from scipy.io import savemat

    text = np.array(nodes.rig.names, dtype=object)
    bodies = np.array([n.body for n in nodes.rig.nodes], dtype=object)
    content = {
        "frame": nodes.frame[:, None],
        "time_s": nodes.t_s[:, None],
        "x_px": nodes.xy_px[..., 0],
        "y_px": nodes.xy_px[..., 1],
        "sigma_px": nodes.sigma_px,
        "area_px": nodes.area_px,
        "status": nodes.status,
        "status_words": np.array(STATUS_WORDS, dtype=object),
        "node": text,
        "body": bodies,
        "image_px": np.array(nodes.rig.image_px, dtype=float),
        "pixel_aspect": np.array(nodes.rig.pixel_aspect, dtype=float),
        "rig_json": nodes.rig.to_json(),
    }
    savemat(path, content, do_compression=True)


def _netcdf(nodes: Nodes, path: Path, px_per_m: float | None, name: str) -> None:
    write_netcdf(nodes.to_xarray(), path, name)


def _excel(nodes: Nodes, path: Path, px_per_m: float | None, name: str) -> None:
    write_excel(nodes.to_dataframe, nodes.status.size, path, name)


WRITERS: dict[str, Callable[[Nodes, Path, float | None, str], None]] = {
    ".c3d": _c3d,
    ".trc": _trc,
    ".csv": _dltdv,
    ".mat": _mat,
    ".nc": _netcdf,
    ".xlsx": _excel,
}
