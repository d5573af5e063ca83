"""Tracks of anyone's as what nodes hold: arrays checked and completed, a rig, metadata, and what was assumed.

Owns: what is taken for an uncertainty, a picture size, bodies and a reference picture that nobody gave.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NoReturn, TypeAlias

import numpy as np
from numpy.typing import NDArray

from pydpend import _native
from pydpend.errors import ArgumentError, Setting, TableError, Text, fault
from pydpend.marker_status import MISSING, PLACED, SEEN
from pydpend.raw_tracks import Floats, RawTracks
from pydpend.rig import Node, Rig
from pydpend.series import highpass_noise

Bodies: TypeAlias = Mapping[str, Sequence[str]] | Sequence[str] | None
"""The nodes of each body by its name, the body of each node, or None."""

Assembled: TypeAlias = tuple[
    NDArray[np.int64], Floats, Floats, NDArray[np.float32], NDArray[np.float32], NDArray[np.uint8], Rig, dict[str, Any]
]  # fmt: skip
"""The fields of `pydpend.Nodes`, in order."""

ASSUMED_SIGMA_PX = 1.0
"""Standard uncertainty of a place where none is given and the tracks are too short to show any."""

LEAST_SIGMA_PX = 1e-3
"""Standard uncertainty at least of places that do not scatter at all, as those of a drawing: no camera knows better."""

UNEVEN = 1e-3
"""Steps of time that differ by more than this part of the middle one are told."""

SINGLE_POINT = "no bodies are given: each node is a body by itself (find_rig finds them)"


@dataclass(frozen=True)
class Who:
    """The one that errors name: the caller's settings, or a file with the place in it."""

    source: str = ""

    def refuse(self, setting: str, problem: Text, advice: Text, place: str = "") -> NoReturn:
        """Raises ArgumentError for a caller's setting, TableError for a file."""
        if self.source:
            raise TableError(fault(self.source, problem, advice, place=place))
        raise ArgumentError(fault(Setting(setting), problem, advice, place=place))


def assembled(tracks: RawTracks, bodies: Bodies = None, who: Who | None = None) -> Assembled:
    """Contents of `pydpend.Nodes`, from tracks in pixels with y down and times.

    Raises
    ------
    TableError, ArgumentError
        Naming what is wrong and where; with a file in ``who`` the former, else the latter.
    """
    who = Who() if who is None else who
    notes = list(tracks.notes)
    count, names = tracks.frame.size, tracks.names
    if not count or not names:
        who.refuse("xy_px", "there are no frames or no points", "Give at least one of both")
    if len(set(names)) != len(names) or not all(names):
        twice = next(n for n in names if not n or names.count(n) > 1)
        who.refuse("names", f"the name {twice!r} is empty or there twice", "Give each node a name of its own")
    assert tracks.t_s is not None
    _check_times(tracks.frame, tracks.t_s, who, notes)
    xy = np.array(tracks.xyz, dtype=np.float64)
    seen = _seen(tracks, xy, who)
    if not seen.any():
        who.refuse("xy_px", "no point is seen in any frame", "Give places")
    xy[~seen] = np.nan
    sigma = _sigma(tracks, xy, seen, who, notes)
    status = np.where(seen, SEEN, MISSING).astype(np.uint8) if tracks.status is None else tracks.status
    area = np.where(seen, 0.0 if tracks.area_px is None else tracks.area_px, np.nan).astype(np.float32)
    rig = _rig(tracks, xy, seen, _bodies(tracks, bodies, who, notes), notes)
    _native.rig_toml(rig.to_json())  # refuses what is no rig
    return tracks.frame, tracks.t_s, xy, sigma, area, status, rig, _meta(tracks, rig, notes)


