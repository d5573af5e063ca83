"""Node tables in Python: where each marker is in each frame, and the rig it belongs to.

Image coordinates: x right, y down, pixel centres at integers, the first pixel is (0, 0).
"""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pydpend import _native
from pydpend.crossing import Columns, HeldColumns
from pydpend.errors import ArgumentError, fault
from pydpend.output import AnyPath
from pydpend.tabular import html_table

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

MISSING, SEEN, REACQUIRED, AMBIGUOUS, UNDECODED = range(5)
"""Numbers in `Nodes.status`: not seen; seen; the first frame back; may be it, but another name is possible; the
frame could not be decoded."""

STATUS_WORDS = ("missing", "seen", "reacquired", "ambiguous", "undecoded")


@dataclass(frozen=True)
class Node:
    """One marker of a rig.

    Attributes
    ----------
    name, body : str
        The marker's name and its body's.
    x_px, y_px : float
        Centre in the reference picture, px; x right, y down.
    """

    name: str
    body: str
    x_px: float
    y_px: float


@dataclass(frozen=True)
class Joint:
    """A point that two bodies share, or with one body the fixed pivot.

    Attributes
    ----------
    name : str
        The joint's name.
    bodies : tuple of str
        Names of its one or two bodies.
    x_px, y_px : float
        Place in the reference picture, px; x right, y down.
    """

    name: str
    bodies: tuple[str, ...]
    x_px: float
    y_px: float


