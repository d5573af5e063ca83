"""Every error of pydpend. Each message says what was wrong, where, what was expected and what to do.

A message reads ``subject, place: problem. Advice``, for example
``encoder.csv, line 12, column voltage_v: 'n/a' is not a number. Remove the line or leave the field empty``.
"""

from __future__ import annotations


class PydpendError(Exception):
    """Anything that pydpend refuses or cannot do."""


class TrackerError(PydpendError):
    """The tracker, the part that turns a film into a node table."""


class SourceError(TrackerError):
    """A recording that cannot be opened or read."""


class DetectError(TrackerError):
    """Detection that cannot be done: no markers, a threshold out of range."""


class RigError(TrackerError):
    """A rig that is wrong in itself or does not fit the recording."""


class TableError(TrackerError):
    """A node table that cannot be written, cannot be read or is not valid."""


class FilmError(TrackerError):
    """A film that cannot be made or an overlay that cannot be drawn."""


class ArgumentError(TrackerError, ValueError):
    """An argument of the tracker that makes no sense: an array of the wrong type or shape, a range, a rate."""


class AnglesError(PydpendError):
    """Angles that cannot be had from these nodes, or an angles table that is not one."""


class EncoderError(PydpendError):
    """An encoder file, a calibration or a comparison that makes no sense."""


class ModelError(PydpendError):
    """A pendulum that cannot exist or is not fully described."""


class SimulationError(PydpendError):
    """A simulation that cannot be done or did not reach its tolerance."""


class FitError(PydpendError):
    """A fit that cannot be done on these data or did not converge."""


def fault(subject: str, problem: str, advice: str = "", *, place: str = "") -> str:
    """The text of an error: ``subject, place: problem. Advice``."""
    where = f"{subject}, {place}" if place else subject
    return f"{where}: {problem}. {advice}" if advice else f"{where}: {problem}"
