"""Figures of damping fits: energy curve (Fig. 19), coefficients of trials (Fig. 20), shares, prediction,
maps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from pydpend.damping import DampingFit, Maps, Prediction
from pydpend.damping.stored import recording_suffix
from pydpend.plots.style import COLORS, new_figure, save, style
from pydpend.trials import Trials


def energy_figure(fit: DampingFit, recording: int = 0, zoom_s: float = 2.0) -> Figure:
    """Energy of the motion and the model's, with the first ``zoom_s`` seconds beside (Fig. 19).

    Raises IndexError for a recording the fit does not have.
    """
    curve = fit.energy[recording]
    with style():
        figure = new_figure(6.5, 3.0)
        whole, zoom = figure.subplots(1, 2, width_ratios=(2, 1))
        stride = max(1, curve.t_s.size // 4000)
        near = curve.t_s <= curve.t_s[0] + zoom_s
        for axes, keep in ((whole, slice(None, None, stride)), (zoom, near)):
            axes.plot(curve.t_s[keep], 1e3 * curve.energy_j[keep], color=COLORS[0], label="motion")
            axes.plot(
                curve.t_s[keep], 1e3 * curve.model_j[keep], "--", color=COLORS[1], label="start - losses"
            )
            axes.set_xlabel("time (s)")
        whole.set_ylabel("energy (mJ)")
        whole.legend()
        zoom.set_title(f"first {zoom_s:g} s")
    return figure


def shares_figure(fit: DampingFit) -> Figure:
    """Fractions of the dissipated energy by law and by joint, with their standard errors."""
    with style():
        figure = new_figure(6.5, 2.5)
        for axes, group in zip(figure.subplots(1, 2), ("law", "joint"), strict=True):
            items = fit.shares[group]
            axes.bar(
                list(items),
                [100 * e.value for e in items.values()],
                yerr=[100 * e.sigma for e in items.values()],
                color=COLORS[: len(items)],
            )
            axes.set_ylabel("share of the energy (%)")
            axes.set_title(f"by {group}")
    return figure


def trials_figure(trials: Trials) -> Figure:
    """Each coefficient over the trials with its errors, and the mean with the spread (Fig. 20)."""
    names = list(trials.joint.coefficients)
    with style():
        columns = min(3, len(names))
        rows = -(-len(names) // columns)
        figure = new_figure(6.5, 1.7 * rows)
        grid = figure.subplots(rows, columns, squeeze=False).ravel()
        for axes in grid[len(names) :]:
            axes.set_visible(False)
        for axes, name in zip(grid, names, strict=False):
            spread = trials.spreads.get(name)
            if spread is None:
                continue
            index = np.arange(1, spread.values.size + 1)
            axes.errorbar(index, spread.values, spread.sigmas, fmt="o", color=COLORS[0], capsize=3)
            axes.axhspan(spread.mean - spread.sigma, spread.mean + spread.sigma, alpha=0.2, color=COLORS[1])
            axes.axhline(spread.mean, color=COLORS[1])
            axes.set_title(f"{name} ({spread.unit})")
            axes.set_xticks(index)
    return figure


def prediction_figure(prediction: Prediction) -> Figure:
    """RMS of each window over the recording, per window length."""
    with style():
        figure = new_figure(6.5, 1.8 * len(prediction.rows))
        grid = figure.subplots(len(prediction.rows), 1, squeeze=False, sharex=True).ravel()
        for axes, (window, rows) in zip(grid, prediction.rows.items(), strict=True):
            for j in range(2):
                axes.plot(rows[:, 0], rows[:, 1 + j], ".", color=COLORS[j], label=f"phi{j + 1}")
            axes.set_ylabel(f"RMS in {window} s (deg)")
            axes.set_ylim(bottom=0)
        grid[0].legend()
        grid[-1].set_xlabel("start of the window (s)")
    return figure


def maps_figure(maps: Maps) -> Figure:
    """The angle-bias maps."""
    with style():
        figure = new_figure(6.5, 3.5)
        at = np.linspace(0, 360, maps.knots_rad.shape[2], endpoint=False)
        for row, j in zip(figure.subplots(2, 3, sharex=True, sharey=True), range(2), strict=True):
            for axes, k, name in zip(row, range(3), ("phi1", "phi2", "phi2 - phi1"), strict=True):
                axes.plot(at, np.degrees(maps.knots_rad[j, k]), color=COLORS[j])
                axes.set_xlabel(f"{name} (deg)")
            row[0].set_ylabel(f"bias of phi{j + 1} (deg)")
    return figure


def save_figures(fit: DampingFit, trials: Trials | None, folder: Path) -> None:
    """Writes every figure that the fit has something for as PNG into a folder."""
    for k in range(len(fit.energy)):
        save(energy_figure(fit, k), folder / f"energy{recording_suffix(fit, k)}.png")
    save(shares_figure(fit), folder / "shares.png")
    if fit.maps is not None:
        save(maps_figure(Maps.from_json(fit.maps)), folder / "maps.png")
    if trials is not None:
        save(trials_figure(trials), folder / "trials.png")
