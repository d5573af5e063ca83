"""Recordings and live images through the compiled module."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import threading
from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib.image
import numpy as np
import pydpend as dp
import pytest
from numpy.typing import NDArray
from pydpend.nodes import Joint, Node, Rig

from tests.support.long_recordings import lengthened, resident

DEMO = Path(__file__).parent.parent.parent / "fixtures" / "demo"
H, W = 120, 200
REACH = {"upper": (12.0, 24.0, 38.0), "lower": (10.0, 21.0, 37.0)}
ELBOW = 44.0
PIVOT = np.array([100.0, 20.0])


def places(t: float) -> NDArray[np.float64]:
    """Centres of six markers on two links at time t in frames, px."""
    upper, lower = 0.4 * np.sin(0.05 * t), 0.9 * np.sin(0.043 * t + 1)
    along = [np.array([np.sin(a), np.cos(a)]) for a in (upper, lower)]
    elbow = PIVOT + ELBOW * along[0]
    out = [PIVOT + r * along[0] for r in REACH["upper"]] + [elbow + r * along[1] for r in REACH["lower"]]
    return np.array(out)


def image(t: float, dtype: Any = np.uint8, level: float = 200.0) -> NDArray[Any]:
    """Discs of radius 3.5 px with edges one pixel wide, and noise of one unit."""
    y, x = np.mgrid[:H, :W]
    picture = 12 + np.random.default_rng(int(t)).normal(0, 1, (H, W))
    for cx, cy in places(t):
        picture += (level - 12) * np.clip(4.0 - np.hypot(x - cx, y - cy), 0, 1)
    return np.clip(np.rint(picture), 0, np.iinfo(dtype).max).astype(dtype)


def rig() -> Rig:
    first = places(0)
    bodies = ["upper"] * 3 + ["lower"] * 3
    nodes = tuple(
        Node(f"n{i}", b, float(p[0]), float(p[1])) for i, (b, p) in enumerate(zip(bodies, first, strict=True))
    )
    along = (first[2] - first[0]) / np.hypot(*(first[2] - first[0]))
    elbow = PIVOT + ELBOW * along
    joints = (
        Joint("pivot", ("upper",), float(PIVOT[0]), float(PIVOT[1])),
        Joint("elbow", ("upper", "lower"), float(elbow[0]), float(elbow[1])),
    )
    return Rig((W, H), nodes, ("upper", "lower"), joints, 0)


@pytest.fixture(scope="module")
def film(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """200 numbered pictures as a y4m film, which FFmpeg reads and which is written in three lines."""
    path = tmp_path_factory.mktemp("film") / "drop.y4m"
    with path.open("wb") as file:
        file.write(f"YUV4MPEG2 W{W} H{H} F500:1 Ip A1:1 Cmono\n".encode())
        for t in range(200):
            file.write(b"FRAME\n" + image(t).tobytes())
    return path


def test_a_film_is_tracked_and_the_table_is_the_same(film: Path, tmp_path: Path) -> None:
    nodes = dp.track(film, rig(), progress=False, output=tmp_path / "a.parquet")
    assert nodes.xy_px.shape == (200, 6, 2)
    assert nodes.complete
    np.testing.assert_allclose(nodes.t_s, np.arange(200) / 500, rtol=0, atol=1e-12)
    truth = np.array([places(t) for t in range(200)])
    # Every marker is in sight and far from the others: discs of radius 3.5 px are centred to 0.03 px or better.
    assert nodes.seen.mean() > 0.99
    assert np.nanmax(np.abs(nodes.xy_px - truth)) < 0.15
    back = dp.read_nodes(tmp_path / "a.parquet")
    np.testing.assert_array_equal(back.xy_px, nodes.xy_px)
    with pytest.raises(dp.TableError, match="it is there already"):
        dp.track(film, rig(), progress=False, output=tmp_path / "a.parquet")
    dp.track(film, rig(), progress=False, output=tmp_path / "b.parquet", threads=1)
    assert (tmp_path / "a.parquet").read_bytes() == (tmp_path / "b.parquet").read_bytes()


def test_frames_and_rate_are_what_was_asked_for(film: Path) -> None:
    nodes = dp.track(film, rig(), progress=False, frames=(20, 50), fps=1000)
    assert list(nodes.frame) == list(range(20, 50))
    np.testing.assert_allclose(nodes.t_s, np.arange(20, 50) / 1000)
    assert nodes.meta["source"]["rate_origin"] == "user"


def test_progress_is_called_and_its_exception_stops_the_run(film: Path) -> None:
    calls: list[tuple[str, int, int | None]] = []

    def watch(stage: str, done: int, total: int | None) -> None:
        calls.append((stage, done, total))

    dp.track(film, rig(), progress=watch)
    assert any(stage == "detecting" and done > 0 for stage, done, _ in calls)

    class Enough(Exception):
        pass

    def stop(stage: str, done: int, total: int | None) -> None:
        if done > 0:
            raise Enough

    with pytest.raises(Enough) as stopped:
        dp.track(film, rig(), progress=stop)
    nodes = getattr(stopped.value, "nodes", None)
    assert isinstance(nodes, dp.Nodes), "what was done until then is kept"


def test_ctrl_c_stops_a_film_without_an_end(tmp_path: Path) -> None:
    pipe = tmp_path / "endless.y4m"
    os.mkfifo(pipe)
    frame = b"FRAME\n" + image(0).tobytes()

    def feed() -> None:
        with contextlib.suppress(BrokenPipeError), pipe.open("wb") as file:
            file.write(f"YUV4MPEG2 W{W} H{H} F500:1 Ip A1:1 Cmono\n".encode())
            while True:
                file.write(frame)

    threading.Thread(target=feed, daemon=True).start()

    def interrupt(stage: str, done: int, total: int | None) -> None:
        if stage == "detecting" and done > 0:
            os.kill(os.getpid(), signal.SIGINT)

    # A film without an end: only Ctrl-C can end this test.
    with pytest.raises(KeyboardInterrupt) as stopped:
        dp.track(pipe, rig(), progress=interrupt)
    nodes = getattr(stopped.value, "nodes", None)
    assert isinstance(nodes, dp.Nodes)
    assert len(nodes) > 0
    assert nodes.meta["ending"] == {"kind": "interrupted"}


def test_ctrl_c_is_heard_while_nobody_feeds_the_pipe(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.y4m")
    program = """
