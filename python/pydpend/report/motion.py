"""The part of the page on how links and points move: rates, phase portraits, a single pendulum's ring-down, speeds."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pydpend.free_swing import RingDown
from pydpend.kinematics import LinkAngles
from pydpend.plots.physics import amplitudes_figure, phase_portrait
from pydpend.plots.style import inline_svg
from pydpend.recording_folder import StoredPoints, StoredStates
from pydpend.report.page import Block, Chart, Figure, Heading, Reset, Series, Table, Text
from pydpend.report.words import digits, with_sigma
from pydpend.run_folder import StoredRecording

MOST_PHASE_POINTS = 4000
"""Points of a phase portrait's curve, which is drawn into the page point by point."""

MOST_SPEEDS = 6
"""Curves of speeds in one chart."""

UNITS = {"viscous": "1/s", "quadratic": "1/(rad s)", "dry": "rad/s"}
"""Unit of each law's rate, by which the amplitude falls."""


@dataclass(frozen=True, eq=False)
class Motion:
    """Rates of the links and speeds of points of one recording."""

    states: StoredStates | None = None
    swing: RingDown | None = None
    points: StoredPoints | None = None

    def warnings(self) -> list[str]:
        """The doubts about them."""
        out = [] if self.states is None or not self.states.no_swing else [self.states.no_swing]
        return out + ([] if self.points is None else [str(n) for n in self.points.about.get("notes", [])])

    def answer(self) -> list[tuple[str, str]]:
        """Its findings, as (property, value)."""
        rows: list[tuple[str, str]] = []
        if self.swing is not None:
            s = self.swing
            rows += [
                ("period of small swings", f"{with_sigma(s.period_s, s.period_sigma_s)} s"),
                ("damping of the amplitude", _laws(s)),
                (f"Q at {digits(np.degrees(s.at_amplitude_rad))} deg", f"{s.q:.4g}"),
            ]
        if self.points is not None and isinstance(self.points.about.get("scale"), dict):
            rows.append(("scale", _scale(self.points.about["scale"])))
        return rows

    def blocks(self, id_: str, angles: LinkAngles | None, film: bool) -> list[Block]:
        """The charts, figures and tables."""
        out: list[Block] = []
        if self.states is not None and angles is not None:
            out += _rates(id_, self.states, angles)
        if self.points is not None:
            out += _speeds(id_, self.points)
        if out:
            out.append(Reset(id_, film=film))
        if self.states is not None and angles is not None:
            out.append(_phase(self.states, angles))
        if self.swing is not None:
            out += _swing(self.swing)
        return out


def read(r: StoredRecording) -> Motion:
    """Everything the run folder holds of a recording's rates and speeds."""
    return Motion(
        r.states() if r.did("states") else None,
        r.swing() if r.did("states") else None,
        r.points() if r.did("points") else None,
    )


def _rates(id_: str, states: StoredStates, angles: LinkAngles) -> list[Block]:
    stems = [angles.columns.stem(k) for k in range(angles.links)]
    rate = tuple(Series(f"{stem} (rad/s)", states.w_rad_s[:, k], k) for k, stem in enumerate(stems))
    change = tuple(Series(f"{stem} (rad/s²)", states.a_rad_s2[:, k], k) for k, stem in enumerate(stems))
    return [
        Chart(f"{id_}-w", "Angular rates ω", id_, states.t_s, rate, y_label="ω (rad/s)"),
        Chart(f"{id_}-a", "Angular accelerations α", id_, states.t_s, change, y_label="α (rad/s²)"),
    ]


def _speeds(id_: str, points: StoredPoints) -> list[Block]:
    unit = f"{points.unit}/s"
    few = points.names[:MOST_SPEEDS]
    series = tuple(Series(f"{name} ({unit})", points.speed[:, k], k) for k, name in enumerate(few))
    out: list[Block] = [
        Chart(f"{id_}-speed", "Speeds of points", id_, points.t_s, series, y_label=f"speed ({unit})")
    ]
    if points.unit == "px":
        out.append(Text("Pixels, because no distance was given (scale).", quiet=True))
    if len(points.names) > MOST_SPEEDS:
        out.append(Text(f"The first {MOST_SPEEDS} of {len(points.names)} points.", quiet=True))
    return out


def _phase(states: StoredStates, angles: LinkAngles) -> Block:
    step = -(-states.t_s.size // MOST_PHASE_POINTS)
    thin = replace(states, phi_rad=states.phi_rad[::step], w_rad_s=states.w_rad_s[::step])
    names = [angles.columns.stem(k) for k in range(angles.links)]
    return Figure(inline_svg(phase_portrait(thin, names)), "Phase portrait: rate over angle of each link.")


def _swing(swing: RingDown) -> list[Block]:
    rows = [
        ("swings", str(swing.swings)),
        ("period of small swings T₀ (s)", with_sigma(swing.period_s, swing.period_sigma_s)),
        (
            "its rise with the amplitude, k in T = T₀ (1 + k A²), A in rad (a pendulum in gravity has 1/16)",
            with_sigma(swing.amplitude_coefficient, swing.amplitude_coefficient_sigma)
            if np.isfinite(swing.amplitude_coefficient_sigma)
            else "1/16, taken: the amplitudes are too small or too equal to tell",
        ),
        (
            "amplitude at first and last (deg)",
            " and ".join(
                digits(np.degrees(a), 3) for a in (swing.first_amplitude_rad, swing.last_amplitude_rad)
            ),
        ),
        ("damping of the amplitude", _laws(swing)),
        (
            f"logarithmic decrement at {digits(np.degrees(swing.at_amplitude_rad))} deg",
            with_sigma(swing.decrement, swing.decrement_sigma),
        ),
        ("Q there", f"{swing.q:.4g}"),
    ]
    compared = sorted(swing.chi2_by_laws.items(), key=lambda pair: pair[1])
    return [
        Heading("Ring-down"),
        Table(("quantity", "value"), tuple(rows), numbers=frozenset({1})),
        Figure(
            inline_svg(amplitudes_figure(swing)),
            "Amplitude at each turning point. Viscous friction alone is a straight line.",
        ),
        Table(
            ("laws", "chi-square of the amplitudes per degree of freedom"),
            tuple((laws, f"{chi2:.4g}") for laws, chi2 in compared),
            caption="Laws of damping compared: viscous (dA/dt in proportion to A), quadratic (to A²), dry (constant). "
            "1 fits to within the noise; the fewest laws that chance does not rule out stand above.",
            numbers=frozenset({1}),
        ),
    ]


def _laws(swing: RingDown) -> str:
    each = zip(swing.laws, swing.rates, swing.rates_sigma, strict=True)
    return " and ".join(f"{law} {with_sigma(rate, sigma)} {UNITS[law]}" for law, rate, sigma in each)


def _scale(scale: dict[str, Any]) -> str:
    value, sigma = 1e3 * scale["m_per_px"], 1e3 * scale["sigma_m_per_px"]
    words = ", ".join(str(one["distance"]) for one in scale["from"])
    return f"{with_sigma(value, sigma)} mm a px (one error of all places), by {words}"
