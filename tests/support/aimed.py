"""Films of two links by cameras that were aimed by eye: node tables whose places a drawn camera has bent."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydpend._native import CAMERA_BY_EYE, recorded_places
from pydpend.nodes import Nodes

from tests.support import two_links

Floats = NDArray[np.float64]

MARKERS: dict[str, tuple[int, ...]] = {"3 + 6": tuple(range(9)), "2 + 2": (0, 2, 3, 8)}
"""Which of the markers of `two_links` a layout has."""

SWINGS = {"wide": np.pi, "20 deg": np.radians(20.0)}
"""How far the links swing to each side, rad."""


def drawn(seed: int) -> Floats:
    """The five numbers of a camera, drawn as one is aimed by eye."""
    return np.asarray(np.random.default_rng([seed, 5]).normal(size=5) * np.array(CAMERA_BY_EYE))


def camera(numbers: Floats, covariance: Floats | None = None) -> dict[str, Any]:
    """A given camera as a rig has it."""
    a, b, v1, v2, k1 = (float(n) for n in numbers)
    out: dict[str, Any] = {"origin": "given", "stretch": [a, b], "vanishing": [v1, v2], "k1": k1}
    return out if covariance is None else out | {"covariance": covariance.tolist()}


def swing(name: str, seed: int, frames: int = 800, fps: float = 200.0) -> tuple[Floats, Floats]:
    """Times and angles (T, 2) of a smooth motion as wide as `SWINGS` says."""
    rng = np.random.default_rng([seed, 6])
    t = np.arange(frames) / fps
    slow, fast, phase = rng.uniform(0.7, 1.1), rng.uniform(1.7, 2.5), rng.uniform(0, 2 * np.pi, 2)
    wave = np.stack(
        [np.sin(2 * np.pi * slow * t + phase[0]), np.sin(2 * np.pi * fast * t + phase[1])], axis=1
    )
    return t, SWINGS[name] * (0.75 * wave + 0.25 * wave[:, ::-1])


def film(
    t_s: Floats, phi_rad: Floats, seed: int, numbers: Floats, markers: str = "3 + 6", sigma_px: float = 0.03
) -> Nodes:
    """The node table of a motion (T, 2) that a camera of these numbers films, and of which the rig says nothing."""
    plain = two_links.film(t_s[:1], phi_rad[:1], seed)
    rig = dataclasses.replace(plain.rig, camera=camera(numbers))
    exact = two_links.places(phi_rad)
    bent = recorded_places(rig.to_json(), exact.reshape(-1, 2)).reshape(exact.shape)
    nodes = two_links.film(t_s, phi_rad, seed, sigma_px=sigma_px, moved_px=bent - exact)
    kept = list(MARKERS[markers])
    return dataclasses.replace(
        nodes,
        rig=dataclasses.replace(nodes.rig, nodes=tuple(nodes.rig.nodes[i] for i in kept)),
        xy_px=nodes.xy_px[:, kept],
        sigma_px=nodes.sigma_px[:, kept],
        area_px=nodes.area_px[:, kept],
        status=nodes.status[:, kept],
    )
