"""Progress of a run: a user's callback, or a bar on a terminal or in a notebook."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

from pydpend._typing import Progress


class Bar:
    """A bar on a terminal's standard error or in a notebook."""

    def __init__(self) -> None:
        self._stage = ""
        self._bar: Any = None

    def __call__(self, stage: str, done: int, total: int | None) -> None:
        """Shows how many frames of a stage are done, of how many in all if known."""
        from tqdm.auto import tqdm

        if stage != self._stage:
            self.close()
            self._stage = stage
            self._bar = tqdm(total=total, desc=stage, unit=" frames", leave=False)
        self._bar.update(done - self._bar.n)

    def close(self) -> None:
        """Takes the bar away."""
        if self._bar is not None:
            self._bar.close()
            self._bar = None


def callback(
    progress: Progress,
) -> tuple[Callable[[str, int, int | None], object] | None, Callable[[], None]]:
    """The callback to use, and what to call at the end."""
    if callable(progress):
        return progress, lambda: None
    notebook = "ipykernel" in sys.modules
    if progress is True or (progress is None and (notebook or sys.stderr.isatty())):
        bar = Bar()
        return bar, bar.close
    return None, lambda: None
