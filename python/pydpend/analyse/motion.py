"""The stages of a run that tell how links and points move: rates, a single pendulum's ring-down, speeds of points.

As in `stages`: each calls public functions, writes their results into a folder and returns one sentence.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pydpend.analyse.options import Options
from pydpend.analyse.state import DoesNotApply, Note, Tell
from pydpend.errors import AnglesError, Setting, fault
from pydpend.kinematics.setting_words import pivots_in_words, scales_in_words
from pydpend.recording_folder import RecordingFolder

if TYPE_CHECKING:
    from pydpend.free_swing import RingDown
    from pydpend.kinematics import LinkAngles, Places
    from pydpend.nodes import Nodes, Rig


def states(name: str, options: Options, here: Path, into: Path, tell: Tell) -> str:
    """Angles to ``states.parquet``; of a single pendulum ``swing.json`` and ``swing.csv`` too."""
    from pydpend.link_states import states as smooth

    angles, folder = RecordingFolder(here).angles(name), RecordingFolder(into)
    found = smooth(angles)
    swing, why = _ring_down(angles, options)
    folder.write_states(found, why)
    said = f"rates and accelerations of {angles.links} link{'s' if angles.links > 1 else ''}"
    if swing is None:
        if why:
            tell(Note(why))
        return said
    folder.write_swing(swing)
    return f"{said}; period {swing.period_s:.6g} s, Q {swing.q:.4g}"


def _ring_down(angles: LinkAngles, options: Options) -> tuple[RingDown | None, str]:
    """A single pendulum's free swing, or why there is none; nothing of several links, which have no one period."""
    from pydpend.damping.single import one_body
    from pydpend.free_swing import ring_down

    if options.pinned and angles.links == 2:
        angles = one_body(angles)[0]
    if angles.links > 1:
        return None, ""
    try:
        return ring_down(angles, start_s=options.start_s, stop_s=options.stop_s), ""
    except AnglesError as problem:
        return None, f"no period and no Q: {problem}"


LEAST_PLACES = 50
"""Places that the smoother takes, at least."""


def points(nodes: Nodes, options: Options, into: Path, tell: Tell) -> str:
    """Places of joints and markers, in metres where a distance is known, to ``points.parquet`` and ``points.json``."""
    from pydpend.kinematics import places
    from pydpend.link_states import point_states

    scale: dict[str, Any] = dict(scales_in_words(options.scale) or {})
    if options.link_length_m is not None:
        link = _first_link(nodes.rig)
        if link is not None and link not in scale:
            scale[link] = options.link_length_m
    named = None if options.points is None else tuple(p.strip() for p in options.points.split(","))
    found = places(
        nodes,
        named,
        scale=scale or None,
        origin=options.origin,
        pivot=pivots_in_words(options.pivot),
        mirrored=options.mirrored,
    )
    kept = _kept(found, nodes.rig, named)
    if not kept:
        raise DoesNotApply(f"no marker and no joint that moves has {LEAST_PLACES} places")
    moving = point_states(found.select(*kept))
    for note in found.meta["notes"]:
        tell(Note(note))
    RecordingFolder(into).write_points(moving, found.meta)
    return f"speed of {', '.join(kept)} in {found.unit}/s"


def _first_link(rig: Rig) -> str | None:
    """The first link from its pivot to its elbow, as a scale names it."""
    pivot = next((j for j in rig.joints if len(j.bodies) == 1), None)
    if pivot is None:
        return None
    elbow = next((j for j in rig.joints if len(j.bodies) == 2 and pivot.bodies[0] in j.bodies), None)
    return None if elbow is None else f"{pivot.name}-{elbow.name}"


def _kept(found: Places, rig: Rig, named: tuple[str, ...] | None) -> tuple[str, ...]:
    """The points that are smoothed: those named, or the joints that move and each link's last marker.

    Raises AnglesError for one that is named and hardly seen.
    """
    seen = dict(zip(found.names, np.isfinite(found.xy[:, :, 0]).sum(axis=0).tolist(), strict=True))
    if named is not None:
        for name in named:
            if seen[name] < LEAST_PLACES:
                problem = (
                    f"{name} has {seen[name]} places, and at least {LEAST_PLACES} are needed for its speed"
                )
                raise AnglesError(fault(Setting("points"), problem, "Leave it out"))
        return named
    tips = {node.body: node.name for node in rig.nodes}
    likely = [j.name for j in rig.joints if len(j.bodies) > 1] + list(tips.values())
    return tuple(name for name in likely if seen.get(name, 0) >= LEAST_PLACES)


def no_pendulum(recordings: list[LinkAngles], rigs: list[Rig | None], options: Options) -> str | None:
    """Why the equations of motion that are fitted are not these recordings', or None where they may be."""
    for angles, rig in zip(recordings, rigs, strict=True):
        names = angles.link_names
        if angles.links > 2:
            return (
                f"{angles.name} has {angles.links} links ({', '.join(names)}), and the equations of motion that are "
                "fitted are those of a pendulum of one or two. Angles, rates and places are in this run"
            )
        hung = [] if rig is None else [j for j in rig.joints if set(j.bodies) <= set(names)]
        if angles.links == 2 and hung and not any(len(j.bodies) == 2 for j in hung):
            return (
                f"{' and '.join(names)} of {angles.name} share no joint, so they are no double pendulum. Angles, rates "
                "and places are in this run"
            )
        if angles.links == 1 and not options.pinned and options.model == Options().model:
            return (
                f"{angles.name} is a single pendulum, and no masses are given. Its period, law of damping and Q "
                "need none and are in this run; N m s need the model of one link (docs/reference/model.md)"
            )
    return None
