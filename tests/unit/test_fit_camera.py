"""The cameras' five numbers in fits: found with their prior, in the covariance, told."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
from numpy.typing import NDArray
from pydpend.coefficients import parameters
from pydpend.damping import DampingFit, fit_damping, shooting
from pydpend.damping.camera import cameras_of
from pydpend.damping.recording import prepare
from pydpend.damping.shooting import Cameras
from pydpend.kinematics import LinkAngles
from pydpend.model import Damping, derived
from pydpend.trials import combine

from tests.support.free_decays import TRUTH, measured, released

Floats = NDArray[np.float64]
MODEL = derived("A")
NUMBERS = np.array([0.7, -1.1, 0.4, 0.2, -0.6])


def columns_of(phi: Floats, size_deg: float = 0.1) -> Floats:
    """Smooth functions of the angles (T, 2, 5), as a camera's are."""
    out = np.stack([np.sin((k // 2 + 1) * phi + (np.pi / 2) * (k % 2)) for k in range(5)], axis=-1)
    return np.asarray(np.radians(size_deg) * out / np.array([1.0, 1.0, 2.0, 2.0, 3.0]))


def seen(
    seed: int,
    seconds: float = 8.0,
    numbers: Floats = NUMBERS,
    damping: Damping = TRUTH,
    **camera: object,
) -> LinkAngles:
    """A decay whose angles a camera of these numbers bends."""
    angles = measured(released(seed, seconds, 500.0, damping), seed, 0.02)
    columns = columns_of(angles.phi_rad)
    return dataclasses.replace(
        angles,
        phi_rad=angles.phi_rad + columns @ numbers,
        camera_rad=columns,
        meta={"bodies": [], "camera": {"origin": "by_eye", "numbers": [0.0] * 5} | camera},
    )


def z_of(fit: DampingFit) -> Floats:
    return np.array([(e.value - getattr(TRUTH, n)) / e.sigma for n, e in fit.coefficients.items()])


@pytest.fixture(scope="module")
def fit() -> DampingFit:
    return fit_damping(seen(1), MODEL, laws="paper", ratios=False)


def test_the_fit_finds_the_cameras_numbers(fit: DampingFit) -> None:
    (given,) = fit.inputs
    off = (np.array(given.camera_numbers) - NUMBERS) / np.array(given.camera_numbers_sigma)
    assert (np.abs(off) < 4).all(), off
    # The motion tells more than the prior of unit variance.
    assert (np.array(given.camera_numbers_sigma) < 0.5).all()
    assert fit.chi2 == pytest.approx(1.0, abs=0.1)
    assert (np.abs(z_of(fit)) < 4).all()


def test_without_the_camera_the_same_angles_are_wrong_beyond_the_noise(fit: DampingFit) -> None:
    blind = fit_damping(dataclasses.replace(seen(1), camera_rad=None), MODEL, laws="paper", ratios=False)
    assert blind.chi2 > 2 * fit.chi2
    assert blind.camera_sigma == {}
    assert any("what the camera does to these angles is not stated" in n for n in blind.notes)


def test_the_cost_rises_from_the_solution_as_its_information_says() -> None:
    """Derivatives by the camera's numbers, against refits with one of them held."""
    angles = seen(2, 5.0, np.array([0.8, 0.0, 0.0, 0.0, 0.0]))
    assert angles.camera_rad is not None
    only = np.where(np.arange(5) == 0, angles.camera_rad, 0.0)
    r = prepare(dataclasses.replace(angles, camera_rad=only), MODEL)
    cameras = cameras_of([r])
    assert cameras is not None
    free = ["mu_v1", "rmu1"]
    start = shooting.settled([r.track], [r.span], 1.0, parameters(MODEL), np.zeros((1, 2)), free=free)

    def solved(tracks: list[shooting.Track], given: Cameras | None) -> shooting.Solution:
        return shooting.solve(
            tracks,
            start.segments,
            start.parameters,
            start.zeros_rad,
            free=free,
            slack=(1e-4, 1e-4, 1e-2, 1e-2),
            learned=False,
            huber=1e3,
            cameras=given,
        )

    best = solved([r.track], cameras)
    assert best.cameras is not None
    at = best.names.index("camera1[0]")
    variance = np.linalg.inv(best.information)[at, at]
    # Numbers without a column stay at the prior's mean with its variance.
    assert best.cameras.numbers[0, 1:] == pytest.approx(0.0, abs=1e-9)
    assert np.linalg.inv(best.information)[at + 1, at + 1] == pytest.approx(1.0)
    for step in (-2.0, 2.0):
        number = best.cameras.numbers[0, 0] + step * variance**0.5
        held = dataclasses.replace(cameras, numbers=np.array([[number, 0, 0, 0, 0]]))
        cost = solved(held.corrected([r.track]), None).cost + number**2 / 2
        # Half chi-square rises by half the squared standard deviations; curvature of the motion is what is left.
        assert cost - best.cost == pytest.approx(step**2 / 2, rel=0.05)


def test_recordings_of_one_camera_share_its_numbers() -> None:
    one, same, other = seen(1), seen(2), seen(3, numbers=-NUMBERS, origin="found")
    prepared = [prepare(a, MODEL) for a in (one, same, other)]
    cameras = cameras_of(prepared)
    assert cameras is not None
    assert [None if p is None else p[1] for p in cameras.parts] == [0, 0, 1]
    assert cameras.numbers.shape == (2, 5)
    fit = fit_damping([one, same, other], MODEL, laws="paper", ratios=False)
    found = [given.camera_numbers for given in fit.inputs]
    assert found[0] == found[1]
    assert found[2] == pytest.approx(-NUMBERS, abs=0.3)


def test_the_cameras_part_of_each_error_is_told(fit: DampingFit) -> None:
    assert set(fit.camera_sigma) == set(fit.coefficients)
    for name, part in fit.camera_sigma.items():
        assert 0 <= part < fit.coefficients[name].sigma
    assert any("part of each standard error that is the camera's" in n for n in fit.notes)
    back = DampingFit.from_json(fit.to_json())
    assert back.camera_sigma == fit.camera_sigma
    old = json.loads(fit.to_json())
    del old["camera_sigmas"]
    assert DampingFit.from_json(json.dumps(old)).camera_sigma == {}


def test_profile_intervals_have_the_camera_too() -> None:
    angles = seen(1, 5.0, damping=Damping(mu_v1=TRUTH.mu_v1, rmu1=TRUTH.rmu1))
    with_camera = fit_damping(angles, MODEL, laws="mu_v1,rmu1", ratios=False, intervals="profile")
    low, high = with_camera.intervals["mu_v1"].low, with_camera.intervals["mu_v1"].high
    sigma = with_camera.coefficients["mu_v1"].sigma
    # A likelihood that is quadratic within the interval gives 2 x 1.96 standard errors.
    assert high - low == pytest.approx(3.92 * sigma, rel=0.1)


def test_the_energy_fit_adds_what_another_camera_would_make_of_it() -> None:
    angles = seen(1, 30.0)
    with_camera = fit_damping(angles, MODEL, "energy", "paper")
    blind = fit_damping(dataclasses.replace(angles, camera_rad=None), MODEL, "energy", "paper")
    for name, e in with_camera.coefficients.items():
        assert e.value == pytest.approx(blind.coefficients[name].value, rel=1e-9)
        both = np.hypot(blind.coefficients[name].sigma, with_camera.camera_sigma.get(name, 0.0))
        assert e.sigma == pytest.approx(both, rel=1e-6)
    assert max(with_camera.camera_sigma.values()) > 0


def test_errors_are_what_is_stated_over_drawn_cameras() -> None:
    """The short form of ``python -m tests.validation.validate_camera trajectory``."""
    damping = Damping(mu_v1=TRUTH.mu_v1, mu_q1=TRUTH.mu_q1)
    z = []
    for seed in range(10):
        numbers = np.random.default_rng([seed, 9]).normal(size=5)
        fit = fit_damping(
            seen(seed, 5.0, numbers, damping),
            MODEL,
            laws="mu_v1,mu_q1",
            ratios=False,
            prediction=False,
            comparison=False,
        )
        z += [(e.value - getattr(damping, n)) / e.sigma for n, e in fit.coefficients.items()]
    # Twenty errors, neighbours correlated: their RMS over the stated ones is known to some 20 %.
    assert 0.55 < np.sqrt(np.mean(np.square(z))) < 1.5
    assert np.mean(np.abs(z) < 1.96) > 0.8


def test_the_mean_of_trials_keeps_the_error_of_the_camera_they_share() -> None:
    values, sigmas = np.array([1.0, 1.1, 0.9, 1.0]), np.full(4, 0.1)
    apart, one = combine(values, sigmas, "1"), combine(values, sigmas, "1", np.full(4, 0.08))
    assert apart.sigma == pytest.approx(0.05)
    assert one.mean == apart.mean
    # 0.06 of each is its own and halves, 0.08 stays.
    assert one.sigma == pytest.approx(np.hypot(0.03, 0.08))
    assert combine(values, sigmas, "1", np.zeros(4)).sigma == pytest.approx(apart.sigma)
