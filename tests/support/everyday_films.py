"""Films as a person makes them: a wall with posters, a hand, blur of the shutter, noise, H.264; with their truth.

The scenes are drawn for a picture of 640 x 480 px with the y axis down, and filmed at half of that.
"""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Picture = NDArray[np.float64]
Colour = tuple[float, float, float]
# Pixels of the scene along one of the film.
SHRINK = 2
W, H = 640 // SHRINK, 480 // SHRINK
SKIN: Colour = (205, 150, 120)
_y, _x = np.mgrid[:H, :W] * float(SHRINK) + (SHRINK - 1) / 2


def filmed(x: float, y: float) -> tuple[float, float]:
    """A place of the scene in pixels of the film, whose centres are whole numbers."""
    return (x - (SHRINK - 1) / 2) / SHRINK, (y - (SHRINK - 1) / 2) / SHRINK


def wall(seed: int, base: Colour) -> Picture:
    """A wall of grains of several sizes, with six posters of bars."""
    rng = np.random.default_rng(seed)
    light = np.ones((H, W))
    for size in (1, 4, 16):
        grains = rng.normal(0, 0.05, (H // size + 1, W // size + 1))
        light += np.kron(grains, np.ones((size, size)))[:H, :W]
    out: Picture = np.array(base) * light[..., None]
    for _ in range(6):
        x, y, w, h = (int(v) for v in rng.integers((0, 0, 15, 10), (W - 40, H - 40, 70, 50)))
        part = out[y : y + h, x : x + w]
        part[:] = 0.4 * part + 0.6 * rng.uniform(40, 220, 3)
        part[::7, 3:] *= 0.6
    bounded: Picture = np.clip(out, 5, 250)
    return bounded


def disc(x: float, y: float, radius: float) -> Picture:
    """The part of each pixel that a disc covers."""
    covered: Picture = np.clip((radius - np.hypot(_x - x, _y - y)) / SHRINK + 0.5, 0, 1)
    return covered


def capsule(a: tuple[float, float], b: tuple[float, float], radius: float) -> Picture:
    """The part of each pixel that a thick line covers."""
    along = np.array(b) - np.array(a)
    part = ((_x - a[0]) * along[0] + (_y - a[1]) * along[1]) / max(float(along @ along), 1e-9)
    part = np.clip(part, 0, 1)
    off = np.hypot(_x - a[0] - part * along[0], _y - a[1] - part * along[1])
    covered: Picture = np.clip((radius - off) / SHRINK + 0.5, 0, 1)
    return covered


def over(picture: Picture, part: Picture, colour: Colour) -> Picture:
    """A picture with a colour over part of each pixel."""
    return picture + part[..., None] * (np.array(colour) - picture)


def hand(picture: Picture, x: float, y: float, angle: float) -> Picture:
    """An arm in a sleeve with a hand of four fingers, which point away from it."""
    c, s = np.cos(angle), np.sin(angle)

    def at(u: float, v: float) -> tuple[float, float]:
        return x + u * c - v * s, y + u * s + v * c

    out = over(picture, capsule(at(40, 0), at(400, 20), 26), (90, 60, 110))
    out = over(out, capsule(at(0, 0), at(60, 5), 24), SKIN)
    for k in range(4):
        finger = capsule(at(-10, -18 + 12 * k), at(-48 + 4 * abs(k - 1), -24 + 15 * k), 6.5)
        out = over(out, finger, (SKIN[0] - 8 * k, SKIN[1] - 6 * k, SKIN[2]))
    return out


def ball(picture: Picture, x: float, y: float, radius: float, colour: Colour) -> Picture:
    """A ball, shaded towards the lower right, with a highlight."""
    light = 1.15 - 0.35 * np.clip(((_x - x) + (_y - y)) / (2 * radius) + 0.3, 0, 1.2)
    shaded = np.array(colour) * light[..., None]
    out = picture + disc(x, y, radius)[..., None] * (shaded - picture)
    return over(out, 0.7 * disc(x - 0.35 * radius, y - 0.4 * radius, 0.18 * radius), (255, 255, 255))


def encode(path: Path, frames: int, fps: int, scene: Callable[[float], Picture], *, seed: int = 1) -> None:
    """Writes a scene, a function of the frame, as H.264 (crf 24): the shutter is open for half of each frame."""
    rng = np.random.default_rng(seed)
    command = f"ffmpeg -v error -y -f rawvideo -pix_fmt rgb24 -s {W}x{H} -r {fps} -i -".split()
    command += ["-c:v", "libx264", "-preset", "veryfast", "-crf", "24", "-pix_fmt", "yuv420p"]
    with subprocess.Popen([*command, str(path)], stdin=subprocess.PIPE) as encoder:
        assert encoder.stdin is not None
        for k in range(frames):
            blurred = np.mean([scene(k + open_for) for open_for in (-0.25, 0.0, 0.25)], axis=0)
            noisy = blurred + rng.normal(0, 3, blurred.shape)
            encoder.stdin.write(np.clip(np.round(noisy), 0, 255).astype(np.uint8).tobytes())
    assert encoder.returncode == 0


def toss(frame: float) -> tuple[float, float]:
    """A ball that a hand lets go in frame 14 and that flies freely from there."""
    t = max(frame - 14, 0)
    return 120 + 6.5 * t, 420 - 16.5 * t + 0.27 * t * t


def film_toss(path: Path, frames: int = 70) -> None:
    """An orange ball tossed by a hand before a wall of posters."""
    behind = wall(16, (120, 100, 90))

    def scene(k: float) -> Picture:
        out = hand(behind, 105, 450 + 2 * max(0, k - 14) + 3 * (14 - min(k, 14)), 0.75 * np.pi)
        return ball(out, *toss(k), 12, (235, 120, 30))

    encode(path, frames, 30, scene)


def film_waving(path: Path, frames: int = 110) -> None:
    """A hand that waves, and a person at the edge: nothing is a marker."""
    behind = wall(15, (180, 175, 165))

    def scene(k: float) -> Picture:
        out = hand(
            behind,
            330 + 120 * np.sin(k / 9),
            240 + 50 * np.sin(k / 5.3 + 1),
            0.25 + 0.3 * float(np.sin(k / 7)),
        )
        x = 40 + 15 * np.sin(k / 23)
        out = over(out, capsule((x, 200), (x - 5, 480), 45), (60, 70, 120))
        return over(out, disc(x, 120 + 3 * float(np.sin(k / 4)), 32), SKIN)

    encode(path, frames, 30, scene)


def roll(frame: float) -> tuple[float, float]:
    """A ball that rolls in from the left and out to the right."""
    return -30 + 11.3 * frame, 300 + 0.4 * frame


def film_rolling(path: Path, frames: int = 62) -> None:
    """A blue ball that comes into the picture and leaves it."""
    behind = wall(17, (150, 130, 110))
    encode(path, frames, 60, lambda k: ball(behind, *roll(k), 20, (40, 70, 190)))


def arms(frame: float) -> tuple[tuple[float, float], tuple[float, float]]:
    """The ends of two arms that hang on each other."""
    a, b = 0.9 * float(np.cos(frame / 9)), 1.3 * float(np.sin(frame / 5.7 + 0.4))
    x, y = 320 + 130 * float(np.sin(a)), 160 + 130 * float(np.cos(a))
    return (x, y), (x + 110 * float(np.sin(b)), y + 110 * float(np.cos(b)))


def film_two_colours(path: Path, frames: int = 110) -> None:
    """Two dark arms with a red sticker on the elbow and a blue one, of the same size, on the tip."""
    behind = wall(18, (185, 180, 170))

    def scene(k: float) -> Picture:
        elbow, tip = arms(k)
        out = over(behind, capsule((320, 160), elbow, 15), (55, 50, 45))
        out = over(out, capsule(elbow, tip, 14), (60, 55, 50))
        return over(over(out, disc(*elbow, 10), (210, 40, 50)), disc(*tip, 10), (40, 80, 215))

    encode(path, frames, 30, scene)
