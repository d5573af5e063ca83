"""Angles of the links: the table every later stage starts from, and the ways from nodes to it.

``table``, ``names``, ``files``: the result, its columns and its file forms. ``structure``, ``ground``: what hangs on
what.
``markers``: image to world. ``pose``, ``linkage``, ``pairwise``: the estimators. ``body_view``, ``camera``,
``camera_slopes``: what the camera does to the angles. ``unwrap``: turns. ``zero``, ``swing``, ``vertical``: rests,
where the motion says that the links hang, where the picture does; ``rests``, ``hanging``: which of them is the zero.
``estimate``: the one body that calls them. ``rig_search``: bodies and joints of tracks without any, by
``constant_distances`` and ``shared_points``.
"""

from __future__ import annotations

from pydpend.kinematics.estimate import angles, find_linkage
from pydpend.kinematics.files import read_angles, write_angles, written_files
from pydpend.kinematics.hanging import parse_zero, roll_sigma
from pydpend.kinematics.linkage import Linkage
from pydpend.kinematics.misfit import misfits
from pydpend.kinematics.names import LinkJoint
from pydpend.kinematics.pairwise import PairAngles, pair_angles
from pydpend.kinematics.point_places import Places, places
from pydpend.kinematics.pose import Pose, fit_pose
from pydpend.kinematics.rig_search import find_rig
from pydpend.kinematics.shape import Shape
from pydpend.kinematics.structure import Structure
from pydpend.kinematics.swing import Swing, find_swing
from pydpend.kinematics.table import LinkAngles
from pydpend.kinematics.zero import Rest, find_rest

__all__ = [
    "LinkAngles",
    "LinkJoint",
    "Linkage",
    "PairAngles",
    "Places",
    "Pose",
    "Rest",
    "Shape",
    "Structure",
    "Swing",
    "angles",
    "find_linkage",
    "find_rest",
    "find_rig",
    "find_swing",
    "fit_pose",
    "misfits",
    "pair_angles",
    "parse_zero",
    "places",
    "read_angles",
    "roll_sigma",
    "write_angles",
    "written_files",
]
