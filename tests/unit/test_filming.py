"""The film maker from Python."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pydpend as dp
import pytest
from pydpend.filming import PRESETS, read_truth

SCENE: dict[str, Any] = {
    "schema": 1,
    "image_px": [96, 80],
    "frames": 20,
    "rate_hz": 1000.0,
    "seed": 4,
    "camera": {"read_noise": 2.0, "shot_gain": 0.1, "exposure_s": 0.0002},
    "link": [{"name": "arm", "joint_px": [48.0, 20.0], "along_px": [-4, 44], "width_px": 10, "level": 20}],
    "marker": [
        {"name": "n0", "link": "arm", "at_px": [14, 0], "radius_px": 3.5, "level": 180},
        {"name": "n1", "link": "arm", "at_px": [38, 2], "radius_px": 3.5, "level": 180},
    ],
}


def test_a_motion_from_python_moves_the_links_counter_clockwise() -> None:
    t_s = np.arange(0.0, 0.05, 0.0005)
    film = dp.Film(SCENE, motion=(t_s, np.sin(20 * t_s)[:, None]))
    truth = film.truth()
    assert truth.xy_px.shape == (20, 2, 2)
    assert truth.nodes == ("n0", "n1")
    assert truth.bodies == ("arm", "arm")
    # The spline through 0.5 ms samples of a 20 rad/s sine is good to (20 * 0.0005)^4 / 384 = 3e-11.
    np.testing.assert_allclose(truth.phi_rad[:, 0], np.sin(20 * truth.t_s), atol=1e-10)
    expected = 48 + 14 * np.sin(truth.phi_rad[:, 0])
    np.testing.assert_allclose(truth.xy_px[:, 0, 0], expected, atol=1e-12)
    np.testing.assert_allclose(truth.visible, 1.0, atol=1e-12)


def test_noise_is_what_the_model_says() -> None:
    film = dp.Film(SCENE, rate_hz=500.0)
    expected = film.expected(3).astype(float)
    images = np.array([film.image(k).astype(float) for k in range(20)])
    camera = film.scene["camera"]
    variance = camera["read_noise"] ** 2 + camera["shot_gain"] * expected + 1 / 12
    z = (images - expected) / np.sqrt(variance)
    # At rest all frames have one expectation: 153600 numbers, so five standard errors of mean and variance.
    assert abs(z.mean()) < 5 / np.sqrt(z.size)
    assert abs(z.var() - 1) < 5 * np.sqrt(2 / z.size)


def test_films_are_written_and_the_same_for_the_same_seed(tmp_path: Path) -> None:
    first = dp.film(SCENE, tmp_path / "a.mkv", truth=tmp_path / "a.csv")
    dp.film(first.scene, tmp_path / "b.mkv")
    dp.film(SCENE, tmp_path / "c.mkv", seed=5)
    assert (tmp_path / "a.mkv").read_bytes() == (tmp_path / "b.mkv").read_bytes()
    assert (tmp_path / "a.mkv").read_bytes() != (tmp_path / "c.mkv").read_bytes()
    lines = (tmp_path / "a.csv").read_text().splitlines()
    assert lines[0] == "frame,time_s,node,body,x_px,y_px,visible,phi1_rad"
    assert len(lines) == 1 + 20 * 2


def test_sixteen_bits_come_as_sixteen_bits() -> None:
    film = dp.Film({**SCENE, "camera": {"depth_bits": 12, "black": 300.0}})
    assert film.image(0).dtype == np.uint16
    assert film.image(0).min() >= 300


def test_presets_are_known_by_name() -> None:
    for name in PRESETS:
        assert dp.Film(name, seed=2, frames=2).scene["seed"] == 2


def test_a_table_of_the_truth_scores_without_fault(tmp_path: Path) -> None:
    film = dp.film(SCENE, tmp_path / "a.mkv", truth=tmp_path / "a.parquet")
    truth = film.truth()
    rig_file = tmp_path / "rig.toml"
    rig_file.write_text(film.rig_toml())
    shape = truth.visible.shape
    nodes = dp.Nodes(
        frame=np.arange(20, dtype=np.int64),
        t_s=truth.t_s,
        xy_px=truth.xy_px + 0.1,
        sigma_px=np.full(shape, 0.1, np.float32),
        area_px=np.full(shape, 38.0, np.float32),
        status=np.ones(shape, np.uint8),
        rig=dp.Rig.read(rig_file),
        meta={},
    )
    for against in (film, tmp_path / "a.parquet"):
        s = dp.score(nodes, against)
        assert (s.wrong, s.switches, s.false_positives, s.coverage) == (0, 0, 0, 1.0)
        assert s.rms_px == pytest.approx((0.1, 0.1))
        assert s.error_over_sigma == pytest.approx(1.0)
        assert s.matches == {"n0": "n0", "n1": "n1"}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"colour": 1}, "unknown field `colour`"),
        ({"frames": 0}, "a film without frames"),
        ({"rate_hz": -5.0}, "not a simple fraction"),
        ({"camera": {"exposure_s": 1.0}}, "longer than"),
    ],
)
def test_scenes_that_make_no_sense_are_refused(change: dict[str, Any], words: str) -> None:
    with pytest.raises(dp.FilmError, match=words):
        dp.Film({**SCENE, **change})


def test_bad_calls_are_refused(tmp_path: Path) -> None:
    with pytest.raises(dp.FilmError, match="not times and angles"):
        dp.Film(SCENE, motion=3)
    with pytest.raises(dp.FilmError, match="do not go together"):
        dp.Film(SCENE, motion=(np.arange(3.0), np.zeros((4, 1))))
    with pytest.raises(dp.FilmError, match="the film needs"):
        dp.Film(SCENE, motion=(np.arange(3) * 1e-3, np.zeros((3, 1))))
    with pytest.raises(dp.FilmError, match="of a film of 20 frames"):
        dp.Film(SCENE).image(20)
    with pytest.raises(dp.FilmError, match="scene cannot be read"):
        dp.Film(tmp_path / "none.toml")
    with pytest.raises(dp.FilmError, match="gif"):
        dp.Film(SCENE).write(tmp_path / "a.gif")


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_truth_is_read_back(tmp_path: Path, ending: str) -> None:
    film = dp.film(SCENE, tmp_path / "a.mkv", truth=tmp_path / f"t.{ending}")
    read, truth = read_truth(tmp_path / f"t.{ending}"), film.truth()
    for key in ("t_s", "xy_px", "visible", "phi_rad"):
        np.testing.assert_array_equal(getattr(read, key), getattr(truth, key))
    assert (read.nodes, read.bodies) == (truth.nodes, truth.bodies)
    (tmp_path / "none.csv").write_text("frame,node\n1,n0\n")
    with pytest.raises(dp.FilmError, match="no column time_s"):
        read_truth(tmp_path / "none.csv")
