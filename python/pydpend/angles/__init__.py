"""Angles of the links: the table every later stage starts from, and the ways from nodes to it.

``table``, ``files``: the result and its file forms. ``markers``: image to world. ``pose``, ``linkage``,
``pairwise``: the estimators. ``unwrap``: turns. ``zero``, ``swing``, ``vertical``: rests, where the motion says that
the links hang, where the picture does; ``rests``, ``hanging``: which of them is the zero. ``estimate``: the one body
that calls them.
"""

from __future__ import annotations

from pydpend.angles.estimate import angles, find_linkage
from pydpend.angles.files import read_angles, write_angles, written_files
from pydpend.angles.hanging import parse_zero, roll_sigma
from pydpend.angles.linkage import Linkage, Shape
from pydpend.angles.misfit import misfits
from pydpend.angles.pairwise import PairAngles, pair_angles
from pydpend.angles.pose import Pose, fit_pose
from pydpend.angles.swing import Swing, find_swing
from pydpend.angles.table import LinkAngles
from pydpend.angles.zero import Rest, find_rest

__all__ = [
    "LinkAngles",
    "Linkage",
    "PairAngles",
    "Pose",
    "Rest",
    "Shape",
    "Swing",
    "angles",
    "find_linkage",
    "find_rest",
    "find_swing",
    "fit_pose",
    "misfits",
    "pair_angles",
    "parse_zero",
    "read_angles",
    "roll_sigma",
    "write_angles",
    "written_files",
]
