"""Rigid or linkage? Both on faultless films and on films with faults: the evidence of docs/decisions on the
default.

Usage: python -m tests.validation.validate_default
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydpend.kinematics import angles
from pydpend.kinematics.estimators import Method

from tests.support import two_links
from tests.unit.test_angles import tumbling

Floats = NDArray[np.float64]
SEEDS = range(200, 204)
CENTRE_PX = np.array([639.5, 511.5])


def faults(t: Floats, phi: Floats, seed: int) -> dict[str, Floats]:
    """What each fault of a film adds to the centres, (T, 9, 2), px."""
    rng = np.random.default_rng(seed)
    still = np.zeros((t.size, 9, 2))
    exact = two_links.places(phi)
    radial = exact - CENTRE_PX
    r2 = (radial**2).sum(axis=2, keepdims=True) / 640.0**2
    a, b = rng.uniform(0, 2 * np.pi, 2)
    shake = (
        np.stack([np.sin(2 * np.pi * 11 * t + a), np.sin(2 * np.pi * 17 * t + b)], axis=1)[:, None, :] + still
    )
    load = np.stack([np.cos(phi[:, 1]), np.sin(phi[:, 1])], axis=1)
    play = still.copy()
    play[:, 3:] = load[:, None, :]
    aspect = still.copy()
    aspect[..., 0] = exact[..., 0] - CENTRE_PX[0]
    return {
        "none": still,
        "camera shakes by 0.05 px": 0.05 * shake,
        "camera shakes by 0.2 px": 0.2 * shake,
        "elbow has 0.1 px of play": 0.1 * play,
        "lens bends 0.2 px at the edge": 0.2 * radial / 640.0 * r2,
        "lens bends 1 px at the edge": 1.0 * radial / 640.0 * r2,
        "pixels wider by 0.05 %": 5e-4 * aspect,
        "pixels wider by 0.5 %": 5e-3 * aspect,
    }


def main() -> None:
    """One line per fault: RMS errors of both estimators, their ratio, error over stated sigma, and the
    note.
    """
    table: dict[str, list[Floats]] = {}
    noted: dict[str, int] = {}
    methods: tuple[Method, ...] = ("rigid", "linkage")
    for seed in SEEDS:
        t, phi = tumbling(6000, seed)
        for name, moved in faults(t, phi, seed).items():
            nodes = two_links.film(t, phi, seed, moved_px=moved)
            row = []
            for method in methods:
                found = angles(nodes, method, zero="reference_frame")
                error = found.phi_rad - phi
                error -= error.mean(axis=0)
                row.append(np.concatenate([error.std(axis=0), (error / found.sigma_rad).std(axis=0)]))
                noted[name] = noted.get(name, 0) + bool(found.meta["notes"])
            table.setdefault(name, []).append(np.array(row))
    print("fault | rigid phi1, phi2 mdeg | linkage phi1, phi2 mdeg | error/stated rigid | linkage | noted")
    for name, rows in table.items():
        rms = np.sqrt((np.array(rows) ** 2).mean(axis=0))
        mdeg = 1e3 * np.degrees(rms[:, :2])
        print(
            f"{name} | {mdeg[0, 0]:.1f}, {mdeg[0, 1]:.1f} | {mdeg[1, 0]:.1f}, {mdeg[1, 1]:.1f} | "
            f"{rms[0, 2]:.2f}, {rms[0, 3]:.2f} | {rms[1, 2]:.2f}, {rms[1, 3]:.2f} | {noted[name]}/{len(rows)}"
        )


if __name__ == "__main__":
    main()
