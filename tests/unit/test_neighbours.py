"""The lists of neighbours and the webs of vectors of one frame."""

from __future__ import annotations

import math

import numpy as np
import pydpend as dp
import pytest
from matplotlib.figure import Figure
from pydpend.errors import PydpendError
from pydpend.plots.neighbours import index_of, neighbour_lists, neighbours_figure, web_figure

PLACES = np.array([[0.0, 0.0], [10.0, 0.0], [0.0, 25.0], [40.0, 0.0]])
"""Distances from the first: 10, 25, 40."""


@pytest.fixture
def nodes() -> dp.Nodes:
    """Two frames of one link: at rest, then turned by 30 degrees counter-clockwise with its third marker hidden."""
    angle = math.radians(-30)  # y points down
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    xy = np.stack([PLACES, PLACES @ turn.T])
    xy[1, 2] = np.nan
    return dp.Nodes.from_arrays(np.array([0.0, 0.1]), xy, bodies=("link",) * 4)


def texts(figure: Figure) -> list[list[str]]:
    """What is written in each of a figure's parts."""
    return [[text.get_text() for text in axes.texts] for axes in figure.axes]


def test_a_column_is_a_marker_and_its_nearest_stands_on_top() -> None:
    assert neighbour_lists(PLACES).T.tolist() == [[1, 2, 3], [0, 2, 3], [0, 1, 3], [1, 0, 2]]


def test_the_frame_is_one_with_a_gap_or_the_one_that_is_named(nodes: dp.Nodes) -> None:
    assert [index_of(nodes, frame) for frame in (None, 0, 1)] == [1, 0, 1]
    with pytest.raises(PydpendError, match=r"frame: the table has no frame 2. Give one of 0 to 1"):
        neighbours_figure(nodes, 2)


def test_what_is_not_seen_is_none_in_all_lists(nodes: dp.Nodes) -> None:
    _, reference, now = texts(neighbours_figure(nodes))
    names = [node.name for node in nodes.rig.nodes]
    a, b, c, d = names
    assert reference == [a, b, c, d, b, a, c, d, c, a, b, d, d, b, a, c]
    assert now.count("None") == 3
    assert now.count(c) == 1
    everything = texts(neighbours_figure(nodes, 0))
    assert everything[1] == everything[2]


def test_the_turn_of_the_longest_vector_is_told(nodes: dp.Nodes) -> None:
    title = web_figure(nodes, 1).axes[1].get_title(loc="left")
    a, _, _, d = (node.name for node in nodes.rig.nodes)
    assert title == f"frame 1\nlink: {a}{d} turned by +30.00°"
    lengths = [text for text in texts(web_figure(nodes, 1))[0] if text.isdigit()]
    assert sorted(map(int, lengths)) == [10, 25, 27, 30, 40, 47]
