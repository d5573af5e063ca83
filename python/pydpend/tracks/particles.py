"""Particles that are linked from frame to frame: tables of trackpy and laptrack, TrackMate's table and XML files."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from numpy.typing import ArrayLike

from pydpend.documents import read_bytes
from pydpend.errors import TableError, fault
from pydpend.long_table import LongTable, read_long
from pydpend.raw_tracks import Floats, RawTracks, Rows, pivot
from pydpend.tracks.cells import lines_of, numbers_of
from pydpend.units import unit_called


def trackpy(path: Path, names: Sequence[str] = ()) -> RawTracks:
    """A table of trackpy, see `of_trackpy`."""
    return of_trackpy(read_long(path, ("frame", "particle", "x", "y"), ("ep",)))


def of_trackpy(table: LongTable) -> RawTracks:
    """A table of `trackpy.link`: ``frame``, ``particle``, ``x``, ``y`` in px, y down; ``ep`` is the uncertainty."""
    particle = table.numbers("particle")
    tracks = _linked(table, "trackpy", "frame", particle, "p")
    error = table.numbers("ep") if "ep" in table else np.full(table.rows, np.nan)
    given = np.isfinite(error[np.isfinite(particle)])
    if given.size and given.all() and (error[np.isfinite(particle)] > 0).all():
        return _linked(table, "trackpy", "frame", particle, "p", error)
    return tracks


def laptrack(path: Path, names: Sequence[str] = ()) -> RawTracks:
    """A table of laptrack, see `of_laptrack`."""
    return of_laptrack(read_long(path, ("track_id", "x", "y"), ("frame", "frame_y")))


def of_laptrack(table: LongTable) -> RawTracks:
    """A table of `laptrack.LapTrack.predict_dataframe`: ``frame``, ``track_id``, ``x``, ``y`` in px, y downwards."""
    frame = "frame" if "frame" in table else "frame_y"
    return _linked(table, "laptrack", frame, table.numbers("track_id"), "t")


def _linked(
    table: LongTable, form: str, frame: str, number: Floats, letter: str, sigma: Floats | None = None
) -> RawTracks:
    """Tracks of a table with a number for each; rows without one are of no track and left out."""
    kept = np.flatnonzero(np.isfinite(number))
    called = [f"{letter}{number[row]:g}" for row in kept]
    wide = pivot(
        Rows(table.source, table.numbers(frame)[kept], called, lambda row: table.place(int(kept[row])))
    )
    xy = np.stack([table.numbers("x")[kept], table.numbers("y")[kept]], axis=1)
    left = table.rows - kept.size
    notes = [f"{left} rows are of no track and left out"] if left else []
    return RawTracks(form, table.source, wide.names, wide.frame, wide.spread(xy),
                     sigma=None if sigma is None else wide.spread(sigma[kept]), notes=notes)  # fmt: skip


def trackmate_csv(path: Path, names: Sequence[str] = ()) -> RawTracks:
    """TrackMate's table of spots: a header, two rows of names and one of units, then a spot per row."""
    lines = lines_of(path)
    parted = list(csv.reader(lines))
    header = [c.strip() for c in parted[0]]
    at = {
        c: header.index(c)
        for c in ("TRACK_ID", "POSITION_X", "POSITION_Y", "FRAME", "POSITION_T")
        if c in header
    }
    # The rows of names and units have no number where a frame's stands.
    rows = [(i, fields) for i, fields in enumerate(parted[1:], start=2) if len(fields) > at["FRAME"]]
    first = next(
        (k for k, (_, f) in enumerate(rows) if f[at["FRAME"]].strip().lstrip("-").isdigit()), len(rows)
    )
    units = rows[first - 1][1] if first > 0 else []
    kept = [(line, [f[at[c]] for c in at]) for line, f in rows[first:]]
    values = dict(zip(at, numbers_of(str(path), kept, tuple(at)).T, strict=True))
    t_s = None
    if "POSITION_T" in at:
        unit = unit_called(_bare(units, at["POSITION_T"]))
        t_s = None if unit is None or unit.quantity != "time" else unit.to_base(values["POSITION_T"])
    track = values["TRACK_ID"]
    inside = np.flatnonzero(np.isfinite(track))
    called = [f"Track_{track[row]:g}" for row in inside]
    xy = np.stack([values["POSITION_X"], values["POSITION_Y"]], axis=1)
    left = len(kept) - inside.size
    notes = [f"{left} spots are of no track and left out"] if left else []
    times = None if t_s is None else t_s[inside]
    rows_in = Rows(
        str(path), values["FRAME"][inside], called, lambda row: f"line {kept[int(inside[row])][0]}", times
    )
    return _trackmate(rows_in, xy[inside], _bare(units, at["POSITION_X"]), notes)


