"""Films of figures in which little moves: what stands still is drawn once."""

from __future__ import annotations

import subprocess
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

from pydpend.errors import Setting, SimulationError, fault
from pydpend.output import whole

ENDINGS = (".gif", ".mp4")
"""Kinds of file that `write_film` writes."""

DPI = 100
"""Pixels an inch: a figure of even hundredths of an inch has even sides, as H.264 wants them."""


def check_film(path: Path, fps: float, speed: float) -> None:
    """Raises SimulationError for another ending than `ENDINGS` and for rates that are not above 0."""
    if path.suffix.lower() not in ENDINGS:
        raise SimulationError(
            fault(str(path), f"{path.suffix or 'no ending'} is not a film", "Use .gif or .mp4")
        )
    for name, value in (("fps", fps), ("speed", speed)):
        if not value > 0:
            raise SimulationError(fault(Setting(name), f"{value:g} is not above 0", "Give a number above 0"))


def pictures_of(
    figure: Figure, moving: Sequence[Artist], move: Callable[[int], None], count: int
) -> Iterator[NDArray[np.uint8]]:
    """The figure after each of ``move(0)``, ``move(1)``, ..., (H, W, 4), valid until the next.

    ``moving`` are the artists that ``move`` changes, the lowest first; nothing else is drawn again.
    """
    figure.set_dpi(DPI)
    canvas: Any = FigureCanvasAgg(figure)
    for artist in moving:
        artist.set_animated(True)
    canvas.draw()
    ground = canvas.copy_from_bbox(figure.bbox)
    for i in range(count):
        move(i)
        canvas.restore_region(ground)
        for artist in moving:
            figure.draw_artist(artist)
        yield np.asarray(canvas.buffer_rgba())


def write_film(path: Path, fps: float, pictures: Iterator[NDArray[np.uint8]]) -> None:
    """Writes a GIF, or H.264 by the program ffmpeg; there is a whole film at ``path`` at the end or what was there.

    Raises SimulationError if it cannot be written.
    """
    try:
        with whole(path) as new:
            if path.suffix.lower() == ".gif":
                _write_gif(new, fps, pictures)
            else:
                _write_mp4(path, new, fps, pictures)
    except OSError as error:
        raise SimulationError(fault(str(path), f"cannot be written ({error.strerror})")) from None


def _write_gif(path: Path, fps: float, pictures: Iterator[NDArray[np.uint8]]) -> None:
    frames = (Image.fromarray(p[:, :, :3]).quantize(method=Image.Quantize.FASTOCTREE) for p in pictures)
    next(frames).save(path, save_all=True, append_images=frames, duration=1000 / fps, loop=0)


def _write_mp4(path: Path, new: Path, fps: float, pictures: Iterator[NDArray[np.uint8]]) -> None:
    first = next(pictures)
    height, width = first.shape[:2]
    words = [
        *("ffmpeg", "-v", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgba"),
        *("-s", f"{width}x{height}", "-framerate", f"{fps}", "-i", "-"),
        *("-c:v", "libx264", "-pix_fmt", "yuv420p", "-movflags", "+faststart"),
        # With its protocol a name is taken for nothing else.
        f"file:{new}",
    ]
    try:
        process = subprocess.Popen(words, stdin=subprocess.PIPE, stderr=subprocess.PIPE)
    except FileNotFoundError:
        raise SimulationError(
            fault(str(path), "the program ffmpeg is not there", "Install it or write a .gif")
        ) from None
    with process:
        assert process.stdin is not None
        assert process.stderr is not None
        try:
            process.stdin.write(first.tobytes())
            for picture in pictures:
                process.stdin.write(picture.tobytes())
            process.stdin.close()
        except BrokenPipeError:
            pass  # It has ended, and says why.
        except BaseException:
            process.kill()
            raise
        said = process.stderr.read().decode("utf-8", "replace").strip().splitlines()
        if process.wait() != 0:
            raise SimulationError(
                fault(str(path), f"ffmpeg could not write it ({said[-1] if said else 'it does not say why'})")
            )
