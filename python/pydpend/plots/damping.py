"""Figures of damping fits: energy curve (Fig. 19), coefficients of trials (Fig. 20), shares, prediction, maps."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from pydpend.coefficients import RATIOS
from pydpend.damping import DampingFit, Maps, Prediction
from pydpend.damping.result_parts import EnergyCurve, Estimate, Residuals
from pydpend.fit_folder import FileOfEach, FitFile, FitFolder
from pydpend.plots.angles import thinned
from pydpend.plots.style import COLORS, new_figure, save, style
from pydpend.trials import Spread, Trials


def energy_figure(energy: EnergyCurve, zoom_s: float = 2.0) -> Figure:
    """Energy of the measured angles, of the fitted motion and of the start less losses (Fig. 19).

    The first ``zoom_s`` seconds stand beside.
    """
    t = energy.t_s
    with style():
        figure = new_figure(6.5, 3.0)
        whole, zoom = figure.subplots(1, 2, width_ratios=(2, 1))
        near = t <= t[0] + zoom_s
        for axes, keep in ((whole, slice(None)), (zoom, near)):
            measured = () if energy.measured_j is None else (energy.measured_j,)
            for color, values, line, label in (
                *((COLORS[3], m, "-", "measured") for m in measured),
                (COLORS[0], energy.energy_j, "-", "fitted motion"),
                (COLORS[1], energy.model_j, "--", "start - losses"),
            ):
                axes.plot(*thinned(t[keep], 1e3 * values[keep]), line, color=color, label=label)
            axes.set_xlabel("time (s)")
        whole.set_ylabel("energy (mJ)")
        whole.legend()
        zoom.set_title(f"first {zoom_s:g} s")
    return figure


def residuals_figure(residuals: Residuals) -> Figure:
    """Measured minus fitted angle of each link over time.

    Between plus and minus the standard deviation that each was weighted by.
    """
    t = residuals.t_s
    links = range(1, residuals.residual_rad.shape[1] + 1)
    with style():
        figure = new_figure(6.5, 1.9 * len(links))
        for axes, j in zip(
            figure.subplots(len(links), 1, squeeze=False, sharex=True).ravel(), links, strict=True
        ):
            left = np.degrees(residuals.residual_rad[:, j - 1])
            sigma = np.degrees(residuals.sigma_rad[:, j - 1])
            axes.plot(*thinned(t, left), color=COLORS[j - 1], lw=0.6)
            for edge in (sigma, -sigma):
                axes.plot(*thinned(t, edge), "k--", lw=0.7)
            axes.set_ylabel(f"phi{j}, measured\nminus fitted (deg)")
            axes.set_title(
                f"RMS {np.sqrt(np.nanmean(left**2)):.3g} deg; dashed: ± standard deviation", fontsize=8
            )
        axes.set_xlabel("time (s)")
    return figure


def shares_figure(shares: Mapping[str, Mapping[str, Estimate]]) -> Figure:
    """Fractions of the dissipated energy by law and by joint, with their standard errors.

    ``shares``: `DampingFit.shares`.
    """
    with style():
        figure = new_figure(6.5, 2.2)
        for axes, group in zip(figure.subplots(1, 2, width_ratios=(3, 2)), ("law", "joint"), strict=True):
            items = shares[group]
            axes.barh(
                list(items),
                [100 * e.value for e in items.values()],
                xerr=[100 * e.sigma for e in items.values()],
                color=COLORS[: len(items)],
                height=0.6,
                capsize=3,
                ecolor="0.5",
            )
            axes.invert_yaxis()
            axes.set_xlim(left=0)
            axes.set_xlabel(f"share of the energy by {group} (%)")
    return figure


def coefficients_figure(coefficients: Mapping[str, Spread]) -> Figure:
    """Each coefficient over the recordings with its errors, and the mean with its own, if it is a number (Fig. 20)."""
    columns = min(3, max(1, len(coefficients)))
    rows = -(-len(coefficients) // columns) or 1
    with style():
        figure = new_figure(6.5, 1.6 * rows)
        for k, (name, c) in enumerate(coefficients.items()):
            axes = figure.add_subplot(rows, columns, k + 1)
            index = range(1, len(c.values) + 1)
            axes.errorbar(index, c.values, c.sigmas, fmt="o", ms=3.5, color=COLORS[0], capsize=3)
            if math.isfinite(c.mean):
                axes.axhspan(c.mean - c.sigma, c.mean + c.sigma, alpha=0.2, color=COLORS[1], lw=0)
                axes.axhline(c.mean, color=COLORS[1])
            else:
                axes.axhline(0, color="0.5", lw=0.8)
            unit = f" ({c.unit.replace('s2', 's²')})" if c.unit not in ("", "1") else ""
            axes.set_title(
                f"{name}/psi{unit}" if name in RATIOS else f"{name}{unit}", fontsize=8, loc="right"
            )
            axes.set_xticks(list(index))
            axes.set_xlim(0.5, len(c.values) + 0.5)
            axes.tick_params(labelsize=7)
            axes.ticklabel_format(axis="y", useOffset=False)
    return figure


def windows_figure(prediction: Prediction) -> Figure:
    """RMS of each window over the recording, per window length."""
    with style():
        count = max(1, len(prediction.rows))
        figure = new_figure(6.5, 1.8 * count)
        grid = figure.subplots(count, 1, squeeze=False, sharex=True).ravel()
        for axes, (length, rows) in zip(grid, prediction.rows.items(), strict=False):
            for j in range(rows.shape[1] - 1):
                axes.plot(rows[:, 0], rows[:, j + 1], ".", color=COLORS[j], label=f"phi{j + 1}")
            axes.set_ylabel(f"RMS in {length} s (deg)")
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


def save_figures(fit: DampingFit, trials: Trials | None, folder: FitFolder) -> None:
    """Writes every figure that the fit has something for as PNG into its folder."""
    for k, curve in enumerate(fit.energy):
        save(energy_figure(curve), folder.file_of(FileOfEach.ENERGY_FIGURE, k, len(fit.inputs)))
    save(shares_figure(fit.shares), folder.file(FitFile.SHARES_FIGURE))
    if fit.maps is not None:
        save(maps_figure(Maps.of(fit.maps)), folder.file(FitFile.MAPS_FIGURE))
    if trials is not None:
        save(coefficients_figure(trials.spreads), folder.file(FitFile.TRIALS_FIGURE))
