"""Fits without any constants: everything over psi."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pydpend.damping import DampingFit, fit_damping
from pydpend.damping.of_motion import pendulum_of
from pydpend.errors import FitError
from pydpend.kinematics import LinkAngles
from pydpend.model import derived, of_ratios

from tests.support.free_decays import TRUTH, measured, released

MODEL = derived("A")
NO_LOAD = replace(TRUTH, rmu1=0.0, rmu2=0.0, tau_c1=2e-4, tau_c2=3e-5)


@pytest.fixture(scope="module")
def angles() -> LinkAngles:
    return measured(released(21, 12.0, 500.0, NO_LOAD), 21, 0.05)


@pytest.fixture(scope="module")
def fit(angles: LinkAngles) -> DampingFit:
    return fit_damping(angles, of_ratios(), prediction=True)


def test_the_motion_alone_starts_near_the_ratios(angles: LinkAngles) -> None:
    found = pendulum_of([angles])
    for name in ("lambda_kg_m2", "sigma_j", "kappa_j", "a3_kg_m2"):
        # Seeds 0 to 2 gave up to 0.15 %; a start within 2 % is as good as a model's.
        expected = getattr(MODEL, name) / MODEL.psi_kg_m2
        assert getattr(found, name) == pytest.approx(expected, rel=0.005), name
    assert found.l1_m == pytest.approx(MODEL.l1_m, rel=0.005)
    assert not found.scale_known


def test_coefficients_are_over_psi_and_true(fit: DampingFit) -> None:
    assert fit.status == "converged"
    assert not fit.scale_known
    assert set(fit.coefficients) == {"mu_v1", "mu_v2", "mu_q1", "mu_q2", "tau_c1", "tau_c2", "strip_drag"}
    for name, e in fit.coefficients.items():
        assert abs(e.value - getattr(NO_LOAD, name) / MODEL.psi_kg_m2) < 4 * e.sigma, name
    units = {name: e.unit for name, e in fit.coefficients.items()}
    assert (units["mu_v1"], units["mu_q1"], units["tau_c1"]) == ("1/s", "1", "1/s2")
    assert any("rmu1 and rmu2 left out" in note for note in fit.notes)
    assert any("the joints are 171." in note or "the joints are 172" in note for note in fit.notes)
    # Noise is 0.05 deg, and so is the prediction of what was not fitted.
    assert fit.prediction["1"].rms_deg[0] < 0.06


def test_a_mass_given_later_makes_it_si(fit: DampingFit) -> None:
    weight = MODEL.kappa_j
    psi = weight / fit.ratios["kappa"].value
    known = DampingFit.from_json(fit.to_json()).scaled(psi, 0.01 * psi)
    for name, e in known.coefficients.items():
        before = fit.coefficients[name]
        assert e.value == pytest.approx(before.value * psi)
        assert e.sigma == pytest.approx(np.hypot(before.sigma * psi, 0.01 * e.value))
    assert known.coefficients["mu_v1"].unit == "N m s"
    assert known.parameters["sigma"] == pytest.approx(MODEL.sigma_j, rel=1e-3)
    with pytest.raises(FitError, match="not over psi"):
        known.scaled(psi)


def test_one_link_needs_no_constants(angles: LinkAngles) -> None:
    t = np.arange(5001) / 500
    from pydpend.model import Damping, Model
    from pydpend.simulation import simulate

    rod = Model.one_link(0.002, 0.3)
    motion = simulate(rod, Damping(mu_v1=2e-5, mu_q1=1e-5), [2.0, 0.0, 0.0, 0.0], t)
    phi = motion.phi_rad[:, :1] + np.random.default_rng(4).normal(0, 1e-3, (t.size, 1))
    fit = fit_damping(LinkAngles(t, phi, np.full_like(phi, 1e-3)), of_ratios(), laws="mu_v1,mu_q1")
    assert abs(fit.ratios["sigma"].value - 150) < 4 * fit.ratios["sigma"].sigma
    assert abs(fit.coefficients["mu_v1"].value - 0.01) < 4 * fit.coefficients["mu_v1"].sigma


def test_what_needs_masses_is_refused_with_a_way_on(angles: LinkAngles) -> None:
    with pytest.raises(FitError, match="rmu1 is a friction in proportion to the load"):
        fit_damping(angles, of_ratios(), laws="mu_v1,rmu1")
    with pytest.raises(FitError, match="this fit takes them from the model"):
        fit_damping(angles, of_ratios(), "energy", "mu_v1,mu_q1")
    with pytest.raises(FitError, match="nothing of the links is known"):
        fit_damping(angles, of_ratios(), pinned=True)
