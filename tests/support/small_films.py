"""Films of some kilobytes, a link of two markers that swings, each of another seed."""

from __future__ import annotations

from pathlib import Path

import pydpend as dp

SCENE = """schema = 1
image_px = [160, 160]
frames = 40
rate_hz = 500.0
seed = 1

[camera]
read_noise = 0.5

[light]
background = 8.0

[[link]]
name = "upper"
joint_px = [80.0, 60.0]
along_px = [-8.0, 60.0]
width_px = 14.0
level = 11.0

[link.motion]
kind = "swing"
phi_rad = 0.0
amplitude_rad = 0.8
frequency_hz = 10.0

[[marker]]
name = "n0"
link = "upper"
at_px = [18.0, -3.0]
radius_px = 4.0
level = 210.0

[[marker]]
name = "n1"
link = "upper"
at_px = [44.0, 3.0]
radius_px = 4.0
level = 210.0
"""


def small_film(path: Path, seed: int, frames: int = 40) -> Path:
    """Writes a film; the same seed gives the same bytes."""
    scene = path.with_suffix(".toml")
    scene.write_text(SCENE, "utf-8")
    path.unlink(missing_ok=True)
    dp.film(scene, path, seed=seed, frames=frames)
    scene.unlink()
    return path


def small_films(folder: Path, count: int) -> list[Path]:
    """Writes so many films, ``f000.mp4`` and so on."""
    folder.mkdir(exist_ok=True)
    return [small_film(folder / f"f{k:03}.mp4", k) for k in range(count)]
