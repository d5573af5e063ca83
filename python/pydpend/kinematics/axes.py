"""Lines of the links whose direction in the picture is their zero, and how well that is known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from pydpend.errors import AnglesError, Setting, fault
from pydpend.kinematics.linkage import Linkage
from pydpend.kinematics.linkage_frames import LinkageAngles, mean_response
from pydpend.kinematics.pose import Pose
from pydpend.kinematics.shape import Shape, across
from pydpend.kinematics.table import Floats
from pydpend.kinematics.vertical import Down, direction
from pydpend.nodes import Joint

Axes = Mapping[str, str | Sequence[str]]
"""The two points of each link by name, from the first to the second: ``"pivot-elbow"`` or ``("pivot", "elbow")``."""

PX = 1.0
"""Standard uncertainty of a joint in the rig that the motion does not tell, px."""


def directions(
    down: Down,
    axes: Axes,
    poses: list[Pose],
    known: Linkage | LinkageAngles | None,
    joints_px: Mapping[Joint, Floats],
) -> Down:
    """Directions of the links with their uncertainties, those of ``axes`` in place of their own.

    ``known``: the linkage, with the angles if these are by it. ``joints_px``: the joints' places (2,) by the rig in the
    world, for links of which the motion tells none.

    Raises :class:`AnglesError` for a link or a point that is not there, or two points that are one.
    """
    turn, sigma, lines = down.turn_rad.copy(), down.sigma_rad.copy(), list(down.lines)
    linkage = known.linkage if isinstance(known, LinkageAngles) else known
    follow = mean_response(known, [p.markers for p in poses]) if isinstance(known, LinkageAngles) else None
    for link in axes:
        if link not in down.links:
            raise AnglesError(
                fault(Setting("axis"), f"there is no link {link!r}", f"The links are {', '.join(down.links)}")
            )
    for k, link in enumerate(down.links):
        points = _points(poses[k], linkage.shape if linkage is not None else None, link, joints_px)
        if link in axes:
            ends = _ends(link, axes[link], list(points))
        elif down.lines[k].count("-") == 1 and all(p in points for p in down.lines[k].split("-")):
            one, _, other = down.lines[k].partition("-")
            ends = (one, other)
        else:
            continue
        (start, at), (stop, to) = points[ends[0]], points[ends[1]]
        v = stop - start
        length = float(np.hypot(*v))
        if not length > 0:
            raise AnglesError(
                fault(Setting("axis"), f"{ends[0]} and {ends[1]} of {link} are one point", "Name two points")
            )
        turn[k], _ = direction(v[None])
        side = np.array([-v[1], v[0]]) / length
        if linkage is not None:
            slope = np.outer(to - at, side).reshape(-1) / length
            if follow is not None:
                # The angles themselves follow the shape, and what both have of its errors is one error.
                slope = slope + follow[k]
            else:
                turned, by = _turned(linkage.shape, k, poses[k])
                turn[k], slope = turn[k] - turned, slope - by
            sigma[k] = np.sqrt(slope @ linkage.covariance_px2 @ slope)
        else:
            sigma[k] = np.hypot(at[0], to[0]) / length
        lines[k] = "-".join(ends)
    return replace(down, turn_rad=turn, sigma_rad=sigma, lines=tuple(lines))


def _turned(shape: Shape, link: int, pose: Pose) -> tuple[float, Floats]:
    """The turn that lays a link's markers in the shape on those of its pose, and its slope (2Q,) by the vectors."""
    rows = shape.markers[shape.of_link == link] * (shape.turns_with == link)
    if len(rows) < 2:
        return 0.0, np.zeros(2 * len(shape.vectors_px))
    rows = rows - rows.mean(axis=0)
    here, there = rows @ shape.vectors_px, pose.template_px
    turn = np.arctan2((here[:, 0] * there[:, 1] - here[:, 1] * there[:, 0]).sum(), (here * there).sum())
    by = np.einsum("kq,kd->qd", rows, across(here)) / (here**2).sum()
    return float(turn), by.reshape(-1)


def _points(
    pose: Pose, shape: Shape | None, link: str, joints_px: Mapping[Joint, Floats]
) -> dict[str, tuple[Floats, Floats]]:
    """The markers and joints of a link: place (2,) in its coordinates, and which vectors lead there, (Q,).

    Without a shape the second is the standard uncertainty, (1,).
    """
    markers = pose.markers
    if shape is None:
        sigma = np.array([float(np.median(markers.weight[markers.seen])) ** -0.5])
        out = {n: (p, sigma) for n, p in zip(markers.nodes, markers.reference_px, strict=True)}
        return out | {j.name: (p, np.array([PX])) for j, p in joints_px.items() if link in j.bodies}
    k = shape.structure.links.index(link)
    names = [j.name for j in shape.structure.joints]
    rows = shape.markers[shape.of_link == k] * (shape.turns_with == k)
    out = {n: (row @ shape.vectors_px, row) for n, row in zip(markers.nodes, rows, strict=True)}
    unit = np.eye(len(shape.vectors_px))
    for j, side, q in shape.ends:
        if side == k:
            out[names[j]] = (shape.local(q), unit[q] if q >= 0 else 0 * unit[0])
    return out


def _ends(link: str, said: str | Sequence[str], known: list[str]) -> tuple[str, str]:
    """The two points that are meant."""
    if isinstance(said, str):
        # Names may have hyphens of their own.
        cuts = [(said[:i], said[i + 1 :]) for i, c in enumerate(said) if c == "-"]
        pairs = [pair for pair in cuts if pair[0] in known and pair[1] in known]
    else:
        pairs = [(str(said[0]), str(said[1]))] if len(said) == 2 else []
        pairs = [pair for pair in pairs if pair[0] in known and pair[1] in known]
    if len(pairs) != 1:
        shown = said if isinstance(said, str) else "-".join(map(str, said))
        raise AnglesError(
            fault(
                Setting("axis"),
                f"{shown!r} names no two points of {link}",
                f"Give two of {', '.join(known)} as {known[0]}-{known[-1]}",
            )
        )
    return pairs[0]
