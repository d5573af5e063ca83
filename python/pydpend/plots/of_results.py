"""The figure of a result, whichever it is: `pydpend.plot`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from matplotlib.figure import Figure

from pydpend.damping import DampingFit, Prediction
from pydpend.encoder import Calibration, Comparison
from pydpend.errors import WrongTypeError, fault, listed
from pydpend.free_swing import RingDown
from pydpend.kinematics import LinkAngles
from pydpend.link_states import LinkStates
from pydpend.nodes import Nodes
from pydpend.plots.angles import angles_figure
from pydpend.plots.damping import coefficients_figure, energy_figure, shares_figure, windows_figure
from pydpend.plots.encoder import calibration_figure, comparison_figure
from pydpend.plots.neighbours import web_figure
from pydpend.plots.physics import amplitudes_figure, phase_portrait
from pydpend.trials import Trials


def _of_fit(fit: DampingFit) -> Figure:
    return energy_figure(fit.energy[0]) if fit.energy else shares_figure(fit.shares)


_FIGURES: dict[type, Callable[[Any], Figure]] = {
    Nodes: web_figure,
    LinkAngles: angles_figure,
    LinkStates: lambda states: phase_portrait(states, states.link_names),
    RingDown: amplitudes_figure,
    Calibration: calibration_figure,
    Comparison: comparison_figure,
    DampingFit: _of_fit,
    Trials: lambda trials: coefficients_figure(trials.spreads),
    Prediction: windows_figure,
}


def plot(result: Any) -> Figure:
    """The figure of a result, as a notebook shows it or ``savefig`` writes it.

    Parameters
    ----------
    result : Nodes, LinkAngles, LinkStates, RingDown, Calibration, Comparison, DampingFit, Prediction or Trials
        What is to be seen: of nodes the web of vectors in a frame (Figs. 5b, 13, 14), of angles their course and
        uncertainty (Fig. 16), of states the phase portrait, of a free swing its amplitudes, of a calibration its line
        (Fig. 10), of a comparison both curves and their difference (Fig. 15), of a fit the energy (Fig. 19), of trials
        each coefficient (Fig. 20), of a prediction the error of each window.

    Returns
    -------
    matplotlib.figure.Figure
        The figure, which pyplot does not know of; in a notebook ``%matplotlib inline`` shows it.

    Raises
    ------
    WrongTypeError
        For anything else.
    """
    for kind, figure in _FIGURES.items():
        if isinstance(result, kind):
            return figure(result)
    raise WrongTypeError(
        fault(
            "result",
            f"there is no figure of a {type(result).__name__}",
            f"Give {listed(kind.__name__ for kind in _FIGURES)}",
        )
    )
