"""Films as people make them for their experiments, drawn with their truth.

``python -m tests.validation.person_films FOLDER [NAME ...]`` gives each film a folder with `film.*`, `truth.csv` and
`meta.json`, as the scorer of films with truth reads them. Everything is drawn at the size of the film from noise,
folds, grain and tiles, with the shutter open for part of each frame, sensor noise and a phone's bit rates. Films are
deterministic.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

Picture = NDArray[Any]
Colour = tuple[float, float, float]
Place = tuple[float, float]
SKIN: Colour = (200, 150, 122)


@dataclass(frozen=True)
class Scene:
    """What is drawn at a time in frames, and where the objects are then, in px (`None` where they are not seen)."""

    size: tuple[int, int]
    fps: int
    frames: int
    draw: Callable[[float], Picture]
    places: Callable[[float], Mapping[str, Place | None]]
    tolerance_px: float
    codec: str = "-c:v libx264 -preset veryfast -crf 26"
    suffix: str = "mp4"
    # Part of a frame for which the shutter is open, and pictures that are averaged over it.
    shutter: float = 0.5
    exposures: int = 5
    noise: float = 3.0
    # Parts of the picture's height that are read one after another during a frame.
    bands: int = 1
    # Gain of a frame.
    gain: Callable[[float], float] = field(default=lambda _: 1.0)
    alternatives: list[list[str]] | None = None
    optional: list[str] = field(default_factory=list)
    wants: str = ""


# -- Surfaces


def grains(rng: np.random.Generator, size: tuple[int, int], scales: Mapping[float, float]) -> Picture:
    """Noise of the given standard deviations, by its scale in px."""
    w, h = size
    out = np.zeros((h, w), np.float32)
    for scale, deviation in scales.items():
        smooth = ndimage.gaussian_filter(rng.normal(0, 1, (h, w)).astype(np.float32), scale, mode="wrap")
        out += deviation * smooth / smooth.std()
    return out


def plaster(seed: int, size: tuple[int, int], colour: Colour, depth: float = 1.0) -> Picture:
    """A rough wall, lit from one side."""
    rng = np.random.default_rng(seed)
    light = 1 + depth * grains(rng, size, {0.7: 0.03, 3: 0.03, 40: 0.06})
    light += np.linspace(-0.08, 0.08, size[0], dtype=np.float32)[None, :]
    return np.array(colour, np.float32) * light[..., None]


def wood(seed: int, size: tuple[int, int], colour: Colour = (150, 105, 65)) -> Picture:
    """Boards with grain along the picture."""
    rng = np.random.default_rng(seed)
    w, h = size
    light = ndimage.gaussian_filter(rng.normal(0, 1, (h, w)).astype(np.float32), (0.8, 30), mode="wrap")
    light = 1 + 0.1 * light / light.std() + grains(rng, size, {12: 0.05})
    light[:: max(h // 5, 1)] *= 0.5
    surface: Picture = np.array(colour, np.float32) * light[..., None]
    return surface


def curtain(seed: int, size: tuple[int, int], colour: Colour = (120, 60, 50)) -> Picture:
    """Folds that hang down."""
    rng = np.random.default_rng(seed)
    w, h = size
    y, x = np.mgrid[:h, :w].astype(np.float32)
    phase = grains(rng, size, {60: 1.2})
    light = 0.8 + 0.25 * np.sin(x / 13 + phase) + 0.1 * np.sin(x / 5.1 + 2 * phase + y / 300)
    surface: Picture = np.array(colour, np.float32) * (light + grains(rng, size, {0.8: 0.05}))[..., None]
    return surface


def tiles(seed: int, size: tuple[int, int], step: int = 60, colour: Colour = (175, 170, 160)) -> Picture:
    """Tiles of unlike shades with dark joints."""
    rng = np.random.default_rng(seed)
    w, h = size
    y, x = np.mgrid[:h, :w]
    shades = rng.normal(1, 0.07, (h // step + 1, w // step + 1)).astype(np.float32)
    light = shades[y // step, x // step] + grains(rng, size, {0.8: 0.03, 6: 0.03})
    light[(y % step < 2) | (x % step < 2)] *= 0.55
    surface: Picture = np.array(colour, np.float32) * light[..., None]
    return surface


def clutter(seed: int, picture: Picture, count: int = 8) -> Picture:
    """A wall with shelves, posters and boxes of stripes on it."""
    rng = np.random.default_rng(seed)
    out = picture.copy()
    h, w = out.shape[:2]
    for _ in range(count):
        bw, bh = int(rng.integers(w // 16, w // 5)), int(rng.integers(h // 14, h // 4))
        x, y = int(rng.integers(0, w - bw)), int(rng.integers(0, h - bh))
        part = out[y : y + bh, x : x + bw]
        part[:] = 0.25 * part + 0.75 * rng.uniform(30, 220, 3)
        part[:: int(rng.integers(5, 12))] *= 0.6
        part[:, :2] *= 0.4
    return out


# -- Things


def paint(
    picture: Picture, box: tuple[float, float, float, float], shape: Callable[..., Picture], colour: object
) -> None:
    """Lays a colour, or a function of places that gives one, over the part of each pixel that a shape covers."""
    h, w = picture.shape[:2]
    x0, y0, x1, y1 = (
        int(np.floor(box[0])),
        int(np.floor(box[1])),
        int(np.ceil(box[2])) + 1,
        int(np.ceil(box[3])) + 1,
    )
    x0, y0, x1, y1 = max(x0, 0), max(y0, 0), min(x1, w), min(y1, h)
    if x0 >= x1 or y0 >= y1:
        return
    y, x = np.mgrid[y0:y1, x0:x1].astype(np.float32)
    part = picture[y0:y1, x0:x1]
    covered = np.clip(shape(x, y), 0, 1)[..., None]
    paint_colour = colour(x, y) if callable(colour) else np.array(colour, np.float32)
    part += covered * (paint_colour - part)


def disc(picture: Picture, at: Place, radius: float, colour: object, part: float = 1.0) -> None:
    """A disc, covering a part of what is behind it."""
    (x0, y0), r = at, radius + 1

    def inside(x: Picture, y: Picture) -> Picture:
        covered: Picture = part * np.clip(radius - np.hypot(x - x0, y - y0) + 0.5, 0, 1)
        return covered

    paint(picture, (x0 - r, y0 - r, x0 + r, y0 + r), inside, colour)


def ball(picture: Picture, at: Place, radius: float, colour: Colour, shine: float = 0.7) -> None:
    """A ball that is lit from the upper left, with a highlight."""

    def shaded(x: Picture, y: Picture) -> Picture:
        light = 1.1 - 0.45 * np.clip(((x - at[0]) + (y - at[1])) / (2 * radius) + 0.3, 0, 1.3)
        return np.array(colour, np.float32) * light[..., None]

    disc(picture, at, radius, shaded)
    disc(picture, (at[0] - 0.35 * radius, at[1] - 0.4 * radius), 0.2 * radius, (255, 255, 255), shine)


def line(picture: Picture, a: Place, b: Place, radius: float, colour: object, part: float = 1.0) -> None:
    """A thick line with round ends."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    length = max(dx * dx + dy * dy, 1e-9)

    def inside(x: Picture, y: Picture) -> Picture:
        t = np.clip(((x - a[0]) * dx + (y - a[1]) * dy) / length, 0, 1)
        return part * np.clip(radius - np.hypot(x - a[0] - t * dx, y - a[1] - t * dy) + 0.5, 0, 1)

    r = radius + 1
    paint(
        picture,
        (min(a[0], b[0]) - r, min(a[1], b[1]) - r, max(a[0], b[0]) + r, max(a[1], b[1]) + r),
        inside,
        colour,
    )


