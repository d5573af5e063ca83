"""High-speed film of a double pendulum in; angles, encoder comparison and joint damping out.

Everything public is listed here. Inside: SI units and radians; angles are counter-clockwise positive, zero
hanging down, unwrapped over turns.
"""

from __future__ import annotations

from pydpend.angles import LinkAngles, read_angles, write_angles
from pydpend.damping import DampingFit, Prediction, fit_damping
from pydpend.errors import (
    AnglesError,
    ArgumentError,
    DetectError,
    EncoderError,
    FilmError,
    FitError,
    ModelError,
    PydpendError,
    RigError,
    SimulationError,
    SourceError,
    TableError,
    TrackerError,
)
from pydpend.nodes import Nodes, Rig, read_nodes

__all__ = [
    "AnglesError",
    "ArgumentError",
    "DampingFit",
    "DetectError",
    "EncoderError",
    "FilmError",
    "FitError",
    "LinkAngles",
    "ModelError",
    "Nodes",
    "Prediction",
    "PydpendError",
    "Rig",
    "RigError",
    "SimulationError",
    "SourceError",
    "TableError",
    "TrackerError",
    "fit_damping",
    "read_angles",
    "read_nodes",
    "write_angles",
]