def _check_times(frame: NDArray[np.int64], t_s: Floats, who: Who, notes: list[str]) -> None:
    """Refuses times that are not numbers or do not increase, and notes steps that differ."""
    bad = np.flatnonzero(~np.isfinite(t_s))
    if bad.size:
        who.refuse("t_s", "the time is no number", "Give every frame a time in s", f"frame {frame[bad[0]]}")
    steps, counts = np.diff(t_s), np.diff(frame)
    back = np.flatnonzero(steps <= 0)
    if back.size:
        i = int(back[0])
        problem = f"its time {float(t_s[i + 1])!r} s comes after {float(t_s[i])!r} s of frame {frame[i]}"
        who.refuse("t_s", problem, "Give times that increase", f"frame {frame[i + 1]}")
    if steps.size:
        each = steps / counts
        middle = float(np.median(each))
        uneven = np.flatnonzero(np.abs(each - middle) > UNEVEN * middle)
        if uneven.size:
            i = int(uneven[0])
            notes.append(
                f"times are not evenly spaced: {each[i]:.6g} s a frame after frame {frame[i]}, {middle:.6g} s in the "
                f"middle; {uneven.size} of {steps.size} steps differ by more than {UNEVEN:g} of it"
            )


def _seen(tracks: RawTracks, xy: Floats, who: Who) -> NDArray[np.bool_]:
    """Where a point has a place, (T, N). Refuses half a place, and a place where the status says there is none."""
    there = ~np.isnan(xy)
    odd = np.argwhere((there.any(axis=2) & ~there.all(axis=2)) | np.isinf(xy).any(axis=2))
    if odd.size:
        t, n = odd[0]
        problem = f"the place of {tracks.names[n]} is ({xy[t, n, 0]:g}, {xy[t, n, 1]:g})"
        who.refuse(
            "xy_px",
            problem,
            "Give both coordinates, or neither where it is not seen",
            f"frame {tracks.frame[t]}",
        )
    seen = np.asarray(there.all(axis=2))
    if tracks.status is None:
        return seen
    is_seen = np.isin(tracks.status, PLACED)
    wrong = np.argwhere(is_seen & ~seen)
    if wrong.size:
        t, n = wrong[0]
        problem = f"{tracks.names[n]} is seen by its status and has no place"
        who.refuse("status", problem, "Give a place, or the status missing", f"frame {tracks.frame[t]}")
    return np.asarray(seen & is_seen)


def _sigma(
    tracks: RawTracks, xy: Floats, seen: NDArray[np.bool_], who: Who, notes: list[str]
) -> NDArray[np.float32]:
    """Standard uncertainties (T, N), px: those given, or one for all from how the places scatter."""
    if tracks.sigma is not None:
        given = np.broadcast_to(np.asarray(tracks.sigma, dtype=np.float64), seen.shape)
        wrong = np.argwhere(seen & ~(np.isfinite(given) & (given > 0)))
        if wrong.size:
            t, n = wrong[0]
            problem = f"the uncertainty of {tracks.names[n]} is {given[t, n]:g} px"
            who.refuse("sigma_px", problem, "Give pixels above 0 for every place", f"frame {tracks.frame[t]}")
        return np.where(seen, given, np.nan).astype(np.float32)
    noise = np.array([highpass_noise(xy[:, n, axis]) for n in range(xy.shape[1]) for axis in range(2)])
    noise = noise[np.isfinite(noise)]
    value, why = ASSUMED_SIGMA_PX, "assumed: the tracks are too short to show it"
    if noise.size:
        value = max(float(np.median(noise)), LEAST_SIGMA_PX)
        why = "the scatter about cubics through nine neighbours, the middle over all nodes; no systematic errors"
    notes.append(f"no uncertainty is given: {value:.3g} px is taken for every place ({why})")
    return np.where(seen, value, np.nan).astype(np.float32)


