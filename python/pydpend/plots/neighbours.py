"""The markers of one frame as the paper draws them: lists of neighbours (Fig. 21), vectors (Figs. 5b, 13, 14)."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pydpend.errors import PydpendError, Setting, fault
from pydpend.marker_status import REACQUIRED, SEEN
from pydpend.nodes import Nodes
from pydpend.plots.style import COLORS, new_figure, plain, style

NONE = "None"
"""The paper's word for a neighbour that is not seen."""
MOST_LENGTHS = 4
"""Markers of a link whose distances are written beside the web; with more they cover each other."""


def neighbour_lists(xy_px: NDArray[np.float64]) -> NDArray[np.int64]:
    """The nearest neighbours of each of K markers at (K, 2), as (K - 1, K): a column a marker, the nearest on top."""
    apart = np.linalg.norm(xy_px[:, None] - xy_px[None], axis=2)
    np.fill_diagonal(apart, -1.0)
    return np.argsort(apart, axis=1, kind="stable")[:, 1:].T


def index_of(nodes: Nodes, frame: int | None) -> int:
    """The row of a frame; without one that of the first in which a marker lacks, else the first.

    Raises PydpendError for a frame that the table has not.
    """
    if frame is None:
        lacking = ~np.isin(nodes.status, (SEEN, REACQUIRED)).all(axis=1)
        return int(lacking.argmax())
    found = np.flatnonzero(nodes.frame == frame)
    if found.size == 0:
        raise PydpendError(
            fault(
                Setting("frame"),
                f"the table has no frame {frame}",
                f"Give one of {nodes.frame[0]} to {nodes.frame[-1]}",
            )
        )
    return int(found[0])


def _square(nodes: Nodes) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The markers' places in the reference picture (K, 2) and in all frames (T, K, 2), in square pixels."""
    wide = np.array([nodes.rig.pixel_aspect[0] / nodes.rig.pixel_aspect[1], 1.0])
    reference = np.array([[node.x_px, node.y_px] for node in nodes.rig.nodes])
    return reference * wide, nodes.xy_px * wide


def _members(nodes: Nodes) -> list[tuple[str, list[int]]]:
    """The links of two markers and more, with the numbers of their markers."""
    of = {b: [i for i, n in enumerate(nodes.rig.nodes) if n.body == b] for b in nodes.rig.bodies}
    return [(body, members) for body, members in of.items() if len(members) > 1]


def neighbours_figure(nodes: Nodes, frame: int | None = None) -> Figure:
    """The lists of neighbours of each link in the reference picture, and beside them what is left of them in a frame.

    A column is a marker, its nearest neighbour on top (the paper's NN matrix). A marker that is not seen in the
    frame is replaced by None and its column is grey; one seen for the first time again is marked.
    """
    t = index_of(nodes, frame)
    links = _members(nodes)
    reference, xy = _square(nodes)
    status = nodes.status[t]
    seen = np.isin(status, (SEEN, REACQUIRED))
    names = [plain(node.name) for node in nodes.rig.nodes]
    most = max((len(m) for _, m in links), default=2)
    with style():
        figure = new_figure(7.5, max(2.6, 0.75 + 0.26 * sum(len(m) + 1 for _, m in links)))
        grid = figure.add_gridspec(max(1, len(links)), 3, width_ratios=(1.2, 1, 1))
        _picture(figure.add_subplot(grid[:, 0]), nodes, xy[t], seen)
        for row, (body, members) in enumerate(links):
            lists = neighbour_lists(reference[members])
            for column, title in enumerate(
                (f"{plain(body)}: reference picture", f"frame {nodes.frame[t]}"), 1
            ):
                now = column == 2
                axes = figure.add_subplot(grid[row, column])
                axes.set_title(title, fontsize=8, loc="left")
                axes.set(xlim=(-0.6, most - 0.4), ylim=(len(members) - 0.4, -0.6))
                axes.set_axis_off()
                axes.axhline(0.5, color="0.5", lw=0.8)
                for k, i in enumerate(members):
                    gone = now and not seen[i]
                    back = now and status[i] == REACQUIRED
                    color = "0.6" if gone else COLORS[1] if back else "black"
                    axes.text(
                        k, 0, names[i], ha="center", va="center", fontsize=8, weight="bold", color=color
                    )
                    for j, other in enumerate(lists[:, k], 1):
                        lacks = now and not seen[members[other]]
                        said = NONE if lacks else names[members[other]]
                        faint = gone or lacks
                        axes.text(
                            k,
                            j,
                            said,
                            ha="center",
                            va="center",
                            fontsize=7,
                            color="0.6" if faint else "black",
                        )
    return figure


