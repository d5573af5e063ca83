"""The compiled half of pydpend; private. Everything here is wrapped by a public name."""

from typing import Any

import numpy as np
import numpy.typing as npt

def simulate_motion(
    model: dict[str, float],
    state: list[float],
    times_s: npt.NDArray[np.float64],
    *,
    tolerance: float,
    width_rad_s: float | None = None,
    pinned: bool = False,
) -> dict[str, Any]: ...
def simulate_ensemble(
    models: list[dict[str, float]],
    states: npt.NDArray[np.float64],
    times_s: npt.NDArray[np.float64],
    *,
    tolerance: float,
    width_rad_s: float | None = None,
    pinned: bool = False,
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64], npt.NDArray[np.bool_]]: ...
def poincare_section(
    model: dict[str, float],
    state: list[float],
    duration_s: float,
    *,
    link: int,
    angle_rad: float,
    direction: float,
    tolerance: float,
    pinned: bool = False,
) -> npt.NDArray[np.float64]: ...
def tangent_growth(
    model: dict[str, float],
    state: list[float],
    interval_s: float,
    skipped: int,
    counted: int,
    tolerance: float,
) -> npt.NDArray[np.float64]: ...
