"""Films as a person makes them, without settings: right, or the exit status says that it may not be."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
import pydpend as dp

from tests.support.everyday_films import (
    arms,
    film_rolling,
    film_toss,
    film_two_colours,
    film_waving,
    filmed,
    roll,
    toss,
)

TRACKER = Path(__file__).parent.parent.parent / "target" / "release" / "tracker"
RADIUS_PX = 6.0


def track(film: Path, table: Path) -> int:
    return subprocess.run([TRACKER, "track", film, "-o", table], capture_output=True, check=False).returncode


def test_a_tossed_ball_is_followed_beside_the_hand_that_throws_it(tmp_path: Path) -> None:
    film_toss(tmp_path / "toss.mp4")
    assert track(tmp_path / "toss.mp4", tmp_path / "toss.parquet") == 0
    places = dp.read_nodes(tmp_path / "toss.parquet").xy_px
    assert places.shape[1] == 1
    off = np.hypot(*(places[15:, 0] - [filmed(*toss(k)) for k in range(15, len(places))]).T)
    assert np.mean(off < RADIUS_PX / 2) > 0.9
    assert np.nanmax(off) < RADIUS_PX


def test_a_hand_that_waves_is_no_marker_without_a_word(tmp_path: Path) -> None:
    film_waving(tmp_path / "waving.mp4")
    assert track(tmp_path / "waving.mp4", tmp_path / "waving.parquet") in (1, 2)


def test_a_ball_at_the_border_of_the_picture_has_no_place(tmp_path: Path) -> None:
    """The middle of what is seen of it is not its own; half a pixel is what the blur of its edge moves that middle."""
    film_rolling(tmp_path / "roll.mp4")
    assert track(tmp_path / "roll.mp4", tmp_path / "roll.parquet") == 0
    places = dp.read_nodes(tmp_path / "roll.parquet").xy_px
    assert places.shape[1] == 1
    truth = np.array([filmed(*roll(k)) for k in range(len(places))])
    whole = (truth[:, 0] > 12) & (truth[:, 0] < 307)
    assert np.mean(np.isfinite(places[whole, 0, 0])) > 0.95
    assert np.nanmax(np.hypot(*(places[:, 0] - truth).T)) < 1.5


def test_markers_of_two_colours_on_two_arms_are_both_followed(tmp_path: Path) -> None:
    film_two_colours(tmp_path / "arms.mp4")
    assert track(tmp_path / "arms.mp4", tmp_path / "arms.parquet") in (0, 1)
    places = dp.read_nodes(tmp_path / "arms.parquet").xy_px
    assert places.shape[1] == 2
    for end in (0, 1):
        truth = np.array([filmed(*arms(k)[end]) for k in range(len(places))])
        near = [np.hypot(*(places[:, node] - truth).T) < 1.5 for node in (0, 1)]
        assert max(np.mean(n) for n in near) > 0.95
