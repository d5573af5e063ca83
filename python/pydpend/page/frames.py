"""Pictures of a film's frames by their index, as the tracker reads them, with levels that a person can stretch."""

from __future__ import annotations

import io
import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from pydpend import _native
from pydpend.reading_options import OpenOptions

JPEG_QUALITY = 92
"""Of 100: sharp to the eye. What is measured is measured on the recorded samples, never on these pictures."""


class Frames:
    """The frames of a film.

    Parameters
    ----------
    film : Path
        The film.
    options : OpenOptions
        How it is opened.
    """

    def __init__(self, film: Path, options: OpenOptions) -> None:
        self._reader = _native.FrameReader(os.fsdecode(film), options.opened())

    def samples(self, index: int) -> tuple[NDArray[np.uint16] | None, int]:
        """The recorded samples (H, W), None where the frame could not be decoded, and their significant bits.

        Raises ArgumentError for a frame that is not there.
        """
        luma, bits, _ = self._reader.frame(index)
        return luma, bits

    def jpeg(self, index: int, low: float | None, high: float | None, width: int | None) -> bytes:
        """The picture of a frame, with ``low`` shown black and ``high`` white, in the film's units.

        In colour where the film has it and the levels are its own; ``width`` in px shrinks it.
        """
        luma, bits, colour = self._reader.frame(index)
        if luma is None:
            return _encoded(Image.new("L", (64, 48), 0), None)
        full = float((1 << bits) - 1)
        bottom, top = 0.0 if low is None else low, full if high is None else high
        if bits == 8 and (bottom, top) == (0.0, full):
            gray = luma.astype(np.uint8)
        else:
            table = np.clip((np.arange(1 << 16) - bottom) / max(top - bottom, 1e-9), 0, 1) * 255
            gray = np.rint(table).astype(np.uint8)[luma]
        picture = Image.fromarray(gray)
        if colour is not None and (low, high) == (None, None):
            height, wide = gray.shape
            planes = [_plane(flat, height, wide) for flat in colour]
            picture = Image.merge("YCbCr", (picture, *planes))
        return _encoded(picture, width)


def _plane(flat: NDArray[np.uint8], height: int, width: int) -> Image.Image:
    """A plane of colour differences in the size of the brightness; it may have half of its sides."""
    size = (height, width) if flat.size == height * width else ((height + 1) // 2, (width + 1) // 2)
    plane = Image.fromarray(np.ascontiguousarray(flat[: size[0] * size[1]].reshape(size)))
    return plane if size == (height, width) else plane.resize((width, height), Image.Resampling.BILINEAR)


def _encoded(picture: Image.Image, width: int | None) -> bytes:
    if width is not None and width < picture.width:
        height = max(1, round(picture.height * width / picture.width))
        picture = picture.resize((width, height), Image.Resampling.BOX)
    out = io.BytesIO()
    picture.save(out, "JPEG", quality=JPEG_QUALITY)
    return out.getvalue()
