"""Each figure of a run folder alone, from the files that lie in it."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pydpend.angles import read_angles
from pydpend.damping.maps import Maps
from pydpend.encoder import read_calibration
from pydpend.errors import PydpendError, Setting, fault
from pydpend.nodes import read_nodes
from pydpend.plots.angles import angles_figure
from pydpend.plots.damping import (
    coefficients_figure,
    energy_figure,
    maps_figure,
    residuals_figure,
    shares_figure,
    windows_figure,
)
from pydpend.plots.encoder import calibration_figure, comparison_figure
from pydpend.plots.nodes import nodes_figure

Floats = NDArray[np.float64]


class FigureError(PydpendError):
    """A figure that a run folder has nothing for."""


@dataclass(frozen=True)
class Stored:
    """One recording of a run folder: its place among all, its folder, the run's folder, the recording's facts."""

    index: int
    here: Path
    run: Path
    facts: dict[str, Any]


@dataclass(frozen=True, eq=False)
class Compared:
    """The stored part of a `pydpend.encoder.Comparison` that its figure needs."""

    link: int
    t_s: Floats
    video_rad: Floats
    encoder_rad: Floats
    video_sigma_rad: Floats
    residual_rad: Floats
    gain: float
    offset_rad: float
    encoder_sigma_rad: float
    rms_rad: float


def read_columns(path: Path) -> dict[str, Floats]:
    """Columns of a Parquet or CSV table of numbers."""
    if path.suffix == ".parquet":
        table = pq.read_table(path)
        return {n: table.column(n).to_numpy().astype(np.float64) for n in table.column_names}
    with path.open(encoding="utf-8") as f:
        names = f.readline().strip().split(",")
        values = np.loadtxt(f, delimiter=",", ndmin=2)
    return {n: values[:, i] for i, n in enumerate(names)}


def _json(path: Path) -> dict[str, Any]:
    value: dict[str, Any] = json.loads(path.read_text("utf-8"))
    return value


def _angles(r: Stored) -> Figure:
    label = r.facts["label"]
    return angles_figure(read_angles(r.here / "angles.parquet", name=label))


def _nodes(r: Stored) -> Figure:
    columns = read_columns(r.here / "residuals.parquet")
    path = r.here / "nodes.parquet"
    nodes = read_nodes(path if path.exists() else r.facts["path"])
    residual = np.column_stack([columns[f"node{i}_px"] for i in range(len(nodes.rig.nodes))])
    return nodes_figure(nodes, residual)


def _calibration(r: Stored) -> Figure:
    return calibration_figure(read_calibration(r.here / "encoder.json"))


def _comparison(r: Stored) -> Figure:
    numbers, c = _json(r.here / "comparison.json"), read_columns(r.here / "comparison.parquet")
    film = read_angles(r.here / "angles.parquet")
    link = int(numbers["link"]) - 1
    sigma = np.interp(c["time_s"], film.t_s, film.sigma_rad[:, link])
    found = Compared(
        link,
        c["time_s"],
        c["video_rad"],
        c["encoder_rad"],
        sigma,
        c["residual_rad"],
        float(numbers["gain"]),
        float(numbers["offset_rad"]),
        float(numbers["stated_sigma_rad"]["encoder"] or np.nan),
        float(numbers["rms_rad"]),
    )
    return comparison_figure(found)


def _energy(r: Stored) -> Figure:
    return energy_figure(read_columns(table_of_fit("energy", r.run, r.index)))


def _residuals(r: Stored) -> Figure:
    return residuals_figure(read_columns(table_of_fit("residuals", r.run, r.index)))


def table_of_fit(name: str, run: Path, index: int) -> Path:
    """A recording's table of the fit: ``energy.csv``, or ``energy-2.csv`` where there are several recordings."""
    alone = run / "fit" / f"{name}.csv"
    return alone if alone.exists() else run / "fit" / f"{name}-{index + 1}.csv"


def _shares(r: Stored) -> Figure:
    return shares_figure(_json(r.run / "fit" / "fit.json")["shares"])


