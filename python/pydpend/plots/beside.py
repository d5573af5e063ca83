"""A recording beside the simulation of the pendulum that was fitted to it, as a film."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.animation import FFMpegWriter, FuncAnimation, PillowWriter
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from numpy.typing import NDArray

from pydpend.errors import SimulationError, fault
from pydpend.model import Model
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
def opened(film: Pictures) -> Iterator[Iterator[NDArray[np.uint8]]]:
    """Its pictures in order, (H, W, 3), decoded by the program ffmpeg."""
    width, height = film.size_px
    words = ["ffmpeg", "-v", "error", "-i", str(film.path), "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    with subprocess.Popen(words, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        stream = process.stdout

        def pictures() -> Iterator[NDArray[np.uint8]]:
            while len(raw := stream.read(width * height * 3)) == width * height * 3:
                yield np.frombuffer(raw, dtype=np.uint8).reshape(height, width, 3)

        try:
            yield pictures()
        finally:
            process.kill()


class _Pendulum:
    """Two links drawn into axes."""

    def __init__(self, axes: Axes, model: Model, title: str) -> None:
        self.l1 = model.l1_m
        self.l2 = model.lower_outer_m if model.lower_outer_m > 0 else model.l1_m
        reach = 1.1 * (self.l1 + self.l2)
        axes.set_xlim(-reach, reach)
        axes.set_ylim(-reach, reach)
        axes.set_aspect("equal")
        axes.set_xticks([])
        axes.set_yticks([])
        axes.set_title(title)
        (self.upper,) = axes.plot([], [], color=COLORS[0], linewidth=5, solid_capstyle="round")
        (self.lower,) = axes.plot([], [], color=COLORS[1], linewidth=4, solid_capstyle="round")

    def stand(self, phi: Floats) -> tuple[Artist, ...]:
        x, y = self.l1 * np.sin(phi[0]), -self.l1 * np.cos(phi[0])
        self.upper.set_data([0.0, x], [0.0, y])
        self.lower.set_data([x, x + self.l2 * np.sin(phi[1])], [y, y - self.l2 * np.cos(phi[1])])
        return self.upper, self.lower


def beside(
    film: Motion,
    run: Motion,
    model: Model,
    path: str | Path,
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
    path = Path(path)
    ending = path.suffix.lower()
    if ending not in (".gif", ".mp4"):
        raise SimulationError(
            fault(str(path), f"{path.suffix or 'no ending'} is not a film", "Use .gif or .mp4")
        )
    if not (fps > 0 and speed > 0):
        raise SimulationError(fault("--fps, --speed", f"{fps} and {speed}", "Both must be above 0"))
    if (ending == ".mp4" or pictures is not None) and not FFMpegWriter.isAvailable():
        raise SimulationError(fault(str(path), "the program ffmpeg is not there", "Install it"))
    times = np.arange(run.t_s[0], run.t_s[-1], speed / fps)
    seen = [np.interp(times, film.t_s, film.phi_rad[:, k]) for k in range(2)]
    made = [np.interp(times, run.t_s, run.phi_rad[:, k]) for k in range(2)]
    with style():
        figure = new_figure(8.0, 6.4)
        grid = figure.add_gridspec(2, 2, height_ratios=(2, 1))
        left, right, below = (
            figure.add_subplot(grid[0, 0]),
            figure.add_subplot(grid[0, 1]),
            figure.add_subplot(grid[1, :]),
        )
        simulated = _Pendulum(right, model, "simulation")
        for k in range(2):
            near = (film.t_s >= times[0]) & (film.t_s <= times[-1])
            below.plot(
                film.t_s[near], np.degrees(film.phi_rad[near, k]), color=COLORS[k], label=f"phi{k + 1}, film"
            )
            below.plot(times, np.degrees(made[k]), "--", color=COLORS[k + 2], label=f"phi{k + 1}, simulation")
        below.set_xlabel("time (s)")
        below.set_ylabel("angle (deg)")
        below.legend(ncols=2, fontsize=7)
        cursor = below.axvline(times[0], color="0.3", lw=0.8)
        # Laid out once: doing it for every picture takes longer than drawing it.
        figure.draw_without_rendering()
        figure.set_layout_engine("none")
        writer = PillowWriter(fps=round(fps)) if ending == ".gif" else FFMpegWriter(fps=round(fps))
        if pictures is None:
            measured = _Pendulum(left, model, "film")

            def draw(i: int) -> tuple[Artist, ...]:
                cursor.set_xdata([times[i], times[i]])
                measured.stand(np.array([seen[0][i], seen[1][i]]))
                return simulated.stand(np.array([made[0][i], made[1][i]]))

            FuncAnimation(figure, draw, frames=len(times)).save(str(path), writer=writer, dpi=100)
            return len(times)
        width, height = pictures.size_px
        shown = left.imshow(np.zeros((height, width, 3), dtype=np.uint8))
        left.set_axis_off()
        left.set_title("film")
        # The picture nearest to each time; times and pictures both go forwards.
        wanted = np.clip(np.searchsorted(pictures.t_s, times), 1, pictures.t_s.size - 1)
        wanted -= times - pictures.t_s[wanted - 1] < pictures.t_s[wanted] - times
        with opened(pictures) as stream:
            at = -1

            def show(i: int) -> tuple[Artist, ...]:
                nonlocal at
                picture = None
                while at < wanted[i]:
                    picture = next(stream, None)
                    at += 1
                if picture is not None:
                    shown.set_data(picture)
                cursor.set_xdata([times[i], times[i]])
                return simulated.stand(np.array([made[0][i], made[1][i]]))

            FuncAnimation(figure, show, frames=len(times), init_func=lambda: (shown,)).save(
                str(path), writer=writer, dpi=100
            )
    return len(times)
