"""Where the links hang by their own swing: against simulated truth, real angles, and motions that are no swing."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from pydpend.kinematics import Swing, find_swing, read_angles

from tests.support import two_links as rig
from tests.unit.test_hanging import held

Floats = NDArray[np.float64]
SHARED = Path(__file__).parents[3] / "shared" / "data"
NOISE_RAD = 3e-4
"""Of a marker's 0.05 px on links of 200 px."""


def found_in(t: Floats, phi: Floats, roll_deg: float, noise_rad: float = NOISE_RAD) -> Swing | None:
    """What the swing says of a film rolled by so much, with white noise."""
    roll = np.radians(roll_deg)
    noisy = phi + roll + noise_rad * np.random.default_rng(61).standard_normal(phi.shape)
    return find_swing(t, noisy, noise_rad, np.full(phi.shape[1], roll))


@pytest.mark.parametrize(
    ("deg", "seconds", "fps", "most_deg"),
    [
        ((50.0, 50.0), 1.0, 500.0, 2.0),
        ((50.0, 50.0), 4.0, 500.0, 1.0),
        ((50.0, 50.0), 6.0, 25.0, 2.0),
        ((10.0, 10.0), 4.0, 500.0, 0.2),
        ((2.0, 2.0), 4.0, 500.0, 0.2),
        ((30.0, -30.0), 4.0, 240.0, 2.0),
        ((120.0, -170.0), 4.0, 240.0, 4.0),
        ((175.0, 170.0), 4.0, 1000.0, 4.0),
        ((3.0,), 1.0, 250.0, 0.2),
        ((80.0,), 1.0, 250.0, 1.0),
        ((170.0,), 4.0, 60.0, 1.0),
    ],
)
@pytest.mark.parametrize("roll_deg", [0.0, -25.0, 170.0])
def test_the_swing_tells_where_the_links_hang(
    deg: tuple[float, ...], seconds: float, fps: float, most_deg: float, roll_deg: float
) -> None:
    t, phi = held(deg, seconds, fps=fps)
    swing = found_in(t, phi, roll_deg)
    assert swing is not None
    np.testing.assert_array_less(np.degrees(swing.sigma_rad), most_deg)
    off = swing.off(np.full(len(deg), np.radians(roll_deg)))
    # The errors are those of cubics, and of friction that the equations do not have: only a bound is held.
    np.testing.assert_array_less(np.abs(off), 4 * swing.sigma_rad + np.radians(0.1))
    assert not swing.refutes(np.full(len(deg), np.radians(roll_deg)))
    assert swing.refutes(np.full(len(deg), np.radians(roll_deg)) + np.radians(deg))


def test_uneven_times_and_gaps_do_not_matter() -> None:
    t, phi = held((50.0, 50.0), 5.0, fps=250.0)
    rng = np.random.default_rng(62)
    keep = np.sort(rng.choice(t.size, round(0.8 * t.size), replace=False))
    t, phi = t[keep], phi[keep].copy()
    phi[300:340, 0] = np.nan
    phi[rng.random(phi.shape) < 0.02] = np.nan
    swing = found_in(t, phi, 10.0)
    assert swing is not None
    np.testing.assert_array_less(np.abs(np.degrees(swing.off(np.radians([10.0, 10.0])))), 2.0)


def test_what_a_hand_moves_is_no_swing() -> None:
    t, phi = rig.drop(0.1, 500.0, 5, rest_s=1.0)
    lift = t < 2.5
    for links in (1, 2):
        assert found_in(t[lift], phi[lift, :links], 0.0) is None
        # A link lowered looks like one that creeps to where it is put down: believed only if that is down.
        lowered = phi[lift, :links][::-1].copy()
        swing = found_in(t[lift], lowered, 0.0)
        assert swing is None or not swing.refutes(np.zeros(links))
        assert found_in(t[lift], lowered + np.radians(40.0), 0.0) is None
    # Two sines of no common period, as no double pendulum swings.
    t = np.arange(2000) / 500
    assert found_in(t, np.stack([8 * np.sin(3 * t), 12 * np.sin(2 * t)], axis=1), 0.0) is None
    assert found_in(t, np.zeros((2000, 2)), 0.0) is None
    assert found_in(t[:4], np.zeros((4, 2)), 0.0) is None


@pytest.mark.skipif(not SHARED.is_dir(), reason="the real recordings are not here")
def test_real_recordings_swing_about_their_zero() -> None:
    """Lifted by hand, tumbling and swinging; the zero of these angles is the rest before the lift."""
    for trial in ("trial1", "trial2"):
        a = read_angles(SHARED / "myers_trials" / trial)
        for stop_s, most_deg in ((20.0, (3.0, 6.0)), (77.0, (0.5, 1.5))):
            part = a.between(0, stop_s)
            swing = find_swing(part.t_s, part.phi_rad, np.radians(0.1), np.zeros(2))
            assert swing is not None
            assert not swing.refutes(np.zeros(2))
            np.testing.assert_array_less(np.degrees(np.abs(swing.zero_rad)), most_deg)
    columns = {"time_s": "t_s", "phi1_rad": "theta1_rad", "phi2_rad": "theta2_rad"}
    a = read_angles(SHARED / "multiarm" / "double_freeswing_1kHz.csv", hanging_rad=np.pi, columns=columns)
    swing = find_swing(a.t_s, a.phi_rad, np.radians(0.05), np.zeros(2))
    assert swing is not None
    np.testing.assert_array_less(np.degrees(np.abs(swing.zero_rad)), 0.2)
