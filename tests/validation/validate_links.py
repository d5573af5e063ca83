"""Angles of mechanisms of any number of links: the numbers of docs/validation/angles.md.

Usage: python -m tests.validation.validate_links [rig]
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydpend.errors import RigError
from pydpend.kinematics import angles, find_rig
from pydpend.kinematics.estimators import Method

from tests.support import linkages
from tests.support.linkages import Made
from tests.unit.test_find_rig import MADE, assert_found, through_a_camera, tracks
from tests.unit.test_linkages import chain_bound, crank_bound, error_of
from tests.unit.test_single_markers import BOB, ELBOW_AND_TIP

Floats = NDArray[np.float64]

SEEDS = range(900, 920)
"""Neither those of the tests nor those on which the estimators were made."""

LONG = 100_000
"""Frames of the four-bar linkage that is timed."""


CASES: dict[str, tuple[Callable[[int], Made], Callable[[Made], Floats], Sequence[Method]]] = {
    "triple pendulum": (linkages.chain, chain_bound, ("rigid", "linkage")),
    "four-bar": (linkages.four_bar, crank_bound, ("rigid", "linkage")),
    "slider-crank": (linkages.slider_crank, chain_bound, ("rigid", "linkage")),
    "bob on a string": (lambda s: linkages.chain(s, layouts=BOB), chain_bound, ("rigid",)),
    "elbow and tip": (lambda s: linkages.chain(s, layouts=ELBOW_AND_TIP), chain_bound, ("rigid",)),
}


def rigid_bound(made: Made) -> Floats:
    """Cramer-Rao bounds (T, L) of each body by itself, its shape known and its place free."""
    out = []
    for p in made.places_px:
        arm2 = ((p - p.mean(axis=1, keepdims=True)) ** 2).sum(axis=(1, 2))
        out.append(linkages.SIGMA_PX / np.sqrt(arm2))
    return np.stack(out, axis=1)


RIG_SEEDS = range(1000, 1010)
"""Of `find_rig`: neither those of the tests nor those on which it was made."""

SPOILT: dict[str, dict[str, Any]] = {
    "0.05 px": {},
    "1 px": {"noise_px": 1.0},
    "0.5 px and 0.4 % wrong places": {"noise_px": 0.5, "wild": 0.004},
    "0.05 px, camera 3 deg askew, lens": {"seen_by": through_a_camera},
}


def rigs() -> int:
    """Prints how often `find_rig` is right; 1 if it is wrong once."""
    wrong = 0
    for name, make in MADE.items():
        for said, spoilt in SPOILT.items():
            right = refused = 0
            for seed in RIG_SEEDS:
                made = make(seed)
                try:
                    found = find_rig(tracks(made, seed, gaps=0.1, **spoilt))
                    assert_found(made, found, np.inf)
                    right += 1
                except RigError:
                    refused += 1
                except AssertionError:
                    wrong += 1
            print(f"| {name} | {said} | {right} of {len(RIG_SEEDS)} | {refused} |")
    return int(wrong > 0)


def main() -> int:
    """Prints the numbers; 1 if one misses its bound."""
    bad = 0
    for name, (make, bound_of, estimators) in CASES.items():
        for estimator in estimators:
            alone = estimator == "rigid" and min(p.shape[1] for p in make(SEEDS[0]).places_px) > 1
            squares, bounds, pulls, joints = [], [], [], []
            for seed in SEEDS:
                made = make(seed)
                found = angles(made.nodes(seed), estimator, zero="reference_frame")
                error = error_of(found, made)
                bound = rigid_bound(made) if alone else bound_of(made)
                squares.append((error**2).mean(axis=0))
                bounds.append((bound**2).mean(axis=0))
                pulls.append(((error / found.sigma_rad) ** 2).mean(axis=0))
                ends = [[made.links.index(j.links[k]) for j in found.joints] for k in (0, 1)]
                between = error[:, ends[1]] - error[:, ends[0]]
                joints.append(((between / found.sigma_theta_rad) ** 2).mean(axis=0))
            ratio = np.sqrt(np.mean(squares, axis=0) / np.mean(bounds, axis=0))
            pull = np.sqrt(np.mean(pulls, axis=0))
            joint = np.sqrt(np.mean(joints, axis=0))
            rms = np.degrees(np.sqrt(np.mean(squares, axis=0)))
            print(f"{name}, {estimator}: RMS error {rms.round(4)} deg, over the bound {ratio.round(3)}")
            print(f"  error over sigma {pull.round(3)}, of the joints' angles {joint.round(3)}")
            bad += int((ratio > 1.1).any()) + int((np.abs(np.concatenate([pull, joint]) - 1) > 0.1).any())
    made = linkages.four_bar(920, frames=LONG)
    nodes = made.nodes(920)
    start, busy = time.perf_counter(), time.process_time()
    angles(nodes, "linkage", zero="vertical")
    took, busy = time.perf_counter() - start, time.process_time() - busy
    print(f"four-bar, linkage, {LONG} frames: {took:.1f} s, {busy:.1f} s of a processor")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(rigs() if sys.argv[1:] == ["rig"] else main())
