"""A law that was left out: it is named, and the standard errors hold what it does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pydpend.damping import DampingFit, fit_damping
from pydpend.damping.omitted import left_out
from pydpend.model import derived

from tests.support.free_decays import TRUTH, measured, released

MODEL = derived("A")
DRY = replace(TRUTH, tau_c1=2e-3)


@pytest.fixture(scope="module")
def fit() -> DampingFit:
    return fit_damping(measured(released(3, 12.0, 500.0, DRY), 3, 0.05), MODEL, laws="paper")


def test_the_law_that_was_left_out_is_named_with_its_size(fit: DampingFit) -> None:
    assert fit.omitted is not None
    assert fit.omitted.explains
    found = fit.omitted.found["tau_c1"]
    assert abs(found.value - DRY.tau_c1) < 4 * found.sigma
    assert any("explained by a law that was left out: tau_c1" in note for note in fit.notes)


def test_standard_errors_hold_what_it_does(fit: DampingFit) -> None:
    far = 0.0
    for name, e in fit.coefficients.items():
        off = abs(e.value - getattr(DRY, name))
        assert off < 2 * e.sigma, name
        at = fit.names.index(name)
        assert fit.covariance[at, at] == pytest.approx(e.sigma**2)
        assert fit.omitted is not None
        far = max(far, off / max((e.sigma**2 - fit.omitted.sigma[name] ** 2) ** 0.5, 1e-300))
    # Without it the errors were tens of standard errors.
    assert far > 10
    assert DampingFit.from_json(fit.to_json()).omitted == fit.omitted


def test_a_bias_of_the_angles_is_named_and_in_the_errors() -> None:
    angles = measured(released(14, 12.0, 500.0), 14, 0.05)
    phi = angles.phi_rad
    bias = np.radians(0.15) * np.column_stack([np.cos(2 * phi[:, 0]), np.sin(3 * phi[:, 1])])
    fit = fit_damping(replace(angles, phi_rad=phi + bias), MODEL, laws="mu_v2,mu_q1,mu_q2,rmu1,rmu2,mu_v1")
    assert fit.within_noise is False
    assert fit.omitted is not None
    assert fit.omitted.tried == ("angle_maps",)
    assert fit.omitted.explains
    assert "a bias of the angles that repeats with them" in fit.notes[-1]
    held = [abs(e.value - getattr(TRUTH, n)) < 1.96 * e.sigma for n, e in fit.coefficients.items()]
    # Without it one in four held.
    assert sum(held) >= 5


def test_nothing_is_tried_where_the_model_is_right() -> None:
    fit = fit_damping(measured(released(3, 8.0, 500.0), 3, 0.05), MODEL, laws="paper")
    assert fit.within_noise
    assert fit.omitted is None


def test_only_laws_that_can_be_fitted_are_tried() -> None:
    one = left_out(("mu_v1",), (), links=1, scale_known=False)
    assert one[0] == ("mu_q1", "tau_c1")
    assert "added_inertia" not in one[1]
    assert left_out(("mu_v1", "mu_q1", "rmu1", "tau_c1"), (), links=1, scale_known=True)[0] == ("offset1",)
