"""What a camera that is not known exactly does to angles: derivatives, what is stated, tables."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pydpend as dp
import pytest
from numpy.typing import NDArray
from pydpend._native import CAMERA_BY_EYE, plane_places, plane_slopes
from pydpend.errors import AnglesError
from pydpend.kinematics.estimators import ESTIMATORS, Method, Wishes, estimate
from pydpend.kinematics.files import NO_CAMERA_PART
from pydpend.kinematics.markers import body_markers
from pydpend.kinematics.structure import Structure
from pydpend.nodes import Nodes

from tests.support import aimed, two_links
from tests.validation.validate_camera import angle_errors

Floats = NDArray[np.float64]
NUMBERS = np.array([0.004, -0.006, 0.05, -0.03, -0.06])


def with_camera(nodes: Nodes, numbers: Floats, covariance: Floats | None = None) -> Nodes:
    rig = dataclasses.replace(nodes.rig, camera=aimed.camera(numbers, covariance))
    return dataclasses.replace(nodes, rig=rig)


def turns(nodes: Nodes, estimator: Method) -> tuple[Floats, Floats]:
    """Turns (T, 2) before any zero, and their derivatives by the camera's numbers (T, 2, 5)."""
    markers = body_markers(nodes)
    structure = Structure.of(nodes.rig, [m.name for m in markers])
    raw, seen = estimate(nodes, markers, structure, Wishes(estimator, mirrored=False))
    return raw.theta, seen.slopes


def test_slopes_of_places_are_differences() -> None:
    t, phi = aimed.swing("wide", 1, frames=5)
    rig = with_camera(aimed.film(t, phi, 1, NUMBERS), NUMBERS).rig
    places = np.random.default_rng(1).uniform((50.0, 50.0), (1200.0, 950.0), (40, 2))
    slopes = plane_slopes(rig.to_json(), places)
    for number, scale in enumerate(CAMERA_BY_EYE):
        step = np.eye(5)[number] * 1e-3 * scale
        there, back = (
            plane_places(dataclasses.replace(rig, camera=aimed.camera(NUMBERS + d)).to_json(), places)[:, :2]
            for d in (step, -step)
        )
        # Places go to 1e-13 px and steps to 1e-6, so differences are good to 1e-7 of some 1000 px.
        assert np.abs((there - back) / (2e-3 * scale) - slopes[..., number]).max() < 1e-3


@pytest.mark.parametrize("estimator", ESTIMATORS)
@pytest.mark.parametrize("markers", aimed.MARKERS)
def test_slopes_of_angles_are_differences_of_whole_estimates(estimator: Method, markers: str) -> None:
    t, phi = aimed.swing("wide", 2, frames=300)
    nodes = with_camera(aimed.film(t, phi, 2, NUMBERS, markers), NUMBERS)
    _, slopes = turns(nodes, estimator)
    for number, scale in enumerate(CAMERA_BY_EYE):
        step = np.eye(5)[number] * 0.02 * scale
        there, back = (turns(with_camera(nodes, NUMBERS + d), estimator)[0] for d in (step, -step))
        apart = np.angle(np.exp(1j * (there - back))) / (0.04 * scale)
        # The whole estimate weighs markers anew, stops its rounds of shape and pose earlier, and the linkage's constant
        # is its own: all of it a few hundredths of what the camera does.
        apart -= np.nanmean(apart - slopes[..., number], axis=0)
        size = np.sqrt(np.nanmean((slopes[..., number] - slopes[..., number].mean(axis=0)) ** 2))
        assert np.sqrt(np.nanmean((apart - slopes[..., number]) ** 2)) < 0.05 * size, number


def test_a_constant_of_the_turns_follows_the_camera_too() -> None:
    """The turn from the reference picture is what angles given for it count from."""
    t, phi = aimed.swing("wide", 2, frames=300)
    nodes = with_camera(aimed.film(t, phi, 2, NUMBERS), NUMBERS)
    _, slopes = turns(nodes, "rigid")
    for number, scale in enumerate(CAMERA_BY_EYE):
        step = np.eye(5)[number] * 0.02 * scale
        there, back = (turns(with_camera(nodes, NUMBERS + d), "rigid")[0] for d in (step, -step))
        apart = np.angle(np.exp(1j * (there - back))) / (0.04 * scale)
        assert np.abs(apart - slopes[..., number]).max() < 0.05 * np.abs(slopes[..., number]).max()


@pytest.mark.parametrize("markers", aimed.MARKERS)
@pytest.mark.parametrize("swing", aimed.SWINGS)
def test_errors_are_what_noise_and_camera_state(markers: str, swing: str) -> None:
    errors, noise, part = angle_errors(markers, swing, range(10))
    for k in range(2):
        # Ten cameras of two numbers that count: their mean square is known to sqrt(2/20) = 32 %, its root to 16 %.
        pooled = np.sqrt(errors[:, k].mean() / (noise + part)[:, k].mean())
        assert 0.6 < pooled < 1.45, (k, pooled)
    # Noise alone is no statement of the error.
    assert np.sqrt(errors.mean() / noise.mean()) > 1.5


def test_a_camera_that_is_given_exactly_adds_nothing() -> None:
    t, phi = aimed.swing("wide", 3, frames=300)
    nodes = aimed.film(t, phi, 3, NUMBERS)
    exact = dp.angles(with_camera(nodes, NUMBERS), zero="vertical")
    assert (exact.sigma_camera_rad == 0).all()
    covariance = np.diag(np.array(CAMERA_BY_EYE) ** 2) / 4
    unsure = dp.angles(with_camera(nodes, NUMBERS, covariance), zero="vertical")
    assert (unsure.sigma_camera_rad > 0).all()
    assert unsure.meta["camera"]["origin"] == "given"
    # The markers tell more than half of what an eye sees.
    assert (np.array(unsure.meta["camera"]["sigma"]) < np.array(CAMERA_BY_EYE) / 2).all()
    assert (unsure.sigma_total_rad >= unsure.sigma_rad).all()


