"""Statistics of series whose neighbours hang together."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def correlation_time(residual: Floats) -> float:
    """Integrated autocorrelation time, in samples, of a series of mean zero; 1 for white noise.

    ``1 + 2 sum rho_k``, the sum taken to the first lag whose correlation is below twice its own standard
    error ``1 / sqrt(n)`` (Sokal's windowing in its simplest form). ``n / correlation_time`` samples count
    as independent for the error of a mean. NaN are left out where they stand.
    """
    x = np.where(np.isfinite(residual), residual, 0.0)
    n = int(np.isfinite(residual).sum())
    power = float(x @ x)
    if n < 8 or power <= 0:
        return 1.0
    size = 1 << int(2 * x.size - 1).bit_length()
    spectrum = np.fft.rfft(x, size)
    rho = np.fft.irfft(spectrum * spectrum.conj(), size)[: x.size // 2] / power
    small = np.flatnonzero(rho[1:] < 2.0 / np.sqrt(n))
    last = int(small[0]) if small.size else rho.size - 1
    return float(max(1.0, 1.0 + 2.0 * rho[1 : last + 1].sum()))


def highpass_noise(x: Floats, points: int = 9) -> float:
    """Standard deviation of the white noise of an even series: residual of a local cubic over 9 points.

    The residual's middle point has kept ``1 - h`` of the noise's variance, with ``h`` the middle's
    leverage; that is put back. NaN windows are left out; NaN if there is none.
    """
    half = points // 2
    grid = np.arange(-half, half + 1, dtype=np.float64)
    design = np.vander(grid, 4, increasing=True)
    weights = np.linalg.pinv(design)[0]
    if x.size < points:
        return float("nan")
    windows = np.lib.stride_tricks.sliding_window_view(x, points)
    residual = windows[:, half] - windows @ weights
    residual = residual[np.isfinite(residual)]
    return float(np.sqrt((residual**2).mean() / (1 - weights[half]))) if residual.size else float("nan")
