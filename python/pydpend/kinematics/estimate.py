"""From a node table to the angles of its links: :func:`angles`, the one body that calls the estimators."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from pydpend.errors import CHECK, AnglesError, Setting, fault
from pydpend.kinematics.axes import Axes, directions
from pydpend.kinematics.camera_slopes import zero_slopes
from pydpend.kinematics.estimators import Method, Seen, Wishes, estimate, poses_of
from pydpend.kinematics.ground import check_ground, check_order
from pydpend.kinematics.hanging import HORIZONTAL, VERTICAL, Raw, is_direction, zero_for
from pydpend.kinematics.linkage import Linkage
from pydpend.kinematics.linkage_frames import LinkageAngles, fit_joints
from pydpend.kinematics.markers import BodyMarkers, body_markers, never_seen, to_world
from pydpend.kinematics.pivots import check_pivots, with_pivots
from pydpend.kinematics.structure import Structure
from pydpend.kinematics.table import Floats, LinkAngles
from pydpend.kinematics.unwrap import unwrap
from pydpend.kinematics.vertical import picture_down
from pydpend.nodes import Nodes
from pydpend.typed import typed


@typed("zero", "method", "pivot", "axis")
def angles(
    nodes: Nodes,
    estimator: Method = "rigid",
    *,
    zero: str | Sequence[float] | float | Nodes = "rest",
    bodies: Sequence[str] | None = None,
    mirrored: bool = False,
    link_length_m: float | None = None,
    link_length_sigma_m: float = 0.0,
    axis: Mapping[str, str | Sequence[str]] | None = None,
    pivot: Sequence[float] | Mapping[str, Sequence[float]] | None = None,
    gaps: Literal["error", "stop"] = "error",
    name: str | None = None,
    method: None = None,
) -> LinkAngles:
    """Angles of links from where their markers are: counter-clockwise positive, zero hanging down.

    Parameters
    ----------
    nodes : Nodes
        Where each marker is in each of T frames.
    estimator : {"rigid", "linkage", "pairwise"}
        ``"rigid"``: weighted least-squares pose of each body by itself, robust against a bad marker. ``"linkage"``:
        all links and the joints they share fitted together, loops too; needs pivots that stay in place. ``"pairwise"``:
        the paper's Eqs. 30-32 with a circular mean. A link of one marker has its angle from its joint by the first two.
    zero : str, float, sequence of float or Nodes
        ``"rest"`` finds the stretches in which all links hang still, and believes them if nothing in the recording
        contradicts that (docs/explanation/angles.md); ``"vertical"`` is the picture's vertical, with the camera's roll
        as standard uncertainty, 1 deg or as in ``"vertical=0.5"``, and ``"horizontal"`` its direction to the right:
        angles are 0 where a link's line (`axis`) points there; the nodes of another recording with the same rig and
        camera take the rest from there; one number per link says at what angles, in rad, the links stand in the rig's
        reference picture; ``"reference_frame"`` says 0 for all.
    bodies : sequence of str, optional
        Names of the links from the pivot outwards; all of the rig's in its order if not given.
    mirrored : bool
        Whether the film was taken from behind.
    link_length_m : float, optional
        Distance of pivot and elbow, m; it puts the scale into ``meta["linkage"]``.
    link_length_sigma_m : float
        Standard uncertainty of that distance, m.
    axis : dict of str to str or sequence of str, optional
        For links by name the line that is vertical or horizontal at 0, from one of their markers or joints to another:
        ``{"upper": "pivot-elbow"}``. If not given it is from the joint from which a link hangs to its next one, or to
        the mean of its markers.
    pivot : sequence of float or dict of str to sequence of float, optional
        Where a link of one marker hangs, if that was not found: place (x, y) in the picture, px (x right, y down), and
        as a third number its standard uncertainty, 1 px if not given (a place pointed at); of several links by their
        names. It is taken together with what the motion says, and refused where that puts it elsewhere. A link of more
        markers needs none for its angle.
    gaps : {"error", "stop"}
        What to do where a link was hidden for so long that a turn may be lost (more than ``pi / |w|``): refuse, or
        leave the link's angles out from there on and say so in ``meta["notes"]``.
    name : str, optional
        Name of the angles; the recording's if not given.
    method : None
        The old name of `estimator`; refused.

    Returns
    -------
    LinkAngles
        Angles in rad at the T times, unwrapped over turns, the first within (-pi, pi]. ``sigma_rad`` is each frame's
        own standard error, ``camera_rad`` what the camera may be off by in all of them; the uncertainty of the zero,
        common to all frames, is in ``meta["zero"]``. Where the table says that
        its times are uncertain (a variable frame rate in coarse ticks), ``sigma_rad`` holds that too, times the
        link's speed; ``meta["time"]`` says what the times are.

    Raises
    ------
    AnglesError
        For a body never seen, or in one marker only; links in the wrong order, by the rig's joints or by the motion; no
        rest found, or one in which the links are held and do not hang; a turn that may be lost; links that turn too
        little for a linkage; a given pivot that the motion contradicts.

    Warns
    -----
    RecordingWarning
        For a zero by a recording, by angles or by the picture's vertical that is not where the links hang, by their
        swing; ``meta["zero"]["sigma_rad"]`` holds the distance. ``meta["zero"]["contradicted"]`` says so of the
        reference picture too, turns from which are exact.
    """
    if method is not None:
        raise AnglesError(
            fault("method", "the option has another name now", "Give " + Setting("estimator", method))
        )
    markers = body_markers(nodes, bodies, mirrored)
    _check_length(estimator, len(markers), link_length_m, link_length_sigma_m)
    label = name if name is not None else _label(nodes)
    before = nodes.rig
    nodes, given = with_pivots(nodes, markers, pivot, mirrored)
    pivot_notes = check_pivots(before, nodes, poses_of(markers) if given else [], given, mirrored)
    structure = Structure.of(nodes.rig, [m.name for m in markers])
    structure = structure.beside() if given else structure
    check_order(structure, label)
    wishes = Wishes(estimator, mirrored, link_length_m, link_length_sigma_m, given)
    raw, seen = estimate(nodes, markers, structure, wishes)
    notes: list[str] = [*never_seen(nodes, markers), *pivot_notes, *raw.meta.pop("notes", ())]
    ending = nodes.meta.get("ending")
    if isinstance(ending, dict) and ending.get("kind") != "complete":
        why = nodes.damage or ending.get("reason") or ending.get("kind")
        notes.append(f"the node table is not of the whole recording ({why})")
    if bodies is None:
        notes += check_ground(raw.structure, seen.poses, label)
    phi, left_out = _unwrapped(nodes, raw.theta, markers, label, gaps, notes)
    _check_hanging(raw.structure, zero, label)
    raw = _with_directions(raw, seen, nodes, zero, axis or {}, wishes)
    offset, zero_meta, doubts = zero_for(nodes, phi, raw, markers, zero, bodies, mirrored, label)
    notes += doubts
    at_zero = zero_slopes(zero, zero_meta, offset, nodes.t_s, seen.slopes, seen.views, mirrored)
    camera, white = seen.part(nodes.rig, at_zero, raw.sigma)
    notes += camera.notes
    phi = phi - offset
    for k in range(phi.shape[1]):
        first = phi[np.flatnonzero(np.isfinite(phi[:, k]))[0], k]
        phi[:, k] -= 2 * np.pi * np.ceil((first - np.pi) / (2 * np.pi))
    meta = {"method": estimator, "mirrored": mirrored, **raw.meta, "zero": zero_meta, "notes": notes}
    meta |= {"left_out": left_out, "camera": camera.meta}
    for key in ("source", "time"):
        if nodes.meta.get(key) is not None:
            meta[key] = nodes.meta[key]
    sigma, covariance = _with_time(nodes, phi, white, raw)
    links, joints = raw.structure.links, raw.structure.between()
    return LinkAngles(
        nodes.t_s, phi, sigma, nodes.frame, meta, label, camera.columns_rad, links, joints, covariance
    )


def _with_directions(raw: Raw, seen: Seen, nodes: Nodes, zero: object, axis: Axes, wishes: Wishes) -> Raw:
    """The turns with the directions of the links, where a direction of the picture is the zero.

    Raises AnglesError for lines that no zero asks for.
    """
    if not (isinstance(zero, str) and is_direction(zero)):
        if axis:
            problem = "a line of a link counts only where a direction of the picture is the zero"
            advice = "Give " + Setting("zero", VERTICAL) + " or " + Setting("zero", HORIZONTAL)
            raise AnglesError(fault(Setting("axis"), problem, advice))
        return raw
    known: LinkageAngles | Linkage | None = raw.linked
    shape = raw.shape
    by_linkage = wishes.estimator == "linkage" or all(p.is_alone for p in seen.poses)
    if not by_linkage or raw.linked is None:
        try:
            known = fit_joints(seen.poses, raw.structure, wishes.given)
            shape = known.shape
        except AnglesError:
            known = None
    down = picture_down(shape, nodes, [p.markers for p in seen.poses], wishes.mirrored)
    at = {j: to_world(np.array([j.x_px, j.y_px]), nodes.rig, wishes.mirrored) for j in raw.structure.joints}
    return replace(raw, down=directions(down, axis, seen.poses, known, at))


def _check_hanging(structure: Structure, zero: object, label: str) -> None:
    """Raises AnglesError where the zero is to be a rest, and links of a loop hang in none."""
    if isinstance(zero, str) and zero == "rest" and structure.loops:
        closing = structure.loops[0]
        raise AnglesError(
            fault(
                label,
                f"the links close a loop at {closing.name} ({' and '.join(closing.bodies)}), where none hangs by "
                "itself, so a rest is no zero",
                "Give "
                + Setting("zero", VERTICAL)
                + " (angles from the picture's vertical) or "
                + Setting("zero", "reference_frame"),
            )
        )


def _time_sigma_s(nodes: Nodes) -> float:
    """Standard uncertainty of each frame's time in s, as the table says; 0 where it says nothing."""
    time = nodes.meta.get("time")
    return float(time.get("sigma_s", 0.0)) if isinstance(time, dict) else 0.0