def _picture(axes: Axes, nodes: Nodes, xy: NDArray[np.float64], seen: NDArray[np.bool_]) -> None:
    """The markers that are seen in a frame, with their names."""
    for i, node in enumerate(nodes.rig.nodes):
        if seen[i]:
            color = COLORS[nodes.rig.bodies.index(node.body) % len(COLORS)]
            axes.plot(*xy[i], "o", color=color, ms=4)
            axes.annotate(plain(node.name), xy[i], (4, 4), textcoords="offset points", fontsize=7)
    lacking = [plain(node.name) for node, there in zip(nodes.rig.nodes, seen, strict=True) if not there]
    axes.set_title(f"not seen: {', '.join(lacking)}" if lacking else "all seen", fontsize=8, loc="left")
    _frame_of(axes)


def _frame_of(axes: Axes) -> None:
    axes.set_aspect("equal", adjustable="datalim")
    axes.invert_yaxis()
    axes.set(xlabel="x (px)", ylabel="y (px)")


def web_figure(nodes: Nodes, frame: int | None = None) -> Figure:
    """The vectors between all markers of each link, in the reference picture with their lengths, and in a frame.

    In the frame the longest vector of each link that is seen stands beside itself in the reference picture (dashed),
    with the angle between the two, counter-clockwise positive.
    """
    t = index_of(nodes, frame)
    reference, xy = _square(nodes)
    names = [plain(node.name) for node in nodes.rig.nodes]
    with style():
        figure = new_figure(7.5, 3.8)
        left, right = figure.subplots(1, 2)
        told = []
        for k, (body, members) in enumerate(_members(nodes)):
            color = COLORS[k % len(COLORS)]
            _web(left, reference, members, color, lengths=len(members) <= MOST_LENGTHS)
            _web(right, xy[t], members, color, lengths=False)
            turned = _turned(right, reference, xy[t], members, color)
            if turned is not None:
                i, j, angle = turned
                told.append(f"{plain(body)}: {names[i]}{names[j]} turned by {np.degrees(angle):+.2f}°")
        for axes, places in ((left, reference), (right, xy[t])):
            for name, place in zip(names, places, strict=True):
                if np.isfinite(place).all():
                    axes.annotate(name, place, (4, 4), textcoords="offset points", fontsize=7)
            _frame_of(axes)
        left.set_title("reference picture (lengths in px where they fit)", fontsize=8, loc="left")
        right.set_title("\n".join([f"frame {nodes.frame[t]}", *told]), fontsize=8, loc="left")
    return figure


def _web(axes: Axes, xy: NDArray[np.float64], members: Sequence[int], color: str, *, lengths: bool) -> None:
    for i, j in itertools.combinations(members, 2):
        if not np.isfinite(xy[[i, j]]).all():
            continue
        axes.plot(*xy[[i, j]].T, "-o", color=color, lw=0.7, ms=3)
        if lengths:
            middle = xy[[i, j]].mean(axis=0)
            length = np.linalg.norm(xy[j] - xy[i])
            axes.annotate(f"{length:.0f}", middle, fontsize=5.5, ha="center", va="center", color=color)


def _turned(
    axes: Axes, reference: NDArray[np.float64], xy: NDArray[np.float64], members: Sequence[int], color: str
) -> tuple[int, int, float] | None:
    """The longest vector of those seen and its turn, rad, counter-clockwise; drawn from its tail as it was and is."""
    pairs = [p for p in itertools.combinations(members, 2) if np.isfinite(xy[list(p)]).all()]
    if not pairs:
        return None
    i, j = max(pairs, key=lambda p: float(np.linalg.norm(reference[p[1]] - reference[p[0]])))
    was, now = reference[j] - reference[i], xy[j] - xy[i]
    # y points down in pictures.
    angle = -float(np.arctan2(was[0] * now[1] - was[1] * now[0], was @ now))
    axes.plot(*np.array([xy[i], xy[i] + was]).T, "--", color=color, lw=1.2)
    axes.plot(*np.array([xy[i], xy[j]]).T, "-", color=color, lw=2.0)
    return i, j, angle
