"""The states of a run and of its stages, and the progress that is told of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

from pydpend.errors import PydpendError
from pydpend.worded import Words


class DoesNotApply(PydpendError):
    """A stage that has no meaning for these recordings; nothing is wrong with them."""


class StageState(Words):
    """The states in which a stage can end."""

    DONE = "done", "done"
    KEPT = "kept", "kept"
    """Its results are there from an earlier run of the same."""
    NOT_DONE = "not_done", "not done"
    """The data do not allow the stage."""
    DOES_NOT_APPLY = "does_not_apply", "does not apply"
    """The stage has no meaning for these recordings; nothing is wrong with them."""

    @property
    def has_results(self) -> bool:
        """Whether the stage's files are there."""
        return self in (StageState.DONE, StageState.KEPT)


class RunState(Words):
    """The states in which a run can end."""

    DONE = "done", "done"
    PARTLY = "partly", "partly done"
    """A stage could not be done, or the fit did not converge."""


@dataclass(frozen=True)
class StageResult:
    """The state of a stage, and the reason where it gave nothing."""

    state: StageState
    why: str = ""

    def __str__(self) -> str:
        """In words."""
        return f"{self.state.words}: {self.why}" if self.why else self.state.words


@dataclass(frozen=True)
class Started:
    """A stage begins."""


@dataclass(frozen=True)
class Going:
    """The progress of a stage: what it does, and its part from 0 to 1 where that is known."""

    what: str
    share: float | None = None

    def __str__(self) -> str:
        """In words."""
        return self.what if self.share is None else f"{self.what} {100 * self.share:.0f} %"


@dataclass(frozen=True)
class Note:
    """Something that should be known of what a stage does."""

    text: str


Event: TypeAlias = Started | Going | Note | StageResult
"""Words for a stage's state."""

Progress: TypeAlias = Callable[[int, int, str, Event], None]
"""Called as ``progress(stage's number from 1, number of stages, title, event)``."""

Tell: TypeAlias = Callable[[Going | Note], None]
"""Called by a stage with how far it is."""
