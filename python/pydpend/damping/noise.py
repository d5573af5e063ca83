"""The noise of measured angles, estimated from the angles themselves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

# Local cubic over nine points: weight of the centre, and so the residual's share of the noise (1 - h).
_HALF = 4
_U = np.arange(-_HALF, _HALF + 1)
_DESIGN = np.vander(_U, 4, increasing=True).astype(np.float64)
_CENTRE = np.linalg.pinv(_DESIGN)[0]

AGREE = 1.25
"""A stated uncertainty within this factor of the measured noise is believed, sample by sample."""


@dataclass(frozen=True, eq=False)
class Noise:
    """Standard deviations used in a fit."""

    sigma_rad: Floats
    """(T, 2), NaN where not seen."""
    measured_rad: tuple[float, float]
    """High-pass noise of each link: RMS residual of a local cubic over nine samples, corrected."""
    source: tuple[str, str]
    """``stated`` or ``measured``, per link."""


def high_pass(phi_rad: Floats) -> float:
    """Standard deviation of the noise of one link's evenly timed angles (T,), NaN where not seen.

    The residual of the centre of a local cubic over nine samples, divided by sqrt(1 - h); outliers beyond six
    times the median are cut. NaN with fewer than 20 complete windows.
    """
    if phi_rad.size < 2 * _HALF + 1:
        return float("nan")
    windows = np.lib.stride_tricks.sliding_window_view(phi_rad, 2 * _HALF + 1)
    residual = windows[:, _HALF] - windows @ _CENTRE
    residual = residual[np.isfinite(residual)]
    if residual.size < 20:
        return float("nan")
    limit = 6 * 1.4826 * np.median(np.abs(residual))
    if limit > 0:
        residual = residual[np.abs(residual) <= limit]
    return float(np.sqrt(np.mean(residual**2) / (1 - _CENTRE[_HALF])))


def noise(t_s: Floats, phi_rad: Floats, sigma_rad: Floats, span: tuple[float, float]) -> Noise:
    """Weights of a recording's angles (T, 2), as standard deviations, rad.

    The stated sigmas where they agree with the measured noise of the moving part, else the measured noise, one number
    per link.

    A pair scatter (the paper's Eq. 32) is two to three times the noise and near zero in some samples:
    weighting by it would let those samples rule the fit.
    """
    moving = (t_s >= span[0]) & (t_s <= span[1])
    out = np.full_like(phi_rad, np.nan)
    measured, source = [], []
    for j in range(phi_rad.shape[1]):
        seen = np.isfinite(phi_rad[:, j])
        level = high_pass(phi_rad[moving, j])
        stated = sigma_rad[moving & seen, j]
        usable = stated.size > 0 and bool(np.all(stated > 0)) and np.isfinite(stated).all()
        if usable:
            rms, least = float(np.sqrt(np.mean(stated**2))), float(stated.min())
            agrees = not np.isfinite(level) or level / AGREE <= rms <= level * AGREE
            usable = agrees and least > 0.2 * rms
        if usable:
            out[:, j] = np.where(seen & (sigma_rad[:, j] > 0), sigma_rad[:, j], np.nan)
        else:
            out[:, j] = np.where(seen, max(level, 1e-9), np.nan)
        measured.append(level)
        source.append("stated" if usable else "measured")
    return Noise(out, (measured[0], measured[-1]), (source[0], source[-1]))