def _bodies(
    tracks: RawTracks, bodies: Bodies, who: Who, notes: list[str]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The bodies in order, and the body of each node."""
    names = tracks.names
    if bodies is None and tracks.bodies is None:
        notes.append(SINGLE_POINT)
        return names, names
    if isinstance(bodies, str):
        who.refuse(
            "bodies",
            f"{bodies!r} is a text",
            "Give the nodes of each body by its name, or one body for each node",
        )
    if isinstance(bodies, Mapping):
        owner: dict[str, str] = {}
        for body, members in bodies.items():
            if isinstance(members, str) or not members:
                who.refuse("bodies", f"the body {body!r} has {members!r}", "Give a list of its nodes")
            for member in members:
                if member not in names:
                    who.refuse(
                        "bodies",
                        f"the body {body!r} has a node {member!r} that is not there",
                        f"The nodes are {', '.join(names)}",
                    )
                if owner.setdefault(member, body) != body:
                    who.refuse(
                        "bodies",
                        f"the node {member!r} is in {owner[member]!r} and in {body!r}",
                        "Leave it in one",
                    )
        alone = [n for n in names if n not in owner]
        taken = next((n for n in alone if n in bodies), None)
        if taken is not None:
            who.refuse(
                "bodies",
                f"the node {taken!r} is in no body, and a body has its name",
                "Give the body another name",
            )
        return (*bodies, *alone), tuple(owner.get(n, n) for n in names)
    each = tracks.bodies if bodies is None else tuple(bodies)
    assert each is not None
    if len(each) != len(names):
        who.refuse(
            "bodies",
            f"{len(each)} bodies for {len(names)} nodes",
            "Give one body for each node, or the nodes of each body by its name",
        )
    return tuple(dict.fromkeys(each)), each


def _rig(
    tracks: RawTracks,
    xy: Floats,
    seen: NDArray[np.bool_],
    bodies: tuple[tuple[str, ...], tuple[str, ...]],
    notes: list[str],
) -> Rig:
    """The rig: its reference picture is the first in which all nodes are seen, or has no number."""
    image = tracks.image_px
    if image is None:
        low, high = np.nanmin(xy, axis=(0, 1)), np.nanmax(xy, axis=(0, 1))
        # At least as large as the farthest place is from the first pixel, on either side.
        width, height = (int(np.ceil(max(abs(a), abs(b)))) + 1 for a, b in zip(low, high, strict=True))
        image = (width, height)
        notes.append(
            f"the size of the pictures is not known: {width} x {height} px, which holds all places, is taken"
        )
    best = int(np.argmax(seen.sum(axis=1)))
    reference: int | None = int(tracks.frame[best])
    places = xy[best].copy()
    lacking = [n for n in range(len(tracks.names)) if not seen[best, n]]
    if lacking:
        reference = None
        notes.append(
            f"no frame shows all nodes: {', '.join(tracks.names[n] for n in lacking)} stand in the rig as first seen, "
            "and there is no reference picture"
        )
    for n in lacking:
        when = np.flatnonzero(seen[:, n])
        # A node that is never seen needs a place of its own in the rig all the same.
        places[n] = xy[when[0], n] if when.size else (n / len(tracks.names), 0.0)
    order, owner = bodies
    nodes = tuple(
        Node(name, body, float(x), float(y))
        for name, body, (x, y) in zip(tracks.names, owner, places, strict=True)
    )
    return Rig(image, nodes, order, reference_frame=reference)


def _meta(tracks: RawTracks, rig: Rig, notes: list[str]) -> dict[str, Any]:
    width, height = rig.image_px
    return {
        "schema_version": 1,
        "tool": f"pydpend {_native.VERSION}",
        "source": {
            "name": ", ".join(map(os.path.basename, tracks.source.split(", "))) or tracks.form,
            "container": tracks.form,
            "codec": "",
            "width": width,
            "height": height,
            "depth_bits": 0,
            "rate_origin": "user" if "fps" in tracks.facts else "time_stamps",
            "time_base": [1, 1_000_000_000],
            "warnings": [],
        },
        "settings": {"import": {"form": tracks.form, **tracks.facts, "notes": notes}},
        "ending": {"kind": "complete"},
    }
