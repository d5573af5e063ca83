"""Method 1 and method 2 of Section 8.2.1: telescoping, the random walk, arcsin, and the propagated bands."""

from __future__ import annotations

import numpy as np
import pytest
from pydpend.errors import AnglesError
from pydpend.kinematics.increments import (
    arcsin_steps,
    by_changing_vectors,
    by_increments,
    by_reference,
    steps,
    vectors_of,
)


def circle(theta: np.ndarray, radius: float = 100.0) -> np.ndarray:
    return radius * np.stack([np.cos(theta), np.sin(theta)], axis=1)


def test_increments_of_one_vector_telescope_to_the_reference_angle() -> None:
    rng = np.random.default_rng(0)
    theta = np.cumsum(rng.uniform(-0.5, 0.9, 3000))
    v = circle(theta) + rng.normal(0, 0.2, (3000, 2))
    one, two = by_reference(v, 0.1), by_increments(v, 0.1)
    # Rounding only: 3000 additions of numbers near 1 to sums near 600 (ERRATA 25 has 4e-15 for smaller sums).
    np.testing.assert_allclose(two.theta_rad, one.theta_rad, atol=3000 * 600 * 2.3e-16)
    np.testing.assert_allclose(two.sigma_rad, one.sigma_rad)
    assert two.summed_rad is not None
    # The paper's sum of errors says 3000 times as much, for nothing.
    assert two.summed_rad[-1] / two.sigma_rad[-1] == pytest.approx(2999, rel=0.01)


def test_the_bands_are_what_repeats_scatter_by() -> None:
    sigma, repeats = 0.15, 400
    theta = np.linspace(0, 7, 300)
    shape = np.array([[0.0, 0.0], [90.0, 0.0], [40.0, 60.0], [-30.0, 70.0]])
    c, s = np.cos(theta)[:, None], np.sin(theta)[:, None]
    exact = np.stack([c * shape[:, 0] - s * shape[:, 1], s * shape[:, 0] + c * shape[:, 1]], axis=-1)
    pairs = np.array([[(0, 1), (2, 3), (1, 3)][i % 3] for i in range(299)])
    errors: dict[str, list[np.ndarray]] = {"one": [], "two": [], "changing": []}
    for seed in range(repeats):
        xy = exact + np.random.default_rng(seed).normal(0, sigma, exact.shape)
        v = vectors_of(xy, 0, 1)
        one, two, changing = (
            by_reference(v, sigma),
            by_increments(v, sigma),
            by_changing_vectors(xy, pairs, sigma),
        )
        for name, found in (("one", one), ("two", two), ("changing", changing)):
            errors[name].append(found.theta_rad - theta)
    for name, found in (("one", one), ("two", two), ("changing", changing)):
        ratio = np.std(errors[name], axis=0)[1:] / found.sigma_rad[1:]
        # 400 repeats: 3.5 % each; the mean over 299 frames, which hang together, stays within 8 %.
        assert ratio.mean() == pytest.approx(1.0, abs=0.08), name
    walk = changing.sigma_rad
    # sqrt(T): four times the frames, twice the error; the paper's sum would be four times.
    assert walk[280] / walk[70] == pytest.approx(2.0, rel=0.05)
    assert changing.summed_rad is not None
    assert changing.summed_rad[280] / changing.summed_rad[70] == pytest.approx(4.0, rel=0.05)


def test_one_step_error_of_the_errata() -> None:
    # ERRATA 25: 0.115 deg a step, another vector every frame, 3.62 deg after 999 steps.
    xy = np.concatenate([np.zeros((1000, 2, 2)), np.full((1000, 2, 2), 500.0)], axis=1)
    length = 100.0
    xy[:, 1, 0] += length
    xy[:, 3, 0] += length
    sigma = np.radians(0.115) * length / 2
    pairs = np.array([(0, 1) if i % 2 else (2, 3) for i in range(999)])
    found = by_changing_vectors(xy, pairs, sigma)
    assert np.degrees(found.sigma_rad[-1]) == pytest.approx(0.115 * np.sqrt(999), rel=0.001)


def test_arcsin_loses_steps_beyond_a_right_angle_and_ours_does_not() -> None:
    for step, seen in ((80.0, 80.0), (95.0, 85.0), (170.0, 10.0), (-120.0, -60.0)):
        v = circle(np.radians(step) * np.arange(5))
        np.testing.assert_allclose(np.degrees(arcsin_steps(v)), seen, atol=1e-9)
        np.testing.assert_allclose(np.degrees(steps(v)), step, atol=1e-9)


def test_given_reference_is_exact_and_bad_input_is_named() -> None:
    v = circle(np.linspace(0, 3, 10))
    given = by_reference(v, 0.1, np.array([100.0, 0.0]))
    np.testing.assert_allclose(given.sigma_rad, np.sqrt(2) * 0.1 / 100)
    hidden = v.copy()
    hidden[4] = np.nan
    with pytest.raises(AnglesError, match="frame 4: not seen"):
        by_increments(hidden, 0.1)
    with pytest.raises(AnglesError, match="not \\(T, 2\\)"):
        steps(np.zeros((3, 3)))
    with pytest.raises(AnglesError, match="one pair a step"):
        by_changing_vectors(np.zeros((4, 3, 2)), np.zeros((4, 2), dtype=np.int64), 0.1)
