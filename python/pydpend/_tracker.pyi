"""The compiled half of pydpend; private. Everything here is wrapped by a public name.

Shapes: T frames, N nodes. Images are (H, W), uint8 or uint16. What is not seen is NaN.
"""

from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

VERSION: str

HeldColumns: TypeAlias = tuple[
    NDArray[np.int64],
    NDArray[np.float64],
    NDArray[np.float64],
    NDArray[np.float32],
    NDArray[np.float32],
    NDArray[np.uint8],
]
Columns: TypeAlias = tuple[
    NDArray[np.int64],
    NDArray[np.float64],
    NDArray[np.float64],
    NDArray[np.float32],
    NDArray[np.float32],
    NDArray[np.uint8],
    str,
]

def read_table(path: str) -> Columns:
    """frame (T,), time in s (T,), centres in px (T, N, 2), sigma in px, area in px and status (T, N), JSON."""

def read_meta(path: str) -> str:
    """The metadata of a node table as JSON."""

def write_table(path: str, held: HeldColumns, meta: str) -> None:
    """Writes a node table, Parquet or CSV by the ending."""

def check_table(held: HeldColumns, meta: str) -> None:
    """Checks the invariants of a node table."""

def arrow_reader(held: HeldColumns, rig: str) -> Any:
    """The rows as an Arrow stream; `rig` is JSON."""

def read_rig(path: str) -> str:
    """A rig file as JSON."""

def rig_toml(rig: str) -> str:
    """A rig's TOML from its JSON."""

def simulate_motion(
    model: dict[str, float],
    state: list[float],
    times_s: NDArray[np.float64],
    *,
    tolerance: float,
    width_rad_s: float | None = None,
    pinned: bool = False,
) -> dict[str, Any]: ...
def simulate_ensemble(
    models: list[dict[str, float]],
    states: NDArray[np.float64],
    times_s: NDArray[np.float64],
    *,
    tolerance: float,
    width_rad_s: float | None = None,
    pinned: bool = False,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]: ...
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
) -> NDArray[np.float64]: ...
def tangent_growth(
    model: dict[str, float],
    state: list[float],
    interval_s: float,
    skipped: int,
    counted: int,
    tolerance: float,
) -> NDArray[np.float64]: ...

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]
_Angles = tuple[_Floats, _Floats, _Floats]

def shooting_segments(
    recordings: Sequence[_Angles], spans: Sequence[tuple[float, float]], length_s: float, chained: bool
) -> tuple[_Ints, _Floats, _Floats]: ...
def shooting_fit(
    recordings: Sequence[_Angles],
    segment_rows: _Ints,
    segment_times: _Floats,
    segment_states: _Floats,
    model: dict[str, float],
    zeros: Sequence[tuple[float, float]],
    *,
    free: Sequence[str],
    bounded: Sequence[str],
    clock: bool,
    free_zeros: bool,
    slack: Sequence[float],
    learned: bool,
    huber: float,
    max_iterations: int,
    stretch: float = 1.0,
    progress: Callable[[int, int, float], object] | None = None,
) -> dict[str, Any]: ...
def shooting_trace(
    recordings: Sequence[_Angles],
    segment_rows: _Ints,
    segment_times: _Floats,
    segment_states: _Floats,
    model: dict[str, float],
    stretch: float,
) -> tuple[_Ints, _Floats, _Floats]: ...
def follow_motion(
    model: dict[str, float], state: tuple[float, float, float, float], start_s: float, times_s: _Floats
) -> _Floats: ...
def term_names() -> list[tuple[str, str]]: ...
def unit_powers(model: dict[str, float], state: _Floats, accelerations: _Floats) -> _Floats: ...
