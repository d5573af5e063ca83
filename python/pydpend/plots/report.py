"""Small figures that stand in the report page."""

from __future__ import annotations

from typing import Any

from matplotlib.figure import Figure

from pydpend.plots.style import COLORS, new_figure, style


def trials_overview(trials: dict[str, Any]) -> Figure:
    """Each coefficient over the recordings (Fig. 20): dots with standard uncertainties, the mean as a line."""
    coefficients = trials["coefficients"]
    columns = min(4, max(1, len(coefficients)))
    rows = -(-len(coefficients) // columns) or 1
    with style():
        figure = new_figure(2.0 * columns, 1.7 * rows)
        for k, (name, c) in enumerate(coefficients.items()):
            axes = figure.add_subplot(rows, columns, k + 1)
            x = range(1, len(c["values"]) + 1)
            axes.errorbar(x, c["values"], yerr=c["sigmas"], fmt="o", ms=3.5, color=COLORS[0], capsize=2)
            axes.axhline(c["mean"], color=COLORS[1])
            axes.axhspan(c["mean"] - c["sigma"], c["mean"] + c["sigma"], color=COLORS[1], alpha=0.2, lw=0)
            axes.set_title(f"{name} ({c['unit']})" if c["unit"] else name, fontsize=8)
            axes.set_xticks(list(x))
            axes.set_xlim(0.5, len(c["values"]) + 0.5)
            axes.tick_params(labelsize=7)
    return figure
