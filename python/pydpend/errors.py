"""Every error of pydpend. Each message says what was wrong, where, what was expected and what to do.

A message reads ``subject, place: problem. Advice``, for example
``encoder.csv, line 12, column voltage_v: 'n/a' is not a number. Remove the line or leave the field empty``.

The library speaks of settings and steps (`Setting`, `Step`), never of flags:
``"Leave out " + Setting("pinned", True)``. Whoever shows a message to a person writes them (`FrontEnd`): as keywords
and functions of Python by default, as flags and commands in the program ``pydpend``.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, replace
from typing import Protocol, TypeAlias

from pydpend.terminal import shortened, shown


class _Part:
    """Something that may stand in a message: a sum of parts and texts is a message."""

    def _as_message(self) -> Message:
        raise NotImplementedError

    def __add__(self, more: Text) -> Message:
        return Message((*self._as_message().parts, *Message.of(more).parts))

    def __radd__(self, before: str) -> Message:
        return Message((before, *self._as_message().parts))


@dataclass(frozen=True)
class Setting(_Part):
    """A keyword argument that a message names, and its value if one is meant: ``Setting("method", "energy")``.

    ``subject``: the message is about it, and begins with it.
    """

    name: str
    value: str | bool | float | None = None
    subject: bool = False

    def _as_message(self) -> Message:
        return Message((self,))

    def __str__(self) -> str:
        return front_end().setting(self)


@dataclass(frozen=True)
class Step(_Part):
    """Something to do with another part of pydpend: what to type, and what to write in Python."""

    command: str
    call: str

    def _as_message(self) -> Message:
        return Message((self,))

    def __str__(self) -> str:
        return front_end().step(self)


@dataclass(frozen=True)
class Message(_Part):
    """A text that names settings and steps as data. ``str`` is the text as the front end says it."""

    parts: tuple[str | Setting | Step, ...] = ()

    @staticmethod
    def of(text: Text) -> Message:
        """A message of one part, or the message itself."""
        return text if isinstance(text, Message) else Message((text,))

    def _as_message(self) -> Message:
        return self

    def __str__(self) -> str:
        return "".join(str(part) for part in self.parts)

    def __bool__(self) -> bool:
        return any(part != "" for part in self.parts)


Text: TypeAlias = "str | Message | Setting | Step"
"""Parts of a message."""


CHECK = Step("pydpend check", "nodes.status")
"""Sums up what became of each node."""
SETUP = Step("pydpend setup", "dp.setup")
"""Finds markers, bodies, joints and camera."""
SELECT = Step("pydpend angles --bodies A,B", "dp.LinkAngles.select")
"""Takes some links of many."""
CALIBRATE = Step("pydpend calibrate", "dp.calibrate")
"""Makes the encoder's calibration."""
ANALYSE = Step("pydpend analyse", "pydpend.analyse.analyse")
"""Does everything from films to a report."""
IMPORT = Step("pydpend import {file} -o {out}", "dp.read_tracks({name})")
"""Makes nodes of another program's tracks; its names are to be filled in."""
FIT = Step("pydpend fit", "dp.fit_damping")
"""Fits the damping."""
PREDICT = Step("pydpend predict", "pydpend.damping.predict")
"""Predicts a recording from a fit of others."""
COMPARE = Step("pydpend compare", "dp.compare")
"""Compares a film's angles with an encoder's."""
FILM_TRUTH = Step("pydpend film --truth", "dp.film(truth=...)")
"""Writes the truth of a film that is made."""


class FrontEnd(Protocol):
    """The form in which settings and steps are written for whoever reads them."""

    def setting(self, setting: Setting) -> str:
        """``--method energy``, ``method='energy'``."""

    def step(self, step: Step) -> str:
        """The command to type, or the call."""


class _Python:
    """The keywords and functions of the package ``pydpend``, imported as ``dp``."""

    def setting(self, setting: Setting) -> str:
        if setting.value is None:
            return setting.name if setting.subject else f"{setting.name}=..."
        return f"{setting.name}={setting.value!r}"

    def step(self, step: Step) -> str:
        return step.call


PYTHON = _Python()
"""Whoever calls the package from Python."""

_FRONT_END: ContextVar[FrontEnd] = ContextVar("front_end")


def front_end() -> FrontEnd:
    """The front end whose user reads messages now; Python's unless another one `speaking` says so."""
    return _FRONT_END.get(PYTHON)


@contextmanager
def speaking(front: FrontEnd) -> Iterator[None]:
    """Messages are written for the user of ``front`` meanwhile."""
    before = _FRONT_END.set(front)
    try:
        yield
    finally:
        _FRONT_END.reset(before)


def listed(words: Iterable[str], last: str = "or") -> str:
    """``a, b or c``."""
    given = list(words)
    return given[0] if len(given) == 1 else f"{', '.join(given[:-1])} {last} {given[-1]}"


class PydpendError(Exception):
    """Anything that pydpend refuses or cannot do.

    Attributes
    ----------
    message : pydpend.errors.Message
        What it says, with settings as data.
    """

    def __init__(self, message: Text = "") -> None:
        self.message = Message.of(message)
        super().__init__(self.message)

    def __str__(self) -> str:
        """The message on one line; what it quotes of names and files does nothing to a terminal."""
        return shortened(shown(str(self.message)))


class TrackerError(PydpendError):
    """The tracker, the part that turns a film into a node table.

    Attributes
    ----------
    kind : str
        ``invalid``, ``damaged``, ``unsupported``, ``setting``, ``nothing_found``, ``missing``, ``exists`` or
        ``system``.
    """

    kind: str = "invalid"


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

    kind = "setting"


class WrongTypeError(PydpendError, TypeError):
    """An argument of another type than the function takes, as a path in place of what is read from it."""


class RecordingWarning(UserWarning):
    """A recording that is damaged or ended early, so that something is missing, or that contradicts its given zero."""


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


class OptionError(PydpendError, ValueError):
    """An option that is not known, makes no sense, or is of another method than the one chosen."""


class FitOptionError(FitError, OptionError):
    """An option of a damping fit that is not known, makes no sense, or is of the other method."""


def fault(subject: Text, problem: Text, advice: Text = "", *, place: str = "") -> Message:
    """The message of an error: ``subject, place: problem. Advice``."""
    if isinstance(subject, Setting):
        subject = replace(subject, subject=True)
    said = Message.of(subject) + (f", {place}: " if place else ": ") + problem
    return said + ". " + advice if Message.of(advice) else said


def one_of(setting: str, value: object, known: Iterable[str]) -> Message:
    """The message for a setting whose value is none of those known."""
    return fault(Setting(setting), f"{value!r} is not known", f"Give {listed(known)}")
