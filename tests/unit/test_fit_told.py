"""Figures and words of a fit: the measured energy, the small oscillations, shares that nothing determines."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pydpend.cli.fit import describe
from pydpend.damping import DampingFit, EnergyCurve, Estimate, fit_damping
from pydpend.fit_folder import FitFolder
from pydpend.model import Damping, derived
from pydpend.simulation import simulate

from tests.support.free_decays import measured, released, with_gaps

MODEL = derived("A")


@pytest.fixture(scope="module")
def fit() -> DampingFit:
    angles = with_gaps(measured(released(3, 8.0, 500.0), 3, 0.05), 3, 0.05)
    return fit_damping(angles, MODEL, laws="mu_v2,mu_q1,mu_q2")


def test_the_measured_energy_is_the_measured_angles_own(fit: DampingFit) -> None:
    curve = fit.energy[0]
    assert curve.measured_j is not None
    seen = np.isfinite(curve.measured_j)
    # A twentieth is missing in gaps, and is not made up.
    assert 0.9 < seen.mean() < 1.0
    off = curve.measured_j[seen] - curve.energy_j[seen]
    # Rates by the smoother have some 0.05 rad/s, times 1e-2 kg m2 and 10 rad/s: 5 mJ; the fitted motion has none of it.
    assert 1e-5 < off.std() < 1e-2
    assert abs(off.mean()) < 2e-3


def test_the_measured_energy_is_written_and_read(fit: DampingFit, tmp_path: Path) -> None:
    folder = FitFolder(tmp_path)
    folder.write(fit)
    again = folder.energy(0)
    assert isinstance(again, EnergyCurve)
    assert again.measured_j is not None
    assert fit.energy[0].measured_j is not None
    assert np.allclose(again.measured_j, fit.energy[0].measured_j, equal_nan=True)


def test_modes_are_measured_only_where_the_links_swing_little(fit: DampingFit) -> None:
    given = fit.inputs[0]
    # Eight seconds after a release near the upright the lower link still tumbles.
    assert max(given.tail_swing_deg) > 20
    assert given.tail_modes_hz == ()
    assert not any("measured in the last seconds" in line for line in describe(fit))
    t = np.arange(5001) / 500
    small = simulate(MODEL, Damping(mu_v1=2e-5, mu_v2=5e-6), [0.12, 0.1, 0.0, 0.0], t)
    rng = np.random.default_rng(2)
    angles = replace(
        measured(released(3, 10.0, 500.0), 3, 0.05), phi_rad=small.phi_rad + rng.normal(0, 1e-3, (5001, 2))
    )
    calm = fit_damping(angles, MODEL, laws="mu_v1,mu_v2")
    assert max(calm.inputs[0].tail_swing_deg) < 15
    assert calm.inputs[0].tail_modes_hz == pytest.approx(calm.modes_hz, rel=2e-3)
    assert any("swinging by up to" in line and "Hz" in line for line in describe(calm))


def test_shares_that_nothing_determines_are_words(fit: DampingFit) -> None:
    none = Estimate(float("nan"), float("nan"), "1")
    wide = Estimate(0.0, 16.67, "1")
    told = describe(replace(fit, shares={"law": {"viscous": none}, "joint": {"upper": wide}}))
    assert "energy by law: viscous none (no energy was lost to these laws)" in told
    assert "energy by joint: upper not determined" in told
    assert not any("nan" in line for line in told)


def test_the_ten_know_of_a_misfit() -> None:
    """Energies that scatter by more than their errors make the ten's errors larger, as those of the six."""
    angles = measured(released(5, 12.0, 500.0), 5, 0.05)
    wrong = replace(MODEL, kappa_j=1.002 * MODEL.kappa_j)
    right, off = (
        fit_damping(angles, m, "energy", "paper", ten_coefficients=True).ten for m in (MODEL, wrong)
    )
    assert right is not None
    assert off is not None
    assert off.chi2 > 3 > right.chi2
    assert "the standard errors are larger" in off.warning
    assert "the standard errors are larger" not in right.warning
    # Twelve energies, eleven unknowns of which some are not determined: the scale is chi-square's root.
    growth = off.values["mu_q1"].sigma / right.values["mu_q1"].sigma
    assert growth == pytest.approx((off.chi2 / max(1.0, right.chi2)) ** 0.5, rel=0.3)
