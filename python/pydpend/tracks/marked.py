"""Points that people mark in a film: OSP Tracker's text and ``.trk``, Kinovea's ``.kva``."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from pydpend.delimited import Numbers, take_apart
from pydpend.documents import read_bytes
from pydpend.errors import TableError, fault
from pydpend.raw_tracks import RawTracks, Rows, pivot
from pydpend.tracks.cells import lines_of
from pydpend.tracks.particles import xml_root

CORNER_PX = 0.5
"""Tracker and Kinovea count from the corner of the first pixel, and here its middle is 0."""

TRACKER = "org.opensourcephysics.cabrillo.tracker."


def osp_text(path: Path, names: Sequence[str] = ()) -> RawTracks:
    """OSP Tracker's exported data of one track: its name, then ``t``, ``x``, ``y`` in its units, y upwards."""
    cells = take_apart(str(path), read_bytes(path, TableError), ("t", "x", "y"), TableError)
    found = cells.fields(["t", "x", "y"])
    numbers = Numbers(cells, found.columns, found.lines)
    t_s = numbers.column("t")
    above = [line.strip() for line in lines_of(path)[: cells.header_line - 1]]
    titles = [line.strip("#,;\t ") for line in above if line.strip("#,;\t ")]
    name = titles[-1] if titles else path.stem
    xy = np.stack([numbers.column("x"), numbers.column("y")], axis=1)
    return RawTracks(
        "OSP Tracker",
        str(path),
        (name,),
        np.arange(t_s.size, dtype=np.int64),
        xy[:, None],
        t_s,
        unit="",
        is_y_up=True,
        notes=["frames are numbered from 0: this form has times alone"],
    )


def osp_trk(path: Path, names: Sequence[str] = ()) -> RawTracks:
    """OSP Tracker's tab: the point masses in px of the film, y downwards, and the clip's times."""
    root = xml_root(path)
    masses = [o for o in root.iter("object") if o.get("class") == f"{TRACKER}PointMass"]
    others = {
        str(o.get("class")).removeprefix(TRACKER)
        for p in _properties(root, "tracks")
        for o in p.iterfind("./property/object")
    }
    notes = ["0.5 px are taken off: Tracker counts from the corner of the first pixel"]
    left = sorted(others - {"PointMass", "CoordAxes"})
    if left:
        notes.append(f"tracks that are no point masses are left out: {', '.join(left)}")
    frame, called, xy = [], [], []
    for i, mass in enumerate(masses):
        name = _text(mass, "name") or f"mass {i + 1}"
        for step in (s for p in _properties(mass, "framedata") for s in p.iterfind("property")):
            point = step.find("object")
            if point is not None:
                frame.append(float(re.sub(r"\D", "", step.get("name", "")) or "nan"))
                called.append(name)
                xy.append([_number(path, point, axis) - CORNER_PX for axis in "xy"])
    wide = pivot(
        Rows(str(path), np.array(frame), called, lambda row: f"step {frame[row]:g} of {called[row]}")
    )
    image, t_s, facts = _clip(path, root, wide.frame.astype(np.float64))
    return RawTracks("OSP Tracker", str(path), wide.names, wide.frame, wide.spread(np.reshape(xy, (-1, 2))), t_s,
                     image_px=image, facts=facts, notes=notes)  # fmt: skip


