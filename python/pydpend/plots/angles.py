"""Figures of angles: the series with their uncertainties (Fig. 16) and the two methods of Section 8.2.1 (Fig. 12)."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pydpend.errors import AnglesError, fault
from pydpend.kinematics.increments import (
    arcsin_steps,
    by_changing_vectors,
    by_increments,
    by_reference,
    steps,
    vectors_of,
)
from pydpend.kinematics.markers import BodyMarkers
from pydpend.kinematics.names import NUMBERED
from pydpend.kinematics.table import LinkAngles
from pydpend.plots.style import COLORS, new_figure, plain, style

Floats = NDArray[np.float64]

MOST_POINTS = 4000
"""A line is drawn through at most this many points: minimum and maximum of each stretch are kept."""

MOST_STRETCHES = 400
"""A quantity that jumps from frame to frame is drawn by quantiles of this many stretches."""


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


def spread(t: Floats, y: Floats, most: int = MOST_STRETCHES) -> tuple[Floats, Floats, Floats, Floats]:
    """Times, and the 10 %, 50 % and 90 % points of the series within each of at most ``most`` stretches.

    Single points stay as they are where there are no more of them; stretches without a number are NaN.
    """
    edges = np.unique(np.linspace(0, t.size, min(most, t.size) + 1).astype(np.int64))
    rows = np.full((edges.size - 1, 3), np.nan)
    for n, (a, b) in enumerate(pairwise(edges.tolist())):
        part = y[a:b][np.isfinite(y[a:b])]
        if part.size:
            rows[n] = np.quantile(part, (0.1, 0.5, 0.9))
    return t[(edges[:-1] + edges[1:] - 1) // 2], rows[:, 0], rows[:, 1], rows[:, 2]


def angles_figure(angles: LinkAngles, title: str | None = None) -> Figure:
    """Angles above, their one-sigma uncertainties below, in degrees (Fig. 16).

    Of a long recording's sigmas the median of each stretch is drawn, and where 80 % of them lie. The camera's part,
    which is one error of all frames in which a link stands alike, is dotted.
    """
    with style():
        figure = new_figure(6.5, 4.2)
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
        for k in range(angles.links):
            color = COLORS[k % len(COLORS)]
            name = _phi(angles, k)
            upper.plot(*thinned(angles.t_s, np.degrees(angles.phi_rad[:, k])), color=color, label=name)
            sigma = np.degrees(angles.sigma_rad[:, k])
            if np.isfinite(sigma).any():
                t, low, middle, high = spread(angles.t_s, sigma)
                lower.fill_between(t, low, high, color=color, alpha=0.25, lw=0)
                lower.plot(t, middle, color=color, label=f"{_sigma(angles, k)} noise")
            part = np.degrees(angles.sigma_camera_rad[:, k])
            if np.isfinite(part).any():
                t, _, middle, _ = spread(angles.t_s, part)
                lower.plot(t, middle, color=color, ls=":", label=f"{_sigma(angles, k)} camera")
        upper.set_ylabel("angle in deg")
        upper.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=2, borderaxespad=0)
        upper.set_title(plain(title if title is not None else angles.name), loc="left", fontsize=9)
        lower.set_ylabel("$\\sigma$ in deg")
        lower.set_xlabel("time in s")
        if lower.lines:
            lower.set_ylim(bottom=0)
            lower.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=4, borderaxespad=0)
        else:
            lower.text(
                0.5, 0.5, "no uncertainties stated", transform=lower.transAxes, ha="center", va="center"
            )
        return figure


def _phi(angles: LinkAngles, link: int) -> str:
    """The symbol of a link's angle: with its number, or its name where there are more than two."""
    if angles.links <= NUMBERED:
        return f"$\\phi_{link + 1}$"
    return f"$\\phi$ {plain(angles.link_names[link])}"


def _sigma(angles: LinkAngles, link: int) -> str:
    """The symbol of its standard uncertainty."""
    if angles.links <= NUMBERED:
        return f"$\\sigma_{{\\phi_{link + 1}}}$"
    return f"$\\sigma$ {plain(angles.link_names[link])}"


