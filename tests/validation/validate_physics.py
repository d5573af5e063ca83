"""CPU time and accuracy of simulation and smoothing: ``python -m tests.validation.validate_physics``."""

from __future__ import annotations

import time

import numpy as np
from pydpend.link_states import states
from pydpend.model import Damping, derived
from pydpend.simulation import simulate, simulate_many

from tests.unit.test_states import errors, made, rms

DAMPING = Damping(
    mu_v1=1.76e-5, mu_v2=5e-6, mu_q1=1.4e-5, rmu1=3e-5, rmu2=3e-5, tau_c1=2e-3, tau_c2=2e-4, strip_drag=1e-6
)


def main() -> None:
    drop = np.radians([181.0, 181.0, 0.0, 0.0])
    for samples in (6001, 60001):
        t = np.linspace(0.0, 60.0, samples)
        for name, damping in (("damped", DAMPING), ("undamped", Damping())):
            best = np.inf
            for _ in range(5):
                began = time.process_time()
                run = simulate(derived("A"), damping, drop, t)
                best = min(best, time.process_time() - began)
            print(f"60 s {name}, {samples} samples: {best:.3f} s CPU, balance {run.balance:.1e}")
    cpu, w, a, z = np.inf, [], [], []
    for seed in range(20, 26):
        angles, truth = made(seed, np.arange(60_000) / 1000.0)
        began = time.process_time()
        found = states(angles)
        cpu = min(cpu, time.process_time() - began)
        e = errors(found, truth)
        w += list(rms(e[1]))
        a += list(rms(e[2]))
        z += [v for k in range(3) for v in rms(e[k] / np.sqrt(found.covariance[:, :, k, k]))]
    print(
        f"states, 60 s at 1000 fps, both links: {cpu:.2f} s CPU; seeds 20-25: w {min(w):.3f}-{max(w):.3f} rad/s, "
    )
    print(f"  a {min(a):.1f}-{max(a):.1f} rad/s2, errors over their sigmas {min(z):.2f}-{max(z):.2f}")
    starts = drop + np.random.default_rng(0).normal(0, 0.02, (1000, 4)) * [1, 1, 0, 0]
    wall, began = time.perf_counter(), time.process_time()
    simulate_many(derived("A"), DAMPING, starts, [0.0, 60.0])
    wall, used = time.perf_counter() - wall, time.process_time() - began
    print(f"1000 runs of 60 s: {wall:.1f} s, {used / wall:.2f} cores busy")


if __name__ == "__main__":
    main()