def _with_time(nodes: Nodes, phi: Floats, white: Floats, raw: Raw) -> tuple[Floats, Floats | None]:
    """Standard uncertainties (T, L) of angles, rad, with that of their times, and their covariance (T, L, L), if any.

    A link that turns with w is at another angle by ``w dt``, all of a frame with the same dt. ``white``: their noise.
    """
    rate = np.zeros_like(phi)
    time_sigma_s = _time_sigma_s(nodes)
    if time_sigma_s > 0:
        for k in range(phi.shape[1]):
            seen = np.flatnonzero(np.isfinite(phi[:, k]))
            if seen.size > 1:
                rate[seen, k] = np.gradient(phi[seen, k], nodes.t_s[seen])
    late = rate * time_sigma_s
    sigma = np.hypot(white, late)
    if raw.covariance_rad2 is None:
        return sigma, None
    grown = np.where(raw.sigma > 0, white / raw.sigma, 1.0)
    covariance = raw.covariance_rad2 * grown[:, :, None] * grown[:, None, :]
    return sigma, covariance + late[:, :, None] * late[:, None, :]


@typed()
def find_linkage(nodes: Nodes, *, bodies: Sequence[str] | None = None, mirrored: bool = False) -> Linkage:
    """Joints and shape of the links: pivot, elbow, places of the markers, length in px, with uncertainties.

    Parameters
    ----------
    nodes : Nodes
        Where each marker is in each frame.
    bodies : sequence of str, optional
        Names of the links from the pivot outwards; in the rig's order if not given.
    mirrored : bool
        Whether the film was taken from behind.

    Returns
    -------
    Linkage
        Places in the world's directions (x right, y up) and in square pixels, as high as the recorded ones.

    Raises
    ------
    AnglesError
        If the links turn too little to find the joints.
    """
    poses = poses_of(body_markers(nodes, bodies, mirrored))
    return fit_joints(poses, Structure.of(nodes.rig, [p.markers.name for p in poses]))