@dataclass(frozen=True)
class Rig:
    """Nodes, bodies and joints, and the picture in which they stand so.

    Places are in recorded pixels, x right, y down; bodies are rigid in square pixels,
    with a camera in the plane that it films.

    Attributes
    ----------
    image_px : tuple of int
        Width and height of the recording, px.
    nodes : tuple of Node
        The markers by body, along it; the order of all arrays over nodes.
    bodies : tuple of str
        Names of the links from the pivot outwards.
    joints : tuple of Joint
        The joints with the pivot first.
    reference_frame : int or None
        Index of the reference picture in the recording.
    region : dict or None
        Part of the picture that is looked at, as in the rig file.
    lens : dict or None
        Distortion of the lens, as in the rig file.
    pixel_aspect : tuple of int
        Width and height of a pixel (16, 15 for pixels 1.0667 times as wide as high).
    camera : dict or None
        Tilt and lens of the camera that films the plane, as in the rig file.
    """

    image_px: tuple[int, int]
    nodes: tuple[Node, ...]
    bodies: tuple[str, ...]
    joints: tuple[Joint, ...] = ()
    reference_frame: int | None = None
    region: dict[str, Any] | None = None
    lens: dict[str, Any] | None = None
    pixel_aspect: tuple[int, int] = (1, 1)
    camera: dict[str, Any] | None = None

    @staticmethod
    def read(path: AnyPath) -> Rig:
        """A rig from its file (TOML), as `tracker setup` writes it.

        Parameters
        ----------
        path : path-like
            The rig file.

        Returns
        -------
        Rig
            The rig.

        Raises
        ------
        RigError
            Naming the line or key at fault.
        """
        return Rig.from_json(_native.read_rig(os.fsdecode(path)))

    @staticmethod
    def from_json(text: str) -> Rig:
        """A rig from the JSON of a table's metadata.

        Parameters
        ----------
        text : str
            What `to_json` gave.

        Returns
        -------
        Rig
            The rig.

        Raises
        ------
        RigError
            Naming what is wrong.
        """
        _native.rig_toml(text)  # refuses what is no rig
        return _rig(json.loads(text))

    def to_dict(self) -> dict[str, Any]:
        """The rig as plain values.

        Returns
        -------
        dict
            The keys of a rig file.
        """
        value: dict[str, Any] = json.loads(self.to_json())
        return value

    def to_json(self) -> str:
        """The rig as the JSON of a table's metadata.

        Returns
        -------
        str
            `to_dict` as text.
        """
        value: dict[str, Any] = {"schema": 1, "image_px": list(self.image_px)}
        width, height = self.pixel_aspect
        if width != height:
            value["pixel_aspect"] = f"{width}:{height}"
        for key in ("reference_frame", "region", "lens", "camera"):
            if getattr(self, key) is not None:
                value[key] = getattr(self, key)
        value["body"] = [{"name": name} for name in self.bodies]
        value["node"] = [{"name": n.name, "body": n.body, "x_px": n.x_px, "y_px": n.y_px} for n in self.nodes]
        value["joint"] = [
            {"name": j.name, "bodies": list(j.bodies), "x_px": j.x_px, "y_px": j.y_px} for j in self.joints
        ]
        return json.dumps(value)

    def to_toml(self) -> str:
        """The rig as the text of a rig file.

        Returns
        -------
        str
            TOML that `Rig.read` reads.

        Raises
        ------
        RigError
            If the rig is wrong in itself.
        """
        return _native.rig_toml(self.to_json())

    def write(self, path: AnyPath) -> None:
        """Writes a rig file.

        Parameters
        ----------
        path : path-like
            The file; one that is there is replaced.

        Raises
        ------
        RigError
            If the rig is wrong in itself or the file cannot be written.
        """
        _native.write_rig(os.fsdecode(path), self.to_json())

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the nodes, in the order of the arrays."""
        return tuple(n.name for n in self.nodes)

    def indices(self, body: str) -> NDArray[np.intp]:
        """Indices of a body's nodes, in the order of the arrays.

        Parameters
        ----------
        body : str
            Name of the body.

        Returns
        -------
        ndarray of int, shape (K,)
            Places of its K nodes in `nodes`.

        Raises
        ------
        ArgumentError
            If there is no such body.
        """
        if body not in self.bodies:
            raise ArgumentError(
                fault("body", f"{body!r} is not in the rig", f"It has {', '.join(self.bodies)}")
            )
        return np.array([i for i, n in enumerate(self.nodes) if n.body == body], dtype=np.intp)

    def places_px(self) -> NDArray[np.float64]:
        """Centres of the nodes in the reference picture.

        Returns
        -------
        ndarray of float, shape (N, 2)
            Places in px; x right, y down.
        """
        return np.array([[n.x_px, n.y_px] for n in self.nodes])


def _rig(value: dict[str, Any]) -> Rig:
    width, height = value["image_px"]
    wide, _, high = value.get("pixel_aspect", "1:1").partition(":")
    return Rig(
        image_px=(int(width), int(height)),
        nodes=tuple(Node(**n) for n in value.get("node", ())),
        bodies=tuple(b["name"] for b in value.get("body", ())),
        joints=tuple(
            Joint(j["name"], tuple(j["bodies"]), j["x_px"], j["y_px"]) for j in value.get("joint", ())
        ),
        reference_frame=value.get("reference_frame"),
        region=value.get("region"),
        lens=value.get("lens"),
        camera=value.get("camera"),
        pixel_aspect=(int(wide), int(high)),
    )


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
        Area of each blob, px.
    status : ndarray of uint8, shape (T, N)
        ``MISSING``, ``SEEN``, ``REACQUIRED``, ``AMBIGUOUS`` or ``UNDECODED`` (0 to 4, in `pydpend.nodes`).
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
        """Whether a place is known, (T, N)."""
        seen: NDArray[np.bool_] = (self.status == SEEN) | (self.status == REACQUIRED)
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


def nodes_of(columns: Columns) -> Nodes:
    """Nodes of what the compiled half hands over."""
    frame, t_s, xy_px, sigma_px, area_px, status, text = columns
    meta = json.loads(text)
    rig = _rig(meta.pop("rig"))
    return Nodes(frame, t_s, xy_px, sigma_px, area_px, status, rig, meta)


def read_nodes(path: AnyPath) -> Nodes:
    """Nodes from a table, Parquet or CSV by the ending; every value is checked.

    Parameters
    ----------
    path : path-like
        A table written by `tracker track` or `Nodes.write`.

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
    return nodes_of(_native.read_table(os.fsdecode(path)))
