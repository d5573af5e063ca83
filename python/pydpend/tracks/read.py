"""`read_tracks`: tracks of any known program from a file, several files or a table in memory."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from pydpend.bare_nodes import bare_tracks, tracks_of
from pydpend.errors import ArgumentError, OptionError, TableError, fault
from pydpend.kinds import expect, kind_of, tracks_form
from pydpend.long_table import of_frame
from pydpend.node_arrays import Who, assembled
from pydpend.nodes import Nodes, nodes_of_dataset
from pydpend.output import AnyPath, path_of
from pydpend.raw_tracks import RawTracks
from pydpend.track_forms import Form, form_of, form_of_columns
from pydpend.tracks import deeplabcut, marked, motion_capture, particles, pose_files, wide_text
from pydpend.tracks.merging import merged
from pydpend.tracks.placing import Wishes, placed
from pydpend.typed import typed

READERS: dict[Form, Callable[[Path, Sequence[str]], RawTracks]] = {
    "nodes": lambda path, names: bare_tracks(path),
    "dltdv": wide_text.dltdv,
    "osp_text": marked.osp_text,
    "osp_trk": marked.osp_trk,
    "kinovea_csv": wide_text.kinovea_csv,
    "kinovea_text": wide_text.kinovea_text,
    "kinovea_kva": marked.kinovea_kva,
    "deeplabcut_csv": wide_text.deeplabcut_csv,
    "deeplabcut_h5": deeplabcut.deeplabcut_h5,
    "sleap_h5": pose_files.sleap_h5,
    "sleap_slp": pose_files.sleap_slp,
    "sleap_csv": wide_text.sleap_csv,
    "trackpy": particles.trackpy,
    "laptrack": particles.laptrack,
    "trackmate_csv": particles.trackmate_csv,
    "trackmate_xml": particles.trackmate_xml,
    "trackmate_tracks": particles.trackmate_tracks,
    "trc": motion_capture.trc,
    "c3d": motion_capture.c3d,
    "qualisys": motion_capture.qualisys,
    "movement": pose_files.movement,
}
"""The reader of each form: from the file and the points that are wanted."""


@typed("source")
def read_tracks(
    source: Any,
    *,
    fps: float | None = None,
    bodies: Mapping[str, Sequence[str]] | Sequence[str] | None = None,
    nodes: Sequence[str] = (),
    unit: str | None = None,
    y_axis: str | None = None,
    plane: str | None = None,
    image_px: tuple[int, int] | None = None,
    min_confidence: float | None = None,
    sigma_px: float | None = None,
) -> Nodes:
    """Nodes of tracks that another program found; whose they are is told from the content.

    Read are DLTdv's xypts, OSP Tracker's text and ``.trk``, Kinovea's CSV, text and ``.kva``, DeepLabCut's HDF5 and
    CSV, SLEAP's analysis HDF5, CSV and ``.slp``, trackpy's and laptrack's tables, TrackMate's table and XML, TRC, C3D,
    Qualisys's TSV, movement's NetCDF, and node tables (docs/how-to/other-programs.md).

    Parameters
    ----------
    source : path-like, sequence of path-like, pandas.DataFrame, pyarrow.Table or xarray.Dataset
        A file, several of one program with points of one film, or the table itself.
    fps : float, optional
        Frames per s of the camera; replaces the times of the file. Needed where that has none.
    bodies : dict of str to sequence of str, or sequence of str, optional
        Nodes of each body, from the pivot outwards, or the body of each node. A node of no body is one by itself.
    nodes : sequence of str, optional
        Points that are taken, in this order; all by default.
    unit : {"px", "m", "cm", "mm", "um", "in"}, optional
        Unit of the places, where the file does not say it. Of lengths 1 px stands for 1 mm.
    y_axis : {"down", "up"}, optional
        Direction of y, where it is not as the program has it.
    plane : {"xy", "xz", "yz"}, optional
        Coordinates of three that are the mechanism's plane, to the right and up; the two that vary most by default.
    image_px : tuple of int, optional
        Width and height of the pictures, px, where the file does not say it.
    min_confidence : float, optional
        Confidence, 0 to 1, below which a place is missing; by default that of the program.
    sigma_px : float, optional
        Standard uncertainty of each coordinate, px; by default the file's, or how the places scatter.

    Returns
    -------
    Nodes
        The nodes; `Nodes.notes` and the metadata say what was assumed.

    Raises
    ------
    TableError
        Naming file and place: what is no form that is known, has no times, no known unit, or is damaged.
    OptionError, ArgumentError
        For a setting that makes no sense or that these tracks have no use for.
    WrongTypeError
        For what is neither a file nor a table.
    """
    wishes = Wishes(fps, tuple(nodes), unit, y_axis, plane, image_px, min_confidence, sigma_px)
    several = isinstance(source, (list, tuple))
    own = None if several else _own(source)
    if own is not None:
        if wishes != Wishes() or bodies is not None:
            raise OptionError(
                fault("source", "it is nodes with all that is known of them", "Leave out the settings")
            )
        return own
    parts = [_raw(one, wishes.nodes) for one in (source if several else [source])]
    if not parts:
        raise ArgumentError(fault("source", "there is no file", "Give at least one"))
    raw = placed(merged(parts), wishes)
    return Nodes(*assembled(raw, bodies, Who(raw.source)))


def _own(source: Any) -> Nodes | None:
    """The nodes of a dataset that `Nodes.to_xarray` gave, or of its file; None for anything else."""
    if hasattr(source, "data_vars"):
        return nodes_of_dataset(source, "the dataset") if "rig" in source.attrs else None
    if not isinstance(source, (str, bytes, os.PathLike)) or tracks_form(path_of(source)) != "movement":
        return None
    dataset = pose_files.opened(path_of(source))
    return nodes_of_dataset(dataset, os.fsdecode(source)) if "rig" in dataset.attrs else None


def _raw(source: Any, names: Sequence[str]) -> RawTracks:
    """The tracks of a file or a table, as they are."""
    if isinstance(source, (str, bytes, os.PathLike)):
        return _of_file(path_of(source), names)
    if hasattr(source, "data_vars"):
        return pose_files.of_dataset(source, "the dataset")
    if getattr(getattr(source, "columns", None), "nlevels", 1) > 1:
        return deeplabcut.of_deeplabcut_frame(source, "the table")
    table = of_frame(source, "the table", ())
    form = form_of_columns(table.header)
    if form == "nodes":
        return tracks_of(table)
    if form == "trackpy":
        return particles.of_trackpy(table)
    if form == "laptrack":
        return particles.of_laptrack(table)
    problem = f"its columns are of no form that is known: {', '.join(map(str, table.header[:20]))}"
    advice = "Give node, x_px, y_px and frame or time_s, or the columns of trackpy or laptrack"
    raise TableError(fault("the table", problem, advice))


def _of_file(path: AnyPath, names: Sequence[str]) -> RawTracks:
    file = path_of(path)
    if not file.exists():
        raise TableError(fault(str(file), "there is no such file", "Check the path"))
    kind = kind_of(file)
    if kind == "nodes":
        return bare_tracks(file)
    form = tracks_form(file)
    if form is None:
        expect(file, ("nodes", "tracks"), TableError)
        form = form_of(file, is_sure=False)
    if form is not None:
        return READERS[form](file, names)
    advice = "docs/how-to/other-programs.md lists the forms; frame, time_s, node, x_px, y_px in a CSV are always read"
    raise TableError(fault(str(file), "it is of no form of tracks that is known", advice))
