"""`dp.plot`: a figure for each kind of result."""

from __future__ import annotations

import numpy as np
import pydpend as dp
import pytest
from matplotlib.figure import Figure


def swinging() -> dp.LinkAngles:
    t_s = np.arange(4000) / 400
    phi = 0.5 * np.exp(-0.05 * t_s) * np.cos(6.0 * t_s)
    return dp.LinkAngles(t_s, phi[:, None], np.full((4000, 1), 1e-3))


def test_results_have_their_figures() -> None:
    angles = swinging()
    nodes = dp.Nodes.from_arrays(
        angles.t_s, np.stack([[[0.0, 0.0], [30.0, 0.0]]] * angles.t_s.size), bodies=("link",) * 2
    )
    drawn = {
        "angle": dp.plot(angles),
        "rate": dp.plot(dp.states(angles)),
        "amplitude": dp.plot(dp.ring_down(angles)),
        "x (px)": dp.plot(nodes),
    }
    for words, figure in drawn.items():
        assert isinstance(figure, Figure)
        labels = [axes.get_xlabel() + axes.get_ylabel() + axes.get_title() for axes in figure.axes]
        assert any(words in label for label in labels), (words, labels)


def test_what_has_no_figure_is_said() -> None:
    with pytest.raises(dp.WrongTypeError, match=r"there is no figure of a Damping\. Give Nodes, LinkAngles"):
        dp.plot(dp.Damping())