def _bare(units: Sequence[str], column: int) -> str:
    return units[column].strip().strip("()") if column < len(units) else ""


def _trackmate(rows: Rows, xy: ArrayLike, unit: str, notes: Sequence[str] = ()) -> RawTracks:
    """The tracks of spots (R)."""
    wide = pivot(rows)
    places = wide.spread(np.reshape(np.asarray(xy, dtype=np.float64), (-1, 2)))
    return RawTracks(
        "TrackMate", rows.source, wide.names, wide.frame, places, wide.t_s, unit=unit, notes=list(notes)
    )


def _spot(row: int) -> str:
    return f"spot {row}"


def trackmate_tracks(path: Path, names: Sequence[str] = ()) -> RawTracks:
    """TrackMate's exported tracks: ``<Tracks><particle><detection t= x= y= z=/>``, t a frame's number."""
    root = xml_root(path)
    frame, called, xy = [], [], []
    for i, particle in enumerate(root.iter("particle")):
        for spot in particle.iter("detection"):
            values = _attributes(path, spot, ("t", "x", "y"))
            frame.append(values[0])
            called.append(f"Track_{i}")
            xy.append(values[1:])
    step = _time_step(root.get("frameInterval"), root.get("timeUnits"))
    numbers = np.array(frame)
    rows = Rows(str(path), numbers, called, _spot, None if step is None else numbers * step)
    return _trackmate(rows, xy, root.get("spaceUnits", ""))


def trackmate_xml(path: Path, names: Sequence[str] = ()) -> RawTracks:
    """TrackMate's own file: spots, tracks as edges between spots, and which tracks were kept."""
    root = xml_root(path)
    model = root.find("Model")
    if model is None:
        raise TableError(fault(str(path), "there is no element Model in it", "Save it again in TrackMate"))
    spots = {spot.get("ID"): spot for spot in model.iter("Spot")}
    kept = {e.get("TRACK_ID") for e in model.iterfind("FilteredTracks/TrackID")}
    frame, called, xy, times = [], [], [], []
    for track in model.iterfind("AllTracks/Track"):
        if kept and track.get("TRACK_ID") not in kept:
            continue
        name = track.get("name") or f"Track_{track.get('TRACK_ID')}"
        ends = {e.get(key): None for e in track.iter("Edge") for key in ("SPOT_SOURCE_ID", "SPOT_TARGET_ID")}
        for key in ends:
            if key not in spots:
                raise TableError(
                    fault(str(path), f"the track {name} has a spot {key} that is not there", "Save it again")
                )
            x, y, number, t = _attributes(
                path, spots[key], ("POSITION_X", "POSITION_Y", "FRAME", "POSITION_T")
            )
            frame.append(number)
            called.append(name)
            xy.append((x, y))
            times.append(t)
    unit = unit_called(model.get("timeunits", ""))
    is_time = unit is not None and unit.quantity == "time"
    t_s = unit.to_base(np.array(times)) if unit is not None and is_time else None
    return _trackmate(Rows(str(path), np.array(frame), called, _spot, t_s), xy, model.get("spatialunits", ""))


def _time_step(interval: str | None, units: str | None) -> float | None:
    """Seconds per frame; None where the file counts frames alone."""
    unit = unit_called(units or "")
    try:
        value = float(interval or "")
    except ValueError:
        return None
    if unit is None or unit.quantity != "time" or not value > 0:
        return None
    return float(unit.to_base(np.array(value)))


def xml_root(path: Path) -> ElementTree.Element:
    """The outermost element of an XML file. Raises TableError naming the line at fault."""
    try:
        return ElementTree.fromstring(read_bytes(path, TableError))
    except (LookupError, ValueError) as problem:  # an encoding that is not known
        raise TableError(fault(str(path), f"is not XML ({problem})", "Save it as UTF-8")) from problem
    except ElementTree.ParseError as problem:
        line, column = problem.position
        said = str(problem).partition(":")[0]
        raise TableError(
            fault(str(path), f"is not XML ({said})", "Copy it again", place=f"line {line}, column {column}")
        ) from problem


def _attributes(path: Path, element: ElementTree.Element, names: Sequence[str]) -> list[float]:
    """Attributes of an element as numbers. Raises TableError naming what is none."""
    out = []
    for name in names:
        text = element.get(name, "")
        try:
            out.append(float(text))
        except ValueError:
            problem = f"{name} of a {element.tag} is {text!r}, which is not a number"
            raise TableError(fault(str(path), problem, "Save it again")) from None
    return out
