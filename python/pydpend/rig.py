"""Rigs in Python: markers, bodies and joints, and the picture in which they stand so.

Image coordinates: x right, y down, pixel centres at integers, the first pixel is (0, 0).
"""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pydpend import _native
from pydpend.errors import ArgumentError, fault
from pydpend.output import AnyPath
from pydpend.typed import typed, typed_class


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


@typed_class()
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
    @typed()
    def read(path: AnyPath) -> Rig:
        """A rig from its file (TOML), as `pydpend setup` writes it.

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
    @typed()
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
        return rig_of(json.loads(text))

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

    @typed()
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

    @typed()
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


def rig_of(value: dict[str, Any]) -> Rig:
    """The rig of plain values that the compiled half has checked."""
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
