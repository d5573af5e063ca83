"""Figures of the encoder: its calibration line (Fig. 10) and the video beside it (Fig. 15)."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pydpend.encoder import Calibration, Comparison
from pydpend.plots.angles import thinned
from pydpend.plots.style import COLORS, new_figure, plain, style

Floats = NDArray[np.float64]


def calibration_figure(calibration: Calibration) -> Figure:
    """The holds and the line, one hold close up against the specification, and the residuals (Fig. 10)."""
    order = sorted(range(len(calibration.holds)), key=lambda i: calibration.holds[i].angle_rad)
    holds = [calibration.holds[i] for i in order]
    residual = calibration.residual_v[order]
    degrees = np.degrees([h.angle_rad for h in holds])
    volts = np.array([h.mean_v for h in holds])
    # A single-turn encoder's holds are drawn on the line, whole spans added.
    on_line = calibration.offset_v + calibration.slope_v_per_rad * np.radians(degrees) + residual
    names = [f"{d:g}".replace("-", "\N{MINUS SIGN}") for d in degrees]
    std = 1e3 * np.array([h.std_v for h in holds])
    with style():
        figure = new_figure(6.5, 4.2)
        grid = figure.add_gridspec(2, 2, width_ratios=(1.6, 1))
        line = figure.add_subplot(grid[:, 0])
        ends = np.array([degrees.min(), degrees.max()])
        line.plot(
            ends,
            calibration.offset_v + calibration.slope_v_per_rad * np.radians(ends),
            color=COLORS[1],
            label=f"{2 * np.pi * calibration.slope_v_per_rad:.5f} V per turn, {calibration.offset_v:.4f} V at zero",
        )
        line.plot(degrees, on_line if calibration.wraps else volts, "o", ms=4, color=COLORS[0], label="holds")
        line.set_xlabel("angle in deg")
        line.set_ylabel("mean voltage in V")
        line.set_xticks(degrees, names, rotation=45)
        line.legend(loc="upper left" if calibration.slope_v_per_rad > 0 else "upper right")
        line.set_ylim(top=line.get_ylim()[1] + 0.12 * float(np.ptp(line.get_ylim())))
        spread = figure.add_subplot(grid[0, 1])
        spread.bar(np.arange(len(holds)), std, color=COLORS[0], width=0.6)
        specified = 1e3 * calibration.spec_v
        spread.axhline(specified, color=COLORS[1], ls="--", label=f"specified {specified:g} mV")
        spread.set_ylim(0, 1.45 * max(float(std.max(initial=0.0)), specified))
        spread.legend(loc="upper right", fontsize=8)
        spread.grid(False, axis="x")
        spread.set_ylabel("std of a reading\nin mV")
        spread.set_xticks(np.arange(len(holds)), names, rotation=45)
        rest = figure.add_subplot(grid[1, 1])
        rest.axhline(0, color="0.5", lw=0.8)
        rest.errorbar(
            degrees,
            1e3 * residual,
            1e3 * np.array([h.sigma_v for h in holds]),
            fmt="o",
            ms=3,
            color=COLORS[0],
            capsize=2,
        )
        rest.set_xticks(degrees, names, rotation=45)
        rest.set_ylabel("hold $-$ line\nin mV")
        rest.set_xlabel("angle in deg")
        return figure


def comparison_figure(
    found: Comparison,
    zooms: tuple[tuple[float, float], tuple[float, float]] | None = None,
    label: str | None = None,
) -> Figure:
    """Video and encoder: the whole series and its residual, and two zooms with one-sigma bands (Fig. 15).

    Below each zoom is what the encoder's readings differ by from the video's angle, with the one-sigma bands of both.
    ``zooms``: two (start, stop) in s on the video's clock; by default 3 s at a third and 3 s near the end
    of the recording, where the paper has 21-24 s and 60-63 s. ``label``: what to call the encoder, for a
    made signal.
    """
    t = found.t_s
    name = plain(label) if label is not None else "encoder"
    length = float(t[-1] - t[0])
    span = min(3.0, length / 4)
    if zooms is None:
        first, last = t[0] + 0.3 * length, t[0] + min(0.8 * length, length - span)
        zooms = ((first, first + span), (last, last + span))
    encoder = np.degrees(found.offset_rad + found.gain * found.encoder_rad)
    video = np.degrees(found.video_rad)
    band = np.degrees(found.video_sigma_rad)
    broad = np.degrees(abs(found.gain) * found.encoder_sigma_rad)
    with style():
        figure = new_figure(7.2, 5.6)
        grid = figure.add_gridspec(3, 2, width_ratios=(1.3, 1))
        whole = figure.add_subplot(grid[:2, 0])
        whole.plot(*thinned(t, encoder), color=COLORS[1], lw=0.8, label=name)
        whole.plot(*thinned(t, video), color=COLORS[0], lw=0.8, label="video")
        whole.set_ylabel(f"$\\phi_{found.link + 1}$ in deg")
        whole.tick_params(labelbottom=False)
        low = figure.add_subplot(grid[2, 0], sharex=whole)
        low.plot(*thinned(t, np.degrees(found.residual_rad)), color=COLORS[2], lw=0.4)
        low.set_ylabel("video $-$ encoder\nin deg")
        low.set_title(f"RMS {np.degrees(found.rms_rad):.3g} deg", loc="right", fontsize=8)
        low.set_xlabel("time in s")
        side = grid[:, 1].subgridspec(4, 1, height_ratios=(2, 1, 2, 1))
        for n, (start, stop) in enumerate(zooms):
            upper = figure.add_subplot(side[2 * n])
            lower = figure.add_subplot(side[2 * n + 1], sharex=upper)
            inside = (t >= start) & (t <= stop)
            at, middle, width = t[inside], video[inside], band[inside]
            upper.plot(at, encoder[inside], ".", ms=1.5, alpha=0.6, mew=0, color=COLORS[1])
            lower.plot(at, (encoder - video)[inside], ".", ms=1.5, alpha=0.6, mew=0, color=COLORS[1])
            for axes, centre in ((upper, middle), (lower, 0 * middle)):
                if np.isfinite(broad):
                    axes.fill_between(
                        at,
                        centre - broad,
                        centre + broad,
                        color=COLORS[1],
                        alpha=0.25,
                        lw=0,
                        label="$\\pm\\sigma$ of the encoder",
                    )
                if np.isfinite(width).any():
                    axes.fill_between(
                        at,
                        centre - width,
                        centre + width,
                        color=COLORS[0],
                        alpha=0.7,
                        lw=0,
                        label="$\\pm\\sigma$ of the video",
                    )
            upper.plot(at, middle, color=COLORS[0], lw=0.8)
            upper.set_title(f"{start:.3g} to {stop:.3g} s", loc="left", fontsize=8)
            upper.set_ylabel("deg")
            upper.tick_params(labelbottom=False)
            lower.set_ylabel("less video\nin deg")
            if n == 0:
                bands = lower.get_legend_handles_labels()
            whole.axvspan(start, stop, color="0.5", alpha=0.15, lw=0)
        lower.set_xlabel("time in s")
        lines = whole.get_legend_handles_labels()
        figure.legend(
            lines[0] + bands[0], lines[1] + bands[1], loc="outside upper center", ncols=4, fontsize=8
        )
        return figure
