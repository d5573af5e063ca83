"""Which files lie in a run folder, by which stage, and what each is."""

from __future__ import annotations

import re

ABOUT = {
    "nodes.parquet": "node table: where each marker is in each frame",
    "residuals.parquet": "distance of each marker from where its rigid body puts it, px",
    "markers.json": "each marker summed up: seen, gaps, residual",
    "angles.parquet": "angles of the links and their standard uncertainties, rad",
    "angles.json": "how the angles were had: bodies, joints, scale, zero",
    "zero.parquet": "node table of the film that hangs still",
    "zero_rig.toml": "the rig it was tracked with",
    "encoder.json": "calibration of the encoder",
    "calibration.svg": "calibration line and its residuals (Fig. 10)",
    "comparison.json": "film against encoder, numbers",
    "comparison.parquet": "film and encoder at the encoder's times, rad",
    "comparison.png": "film against encoder (Fig. 15)",
    "overlay.mp4": "the film with nodes, names and bodies drawn in",
    "overlay.json": "times of its frames in the recording",
    "fit.json": "damping coefficients, uncertainties, shares, identifiability",
    "model.json": "constants of the model that the fit began from, with their standard uncertainties, SI",
    "coefficients.csv": "the coefficients as a table",
    "shares.png": "where the energy goes",
    "trials.json": "the coefficients of each recording and their mean",
    "trials.png": "the same, drawn (Fig. 20)",
    "maps.png": "angle-dependent bias of the tracking",
    "windows.csv": "error of each predicted window, degrees",
    "prediction.json": "each recording predicted from the others",
}


def about(name: str) -> str:
    """What a file of a run folder is."""
    last = name.rsplit("/", 1)[-1]
    if last.startswith("energy"):
        return "energy of the motion and what each law takes out" + (
            " (Fig. 19)" if last.endswith(".png") else ", J"
        )
    if last.startswith("residuals") and last.endswith(".csv"):
        return "measured minus fitted angle of each link, and its standard deviation, rad"
    return ABOUT.get(last, "")


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
