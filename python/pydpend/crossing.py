"""The types of what crosses between Python and the compiled half.

T frames, N nodes, D detections. What is not seen is NaN.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

HeldColumns: TypeAlias = tuple[
    NDArray[np.int64],
    NDArray[np.float64],
    NDArray[np.float64],
    NDArray[np.float32],
    NDArray[np.float32],
    NDArray[np.uint8],
]
"""Frames, times, places, uncertainties, areas and status."""
Columns: TypeAlias = tuple[*HeldColumns, str]
"""The columns, and the metadata as JSON."""

Found: TypeAlias = tuple[NDArray[np.float64], NDArray[np.float32], NDArray[np.uint8]]
Row: TypeAlias = tuple[NDArray[np.float64], NDArray[np.float32], NDArray[np.float32], NDArray[np.uint8]]
Frames: TypeAlias = tuple[int, int | None] | None
Callback: TypeAlias = Callable[[str, int, int | None], object] | None
"""Called with stage, frames done and frames in all, if known."""


class SegmentArrays(Protocol):
    """The arrays that the compiled fit reads of `pydpend.damping.shooting.Segments`, K segments."""

    @property
    def rows(self) -> NDArray[np.int64]:
        """Recording, first sample, one past the last, whether the next continues it, (K, 4)."""

    @property
    def times_s(self) -> NDArray[np.float64]:
        """Start and end, (K, 2)."""

    @property
    def states(self) -> NDArray[np.float64]:
        """Angles in rad and rates in rad/s at the start, (K, 4)."""


class StartNumbers(Protocol):
    """The attributes that the compiled fit reads of `pydpend.damping.shooting.Start`, R recordings and C cameras."""

    @property
    def zeros_rad(self) -> Sequence[tuple[float, float]]:
        """Angle zeros of each recording, rad, (R, 2)."""

    @property
    def camera_numbers(self) -> Sequence[Sequence[float]]:
        """Numbers of each camera in units of their prior standard deviations, (C, 5)."""

    @property
    def clock_scale(self) -> float:
        """The motion's seconds to a second of the recording."""
