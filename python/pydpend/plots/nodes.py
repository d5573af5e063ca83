"""The identity map: what was known of each node over time."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from pydpend.nodes import STATUS_WORDS, Nodes
from pydpend.plots.angles import thinned
from pydpend.plots.style import COLORS, new_figure, plain, style

STATUS_COLORS = ("0.85", COLORS[2], COLORS[0], COLORS[1], COLORS[3], COLORS[4])
"""Missing, seen, reacquired, ambiguous, undecoded, manual."""


def nodes_figure(nodes: Nodes, residual_px: NDArray[np.float64]) -> Figure:
    """A row for each node: its status, and its distance (T, N) from its place in its body's shape as a curve.

    A row is as high as the 99.9th percentile of all distances; larger ones are cut off.
    """
    count = len(nodes.rig.nodes)
    known = np.isfinite(residual_px)
    full = float(np.nanpercentile(residual_px, 99.9)) if known.any() else 1.0
    step = float(np.median(np.diff(nodes.t_s))) if len(nodes) > 1 else 1.0
    ends = np.append(nodes.t_s[1:], nodes.t_s[-1] + step)
    with style():
        figure = new_figure(6.5, 0.9 + 0.32 * count)
        axes = figure.subplots()
        for i in range(count):
            status = nodes.status[:, i]
            first = np.concatenate(([0], np.flatnonzero(np.diff(status)) + 1))
            last = np.append(first[1:], status.size) - 1
            for code in range(len(STATUS_WORDS)):
                rows = status[first] == code
                spans = list(
                    zip(nodes.t_s[first[rows]], ends[last[rows]] - nodes.t_s[first[rows]], strict=True)
                )
                axes.broken_barh(spans, (count - 1 - i + 0.1, 0.8), facecolors=STATUS_COLORS[code], lw=0)
            height = 0.8 * np.clip(residual_px[:, i] / full, 0, 1)
            axes.plot(*thinned(nodes.t_s, count - 1 - i + 0.1 + height), color="black", lw=0.3)
        axes.set_yticks(
            [count - 0.5 - i for i in range(count)], [plain(n.name) for n in nodes.rig.nodes], fontsize=8
        )
        axes.set_ylim(0, count)
        axes.set_xlim(nodes.t_s[0], ends[-1])
        axes.grid(False)
        axes.set_xlabel("time in s")
        axes.set_title(
            f"curves: distance from the body's shape, a row is {full:.2g} px high"
            if known.any()
            else "no body shows two nodes at once, so there is no shape to compare with",
            loc="left",
            fontsize=8,
        )
        figure.legend(
            handles=[Patch(color=c, label=w) for c, w in zip(STATUS_COLORS, STATUS_WORDS, strict=True)],
            loc="outside lower center",
            ncols=len(STATUS_WORDS),
        )
    return figure