def _clip(
    path: Path, root: ElementTree.Element, frame: np.ndarray[tuple[int, ...], np.dtype[np.float64]]
) -> tuple[
    tuple[int, int] | None, np.ndarray[tuple[int, ...], np.dtype[np.float64]] | None, dict[str, str | float]
]:
    """The pictures' size, the times of the frames, and the scale that the file has."""
    size = [_text(root, key) for key in ("width", "height")]
    image = (round(float(size[0])), round(float(size[1]))) if all(size) else None
    clip, control = _object(root, "videoclip"), _object(root, "clipcontrol")
    video = None if clip is None else _object(clip, "video")
    step = next((_text(o, "delta_t") for o in (control, video) if o is not None and _text(o, "delta_t")), "")
    t_s = None
    if step:
        first, start_ms = (
            0.0 if clip is None else float(_text(clip, k) or 0) for k in ("startframe", "starttime")
        )
        # Exactly what Tracker's own table has: whole steps, in ms.
        t_s = (start_ms + (frame - first) * float(step)) / 1000
    facts: dict[str, str | float] = {}
    coords = _object(root, "coords")
    scales = (
        [] if coords is None else [_text(o, "xscale") for o in coords.iter("object") if _text(o, "xscale")]
    )
    if scales:
        facts["scale"] = f"{scales[0]} px per {_text(root, 'length_unit') or 'unit'}"
    return image, t_s, facts


def _properties(element: ElementTree.Element, name: str) -> list[ElementTree.Element]:
    """An object's own properties of a name."""
    return [p for p in element.iterfind("property") if p.get("name") == name]


def _object(element: ElementTree.Element, name: str) -> ElementTree.Element | None:
    """The object that is an object's property; None if there is none."""
    return next((o for p in _properties(element, name) for o in p.iterfind("object")), None)


def _text(element: ElementTree.Element, name: str) -> str:
    """The text of an object's own property, "" if it has none."""
    return next(((p.text or "").strip() for p in _properties(element, name)), "")


def _number(path: Path, element: ElementTree.Element, name: str) -> float:
    text = _text(element, name)
    try:
        return float(text)
    except ValueError:
        problem = f"{name} of a step is {text!r}, which is not a number"
        raise TableError(fault(str(path), problem, "Save the tab again")) from None


def kinovea_kva(path: Path, names: Sequence[str] = ()) -> RawTracks:
    """Kinovea's annotations: the trajectories in px of the film, y downwards, and the rate at which it was taken."""
    root = xml_root(path)
    ticks = _found(path, root, "AverageTimeStampsPerFrame", 1.0)
    begin = _found(path, root, "FirstTimeStamp", 0.0)
    rate = _found(path, root, "CaptureFramerate", 0.0)
    frame, called, xy = [], [], []
    for i, track in enumerate(root.iter("Track")):
        label = track.find("MainLabel")
        name = track.get("name") or (None if label is None else label.get("Text")) or f"track {i + 1}"
        for point in track.iter("TrackPoint"):
            try:
                x, y, stamp = (float(part) for part in (point.text or "").split(";"))
            except ValueError:
                problem = f"a point of {name} is {point.text!r}, and x;y;t is expected"
                raise TableError(fault(str(path), problem, "Save the annotations again")) from None
            frame.append(round((stamp - begin) / ticks))
            called.append(name)
            xy.append((x - CORNER_PX, y - CORNER_PX))
    notes = ["0.5 px are taken off: Kinovea counts from the corner of the first pixel"]
    if root.find(".//TrackableDrawing") is not None:
        notes.append("drawings that follow points are left out: trajectories alone are read")
    numbers = np.array(frame, dtype=np.float64)
    wide = pivot(Rows(str(path), numbers, called, lambda row: f"frame {frame[row]} of {called[row]}"))
    size = re.fullmatch(r"(\d+);(\d+)", root.findtext("ImageSize", ""))
    return RawTracks(
        "Kinovea",
        str(path),
        wide.names,
        wide.frame,
        wide.spread(np.reshape(np.array(xy), (-1, 2))),
        wide.frame / rate if rate > 0 else None,
        image_px=None if size is None else (int(size[1]), int(size[2])),
        notes=notes,
    )


def _found(path: Path, root: ElementTree.Element, name: str, default: float) -> float:
    text = root.findtext(name, "").strip()
    try:
        return float(text) if text else default
    except ValueError:
        raise TableError(
            fault(str(path), f"{name} is {text!r}, which is not a number", "Save it again")
        ) from None
