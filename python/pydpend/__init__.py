"""High-speed film of a double pendulum in; angles, encoder comparison and joint damping out.

Everything public is listed here. Inside: SI units and radians; angles are counter-clockwise positive, zero
hanging down, unwrapped over turns.
"""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pydpend.batching import Batch, BatchError, BatchOptions, batch
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
    from pydpend.free_swing import RingDown, ring_down
    from pydpend.kinematics import (
        Linkage,
        LinkAngles,
        Places,
        angles,
        find_linkage,
        find_rest,
        find_rig,
        places,
        read_angles,
        write_angles,
    )
    from pydpend.linear import lyapunov, modes, poincare
    from pydpend.link_states import LinkStates, PointStates, point_states, savitzky_golay, states
    from pydpend.live import NodeRow, Tracker, detect
    from pydpend.model import Damping, Model, derived, published, read_model
    from pydpend.nodes import Nodes, Rig, read_nodes
    from pydpend.page.opening import edit
    from pydpend.plots.of_results import plot
    from pydpend.scoring import Score, score
    from pydpend.simulation import Simulation, simulate, simulate_many
    from pydpend.tracking import OverlayFilm, Setup, info, overlay, setup, track
    from pydpend.tracks import read_tracks

    __version__: str

__all__ = [
    "AnglesError",
    "ArgumentError",
    "Batch",
    "BatchError",
    "BatchOptions",
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
    "Places",
    "PointStates",
    "Prediction",
    "PydpendError",
    "RecordingWarning",
    "Rig",
    "RigError",
    "RingDown",
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
    "batch",
    "calibrate",
    "compare",
    "derived",
    "detect",
    "edit",
    "encoder_angles",
    "export",
    "film",
    "find_linkage",
    "find_rest",
    "find_rig",
    "fit_damping",
    "info",
    "lyapunov",
    "modes",
    "overlay",
    "places",
    "plot",
    "poincare",
    "point_states",
    "published",
    "read_angles",
    "read_calibration",
    "read_encoder",
    "read_holds",
    "read_model",
    "read_nodes",
    "read_tracks",
    "ring_down",
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

_HOMES = {
    "batching": ("Batch", "BatchError", "BatchOptions", "batch"),
    "damping": ("DampingFit", "Prediction", "fit_damping"),
    "encoder": (
        "Calibration",
        "Comparison",
        "EncoderSignal",
        "Synchronisation",
        "calibrate",
        "compare",
        "encoder_angles",
        "read_calibration",
        "read_encoder",
        "read_holds",
        "synchronise",
    ),
    "errors": (
        "AnglesError",
        "ArgumentError",
        "DetectError",
        "EncoderError",
        "FilmError",
        "FitError",
        "ModelError",
        "PydpendError",
        "RecordingWarning",
        "RigError",
        "SimulationError",
        "SourceError",
        "TableError",
        "TrackerError",
        "WrongTypeError",
    ),
    "exporting": ("export",),
    "filming": ("Film", "Truth", "film"),
    "fit_options": ("FitOptions",),
    "kinematics": (
        "LinkAngles",
        "Linkage",
        "Places",
        "angles",
        "find_linkage",
        "find_rest",
        "find_rig",
        "places",
        "read_angles",
        "write_angles",
    ),
    "linear": ("lyapunov", "modes", "poincare"),
    "link_states": ("LinkStates", "PointStates", "point_states", "savitzky_golay", "states"),
    "live": ("NodeRow", "Tracker", "detect"),
    "model": ("Damping", "Model", "derived", "published", "read_model"),
    "nodes": ("Nodes", "Rig", "read_nodes"),
    "page.opening": ("edit",),
    "free_swing": ("RingDown", "ring_down"),
    "plots.of_results": ("plot",),
    "scoring": ("Score", "score"),
    "simulation": ("Simulation", "simulate", "simulate_many"),
    "tracking": ("OverlayFilm", "Setup", "info", "overlay", "setup", "track"),
    "tracks": ("read_tracks",),
}
"""The module of each public name, loaded when the name is first used: whoever needs none of them starts at once."""


if not TYPE_CHECKING:
    # A type checker would take any name for one of the package's.
    def __getattr__(name: str) -> Any:
        """A public name or a module of the package, loaded when it is first used (PEP 562)."""
        if name == "__version__":
            found = import_module("pydpend._native").VERSION
        elif name in __all__:
            home = next(module for module, names in _HOMES.items() if name in names)
            found = getattr(import_module(f"pydpend.{home}"), name)
        elif not name.startswith("_") and find_spec(f"pydpend.{name}") is not None:
            found = import_module(f"pydpend.{name}")
        else:
            raise AttributeError(f"module 'pydpend' has no attribute {name!r}")
        globals()[name] = found
        return found


def __dir__() -> list[str]:
    """The public names, loaded or not, and what else is there."""
    return sorted({*globals(), *__all__, "__version__"})
