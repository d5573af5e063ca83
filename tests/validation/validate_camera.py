"""Angles and damping of films by cameras aimed by eye: errors over what is stated of them.

Usage: python -m tests.validation.validate_camera [angles|films|trajectory|energy] [SEEDS]
"""

from __future__ import annotations

import dataclasses
import sys
import tempfile

import numpy as np
import pydpend as dp
from numpy.typing import NDArray
from pydpend.damping import DampingFit, fit_damping
from pydpend.model import derived

from tests.support import aimed
from tests.support.free_decays import TRUTH, released

Floats = NDArray[np.float64]


def angle_errors(markers: str, swing: str, seeds: range) -> tuple[Floats, Floats, Floats]:
    """Mean squares over the frames, (seeds, 2), rad^2: of the errors, the stated noise, the stated camera's part.

    A constant is left out of all three: it is the zero's.
    """
    errors, noise, part = [], [], []
    for seed in seeds:
        t, phi = aimed.swing(swing, seed)
        found = dp.angles(aimed.film(t, phi, seed, aimed.drawn(seed), markers), zero="vertical")
        off = found.phi_rad - phi
        off = np.angle(np.exp(1j * (off - np.angle(np.nanmean(np.exp(1j * off), axis=0)))))
        errors.append(np.nanmean(off**2, axis=0))
        noise.append(np.nanmean(found.sigma_rad**2, axis=0))
        part.append(np.nanmean(found.sigma_camera_rad**2, axis=0))
    return np.array(errors), np.array(noise), np.array(part)


def show_angles(count: int) -> None:
    """A line per layout, swing and link."""
    print("markers | swing | angle | RMS error deg | stated noise | stated camera | error/noise | error/both")
    for markers in aimed.MARKERS:
        for swing in aimed.SWINGS:
            errors, noise, part = angle_errors(markers, swing, range(count))
            for k in range(2):
                e, n, c = (float(np.degrees(np.sqrt(v[:, k].mean()))) for v in (errors, noise, part))
                both = float(np.sqrt((errors[:, k] / (noise + part)[:, k]).mean()))
                pooled = e / float(np.hypot(n, c))
                print(
                    f"{markers} | {swing} | phi{k + 1} | {e:.4f} | {n:.4f} | {c:.4f} | {e / n:.1f} | "
                    f"{pooled:.2f} (mean of each {both:.2f})"
                )


def show_films(count: int) -> None:
    """Films of the preset ``clean`` by drawn cameras, tracked without settings: the tracker finds the camera."""
    scores, noise, part = [], [], []
    for seed in range(count):
        rng = np.random.default_rng([seed, 77])
        scene = dp.Film("clean", seed=900 + seed, frames=400).scene
        scene["camera"]["view"] = {
            "tilt_deg": abs(rng.normal(0, 3.0)),
            "towards_deg": rng.uniform(0, 360),
            "k1": rng.normal(0, 0.03),
            "pixel_height": 1 + rng.normal(0, 0.002),
        }
        with tempfile.TemporaryDirectory() as folder:
            film = dp.film(scene, f"{folder}/film.avi", codec="raw")
            nodes = dp.track(f"{folder}/film.avi", progress=False)
        found = dp.angles(nodes, zero="vertical")
        off = found.phi_rad - film.truth().phi_rad[found.frame]
        off = np.angle(np.exp(1j * (off - np.angle(np.nanmean(np.exp(1j * off), axis=0)))))
        scores.append(np.nanmean((off / found.sigma_total_rad) ** 2, axis=0))
        noise.append(np.nanmedian(found.sigma_rad, axis=0))
        part.append(np.sqrt(np.nanmean(found.sigma_camera_rad**2, axis=0)))
        z, n, c = np.sqrt(scores[-1]), np.degrees(noise[-1]), np.degrees(part[-1])
        has = "a camera found" if nodes.rig.camera else "no camera found"
        print(f"{seed}: {has}; error over both {z}, noise {n} deg, camera {c} deg", flush=True)
    n, c = (np.degrees(np.median(v, axis=0)) for v in (noise, part))
    print(f"error over both {np.sqrt(np.mean(scores, axis=0))}; median noise {n} deg, camera {c} deg")


def filmed_decay(seed: int, seconds: float, fps: float) -> dp.LinkAngles:
    """Angles of a free decay by a drawn camera of which the rig says nothing."""
    motion = released(seed, seconds, fps, TRUTH)
    nodes = aimed.film(motion.t_s, motion.phi_rad, seed, aimed.drawn(seed))
    return dp.angles(nodes, zero="vertical", name=f"seed {seed}")


def scores(fit: DampingFit) -> Floats:
    """Error over stated standard error of each coefficient."""
    return np.array([(e.value - getattr(TRUTH, n)) / e.sigma for n, e in fit.coefficients.items()])


def show_damping(method: str, count: int) -> None:
    """How often 95 % intervals hold the truth and errors over standard errors, with the camera's part and without."""
    held: dict[str, list[Floats]] = {"with": [], "without": []}
    wide: dict[str, list[Floats]] = {"with": [], "without": []}
    parts, refused = [], []
    for seed in range(count):
        try:
            angles = filmed_decay(seed, 15.0, 500.0)
        except dp.AnglesError as problem:
            # A camera so far off that its distances are taken for wrong markers: the tracker would have found it.
            refused.append(f"{seed} ({problem})")
            continue
        plain = dataclasses.replace(angles, camera_rad=None)
        for name, given in (("with", angles), ("without", plain)):
            fit = fit_damping(given, derived("A"), method, "paper", ratios=False)
            held[name].append(scores(fit))
            wide[name].append(np.array([e.sigma for e in fit.coefficients.values()]))
            if name == "with":
                parts.append([fit.camera_sigma.get(n, 0.0) / e.sigma for n, e in fit.coefficients.items()])
            words = ", ".join(f"{n} {z:+.2f}" for n, z in zip(fit.coefficients, held[name][-1], strict=True))
            print(f"{seed} {name} camera: {fit.status}, chi2 {fit.chi2:.3f}; {words}", flush=True)
    for name, found in held.items():
        z = np.array(found)
        print(
            f"{method}, {name} camera: 95 % intervals hold the truth in {100 * np.mean(np.abs(z) < 1.96):.1f} %; "
            f"error over standard error {np.sqrt((z**2).mean()):.2f}, by coefficient "
            f"{np.round(np.sqrt((z**2).mean(axis=0)), 2).tolist()}; median standard errors "
            f"{[f'{s:.2g}' for s in np.median(wide[name], axis=0)]}"
        )
    print("part of each standard error that is the camera's:", np.round(np.median(parts, axis=0), 2).tolist())
    print(f"{len(refused)} films refused: {'; '.join(refused)}")


def main() -> None:
    """The tables that are asked for."""
    what = sys.argv[1] if len(sys.argv) > 1 else "angles"
    count = int(sys.argv[2]) if len(sys.argv) > 2 else 50
    if what == "angles":
        show_angles(count)
    elif what == "films":
        show_films(count)
    else:
        show_damping(what, count)


if __name__ == "__main__":
    main()
