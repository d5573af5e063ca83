"""A recording beside the simulation of the pendulum that was fitted to it, as a film."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backend_bases import RendererBase
from numpy.typing import NDArray

from pydpend.model import Model
from pydpend.output import AnyPath, path_of
from pydpend.plots.moving import DPI, check_film, pictures_of, write_film
from pydpend.plots.physics import Motion
from pydpend.plots.style import COLORS, new_figure, style

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Pictures:
    """A film file and the recording's time in s at each of its pictures, (K,)."""

    path: Path
    size_px: tuple[int, int]
    t_s: Floats


@contextmanager
def opened(film: Pictures, size_px: tuple[int, int]) -> Iterator[Iterator[NDArray[np.uint8]]]:
    """Its pictures in order at this width and height, (H, W, 4), decoded by the program ffmpeg."""
    width, height = size_px
    words = [
        "ffmpeg",
        "-nostdin",
        "-v",
        "error",
        "-i",
        f"file:{film.path}",
        "-vf",
        f"scale={width}:{height}:flags=area",
    ]
    words += ["-f", "rawvideo", "-pix_fmt", "rgba", "-"]
    with subprocess.Popen(words, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        stream = process.stdout

        def pictures() -> Iterator[NDArray[np.uint8]]:
            while len(raw := stream.read(width * height * 4)) == width * height * 4:
                yield np.frombuffer(raw, dtype=np.uint8).reshape(height, width, 4).copy()

        try:
            yield pictures()
        finally:
            process.kill()


class _Picture(Artist):
    """A picture that fills axes pixel for pixel: matplotlib's own images are scaled anew whenever they are drawn."""

    def __init__(self, axes: Axes) -> None:
        super().__init__()
        box = axes.get_window_extent()
        self.left_bottom = round(box.x0), round(box.y0)
        self.size_px = round(box.width), round(box.height)
        self.rgba = np.zeros((*self.size_px[::-1], 4), dtype=np.uint8)

    def draw(self, renderer: RendererBase) -> None:
        gc = renderer.new_gc()
        renderer.draw_image(gc, *self.left_bottom, self.rgba)
        gc.restore()


class _Pendulum:
    """Two links drawn into axes."""

    def __init__(self, axes: Axes, model: Model, title: str) -> None:
        self.l1 = model.l1_m
        self.l2 = model.lower_outer_m if model.lower_outer_m > 0 else model.l1_m
        reach = 1.1 * (self.l1 + self.l2)
        axes.set_xlim(-reach, reach)
        axes.set_ylim(-reach, reach)
        axes.set_aspect("equal")
        axes.set_axis_off()
        axes.set_title(title)
        axes.plot(0.0, 0.0, "o", color="0.5", ms=8, zorder=0)
        (self.upper,) = axes.plot([], [], color=COLORS[0], linewidth=5, solid_capstyle="round")
        (self.lower,) = axes.plot([], [], color=COLORS[1], linewidth=4, solid_capstyle="round")

    def stand(self, phi: Floats) -> None:
        x, y = self.l1 * np.sin(phi[0]), -self.l1 * np.cos(phi[0])
        self.upper.set_data([0.0, x], [0.0, y])
        self.lower.set_data([x, x + self.l2 * np.sin(phi[1])], [y, y - self.l2 * np.cos(phi[1])])


def beside(
    film: Motion,
    run: Motion,
    model: Model,
    path: AnyPath,
    *,
    pictures: Pictures | None = None,
    fps: float = 25.0,
    speed: float = 0.2,
) -> int:
    """Writes a film, GIF or MP4 by the ending: the recording, the simulation, and both angles below with a cursor.

    Left are the recording's ``pictures``, or where there are none its angles drawn as links. ``run`` gives the span.
    ``speed`` is film time over real time: 0.2 is five times slowed. Returns the number of pictures. Raises
    SimulationError for another ending, rates that are not positive, or without the program ffmpeg where it is needed.
    """
    path = path_of(path)
    check_film(path, fps, speed)
    times = np.arange(run.t_s[0], run.t_s[-1], speed / fps)
    seen = [np.interp(times, film.t_s, film.phi_rad[:, k]) for k in range(2)]
    made = [np.interp(times, run.t_s, run.phi_rad[:, k]) for k in range(2)]
    with style():
        figure = new_figure(8.0, 6.4)
        figure.set_dpi(DPI)
        grid = figure.add_gridspec(2, 2, height_ratios=(2, 1))
        left, right, below = (
            figure.add_subplot(grid[0, 0]),
            figure.add_subplot(grid[0, 1]),
            figure.add_subplot(grid[1, :]),
        )
        simulated = _Pendulum(right, model, "simulation")
        near = (film.t_s >= times[0]) & (film.t_s <= times[-1])
        for k in range(2):
            below.plot(
                film.t_s[near],
                np.degrees(film.phi_rad[near, k]),
                color=COLORS[k],
                label=f"phi{k + 1}, recording",
            )
            below.plot(times, np.degrees(made[k]), "k--", label="simulation" if k else None)
        below.set_xlabel("time (s)")
        below.set_ylabel("angle (deg)")
        below.legend(ncols=3, fontsize=7)
        cursor = below.axvline(times[0], color="0.3", lw=0.8)

        def stand(i: int) -> None:
            cursor.set_xdata([times[i], times[i]])
            simulated.stand(np.array([made[0][i], made[1][i]]))

        moving: list[Artist] = [simulated.upper, simulated.lower, cursor]
        if pictures is None:
            measured = _Pendulum(left, model, "recording")

            def draw(i: int) -> None:
                stand(i)
                measured.stand(np.array([seen[0][i], seen[1][i]]))

            moving += [measured.upper, measured.lower]
            write_film(path, fps, pictures_of(figure, moving, draw, len(times)))
            return len(times)
        left.set_axis_off()
        left.set_title("recording")
        left.set_box_aspect(pictures.size_px[1] / pictures.size_px[0])
        figure.draw_without_rendering()
        figure.set_layout_engine("none")
        shown = _Picture(left)
        # The picture nearest to each time; times and pictures both go forwards.
        wanted = np.clip(np.searchsorted(pictures.t_s, times), 1, pictures.t_s.size - 1)
        wanted -= times - pictures.t_s[wanted - 1] < pictures.t_s[wanted] - times
        with opened(pictures, shown.size_px) as stream:
            at = -1

            def show(i: int) -> None:
                nonlocal at
                picture = None
                while at < wanted[i]:
                    picture = next(stream, None)
                    at += 1
                if picture is not None:
                    shown.rgba = picture[::-1]
                stand(i)

            write_film(path, fps, pictures_of(figure, [shown, *moving], show, len(times)))
    return len(times)
