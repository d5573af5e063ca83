"""Node tables of mechanisms with any number of links, made without a film: exact places, Gaussian noise, truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydpend.nodes import MISSING, SEEN, Joint, Node, Nodes, Rig

from tests.support.mechanism_films import body, still, swing

Floats = NDArray[np.float64]
Layout = Sequence[tuple[float, float]]

SIGMA_PX = 0.05
META: dict[str, Any] = {
    "schema_version": 1,
    "tool": "tests",
    "source": {
        "name": "made.mp4",
        "container": "mp4",
        "codec": "h264",
        "width": 640,
        "height": 512,
        "depth_bits": 8,
        "rate_origin": "user",
        "time_base": [1, 500],
        "warnings": [],
    },
    "settings": {},
    "ending": {"kind": "complete"},
}


@dataclass(frozen=True, eq=False)
class Made:
    """A motion with its truth, image coordinates.

    ``phi_rad`` (T, L): from hanging, counter-clockwise. ``joints``: name, links and places (T, 2) of each joint.
    """

    t_s: Floats
    phi_rad: Floats
    links: tuple[str, ...]
    places_px: tuple[Floats, ...]
    joints: tuple[tuple[str, tuple[str, ...], Floats], ...]

    def nodes(
        self,
        seed: int,
        *,
        sigma_px: float = SIGMA_PX,
        reference: int = 0,
        hidden: NDArray[np.bool_] | None = None,
        joints: bool = True,
        joint_error_px: float = 0.3,
    ) -> Nodes:
        """The node table that a tracker makes of it; ``hidden`` (T, N). The rig's joints err as stated."""
        rng = np.random.default_rng(seed)
        exact = np.concatenate(self.places_px, axis=1)
        xy = exact + rng.normal(0, sigma_px, exact.shape)
        which = [name for name, p in zip(self.links, self.places_px, strict=True) for _ in range(p.shape[1])]
        status = np.full(exact.shape[:2], SEEN, np.uint8)
        if hidden is not None:
            status[hidden], xy[hidden] = MISSING, np.nan
        at = exact[reference] + rng.normal(0, sigma_px, exact.shape[1:])
        rig = Rig(
            image_px=(640, 512),
            nodes=tuple(
                Node(f"n{i}", name, float(at[i, 0]), float(at[i, 1])) for i, name in enumerate(which)
            ),
            bodies=self.links,
            joints=tuple(
                Joint(name, links, *(p[reference] + rng.normal(0, joint_error_px, 2)).tolist())
                for name, links, p in self.joints
            )
            if joints
            else (),
            reference_frame=reference,
        )
        seen = status == SEEN
        sigma = np.where(seen, sigma_px, np.nan).astype(np.float32)
        area = np.where(seen, 50.0, np.nan).astype(np.float32)
        frame = np.arange(self.t_s.size, dtype=np.int64)
        return Nodes(frame, self.t_s, xy, sigma, area, status, rig, META)


def _end(origin: Floats, angle: Floats, length: float) -> Floats:
    return np.asarray(origin + length * np.stack([np.sin(angle), np.cos(angle)], -1))


CHAIN = (
    [(20, 8), (70, -8), (45, 10)],
    [(22, -8), (62, 9), (40, 12)],
    [(16, 8), (48, -9), (68, 4)],
    [(20, 6), (50, -6)],
)
LENGTHS_PX = (85.0, 78.0, 70.0, 60.0)
NAMES = ("thigh", "shank", "foot", "toe")


