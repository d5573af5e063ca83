"""One look for every figure: colour-blind-safe, readable in print, the same fonts and line widths."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import matplotlib
from cycler import cycler
from matplotlib.figure import Figure
from matplotlib.text import Text

from pydpend.errors import PydpendError, fault
from pydpend.output import AnyPath, path_of, whole

COLORS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#b8860b", "#56b4e9")
"""Okabe and Ito's colours (yellow darkened for paper): link or joint 1, link or joint 2, then others."""

FORMATS = ("png", "svg", "pdf")
"""File formats of `save`."""

_INK = "#010203"
"""Stands for the text colour in SVG, replaced by ``currentColor`` so that a page's theme decides."""

_SETTINGS: Any = {
    "axes.grid": True,
    "axes.prop_cycle": cycler(color=COLORS),
    "axes.spines.right": False,
    "axes.spines.top": False,
    "figure.constrained_layout.use": True,
    "font.size": 9.0,
    "grid.alpha": 0.3,
    "grid.linewidth": 0.5,
    "legend.frameon": False,
    "lines.linewidth": 1.0,
    "savefig.dpi": 200,
    "svg.fonttype": "none",
    "svg.hashsalt": "pydpend",
}


@contextmanager
def style() -> Iterator[None]:
    """Use as ``with style(): ...`` around the making of a figure."""
    with matplotlib.rc_context(_SETTINGS):
        yield


def new_figure(width_in: float = 6.5, height_in: float = 3.5) -> Figure:
    """An empty figure of this size; call it inside `style`. Not registered with pyplot, so nothing leaks."""
    return Figure(figsize=(width_in, height_in), layout="constrained")


def plain(text: str) -> str:
    """A name from a user's file as matplotlib draws it letter by letter: a dollar sign begins no formula."""
    return text.replace("$", r"\$")


def save(figure: Figure, path: AnyPath) -> None:
    """Writes PNG, SVG or PDF by the ending. The same figure gives the same bytes."""
    path = path_of(path)
    kind = path.suffix.lower().lstrip(".")
    if kind not in FORMATS:
        raise PydpendError(
            fault(str(path), f"{kind or 'no ending'} is not a figure format", "Use .png, .svg or .pdf")
        )
    metadata = {"png": {"Software": None}, "svg": {"Date": None}, "pdf": {"CreationDate": None}}[kind]
    with matplotlib.rc_context(_SETTINGS), whole(path) as new:
        figure.savefig(new, format=kind, metadata=metadata)


def inline_svg(figure: Figure) -> str:
    """The figure as SVG to stand in an HTML page.

    Text and frames take the page's text colour, curves its ``--s0``, ``--s1``, ... where it has them.
    """
    for axes in figure.axes:
        axes.patch.set_alpha(0.0)
        for spine in axes.spines.values():
            spine.set_edgecolor(_INK)
        axes.tick_params(colors=_INK, which="both")
    for text in figure.findobj(Text):
        text.set_color(_INK)
    figure.patch.set_alpha(0.0)
    out = io.StringIO()
    with matplotlib.rc_context(_SETTINGS):
        figure.savefig(
            out, format="svg", metadata=dict.fromkeys(("Creator", "Date", "Format", "Type")), transparent=True
        )
    svg = out.getvalue()
    svg = svg[svg.index("<svg") :].replace(_INK, "currentColor")
    for k, color in enumerate(COLORS):
        svg = svg.replace(f": {color}", f": var(--s{k}, {color})")
    return svg
