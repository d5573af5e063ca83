"""Places of markers and joints over time, in px or in metres, x right and y up from an origin."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pydpend.errors import AnglesError, Setting, fault
from pydpend.kinematics.body_view import BodyView
from pydpend.kinematics.camera import known
from pydpend.kinematics.estimators import poses_of
from pydpend.kinematics.linkage import Given
from pydpend.kinematics.linkage_frames import fit_linkage, joint_places
from pydpend.kinematics.markers import BodyMarkers, body_markers, to_world
from pydpend.kinematics.metres import Known, Measured, scale_of
from pydpend.kinematics.pivots import POINTED_AT_PX, with_pivots
from pydpend.kinematics.structure import Structure
from pydpend.kinematics.table import Floats
from pydpend.nodes import Nodes
from pydpend.tabular import TableResult, html_rows
from pydpend.typed import typed

PLACE = re.compile(r"\s*(-?[\d.]+)\s*,\s*(-?[\d.]+)\s*")
"""A point of the picture in words: ``320.5,80``."""

PICTURE_M = (2e-3, 50.0)
"""Widths in m of what a picture shows, from a microscope's to a crane's: others are told, as of a distance in mm."""


@dataclass(frozen=True, eq=False, repr=False)
class Places(TableResult):
    """Places of P points at T times, x right and y up.

    Attributes
    ----------
    t_s : ndarray of float, shape (T,)
        Time, s.
    names : tuple of str
        Names of the markers and joints.
    xy : ndarray of float, shape (T, P, 2)
        Places from the origin, in `unit`; NaN where not seen.
    sigma : ndarray of float, shape (T, P)
        Standard uncertainty of each coordinate by the noise of the frame, in `unit`: not that of the scale, which
        is one of all places (``meta["scale"]``), nor the camera's (``meta["camera"]``).
    unit : {"m", "px"}
        Metres, or square pixels where no scale was given.
    frame : ndarray of int64, shape (T,)
        Index in the recording.
    meta : dict
        Origin, scale and camera, as plain values, and notes.
    name : str
        Name of the recording.
    """

    t_s: Floats
    names: tuple[str, ...]
    xy: Floats
    sigma: Floats
    unit: str
    frame: NDArray[np.int64]
    meta: dict[str, Any] = field(default_factory=dict)
    name: str = "places"

    def __repr__(self) -> str:
        """A line for people."""
        return f"<Places {self.name}: {self.t_s.size} times x {len(self.names)} points, {self.unit}>"

    def _repr_html_(self) -> str:
        """The first rows, for a notebook."""
        few = dict(list(self.to_columns().items())[:8])
        return html_rows(repr(self)[1:-1], few)

    @typed()
    def select(self, *points: str) -> Places:
        """Some of the points, in the order named.

        Parameters
        ----------
        *points : str
            Their names.

        Returns
        -------
        Places
            These alone.

        Raises
        ------
        AnglesError
            For a name that is none of theirs.
        """
        for name in points:
            if name not in self.names:
                advice = f"There are {', '.join(self.names)}"
                raise AnglesError(fault(Setting("points"), f"there is no point {name!r}", advice))
        k = [self.names.index(name) for name in points]
        return replace(self, names=points, xy=self.xy[:, k], sigma=self.sigma[:, k])

    def to_columns(self) -> dict[str, NDArray[Any]]:
        """The places as columns of a table.

        Returns
        -------
        dict of str to ndarray, each of shape (T,)
            ``frame``, ``time_s``, and of each point ``x_n0_m``, ``y_n0_m`` and ``sigma_n0_m``, or ``..._px``.
        """
        out: dict[str, NDArray[Any]] = {"frame": self.frame, "time_s": self.t_s}
        for k, name in enumerate(self.names):
            out[f"x_{name}_{self.unit}"], out[f"y_{name}_{self.unit}"] = self.xy[:, k].T
            out[f"sigma_{name}_{self.unit}"] = self.sigma[:, k]
        return out


@typed("pivot")
def places(
    nodes: Nodes,
    points: Sequence[str] | None = None,
    *,
    scale: Mapping[str, float | Sequence[float]] | None = None,
    origin: str | Sequence[float] | None = None,
    pivot: Sequence[float] | Mapping[str, Sequence[float]] | None = None,
    mirrored: bool = False,
) -> Places:
    """Places of markers and joints, in metres where a distance is known.

    Parameters
    ----------
    nodes : Nodes
        Where each marker is in each of T frames.
    points : sequence of str, optional
        Names of markers and joints; all markers and the joints that the motion tells if not given.
    scale : dict of str to float or sequence of float, optional
        Distances that are known, m, and as a second number their standard uncertainty (if it is not given, half a unit
        of the last digit): ``{"n0-n3": 0.1719, "pivot-joint1": (0.2, 1e-4), "10,20-410,22": 0.5}`` between markers or
        joints of one link, joints of the ground, or places in the picture, px. Several are averaged and compared.
    origin : str or sequence of float, optional
        A joint of the ground or a marker that stands still, or a place (x, y) in the picture, px; the first joint of
        the ground if not given, or else the picture's first pixel.
    pivot : sequence of float or dict of str to sequence of float, optional
        Where a link of one marker hangs, if that was not found, as `angles` takes it.
    mirrored : bool
        Whether the film was taken from behind.

    Returns
    -------
    Places
        In square pixels of the bodies' plane without a scale; the rig's camera is taken into account.

    Raises
    ------
    AnglesError
        For a point or a distance that is not there or not constant.
    """
    markers = body_markers(nodes, None, mirrored)
    nodes, given = with_pivots(nodes, markers, pivot, mirrored)
    known_points, notes = _known_points(nodes, markers, given)
    known_points |= {
        name: Measured(*_given(name, nodes, mirrored)) for name in _in_picture(scale or {}, origin)
    }
    names = tuple(points) if points is not None else tuple(n for n in known_points if not PLACE.fullmatch(n))
    for name in names:
        if name not in known_points:
            problem = f"there is no point {name!r}" + (f" ({notes[0]})" if notes else "")
            advice = f"There are {', '.join(known_points)}"
            raise AnglesError(fault(Setting("points"), problem, advice))
    zero, said = _origin(origin, nodes, known_points, mirrored)
    xy = np.stack([np.broadcast_to(known_points[n].xy_px, (len(nodes), 2)) for n in names], axis=1) - zero
    sigma = np.stack([np.broadcast_to(known_points[n].sigma_px, (len(nodes),)) for n in names], axis=1)
    sigma = np.where(np.isfinite(xy).all(axis=2), sigma, np.nan)
    meta: dict[str, Any] = {"origin": said, "camera": _camera(nodes, markers, mirrored), "notes": notes}
    unit, factor = "px", 1.0
    if scale:
        found, told = scale_of([Known.of(word, value, known_points) for word, value in scale.items()])
        meta["scale"], unit, factor = found, "m", found["m_per_px"]
        notes += [*told, *_odd_width(nodes.rig.image_px[0] * factor)]
    source = nodes.meta.get("source")
    label = str(source.get("name", "nodes")) if isinstance(source, dict) else "nodes"
    return Places(nodes.t_s, names, factor * xy, factor * sigma, unit, nodes.frame, meta, label)


def _odd_width(width_m: float) -> list[str]:
    """A note where the picture is as wide by the scale as no film of a mechanism is."""
    if PICTURE_M[0] < width_m < PICTURE_M[1]:
        return []
    return [f"by the scale the picture is {width_m:.3g} m wide: are the distances in m?"]


def _known_points(
    nodes: Nodes, markers: list[BodyMarkers], given: Mapping[str, Given]
) -> tuple[dict[str, Measured], list[str]]:
    """Markers, and the joints where the motion tells them, in world px; and what is doubtful."""
    out: dict[str, Measured] = {}
    poses = poses_of(markers)
    for body, pose in zip(markers, poses, strict=True):
        for k, name in enumerate(body.nodes):
            seen = body.seen[:, k]
            xy = np.where(seen[:, None], body.xy_px[:, k], np.nan)
            sigma = np.where(seen, np.where(seen, body.weight[:, k], 1.0) ** -0.5, np.nan)
            out[name] = Measured(xy, sigma * pose.sigma_scale, body.name)
    structure = Structure.of(nodes.rig, [m.name for m in markers])
    if not structure.joints:
        return out, []
    try:
        linked = fit_linkage(poses, structure, given)
    except AnglesError as problem:
        return out, [f"the joints are left out: {problem}"]
    xy, sigma = joint_places(linked, markers)
    for j, joint in enumerate(linked.linkage.shape.structure.joints):
        out[joint.name] = Measured(xy[:, j], sigma[:, j], joint.bodies)
    return out, []


def _in_picture(scale: Mapping[str, Any], origin: object) -> list[str]:
    """Points of the picture that distances or the origin name."""
    out = []
    for word in scale:
        ends = re.fullmatch(rf"({PLACE.pattern})-({PLACE.pattern})", word)
        if ends:
            out += [ends[1], ends[4]]
    return out


def _given(word: str, nodes: Nodes, mirrored: bool) -> tuple[Floats, Floats, str]:
    """A point of the picture: its place in the world, its standard uncertainty, and that it is of the picture."""
    match = PLACE.fullmatch(word)
    assert match is not None
    at = to_world(np.array([float(match[1]), float(match[2])]), nodes.rig, mirrored)
    return at, np.array(POINTED_AT_PX), "the picture"


def _origin(
    origin: str | Sequence[float] | None, nodes: Nodes, points: Mapping[str, Measured], mirrored: bool
) -> tuple[Floats, dict[str, Any]]:
    """The origin in world px, and in words where that is."""
    if origin is None:
        still = [j.name for j in nodes.rig.joints if len(j.bodies) == 1 and j.name in points]
        origin = still[0] if still else (0.0, 0.0)
    if isinstance(origin, str) and PLACE.fullmatch(origin):
        origin = [float(v) for v in origin.split(",")]
    if not isinstance(origin, str):
        at = np.asarray(origin, dtype=np.float64)
        if at.shape != (2,) or not np.isfinite(at).all():
            raise AnglesError(
                fault(Setting("origin"), f"{origin!r} is no place", "Give x and y in px: 320.5,80")
            )
        return to_world(at, nodes.rig, mirrored), {"picture_px": at.tolist()}
    if origin not in points:
        advice = f"Give one of {', '.join(points)}, or x and y in px: 320.5,80"
        raise AnglesError(fault(Setting("origin"), f"there is no point {origin!r}", advice))
    point = points[origin]
    xy = point.xy_px.reshape(-1, 2)
    spread = float(np.nanstd(xy, axis=0).max())
    if spread > 10 * float(np.nanmedian(point.sigma_px)) + 0.1:
        raise AnglesError(
            fault(
                Setting("origin"),
                f"{origin} moves by {spread:.3g} px",
                "Give a joint of the ground, or x and y in px: 320.5,80",
            )
        )
    return np.nanmean(xy, axis=0), {"point": origin}


def _camera(nodes: Nodes, markers: list[BodyMarkers], mirrored: bool) -> dict[str, Any]:
    """The camera's part in the markers' places: RMS of each, but for a common shift, px."""
    poses = poses_of(markers)
    views = [BodyView.of(nodes, pose, mirrored) for pose in poses]
    camera = known(nodes.rig, [v.evidence(p.centre_px) for v, p in zip(views, poses, strict=True)])
    rows = np.unique(np.linspace(0, len(nodes) - 1, min(len(nodes), 2000)).astype(np.int64))
    moved = np.concatenate([view.moves(rows) for view in views], axis=1) @ camera.root()
    seen = np.concatenate([m.seen[rows] for m in markers], axis=1)
    moved = np.where(seen[..., None, None], moved, np.nan)
    moved = moved - np.nanmean(moved, axis=(0, 1))
    rms = np.sqrt(np.nanmean((moved**2).sum(axis=3), axis=(0, 2)))
    return {
        "origin": camera.origin,
        "rms_px": dict(zip([n for m in markers for n in m.nodes], rms.tolist(), strict=True)),
    }
