"""The blocks of a report page, and how they become HTML.

Everything that comes from a user's file (names, metadata) is text here and is escaped by the template; only the
SVG that pydpend draws itself and the assets beside this file go in as they are.
"""

from __future__ import annotations

import base64
import json
from dataclasses import dataclass
from enum import Enum
from importlib.resources import files
from typing import Any

import jinja2
import numpy as np
from numpy.typing import NDArray


class _Block:
    @property
    def kind(self) -> str:
        """The name by which the template knows the block."""
        return type(self).__name__


@dataclass(frozen=True)
class Text(_Block):
    """A paragraph."""

    text: str
    quiet: bool = False


@dataclass(frozen=True)
class Heading(_Block):
    """A heading within a section."""

    text: str


@dataclass(frozen=True)
class Listing(_Block):
    """A list of sentences."""

    entries: tuple[str, ...]


@dataclass(frozen=True)
class Links(_Block):
    """Files beside the page, by their paths from it."""

    paths: tuple[str, ...]


@dataclass(frozen=True)
class Code(_Block):
    """Text to be copied; ``label`` says what it is to those who hear the page."""

    text: str
    label: str = "Command"


LONGEST_NUMBER = 32
"""Characters: a value, its uncertainty and its unit fit in; what is longer is a sentence."""


@dataclass(frozen=True)
class Table(_Block):
    """Cells as text; ``numbers`` are the columns set to the right."""

    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    caption: str = ""
    numbers: frozenset[int] = frozenset()

    def is_number(self, column: int) -> bool:
        """Whether the column holds numbers."""
        return column in self.numbers

    def cell_class(self, column: int, cell: str) -> str:
        """The cell's class of style: ``number`` is not broken over lines, ``number words`` is."""
        if not self.is_number(column):
            return ""
        return "number words" if len(cell) > LONGEST_NUMBER else "number"


@dataclass(frozen=True)
class Figure(_Block):
    """A drawing made by pydpend, as SVG."""

    svg: str
    caption: str


@dataclass(frozen=True)
class Reset(_Block):
    """The way to move in the charts of a group, and the way back."""

    group: str
    film: bool = False
    """Whether a film moves with them."""


@dataclass(frozen=True, eq=False)
class Film(_Block):
    """A film in the page. Frame k shows the recording at ``times_s[k]``; its own rate is ``rate_hz``."""

    id: str
    group: str
    mp4: bytes
    times_s: NDArray[np.float64]
    rate_hz: float
    caption: str

    @property
    def base64(self) -> str:
        """The file as base64."""
        return base64.b64encode(self.mp4).decode("ascii")


@dataclass(frozen=True, eq=False)
class Series:
    """One curve; one without a label is not in the legend.

    ``band`` (i, j): fill between the series i and j places before this one (0 is itself). ``edge``: a thin line,
    because it bounds a band.
    """

    label: str
    y: NDArray[np.float64]
    color: int | None = 0
    points: bool = False
    band: tuple[int, int] | None = None
    dashed: bool = False
    edge: bool = False


def band(sigma: NDArray[np.float64]) -> tuple[Series, Series]:
    """A band of ± sigma around zero; it comes after the curves that it is to be seen through."""
    return Series("± sigma", sigma, None, edge=True), Series("", -sigma, None, band=(1, 0), edge=True)


@dataclass(frozen=True, eq=False)
class Chart(_Block):
    """Curves over a common x that can be zoomed; charts of a ``group`` move together."""

    id: str
    title: str
    group: str
    x: NDArray[np.float64]
    series: tuple[Series, ...]
    x_label: str = "time (s)"
    y_label: str = ""
    height: int = 240
    key: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, eq=False)
class StatusMap(_Block):
    """The status of each node over time. ``runs[n]``: (status code, from s, to s).

    ``residual_px[n]``: distance of the node from its place in the body's shape at ``t_s``; drawn in the node's row,
    which is ``full_px`` high.
    """

    id: str
    title: str
    group: str
    t_s: NDArray[np.float64]
    nodes: tuple[str, ...]
    runs: tuple[tuple[tuple[int, float, float], ...], ...]
    residual_px: tuple[NDArray[np.float64], ...] = ()
    full_px: float = 1.0
    height: int = 240
    key: tuple[tuple[str, str], ...] = (
        ("seen", "--s2"),
        ("reacquired", "--s0"),
        ("ambiguous", "--s1"),
        ("missing", "--line"),
        ("undecoded", "--s3"),
        ("manual", "--s4"),
    )


class Light(Enum):
    """A traffic light, from what needs no second look to what is not to be trusted; its value is what it says."""

    GOOD = "good"
    LOOK = "look at it"
    BAD = "not to be trusted"


