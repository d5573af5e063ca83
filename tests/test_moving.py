"""Recordings without markers: what moves before a still, textured ground is followed, or nothing is named."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pydpend as dp
import pytest
from numpy.typing import NDArray

W, H, RADIUS = 320, 240, 7.0
FILMS = Path(__file__).parent.parent.parent / "shared" / "films"


def ground(seed: int) -> NDArray[np.float64]:
    """Grains of 2 to 20 px, as much brighter or darker as the thing: nothing stands out in a single frame."""
    rng = np.random.default_rng(seed)
    out = np.full((H, W), 110.0)
    y, x = np.mgrid[:H, :W]
    for _ in range(300):
        r, level = rng.uniform(1, 10), rng.uniform(-45, 45)
        out += level * np.clip(r + 0.5 - np.hypot(x - rng.uniform(0, W), y - rng.uniform(0, H)), 0, 1)
    bounded: NDArray[np.float64] = np.clip(out, 40, 180)
    return bounded


def bob(k: int) -> tuple[float, float]:
    """A bob on a string of 160 px, 40 degrees to each side, once in 80 frames."""
    angle = np.radians(40) * np.cos(2 * np.pi * k / 80)
    return 160 + 160 * np.sin(angle), 40 + 160 * np.cos(angle)


def film(path: Path, frames: int, *, moving: bool = True, seed: int = 3) -> None:
    """H.264 as a phone makes it (crf 23), with noise of two grey levels."""
    rng = np.random.default_rng(seed)
    behind = ground(seed)
    y, x = np.mgrid[:H, :W]
    command = [
        "ffmpeg",
        "-v",
        "error",
        "-y",
        "-f",
        "rawvideo",
        "-pix_fmt",
        "gray",
        "-s",
        f"{W}x{H}",
        "-r",
        "60",
    ]
    command += [
        "-i",
        "-",
        "-c:v",
        "libx264",
        "-preset",
        "veryfast",
        "-crf",
        "23",
        "-pix_fmt",
        "yuv420p",
        str(path),
    ]
    with subprocess.Popen(command, stdin=subprocess.PIPE) as encoder:
        assert encoder.stdin is not None
        for k in range(frames):
            u, v = bob(k) if moving else (90.0, 90.0)
            part = np.clip(RADIUS + 0.5 - np.hypot(x - u, y - v), 0, 1)
            picture = behind + (235 - behind) * part + rng.normal(0, 2, behind.shape)
            encoder.stdin.write(np.clip(np.round(picture), 0, 255).astype(np.uint8).tobytes())
    assert encoder.returncode == 0


def test_a_bob_before_texture_is_followed_without_settings_and_says_so(tmp_path: Path) -> None:
    film(tmp_path / "bob.mp4", 200)
    nodes = dp.track(tmp_path / "bob.mp4", output=tmp_path / "bob.parquet")
    assert nodes.xy_px.shape == (200, 1, 2)
    truth = np.array([bob(k) for k in range(200)])
    error = nodes.xy_px[:, 0] - truth
    seen = np.isfinite(error).all(axis=1)
    assert seen.sum() >= 196
    # Compression and texture move the half level of the edge by some hundredths of the radius.
    assert np.sqrt(np.nanmean(error**2)) < 0.05 * RADIUS
    # The stated uncertainty covers that, and is not many times too wide.
    over = error[seen] / nodes.sigma_px[seen, 0, None]
    assert 0.3 < np.sqrt(np.mean(over**2)) < 1.5
    assert any("what moves" in str(w) for w in nodes.meta["warnings"])
    dp.read_nodes(tmp_path / "bob.parquet")


def test_setup_names_it_and_its_rig_finds_it_again(tmp_path: Path) -> None:
    film(tmp_path / "bob.mp4", 120)
    setup = dp.setup(tmp_path / "bob.mp4", output=tmp_path / "rig.toml")
    text = (tmp_path / "rig.toml").read_text().replace('"n0"', '"weight"')
    (tmp_path / "rig.toml").write_text(text)
    assert setup.picture.shape[2] == 3
    nodes = dp.track(tmp_path / "bob.mp4", rig=tmp_path / "rig.toml")
    assert [n.name for n in nodes.rig.nodes] == ["weight"]
    assert np.isfinite(nodes.xy_px[:, 0, 0]).sum() >= 116


def test_nothing_is_named_where_nothing_moves(tmp_path: Path) -> None:
    film(tmp_path / "still.mp4", 60, moving=False)
    with pytest.raises(dp.PydpendError):
        dp.track(tmp_path / "still.mp4")


@pytest.mark.skipif(not FILMS.is_dir(), reason="the films with truth are not here")
@pytest.mark.parametrize("name", ["pt_pivot", "pt_slide1"])
def test_a_real_film_is_right_without_settings(name: str, tmp_path: Path) -> None:
    """Judged by the films' own scorer: each object covered to 90 %, at most 0.5 % of the rows wrong, no other named."""
    folder = FILMS / name
    meta = json.loads((folder / "meta.json").read_text())
    table = tmp_path / "table.parquet"
    nodes = dp.track(folder / meta["film"], output=table)
    command: list[str | Path] = [
        sys.executable,
        FILMS / "score.py",
        table,
        folder / "truth.csv",
        folder / "meta.json",
    ]
    verdict = json.loads(subprocess.run(command, capture_output=True, check=True, text=True).stdout)
    assert verdict["verdict"] == "right", verdict
    assert any("what moves" in str(w) for w in nodes.meta["warnings"])
