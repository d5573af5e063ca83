"""Films of mechanisms with known markers, drawn by nothing of pydpend's: links with discs, any background.

Usage: python -m tests.support.mechanism_films four-bar four-bar.mp4 [SEED]
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

W, H, FPS, FRAMES = 640, 512, 500, 600
RADIUS_PX = 5.0
LEVEL, GROUND, NOISE = 220.0, 12.0, 3.0
GRAVITY = 9.81
UPPER = [(20, 12), (80, -9), (128, 10), (50, 14)]
LOWER = [(22, -10), (62, 10), (104, -6), (108, 12)]
LENGTHS_PX = (140.0, 115.0)
PIVOT = (W / 2, 0.42 * H)


@dataclass
class Mechanism:
    """Where the markers are, (frames, markers, 2) in px, and which body each is on; what else is drawn."""

    places_px: Floats
    body: NDArray[np.int64]
    fps: float = FPS
    background: Floats = field(default_factory=lambda: np.full((H, W), GROUND))
    hand: bool = False
    hidden: NDArray[np.bool_] | None = None

    def covered(self) -> NDArray[np.bool_]:
        """Markers that are not drawn, frame by frame."""
        return np.zeros(self.places_px.shape[:2], bool) if self.hidden is None else self.hidden


def swing(lengths_m: Sequence[float], start_rad: Sequence[float], frames: int, fps: float) -> Floats:
    """Angles from hanging, (frames, links) in rad, of equal point masses on a chain (Runge and Kutta, fourth order)."""
    n, length = len(lengths_m), np.asarray(lengths_m, float)
    mass = np.array([[n - max(i, j) for j in range(n)] for i in range(n)], float)

    def rates(state: Floats) -> Floats:
        angle, rate = state
        apart = angle[:, None] - angle[None, :]
        lever = mass * np.outer(length, length)
        force = -(lever * np.sin(apart)) @ rate**2 - GRAVITY * np.diag(mass) * length * np.sin(angle)
        return np.stack([rate, np.linalg.solve(lever * np.cos(apart), force - 0.05 * length**2 * rate)])

    state = np.stack([np.asarray(start_rad, float), np.zeros(n)])
    out = np.empty((frames, n))
    steps = max(1, round(2000 / fps))
    h = 1 / fps / steps
    for k in range(frames):
        out[k] = state[0]
        for _ in range(steps):
            a = rates(state)
            b = rates(state + h / 2 * a)
            c = rates(state + h / 2 * b)
            d = rates(state + h * c)
            state = state + h / 6 * (a + 2 * b + 2 * c + d)
    return out


def body(origin_px: Floats, angle_rad: Floats, markers: Sequence[tuple[float, float]]) -> Floats:
    """Places of markers (along the link, beside it) of a body at an origin and an angle from hanging."""
    along = np.stack([np.sin(angle_rad), np.cos(angle_rad)], -1)
    beside = np.stack([np.cos(angle_rad), -np.sin(angle_rad)], -1)
    at = np.asarray(markers, float)
    placed: Floats = origin_px[:, None] + along[:, None] * at[:, :1] + beside[:, None] * at[:, 1:]
    return placed


def still(x: float, y: float, frames: int) -> Floats:
    return np.tile([x, y], (frames, 1)).astype(float)


def of_bodies(bodies: Sequence[Floats], fps: float = FPS) -> Mechanism:
    which = np.concatenate([np.full(b.shape[1], i) for i, b in enumerate(bodies)])
    return Mechanism(np.concatenate(bodies, axis=1), which, fps)


def chain(
    rng: np.random.Generator,
    lengths_px: Sequence[float],
    layouts: Sequence[Sequence[tuple[float, float]]],
    fps: float = FPS,
    frames: int = FRAMES,
) -> Mechanism:
    """A pendulum of so many links, started anywhere up to 126 deg from hanging."""
    start = [rng.uniform(-2.2, 2.2) for _ in lengths_px]
    angles = swing([length / 800 for length in lengths_px], start, frames, fps)
    origin, bodies = still(*PIVOT, frames), []
    for i, length in enumerate(lengths_px):
        bodies.append(body(origin, angles[:, i], layouts[i]))
        origin = origin + length * np.stack([np.sin(angles[:, i]), np.cos(angles[:, i])], -1)
    return of_bodies(bodies, fps)


def double(rng: np.random.Generator, fps: float = FPS, frames: int = FRAMES) -> Mechanism:
    return chain(rng, LENGTHS_PX, [UPPER, LOWER], fps, frames)


def cart_pole(rng: np.random.Generator, cart: Sequence[tuple[float, float]]) -> Mechanism:
    t = np.arange(FRAMES) / FPS
    x = W / 2 + 110 * np.sin(2 * np.pi * 0.9 * t + rng.uniform(0, 6))
    origin = np.stack([x, np.full(FRAMES, 0.4 * H)], -1)
    pole = swing([0.25], [rng.uniform(1, 2.5)], FRAMES, FPS)[:, 0]
    return of_bodies([body(origin, np.zeros(FRAMES), cart), body(origin, pole, [(70, 0), (165, 0)])])


def four_bar(rng: np.random.Generator, layouts: Sequence[Sequence[tuple[float, float]]]) -> Mechanism:
    """Crank, coupler and rocker: four joints, two of them of the ground."""
    a, b = np.array([0.28 * W, 0.62 * H]), np.array([0.28 * W + 210, 0.62 * H])
    crank = rng.uniform(0, 6) + 2 * np.pi * rng.uniform(1.2, 2.0) * np.arange(FRAMES) / FPS
    c = a + 70 * np.stack([np.cos(crank), np.sin(crank)], -1)
    to = b - c
    far = np.hypot(*to.T)
    coupler = np.arctan2(to[:, 1], to[:, 0]) - np.arccos((200**2 + far**2 - 160**2) / (2 * 200 * far))
    end = c + 200 * np.stack([np.cos(coupler), np.sin(coupler)], -1)
    rocker = np.arctan2(*(end - b).T[::-1])
    origins = [np.tile(a, (FRAMES, 1)), c, np.tile(b, (FRAMES, 1))]
    turned = zip(origins, (crank, coupler, rocker), layouts, strict=True)
    return of_bodies([body(o, np.pi / 2 - angle, layout) for o, angle, layout in turned])


def two_pendulums(
    rng: np.random.Generator, one: Sequence[tuple[float, float]], other: Sequence[tuple[float, float]]
) -> Mechanism:
    def single(x: float, layout: Sequence[tuple[float, float]], sign: float) -> Floats:
        angle = swing([0.22], [sign * rng.uniform(0.5, 2)], FRAMES, FPS)[:, 0]
        return body(still(x, 0.3 * H, FRAMES), angle, layout)

    return of_bodies([single(0.25 * W, one, 1), single(0.75 * W, other, -1)])


def coupled(rng: np.random.Generator) -> Mechanism:
    """Two pendulums in their two modes."""
    t = 1.6 * np.arange(FRAMES) / FPS
    slow = rng.uniform(0.3, 0.7) * np.cos(2 * np.pi * 1.1 * t)
    fast = rng.uniform(0.3, 0.7) * np.cos(2 * np.pi * 1.5 * t + rng.uniform(0, 6))
    one = body(still(0.33 * W, 0.25 * H, FRAMES), slow + fast, [(40, 8), (120, -8), (170, 6)])
    return of_bodies(
        [one, body(still(0.66 * W, 0.25 * H, FRAMES), slow - fast, [(50, -8), (110, 10), (180, 4)])]
    )


def sliders(rng: np.random.Generator) -> Mechanism:
    t = np.arange(FRAMES) / FPS
    high = np.stack([0.4 * W + 90 * np.sin(2 * np.pi * 1.3 * t), np.full(FRAMES, 0.35 * H)], -1)
    low = np.stack(
        [0.55 * W + 110 * np.sin(2 * np.pi * 0.9 * t + rng.uniform(0, 6)), np.full(FRAMES, 0.65 * H)], -1
    )
    none = np.zeros(FRAMES)
    return of_bodies(
        [
            body(high, none, [(-15, -30), (15, -28), (10, 32)]),
            body(low, none, [(-12, -34), (18, -20), (6, 30)]),
        ]
    )


def moved(by_px: Callable[[np.random.Generator], Floats]) -> Callable[[np.random.Generator], Mechanism]:
    """A double pendulum before a camera that moves."""

    def made(rng: np.random.Generator) -> Mechanism:
        out = double(rng)
        out.places_px += by_px(rng)[:, None]
        return out

    return made


def repeated(rng: np.random.Generator) -> Mechanism:
    """A double pendulum of which each frame is shown twice, as in a recording of a screen."""
    out = double(rng)
    out.places_px = out.places_px[np.arange(FRAMES) // 2 * 2]
    return out


def hidden(rng: np.random.Generator) -> Mechanism:
    """A double pendulum of which 40 % of the markers are hidden for 200 ms, twice."""
    out = double(rng)
    count = out.places_px.shape[1]
    gone = np.zeros((FRAMES, count), bool)
    for first in (150, 370):
        gone[first : first + FPS // 5, rng.permutation(count)[: round(0.4 * count)]] = True
    out.hidden = gone
    return out


def scratched(rng: np.random.Generator) -> Mechanism:
    out = double(rng)
    y, x = np.mgrid[:H, :W]
    for _ in range(25):
        u, v, angle = x - rng.uniform(0, W), y - rng.uniform(0, H), rng.uniform(0, np.pi)
        along, beside = u * np.cos(angle) + v * np.sin(angle), v * np.cos(angle) - u * np.sin(angle)
        out.background[(abs(along) < rng.uniform(15, 100)) & (abs(beside) < 1)] = rng.uniform(40, 90)
    return out


def uneven_light(rng: np.random.Generator) -> Mechanism:
    out = double(rng)
    y, x = np.mgrid[:H, :W]
    out.background += 60 * np.exp(-((x - 0.3 * W) ** 2 + (y - 0.3 * H) ** 2) / (2 * (0.3 * W) ** 2))
    return out


def cluttered(rng: np.random.Generator) -> Mechanism:
    """A double pendulum before patches and 60 still bright spots, with a hand that moves."""
    out = double(rng)
    coarse = 40 + 20 * rng.random((H // 40 + 1, W // 40 + 1))
    out.background[:] = np.kron(coarse, np.ones((40, 40)))[:H, :W]
    y, x = np.mgrid[:H, :W]
    for _ in range(60):
        u, v = rng.uniform(0, W), rng.uniform(0, H)
        out.background[np.hypot(x - u, y - v) < rng.uniform(1.5, 6)] = rng.uniform(60, 200)
    out.hand = True
    return out


KINDS: dict[str, Callable[[np.random.Generator], Mechanism]] = {
    "double": double,
    "two a link": lambda r: chain(r, LENGTHS_PX, [[(45, 0), (130, 0)], [(30, 0), (105, 0)]]),
    "five a link": lambda r: chain(
        r,
        LENGTHS_PX,
        [
            [(15, 10), (45, -10), (75, 8), (105, -6), (130, 9)],
            [(20, -9), (45, 10), (70, -8), (90, 7), (112, -10)],
        ],
    ),
    "triple": lambda r: chain(
        r,
        (85, 78, 70),
        [[(20, 8), (70, -8), (45, 10)], [(22, -8), (62, 9), (40, 12)], [(16, 8), (48, -9), (68, 4)]],
    ),
    "one a link, three links": lambda r: chain(r, (85, 75, 70), [[(85, 0)], [(75, 0)], [(70, 0)]]),
    "rows alike": lambda r: chain(
        r, LENGTHS_PX, [[(25, 0), (65, 0), (105, 0)], [(25, 0), (65, 0), (105, 0)]]
    ),
    "rectangle and rhombus": lambda r: chain(
        r,
        LENGTHS_PX,
        [[(35, 18), (35, -18), (115, 18), (115, -18)], [(30, 0), (65, 18), (65, -18), (100, 0)]],
    ),
    "marker on the elbow": lambda r: chain(
        r, LENGTHS_PX, [[(30, 9), (75, 10), (140, 0)], [(60, 8), (115, 0)]]
    ),
    "four-bar": lambda r: four_bar(r, [[(15, 9), (58, -10)], [(40, 12), (165, 10)], [(30, -12), (135, -10)]]),
    "cart and pole, 2 + 2": lambda r: cart_pole(r, [(0, -36), (0, 36)]),
    "cart and pole, 3 + 2": lambda r: cart_pole(r, [(0, -36), (0, 36), (-18, 10)]),
    "coupled pendulums": coupled,
    "two pendulums alike": lambda r: two_pendulums(r, *2 * [[(40, 8), (120, -8), (150, 6)]]),
    "two pendulums alike, 2 + 2": lambda r: two_pendulums(r, *2 * [[(60, 0), (150, 0)]]),
    "two sliders": sliders,
    "camera shakes 2 px": moved(lambda r: r.normal(0, 2.0, (FRAMES, 2))),
    "camera drifts": moved(lambda r: np.outer(np.arange(FRAMES) / FRAMES, r.uniform(-12, 12, 2))),
    "each frame twice": repeated,
    "40 % hidden for 200 ms": hidden,
    "scratches": scratched,
    "uneven light": uneven_light,
    "clutter and a hand": cluttered,
    "25 frames per s": lambda r: double(r, 25, 300),
    "50 frames per s": lambda r: double(r, 50, 300),
}


SINGLE: dict[str, Callable[[np.random.Generator], Mechanism]] = {
    "bob": lambda r: chain(r, (180,), [[(180, 0)]], fps=100, frames=1500),
}
"""A marker alone, which the mechanisms' validation has no count for: it is of bodies."""


