"""High-speed film of a double pendulum in; angles, encoder comparison and joint damping out.

Everything public is listed here. Inside: SI units and radians; angles are counter-clockwise positive, zero
hanging down, unwrapped over turns.
"""

from __future__ import annotations

from pydpend import _native
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
    RecordingWarning,
    RigError,
    SimulationError,
    SourceError,
    TableError,
    TrackerError,
    WrongTypeError,
)
from pydpend.exporting import export
from pydpend.filming import Film, Truth, film
from pydpend.fit_options import FitOptions
from pydpend.kinematics import Linkage, LinkAngles, angles, find_linkage, find_rest, read_angles, write_angles
from pydpend.linear import lyapunov, modes, poincare
from pydpend.link_states import LinkStates, savitzky_golay, states
from pydpend.live import NodeRow, Tracker, detect
from pydpend.model import Damping, Model, derived, published, read_model
from pydpend.nodes import Nodes, Rig, read_nodes
from pydpend.scoring import Score, score
from pydpend.simulation import Simulation, simulate, simulate_many
from pydpend.tracking import OverlayFilm, Setup, info, overlay, setup, track
from pydpend.tracks import read_tracks

__version__: str = _native.VERSION

__all__ = [
    "AnglesError",
    "ArgumentError",
    "Calibration",
    "Comparison",
    "Damping",
    "DampingFit",
    "DetectError",
    "EncoderError",
    "EncoderSignal",
    "Film",
    "FilmError",
    "FitError",
    "FitOptions",
    "LinkAngles",
    "LinkStates",
    "Linkage",
    "Model",
    "ModelError",
    "NodeRow",
    "Nodes",
    "OverlayFilm",
    "Prediction",
    "PydpendError",
    "RecordingWarning",
    "Rig",
    "RigError",
    "Score",
    "Setup",
    "Simulation",
    "SimulationError",
    "SourceError",
    "Synchronisation",
    "TableError",
    "Tracker",
    "TrackerError",
    "Truth",
    "WrongTypeError",
    "angles",
    "calibrate",
    "compare",
    "derived",
    "detect",
    "encoder_angles",
    "export",
    "film",
    "find_linkage",
    "find_rest",
    "fit_damping",
    "info",
    "lyapunov",
    "modes",
    "overlay",
    "poincare",
    "published",
    "read_angles",
    "read_calibration",
    "read_encoder",
    "read_holds",
    "read_model",
    "read_nodes",
    "read_tracks",
    "savitzky_golay",
    "score",
    "setup",
    "simulate",
    "simulate_many",
    "states",
    "synchronise",
    "track",
    "write_angles",
]
