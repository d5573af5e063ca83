"""Node tables in Python: where each marker is in each frame, and the rig it belongs to.

Image coordinates: x right, y down, pixel centres at integers, the first pixel is (0, 0).
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pydpend import _native
from pydpend.bare_nodes import bare_tracks, is_bare
from pydpend.crossing import Columns, HeldColumns
from pydpend.datasets import poses_dataset
from pydpend.errors import ArgumentError, Step, TableError, fault
from pydpend.kinds import kind_of, misplaced
from pydpend.marker_status import (
    AMBIGUOUS,
    MANUAL,
    MISSING,
    PLACED,
    REACQUIRED,
    SEEN,
    STATUS_WORDS,
    UNDECODED,
)
from pydpend.node_arrays import Bodies, Who, assembled
from pydpend.output import AnyPath, path_of
from pydpend.raw_tracks import RawTracks
from pydpend.rig import Joint, Node, Rig, rig_of
from pydpend.tabular import html_table
from pydpend.typed import typed, typed_class

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa
    import xarray as xr

__all__ = [
    "AMBIGUOUS",
    "MANUAL",
    "MISSING",
    "REACQUIRED",
    "SEEN",
    "STATUS_WORDS",
    "UNDECODED",
    "Bodies",
    "Joint",
    "Node",
    "Nodes",
    "Rig",
    "nodes_of",
    "nodes_of_dataset",
    "nodes_of_tracks",
    "read_nodes",
]


@typed_class()
@dataclass(frozen=True, eq=False)
class Nodes:
    """T frames of N nodes. What is not seen is NaN.

    Attributes
    ----------
    frame : ndarray of int64, shape (T,)
        Index in the recording, from 0.
    t_s : ndarray of float, shape (T,)
        Time in s, from the recording's time base, increasing.
    xy_px : ndarray of float, shape (T, N, 2)
        Centres in recorded pixels; x right, y down, the middle of the first pixel at (0, 0).
    sigma_px : ndarray of float32, shape (T, N)
        Standard uncertainty of each coordinate in square pixels as high as the recorded ones, the greater of the two;
        in recorded pixels that of x is as much smaller as these are wider than high.
    area_px : ndarray of float32, shape (T, N)
        Area of each blob, px; NaN of what a person placed.
    status : ndarray of uint8, shape (T, N)
        ``MISSING``, ``SEEN``, ``REACQUIRED``, ``AMBIGUOUS``, ``UNDECODED`` or ``MANUAL`` (0 to 5, in `pydpend.nodes`).
    rig : Rig
        The rig; its nodes are in the order of the arrays.
    meta : dict
        Recording (``source``), ``settings``, program (``tool``), ``ending`` of the run and, if frames are lost,
        ``damage``, as in the table.
    """

    frame: NDArray[np.int64]
    t_s: NDArray[np.float64]
    xy_px: NDArray[np.float64]
    sigma_px: NDArray[np.float32]
    area_px: NDArray[np.float32]
    status: NDArray[np.uint8]
    rig: Rig
    meta: dict[str, Any] = field(default_factory=dict)

    @classmethod
    @typed()
    def from_arrays(
        cls,
        t_s: ArrayLike,
        xy_px: ArrayLike,
        *,
        names: Sequence[str] | None = None,
        bodies: Mapping[str, Sequence[str]] | Sequence[str] | None = None,
        sigma_px: ArrayLike | None = None,
        frame: ArrayLike | None = None,
        image_px: tuple[int, int] | None = None,
    ) -> Nodes:
        """Nodes of places that anyone found, in T frames of N nodes.

        Parameters
        ----------
        t_s : array_like, shape (T,)
            Time of each frame, s, increasing.
        xy_px : array_like, shape (T, N, 2)
            Places in px: x right, y down, the middle of the first pixel at (0, 0). NaN where a node is not seen.
        names : sequence of str, optional
            Names of the nodes (N); n0, n1, ... by default.
        bodies : dict of str to sequence of str, or sequence of str, optional
            Nodes of each body, in the order from the pivot outwards, or the body of each node (N). A node of no body is
            one by itself.
        sigma_px : array_like, optional
            Standard uncertainty of each coordinate in px, above 0, for all, each node (N,) or each place (T, N). By
            default how the places scatter about smooth motion.
        frame : array_like of int, shape (T,), optional
            Numbers of the frames, increasing from 0 or more; 0, 1, ... by default.
        image_px : tuple of int, optional
            Width and height of the pictures, px. By default all places are held.

        Returns
        -------
        Nodes
            The nodes; what was taken for what is not given stands in `notes`.

        Raises
        ------
        ArgumentError
            If shapes do not fit, a time does not increase or is no number, half a place is given, or a name or body is
            not known; with the frame at fault.
        """
        times = _array("t_s", t_s, 1)
        places = _array("xy_px", xy_px, 3)
        count, width, axes = places.shape
        if times.size != count or axes != 2:
            shapes = f"the shapes are {times.shape} and {places.shape}"
            raise ArgumentError(
                fault("t_s and xy_px", shapes, "Give (T,) and (T, N, 2) for T frames of N nodes")
            )
        numbers = np.arange(count) if frame is None else _array("frame", frame, 1)
        if numbers.shape != (count,) or np.any(numbers != np.round(numbers)) or np.any(np.diff(numbers) <= 0):
            raise ArgumentError(
                fault("frame", "it is no number of each frame", f"Give {count} whole numbers that increase")
            )
        called = tuple(f"n{i}" for i in range(width)) if names is None else tuple(map(str, names))
        if len(called) != width:
            raise ArgumentError(fault("names", f"{len(called)} names for {width} nodes", "Give one for each"))
        sigma = None
        if sigma_px is not None:
            try:
                sigma = np.broadcast_to(np.asarray(sigma_px, dtype=np.float64), (count, width))
            except ValueError as problem:
                advice = f"Give one number, ({width},) or ({count}, {width})"
                raise ArgumentError(fault("sigma_px", "its shape does not fit", advice)) from problem
        tracks = RawTracks(
            "arrays",
            "",
            called,
            numbers.astype(np.int64),
            places,
            times,
            sigma=sigma,
            image_px=image_px,
        )
        return cls(*assembled(tracks, bodies))

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.frame)

    def __repr__(self) -> str:
        """A line for people."""
        seen = 100 * float(np.mean(self.seen)) if self.status.size else 0.0
        name = self.meta.get("source", {}).get("name", "nodes")
        return f"<Nodes {name}: {len(self)} frames x {len(self.rig.nodes)} nodes, {seen:.1f} % seen>"

    def _repr_html_(self) -> str:
        """The sight of each node, for a notebook."""
        rows = []
        for i, node in enumerate(self.rig.nodes):
            seen = self.seen[:, i]
            sigma = f"{float(np.median(self.sigma_px[seen, i])):.4f}" if seen.any() else "-"
            rows.append((node.name, node.body, f"{100 * seen.mean() if seen.size else 0:.1f} %", sigma))
        return html_table(repr(self)[1:-1], ("node", "body", "seen", "median sigma (px)"), rows)

    @property
    def seen(self) -> NDArray[np.bool_]:
        """Whether a place is known, (T, N): found in the film, or said by a person."""
        seen: NDArray[np.bool_] = np.isin(self.status, PLACED)
        return seen

    @property
    def complete(self) -> bool:
        """Whether the run came to the end of what it was asked for and the recording was whole."""
        ending = self.meta.get("ending", {})
        return bool(ending.get("kind") == "complete")

    @property
    def damage(self) -> str | None:
        """The frames lost to damage, in a sentence; None if none are.

        Raises
        ------
        TableError
            If ``meta["damage"]`` is not that of a table.
        """
        damage = self.meta.get("damage")
        return None if damage is None else _native.damage_words(json.dumps(damage))

    @property
    def edits(self) -> str | None:
        """How many rows a person decided and where, in a sentence; None if no edits were given."""
        edits = self.meta.get("settings", {}).get("edits")
        return None if edits is None else str(edits.get("words"))

    @property
    def notes(self) -> tuple[str, ...]:
        """Assumptions where the nodes are not our tracker's, in sentences; empty where they are."""
        imported = self.meta.get("settings", {}).get("import", {})
        return tuple(str(note) for note in imported.get("notes", ()))

    def check(self) -> None:
        """Checks the table's invariants: shapes, increasing frames and times, places exactly where seen.

        Raises
        ------
        TableError
            Naming the first row at fault.
        ArgumentError
            If an array has the wrong type or shape.
        """
        _native.check_table(self._columns(), self._meta_json())

    @typed()
    def write(self, path: AnyPath, *, safe_csv: bool = False) -> None:
        """Writes the table, Parquet or CSV (with its `.json`) by the ending, replacing what is there.

        Parameters
        ----------
        path : path-like
            The file.
        safe_csv : bool
            Whether names in a CSV that a spreadsheet would take for a formula (they begin with ``=``, ``+``, ``-``,
            ``@``, a tab or a carriage return) get a ``'`` before them. `read_nodes` takes it off again.

        Raises
        ------
        TableError
            If the table is not valid or the file cannot be written.
        ArgumentError
            If an array has the wrong type or shape.
        """
        _native.write_table(os.fsdecode(path), self._columns(), self._meta_json(), safe_csv)

    def to_dataframe(self) -> pd.DataFrame:
        """The table as pandas has it; pandas must be installed.

        Returns
        -------
        pandas.DataFrame
            One row per frame and node, in the columns of the file (docs/reference/conventions.md);
            names are categories.
        """
        frame: pd.DataFrame = self.to_arrow().to_pandas()
        return frame

    def to_arrow(self) -> pa.Table:
        """The table as Arrow has it.

        Returns
        -------
        pyarrow.Table
            One row per frame and node, in the columns of the file (docs/reference/conventions.md).
        """
        import pyarrow as pa

        return pa.table(self)

    def to_xarray(self) -> xr.Dataset:
        """The nodes as movement has poses; xarray must be installed.

        Returns
        -------
        xarray.Dataset
            ``position`` (px, y down) with the dimensions time (s), space (x, y), keypoints (the nodes) and individuals
            (one), NaN where not seen; ``confidence`` NaN, as it is not known; ``sigma_px``, ``area_px`` and ``status``;
            the coordinates ``frame`` and ``body``; ``rig`` and ``meta`` as JSON in the attributes. `dp.read_tracks`
            reads it, with all that is in it.

        Raises
        ------
        TableError
            If xarray is not installed.
        ArgumentError
            If an array has the wrong type or shape.
        """
        width, height = self.rig.image_px
        about = {
            "image_px": [width, height],
            "rig": self.rig.to_json(),
            "meta": json.dumps(self.meta),
        }
        return poses_dataset(self._columns(), self.rig.names, [n.body for n in self.rig.nodes], about)

    def __arrow_c_stream__(self, requested_schema: object | None = None) -> object:
        """The table as an Arrow stream: `pyarrow.table(nodes)`, `polars.DataFrame(nodes)`.

        `polars.from_arrow(nodes)` gives the same as one column of structs, as of every such stream.
        """
        reader = _native.arrow_reader(self._columns(), self.rig.to_json())
        return reader.__arrow_c_stream__(requested_schema)

    def _columns(self) -> HeldColumns:
        columns = (self.frame, self.t_s, self.xy_px, self.sigma_px, self.area_px, self.status)
        wanted = (
            ("frame", np.int64, 1),
            ("t_s", np.float64, 1),
            ("xy_px", np.float64, 3),
            ("sigma_px", np.float32, 2),
            ("area_px", np.float32, 2),
            ("status", np.uint8, 2),
        )
        for array, (name, dtype, dimensions) in zip(columns, wanted, strict=True):
            if not isinstance(array, np.ndarray) or array.dtype != dtype or array.ndim != dimensions:
                found = (
                    f"{array.dtype} of {array.ndim} dimensions"
                    if isinstance(array, np.ndarray)
                    else "no array"
                )
                raise ArgumentError(
                    fault(name, f"it is {found}", f"Give {np.dtype(dtype)} of {dimensions} dimensions")
                )
        return columns

    def _meta_json(self) -> str:
        meta = {key: value for key, value in self.meta.items() if key != "rig"}
        missing = [
            key for key in ("schema_version", "tool", "source", "settings", "ending") if key not in meta
        ]
        if missing:
            raise ArgumentError(
                fault(
                    "meta",
                    f"it lacks {', '.join(missing)}",
                    "Keep the meta of the nodes that these come from",
                )
            )
        return json.dumps({**meta, "rig": json.loads(self.rig.to_json())})