def chain(
    seed: int,
    frames: int = 1500,
    fps: float = 500.0,
    *,
    layouts: Sequence[Layout] = CHAIN[:3],
    start_rad: Sequence[float] | None = None,
    rest_s: float = 0.0,
) -> Made:
    """A pendulum of as many links as there are layouts; with ``rest_s`` it hangs first and is lifted in 1 s."""
    rng = np.random.default_rng(seed)
    n = len(layouts)
    start = np.asarray(start_rad if start_rad is not None else rng.uniform(-1.5, 1.5, n), float)
    phi = swing([length / 800 for length in LENGTHS_PX[:n]], start.tolist(), frames, fps)
    if rest_s:
        u = np.clip((np.arange(round((rest_s + 1) * fps)) / fps - rest_s), 0, 1)
        phi = np.concatenate([(u**3 * (10 - 15 * u + 6 * u * u))[:, None] * start, phi])
    t = np.arange(len(phi)) / fps
    origin, places, joints = still(320, 200, len(phi)), [], []
    for k in range(n):
        joints.append(("pivot" if k == 0 else f"joint{k}", NAMES[max(k - 1, 0) : k + 1], origin))
        places.append(body(origin, phi[:, k], layouts[k]))
        origin = _end(origin, phi[:, k], LENGTHS_PX[k])
    return Made(t, phi, NAMES[:n], tuple(places), tuple(joints))


def four_bar(
    seed: int, frames: int = 1500, fps: float = 500.0, layouts: Sequence[Layout] | None = None
) -> Made:
    """Crank, coupler and rocker: four joints, two of them of the ground."""
    rng = np.random.default_rng(seed)
    on_crank, on_coupler, on_rocker = layouts or (
        [(15, 9), (58, -10), (40, 6)],
        [(40, 12), (165, 10), (90, -14)],
        [(30, -12), (135, -10), (80, 8)],
    )
    t = np.arange(frames) / fps
    a, b = np.array([180.0, 300.0]), np.array([390.0, 300.0])
    crank = rng.uniform(0, 6) + 2 * np.pi * rng.uniform(0.6, 1.2) * t
    phi1 = np.pi / 2 - crank
    c = _end(np.tile(a, (frames, 1)), phi1, 70)
    far = np.hypot(*(b - c).T)
    coupler = np.arctan2(*(b - c).T[::-1]) - np.arccos((200**2 + far**2 - 160**2) / (2 * 200 * far))
    phi2 = np.pi / 2 - np.unwrap(coupler)
    d = _end(c, phi2, 200)
    phi3 = np.pi / 2 - np.unwrap(np.arctan2(*(d - b).T[::-1]))
    grounds = [np.tile(p, (frames, 1)) for p in (a, b)]
    return Made(
        t,
        np.stack([phi1, phi2, phi3], axis=1),
        ("crank", "coupler", "rocker"),
        (body(grounds[0], phi1, on_crank), body(c, phi2, on_coupler), body(grounds[1], phi3, on_rocker)),
        (
            ("A", ("crank",), grounds[0]),
            ("D", ("rocker",), grounds[1]),
            ("B", ("crank", "coupler"), c),
            ("C", ("coupler", "rocker"), d),
        ),
    )


def slider_crank(seed: int, frames: int = 1500, fps: float = 500.0) -> Made:
    """Crank, rod and a slider that only moves along x."""
    rng = np.random.default_rng(seed)
    t = np.arange(frames) / fps
    a = np.tile([180.0, 260.0], (frames, 1))
    phi1 = rng.uniform(0, 6) + 2 * np.pi * rng.uniform(0.6, 1.2) * t
    pin = _end(a, phi1, 60)
    phi2 = np.arccos((260.0 - pin[:, 1]) / 190)
    wrist = _end(pin, phi2, 190)
    none = np.zeros(frames)
    return Made(
        t,
        np.stack([phi1, phi2, none], axis=1),
        ("crank", "rod", "slider"),
        (
            body(a, phi1, [(15, 9), (50, -10), (35, 6)]),
            body(pin, phi2, [(30, 8), (150, -8), (90, 10)]),
            body(wrist, none, [(-12, -20), (14, 18), (0, 24)]),
        ),
        (("A", ("crank",), a), ("B", ("crank", "rod"), pin), ("C", ("rod", "slider"), wrist)),
    )


def rms(values: Floats) -> Floats:
    """Root mean square over the frames, NaN left out."""
    return np.asarray(np.sqrt(np.nanmean(values**2, axis=0)))
