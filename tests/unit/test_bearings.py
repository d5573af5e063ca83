"""Bearing kinematics of Sections 4.2 to 4.4."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from pydpend.bearings import ball_angles, ball_sum, random_phase, rates, ratios, reference_ball
from pydpend.components import Balls, configuration, values
from pydpend.errors import ModelError


def test_ratios_of_the_paper_s_bearing() -> None:
    r = ratios(11.062, 3.932)
    # Errata section 0.
    assert (r.d11, r.d12, r.c11, r.c12, r.radius) == pytest.approx(
        (0.36888, 0.63112, 1.40666, 2.40666, 7.497), abs=5e-6
    )


def test_rates_satisfy_both_contacts_and_the_second_derivation() -> None:
    """Eqs. 4 and 7; and Eqs. 14 and 17 with omega_C + omega_D, as Eq. 10's sign demands (erratum 23)."""
    d_in, d_ball, w_a, w_b = sp.symbols("d_in d_ball w_a w_b", positive=True)
    carrier, ball = rates(d_in, d_ball, w_a, w_b)
    assert sp.simplify(w_a * d_in - (d_in + d_ball) * carrier - d_ball * ball) == 0
    assert sp.simplify((d_in + d_ball) * carrier - d_ball * ball - (d_in + 2 * d_ball) * w_b) == 0
    assert sp.simplify((w_a - carrier) * d_in - (ball + carrier) * d_ball) == 0
    assert sp.simplify(-(ball + carrier) * d_ball / 2 - (w_b - carrier) * (d_in / 2 + d_ball)) == 0


def test_a_bearing_turning_as_one_body_does_not_roll() -> None:
    """Both races at the same rate: the carrier goes with them, and the ball's spin is that rate (-omega_C = w)."""
    carrier, ball = rates(11.062, 3.932, 3.0, 3.0)
    assert carrier == pytest.approx(3.0)
    assert -ball == pytest.approx(3.0)


@pytest.mark.parametrize("number", [2, 3, 7, 9])
def test_the_ball_sum_vanishes_whatever_the_phase(number: int) -> None:
    """Erratum 6: A1 and A2 multiply exactly zero, so the random phase of Section 4.4 has no effect."""
    rng = np.random.default_rng(number)
    phase = random_phase(number, rng, 200)
    assert np.all((phase >= 0) & (phase < 2 * np.pi / number))
    phi = rng.uniform(-10, 10, 200)
    # `number` cosines of order one, summed in double precision.
    assert np.max(np.abs(ball_sum(ball_angles(phase, number), phi))) < 1e-14 * number


@pytest.mark.parametrize("number", [7, 9])
def test_one_missing_ball_leaves_its_cosine(number: int) -> None:
    """And so the printed sum over 8 of configuration B's 9 balls: minus the last one's cosine, amplitude 1."""
    angles = ball_angles(np.linspace(0, 6, 50), number)
    phi = np.linspace(-3, 3, 50)
    left = ball_sum(angles[:, :-1], phi)
    np.testing.assert_allclose(left, -np.cos(angles[:, -1] - phi), atol=1e-13)


def test_what_one_missing_ball_would_do_to_the_energy() -> None:
    """The cross term of one ball less: A1 w1^2 + A2 w1 w2 times a cosine, 142.6 and 244.0 g mm2 (errata)."""
    pendulum = configuration("A")
    part = next(p for p in pendulum.parts if p.item == "8c")
    assert isinstance(part.place, Balls)
    q = values(pendulum.quantities)

    def cross(w1: float, w2: float) -> float:
        return float(
            part.kinetic(q, 0.3, 1.1, w1, w2, np.cos, ball_sum=1.0)
            - part.kinetic(q, 0.3, 1.1, w1, w2, np.cos)
        )

    a1 = cross(1.0, 0.0)
    assert a1 == pytest.approx(142.6, abs=0.05)
    assert cross(1.0, 1.0) - a1 == pytest.approx(244.0, abs=0.05)


def test_the_reference_ball_follows_its_races() -> None:
    """Eq. 19 against integrating the carrier's rate."""
    t = np.linspace(0, 2, 2001)
    inner, outer = np.sin(3 * t), 0.4 * t**2
    carrier, _ = rates(11.062, 3.932, 3 * np.cos(3 * t), 0.8 * t)
    integrated = 0.2 + np.concatenate([[0.0], np.cumsum((carrier[1:] + carrier[:-1]) / 2 * np.diff(t))])
    # The trapezium rule at 1 ms is good to h^2/12 times the second derivative's integral: 1e-6.
    np.testing.assert_allclose(reference_ball(0.2, 11.062, 3.932, inner, outer), integrated, atol=2e-6)


def test_a_bearing_has_balls() -> None:
    with pytest.raises(ModelError, match="0 balls"):
        ball_angles(0.0, 0)
