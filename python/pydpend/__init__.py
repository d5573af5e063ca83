"""High-speed film of a double pendulum in; angles, encoder comparison and joint damping out.

Everything public is listed here. Inside: SI units and radians; angles are counter-clockwise positive, zero
hanging down, unwrapped over turns.
"""

from __future__ import annotations

from pydpend.angles import Linkage, LinkAngles, angles, find_linkage, find_rest, read_angles, write_angles
from pydpend.damping import DampingFit, Prediction, fit_damping
from pydpend.encoder import (
    Calibration,
    Comparison,
    EncoderSignal,
    Synchronisation,
    calibrate,
    compare,
    encoder_angles,
    read_calibration,
    read_encoder,
    read_holds,
    synchronise,
)
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
from pydpend.export import export
from pydpend.filming import Film, Truth, film
from pydpend.nodes import Nodes, Rig, read_nodes
from pydpend.scoring import Score, score
from pydpend.tracking import NodeRow, Tracker, detect, info, setup, track

__all__ = [
    "AnglesError",
    "ArgumentError",
    "Calibration",
    "Comparison",
    "DampingFit",
    "DetectError",
    "EncoderError",
    "EncoderSignal",
    "Film",
    "FilmError",
    "FitError",
    "LinkAngles",
    "Linkage",
    "ModelError",
    "NodeRow",
    "Nodes",
    "Prediction",
    "PydpendError",
    "Rig",
    "RigError",
    "Score",
    "SimulationError",
    "SourceError",
    "Synchronisation",
    "TableError",
    "Tracker",
    "TrackerError",
    "Truth",
    "angles",
    "calibrate",
    "compare",
    "detect",
    "encoder_angles",
    "export",
    "film",
    "find_linkage",
    "find_rest",
    "fit_damping",
    "info",
    "read_angles",
    "read_calibration",
    "read_encoder",
    "read_holds",
    "read_nodes",
    "score",
    "setup",
    "synchronise",
    "track",
    "write_angles",
]
