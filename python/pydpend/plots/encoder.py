"""Figures of the encoder: its calibration line (Fig. 10) and the video beside it (Fig. 15)."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from pydpend.encoder.calibration import Calibration
from pydpend.encoder.compare import Comparison
from pydpend.plots.angles import thinned
from pydpend.plots.style import COLORS, new_figure, style


def calibration_figure(calibration: Calibration) -> Figure:
    """The holds and the line, one hold close up against the specification, and the residuals (Fig. 10)."""
    holds = calibration.holds
    degrees = np.degrees([h.angle_rad for h in holds])
    volts = np.array([h.mean_v for h in holds])
    # A single-turn encoder's holds are drawn on the line, whole spans added.
    on_line = (
        calibration.offset_v + calibration.slope_v_per_rad * np.radians(degrees) + calibration.residual_v
    )
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
        line.set_xticks(degrees, [f"{d:g}" for d in degrees], rotation=45)
        line.legend(loc="best")
        spread = figure.add_subplot(grid[0, 1])
        spread.bar(np.arange(len(holds)), std, color=COLORS[0], width=0.6)
        spread.axhline(1e3 * calibration.spec_v, color=COLORS[1], ls="--")
        spread.text(0, 1e3 * calibration.spec_v, " specified", color=COLORS[1], va="bottom", fontsize=8)
        spread.set_ylim(0, 1.25 * max(float(std.max(initial=0.0)), 1e3 * calibration.spec_v))
        spread.set_ylabel("std of a reading in mV")
        spread.set_xticks(np.arange(len(holds)), [f"{d:g}" for d in degrees], rotation=45)
        rest = figure.add_subplot(grid[1, 1])
        rest.axhline(0, color="0.5", lw=0.8)
        rest.errorbar(
            degrees,
            1e3 * calibration.residual_v,
            1e3 * np.array([h.sigma_v for h in holds]),
            fmt="o",
            ms=3,
            color=COLORS[0],
            capsize=2,
        )
        rest.set_ylabel("hold $-$ line in mV")
        rest.set_xlabel("angle in deg")
        return figure


def comparison_figure(
    found: Comparison,
    zooms: tuple[tuple[float, float], tuple[float, float]] | None = None,
    label: str | None = None,
) -> Figure:
    """Video and encoder: the whole series, two zooms with one-sigma bands, and the residual (Fig. 15).

    ``zooms``: two (start, stop) in s on the video's clock; by default 3 s at a third and 3 s near the end
    of the recording, where the paper has 21-24 s and 60-63 s. ``label``: what to call the encoder, for a
    made signal.
    """
    t = found.t_s
    name = label if label is not None else "encoder"
    length = float(t[-1] - t[0])
    span = min(3.0, length / 4)
    if zooms is None:
        zooms = (
            (t[0] + 0.3 * length, t[0] + 0.3 * length + span),
            (t[0] + 0.8 * length, t[0] + 0.8 * length + span),
        )
    encoder = np.degrees(found.offset_rad + found.gain * found.encoder_rad)
    video = np.degrees(found.video_rad)
    band = np.degrees(found.video_sigma_rad)
    with style():
        figure = new_figure(6.8, 5.0)
        grid = figure.add_gridspec(3, 2, width_ratios=(1.4, 1))
        whole = figure.add_subplot(grid[:2, 0])
        whole.plot(*thinned(t, encoder), color=COLORS[1], lw=0.8, label=name)
        whole.plot(*thinned(t, video), color=COLORS[0], lw=0.8, label="video")
        whole.set_ylabel(f"$\\phi_{found.link + 1}$ in deg")
        whole.legend(loc="best")
        low = figure.add_subplot(grid[2, 0], sharex=whole)
        low.plot(*thinned(t, np.degrees(found.residual_rad)), color=COLORS[2], lw=0.5)
        low.set_ylabel("video $-$ encoder\nin deg")
        low.set_xlabel("time in s")
        side = grid[:, 1].subgridspec(2, 1)
        for n, (start, stop) in enumerate(zooms):
            axes = figure.add_subplot(side[n])
            inside = (t >= start) & (t <= stop)
            axes.plot(t[inside], encoder[inside], ".", ms=1.5, color=COLORS[1])
            axes.plot(t[inside], video[inside], color=COLORS[0], lw=0.8)
            if np.isfinite(band[inside]).any():
                axes.fill_between(
                    t[inside],
                    (video - band)[inside],
                    (video + band)[inside],
                    color=COLORS[0],
                    alpha=0.35,
                    lw=0,
                    label="$\\pm\\sigma$ of the video",
                )
                axes.legend(loc="best", fontsize=7)
            axes.set_title(f"{start:.3g} to {stop:.3g} s", loc="left", fontsize=8)
            axes.set_ylabel("deg")
            whole.axvspan(start, stop, color="0.5", alpha=0.15, lw=0)
        axes.set_xlabel("time in s")
        return figure
