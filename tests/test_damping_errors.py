"""Standard errors of the trajectory fit: against the exact covariance of the estimate, and against kicks put in."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np
from pydpend.coefficients import parameters
from pydpend.damping import shooting
from pydpend.damping.shooting import Solution, Track
from pydpend.damping.uncertainty import covariance, invert
from pydpend.model import derived
from pydpend.simulate import simulate

from tests.free_decays import TRUTH, released

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
