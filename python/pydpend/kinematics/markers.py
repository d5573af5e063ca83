"""From a node table to what the estimators need: each body's markers in the world's directions.

Owns: the **one place where image y (down) becomes world y (up)** and recorded pixels become square ones, as high as
these, and which rows count as seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pydpend._native import plane_places, recorded_places
from pydpend.errors import CHECK, AnglesError, Setting, fault
from pydpend.kinematics.table import Floats
from pydpend.marker_status import PLACED

if TYPE_CHECKING:
    from pydpend.nodes import Nodes, Rig


@dataclass(frozen=True, eq=False)
class BodyMarkers:
    """The K markers of one body over T frames.

    ``xy_px`` (T, K, 2): world directions, x right and y **up**, square px, 0 where not seen. ``weight`` (T, K): 1 /
    sigma^2 in px^-2, 0 where not seen. ``reference_px`` (K, 2): the rig's own places of the markers.
    """

    name: str
    nodes: tuple[str, ...]
    xy_px: Floats
    weight: Floats
    reference_px: Floats

    @property
    def seen(self) -> NDArray[np.bool_]:
        """(T, K): where a marker has a trusted centre."""
        return self.weight > 0

    def without(self, drop: NDArray[np.bool_]) -> BodyMarkers:
        """The markers with the marked (T, K) centres left out."""
        return BodyMarkers(
            self.name, self.nodes, self.xy_px, np.where(drop, 0.0, self.weight), self.reference_px
        )

    def at(self, rows: NDArray[np.int64]) -> BodyMarkers:
        """Some of the frames."""
        return BodyMarkers(self.name, self.nodes, self.xy_px[rows], self.weight[rows], self.reference_px)


def never_seen(nodes: Nodes, markers: Sequence[BodyMarkers]) -> list[str]:
    """A note on the nodes of the bodies that are no markers because they are never seen, if there are any."""
    bodies = [m.name for m in markers]
    known = {n for m in markers for n in m.nodes}
    names = [n.name for n in nodes.rig.nodes if n.body in bodies and n.name not in known]
    if not names:
        return []
    return [f"{', '.join(names)}: never seen, so the angles are those of the other markers of the link"]


def to_world(xy_px: Floats, rig: Rig, mirrored: bool = False) -> Floats:
    """Image places (..., 2), y down, to square pixels of the bodies' plane in world directions, y up.

    With ``mirrored``, which turns x round as well, a film taken from behind, or flipped by the camera, gives the angles
    seen from the front.
    """
    if rig.camera is None:
        return np.asarray(xy_px * _scale(rig, mirrored))
    return np.asarray(_flat(xy_px, rig)[..., :2] * world_turn(mirrored))


def to_image(xy_px: Floats, rig: Rig, mirrored: bool = False) -> Floats:
    """The way back."""
    if rig.camera is None:
        return np.asarray(xy_px / _scale(rig, mirrored))
    plane = np.asarray(xy_px, dtype=np.float64) * world_turn(mirrored)
    return recorded_places(rig.to_json(), plane.reshape(-1, 2)).reshape(plane.shape)


def sigma_to_image(sigma_px: Floats, rig: Rig) -> Floats:
    """Standard uncertainties (..., 2) of a place along x and y in recorded pixels.

    A camera's stretch, of some percent, is left out.
    """
    return np.abs(sigma_px / _scale(rig, mirrored=False))


def _flat(xy_px: Floats, rig: Rig) -> Floats:
    """Image places (..., 2) in the bodies' plane, and the most that lengths are stretched there, (..., 3)."""
    recorded = np.ascontiguousarray(xy_px, dtype=np.float64)
    return plane_places(rig.to_json(), recorded.reshape(-1, 2)).reshape((*recorded.shape[:-1], 3))


def world_turn(mirrored: bool) -> Floats:
    """World directions for a step along the plane's x and y, (2,)."""
    return np.array([-1.0 if mirrored else 1.0, -1.0])


def _scale(rig: Rig, mirrored: bool) -> Floats:
    """World px for a recorded one along x and along y."""
    width, height = rig.pixel_aspect
    return np.array([(-1.0 if mirrored else 1.0) * (width / height), -1.0])


def body_markers(
    nodes: Nodes, bodies: Sequence[str] | None = None, mirrored: bool = False
) -> list[BodyMarkers]:
    """The markers of each body, from the pivot outwards (the rig's order unless ``bodies`` is given).

    A node that is never seen is not among them: nothing tells where on its body it is.

    Raises :class:`AnglesError` for an unknown body, one that is never seen, or a seen centre without a standard
    uncertainty.
    """
    rig = nodes.rig
    names = list(rig.bodies)
    wanted = list(bodies) if bodies is not None else names
    for name in wanted:
        if name not in names:
            raise AnglesError(
                fault(Setting("bodies"), f"there is no body {name!r}", f"The rig has {', '.join(names)}")
            )
    if not wanted or len(set(wanted)) != len(wanted):
        twice = ", ".join(wanted) or "none"
        raise AnglesError(
            fault(
                Setting("bodies"), f"{twice}: no body, or one twice", f"Name each once of {', '.join(names)}"
            )
        )
    trusted = np.isin(nodes.status, PLACED) & np.isfinite(nodes.xy_px).all(axis=2)
    bad = np.argwhere(trusted & ~(np.isfinite(nodes.sigma_px) & (nodes.sigma_px > 0)))
    if bad.size:
        t, n = (int(v) for v in bad[0])
        raise AnglesError(
            fault(
                "nodes",
                f"the centre is seen but its sigma_px is {nodes.sigma_px[t, n]}",
                "Give every seen centre a standard uncertainty above zero",
                place=f"frame {int(nodes.frame[t])}, node {rig.nodes[n].name}",
            )
        )
    out = []
    for name in wanted:
        own = [i for i, n in enumerate(rig.nodes) if n.body == name]
        index = [i for i in own if trusted[:, i].any()]
        if len(index) == 1:
            # Of several markers one alone is refused with the frames in which two are to be seen.
            index = own
        seen = trusted[:, index]
        if not index:
            raise AnglesError(
                fault(
                    "nodes",
                    f"no node of the body {name} is ever seen",
                    "Look at " + CHECK + " of the table, or name other bodies with " + Setting("bodies"),
                )
            )
        xy = to_world(np.where(seen[..., None], nodes.xy_px[:, index], 0.0), rig, mirrored)
        sigma = np.where(seen, nodes.sigma_px[:, index], 1.0).astype(np.float64)
        if rig.camera is not None:
            sigma *= _flat(np.where(seen[..., None], nodes.xy_px[:, index], 0.0), rig)[..., 2]
        reference = np.array([[rig.nodes[i].x_px, rig.nodes[i].y_px] for i in index], dtype=np.float64)
        out.append(
            BodyMarkers(
                name,
                tuple(rig.nodes[i].name for i in index),
                xy,
                np.where(seen, sigma**-2.0, 0.0),
                to_world(reference, rig, mirrored),
            )
        )
    return out
