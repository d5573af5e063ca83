"""Small oscillations, sections, exponents; and the equations of motion against Newton and Euler."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from pydpend.errors import SimulationError
from pydpend.linear import lyapunov, modes, poincare
from pydpend.model import Damping, Model, derived
from pydpend.plots import physics
from pydpend.plots.beside import Pictures, beside
from pydpend.simulation import simulate

Array = npt.NDArray[np.float64]


def e(p: float) -> Array:
    """Along a link."""
    return np.array([np.sin(p), -np.cos(p)])


def n(p: float) -> Array:
    """Across a link."""
    return np.array([np.cos(p), np.sin(p)])


def cross(r: Array) -> Array:
    """r x F = cross(r) . F"""
    return np.array([-r[1], r[0]])


def newton_euler(m: Model, d: Damping, d1: float, i1: float, i2: float, x: Array) -> Array:
    """(a1, a2, N1, N2) from force and moment balances of both links, pin reactions as unknowns (10 equations).

    Dry moments depend on the sizes of the reactions, so they are iterated; nothing is shared with the package but
    the meaning of the numbers.
    """
    p1, p2, w1, w2 = x
    d2 = m.kappa_j / (m.g_m_s2 * m.m2_kg)
    sign = np.sign([w1, w2 - w1])
    load = np.zeros(2)
    out = np.zeros(4)
    for _ in range(100):
        joint1 = d.mu_v1 * w1 + d.mu_q1 * abs(w1) * w1 + (d.rmu1 * load[0] + d.tau_c1) * sign[0]
        joint2 = d.mu_v2 * (w2 - w1) + (d.rmu2 * load[1] + d.tau_c2) * sign[1]
        # unknowns: a1, a2, centre accelerations c1 (2), c2 (2), reactions F1 on link 1 (2), F2 on link 2 (2)
        a, b = np.zeros((10, 10)), np.zeros(10)
        a[0:2, 2:4], a[0:2, 0] = np.eye(2), -d1 * n(p1)
        b[0:2] = -d1 * w1**2 * e(p1)
        a[2:4, 4:6], a[2:4, 0], a[2:4, 1] = np.eye(2), -m.l1_m * n(p1), -d2 * n(p2)
        b[2:4] = -m.l1_m * w1**2 * e(p1) - d2 * w2**2 * e(p2)
        a[4:6, 2:4], a[4:6, 6:8], a[4:6, 8:10] = m.m1_kg * np.eye(2), -np.eye(2), np.eye(2)
        b[4:6] = [0, -m.m1_kg * m.g_m_s2]
        a[6:8, 4:6], a[6:8, 8:10] = m.m2_kg * np.eye(2), -np.eye(2)
        b[6:8] = [0, -m.m2_kg * m.g_m_s2]
        a[8, 0], a[8, 6:8], a[8, 8:10] = i1, -cross(-d1 * e(p1)), cross((m.l1_m - d1) * e(p1))
        b[8] = -joint1 + joint2
        a[9, 1], a[9, 8:10] = i2, -cross(-d2 * e(p2))
        b[9] = -joint2 - d.mu_q2 * abs(w2) * w2
        u = np.linalg.solve(a, b)
        new = np.array([u[0], u[1], np.hypot(u[6], u[7]), np.hypot(u[8], u[9])])
        if np.allclose(new, out, rtol=1e-15, atol=0):
            break
        out, load = new, new[2:]
    return out


def test_accelerations_and_normal_forces_are_newtons() -> None:
    """300 random pendulums and states (errata 13 to 16): 1e-12 of the largest term."""
    rng = np.random.default_rng(0)
    worst = 0.0
    for _ in range(300):
        m1, m2, i1, i2 = rng.uniform(0.05, 0.5, 2).tolist() + rng.uniform(1e-4, 2e-3, 2).tolist()
        length, d1, d2 = rng.uniform(0.1, 0.3), rng.uniform(0.02, 0.2), rng.uniform(0.03, 0.2)
        model = Model(
            psi_kg_m2=(i1 + m1 * d1**2 + m2 * length**2) / 2,
            lambda_kg_m2=(i2 + m2 * d2**2) / 2,
            zeta_kg_m2=0.0,
            a3_kg_m2=m2 * length * d2,
            sigma_j=9.81 * (m1 * d1 + m2 * length),
            kappa_j=9.81 * m2 * d2,
            m1_kg=m1,
            m2_kg=m2,
            l1_m=length,
        )
        # friction far beyond a bearing's, so that its dependence on the accelerations counts
        names = ("mu_v1", "mu_v2", "mu_q1", "mu_q2", "rmu1", "rmu2", "tau_c1", "tau_c2")
        damping = Damping(**dict(zip(names, (rng.uniform(0, 1e-3, 8)).tolist(), strict=True)))
        x = np.concatenate([rng.uniform(-np.pi, np.pi, 2), rng.uniform(-20, 20, 2)])
        run = simulate(model, damping, x, [0.0])
        expected = newton_euler(model, damping, d1, i1, i2, x)
        got = np.concatenate([run.a_rad_s2[0], run.normal_n[0]])
        scale = np.repeat([np.abs(expected[:2]).max(), np.abs(expected[2:]).max()], 2)
        worst = max(worst, float(np.max(np.abs(got - expected) / scale)))
    assert worst < 1e-12


def test_modes_of_the_derived_constants() -> None:
    found = modes(derived("A"))
    np.testing.assert_allclose(found.frequency_hz, [1.108, 2.267], atol=5e-4)
    # In the slow mode the links swing together, in the fast one against each other.
    assert found.shape[0].min() > 0
    assert found.shape[1].prod() < 0
    np.testing.assert_allclose(found.damping_ratio, 0, atol=1e-12)


@pytest.mark.parametrize("mode", [0, 1])
def test_small_simulations_swing_at_the_linear_frequencies(mode: int) -> None:
    """To 1e-6: an amplitude of 1e-4 rad changes the period by less than its square."""
    model = derived("A")
    found = modes(model)
    start = [*(1e-4 * found.shape[mode]), 0.0, 0.0]
    t = poincare(model, Damping(), start, 30.0).t_s
    frequency = (len(t) - 1) / (t[-1] - t[0])
    assert frequency == pytest.approx(found.frequency_hz[mode], rel=1e-6)


def test_damping_ratio_is_the_decay_of_a_small_swing() -> None:
    model = derived("A")
    damping = Damping(mu_v1=2e-3, mu_v2=2e-4)
    found = modes(model, damping)
    start = [*(1e-4 * found.shape[0]), 0.0, 0.0]
    run = simulate(model, damping, start, np.linspace(0, 10, 3))
    # The slow mode's energy falls as exp(-2 ratio w t); its damped shape differs from the real part in second order.
    rate = 2 * found.damping_ratio[0] * 2 * np.pi * found.frequency_hz[0]
    assert np.log(run.energy_j[0] / run.energy_j[2]) / 10 == pytest.approx(rate, rel=0.02)


def test_the_exponent_of_the_drop_and_its_error() -> None:
    """Two halves of the motion agree within their stated errors, and a small swing has none."""
    model = derived("A")
    one = lyapunov(model, Damping(), [3.1, 3.1, 0, 0], duration_s=200)
    two = lyapunov(model, Damping(), [3.1, 3.05, 0, 0], duration_s=200)
    assert one.per_s > 10 * one.sigma_per_s
    assert abs(one.per_s - two.per_s) < 5 * np.hypot(one.sigma_per_s, two.sigma_per_s)
    assert lyapunov(model, Damping(), [0.02, 0.02, 0, 0], duration_s=100).per_s < 0.1


def test_refusals_name_their_argument() -> None:
    with pytest.raises(SimulationError, match="tau_c1"):
        lyapunov(derived("A"), Damping(tau_c1=1e-4), [1, 1, 0, 0])
    with pytest.raises(SimulationError, match="link 3"):
        poincare(derived("A"), Damping(), [1, 1, 0, 0], 1.0, link=3)
    with pytest.raises(SimulationError, match="10 intervals"):
        lyapunov(derived("A"), Damping(), [1, 1, 0, 0], duration_s=5.0)


def test_figures_and_animation(tmp_path: Path) -> None:
    model = derived("A")
    run = simulate(model, Damping(mu_v1=1e-3), [2.0, 1.0, 0, 0], np.linspace(0, 1, 101))
    assert len(physics.energies(run, model).axes) == 2
    assert len(physics.phase_portrait(run).axes) == 2
    assert len(physics.comparison(run, run).axes) == 2
    found = poincare(model, Damping(), [2.0, 1.0, 0, 0], 5.0)
    assert np.size(physics.section(found).axes[0].lines[0].get_xdata()) == len(found.t_s) > 1
    physics.animate(run, model, tmp_path / "p.gif", fps=5)
    assert (tmp_path / "p.gif").read_bytes()[:3] == b"GIF"
    physics.animate(run, model, tmp_path / "p.mp4", fps=5)
    assert (tmp_path / "p.mp4").read_bytes()[4:8] == b"ftyp"
    with pytest.raises(SimulationError, match="is not a film"):
        physics.animate(run, model, tmp_path / "p.avi")
    with pytest.raises(SimulationError, match="cannot be written"):
        physics.animate(run, model, tmp_path / "none" / "p.mp4", fps=5)


def pictures_in(film: Path) -> Array:
    """Gray values of its pictures, (K, H, W), of a film 800 by 640."""
    words = ["ffmpeg", "-v", "error", "-i", str(film), "-f", "rawvideo", "-pix_fmt", "gray", "-"]
    raw = subprocess.run(words, capture_output=True, check=True).stdout
    return np.frombuffer(raw, dtype=np.uint8).reshape(-1, 640, 800).astype(np.float64)


def test_the_recording_stands_upright_beside_its_simulation_at_its_time(tmp_path: Path) -> None:
    model = derived("A")
    run = simulate(model, Damping(), [2.0, 1.0, 0, 0], np.linspace(0, 1, 101))
    # Ten pictures, one each 0.1 s: the upper half is white in the first five, the lower half in the others.
    half = "geq=lum='255*eq(lt(Y,H/2),lt(N,5))':cb=128:cr=128"
    source = f"nullsrc=size=64x48:rate=10:duration=1,{half}"
    words = ["ffmpeg", "-v", "error", "-f", "lavfi", "-i", source, "-pix_fmt", "yuv420p"]
    subprocess.run([*words, str(tmp_path / "film.mp4")], check=True)
    pictures = Pictures(tmp_path / "film.mp4", (64, 48), np.arange(10) / 10)
    for name in ("b.mp4", "b.gif"):
        assert beside(run, run, model, tmp_path / name, pictures=pictures, fps=10, speed=1.0) == 10
        shown = pictures_in(tmp_path / name)
        # Well inside the left axes, where the picture 4:3 is, above and below its middle (200 px from the top).
        upper, lower = (
            shown[:, 120:160, 180:320].mean(axis=(1, 2)),
            shown[:, 240:280, 180:320].mean(axis=(1, 2)),
        )
        assert (upper[:5] > 200).all()
        assert (upper[5:] < 55).all()
        assert (lower[:5] < 55).all()
        assert (lower[5:] > 200).all()
