"""Films as a person makes them, without settings: right, or the exit status says that it may not be."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
import pydpend as dp

from tests.support.everyday_films import film_toss, film_waving, filmed, toss

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
