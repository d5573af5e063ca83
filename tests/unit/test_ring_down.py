"""Period, damping law and quality factor of a single pendulum, from made swings with noise."""

from __future__ import annotations

import numpy as np
import pydpend as dp
import pytest
from numpy.typing import NDArray
from pydpend.errors import AnglesError

Floats = NDArray[np.float64]

FPS, NOISE = 200.0, 1e-3
W = 2 * np.pi / 1.1
"""Circular frequency of a small swing of 1.1 s."""


def swing(
    seed: int, seconds: float, amplitude: float, *, a: float = 0.0, b: float = 0.0, c: float = 0.0
) -> dp.LinkAngles:
    """A pendulum in gravity whose amplitude falls by ``a A + b A^2 + c``, by Runge and Kutta; its zero is 3 deg off."""

    # Averages of the three laws over a swing: -2 a w, -(3 pi / 4)(b / W) |w| w and -(pi W / 2) c sign(w).
    def rates(x: Floats) -> Floats:
        w = x[1]
        loss = 2 * a * w + 0.75 * np.pi * b / W * abs(w) * w + np.pi * W / 2 * c * np.tanh(w / 1e-4)
        return np.array([w, -(W**2) * np.sin(x[0]) - loss])

    h = 1 / FPS / 4
    x, out = np.array([amplitude, 0.0]), []
    for _ in range(round(seconds * FPS)):
        out.append(x[0])
        for _ in range(4):
            k1 = rates(x)
            k2 = rates(x + h / 2 * k1)
            k3 = rates(x + h / 2 * k2)
            x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + rates(x + h * k3))
    rng = np.random.default_rng(seed)
    phi = np.array(out) + 0.05 + rng.normal(0, NOISE, len(out))
    t = np.arange(phi.size) / FPS
    return dp.LinkAngles(t, phi[:, None], np.full((phi.size, 1), NOISE), name="bob")


@pytest.mark.parametrize(
    ("laws", "rates"),
    [
        (("viscous",), {"a": 0.02}),
        (("quadratic",), {"b": 0.08}),
        (("dry",), {"c": 0.006}),
        (("viscous", "dry"), {"a": 0.015, "c": 0.004}),
    ],
)
def test_the_law_is_told_with_its_rate(laws: tuple[str, ...], rates: dict[str, float]) -> None:
    found = dp.ring_down(swing(1, 40.0, 0.6, **rates))
    assert found.laws == laws
    # The loss in a swing is some percent of the amplitude, whose second order the averages leave out.
    assert found.rates == pytest.approx(list(rates.values()), rel=0.03)
    assert found.period_s == pytest.approx(1.1, abs=5 * found.period_sigma_s)
    assert found.period_sigma_s < 2e-4
    assert found.amplitude_coefficient == pytest.approx(1 / 16, abs=5 * found.amplitude_coefficient_sigma)
    assert found.middle_rad == pytest.approx(0.05, abs=1e-3)
    assert found.q == pytest.approx(np.pi / found.decrement)


def test_a_linear_swing_has_the_textbook_decrement_and_q() -> None:
    found = dp.ring_down(swing(2, 30.0, 0.2, a=0.03))
    assert found.decrement == pytest.approx(0.03 * 1.1, rel=0.02)
    assert found.q == pytest.approx(np.pi / (0.03 * 1.1), rel=0.02)
    assert abs(found.decrement - 0.033) < 4 * found.decrement_sigma + 0.002 * 0.033
    assert found.swings == 26 or found.swings == 27
    assert found.to_dict()["laws"] == ["viscous"]


def test_a_wide_swing_in_gravity() -> None:
    found = dp.ring_down(swing(21, 25.0, 1.9, a=0.02))
    assert found.period_s == pytest.approx(1.1, rel=2e-4)
    assert found.amplitude_coefficient == pytest.approx(1 / 16, rel=0.02)
    assert found.rates == pytest.approx([0.02], rel=0.01)
    # Of two turning points a swing apart.
    near = int(np.argmin(np.abs(found.amplitude_rad - found.at_amplitude_rad)))
    measured = np.log(found.amplitude_rad[near - 1] / found.amplitude_rad[near + 1])
    assert found.decrement == pytest.approx(measured, rel=0.06)


def test_uncertainties_cover_the_truth() -> None:
    pulls = []
    for seed in range(3, 13):
        found = dp.ring_down(swing(seed, 15.0, 0.15, a=0.02))
        pulls.append(
            [
                (found.period_s - 1.1) / found.period_sigma_s,
                (found.decrement - 0.022) / found.decrement_sigma,
            ]
        )
    # Ten values each: their RMS scatters by 22 %.
    assert (np.sqrt(np.mean(np.square(pulls), axis=0)) < 1.7).all()


def test_what_is_no_free_swing() -> None:
    short = swing(20, 3.0, 0.3)
    with pytest.raises(AnglesError, match="which are fewer than 3 swings"):
        dp.ring_down(short)
    t = np.arange(4000) / FPS
    phi = 0.5 * np.sin(W * t + 3 * np.sin(0.6 * t))
    with pytest.raises(AnglesError, match="no single pendulum's free swing"):
        dp.ring_down(dp.LinkAngles(t, phi[:, None], np.full((t.size, 1), NOISE)))
    two = dp.LinkAngles(t, np.stack([phi, phi], axis=1), np.full((t.size, 2), NOISE), link_names=("a", "b"))
    with pytest.raises(AnglesError, match=r"angles of 2 links. Name one of a, b"):
        dp.ring_down(two)
    growing = 0.1 * np.exp(0.05 * t) * np.sin(W * t)
    with pytest.raises(AnglesError, match="the amplitude does not fall"):
        dp.ring_down(dp.LinkAngles(t, growing[:, None], np.full((t.size, 1), NOISE)))
