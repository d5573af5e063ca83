"""Figures of angles: the series with their uncertainties (Fig. 16) and the two methods of Section 8.2.1
(Fig. 12).
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pydpend.angles.increments import by_changing_vectors, by_increments, by_reference, vectors_of
from pydpend.angles.table import LinkAngles
from pydpend.plots.style import COLORS, new_figure, style

Floats = NDArray[np.float64]

MOST_POINTS = 4000
"""A line is drawn through at most this many points: minimum and maximum of each stretch are kept."""


def thinned(t: Floats, y: Floats, most: int = MOST_POINTS) -> tuple[Floats, Floats]:
    """The series with only the lowest and the highest point of each stretch; NaN stay as breaks."""
    if t.size <= most:
        return t, y
    edges = np.linspace(0, t.size, most // 2 + 1).astype(np.int64)
    keep: list[int] = []
    for a, b in pairwise(edges.tolist()):
        part = y[a:b]
        if np.isnan(part).all():
            keep.append(int(a))
        else:
            keep += sorted({int(a + np.nanargmin(part)), int(a + np.nanargmax(part))})
    index = np.array(keep)
    return t[index], y[index]


def angles_figure(angles: LinkAngles, title: str | None = None) -> Figure:
    """Angles above, their one-sigma uncertainties below, in degrees (Fig. 16)."""
    with style():
        figure = new_figure(6.5, 4.2)
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
        for k in range(angles.links):
            name = f"$\\phi_{k + 1}$"
            upper.plot(*thinned(angles.t_s, np.degrees(angles.phi_rad[:, k])), color=COLORS[k], label=name)
            sigma = np.degrees(angles.sigma_rad[:, k])
            if np.isfinite(sigma).any():
                lower.plot(
                    *thinned(angles.t_s, sigma),
                    color=COLORS[k],
                    lw=0.6,
                    alpha=0.8,
                    label=f"$\\sigma_{{\\phi_{k + 1}}}$",
                )
        upper.set_ylabel("angle in deg")
        upper.legend(loc="upper right", ncols=2)
        upper.set_title(title if title is not None else angles.name, loc="left", fontsize=9)
        lower.set_ylabel("$\\sigma$ in deg")
        lower.set_xlabel("time in s")
        if lower.lines:
            lower.set_ylim(bottom=0)
            lower.legend(loc="upper right", ncols=2)
        else:
            lower.text(
                0.5, 0.5, "no uncertainties stated", transform=lower.transAxes, ha="center", va="center"
            )
        return figure


def methods_figure(xy_px: Floats, sigma_px: float, frames: tuple[int, int, int] | None = None) -> Figure:
    """The two ways to an angle (Fig. 12), and how their errors really grow.

    ``xy_px`` (T, K, 2): centres of one body's markers, y up, all seen, K at least 3. Above: the vector from
    the first to the second marker in three frames, against the first frame's (method 1) and from frame to
    frame (method 2). Below: standard uncertainty of both, of method 2 with another vector in every step,
    and the sum of errors that the paper's Eq. 44 states.
    """
    total, count = xy_px.shape[:2]
    picked = frames if frames is not None else (0, total // 3, 2 * total // 3)
    v = vectors_of(xy_px, 0, 1)
    one, two = by_reference(v, sigma_px), by_increments(v, sigma_px)
    every = np.array([(s % count, (s + 1) % count) for s in range(total - 1)], dtype=np.int64)
    changing = by_changing_vectors(xy_px, every, sigma_px)
    with style():
        figure = new_figure(6.5, 5.2)
        grid = figure.add_gridspec(2, 2, height_ratios=(1, 1))
        for column, title in enumerate(("method 1: against the reference", "method 2: from frame to frame")):
            axes = figure.add_subplot(grid[0, column])
            axes.set_aspect("equal")
            axes.set_title(title, loc="left", fontsize=9)
            angle = np.arctan2(v[list(picked), 1], v[list(picked), 0])
            length = float(np.hypot(*v[picked[0]]))
            for n, f in enumerate(picked):
                axes.annotate(
                    "",
                    xy=tuple(v[f]),
                    xytext=(0, 0),
                    arrowprops={"arrowstyle": "->", "color": COLORS[n], "lw": 1.4},
                )
                axes.text(
                    1.08 * v[f, 0], 1.08 * v[f, 1], f"$t_{n}$", color=COLORS[n], ha="center", va="center"
                )
            for n in (1, 2):
                start = angle[0] if column == 0 else angle[n - 1]
                turn = float(np.angle(np.exp(1j * (angle[n] - start))))
                along = start + np.linspace(0, turn, 60)
                radius = length * (0.3 + 0.15 * n)
                axes.plot(radius * np.cos(along), radius * np.sin(along), color=COLORS[n], lw=1.0)
                middle = along[30]
                name = f"$\\phi(t_{n})$" if column == 0 else f"$\\Delta\\phi_{n}$"
                axes.text(1.15 * radius * np.cos(middle), 1.15 * radius * np.sin(middle), name, fontsize=8)
            axes.set_xlim(-1.25 * length, 1.25 * length)
            axes.set_ylim(-1.25 * length, 1.25 * length)
            axes.set_xlabel("x in px")
        axes = figure.add_subplot(grid[1, :])
        steps = np.arange(1, total)
        axes.loglog(
            steps, np.degrees(one.sigma_rad[1:]), color=COLORS[0], lw=2.5, alpha=0.5, label="method 1"
        )
        axes.loglog(
            steps, np.degrees(two.sigma_rad[1:]), color=COLORS[1], ls="--", label="method 2, one vector"
        )
        axes.loglog(
            steps, np.degrees(changing.sigma_rad[1:]), color=COLORS[2], label="method 2, another every step"
        )
        if two.summed_rad is not None:
            axes.loglog(
                steps, np.degrees(two.summed_rad[1:]), color=COLORS[3], ls=":", label="errors summed (Eq. 44)"
            )
        axes.set_xlabel("frames since the reference")
        axes.set_ylabel("$\\sigma_\\phi$ in deg")
        axes.legend(loc="upper left")
        return figure