def _check_length(estimator: Method, links: int, length_m: float | None, length_sigma_m: float) -> None:
    """Raises AnglesError for a length that does nothing or makes no sense."""
    if length_m is None:
        if length_sigma_m:
            problem = "an uncertainty of a length that is not given"
            raise AnglesError(
                fault(Setting("link_length_sigma_m"), problem, "Give " + Setting("link_length_m"))
            )
        return
    if not (np.isfinite(length_m) and length_m > 0):
        raise AnglesError(
            fault(Setting("link_length_m"), f"{length_m:g} m is no length", "Give metres, above 0")
        )
    if estimator == "pairwise":
        advice = "Leave it out, or use " + Setting("estimator", "rigid")
        raise AnglesError(fault(Setting("link_length_m"), "the pairs of markers give no joints", advice))
    if links == 1:
        raise AnglesError(fault(Setting("link_length_m"), "a single link has no elbow", "Leave it out"))


def _label(nodes: Nodes) -> str:
    source = nodes.meta.get("source")
    return str(source.get("name", "nodes")) if isinstance(source, dict) else "nodes"


def _unwrapped(
    nodes: Nodes,
    theta: Floats,
    markers: list[BodyMarkers],
    label: str,
    gaps: Literal["error", "stop"],
    notes: list[str],
) -> tuple[Floats, int]:
    """The angles counted over turns, (T, L), and how many are left out behind a gap in which one may be lost."""
    phi, left_out = np.empty_like(theta), 0
    for k, body in enumerate(markers):
        if not np.isfinite(theta[:, k]).any():
            raise AnglesError(
                fault(
                    label,
                    f"the body {body.name} has no angle in any frame",
                    "Look at " + CHECK + " of the table",
                )
            )
        phi[:, k], lost = unwrap(nodes.t_s, theta[:, k])
        if not lost:
            continue
        gap = lost[0]
        hidden = f"frames {int(nodes.frame[gap.before]) + 1} to {int(nodes.frame[gap.after]) - 1}"
        place = f"{hidden}, body {body.name}"
        problem = (
            f"not seen for {gap.length_s:.4g} s, more than the {gap.limit_s:.4g} s "
            "after which a turn may be lost"
        )
        if gaps == "error":
            raise AnglesError(
                fault(
                    label, problem, "Cut the recording there, or use " + Setting("gaps", "stop"), place=place
                )
            )
        left_out += int(np.isfinite(phi[gap.after :, k]).sum())
        phi[gap.after :, k] = np.nan
        notes.append(f"{place}: {problem}; its angles are left out from there on")
    return phi, left_out