def body_methods_figure(markers: BodyMarkers) -> Figure:
    """:func:`methods_figure` of the longest stretch in which all of a body's markers are seen.

    Raises :class:`~pydpend.errors.AnglesError` if it has fewer than three markers or ten such frames in a row.
    """
    edges = np.flatnonzero(
        np.diff(np.concatenate([[False], markers.seen.all(axis=1), [False]]).astype(np.int8))
    )
    runs = edges.reshape(-1, 2)
    first, stop = max(runs.tolist(), key=lambda run: run[1] - run[0], default=(0, 0))
    if markers.seen.shape[1] < 3 or stop - first < 10:
        raise AnglesError(
            fault(
                f"body {markers.name}",
                f"{markers.seen.shape[1]} markers, all seen in {stop - first} frames in a row",
                "The figure of the two methods needs three markers and ten frames",
            )
        )
    sigma = float(np.median(markers.weight[first:stop])) ** -0.5
    return methods_figure(markers.xy_px[first:stop], sigma)


def methods_figure(xy_px: Floats, sigma_px: float, frames: tuple[int, int, int] | None = None) -> Figure:
    """The two ways to an angle (Fig. 12), and how their errors really grow.

    ``xy_px`` (T, K, 2): centres of one body's markers, y up, all seen, K at least 3. Above: the vector from
    the first to the second marker in three frames, against the first frame's (method 1) and from frame to
    frame (method 2), and what a step is found to be by the paper's arcsin and by the atan2 of cross and dot
    product. Below: standard uncertainty of both, of method 2 with another vector in every step, and the sum of
    errors that the paper's Eq. 44 states.
    """
    total, count = xy_px.shape[:2]
    picked = frames if frames is not None else (0, total // 3, 2 * total // 3)
    v = vectors_of(xy_px, 0, 1)
    one, two = by_reference(v, sigma_px), by_increments(v, sigma_px)
    every = np.array([(s % count, (s + 1) % count) for s in range(total - 1)], dtype=np.int64)
    changing = by_changing_vectors(xy_px, every, sigma_px)
    with style():
        figure = new_figure(7.2, 5.0)
        grid = figure.add_gridspec(2, 3, height_ratios=(1, 1))
        for column, title in enumerate(("method 1: to the reference", "method 2: frame to frame")):
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
                # Method 1's arcs lie over each other: the inner one has its name inside.
                out = radius + (-0.2 if column == 0 and n == 1 else 0.2) * length
                axes.text(
                    out * np.cos(middle),
                    out * np.sin(middle),
                    name,
                    color=COLORS[n],
                    fontsize=8,
                    ha="center",
                    va="center",
                )
            axes.set_xlim(-1.25 * length, 1.25 * length)
            axes.set_ylim(-1.25 * length, 1.25 * length)
            axes.set_xlabel("x in px")
            axes.set_ylabel("y in px, upwards")
        axes = figure.add_subplot(grid[0, 2])
        true = np.radians(np.linspace(-175, 175, 71))
        turned = np.stack([np.cos(true), np.sin(true)], axis=1)
        ends = np.stack([np.broadcast_to([1.0, 0.0], turned.shape), turned], axis=1)
        for name, how, color, line in (
            ("atan2", steps, COLORS[0], "-"),
            ("arcsin", arcsin_steps, COLORS[1], "--"),
        ):
            axes.plot(
                np.degrees(true), np.degrees([how(pair)[0] for pair in ends]), line, color=color, label=name
            )
        axes.set_title("one step, as found", loc="left", fontsize=9)
        axes.set_xticks([-180, -90, 0, 90, 180])
        axes.set_yticks([-180, -90, 0, 90, 180])
        axes.set_xlabel("true step in deg")
        axes.set_ylabel("found in deg")
        axes.legend(loc="upper left")
        axes = figure.add_subplot(grid[1, :])
        since = np.arange(1, total)
        axes.loglog(
            since, np.degrees(one.sigma_rad[1:]), color=COLORS[0], lw=2.5, alpha=0.5, label="method 1"
        )
        axes.loglog(
            since,
            np.degrees(two.sigma_rad[1:]),
            color=COLORS[1],
            ls="--",
            label="method 2, one vector: telescopes",
        )
        axes.loglog(
            since,
            np.degrees(changing.sigma_rad[1:]),
            color=COLORS[2],
            label="method 2, another vector every step: $\\sqrt{T}$",
        )
        if two.summed_rad is not None:
            axes.loglog(
                since,
                np.degrees(two.summed_rad[1:]),
                color=COLORS[3],
                ls=":",
                label="errors summed, as in Eq. 44: $T$",
            )
        axes.set_xlabel("frames since the reference")
        axes.set_ylabel("$\\sigma_\\phi$ in deg")
        axes.legend(loc="upper left")
        return figure