def block(picture: Picture, at: Place, half: Place, angle: float, colour: object) -> None:
    """A rectangle that is turned."""
    c, s = np.cos(angle), np.sin(angle)

    def inside(x: Picture, y: Picture) -> Picture:
        u, v = (x - at[0]) * c + (y - at[1]) * s, -(x - at[0]) * s + (y - at[1]) * c
        surface: Picture = np.clip(half[0] - np.abs(u) + 0.5, 0, 1) * np.clip(half[1] - np.abs(v) + 0.5, 0, 1)
        return surface

    r = float(np.hypot(*half)) + 1
    paint(picture, (at[0] - r, at[1] - r, at[0] + r, at[1] + r), inside, colour)


def hand(picture: Picture, at: Place, angle: float, size: float) -> None:
    """A forearm in a sleeve with a hand of four fingers, which end at the place."""
    c, s = np.cos(angle), np.sin(angle)

    def to(u: float, v: float) -> Place:
        return at[0] + size * (u * c - v * s), at[1] + size * (u * s + v * c)

    line(picture, to(80, 0), to(420, 30), 26 * size, (70, 80, 120))
    line(picture, to(45, 0), to(100, 5), 23 * size, SKIN)
    for k in range(4):
        shade = (SKIN[0] - 9 * k, SKIN[1] - 7 * k, SKIN[2] - 4 * k)
        line(picture, to(45, -18 + 12 * k), to(4 * abs(k - 1), -14 + 9 * k), 6.5 * size, shade)


