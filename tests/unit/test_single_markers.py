"""Links of one marker: their angle is from their joint, found by the circle or pointed at, with its uncertainty."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pydpend as dp
import pytest
from numpy.typing import NDArray
from pydpend.cli import main
from pydpend.errors import AnglesError
from pydpend.nodes import Nodes

from tests.support import linkages, two_links

Floats = NDArray[np.float64]

BOB = [[(80.0, 0.0)]]
ELBOW_AND_TIP = [[(85.0, 0.0)], [(78.0, 0.0)]]


def off(found: dp.LinkAngles, made: linkages.Made) -> Floats:
    """Errors but for a constant, rad."""
    error = found.phi_rad - made.phi_rad
    return np.asarray(error - np.nanmean(error, axis=0))


def without_joints(nodes: Nodes) -> Nodes:
    return replace(nodes, rig=replace(nodes.rig, joints=()))


@pytest.mark.parametrize("seed", [101, 102, 103])
def test_a_bob_on_a_string_errs_as_its_marker_over_its_length(seed: int) -> None:
    made = linkages.chain(seed, layouts=BOB, start_rad=[0.9])
    found = dp.angles(made.nodes(seed), zero="reference_frame")
    bound = linkages.SIGMA_PX / 80.0
    # The RMS of 1500 frames scatters by 1.8 %.
    assert linkages.rms(off(found, made))[0] == pytest.approx(bound, rel=0.06)
    assert linkages.rms(off(found, made) / found.sigma_rad)[0] == pytest.approx(1, abs=0.06)
    linkage = found.meta["linkage"]
    np.testing.assert_array_less(
        np.abs(np.subtract(linkage["pivot_px"], (320, 200))), 5 * np.array(linkage["pivot_sigma_px"])
    )
    assert max(linkage["pivot_sigma_px"]) < 0.05


def test_elbow_and_tip_with_their_covariance() -> None:
    made = linkages.chain(104, layouts=ELBOW_AND_TIP, start_rad=[0.9, 1.4])
    found = dp.angles(made.nodes(104), zero="reference_frame")
    error = off(found, made)
    assert (np.abs(linkages.rms(error / found.sigma_rad) - 1) < 0.06).all()
    assert found.covariance_rad2 is not None
    # The lower link's angle errs against the upper one's, which moves the elbow.
    correlation = np.mean(error[:, 0] * error[:, 1]) / np.prod(error.std(axis=0))
    stated = found.covariance_rad2[:, 0, 1] / np.prod(found.sigma_rad, axis=1)
    assert correlation == pytest.approx(stated.mean(), abs=0.1)
    theta = error[:, 1] - error[:, 0]
    assert linkages.rms(theta / found.sigma_theta_rad[:, 0]) == pytest.approx(1, abs=0.06)


def test_a_single_marker_on_a_link_of_many(tmp_path: Path) -> None:
    made = linkages.chain(
        105, layouts=[linkages.CHAIN[0], [(78, 0)], linkages.CHAIN[2]], start_rad=[1, 1.2, 0.5]
    )
    found = dp.angles(made.nodes(105), zero="reference_frame")
    assert (np.abs(linkages.rms(off(found, made) / found.sigma_rad) - 1) < 0.08).all()
    for ending in ("csv", "parquet"):
        dp.write_angles(found, tmp_path / f"a.{ending}")
        back = dp.read_angles(tmp_path / f"a.{ending}")
        assert back.covariance_rad2 is not None
        assert found.covariance_rad2 is not None
        np.testing.assert_allclose(back.covariance_rad2, found.covariance_rad2, rtol=1e-15)
        np.testing.assert_allclose(back.sigma_theta_rad, found.sigma_theta_rad, rtol=1e-12)


def test_a_rest_of_another_recording_is_the_zero_of_a_bob() -> None:
    swinging = linkages.chain(106, layouts=BOB, start_rad=[0.8])
    nodes = swinging.nodes(106)
    still = replace(
        swinging, phi_rad=0 * swinging.phi_rad, places_px=(np.tile([[[320.0, 280.0]]], (1500, 1, 1)),)
    )
    found = dp.angles(nodes, zero=replace(still.nodes(107), rig=nodes.rig))
    # The pivot of the swing and the mean of 1500 frames at rest.
    assert np.abs((found.phi_rad - swinging.phi_rad).mean()) < 5 * found.meta["zero"]["sigma_rad"][0] + 5e-4


def test_no_joint_is_refused_and_a_pivot_pointed_at_is_taken_with_the_motion() -> None:
    made = linkages.chain(108, layouts=BOB, start_rad=[0.7])
    nodes = without_joints(made.nodes(108))
    with pytest.raises(
        AnglesError, match=r"the link thigh has one marker and no joint was found.*pivot='X,Y'"
    ):
        dp.angles(nodes)
    found = dp.angles(nodes, zero="vertical", pivot=(320.8, 199.4))
    # A swing tells the pivot far better than a finger does.
    assert linkages.rms(off(found, made) / found.sigma_rad)[0] == pytest.approx(1, abs=0.06)
    assert np.abs((found.phi_rad - made.phi_rad).mean()) < 2e-3
    assert not [n for n in found.meta["notes"] if "the given pivot" in n]
    near = dp.angles(nodes, zero="vertical", pivot={"thigh": (322.5, 200.0, 0.5)})
    assert any("the given pivot is" in n for n in near.meta["notes"])
    with pytest.raises(
        AnglesError, match=r"given at \(340\.0, 199\.4\) \+- 0\.5 px, and by the motion it is at \(320"
    ):
        dp.angles(nodes, zero="vertical", pivot={"thigh": (340.0, 199.4, 0.5)})
    # Said to be known to 20 px only, it is no contradiction.
    rough = dp.angles(nodes, zero="vertical", pivot={"thigh": (340.0, 199.4, 20.0)})
    assert linkages.rms(off(rough, made) / rough.sigma_rad)[0] == pytest.approx(1, abs=0.06)


def two(hung: bool) -> Nodes:
    """Two links of three and six markers that swing, one from the other or beside each other; the rig has no joint."""
    t = np.arange(1000) / 250
    phi = np.stack([0.7 * np.cos(7 * t), 0.6 * np.cos(9 * t + 1)], axis=1)
    nodes = without_joints(two_links.film(t, phi, 7))
    if not hung:
        xy = nodes.xy_px.copy()
        (x, y), c, s = two_links.ELBOW_PX, np.cos(phi[:, 0]), np.sin(phi[:, 0])
        elbow = two_links.PIVOT_PX + np.stack([c * x + s * y, -s * x + c * y], axis=1)
        xy[:, 3:] += (two_links.PIVOT_PX + np.array([300, 40]) - elbow)[:, None]
        nodes = replace(nodes, xy_px=xy)
    return nodes


@pytest.mark.parametrize("estimator", ["rigid", "linkage"])
@pytest.mark.parametrize("pivot", [(1, 1), {"upper": (1, 1)}, {"upper": (640.3, 386.7)}])
def test_a_given_pivot_away_from_the_one_found_is_refused(estimator: Any, pivot: Any) -> None:
    with pytest.raises(AnglesError, match=r"by the motion it is at \(640\.3, 380\.7\)") as refused:
        dp.angles(two(True), estimator, zero="vertical", pivot=pivot)
    assert "the angle of upper is by its 3 markers and needs no pivot" in str(refused.value)


def test_a_link_that_hangs_from_another_has_no_fixed_pivot() -> None:
    # The places in the reference picture have a noise of 0.3 px.
    for place in ((1, 1), (643.3, 570.7)):
        with pytest.raises(AnglesError, match=r"lower hangs from upper, at \(64\d\.\d, 57\d\.\d\) in the"):
            dp.angles(two(True), zero="vertical", pivot={"lower": place})


def test_a_given_pivot_where_it_is_changes_nothing_but_a_note() -> None:
    bare = dp.angles(two(True), zero="vertical")
    for place in (two_links.PIVOT_PX, two_links.PIVOT_PX + np.array([1.5, -2])):
        found = dp.angles(two(True), zero="vertical", pivot=tuple(place))
        # The prior of 1 px moves a pivot known to 0.003 px by a part of 1e-5 of 2.5 px, seen from 80 px and more.
        np.testing.assert_allclose(found.phi_rad, bare.phi_rad, rtol=0, atol=1e-5 * 2.5 / 80)
        assert any("upper is by its 3 markers and needs no pivot" in n for n in found.meta["notes"])


def test_a_pivot_of_one_of_two_links_beside_each_other_leaves_the_other_its_own() -> None:
    nodes = two(False)
    place = tuple(two_links.PIVOT_PX + np.array([300, 40]))
    found = dp.angles(nodes, zero="vertical", pivot={"lower": place})
    assert found.meta["zero"]["lines"] == ["pivot_upper-markers", "pivot-markers"]
    with pytest.raises(
        AnglesError, match=r"the pivot of lower was given at \(1\.0, 1\.0\).*it is at \(940\.3, 420\.7\)"
    ):
        dp.angles(nodes, zero="vertical", pivot={"lower": (1, 1)})


def test_a_short_swing_is_as_uncertain_as_the_pivot_that_was_pointed_at() -> None:
    pulls = []
    for seed in range(110, 122):
        made = linkages.chain(seed, 300, layouts=BOB, start_rad=[0.02])
        rng = np.random.default_rng(seed)
        nodes = without_joints(made.nodes(seed))
        found = dp.angles(
            nodes, zero="vertical=0.001", pivot=(320 + rng.normal(0, 1), 200 + rng.normal(0, 1))
        )
        # One error of all frames: its size in one frame is that of all.
        pulls.append(((found.phi_rad - made.phi_rad) / found.sigma_rad).mean())
    # The RMS of twelve scatters by 20 %.
    assert np.sqrt(np.mean(np.square(pulls))) == pytest.approx(1, abs=0.6)


@pytest.mark.parametrize(
    ("pivot", "message"),
    [
        ((1.0,), "is no place"),
        ((1.0, 2.0, 0.0), "is no place"),
        ((1.0, float("nan")), "is no place"),
        ({"bob": (1, 2)}, "there is no link 'bob'"),
    ],
)
def test_what_is_no_pivot(pivot: object, message: str) -> None:
    made = linkages.chain(109, 100, layouts=BOB)
    with pytest.raises(AnglesError, match=message):
        dp.angles(made.nodes(109), pivot=pivot)  # type: ignore[arg-type]


def test_a_path_that_is_no_circle_is_told() -> None:
    made = linkages.chain(123, layouts=BOB, start_rad=[0.7])
    bent = made.places_px[0].copy()
    bent[..., 1] += 4 * np.sin(40 * made.t_s)[:, None]
    found = dp.angles(replace(made, places_px=(bent,)).nodes(123), zero="reference_frame")
    assert any("times as far from where the joints put them" in n for n in found.meta["notes"])


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    made = linkages.chain(124, layouts=BOB, start_rad=[0.7])
    without_joints(made.nodes(124)).write(tmp_path / "n.parquet")
    command = ["angles", str(tmp_path / "n.parquet"), "-o", str(tmp_path / "a.csv"), "--zero", "vertical"]
    assert main(command) == 2
    error = capsys.readouterr().err
    assert "the link thigh has one marker and no joint was found. Give --pivot X,Y" in error
    for word in ("320.4,199.7", "thigh=320.4,199.7,2"):
        assert main([*command, "--pivot", word, "--force"]) == 0
        assert "phi1: 1500 of 1500 frames" in capsys.readouterr().out
    assert main([*command, "--pivot", "here", "--force"]) == 2
    assert "is not a list of numbers" in capsys.readouterr().err
