"""Recordings without markers: what moves before a still, textured ground is followed, or nothing is named."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pydpend as dp
import pytest
from numpy.typing import NDArray

W, H, RADIUS = 320, 240, 7.0
TRACKER = Path(__file__).parent.parent.parent / "target" / "release" / "tracker"
FILMS = Path(__file__).parent.parent.parent.parent / "shared" / "films"


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


def encode(path: Path, crf: int, pictures: Iterable[NDArray[np.float64]]) -> None:
    """Writes gray pictures as H.264 of 60 frames per s."""
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
    command += ["-i", "-", "-c:v", "libx264", "-preset", "veryfast", "-crf", str(crf), "-pix_fmt", "yuv420p"]
    with subprocess.Popen([*command, str(path)], stdin=subprocess.PIPE) as encoder:
        assert encoder.stdin is not None
        for picture in pictures:
            encoder.stdin.write(np.clip(np.round(picture), 0, 255).astype(np.uint8).tobytes())
    assert encoder.returncode == 0


def film(path: Path, frames: int, *, moving: bool = True, seed: int = 3) -> None:
    """H.264 as a phone makes it (crf 23), with noise of two grey levels."""
    rng = np.random.default_rng(seed)
    behind = ground(seed)
    y, x = np.mgrid[:H, :W]

    def picture(k: int) -> NDArray[np.float64]:
        u, v = bob(k) if moving else (90.0, 90.0)
        part = np.clip(RADIUS + 0.5 - np.hypot(x - u, y - v), 0, 1)
        seen: NDArray[np.float64] = behind + (235 - behind) * part + rng.normal(0, 2, behind.shape)
        return seen

    encode(path, 23, map(picture, range(frames)))


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


@pytest.mark.skipif(not FILMS.is_dir(), reason="the films with truth are not here")
def test_one_click_on_a_toy_car_follows_its_picture_and_says_where_it_is_lost() -> None:
    """No row is wrong, and what is not seen in 90 % of the frames has not exit status 0."""
    done = subprocess.run(
        [sys.executable, "-m", "tests.validation.clicks", TRACKER, "carloop", "--films", FILMS],
        cwd=TRACKER.parent.parent.parent,
        capture_output=True,
        text=True,
        check=True,
    )
    row = done.stdout.splitlines()[0]
    assert row.split()[:4] == ["carloop", "said", "exit", "1"], row
    judged = json.loads(row[row.index("{") :])
    assert judged["coverage"]["masaA"] > 50
    assert judged["swap_pct"] + judged["false_pct"] == 0


def two(path: Path, frames: int = 150, seed: int = 5) -> None:
    """A large bright disc that circles, which is likeliest meant, and a small dark one beside it."""
    rng = np.random.default_rng(seed)
    behind = ground(seed)
    y, x = np.mgrid[:H, :W]

    def picture(k: int) -> NDArray[np.float64]:
        seen: NDArray[np.float64] = behind.copy()
        for u, v, radius, level in ((*large(k), 11.0, 240.0), (*small(k), 5.0, 12.0)):
            part = np.clip(radius + 0.5 - np.hypot(x - u, y - v), 0, 1)
            seen += (level - seen) * part
        seen += rng.normal(0, 2, seen.shape)
        return seen

    encode(path, 18, map(picture, range(frames)))


def large(k: int) -> tuple[float, float]:
    return 220 + 60 * np.cos(2 * np.pi * k / 90), 120 + 60 * np.sin(2 * np.pi * k / 90)


def small(k: int) -> tuple[float, float]:
    return 70 + 45 * np.cos(2 * np.pi * k / 70), 130 + 45 * np.sin(2 * np.pi * k / 70)


def on(xy: NDArray[np.float64], truth: Callable[[int], tuple[float, float]]) -> float:
    """Part of the frames in which a node is within 2 px of what it is to be on."""
    off = np.hypot(*(xy - np.array([truth(k) for k in range(len(xy))])).T)
    return float(np.mean(off < 2))


def place(truth: Callable[[int], tuple[float, float]], frame: int) -> str:
    return f"{truth(frame)[0]:.0f},{truth(frame)[1] + 1:.0f}@{frame}"


def test_what_is_pointed_at_is_followed_in_that_order_and_kept_in_the_rig(tmp_path: Path) -> None:
    two(tmp_path / "two.mp4")
    film = tmp_path / "two.mp4"
    nodes = dp.track(film, marker=[place(small, 40), (*large(90), 90)])
    assert on(nodes.xy_px[:, 0], small) > 0.95
    assert on(nodes.xy_px[:, 1], large) > 0.95
    assert any("named by its place" in w for w in nodes.meta["warnings"])
    setup = dp.setup(film, output=tmp_path / "rig.toml", marker=place(small, 40))
    assert len(setup.rig.nodes) == 1
    assert "[[wanted.marker]]" in (tmp_path / "rig.toml").read_text()
    again = dp.track(film, rig=tmp_path / "rig.toml")
    assert on(again.xy_px[:, 0], small) > 0.95
    # A rig of places alone says it as well.
    text = (tmp_path / "rig.toml").read_text()
    start = text.index("[[wanted.marker]]")
    (tmp_path / "bare.toml").write_text(text[:start] + text[text.index("[[body]]") :])
    assert on(dp.track(film, rig=tmp_path / "bare.toml").xy_px[:, 0], small) > 0.95


def test_a_place_that_holds_nothing_does_not_refuse_the_others(tmp_path: Path) -> None:
    two(tmp_path / "two.mp4")
    run: list[str | Path] = [TRACKER, "track", tmp_path / "two.mp4", "-o", tmp_path / "t.parquet"]
    run += ["--marker", "3,3@40", "--marker", place(small, 40)]
    done = subprocess.run(run, check=False, capture_output=True, text=True)
    assert done.returncode == 1
    assert "nothing is followed from (3, 3) px in frame 40" in done.stderr
    nodes = dp.read_nodes(tmp_path / "t.parquet")
    # The name is the number of the place, from 0 on.
    assert [node.name for node in nodes.rig.nodes] == ["n1"]
    assert on(nodes.xy_px[:, 0], small) > 0.95


def test_the_command_line_takes_the_same(tmp_path: Path) -> None:
    two(tmp_path / "two.mp4")
    run: list[str | Path] = [TRACKER, "track", tmp_path / "two.mp4", "-o", tmp_path / "t.parquet", "--force"]
    subprocess.run([*run, "--marker", place(small, 40)], check=True, capture_output=True)
    assert on(dp.read_nodes(tmp_path / "t.parquet").xy_px[:, 0], small) > 0.95
    subprocess.run([*run, "--polarity", "dark", "--region", "0,60,150,239"], check=True, capture_output=True)
    assert on(dp.read_nodes(tmp_path / "t.parquet").xy_px[:, 0], small) > 0.95
    # Numbers are those of the picture of `setup`: 1 is followed, 2 is offered.
    setup = dp.setup(tmp_path / "two.mp4")
    assert any("also moving, number 2" in w for w in setup.warnings), setup.warnings
    subprocess.run([*run, "--also", "2"], check=True, capture_output=True)
    both = dp.read_nodes(tmp_path / "t.parquet").xy_px
    assert all(max(on(both[:, i], truth) for i in (0, 1)) > 0.95 for truth in (large, small))
    subprocess.run([*run, "--markers", "2"], check=True, capture_output=True)
    assert dp.read_nodes(tmp_path / "t.parquet").xy_px.shape[1] == 2


@pytest.mark.parametrize(
    ("told", "said"),
    [
        ({"marker": (400, 10)}, "marker: (400, 10) px is not in the picture of 320 x 240 px"),
        (
            {"marker": (10, 10, 900)},
            "marker: frame 900 is not among those that are decoded. Give a frame of 0 to 59",
        ),
        ({"marker": "10;10"}, "marker: '10;10'"),
        ({"marker": [(10, 10), (50, 50)], "markers": 3}, "markers: 3 markers, and 2 were pointed at"),
        ({"marker": (10, 10), "also": 2}, "also: the numbers are those of a picture"),
        ({"also": 77}, "also: 77 is no number of the picture"),
        ({"same": "n0=n7"}, "same: n7 is no node"),
        ({"same": "n0"}, "same: 'n0' cannot be"),
        ({"markers": 0}, "markers: 0 markers cannot be followed"),
        ({"region": (5, 5, 1, 1)}, "region"),
    ],
)
def test_what_cannot_be_wanted_is_refused_in_words(told: dict[str, Any], said: str, tmp_path: Path) -> None:
    film(tmp_path / "bob.mp4", 60)
    with pytest.raises(dp.PydpendError) as refused:
        dp.track(tmp_path / "bob.mp4", **told)
    assert said.replace("'", '"') in str(refused.value).replace("'", '"')


def test_a_place_that_cannot_be_followed_is_told_and_the_others_are_followed(tmp_path: Path) -> None:
    """Names are the numbers of the places; the exit status says that one lacks: here one marker is pointed at twice."""
    film(tmp_path / "bob.mp4", 60)
    (u, v), table = bob(0), tmp_path / "t.parquet"
    run: list[str | Path] = [TRACKER, "track", tmp_path / "bob.mp4", "-o", table]
    places = [word for off in (2, 0) for word in ("--marker", f"{u + off:.0f},{v + off:.0f}")]
    done = subprocess.run([*run, *places], capture_output=True, text=True, check=False)
    assert done.returncode == 1, done.stderr
    assert "note: nothing is followed from (" in done.stderr
    assert "are one marker, which is followed from there" in done.stderr
    assert "not followed, as the notes say: (" in done.stderr
    nodes = dp.read_nodes(table)
    assert [n.name for n in nodes.rig.nodes] == ["n1"]
    assert on(nodes.xy_px[:, 0], bob) > 0.95


def test_a_refusal_has_a_picture_with_numbers_and_the_way_on(tmp_path: Path) -> None:
    """Discs that are elsewhere in every frame: none can be followed."""
    rng = np.random.default_rng(8)
    behind = ground(8)
    y, x = np.mgrid[:H, :W]
    folder = tmp_path / "jumps"
    folder.mkdir()
    for k in range(40):
        picture = behind.copy()
        for u, v in rng.uniform((20, 20), (W - 20, H - 20), (6, 2)):
            part = np.clip(RADIUS + 0.5 - np.hypot(x - u, y - v), 0, 1)
            picture += (240 - picture) * part
        grey = np.clip(np.round(picture), 0, 255).astype(np.uint8)
        (folder / f"f{k:03d}.pgm").write_bytes(b"P5 %d %d 255\n" % (W, H) + grey.tobytes())
    with pytest.raises(dp.PydpendError) as refused:
        dp.setup(folder, fps=60, picture=tmp_path / "jumps.png")
    said = str(refused.value)
    assert "marker=" in said, said
    assert "the picture of" not in said
    assert refused.value.candidates[0].startswith("1, at ")  # type: ignore[attr-defined]
    assert refused.value.picture.shape == (H, W, 3)  # type: ignore[attr-defined]
    assert (tmp_path / "jumps.png").stat().st_size > 1000
    run: list[str | Path] = [TRACKER, "track", folder, "--fps", "60", "-o", tmp_path / "t.csv"]
    done = subprocess.run(run, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    lines = done.stderr.splitlines()
    assert any("t.png: the picture of what was found in frame" in line for line in lines), lines
    assert any(line.startswith("tracker: 1, at ") for line in lines), lines
    assert "--marker " in lines[-1], lines[-1]
    assert (tmp_path / "t.png").exists()
    assert not (tmp_path / "t.csv").exists()
    # What is there already is not replaced unasked.
    again = subprocess.run(run, capture_output=True, text=True, check=False).stderr
    assert "is not written" in again
    assert "there already" in again
