"""A wrong zero of the angles: the fit finds its own, the coefficients do not feel it, and people are told."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pydpend.cli import main
from pydpend.damping import DampingFit, fit_damping
from pydpend.damping.plausible import check_model
from pydpend.damping.recording import FittedZero
from pydpend.damping.stored import StoredFit
from pydpend.errors import FitError
from pydpend.kinematics import LinkAngles, angles, write_angles
from pydpend.model import Damping, Model, derived
from pydpend.report import damping as told
from pydpend.simulation import simulate

from tests.support import two_links as rig
from tests.unit.test_hanging import BAR, held

MODEL = derived("A")
TRUTH = Damping(mu_v1=2e-4, mu_v2=5e-5, tau_c1=1e-3)
LAWS = ("mu_v1", "mu_v2", "tau_c1")
NOISE_RAD = np.radians(0.05)


def swung(seconds: float = 8.0) -> LinkAngles:
    """Let go at (50, 50) deg, with white noise, the zero right."""
    t = np.arange(round(seconds * 250)) / 250
    phi = simulate(MODEL, TRUTH, [*np.radians([50.0, 50.0]), 0, 0], t, tolerance=1e-9).phi_rad
    phi = phi + NOISE_RAD * np.random.default_rng(51).standard_normal(phi.shape)
    return LinkAngles(t, phi, np.full(phi.shape, NOISE_RAD), name="swing")


def moved(off_deg: float | tuple[float, float]) -> LinkAngles:
    given = swung()
    return replace(given, phi_rad=given.phi_rad + np.radians(off_deg))


@pytest.fixture(scope="module")
def right() -> DampingFit:
    fit = fit_damping(swung(), MODEL, laws=LAWS)
    assert fit.status == "converged"
    return fit


@pytest.mark.parametrize(
    "off_deg", [(1.0, -1.0), (3.0, 3.0), (10.0, -10.0), (0.0, 15.0), (50.0, 50.0), (180.0, 180.0)]
)
def test_a_wrong_zero_changes_no_coefficient_and_is_told(
    right: DampingFit, off_deg: tuple[float, float]
) -> None:
    fit = fit_damping(moved(off_deg), MODEL, laws=LAWS)
    assert fit.status == "converged"
    # The same angles but for a constant that is fitted: only where the iteration stops differs.
    assert fit.chi2 == pytest.approx(right.chi2, abs=1e-3)
    for name, found in fit.coefficients.items():
        assert abs(found.value - right.coefficients[name].value) < 0.1 * found.sigma, name
        assert abs(found.value - getattr(TRUTH, name)) < 4 * found.sigma, name
    given = fit.inputs[0]
    turned = (np.array(given.zeros_deg) - off_deg + 180) % 360 - 180
    np.testing.assert_array_less(np.abs(turned), 5 * np.array(given.zeros_sigma_deg))
    assert given.zeros_off == tuple(abs(v) > 0.5 for v in off_deg)
    words = " and ".join(f"{abs(v):.1f} deg (phi{j})" for j, v in enumerate(off_deg, 1) if v)
    assert f"swing: the zero was off by {words}; " in " ".join(fit.notes)
    (warning,) = [w for w in told.warnings(fit) if "the zero of its angles was off by" in w]
    assert warning.startswith("swing")


def test_a_right_zero_is_not_spoken_of(right: DampingFit) -> None:
    assert right.inputs[0].zeros_off == (False, False)
    assert not any("zero was off" in note for note in right.notes)
    assert not any("zero of its angles" in w for w in told.warnings(right))


def test_the_energy_fit_and_a_prediction_have_their_own_zero_too(right: DampingFit) -> None:
    few, wrong = (fit_damping(a, MODEL, "energy", LAWS) for a in (swung(), moved(30.0)))
    for name, found in wrong.coefficients.items():
        assert abs(found.value - few.coefficients[name].value) < 0.1 * found.sigma, name
    assert wrong.inputs[0].zeros_off == (True, True)
    predicted = StoredFit.of(right).predict(moved(30.0), (0.5,))
    assert np.degrees(predicted.zeros_rad) == pytest.approx([30.0, 30.0], abs=0.1)
    assert predicted.in_window["0.5"].rms_deg == pytest.approx([0.05, 0.05], rel=0.1)


@pytest.mark.parametrize("off_deg", [2.0, -10.0, 70.0])
def test_a_wrong_zero_of_a_bar(off_deg: float) -> None:
    bar = Model.one_link(0.00128, 0.24, 0.3)
    t = np.arange(2000) / 250
    phi = simulate(bar, Damping(mu_v1=2e-4, tau_c1=1e-3), [0.7, 0, 0, 0], t, tolerance=1e-9).phi_rad[:, :1]
    phi = phi + np.radians(off_deg) + NOISE_RAD * np.random.default_rng(52).standard_normal(phi.shape)
    fit = fit_damping(LinkAngles(t, phi, np.full(phi.shape, NOISE_RAD), name="bar"), bar, laws="mu_v1,tau_c1")
    assert fit.coefficients["mu_v1"].value == pytest.approx(2e-4, abs=4 * fit.coefficients["mu_v1"].sigma)
    assert f"bar: the zero was off by {abs(off_deg):.1f} deg; " in " ".join(fit.notes)


def test_a_zero_by_the_pictures_vertical_gives_the_right_damping() -> None:
    """Held at (50, 50) deg, let go and cut before it hangs, the camera rolled by 3 deg."""
    t = np.arange(2000) / 250
    free = t >= 0.6
    phi = np.tile(np.radians([50.0, 50.0]), (t.size, 1))
    phi[free] = simulate(MODEL, TRUTH, [*phi[0], 0, 0], t[free], tolerance=1e-9).phi_rad
    roll = np.radians(3.0)
    found = angles(rig.film(t, phi + roll, 53, reference_rad=(roll, roll)), zero="vertical")
    fit = fit_damping(found, MODEL, laws=LAWS)
    assert fit.status == "converged"
    for name, estimate in fit.coefficients.items():
        assert abs(estimate.value - getattr(TRUTH, name)) < 4 * estimate.sigma, name
    given = fit.inputs[0]
    np.testing.assert_allclose(given.zeros_stated_sigma_deg, np.degrees(found.meta["zero"]["sigma_rad"]))
    # Three degrees of roll and 0.9 of the upper link's line of joints, less than five of the stated degree.
    assert given.zeros_deg[0] == pytest.approx(3.9, abs=0.2)
    assert given.zeros_off == (False, False)


@pytest.mark.parametrize(
    ("deg", "off_deg"), [((10.0, 10.0), 0.0), ((10.0, 10.0), -9.5), ((3.0,), 0.0), ((30.0, -30.0), 5.0)]
)
def test_a_hold_is_no_part_of_the_free_decay(deg: tuple[float, ...], off_deg: float) -> None:
    """Held for a second and let go gently, so that no rate tells the release; the zero of the angles right or wrong."""
    laws = ("mu_v1", "tau_c1")
    truth = Damping(mu_v1=2e-4, tau_c1=2e-4)
    t, phi = held(deg, 6.0, damping=truth)
    phi = phi + np.radians(off_deg) + NOISE_RAD * np.random.default_rng(54).standard_normal(phi.shape)
    model = MODEL if len(deg) == 2 else BAR
    fit = fit_damping(LinkAngles(t, phi, np.full(phi.shape, NOISE_RAD), name="held"), model, laws=laws)
    assert fit.status == "converged"
    assert fit.inputs[0].start_s > 1.1
    assert abs(fit.chi2 - 1) < 0.08
    for name in laws:
        found = fit.coefficients[name]
        assert abs(found.value - getattr(truth, name)) < 4 * found.sigma, name


def test_a_zero_is_off_by_its_own_and_the_stated_uncertainty_together() -> None:
    def off(zero_deg: float, sigma_deg: float, stated_deg: float) -> bool:
        return bool(FittedZero(*(np.radians([v]) for v in (zero_deg, sigma_deg, stated_deg))).off[0])

    assert off(0.6, 0.01, np.nan)
    assert not off(0.4, 0.01, 0.001)
    assert not off(4.9, 0.1, 1.0)
    assert off(5.1, 0.1, 1.0)
    assert not off(3.0, 1.0, np.nan)
    assert off(3.0, np.nan, np.nan)


def test_wrong_constants_are_refused_for_what_is_wrong_with_them() -> None:
    given = moved(2.0)
    wrong = replace(MODEL, kappa_j=3 * MODEL.kappa_j)
    track, span = (given.t_s, given.phi_rad, given.sigma_rad), (0.0, 8.0)
    for chi2, said in (
        (1.2, "although nothing drives it (its"),
        (7.3, "chi-square is 7.3, where noise alone"),
    ):
        with pytest.raises(FitError, match="goes up and down") as refused:
            check_model(track, span, wrong, "swing", chi2)
        assert said in str(refused.value)


def test_the_command_line_says_by_how_much_the_zero_was_off(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_angles(moved(10.0), tmp_path / "wrong.parquet")
    line = [
        "fit",
        str(tmp_path / "wrong.parquet"),
        "--laws",
        "mu_v1,mu_v2,tau_c1",
        "-o",
        str(tmp_path / "fit"),
    ]
    assert main([*line, "--no-prediction", "--no-comparison", "--no-figures"]) == 0
    assert "the zero was off by 10.0 deg (phi1) and 10.0 deg (phi2)" in capsys.readouterr().out
