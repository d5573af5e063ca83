"""Figures of motions and energies, and the pendulum's animation.

Functions return figures and write nothing, except `animate`, which writes a film.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure

from pydpend.free_swing import RingDown
from pydpend.linear import Section
from pydpend.model import Model
from pydpend.output import AnyPath, path_of
from pydpend.plots.moving import check_film, pictures_of, write_film
from pydpend.plots.style import COLORS, new_figure, plain, style
from pydpend.simulation import LAWS, Simulation

Array = npt.NDArray[np.float64]


class Motion(Protocol):
    """Angles over time: a simulation, angles of a film, or smoothed states."""

    @property
    def t_s(self) -> Array:
        """Times (T,), s."""
        ...

    @property
    def phi_rad(self) -> Array:
        """Angles (T, L), rad."""
        ...


class Rates(Motion, Protocol):
    """Angles and rates over time."""

    @property
    def w_rad_s(self) -> Array:
        """Rates (T, L), rad/s."""
        ...


def energies(run: Simulation, model: Model) -> Figure:
    """Kinetic, potential and total energy, and what each law has taken out."""
    with style():
        figure = new_figure(6.5, 5.0)
        upper, lower = figure.subplots(2, 1, sharex=True)
        potential = model.potential(run.phi_rad)
        upper.plot(run.t_s, run.energy_j - potential, label="kinetic")
        upper.plot(run.t_s, potential, label="potential")
        upper.plot(run.t_s, run.energy_j, label="total")
        upper.set_ylabel("energy (J)")
        upper.legend()
        used = [i for i in range(len(LAWS)) if np.any(run.works_j[:, i] != 0)]
        if used:
            lower.stackplot(
                run.t_s,
                run.works_j[:, used].T,
                labels=[LAWS[i] for i in used],
                colors=[COLORS[k % len(COLORS)] for k in range(len(used))],
            )
            lower.legend(loc="upper left")
        lower.set_ylabel("taken out (J)")
        lower.set_xlabel("time (s)")
    return figure


def phase_portrait(motion: Rates, names: Sequence[str] = ()) -> Figure:
    """Rate over angle of each link, the angle within one turn; ``names`` of the angles for the axes."""
    with style():
        figure = new_figure(6.5, 3.2)
        axes = figure.subplots(1, motion.phi_rad.shape[1], squeeze=False)[0]
        for k, ax in enumerate(axes):
            phi = np.degrees(np.mod(motion.phi_rad[:, k] + np.pi, 2 * np.pi) - np.pi)
            w = motion.w_rad_s[:, k].copy()
            # No line across the seam at half a turn.
            jump = np.abs(np.diff(phi, append=phi[-1:])) > 180
            w[jump] = np.nan
            ax.plot(phi, w, color=COLORS[k % len(COLORS)], linewidth=0.6)
            one = plain(names[k]) if k < len(names) else f"phi{k + 1}"
            ax.set_xlabel(f"{one} (deg)")
            ax.set_ylabel("rate (rad/s)")
    return figure


def amplitudes_figure(swing: RingDown) -> Figure:
    """Amplitude of a single pendulum's free swing at its turning points, deg, on a logarithmic scale.

    Viscous friction alone is a straight line there; drag of the square of the speed falls faster at first, dry friction
    faster at last.
    """
    with style():
        figure = new_figure(6.5, 2.8)
        ax = figure.subplots()
        ax.errorbar(
            swing.t_s,
            np.degrees(swing.amplitude_rad),
            np.degrees(swing.amplitude_sigma_rad),
            fmt=".",
            markersize=3,
            color=COLORS[0],
        )
        ax.set_yscale("log")
        ax.set_xlabel("time (s)")
        ax.set_ylabel("amplitude (deg)")
    return figure


def section(found: Section) -> Figure:
    """A Poincaré section: the other link's angle and rate at the passages."""
    with style():
        figure = new_figure(4.5, 3.5)
        ax = figure.subplots()
        phi = np.degrees(np.mod(found.phi_rad[:, 1] + np.pi, 2 * np.pi) - np.pi)
        ax.plot(phi, found.w_rad_s[:, 1], ".", markersize=2)
        ax.set_xlabel("phi2 (deg)")
        ax.set_ylabel("w2 (rad/s)")
    return figure


def comparison(film: Motion, run: Motion) -> Figure:
    """Angles of a film and of a simulation, and their difference at the film's times."""
    with style():
        figure = new_figure(6.5, 5.0)
        upper, lower = figure.subplots(2, 1, sharex=True)
        for k in range(film.phi_rad.shape[1]):
            upper.plot(film.t_s, np.degrees(film.phi_rad[:, k]), ".", markersize=2, color=COLORS[k])
            upper.plot(run.t_s, np.degrees(run.phi_rad[:, k]), color=COLORS[k], label=f"phi{k + 1}")
            inside = (film.t_s >= run.t_s[0]) & (film.t_s <= run.t_s[-1])
            expected = np.interp(film.t_s[inside], run.t_s, run.phi_rad[:, k])
            lower.plot(
                film.t_s[inside],
                np.degrees(film.phi_rad[inside, k] - expected),
                ".",
                markersize=2,
                color=COLORS[k],
            )
        upper.set_ylabel("angle (deg)\npoints: film, lines: simulation")
        upper.legend()
        lower.set_ylabel("difference (deg)")
        lower.set_xlabel("time (s)")
    return figure


def animate(motion: Motion, model: Model, path: AnyPath, *, fps: float = 25.0, speed: float = 1.0) -> None:
    """Writes the pendulum's motion as a film, GIF or MP4 by the ending (MP4 needs the program ffmpeg).

    ``speed`` is film time over real time: 0.1 is ten times slowed. Raises SimulationError for another ending or a
    rate that is not positive.
    """
    path = path_of(path)
    check_film(path, fps, speed)
    times = np.arange(motion.t_s[0], motion.t_s[-1], speed / fps)
    phi = np.stack([np.interp(times, motion.t_s, motion.phi_rad[:, k]) for k in range(2)], axis=1)
    length = model.lower_outer_m if model.lower_outer_m > 0 else model.l1_m
    elbow = model.l1_m * np.stack([np.sin(phi[:, 0]), -np.cos(phi[:, 0])], axis=1)
    end = elbow + length * np.stack([np.sin(phi[:, 1]), -np.cos(phi[:, 1])], axis=1)
    reach = 1.1 * (model.l1_m + length)
    with style():
        figure = new_figure(4.0, 4.0)
        ax = figure.subplots()
        ax.set_xlim(-reach, reach)
        ax.set_ylim(-reach, reach)
        ax.set_aspect("equal")
        (upper,) = ax.plot([], [], color=COLORS[0], linewidth=5, solid_capstyle="round")
        (lower,) = ax.plot([], [], color=COLORS[1], linewidth=4, solid_capstyle="round")
        (trace,) = ax.plot([], [], color=COLORS[2], linewidth=0.6)
        title = ax.set_title("")

        def draw(i: int) -> None:
            upper.set_data([0.0, elbow[i, 0]], [0.0, elbow[i, 1]])
            lower.set_data([elbow[i, 0], end[i, 0]], [elbow[i, 1], end[i, 1]])
            since = max(0, i - round(fps))
            trace.set_data(end[since : i + 1, 0], end[since : i + 1, 1])
            title.set_text(f"{times[i]:.2f} s")

        title.set_text("0.00 s")  # Its height counts when the figure is laid out.
        write_film(path, fps, pictures_of(figure, [upper, lower, trace, title], draw, len(times)))
