"""Each figure of a run folder alone, from the files that lie in it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pydpend.angles import read_angles
from pydpend.columns import read_columns
from pydpend.damping.stored import load_fit
from pydpend.documents import Table, read_json
from pydpend.encoder import read_calibration
from pydpend.errors import ANALYSE, PydpendError, Setting, fault, listed
from pydpend.kinds import expect
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


AGAIN = "Do " + ANALYSE + " again"


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


def read_table(path: Path, *required: str) -> dict[str, Floats]:
    """All columns of a table that a stage wrote. Raises FigureError if it is damaged or lacks a ``required`` one."""
    return read_columns(path, required, None, error=FigureError).values


def _json(path: Path) -> Table:
    return read_json(path, FigureError, AGAIN)


def _angles(r: Stored) -> Figure:
    label = r.facts["label"]
    return angles_figure(read_angles(r.here / "angles.parquet", name=label))


def _nodes(r: Stored) -> Figure:
    path = r.here / "nodes.parquet"
    if not path.exists():
        path = Path(r.facts["path"])
        if not path.is_file():
            raise FigureError(fault(str(path), "the run's node table is no longer there", AGAIN))
    nodes = read_nodes(path)
    names = [f"node{i}_px" for i in range(len(nodes.rig.nodes))]
    columns = read_table(r.here / "residuals.parquet", *names)
    residual = np.column_stack([columns[name] for name in names])
    if len(residual) != len(nodes):
        raise FigureError(
            fault(str(r.here), f"{len(residual)} rows of residuals for {len(nodes)} frames", AGAIN)
        )
    return nodes_figure(nodes, residual)


def _calibration(r: Stored) -> Figure:
    return calibration_figure(read_calibration(r.here / "encoder.json"))


def _comparison(r: Stored) -> Figure:
    numbers = _json(r.here / "comparison.json")
    c = read_table(r.here / "comparison.parquet", "time_s", "video_rad", "encoder_rad", "residual_rad")
    film = read_angles(r.here / "angles.parquet")
    link = numbers.whole("link", 1, film.links) - 1
    sigmas = numbers.table("stated_sigma_rad")
    sigma = np.interp(c["time_s"], film.t_s, film.sigma_rad[:, link])
    found = Compared(
        link,
        c["time_s"],
        c["video_rad"],
        c["encoder_rad"],
        sigma,
        c["residual_rad"],
        numbers.number("gain"),
        numbers.number("offset_rad"),
        (sigmas.number("encoder") if "encoder" in sigmas else 0.0) or np.nan,
        numbers.number("rms_rad"),
    )
    return comparison_figure(found)


def _energy(r: Stored) -> Figure:
    path = table_of_fit("energy", r.run, r.index)
    return energy_figure(read_table(path, "time_s", "energy_j", "model_j"))


def _residuals(r: Stored) -> Figure:
    path = table_of_fit("residuals", r.run, r.index)
    return residuals_figure(read_table(path, "time_s", "phi1_residual_rad", "phi1_sigma_rad"))


def table_of_fit(name: str, run: Path, index: int) -> Path:
    """A recording's table of the fit: ``energy.csv``, or ``energy-2.csv`` where there are several recordings."""
    alone = run / "fit" / f"{name}.csv"
    return alone if alone.exists() else run / "fit" / f"{name}-{index + 1}.csv"


def _fit(r: Stored) -> Table:
    return _json(r.run / "fit" / "fit.json")


def _shares(r: Stored) -> Figure:
    shares = _fit(r).table("shares")
    groups = {group: shares.table(group) for group in ("law", "joint")}
    return shares_figure(
        {
            group: {
                name: {key: table.table(name).number(key) for key in ("value", "sigma")} for name in table
            }
            for group, table in groups.items()
        }
    )


def _coefficients(r: Stored) -> Figure:
    trials = r.run / "fit" / "trials.json"
    stored = (_json(trials) if trials.exists() else _fit(r)).table("coefficients")
    each = {name: stored.table(name) for name in stored}
    if trials.exists():
        return coefficients_figure({name: _trials(table) for name, table in each.items()})
    return coefficients_figure(
        {
            name: {"values": [c.number("value")], "sigmas": [c.number("sigma")], "unit": c.text("unit")}
            for name, c in each.items()
        }
    )


def _trials(table: Table) -> dict[str, Any]:
    """A coefficient over the recordings, every value checked."""
    values, sigmas = table.array("values", -1), table.array("sigmas", -1)
    if values.shape != sigmas.shape:
        table.refuse("sigmas", f"{sigmas.size} uncertainties for {values.size} values")
    more = {key: table.number(key) for key in ("mean", "sigma")}
    return {"values": values.tolist(), "sigmas": sigmas.tolist(), "unit": table.text("unit"), **more}


def _prediction(r: Stored) -> Figure:
    return windows_figure(read_table(r.here / "windows.csv", "window_s", "start_s", "phi1_rms_deg"))


def _maps(r: Stored) -> Figure:
    maps = load_fit(r.run / "fit").maps
    if maps is None:
        raise FigureError(fault("maps", f"the fit of {r.run} was made without angle maps", AGAIN))
    return maps_figure(maps)


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
        "each node over time: seen, missing, reacquired, ambiguous, undecoded; distance to the shape",
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
    expect(path, ("run",), FigureError)
    record = path / "run.json"
    if not record.is_file():
        raise FigureError(
            fault(str(path), "is not a run folder (it has no run.json)", "Make one with " + ANALYSE)
        )
    out = []
    for i, facts in enumerate(_json(record).table("facts").tables("recordings")):
        name = facts.text("name")
        if "/" in name or name in ("", ".", ".."):
            facts.refuse("name", f"{name!r} is no folder of the run", "Make the run again with " + ANALYSE)
        for key in ("label", "path", "kind"):
            facts.text(key)
        out.append(Stored(i, path / name, path, facts.values))
    if not out:
        raise FigureError(fault(str(record), "there is no recording in it", AGAIN))
    return out


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
    if name not in DRAWINGS:
        raise FigureError(fault(name, "is not a figure", f"Give {listed(DRAWINGS)}"))
    drawing = DRAWINGS[name]
    if recording is not None and not drawing.each:
        raise FigureError(fault(Setting("recording"), f"{name} is of the whole run", "Leave it out"))
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