def drawn(made: Mechanism, path: Path, seed: int) -> None:
    """Writes the film: H.264 of high quality, gray."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:H, :W]
    command = ["ffmpeg", "-v", "error", "-y", "-f", "rawvideo", "-pix_fmt", "gray", "-s", f"{W}x{H}"]
    command += ["-r", str(made.fps), "-i", "-", "-c:v", "libx264", "-crf", "14", "-preset", "veryfast"]
    covered = made.covered()
    with subprocess.Popen([*command, "-pix_fmt", "yuv420p", str(path)], stdin=subprocess.PIPE) as encoder:
        assert encoder.stdin is not None
        for k, places in enumerate(made.places_px):
            picture = made.background.copy()
            if made.hand:
                u, v = W * (0.85 + 0.1 * np.sin(k / 40)), H * (0.8 + 0.08 * np.cos(k / 31))
                hand = ((x - u) / 50) ** 2 + ((y - v) / 75) ** 2 < 1
                picture[hand] = 120 + 30 * np.sin((x[hand] - u) / 7)
            for place in places[~covered[k]]:
                x0, y0 = (max(int(c - RADIUS_PX - 2), 0) for c in place)
                box = np.s_[y0 : y0 + int(2 * RADIUS_PX + 6), x0 : x0 + int(2 * RADIUS_PX + 6)]
                part = np.clip(RADIUS_PX + 0.5 - np.hypot(x[box] - place[0], y[box] - place[1]), 0, 1)
                picture[box] += (LEVEL - picture[box]) * part
            picture += rng.normal(0, NOISE, picture.shape)
            encoder.stdin.write(np.clip(np.round(picture), 0, 255).astype(np.uint8).tobytes())
    assert encoder.returncode == 0


def main(words: Sequence[str]) -> int:
    """Draws the film of one of `KINDS` or `SINGLE`: its name, the file, and a seed."""
    kind, path, *seed = words
    number = int(seed[0]) if seed else 4
    drawn((KINDS | SINGLE)[kind](np.random.default_rng(number)), Path(path), number)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
