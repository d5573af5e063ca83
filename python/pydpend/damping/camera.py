"""The cameras' part in a fit: five numbers per camera with their prior, never noise.

The angles have it as columns (`pydpend.kinematics.LinkAngles.camera_rad`), measured = true + columns . numbers, each
number of unit variance before anything was fitted. Recordings of one camera share its numbers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from pydpend.damping.recording import Recording
from pydpend.damping.shooting import CAMERA, Cameras, Solution
from pydpend.damping.uncertainty import covariance
from pydpend.kinematics.table import CAMERA_NUMBERS

Floats = NDArray[np.float64]


def cameras_of(recordings: Sequence[Recording]) -> Cameras | None:
    """The cameras of recordings, those with one and the same together; None where no recording states any.

    Recordings are of one camera if their angles were corrected by the same numbers and the pictures have one size: also
    where none was found, since the same camera aimed by eye is the more cautious reading.
    """
    kinds: list[object] = []
    parts: list[tuple[Floats, int] | None] = []
    for k, r in enumerate(recordings):
        columns = r.angles.camera_rad
        if columns is None or not np.nan_to_num(columns).any():
            parts.append(None)
            continue
        stated = r.angles.meta.get("camera")
        about = stated if isinstance(stated, dict) else {"numbers": k}
        kind = [about.get(key) for key in ("origin", "numbers", "image_px", "pixel_aspect")]
        if kind not in kinds:
            kinds.append(kind)
        parts.append((columns, kinds.index(kind)))
    return Cameras(parts, np.zeros((len(kinds), CAMERA_NUMBERS))) if kinds else None


def without(recordings: Sequence[Recording]) -> list[str]:
    """Notes on recordings from a film whose angles state no camera's part."""
    return [
        f"{r.angles.name}: what the camera does to these angles is not stated, and is not in the standard errors"
        for r in recordings
        if r.angles.camera_rad is None and isinstance(r.angles.meta.get("bodies"), list)
    ]


def of_camera(solution: Solution, total: Floats, *, model_error: bool) -> dict[str, float]:
    """The cameras' part of each unknown's standard error, by its name, in its unit.

    ``total`` (G, G): covariance of the solution's unknowns. Were the cameras known, it would be that of the others
    alone; the difference of the variances is the cameras'.
    """
    rest = np.array([not n.startswith(CAMERA) for n in solution.names])
    if rest.all():
        return {}
    block = np.ix_(rest, rest)
    known = replace(
        solution,
        names=tuple(n for n, r in zip(solution.names, rest, strict=True) if r),
        information=solution.information[block],
        angle_information=solution.angle_information[block],
        jump_information=solution.jump_information[block],
        scores=solution.scores[:, rest],
    )
    less = np.diag(total)[rest] - np.diag(covariance(known, model_error=model_error))
    sigma = np.sqrt(np.maximum(less, 0.0))
    return dict(zip(known.names, sigma.tolist(), strict=True))


Numbers: TypeAlias = tuple[float, ...] | None


def found_numbers(solution: Solution, total: Floats, index: int) -> tuple[Numbers, Numbers]:
    """A fit's estimate of a recording's camera: its numbers and their standard errors, in units of the prior's."""
    cameras = solution.cameras
    part = None if cameras is None else cameras.parts[index]
    if cameras is None or part is None:
        return None, None
    at = [solution.names.index(f"{CAMERA}{n + 1}[{part[1]}]") for n in range(CAMERA_NUMBERS)]
    return tuple(cameras.numbers[part[1]].tolist()), tuple(np.sqrt(np.diag(total)[at]).tolist())


def words(sigma: dict[str, float], of_cameras: dict[str, float]) -> tuple[str, ...]:
    """In a sentence how much of the coefficients' standard errors is the cameras'; empty where none is stated."""
    parts = [
        f"{name} {100 * of_cameras[name] / s:.2g} %"
        for name, s in sigma.items()
        if name in of_cameras and s > 0
    ]
    if not parts:
        return ()
    return (
        f"part of each standard error that is the camera's (squares add up to 100 %): {', '.join(parts)}",
    )
