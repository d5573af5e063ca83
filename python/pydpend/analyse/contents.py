"""Which files lie in a run folder, by which stage, and what each is."""

from __future__ import annotations

import re

from pydpend.run_folder import RunFile


def about(name: str) -> str:
    """What a file of a run folder is."""
    last = name.rsplit("/", 1)[-1]
    if last.startswith("energy"):
        return "energy of the motion and what each law takes out" + (
            " (Fig. 19)" if last.endswith(".png") else ", J"
        )
    if last.startswith("residuals") and last.endswith(".csv"):
        return "measured minus fitted angle of each link, and its standard deviation, rad"
    return RunFile(last).words if last in list(RunFile) else ""


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
