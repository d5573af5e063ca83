"""Standard errors of the trajectory fit: against the exact covariance of the estimate, and against kicks put in."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np
import pytest
from pydpend.coefficients import parameters
from pydpend.damping import fit_damping, shooting
from pydpend.damping.shooting import Solution, Track
from pydpend.damping.uncertainty import covariance
from pydpend.errors import FitError
from pydpend.information import check_errors, invert
from pydpend.kinematics import LinkAngles
from pydpend.model import Damping, derived
from pydpend.simulation import simulate

from tests.support.free_decays import TRUTH, released

MODEL = derived("A")
FREE = ("lambda", "mu_v2", "mu_q1", "mu_q2")
SIGMA = np.radians(0.05)
PIECE_S = 0.25


def fitted(track: Track, near: Solution, slack: np.ndarray, steps: int = 30) -> Solution:
    """From a solution, with this slack."""
    return shooting.solve(
        [track],
        near.segments,
        near.parameters,
        near.zeros_rad,
        free=FREE,
        slack=list(slack),
        learned=False,
        huber=1e3,
        max_iterations=steps,
    )


def begun(track: Track) -> Solution:
    """A loose fit of pieces from the truth."""
    t = track[0]
    return shooting.solve(
        [track],
        shooting.cut([track], [(t[0], t[-1])], PIECE_S),
        parameters(MODEL) | asdict(TRUTH),
        np.zeros((1, 2)),
        free=FREE,
        slack=1.0,
        learned=False,
    )


def test_stated_covariance_is_that_of_the_estimate_though_slack_was_allowed() -> None:
    """Angles without error, so that the estimate is linear in errors of the angles: its derivative by each of them,
    times their standard deviation, squared and summed, is its covariance. Slack that no jump uses must not widen it."""
    motion = released(3, 2.5, 50.0)
    phi = motion.phi_rad
    sigma = np.full_like(phi, SIGMA)
    loose = begun((motion.t_s, phi, sigma))
    best = fitted((motion.t_s, phi, sigma), loose, 0.3 * loose.own_sigma)
    exact = np.zeros((len(best.names), len(best.names)))
    for i, j in np.ndindex(phi.shape):
        moved = phi.copy()
        moved[i, j] += SIGMA
        found = fitted((motion.t_s, moved, sigma), best, best.slack, 1)
        change = [found.parameters[n] - best.parameters[n] for n in FREE]
        change += (found.zeros_rad - best.zeros_rad)[0].tolist()
        exact += np.outer(change, change)
    stated = covariance(best, model_error=False)
    # A Gauss-Newton step from a solution without residuals is exact; damping of 1e-4 and less is in it.
    assert np.allclose(np.diag(stated), np.diag(exact), rtol=2e-3)
    # Had the allowed jumps been there, coefficients would have 1.4 to 3.6 times that variance: the test can tell.
    assert (np.diag(invert(best.information) / exact)[: len(FREE)] > 1.3).all()


def test_jumps_that_are_there_are_counted_as_large_as_they_are() -> None:
    """Eighty kicks as large as a piece's samples determine its state, and none at all, with the same slack."""
    rng = np.random.default_rng(17)
    t = np.arange(81 * 25 + 1) / 100
    kick = np.zeros(4)
    shown = []
    for _ in range(2):
        phi = np.empty((t.size, 2))
        x = np.array([2.6, 2.2, 0.0, 0.0])
        for k in range(0, t.size - 1, 25):
            s = simulate(MODEL, TRUTH, x, t[k : k + 26])
            phi[k : k + 26] = s.phi_rad
            x = np.concatenate([s.phi_rad[-1], s.w_rad_s[-1]]) + kick * rng.normal(size=4)
        track = (t, phi + rng.normal(0.0, SIGMA, phi.shape), np.full_like(phi, SIGMA))
        loose = begun(track)
        kick = loose.own_sigma if not kick.any() else kick
        shown.append(float(fitted(track, loose, kick).jumps_shown[0]))
    # About half of the 320 jumps' components is free: their variance scatters by sqrt(2/160) = 0.11; three of these.
    assert shown[0] < 0.33
    assert abs(shown[1] - 1) < 0.33


@pytest.mark.parametrize(
    ("mu_n_m_s", "seconds", "method", "laws", "message"),
    [
        (0.6, 3.0, "trajectory", "full", "has no standard error"),
        (0.6, 3.0, "energy", "mu_v1", "no motion of this pendulum comes near the angles"),
        (2.0, 3.0, "trajectory", "mu_v1,mu_v2", "the motion is not determined by these angles"),
        (100.0, 20.0, "trajectory", "mu_v1", "Check the units"),
    ],
)
def test_damping_that_lets_nothing_swing_is_refused(
    mu_n_m_s: float, seconds: float, method: str, laws: str, message: str
) -> None:
    """A pendulum that creeps back says little of its laws: no standard error is 0, none is not a number."""
    t = np.arange(0.0, seconds, 2e-3)
    motion = simulate(derived("A"), Damping(mu_v1=mu_n_m_s, mu_v2=mu_n_m_s / 5), [1.5, 1.2, 0.0, 0.0], t)
    noise = np.random.default_rng(1).normal(0.0, 3e-4, motion.phi_rad.shape)
    angles = LinkAngles(t, motion.phi_rad + noise, np.full_like(noise, 3e-4), name="creeping")
    with pytest.raises(FitError, match=message):
        fit_damping(angles, derived("A"), method, laws, start_s=0.0, stop_s=seconds - 0.1)


def test_strong_damping_that_is_determined_is_fitted() -> None:
    """0.3 N m s for 3 s: the links creep, and their creeping tells the two coefficients; the errors are true to 4."""
    t = np.arange(0.0, 3.0, 2e-3)
    motion = simulate(derived("A"), Damping(mu_v1=0.3, mu_v2=0.06), [1.5, 1.2, 0.0, 0.0], t)
    noise = np.random.default_rng(1).normal(0.0, 3e-4, motion.phi_rad.shape)
    angles = LinkAngles(t, motion.phi_rad + noise, np.full_like(noise, 3e-4))
    fit = fit_damping(angles, derived("A"), laws="mu_v1,mu_v2", start_s=0.0, stop_s=2.9)
    for name, truth in (("mu_v1", 0.3), ("mu_v2", 0.06)):
        found = fit.coefficients[name]
        assert abs(found.value - truth) < 4 * found.sigma
        assert 0 < found.sigma < 0.02 * truth


def test_an_inverse_is_huge_where_nothing_is_known() -> None:
    """The third unknown is the sum of the others: its direction has a huge variance, where a pseudo-inverse has 0."""
    rows = np.random.default_rng(3).normal(size=(50, 2))
    design = np.column_stack([rows, rows.sum(axis=1)])
    assert (np.diag(invert(design.T @ design)) > 1e9).all()
    with pytest.raises(FitError, match="do not determine the coefficients"):
        invert(np.array([[1.0, np.inf], [np.inf, 1.0]]))
    with pytest.raises(FitError, match="b has no standard error"):
        check_errors(["a", "b"], np.diag([1.0, 0.0]))
