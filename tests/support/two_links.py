"""A rig of two links with markers, its motion, and the node table that a tracker would make of it.

Layout as in the paper: three markers on the upper link, six on the lower. Truth is exact; centres get
Gaussian noise of the stated standard uncertainty.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydpend.model import Damping, derived
from pydpend.nodes import MISSING, SEEN, Joint, Node, Nodes, Rig
from pydpend.simulation import simulate

Floats = NDArray[np.float64]

PIVOT_PX = np.array([640.3, 380.7])
"""Image coordinates."""
ELBOW_PX = np.array([3.0, 190.0])
"""Elbow from the pivot, both links hanging, image coordinates (y down)."""
UPPER_PX = np.array([[0.0, 25.0], [-9.0, 95.0], [6.0, 150.0]])
"""Markers of the upper link from the pivot, hanging."""
LOWER_PX = np.array([[-6.0, 20.0], [9.0, 45.0], [-4.0, 80.0], [8.0, 110.0], [-9.0, 150.0], [3.0, 185.0]])
"""Markers of the lower link from the elbow, hanging."""
SIGMA_PX = 0.05


def places(phi_rad: Floats, links: int = 2) -> Floats:
    """Exact centres (T, N, 2), image coordinates: a turn counter-clockwise as seen, y pointing down."""

    def turned(angle: Floats, p: Floats) -> Floats:
        c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
        return np.stack([c * p[:, 0] + s * p[:, 1], -s * p[:, 0] + c * p[:, 1]], axis=-1)

    upper = PIVOT_PX + turned(phi_rad[:, 0], UPPER_PX)
    if links == 1:
        return upper
    elbow = PIVOT_PX + turned(phi_rad[:, 0], ELBOW_PX[None, :])
    return np.concatenate([upper, elbow + turned(phi_rad[:, 1], LOWER_PX)], axis=1)


def film(
    t_s: Floats,
    phi_rad: Floats,
    seed: int,
    *,
    sigma_px: float | Floats = SIGMA_PX,
    hidden: NDArray[np.bool_] | None = None,
    stated: float = 1.0,
    reference_rad: tuple[float, float] = (0.0, 0.0),
    moved_px: Floats | None = None,
) -> Nodes:
    """The node table of a motion (T, L). ``stated`` times the true noise goes into ``sigma_px``.

    ``reference_rad``: the links' angles in the rig's reference picture. ``moved_px`` (T, N, 2) is added to the
    centres: faults of the film.
    """
    links = phi_rad.shape[1]
    rng = np.random.default_rng(seed)
    exact = places(phi_rad, links)
    noise = np.broadcast_to(np.asarray(sigma_px, dtype=np.float64), exact.shape[:2])
    xy = exact + noise[..., None] * rng.standard_normal(exact.shape)
    if moved_px is not None:
        xy = xy + moved_px
    status = np.full(exact.shape[:2], SEEN, dtype=np.uint8)
    sigma = (stated * noise).astype(np.float32)
    if hidden is not None:
        status[hidden] = MISSING
        xy[hidden] = np.nan
        sigma = np.where(hidden, np.float32(np.nan), sigma)
    at = places(np.array([reference_rad[:links]]), links)[0] + rng.normal(0, 0.3, exact.shape[1:])
    names = [("upper", i) for i in range(3)] + [("lower", i) for i in range(6)]
    rig = Rig(
        image_px=(1280, 1024),
        nodes=tuple(
            Node(f"n{i}", body, float(at[i, 0]), float(at[i, 1]))
            for i, (body, _) in enumerate(names[: exact.shape[1]])
        ),
        bodies=("upper", "lower")[:links],
        joints=(Joint("pivot", ("upper",), float(PIVOT_PX[0]), float(PIVOT_PX[1])),),
    )
    frame = np.arange(t_s.size, dtype=np.int64)
    area = np.where(status == SEEN, np.float32(50.0), np.float32(np.nan)).astype(np.float32)
    return Nodes(frame, t_s, xy, sigma, area, status, rig, {})


def drop(seconds: float, fps: float, seed: int, *, rest_s: float = 0.0) -> tuple[Floats, Floats]:
    """Times and angles (T, 2) of a free drop of the paper's pendulum from nearly upside down.

    With ``rest_s`` it hangs still for so long first and is lifted smoothly by hand in 1.5 s. After half a
    minute or so dry friction brings it to rest.
    """
    rng = np.random.default_rng(seed)
    release = np.pi + rng.uniform(-0.3, 0.3, 2)
    lift = 1.5 if rest_s else 0.0
    t = np.arange(round((rest_s + lift + seconds) * fps)) / fps
    falling = t >= rest_s + lift
    damping = Damping(mu_v1=2e-5, mu_v2=1e-5, mu_q2=1e-6, tau_c1=1e-3, tau_c2=5e-5)
    found = simulate(derived("A"), damping, [*release, 0.0, 0.0], t[falling], tolerance=1e-9)
    phi = np.zeros((t.size, 2))
    phi[falling] = found.phi_rad
    if lift:
        u = np.clip((t - rest_s) / lift, 0, 1)
        phi[~falling] = (u**3 * (10 - 15 * u + 6 * u * u))[~falling, None] * release
    return t, phi
