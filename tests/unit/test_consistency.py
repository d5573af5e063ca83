"""Fits that are given wrong constants: what the ratios say of them, and that the standard errors hold it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pydpend.damping import Consistency, DampingFit, fit_damping, parts
from pydpend.model import Model, derived

from tests.support.free_decays import TRUTH, measured, released

MODEL = derived("A")
NAMES = ("lambda", "sigma", "kappa", "a3")


def told(true: Model, given: Model = MODEL, clock: float = 1.0) -> Consistency:
    """What exact ratios of a pendulum, in seconds that are too long by ``clock``, say of the given model."""
    values = np.array([true.lambda_kg_m2, true.sigma_j, true.kappa_j, true.a3_kg_m2]) / true.psi_kg_m2
    values[1:3] /= clock**2
    ratios = dict(zip(NAMES, values.tolist(), strict=True))
    return parts.check(given, ratios, np.diag((1e-5 * values) ** 2))[0]


def with_gravity(by: float) -> Model:
    return replace(MODEL, g_m_s2=9.81 * by, sigma_j=MODEL.sigma_j * by, kappa_j=MODEL.kappa_j * by)


def test_what_is_as_given_is_said_to_be() -> None:
    found = told(MODEL)
    assert found.length is not None
    assert not found.length.off
    assert not found.contradicts
    assert found.length.measured["g_m_s2"] == pytest.approx(9.81)
    assert len(found.sentences) == 1


def test_a_wrong_gravity_is_named_with_its_factor() -> None:
    found = told(MODEL, with_gravity(1.02))
    assert found.length is not None
    # 10.006 m/s2 is nowhere on the ground, and 9.81 is: neither clock nor length is to blame.
    assert found.length.possible == ("g_m_s2",)
    assert found.length.contradicts
    assert found.likely[0].name == "g"
    assert found.likely[0].factor == pytest.approx(1 / 1.02, rel=1e-4)
    assert "g is 9.81" in found.sentences[0]


def test_a_wrong_clock_is_named_with_its_factor() -> None:
    found = told(MODEL, clock=1.01)
    assert found.length is not None
    assert found.length.possible == ("clock", "l1_m")
    assert found.likely[0].name == "clock"
    # The stated 0.17 % of l1 are 0.09 % of the clock's.
    assert found.likely[0].factor == pytest.approx(1.01, abs=1e-3)
    assert "9.617 m/s2, which is nowhere on the ground" in found.sentences[0]


def test_a_small_error_of_the_clock_is_said_though_the_length_may_be_it() -> None:
    found = told(MODEL, clock=1.001)
    assert found.length is not None
    assert found.length.off
    assert not found.length.contradicts
    assert found.length.measured["clock"] == pytest.approx(1.001, rel=1e-6)
    assert "The stated uncertainty of l1 may be all of it" in found.sentences[0]


def test_a_wrong_length_is_named_with_its_factor() -> None:
    found = told(derived("A", given={"l_u": 171.9 * 1.01}))
    assert found.likely[0].name == "l1"
    assert found.likely[0].factor == pytest.approx(1.01, rel=1e-3)


@pytest.mark.parametrize("inertia", [245000.0, 1.1 * 245000])
def test_a_heavier_lower_link_is_among_what_would_explain_it(inertia: float) -> None:
    true = derived("A", given={"m_9": 1.1 * 116, "I_9": inertia})
    found = told(true)
    assert found.contradicts
    by_name = {e.name: e for e in found.likely}
    name = "lower mass" if inertia > 245000 else "lower mass, same inertia"
    # The arm is 0.947 of the lower link, whose parts are uncertain by 1.7 %.
    assert by_name[name].factor == pytest.approx(1.1, abs=0.02)
    assert by_name[name].psi_kg_m2 == pytest.approx(true.psi_kg_m2, rel=0.01)
    _, together = found.constants["psi"]
    assert abs(together.value - true.psi_kg_m2) < 2 * together.sigma


def test_constants_without_uncertainties_are_taken_for_a_hundredth_and_that_is_said() -> None:
    found = told(derived("A", given={"m_9": 1.1 * 116}), replace(MODEL, covariance=None))
    assert found.contradicts
    assert "uncertainties of 1 %, since it states none" in found.sentences[1]


def test_constants_without_masses_have_no_masses_to_blame() -> None:
    bare = replace(MODEL, m1_kg=0.0, m2_kg=0.0, covariance=None)
    found = told(derived("A", given={"m_9": 1.1 * 116}), bare)
    assert {e.name for e in found.explanations} == {"parts", "clock", "g"}


@pytest.fixture(scope="module")
def heavy() -> DampingFit:
    true = derived("A", given={"m_9": 1.1 * 116, "I_9": 1.1 * 245000})
    return fit_damping(measured(released(3, 12.0, 500.0, model=true), 3, 0.05), MODEL, laws="paper")


def test_standard_errors_hold_what_a_wrong_mass_does(heavy: DampingFit) -> None:
    told = heavy.consistency
    assert told is not None
    assert told.contradicts
    for name, e in heavy.coefficients.items():
        assert abs(e.value - getattr(TRUTH, name)) < 2 * e.sigma, name
    # psi alone is off by 5 %, and that is in every coefficient but the load's.
    assert heavy.coefficients["mu_q1"].sigma > 0.03 * TRUTH.mu_q1
    assert any(note.startswith("warning: the fitted ratios") for note in heavy.notes)


def test_the_covariance_is_that_of_the_standard_errors_and_goes_there_and_back(heavy: DampingFit) -> None:
    for name, e in heavy.coefficients.items():
        at = heavy.names.index(name)
        assert heavy.covariance[at, at] == pytest.approx(e.sigma**2)
    again = DampingFit.from_json(heavy.to_json())
    assert again.consistency == heavy.consistency