def _coefficients(r: Stored) -> Figure:
    trials = r.run / "fit" / "trials.json"
    if trials.exists():
        return coefficients_figure(_json(trials)["coefficients"])
    fit = _json(r.run / "fit" / "fit.json")
    return coefficients_figure(
        {
            k: {"values": [c["value"]], "sigmas": [c["sigma"]], "unit": c["unit"]}
            for k, c in fit["coefficients"].items()
        }
    )


def _prediction(r: Stored) -> Figure:
    return windows_figure(read_columns(r.here / "windows.csv"))


def _maps(r: Stored) -> Figure:
    return maps_figure(Maps.from_json(_json(r.run / "fit" / "fit.json")["maps"]))


@dataclass(frozen=True)
class Drawing:
    """A figure: what it shows, how it is drawn, and the file without which there is none.

    ``each``: one for each recording.
    """

    about: str
    draw: Callable[[Stored], Figure]
    needs: str
    each: bool = True


DRAWINGS = {
    "nodes": Drawing(
        "each node over time: seen, missing, reacquired, ambiguous; distance to the shape",
        _nodes,
        "residuals.parquet",
    ),
    "angles": Drawing("angles and their standard uncertainties (Fig. 16)", _angles, "angles.parquet"),
    "calibration": Drawing(
        "calibration line of the encoder and its residuals (Fig. 10)", _calibration, "encoder.json"
    ),
    "comparison": Drawing(
        "film and encoder, two zooms, residuals (Fig. 15)", _comparison, "comparison.parquet"
    ),
    "residuals": Drawing("measured minus fitted angles over time", _residuals, "fit/fit.json"),
    "energy": Drawing("energy of the motion and the model's, with a zoom (Fig. 19)", _energy, "fit/fit.json"),
    "coefficients": Drawing(
        "coefficients with their errors, over the recordings (Fig. 20)",
        _coefficients,
        "fit/fit.json",
        each=False,
    ),
    "shares": Drawing("where the energy goes, by law and by joint", _shares, "fit/fit.json", each=False),
    "prediction": Drawing("error of each predicted window over time", _prediction, "windows.csv"),
    "maps": Drawing("angle-dependent bias of the tracking", _maps, "fit/maps.png", each=False),
}
"""Every figure of a run folder."""


def recordings_of(run: str | Path) -> list[Stored]:
    """The recordings of a run folder. Raises FigureError if it is none."""
    path = Path(run)
    try:
        facts = _json(path / "run.json")["facts"]["recordings"]
    except (OSError, ValueError, KeyError, TypeError):
        raise FigureError(
            fault(
                str(path),
                "is not a run folder (run.json is missing or damaged)",
                "Make one with pydpend analyse",
            )
        ) from None
    return [Stored(i, path / r["name"], path, r) for i, r in enumerate(facts)]


def chosen(run: str | Path, recording: str | None) -> Stored:
    """The recording called so (its name or its file's), or the only one.

    Raises FigureError if there is none so called, or several and none is named.
    """
    found = recordings_of(run)
    names = ", ".join(r.facts["name"] for r in found)
    if recording is None:
        if len(found) > 1:
            raise FigureError(fault(Setting("recording"), f"{run} has several", f"Give one of {names}"))
        return found[0]
    for r in found:
        if recording in (r.facts["name"], r.facts["label"]):
            return r
    raise FigureError(fault(Setting("recording"), f"{run} has no {recording!r}", f"Give one of {names}"))


def available(r: Stored) -> list[str]:
    """Names of the figures that there is something for."""
    return [name for name, d in DRAWINGS.items() if _file(r, d).exists()]


def _file(r: Stored, d: Drawing) -> Path:
    return (r.run if d.needs.startswith("fit/") else r.here) / d.needs


def figure_of(name: str, run: str | Path, recording: str | None = None) -> Figure:
    """The figure called ``name`` (one of `DRAWINGS`) of a run folder.

    Raises FigureError if the folder has nothing for it or is no run folder.
    """
    drawing = DRAWINGS[name]
    r = chosen(run, recording) if drawing.each else recordings_of(run)[0]
    if not _file(r, drawing).exists():
        there = available(r)
        raise FigureError(
            fault(
                name,
                f"{run} has nothing for it ({_file(r, drawing)} is not there)",
                f"It has {', '.join(there)}" if there else "See the warnings in its report.html",
            )
        )
    return drawing.draw(r)