def test_a_covariance_that_is_none_is_refused() -> None:
    t, phi = aimed.swing("wide", 3, frames=100)
    wrong = np.diag(np.array(CAMERA_BY_EYE) ** 2)
    wrong[0, 1] = wrong[1, 0] = 2 * wrong[0, 0]
    with pytest.raises(AnglesError, match=r"camera\.covariance.*no covariance"):
        dp.angles(with_camera(aimed.film(t, phi, 3, NUMBERS), NUMBERS, wrong), zero="vertical")


def test_a_camera_that_was_not_used_is_told() -> None:
    t, phi = aimed.swing("wide", 4)
    found = dp.angles(aimed.film(t, phi, 4, NUMBERS), zero="vertical")
    told = [n for n in found.meta["notes"] if "find the camera with" in n]
    assert len(told) == 1
    assert "distances between the markers" in told[0]
    assert any("no number of frames averages it out" in n for n in found.meta["notes"])
    # With it nothing is left to tell.
    square = dp.angles(with_camera(aimed.film(t, phi, 4, NUMBERS), NUMBERS), zero="vertical")
    assert not any("camera" in n for n in square.meta["notes"])


def some_angles() -> dp.LinkAngles:
    t, phi = aimed.swing("20 deg", 5, frames=200)
    found = dp.angles(aimed.film(t, phi, 5, aimed.drawn(5)), zero="vertical")
    phi = found.phi_rad.copy()
    phi[7, 1] = np.nan
    return dataclasses.replace(found, phi_rad=phi)


@pytest.mark.parametrize("name", ["angles.parquet", "angles.csv"])
def test_the_part_survives_its_file(tmp_path: Path, name: str) -> None:
    angles = some_angles()
    dp.write_angles(angles, tmp_path / name)
    back = dp.read_angles(tmp_path / name)
    assert back.camera_rad is not None
    assert angles.camera_rad is not None
    assert np.array_equal(back.camera_rad, angles.camera_rad, equal_nan=True)
    assert np.isnan(back.camera_rad[7, 1]).all()
    assert back.meta["camera"] == json.loads(json.dumps(angles.meta["camera"]))
    turned = dp.read_angles(tmp_path / name, clockwise=True)
    assert turned.camera_rad is not None
    assert np.array_equal(turned.camera_rad, -angles.camera_rad, equal_nan=True)
    part = back.between(0.1, 0.3)
    assert part.camera_rad is not None
    assert part.camera_rad.shape[0] == part.t_s.size


def test_an_old_table_is_read_with_a_word(tmp_path: Path) -> None:
    old = dataclasses.replace(some_angles(), camera_rad=None)
    dp.write_angles(old, tmp_path / "old.parquet")
    back = dp.read_angles(tmp_path / "old.parquet")
    assert back.camera_rad is None
    assert NO_CAMERA_PART in back.meta["notes"]
    assert np.isnan(back.sigma_camera_rad).all()
    assert np.array_equal(back.sigma_total_rad, back.sigma_rad, equal_nan=True)


def test_part_of_the_part_is_refused(tmp_path: Path) -> None:
    columns = some_angles().to_columns()
    del columns["camera3_phi2_rad"]
    rows = zip(*(c.tolist() for c in columns.values()), strict=True)
    text = "\n".join(",".join("" if v != v else repr(v) for v in row) for row in rows)
    (tmp_path / "part.csv").write_text(",".join(columns) + "\n" + text + "\n", encoding="utf-8")
    with pytest.raises(AnglesError, match=r"camera1_phi1_rad is there and camera3_phi2_rad is not"):
        dp.read_angles(tmp_path / "part.csv")


def test_a_part_that_is_missing_where_there_is_an_angle_is_refused() -> None:
    angles = some_angles()
    assert angles.camera_rad is not None
    hole = angles.camera_rad.copy()
    hole[3, 0, 2] = np.nan
    with pytest.raises(AnglesError, match=r"row 3, column camera3_phi1_rad.*where there is an angle"):
        dataclasses.replace(angles, camera_rad=hole)
    with pytest.raises(AnglesError, match=r"shape \(200, 2, 4\)"):
        dataclasses.replace(angles, camera_rad=hole[..., :4])


@pytest.mark.parametrize("from_another", [False, True])
def test_at_rest_the_camera_says_nothing_of_the_angle(from_another: bool) -> None:
    """Where the zero is taken, the camera's error of the angle and that of the zero are one."""
    t, phi = two_links.drop(2.0, 200.0, 6, rest_s=1.0)
    nodes = aimed.film(t, phi, 6, aimed.drawn(6))
    hanging = aimed.film(t[:150], np.zeros((150, 2)), 7, aimed.drawn(6))
    hanging = dataclasses.replace(hanging, rig=nodes.rig)
    found = dp.angles(nodes, zero=hanging if from_another else "rest", gaps="stop")
    still = t < 0.9
    part = np.sqrt(np.nanmean(found.sigma_camera_rad[still] ** 2, axis=0))
    moving = np.sqrt(np.nanmean(found.sigma_camera_rad[~still] ** 2, axis=0))
    assert (part < 0.02 * moving).all(), (part, moving)
