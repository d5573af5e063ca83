"""Effect of the film's camera on a comparison with an encoder: five numbers with their prior, never noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pydpend.kinematics.table import LinkAngles

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class CameraInComparison:
    """The camera's part of ``video = offset + gain * encoder``.

    Attributes
    ----------
    covariance : ndarray of float, shape (2, 2)
        What it adds to the covariance of offset (rad) and gain.
    share : float
        Part of the residual's variance that the camera explains, with numbers as likely as residual and prior make
        them.
    """

    covariance: Floats
    share: float


def camera_in(
    video: LinkAngles, link: int, t_s: Floats, line_rad: Floats, residual_rad: Floats, noise_rad: float
) -> CameraInComparison | None:
    """The camera's part at the encoder's readings, video time ``t_s`` (n,); None where the angles state none.

    A line through the columns of the camera's part over the angle is what they do to offset and gain; what a line
    leaves of them is looked for in the residual, whose noise is ``noise_rad`` a reading. ``line_rad`` (n,): the angle
    in units of the encoder's, without the encoder's noise, which would be taken for a trace of the camera.
    """
    if video.camera_rad is None:
        return None
    seen = video.seen[:, link]
    columns = np.stack(
        [np.interp(t_s, video.t_s[seen], column) for column in video.camera_rad[seen, link].T], axis=1
    )
    design = np.stack([np.ones_like(line_rad), line_rad], axis=1)
    onto, *_ = np.linalg.lstsq(design, columns, rcond=None)
    left = columns - design @ onto
    variance = float((residual_rad**2).mean())
    share = 0.0
    if noise_rad > 0 and variance > 0:
        normal = np.eye(left.shape[1]) + left.T @ left / noise_rad**2
        numbers = np.linalg.solve(normal, left.T @ residual_rad / noise_rad**2)
        share = 1.0 - float(((residual_rad - left @ numbers) ** 2).mean()) / variance
    return CameraInComparison(onto @ onto.T, share)
