"""The issue's table of accuracies over seeds held back (0-19):
``python -m tests.validation.validate_damping CASE [SEEDS [FIRST]]``.

``python -m tests.validation.validate_damping wrong [SEEDS [FIRST [KIND]]]``: inputs of which something is wrong
(`tests.support.wrong_inputs`), the paper's laws and free ratios: how many intervals hold, and if the cause is named.

Cases: exact, energy, inertias (true inertias), ratios (inertias up to 2 % off), slow (500 fps, 0.1 deg), all (every
law), added (the paper's laws alone, fitted with every law), none (mu_q2 is zero); speed (wall and processor time,
memory; no seeds). Prints each seed's errors, and over all the worst and how often 95 % intervals hold the truth. Not
run by pytest.
"""

from __future__ import annotations

import resource
import sys
import time
from dataclasses import asdict, replace

import numpy as np
from pydpend import energy
from pydpend.damping import DampingFit, fit_damping
from pydpend.damping.shares import shares
from pydpend.model import Damping, derived

from tests.support.free_decays import ALL_TERMS, TRUTH, measured, released
from tests.support.wrong_inputs import kinds

RATIOS = {"lambda": "lambda_kg_m2", "sigma": "sigma_j", "kappa": "kappa_j", "a3": "a3_kg_m2"}


def speed() -> None:
    """Times of the trajectory fit with ratios free over 15, 30 and 60 s at 1000 fps, and of the energy fit's least
    squares; largest memory of this process."""
    true = derived("A")
    for seconds in (15.0, 30.0, 60.0):
        angles = measured(released(0, seconds), 0, 0.05)
        wall, processor = time.perf_counter(), time.process_time()
        result = fit_damping(angles, true, laws="paper")
        wall, processor = time.perf_counter() - wall, time.process_time() - processor
        most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        print(
            f"{seconds:.0f} s: {result.status}, {wall:.2f} s wall, {processor:.2f} s CPU, {most:.0f} MiB",
            flush=True,
        )
    profile = energy.energy_profile(released(0, 60.0), true, "paper")
    wall = time.perf_counter()
    energy.fit_profiles([profile])
    print(f"energy fit of {profile.t_s.size} samples: {time.perf_counter() - wall:.3f} s wall")


def shares_off(result: DampingFit, motion: energy.Motion, truth: Damping) -> float:
    """The largest error of a share of a law or a joint, in points (percent of the dissipated energy)."""
    exact = energy.energy_profile(motion, derived("A"), "paper")
    n = len(exact.names)
    true = shares(exact.names, asdict(truth), np.zeros((n, n)), exact.unit_works[-1])
    off = [
        e.value - true[group][k].value for group in ("law", "joint") for k, e in result.shares[group].items()
    ]
    return 100 * float(np.abs(off).max())


def wrong(seeds: int, first: int, only: str = "") -> None:
    """Prints a row for each kind of wrong input."""
    for name, kind in kinds().items():
        if only and name != only:
            continue
        inside, z, named, done = [], [], 0, 0
        for seed in range(first, first + seeds):
            fit = fit_damping(kind.angles(seed), kind.given, laws="paper")
            score = [(e.value - getattr(kind.truth, n)) / e.sigma for n, e in fit.coefficients.items()]
            inside += [abs(s) < 1.96 for s in score]
            z.append(max(map(abs, score)))
            named += kind.named(fit)
            done += fit.status == "converged"
        print(
            f"{name} ({kind.about}): {done} of {seeds} converged, 95 % intervals hold {100 * np.mean(inside):.1f} % of "
            f"{len(inside)}, largest |z| {max(z):.2f}, cause named in {named} of {seeds}",
            flush=True,
        )


def main(case: str, seeds: int, first: int) -> None:
    """Runs one case and prints."""
    if case == "speed":
        speed()
        return
    true = derived("A")
    truth = {"all": ALL_TERMS, "none": replace(TRUTH, mu_q2=0.0)}.get(case, TRUTH)
    inside, z, worst, ratio_ppm, chi2, points, converged = [], [], [], [], [], [], []
    z_zero: list[float] = []
    for seed in range(first, first + seeds):
        motion = released(seed, 60.0, 500.0 if case == "slow" else 1000.0, truth)
        if case == "exact":
            fit = energy.fit_profiles([energy.energy_profile(motion, true, "paper")])
            errors = {n: v / getattr(truth, n) - 1 for n, v in zip(fit.names, fit.values, strict=True)}
            print(seed, {n: f"{100 * e:+.4f} %" for n, e in errors.items()})
            continue
        angles = measured(motion, seed, 0.1 if case == "slow" else 0.05)
        model = true
        if case == "ratios":
            factor = 1 + np.random.default_rng([seed, 3]).uniform(-0.02, 0.02, 4)
            model = replace(
                true, **{f: getattr(true, f) * float(k) for f, k in zip(RATIOS.values(), factor, strict=True)}
            )
        result = fit_damping(
            angles,
            model,
            "energy" if case == "energy" else "trajectory",
            "full" if case in ("all", "added") else "paper",
            ratios=case in ("ratios", "all", "added"),
        )
        error = {
            n: 100 * (e.value / t - 1) for n, e in result.coefficients.items() if (t := getattr(truth, n)) > 0
        }
        zero = {n: e.value / e.sigma for n, e in result.coefficients.items() if getattr(truth, n) == 0}
        z_zero += zero.values()
        score = [(e.value - getattr(truth, n)) / e.sigma for n, e in result.coefficients.items()]
        ppm = [
            1e6 * (e.value * true.psi_kg_m2 / getattr(true, RATIOS[n]) - 1) for n, e in result.ratios.items()
        ]
        worst.append(max(error.values(), key=abs))
        z += score
        inside += [abs(s) < 1.96 for s in score]
        chi2.append(result.chi2)
        points.append(shares_off(result, motion, truth) if case == "energy" else 0.0)
        converged.append(result.status == "converged")
        ratio_ppm.append(float(np.abs(ppm).max()))
        words = ", ".join(
            [f"{n} {e:+.2f} %" for n, e in error.items()]
            + [f"{n} zero + {s:.2f} sigma" for n, s in zero.items()]
        )
        print(
            f"{seed}: {result.status}, chi2 {result.chi2:.4f}; {words}; ratios within {ratio_ppm[-1]:.1f} ppm",
            flush=True,
        )
    if z:
        print(
            f"{case}: {sum(converged)} of {seeds} converged, chi-square {min(chi2):.3f}-{max(chi2):.3f}, worst "
            f"{max(np.abs(worst)):.2f} %, ratios {max(ratio_ppm):.1f} ppm, largest |z| "
            f"{np.abs(z).max():.2f}, RMS {np.sqrt(np.mean(np.square(z))):.2f}, "
            f"95 % intervals hold {100 * np.mean(inside):.1f} % of {len(z)}"
        )
    if case == "energy":
        print(
            f"energy: shares within {max(points):.3f} points, RMS {np.sqrt(np.mean(np.square(points))):.3f}"
        )
    if z_zero:
        print(
            f"{case}: what is zero comes back within {max(z_zero):.2f} standard errors, {len(z_zero)} times"
        )


if __name__ == "__main__":
    if sys.argv[1] == "wrong":
        given = [*sys.argv[2:], *("20", "200", "")[len(sys.argv[2:]) :]]
        wrong(int(given[0]), int(given[1]), given[2])
        sys.exit()
    counts = [int(a) for a in sys.argv[2:]]
    main(sys.argv[1], *counts, *(20, 0)[len(counts) :])
