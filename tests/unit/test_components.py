"""The reduced constants derived with SymPy from positions and energies, and their uncertainties."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sympy as sp
from pydpend.components import Cage, Part, Rigid, configuration, covariance, total, values
from pydpend.errors import ModelError
from pydpend.model import CONSTANTS, G_MM_S2, derived, jacobian, reduced_constants

P1, P2, W1, W2, G, LAMBDA = sp.symbols("p1 p2 w1 w2 g Lambda")
CASES = [("A", False), ("A", True), ("B", False)]


def symbols_of(config: str, trackers: bool = False) -> dict[str, Any]:
    return {s: sp.Symbol(s, positive=True) for s in configuration(config, trackers=trackers).quantities}


def velocity(centre: Any) -> Any:
    """By the chain rule."""
    return centre.diff(P1) * W1 + centre.diff(P2) * W2


def energies_from_positions(part: Part, q: dict[str, Any]) -> tuple[Any, Any]:
    """Kinetic and potential energy of one kind of part, from the positions of its centres alone."""
    m = 0 if part.mass is None else q[part.mass]
    inertia = 0 if part.inertia is None else q[part.inertia]
    elbow = sp.Matrix([q["l_u"] * sp.sin(P1), -q["l_u"] * sp.cos(P1)])
    origin = sp.zeros(2, 1)
    if isinstance(part.place, Rigid):
        along = sp.Integer(0) if part.place.along is None else q[part.place.along]
        phi, spin = ((P1, W1), (P2, W2))[part.place.body - 1]
        centre = (elbow if part.place.body == 2 else origin) + along * sp.Matrix([sp.sin(phi), -sp.cos(phi)])
        if part.place.distance is not None:
            # Many parts at places whose mean is `along` and whose mean square is `distance`^2.
            inertia = inertia + m * (q[part.place.distance] ** 2 - along**2)
        v = velocity(centre)
        return part.count * (m * (v.T * v)[0] + inertia * spin**2) / 2, part.count * m * G * centre[1]
    races = part.place.races
    d_in, d_ball = q[races.d_inner], q[races.d_ball]
    of = (sp.Integer(0), W1, W2)
    # No slip at both contacts: the surface speeds of Eqs. 4 and 7, solved here again.
    carrier, ball = sp.symbols("carrier ball")
    solved = sp.solve(
        [
            of[races.inner] * d_in - (d_in + d_ball) * carrier - d_ball * ball,
            (d_in + d_ball) * carrier - d_ball * ball - (d_in + 2 * d_ball) * of[races.outer],
        ],
        [carrier, ball],
    )
    centre = elbow if races.at_elbow else origin
    v = velocity(centre)
    if isinstance(part.place, Cage):
        kinetic = (m * (v.T * v)[0] + inertia * solved[carrier] ** 2) / 2
        return part.count * kinetic, part.count * m * G * centre[1]
    # One ball at the angle p1 + delta; all of them: Lambda for the sum of cos(delta), nothing for that of sines.
    delta = sp.Symbol("delta")
    radius = (d_in + d_ball) / 2
    v = v + radius * solved[carrier] * sp.Matrix([sp.cos(P1 + delta), sp.sin(P1 + delta)])
    square = sp.expand(sp.trigsimp(sp.expand(sp.expand_trig(sp.expand((v.T * v)[0])))))
    number = part.place.number
    constant, cosine = square.coeff(sp.cos(delta), 0), square.coeff(sp.cos(delta), 1)
    assert sp.simplify(square - constant - cosine * sp.cos(delta)) == 0
    kinetic = (m * (number * constant + LAMBDA * cosine) + number * inertia * solved[ball] ** 2) / 2
    # The centre of all balls is the bearing's.
    return part.count * kinetic, part.count * number * m * G * centre[1]


@pytest.mark.parametrize(("config", "trackers"), CASES)
def test_every_part_says_the_energies_of_its_positions(config: str, trackers: bool) -> None:
    """Sections 4.1 and 8.1 item by item (errata 5, 7, 8, 21): residual exactly zero."""
    q = symbols_of(config, trackers)
    for part in configuration(config, trackers=trackers).parts:
        t, v = energies_from_positions(part, q)
        own_t = part.kinetic(q, P1, P2, W1, W2, sp.cos, LAMBDA)
        own_v = part.potential(q, P1, P2, G, sp.cos)
        assert sp.simplify(sp.trigsimp(sp.expand(sp.expand_trig(sp.expand(t - own_t))))) == 0, part.name
        # The zero of a potential is free.
        assert all(sp.simplify(sp.expand(sp.diff(v - own_v, p))) == 0 for p in (P1, P2)), part.name


@pytest.mark.parametrize(("config", "trackers"), CASES)
def test_constants_are_the_coefficients_of_the_summed_energies(config: str, trackers: bool) -> None:
    """Eqs. 20 and 21 in the form of Eqs. 26 and 27, with the ball sum zero: residual exactly zero."""
    q = symbols_of(config, trackers)
    parts = configuration(config, trackers=trackers).parts
    kinetic = sum(part.kinetic(q, P1, P2, W1, W2, sp.cos, 0) for part in parts)
    potential = sum(part.potential(q, P1, P2, G, sp.cos) for part in parts)
    ours = dict(zip(CONSTANTS, reduced_constants(parts, q, G), strict=True))
    model_t = (
        ours["psi_kg_m2"] * W1**2
        + ours["lambda_kg_m2"] * W2**2
        + (ours["zeta_kg_m2"] + ours["a3_kg_m2"] * sp.cos(P2 - P1)) * W1 * W2
    )
    model_v = ours["sigma_j"] * (1 - sp.cos(P1)) + ours["kappa_j"] * (1 - sp.cos(P2))
    assert sp.simplify(sp.together(sp.expand(kinetic - model_t))) == 0
    assert sp.expand(potential - model_v) == 0


@pytest.mark.parametrize("number", [7, 9])
def test_the_ball_sum_is_zero_exactly(number: int) -> None:
    """sum exp(2 pi i k / N) = 0: the polynomial 1 + z + ... + z^(N-1) is a multiple of the one that the N-th root
    of unity satisfies (erratum 6)."""
    z = sp.Symbol("z")
    assert sp.rem(sum(z**k for k in range(number)), sp.cyclotomic_poly(number, z), z) == 0
    assert sp.rem(sum(z**k for k in range(number - 1)), sp.cyclotomic_poly(number, z), z) != 0


def test_constants_are_the_closed_forms_of_the_errata() -> None:
    """Errata section 0, configuration A, typed again here."""
    q = symbols_of("A")
    v = dict(q)
    pitch = v["d_I"] + v["d_B"]
    d11, d12 = v["d_I"] / (2 * pitch), (v["d_I"] + 2 * v["d_B"]) / (2 * pitch)
    c11, c12 = v["d_I"] / (2 * v["d_B"]), (v["d_I"] + 2 * v["d_B"]) / (2 * v["d_B"])
    r = pitch / 2
    elbow = v["m_6"] + v["m_7"] + v["m_81"] + v["m_82"] + 7 * v["m_83"] + v["m_84"] + v["m_9"]
    psi = (
        v["I_1"] + v["I_2"] + 2 * v["I_31"] + 2 * v["I_32"] * d11**2
        + 14 * (v["m_33"] * (d11 * r) ** 2 + v["I_33"] * c11**2)
        + v["I_4"] + v["m_4"] * v["r_4"] ** 2 + 2 * (v["I_5"] + v["m_5"] * v["r_5"] ** 2)
        + v["I_6"] + v["I_7"] + v["I_81"] + v["I_82"] * d11**2
        + 7 * (v["m_83"] * (d11 * r) ** 2 + v["I_83"] * c11**2) + v["l_u"] ** 2 * elbow
    ) / 2  # fmt: skip
    lam = (
        v["I_82"] * d12**2 + 7 * (v["m_83"] * (d12 * r) ** 2 + v["I_83"] * c12**2)
        + v["I_84"] + v["I_9"] + v["m_9"] * v["r_9"] ** 2
    ) / 2  # fmt: skip
    zeta = (v["I_82"] + 7 * v["m_83"] * r**2) * d11 * d12 - 7 * v["I_83"] * c11 * c12
    a3 = v["l_u"] * v["m_9"] * v["r_9"]
    sigma = G * (v["m_4"] * v["r_4"] + 2 * v["m_5"] * v["r_5"] + v["l_u"] * elbow)
    ours = reduced_constants(configuration("A").parts, q, G)
    for mine, theirs in zip(ours, (psi, lam, zeta, a3, sigma, G * v["m_9"] * v["r_9"]), strict=False):
        assert sp.simplify(mine - theirs) == 0


def test_covariance_agrees_with_monte_carlo() -> None:
    """Linear propagation against 200000 samples; the sampling error of a standard deviation is 0.16 %."""
    pendulum = configuration("A")
    q = values(pendulum.quantities)
    cov = covariance(pendulum.quantities, pendulum.identical)
    rng = np.random.default_rng(1)
    samples = rng.multivariate_normal(list(q.values()), cov, size=200_000, method="svd")
    drawn: dict[str, Any] = dict(zip(q, samples.T, strict=True))
    results = np.array(
        [np.broadcast_to(c, 200_000) for c in reduced_constants(pendulum.parts, drawn, G_MM_S2)]
    )
    model = derived("A")
    assert model.covariance is not None
    scale = np.array([1e-9] * 6 + [1e-3] * 3)
    sampled = np.cov(results * scale[:, None])
    for i in range(len(CONSTANTS)):
        # Products of two uncertain numbers add second-order terms below 1 % of the variance.
        assert np.sqrt(sampled[i, i]) == pytest.approx(np.sqrt(model.covariance[i, i]), rel=0.01)
    rho = np.corrcoef(results)
    sigma = np.sqrt(np.diag(model.covariance))
    np.testing.assert_allclose(rho, model.covariance / np.outer(sigma, sigma), atol=0.01)


def test_identical_parts_are_fully_correlated() -> None:
    """The balls of all three bearings were weighed once: their shares of psi add as amounts, not as squares."""
    pendulum = configuration("A")
    cov = covariance(pendulum.quantities, pendulum.identical)
    symbols = list(pendulum.quantities)
    i, j = symbols.index("m_33"), symbols.index("m_83")
    assert cov[i, j] == pytest.approx(cov[i, i]) == pytest.approx(0.01)
    row = jacobian(pendulum.parts, values(pendulum.quantities), G_MM_S2)[0]
    assert row[i] > 0 < row[j]


def test_configuration_b_works_with_given_values() -> None:
    """Its constants by hand for a made set of parts, and its refusal of a name it does not know."""
    given = dict.fromkeys(configuration("B").quantities, 1.0) | {
        "d_I": 12.0,
        "d_B": 4.0,
        "l_u": 100.0,
        "r_8": 50.0,
    }
    given |= {"m_8": 100.0, "I_8": 1e5, "m_1": 200.0, "I_1": 1e6, "r_1": 50.0}
    model = derived("B", given=given)
    assert model.kappa_j == pytest.approx(9810 * 100 * 50 * 1e-9)
    assert model.a3_kg_m2 == pytest.approx(100 * 50 * 100 * 1e-9)
    assert model.m2_kg == pytest.approx((100 + 1 + 1 + 2 + 1 + 2) * 1e-3)
    with pytest.raises(ModelError, match="'m_99'"):
        derived("B", given=given | {"m_99": 1.0})
    with pytest.raises(ModelError, match="configuration 'C'"):
        derived("C")


def test_total_is_the_sum_of_the_parts() -> None:
    pendulum = configuration("A")
    q = values(pendulum.quantities)
    assert total(pendulum.parts, q).psi == pytest.approx(sum(p.reduced(q).psi for p in pendulum.parts))
