"""Types of arguments that many functions have."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Literal, TypeAlias

Progress: TypeAlias = Callable[[str, int, int | None], object] | bool | None
"""A callback ``(stage, done, total)``; None is a bar on a terminal or in a notebook, False is nothing."""

Polarity: TypeAlias = Literal["auto", "bright", "dark"]
Centroid: TypeAlias = Literal["disc", "weighted", "contour"]
Decoder: TypeAlias = Literal["auto", "ffmpeg", "opencv"]
Interlaced: TypeAlias = Literal["refuse", "as-frames"]
PixelAspect: TypeAlias = tuple[int, int] | str
"""Width to height of a pixel: ``(16, 15)`` or ``"16:15"``."""
Region: TypeAlias = Sequence[float] | str
"""First column and row and last column and row in px: ``(0, 0, 319, 239)`` or ``"0,0,319,239"``."""
Frames: TypeAlias = tuple[int, int | None] | range | str
"""First frame and one past the last, counted from 0: ``(0, 500)``, ``range(500)`` or ``"0..500"``."""