import os, signal, sys
import pydpend as dp

def interrupt(stage, done, total):
    os.kill(os.getpid(), signal.SIGINT)

for work in (
    lambda: dp.track("pipe.y4m", progress=interrupt, output="t.parquet"),
    lambda: dp.setup("pipe.y4m", progress=interrupt),
):
    try:
        work()
    except KeyboardInterrupt:
        print("heard")
"""
    # In a process of its own, since a pipe that is waited for would stop all tests.
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, timeout=120
    )
    assert (done.stdout, done.returncode) == ("heard\nheard\n", 0), done.stderr
    assert [p.name for p in tmp_path.iterdir()] == ["pipe.y4m"]


def test_the_gil_is_free_during_work(film: Path) -> None:
    """Python goes on counting while a film is tracked; with the GIL held it would stand still."""
    counts = []
    done = threading.Event()

    def count() -> None:
        n = 0
        while not done.is_set():
            n += 1
            done.wait(0.001)
        counts.append(n)

    thread = threading.Thread(target=count)
    thread.start()
    dp.track(film, rig(), progress=False)
    done.set()
    thread.join()
    assert counts[0] > 3


def test_setup_finds_two_links_and_info_knows_the_film(film: Path, tmp_path: Path) -> None:
    known = dp.info(film)
    assert (known["width"], known["height"], known["rate_hz"]) == (W, H, 500.0)
    found = dp.setup(film, tmp_path / "rig.toml", picture=tmp_path / "rig.png", progress=False)
    assert len(found.rig.nodes) == 6
    assert len(found.rig.bodies) == 2
    assert isinstance(found.warnings, list)
    assert Rig.read(tmp_path / "rig.toml") == found.rig
    # What is written is what is returned, in matplotlib's order of colours, and there is colour on a gray ground.
    assert found.picture.shape == (H, W, 3)
    assert np.ptp(found.picture.astype(int), axis=2).max() > 50
    written = matplotlib.image.imread(tmp_path / "rig.png")
    np.testing.assert_array_equal(np.rint(written[..., :3] * 255), found.picture)
    with pytest.raises(dp.FilmError, match=r"\.xyz"):
        dp.setup(film, picture=tmp_path / "rig.xyz", progress=False)


def test_an_overlay_has_the_frames_asked_for_at_its_width(film: Path, tmp_path: Path) -> None:
    nodes = dp.track(film, rig(), progress=False, frames=(20, 120))
    calls: list[tuple[str, int, int | None]] = []
    whole = dp.overlay(
        film, nodes, tmp_path / "whole.mp4", progress=lambda *call: calls.append(call), play_fps=25
    )
    assert calls[-1][0] == "drawing"
    np.testing.assert_array_equal(whole.frame, np.arange(20, 120))
    np.testing.assert_allclose(whole.t_s, np.arange(20, 120) / 500)
    known = dp.info(whole.path)
    assert (known["width"], known["height"], known["rate_hz"]) == (W, H, 25.0)
    small = dp.overlay(film, nodes, tmp_path / "small.mp4", every=8, width=100, progress=False)
    np.testing.assert_array_equal(small.frame, np.arange(20, 120, 8))
    known = dp.info(small.path)
    assert (known["width"], known["height"], known["declared_frames"]) == (100, 60, 13)
    with pytest.raises(dp.FilmError, match="it is there already"):
        dp.overlay(film, nodes, tmp_path / "small.mp4", progress=False)
    wrong: list[tuple[dict[str, Any], str]] = [
        ({"every": 0}, "every: it is out of range"),
        ({"every": -1}, "every: -1 is out of range"),
        ({"width": 99}, "width: it is out of range. Give an even number"),
        ({"quality": 52}, "quality"),
        ({"play_fps": 0}, "play_fps"),
    ]
    for keywords, match in wrong:
        with pytest.raises(dp.ArgumentError, match=match):
            dp.overlay(film, nodes, tmp_path / "new.mp4", progress=False, **keywords)
    other = replace(nodes, rig=replace(nodes.rig, image_px=(W, H + 1)))
    with pytest.raises(dp.TableError, match="200 x 120 px, the table is of 200 x 121 px"):
        dp.overlay(film, other, tmp_path / "new.mp4", progress=False)
    later = replace(nodes, frame=nodes.frame + 1000)
    with pytest.raises(dp.TableError, match="none of the table's frames"):
        dp.overlay(film, later, tmp_path / "none.mp4", progress=False)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["small.mp4", "whole.mp4"]


def test_ctrl_c_leaves_the_overlay_of_what_was_drawn(film: Path, tmp_path: Path) -> None:
    nodes = dp.track(film, rig(), progress=False)

    def interrupt(stage: str, done: int, total: int | None) -> None:
        # The encoder holds the last half a hundred pictures, which go with it.
        if done >= 120:
            os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        dp.overlay(film, nodes, tmp_path / "half.mp4", width=1600, progress=interrupt)
    assert [p.name for p in tmp_path.iterdir()] == ["half.mp4"]
    known = dp.info(tmp_path / "half.mp4")
    assert 0 < known["declared_frames"] < 200
    assert known["warnings"] == []


def test_a_long_recording_needs_no_more_memory_than_a_short_one(tmp_path: Path) -> None:
    """The long one has 260 MB of pictures more. The sizes of equal runs differ by about a tenth of the 10 % allowed."""
    scene = {**dp.Film("clean").scene, "image_px": [360, 360]}
    scene["link"] = [
        {**link, "joint_px": [180.0, 180.0]} if "parent" not in link else link for link in scene["link"]
    ]
    dp.film(scene, tmp_path / "short.mraw", frames=500, bits=8)
    sizes = [
        resident(film, tmp_path / f"{film.stem}.parquet")
        for film in (tmp_path / "short.mraw", lengthened(tmp_path / "short.mraw", 2500))
    ]
    assert sizes[1] < 1.1 * sizes[0]


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_one_image_is_detected_whatever_its_strides(dtype: Any) -> None:
    picture = image(3, dtype, 200 if dtype == np.uint8 else 3000)
    found = dp.detect(picture)
    truth = places(3)
    assert len(found) == 6
    for x, y in truth:
        assert np.hypot(found["x_px"] - x, found["y_px"] - y).min() < 0.15
    wide = np.zeros((H, 2 * W), dtype)
    wide[:, ::2] = picture
    for same in (wide[:, ::2], np.asfortranarray(picture), picture[::-1][::-1]):
        np.testing.assert_array_equal(dp.detect(same), found)


@pytest.mark.parametrize(
    ("bad", "match"),
    [
        (np.zeros((4, 5), np.float64), "its type is"),
        (np.zeros((4, 5), np.int16), "its type is"),
        (np.zeros((4, 5), ">u2"), "its type is"),
        (np.zeros((4, 5, 3), np.uint8), "its shape is"),
        (np.zeros((0, 5), np.uint8), "its shape is"),
        ([[1, 2]], "not a NumPy array"),
    ],
)
def test_what_is_no_image_is_refused(bad: Any, match: str) -> None:
    with pytest.raises(dp.ArgumentError, match=match):
        dp.detect(bad)
    with pytest.raises(dp.ArgumentError, match=match):
        dp.Tracker(rig()).step(bad)


def test_live_images_are_followed() -> None:
    live = dp.Tracker(rig())
    live.learn([image(t) for t in range(0, 100, 20)])
    errors = []
    for t in range(120):
        row = live.step(image(t))
        assert row.frame == t
        seen = (row.status == 1) | (row.status == 2)
        errors.append(np.abs(row.xy_px - places(t))[seen])
        assert len(live.detections) == 6
    assert sum(e.shape[0] for e in errors) > 0.95 * 120 * 6
    assert max(e.max() for e in errors if e.size) < 0.15
    with pytest.raises(dp.ArgumentError, match="frame"):
        live.step(image(5), 3)
    with pytest.raises(dp.ArgumentError, match="the rig is for 200 x 120"):
        live.step(np.zeros((5, 5), np.uint8))


@pytest.mark.parametrize(
    ("keywords", "match"),
    [
        ({"frames": (5, 3)}, "frames"),
        ({"frames": "all"}, "frames"),
        ({"threads": 0}, "threads"),
        ({"polarity": "grey"}, "polarity: .*Give auto, bright or dark"),
        ({"decoder": "vlc"}, "decoder"),
        ({"threshold": float("nan")}, "threshold"),
    ],
)
def test_arguments_that_make_no_sense_are_refused(film: Path, keywords: dict[str, Any], match: str) -> None:
    with pytest.raises(dp.ArgumentError, match=match):
        dp.track(film, rig(), progress=False, **keywords)


def test_each_fault_has_its_exception(film: Path, tmp_path: Path) -> None:
    with pytest.raises(dp.SourceError, match="no such file"):
        dp.track(tmp_path / "none.mp4", progress=False)
    (tmp_path / "text.mp4").write_text("no film\n" * 100)
    with pytest.raises(dp.SourceError, match=r"text\.mp4"):
        dp.info(tmp_path / "text.mp4")
    with pytest.raises(dp.RigError, match="images of 200 x 121 px"):
        dp.track(film, Rig((W, H + 1), rig().nodes, ("upper", "lower")), progress=False)
    with pytest.raises(dp.TableError, match="nowhere"):
        dp.track(film, rig(), progress=False, output=tmp_path / "nowhere" / "t.csv")


def test_what_ffmpeg_says_of_a_file_reaches_the_user(tmp_path: Path) -> None:
    path = tmp_path / "no.mp4"
    path.write_bytes(bytes(range(1, 32)) * 40)
    # FFmpeg's own words; they were an empty pair of brackets once.
    with pytest.raises(dp.SourceError, match=r"no\.mp4: not a recording that can be read \(\w+"):
        dp.info(path)


def test_a_recording_that_is_cut_while_it_is_read_is_an_error_and_not_the_end_of_python(
    tmp_path: Path,
) -> None:
    path = tmp_path / "drop.mraw"
    # Zeros that take no room, more than are read until the first call; markers in the first frames, and where levels
    # are learned: in the middles of a dozen or two dozen equal parts.
    count, size = 240_000, H * W
    with path.open("wb") as file:
        for t in [*range(60), *range(count // 48, count, count // 48)]:
            file.seek(t * size)
            file.write(image(t).tobytes())
    os.truncate(path, count * size)
    keys = {
        "Record Rate(fps)": 500, "Total Frame": count, "Image Width": W, "Image Height": H, "Color Bit": 8,
        "Color Type": "Mono", "File Format": "MRaw",
    }  # fmt: skip
    lines = [f"{key} : {value}" for key, value in keys.items()]
    path.with_suffix(".cih").write_text("\n".join(["#Camera Information Header", *lines]) + "\n")

    def cut(stage: str, done: int, total: int | None) -> None:
        if stage == "detecting":
            os.truncate(path, 41 * size + 9)

    with pytest.raises(
        dp.SourceError, match=r"drop\.mraw, frame \d+: the file became shorter while it was read"
    ):
        dp.track(path, rig(), progress=cut)


def test_what_a_recording_lacks_is_a_warning(tmp_path: Path) -> None:
    damaged, cut = tmp_path / "damaged.mp4", tmp_path / "cut.mkv"
    for path in (damaged, cut):
        copied = ["-frames:v", "1000", "-c", "copy", str(path)]
        subprocess.run(["ffmpeg", "-v", "error", "-i", str(DEMO / "drop.mp4"), *copied], check=True)
    whole = damaged.read_bytes()
    at = whole.index(b"mdat") + len(whole) // 2
    damaged.write_bytes(whole[:at] + bytes(400) + whole[at + 400 :])
    cut.write_bytes(cut.read_bytes()[: cut.stat().st_size * 7 // 10])
    for path, said in (
        (damaged, r"damaged\.mp4: damaged: frames? \d"),
        (cut, r"cut\.mkv: .*the recording ended early, after \d+"),
    ):
        with pytest.warns(dp.RecordingWarning, match=said):
            nodes = dp.track(path, progress=False)
        assert not nodes.complete
