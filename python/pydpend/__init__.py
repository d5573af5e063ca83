"""High-speed film of a double pendulum in; angles, encoder comparison and joint damping out.

Everything public is listed here. Inside: SI units and radians; angles are counter-clockwise positive, zero
hanging down, unwrapped over turns.
"""

from __future__ import annotations

from pydpend.angles import LinkAngles, read_angles, write_angles
from pydpend.errors import (
    AnglesError,
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

__all__ = [
    "AnglesError",
    "DetectError",
    "EncoderError",
    "FilmError",
    "FitError",
    "LinkAngles",
    "ModelError",
    "PydpendError",
    "RigError",
    "SimulationError",
    "SourceError",
    "TableError",
    "TrackerError",
    "read_angles",
    "write_angles",
]