def nodes_of_dataset(dataset: Any, source: str) -> Nodes:
    """Nodes of what `Nodes.to_xarray` gave. Raises TableError or RigError if it is not that."""
    try:
        arrays = [dataset[name].values[..., 0] for name in ("sigma_px", "area_px", "status")]
        sigma_px, area_px, status = arrays
        nodes = Nodes(
            dataset["frame"].values.astype(np.int64),
            dataset["time"].values.astype(np.float64),
            np.ascontiguousarray(dataset["position"].values[..., 0].transpose(0, 2, 1), dtype=np.float64),
            sigma_px.astype(np.float32),
            area_px.astype(np.float32),
            status.astype(np.uint8),
            Rig.from_json(dataset.attrs["rig"]),
            json.loads(dataset.attrs["meta"]),
        )
        nodes.check()
    except (KeyError, ValueError, TypeError, AttributeError, IndexError) as problem:
        raise TableError(
            fault(source, f"it is no dataset of nodes ({problem})", "Write it again")
        ) from problem
    return nodes


def _array(name: str, value: ArrayLike, dimensions: int) -> NDArray[np.float64]:
    """A caller's numbers as an array of so many dimensions, a copy. Raises ArgumentError naming it."""
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError) as problem:
        raise ArgumentError(fault(name, f"it is no array of numbers ({problem})", "Give one")) from problem
    if array.ndim != dimensions:
        raise ArgumentError(fault(name, f"its shape is {array.shape}", f"Give {dimensions} dimensions"))
    return array


