"""The files of a run folder: what each is, and the stage that wrote it."""

from __future__ import annotations

import re

from pydpend.fit_folder import about_fit
from pydpend.recording_folder import RunFile
from pydpend.run_folder import PREDICTION


def about(name: str) -> str:
    """The description of a file of a run folder."""
    last = name.rsplit("/", 1)[-1]
    if last == PREDICTION:
        return "each recording predicted from the others"
    return RunFile(last).words if last in list(RunFile) else about_fit(last)


_PART = re.compile(r"[A-Za-z0-9_-][A-Za-z0-9._-]*")


def made_by(stage: str, name: str) -> bool:
    """Whether a stage of a run may have made the file ``name``, a path relative to the run folder.

    It is then a file of the run folder or of one folder in it, and one that pydpend makes: never a user's.
    """
    folder, _, file = name.rpartition("/")
    if not about(file) or not _PART.fullmatch(file) or (folder and not _PART.fullmatch(folder)):
        return False
    of_stage = stage.partition("/")[0]
    return of_stage == "prediction" or folder == of_stage