@dataclass(frozen=True)
class Bar:
    """A part of a whole: its name, its size in words, and its length in percent."""

    label: str
    value: str
    percent: float


@dataclass(frozen=True)
class Tile:
    """A summary at the top. ``svg`` is pydpend's own drawing; a ``film`` of this id gives its picture in its place."""

    id: str
    title: str
    note: str = ""
    light: Light | None = None
    rows: tuple[tuple[str, str], ...] = ()
    bars: tuple[tuple[Bar, ...], ...] = ()
    svg: str = ""
    film: str | None = None


Block = Text | Heading | Listing | Links | Code | Table | Figure | Reset | Film | Chart | StatusMap


@dataclass(frozen=True)
class Section:
    """A part of the page with its own link."""

    id: str
    title: str
    blocks: tuple[Block, ...]


@dataclass(frozen=True)
class Page:
    """The whole page: tiles, warnings, then the sections in order."""

    title: str
    subtitle: str
    warnings: tuple[str, ...]
    sections: tuple[Section, ...]
    tiles: tuple[Tile, ...] = ()


class _Arrays:
    """Collects arrays as base64 of little-endian floats, times in double precision; the same array is kept once.

    A name starts with ``d`` (float64) or ``a`` (float32).
    """

    def __init__(self) -> None:
        self.encoded: dict[str, str] = {}
        self._names: dict[tuple[str, bytes], str] = {}

    def add(self, values: NDArray[np.float64], kind: str = "a") -> str:
        raw = np.ascontiguousarray(values, dtype="<f8" if kind == "d" else "<f4").tobytes()
        key = (kind, raw)
        if key not in self._names:
            self._names[key] = f"{kind}{len(self._names)}"
            self.encoded[self._names[key]] = base64.b64encode(raw).decode("ascii")
        return self._names[key]


def _chart_data(chart: Chart | StatusMap, arrays: _Arrays) -> dict[str, Any]:
    data: dict[str, Any] = {
        "id": chart.id,
        "title": chart.title,
        "group": chart.group,
        "height": chart.height,
    }
    if isinstance(chart, StatusMap):
        edges = np.array([chart.t_s[0], chart.t_s[-1]])
        return data | {
            "kind": "status",
            "x": arrays.add(edges, "d"),
            "x_label": "time (s)",
            "y_label": "",
            "nodes": list(chart.nodes),
            "runs": chart.runs,
            "t": arrays.add(chart.t_s, "d"),
            "residual": [arrays.add(r) for r in chart.residual_px],
            "full": chart.full_px,
            "series": [{"label": "", "y": arrays.add(np.full(2, np.nan))}],
        }
    series = []
    for s in chart.series:
        entry: dict[str, Any] = {"label": s.label, "y": arrays.add(s.y)}
        if s.color is not None:
            entry["color"] = s.color
        for key in ("points", "dashed", "edge"):
            if getattr(s, key):
                entry[key] = True
        if s.band is not None:
            entry["band"] = [-s.band[0], -s.band[1]]
        series.append(entry)
    return data | {
        "kind": "lines",
        "x": arrays.add(chart.x, "d"),
        "x_label": chart.x_label,
        "y_label": chart.y_label,
        "series": series,
    }


def render(page: Page) -> str:
    """The page as HTML that needs nothing outside itself."""
    arrays = _Arrays()
    blocks = [b for s in page.sections for b in s.blocks]
    charts = [_chart_data(b, arrays) for b in blocks if isinstance(b, (Chart, StatusMap))]
    films = [
        {"id": b.id, "group": b.group, "times": arrays.add(b.times_s, "d"), "rate_hz": b.rate_hz}
        for b in blocks
        if isinstance(b, Film)
    ]
    data = json.dumps({"charts": charts, "films": films, "arrays": arrays.encoded}, allow_nan=False)
    # Inside <script> only "</" and "<!--" are special; without any "<" neither can occur.
    data = data.replace("<", "\\u003c")
    here = files("pydpend.report") / "assets"
    read = {
        key: (here / name).read_text("utf-8")
        for key, name in {
            "css": "report.css",
            "js": "report.js",
            "save_js": "save.js",
            "uplot_css": "uPlot.min.css",
            "uplot_js": "uPlot.iife.min.js",
        }.items()
    }
    environment = jinja2.Environment(autoescape=True, trim_blocks=True, undefined=jinja2.StrictUndefined)
    template = environment.from_string((here / "report.html.j2").read_text("utf-8"))
    return template.render(page=page, assets=read, data_json=data)
