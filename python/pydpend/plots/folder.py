"""Each figure of a run folder alone, from the files that lie in it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from matplotlib.figure import Figure

from pydpend.damping import Maps
from pydpend.encoder import read_calibration
from pydpend.errors import PydpendError, Setting, fault, listed
from pydpend.fit_folder import FitFile
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
from pydpend.plots.neighbours import neighbours_figure, web_figure
from pydpend.plots.nodes import nodes_figure
from pydpend.plots.physics import amplitudes_figure, phase_portrait
from pydpend.recording_folder import AGAIN, RunFile
from pydpend.run_folder import StoredRecording, StoredRun, read_run
from pydpend.trials import alone, each_alone


class FigureError(PydpendError):
    """A figure that a run folder has nothing for."""


def _nodes(run: StoredRun, r: StoredRecording) -> Figure:
    nodes = r.nodes()
    return nodes_figure(nodes, r.residual_px(nodes))


def _neighbours(run: StoredRun, r: StoredRecording, frame: int | None) -> Figure:
    return neighbours_figure(r.nodes(), frame)


def _web(run: StoredRun, r: StoredRecording, frame: int | None) -> Figure:
    return web_figure(r.nodes(), frame)


def _ten(run: StoredRun, r: StoredRecording) -> Figure:
    ten = run.fit_folder.fit().ten
    if ten is None:
        raise FigureError(fault("ten", f"the fit of {run.path} was made without the paper's ten", AGAIN))
    return coefficients_figure(each_alone(ten.values))


def _has_ten(run: StoredRun) -> bool:
    return run.fit_folder.fit().ten is not None


def _angles(run: StoredRun, r: StoredRecording) -> Figure:
    return angles_figure(r.angles())


def _phase(run: StoredRun, r: StoredRecording) -> Figure:
    found = r.states()
    return phase_portrait(found, found.link_names)


def _amplitudes(run: StoredRun, r: StoredRecording) -> Figure:
    swing = r.swing()
    if swing is None:
        raise _no_table(r, "turning points")
    return amplitudes_figure(swing)


def _calibration(run: StoredRun, r: StoredRecording) -> Figure:
    return calibration_figure(read_calibration(r.file(RunFile.ENCODER)))


def _comparison(run: StoredRun, r: StoredRecording) -> Figure:
    return comparison_figure(r.comparison())


def _energy(run: StoredRun, r: StoredRecording) -> Figure:
    curve = r.energy()
    if curve is None:
        raise _no_table(r, "energy")
    return energy_figure(curve)


def _residuals(run: StoredRun, r: StoredRecording) -> Figure:
    left = r.residuals()
    if left is None:
        raise _no_table(r, "residuals")
    return residuals_figure(left)


def _no_table(r: StoredRecording, name: str) -> FigureError:
    return FigureError(fault(str(r.run), f"it has no table of {name} of {r.label}", AGAIN))


def _shares(run: StoredRun, r: StoredRecording) -> Figure:
    return shares_figure(run.fit_folder.fit().shares)


def _coefficients(run: StoredRun, r: StoredRecording) -> Figure:
    trials = run.fit_folder.trials()
    return coefficients_figure(alone(run.fit_folder.fit()) if trials is None else trials.spreads)


def _prediction(run: StoredRun, r: StoredRecording) -> Figure:
    found = run.predictions().get(r.name)
    if found is None:
        raise FigureError(fault(str(r.run), f"it has no prediction of {r.label}", AGAIN))
    return windows_figure(found)


def _maps(run: StoredRun, r: StoredRecording) -> Figure:
    maps = run.fit_folder.fit().maps
    if maps is None:
        raise FigureError(fault("maps", f"the fit of {run.path} was made without angle maps", AGAIN))
    return maps_figure(Maps.of(maps))


@dataclass(frozen=True)
class Drawing:
    """A figure: what it shows, how it is drawn, and the file without which there is none.

    ``each``: one for each recording. ``of_frame``: one for each frame too, which `draw` then takes.
    ``has``: whether the file holds what is drawn.
    """

    about: str
    draw: Callable[..., Figure]
    needs: RunFile | FitFile
    each: bool = True
    of_frame: bool = False
    has: Callable[[StoredRun], bool] = lambda _: True


DRAWINGS = {
    "nodes": Drawing(
        "each node over time: seen, missing, reacquired, ambiguous, undecoded; distance to the shape",
        _nodes,
        RunFile.RESIDUALS,
    ),
    "neighbours": Drawing(
        "lists of neighbours of each link's markers, and what is left of them in a frame (Fig. 21)",
        _neighbours,
        RunFile.RESIDUALS,
        of_frame=True,
    ),
    "web": Drawing(
        "vectors between a link's markers in the reference picture and in a frame (Figs. 5b, 13, 14)",
        _web,
        RunFile.RESIDUALS,
        of_frame=True,
    ),
    "angles": Drawing("angles and their standard uncertainties (Fig. 16)", _angles, RunFile.ANGLES),
    "phase": Drawing("phase portrait: rate over angle of each link", _phase, RunFile.STATES),
    "amplitudes": Drawing(
        "amplitude of a single pendulum's free swing at its turning points", _amplitudes, RunFile.SWING
    ),
    "calibration": Drawing(
        "calibration line of the encoder and its residuals (Fig. 10)", _calibration, RunFile.ENCODER
    ),
    "comparison": Drawing("film and encoder, two zooms, residuals (Fig. 15)", _comparison, RunFile.COMPARED),
    "residuals": Drawing("measured minus fitted angles over time", _residuals, FitFile.FIT),
    "energy": Drawing("energy of the motion and the model's, with a zoom (Fig. 19)", _energy, FitFile.FIT),
    "coefficients": Drawing(
        "coefficients with their errors, over the recordings (Fig. 20)",
        _coefficients,
        FitFile.FIT,
        each=False,
    ),
    "ten": Drawing(
        "the paper's ten coefficients with their errors (Fig. 20)",
        _ten,
        FitFile.FIT,
        each=False,
        has=_has_ten,
    ),
    "shares": Drawing("where the energy goes, by law and by joint", _shares, FitFile.FIT, each=False),
    "prediction": Drawing("error of each predicted window over time", _prediction, RunFile.WINDOWS),
    "maps": Drawing("angle-dependent bias of the tracking", _maps, FitFile.MAPS_FIGURE, each=False),
}
"""Every figure of a run folder."""


def chosen(run: StoredRun, recording: str | None) -> StoredRecording:
    """The recording called so (its name or its file's), or the only one.

    Raises FigureError if there is none so called, or several and none is named.
    """
    if not run.recordings:
        raise FigureError(fault(str(run.path), "there is no recording in it", AGAIN))
    names = ", ".join(r.name for r in run.recordings)
    if recording is None:
        if len(run.recordings) > 1:
            raise FigureError(fault(Setting("recording"), f"{run.path} has several", f"Give one of {names}"))
        return run.recordings[0]
    for r in run.recordings:
        if recording in (r.name, r.label):
            return r
    raise FigureError(fault(Setting("recording"), f"{run.path} has no {recording!r}", f"Give one of {names}"))


def available(run: StoredRun, r: StoredRecording) -> list[str]:
    """Names of the figures that there is something for."""
    return [name for name, d in DRAWINGS.items() if _file(run, r, d).exists() and d.has(run)]


def _file(run: StoredRun, r: StoredRecording, d: Drawing) -> Path:
    return run.fit_folder.file(d.needs) if isinstance(d.needs, FitFile) else r.file(d.needs)


def figure_of(
    name: str, run_folder: str | Path, recording: str | None = None, frame: int | None = None
) -> Figure:
    """The figure called ``name`` (one of `DRAWINGS`) of a run folder; ``frame`` for those of one frame.

    Raises FigureError if the folder has nothing for it, RunFileError if it is no run folder or damaged.
    """
    if name not in DRAWINGS:
        raise FigureError(fault(name, "is not a figure", f"Give {listed(DRAWINGS)}"))
    drawing = DRAWINGS[name]
    if recording is not None and not drawing.each:
        raise FigureError(fault(Setting("recording"), f"{name} is of the whole run", "Leave it out"))
    if frame is not None and not drawing.of_frame:
        raise FigureError(fault(Setting("frame"), f"{name} is of the whole recording", "Leave it out"))
    run = read_run(run_folder)
    r = (
        chosen(run, recording)
        if drawing.each
        else chosen(run, run.recordings[0].name if run.recordings else None)
    )
    file = _file(run, r, drawing)
    if not file.exists():
        there = available(run, r)
        raise FigureError(
            fault(
                name,
                f"{run_folder} has nothing for it ({file} is not there)",
                f"It has {', '.join(there)}" if there else "See the warnings in its report.html",
            )
        )
    return drawing.draw(run, r, frame) if drawing.of_frame else drawing.draw(run, r)