def person(picture: Picture, x: float, t: float, height: float, shirt: Colour) -> None:
    """A person who walks."""
    h = picture.shape[0]
    y = h - height
    swing = 0.08 * height * np.sin(t / 6)
    line(picture, (x, y + 0.5 * height), (x + swing, h + 20), 0.06 * height, (40, 45, 60))
    line(picture, (x, y + 0.5 * height), (x - swing, h + 20), 0.06 * height, (45, 50, 70))
    line(picture, (x, y + 0.22 * height), (x, y + 0.5 * height), 0.11 * height, shirt)
    line(picture, (x, y + 0.24 * height), (x - 1.5 * swing, y + 0.55 * height), 0.035 * height, SKIN)
    disc(picture, (x, y + 0.08 * height + 3 * np.sin(t / 3)), 0.075 * height, SKIN)
    disc(picture, (x, y + 0.05 * height + 3 * np.sin(t / 3)), 0.07 * height, (60, 40, 30))


def moved(picture: Picture, shift: Place) -> Picture:
    """A picture that the camera's own motion shifts; it goes on beyond its edges as in a mirror."""
    return np.stack(
        [ndimage.shift(picture[..., c], shift[::-1], order=1, mode="mirror") for c in range(3)], -1
    )


def shake(seed: int, frames: int, px: float) -> Callable[[float], Place]:
    """The motion of a camera that is held in a hand, with this standard deviation a coordinate."""
    rng = np.random.default_rng(seed)
    walk = ndimage.gaussian_filter1d(rng.normal(0, 1, (frames + 20, 2)), 4, axis=0)
    walk *= px / walk.std(axis=0)
    at = np.arange(len(walk))
    return lambda t: (float(np.interp(t + 5, at, walk[:, 0])), float(np.interp(t + 5, at, walk[:, 1])))


# -- Writing


def expose(scene: Scene, frame: int) -> Picture:
    """One frame: the mean over the open shutter, each band of rows a little later than the one above."""
    parts = []
    h = scene.size[1]
    for band in range(scene.bands):
        rows = slice(band * h // scene.bands, (band + 1) * h // scene.bands)
        start = frame + (band / scene.bands - 0.5 if scene.bands > 1 else 0.0)
        times = start + scene.shutter * (np.arange(scene.exposures) / max(scene.exposures - 1, 1) - 0.5)
        parts.append(np.mean([scene.draw(float(t))[rows] for t in times], axis=0))
    return np.concatenate(parts) * scene.gain(frame)


def write(folder: Path, name: str, scene: Scene) -> None:
    """Writes a film, its truth and what is known of it."""
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(7)
    w, h = scene.size
    film = f"film.{scene.suffix}"
    command = f"ffmpeg -v error -y -f rawvideo -pix_fmt rgb24 -s {w}x{h} -r {scene.fps} -i - {scene.codec}"
    command += " -pix_fmt yuv420p"
    places: dict[str, list[tuple[int, float, float]]] = {}
    with subprocess.Popen([*command.split(), str(folder / film)], stdin=subprocess.PIPE) as encoder:
        assert encoder.stdin is not None
        for k in range(scene.frames):
            noisy = expose(scene, k) + rng.normal(0, scene.noise, (h, w, 3))
            encoder.stdin.write(np.clip(np.round(noisy), 0, 255).astype(np.uint8).tobytes())
            for thing, place in scene.places(k).items():
                if place is not None and 0 <= place[0] < w and 0 <= place[1] < h:
                    places.setdefault(thing, []).append((k, *place))
    assert encoder.returncode == 0
    rows = [f"{k},{thing},{x:.3f},{y:.3f}" for thing, all_ in places.items() for k, x, y in all_]
    (folder / "truth.csv").write_text("frame,object,x_px,y_px\n" + "\n".join(rows) + "\n")
    meta = {
        "name": name,
        "film": film,
        "fps_true": scene.fps,
        "frames": scene.frames,
        "tolerance_px": scene.tolerance_px,
    }
    meta |= {"optional": scene.optional, "user_wants": scene.wants, "absent": {}}
    if scene.alternatives:
        meta["alternatives"] = scene.alternatives
    (folder / "meta.json").write_text(json.dumps(meta, indent=1))


def main(arguments: list[str]) -> None:
    """Writes the films of the given names, or all, into a folder."""
    from tests.validation.person_scenes import SCENES

    folder, names = Path(arguments[0]), arguments[1:] or list(SCENES)
    for name in names:
        write(folder / name, name, SCENES[name]())
        print(name, flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