def nodes_of(columns: Columns) -> Nodes:
    """Nodes of what the compiled half hands over."""
    frame, t_s, xy_px, sigma_px, area_px, status, text = columns
    meta = json.loads(text)
    rig = rig_of(meta.pop("rig"))
    return Nodes(frame, t_s, xy_px, sigma_px, area_px, status, rig, meta)


@typed()
def read_nodes(path: AnyPath) -> Nodes:
    """Nodes from a table, Parquet or CSV; every value is checked.

    A table that has our metadata is read by the ending of its name. One that has none, from any program, is told by its
    columns ``frame``, ``time_s``, ``node``, ``x_px`` and ``y_px``, beside which ``body``, ``sigma_px``, ``area_px`` and
    ``status`` may stand; what is assumed of it stands in `Nodes.notes`.

    Parameters
    ----------
    path : path-like
        A table written by `pydpend track`, `Nodes.write` or anyone.

    Returns
    -------
    Nodes
        The nodes.

    Raises
    ------
    TableError
        Naming the row, line or column at fault, or a schema version that is not known.
    RigError
        If the rig in it is wrong.
    """
    file = path_of(path)
    said = misplaced(file, ("nodes",)) if kind_of(file) == "tracks" else None
    if said is not None:
        raise TableError(said)
    if is_bare(file):
        return nodes_of_tracks(bare_tracks(file))
    return nodes_of(_native.read_table(os.fsdecode(path)))


def nodes_of_tracks(tracks: RawTracks, bodies: Bodies = None) -> Nodes:
    """Nodes of tracks in pixels. Raises TableError if they have no times, and naming what else is wrong."""
    if tracks.t_s is None:
        step = Step("pydpend import FILE --fps RATE -o nodes.parquet", "dp.read_tracks(path, fps=...)")
        raise TableError(fault(tracks.source, "there is no column time_s", "Give the rate: " + step))
    return Nodes(*assembled(tracks, bodies, Who(tracks.source)))
