"""Types of arguments that many functions have."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, TypeAlias

Progress: TypeAlias = Callable[[str, int, int | None], object] | bool | None
"""A callback ``(stage, done, total)``; None is a bar on a terminal or in a notebook, False is nothing."""

Polarity: TypeAlias = Literal["auto", "bright", "dark"]
Centroid: TypeAlias = Literal["weighted", "contour"]
Decoder: TypeAlias = Literal["auto", "ffmpeg", "opencv"]
Interlaced: TypeAlias = Literal["refuse", "as-frames"]
PixelAspect: TypeAlias = tuple[int, int] | str
"""Width to height of a pixel: ``(16, 15)`` or ``"16:15"``."""
