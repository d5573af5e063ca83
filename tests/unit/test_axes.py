"""Zeros by a direction of the picture, along lines of the links that are named, with their uncertainty."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pydpend as dp
import pytest
from numpy.typing import NDArray
from pydpend.cli import main
from pydpend.errors import AnglesError
from pydpend.kinematics.estimators import Method

from tests.support import linkages

Floats = NDArray[np.float64]


def off(found: dp.LinkAngles, made: linkages.Made) -> Floats:
    """Mean error of each link, whole turns left out, rad."""
    return np.asarray(np.angle(np.exp(1j * (found.phi_rad - made.phi_rad))).mean(axis=0))


@pytest.mark.parametrize("estimator", ["rigid", "linkage"])
def test_the_vertical_along_the_joints_is_as_sure_as_these(estimator: Method) -> None:
    pulls = []
    for seed in range(300, 308):
        made = linkages.four_bar(seed, 600)
        found = dp.angles(made.nodes(seed, joint_error_px=3.0), estimator, zero="vertical=0.0001")
        zero = found.meta["zero"]
        assert zero["lines"] == ["A-B", "B-C", "D-C"]
        pulls.append(off(found, made) / zero["sigma_rad"])
        assert max(np.degrees(zero["sigma_rad"])) < 0.05
    # The RMS of 24 numbers scatters by 14 %; the rig's joints, 3 px off, have no say.
    assert np.sqrt(np.mean(np.square(pulls))) == pytest.approx(1, abs=0.45)


def test_a_line_from_a_joint_to_a_marker_and_one_between_markers() -> None:
    made = linkages.chain(310)
    found = dp.angles(
        made.nodes(310), zero="vertical=0.001", axis={"thigh": "pivot-n1", "foot": ("n6", "n8")}
    )
    # The markers lie (70, -8) px from the pivot, and (68, 4) from (16, 8): that far the lines are turned.
    turned = np.array([np.arctan2(-8, 70), 0, np.arctan2(4 - 8, 68 - 16)])
    assert (np.abs(off(found, made) - turned) < 4 * np.array(found.meta["zero"]["sigma_rad"])).all()
    assert found.meta["zero"]["lines"] == ["pivot-n1", "joint1-joint2", "n6-n8"]


def test_the_horizontal_is_a_quarter_turn_on() -> None:
    made = linkages.four_bar(311, 300)
    nodes = made.nodes(311)
    down, right = (dp.angles(nodes, zero=zero) for zero in ("vertical", "horizontal=1"))
    np.testing.assert_allclose(
        np.angle(np.exp(1j * (down.phi_rad - right.phi_rad - np.pi / 2))), 0, atol=1e-12
    )
    assert right.meta["zero"]["from"] == "the picture's horizontal"
    assert right.meta["zero"]["sigma_rad"] == down.meta["zero"]["sigma_rad"]


def test_a_link_without_joints_has_a_vertical_by_two_of_its_markers() -> None:
    made = linkages.chain(312, 300)
    nodes = made.nodes(312, joints=False)
    with pytest.raises(AnglesError, match=r"the joint of link thigh is not known.*axis"):
        dp.angles(nodes, zero="vertical")
    lines = {"thigh": "n0-n1", "shank": "n3-n4", "foot": "n6-n7"}
    found = dp.angles(nodes, zero="vertical=0.01", axis=lines)
    turned = np.array([np.arctan2(-16, 50), np.arctan2(17, 40), np.arctan2(-17, 32)])
    assert (np.abs(off(found, made) - turned) < np.radians(0.4)).all()
    assert (np.degrees(found.meta["zero"]["sigma_rad"]) < 0.4).all()


@pytest.mark.parametrize(
    ("zero", "axis", "message"),
    [
        ("vertical", {"hip": "a-b"}, r"no link 'hip'. The links are thigh, shank, foot"),
        (
            "vertical",
            {"thigh": "pivot-n5"},
            r"'pivot-n5' names no two points of thigh. Give two of n0, n1, n2, pivot",
        ),
        ("vertical", {"thigh": ("pivot",)}, "'pivot' names no two points of thigh"),
        ("vertical", {"thigh": "n1-n1"}, "n1 and n1 of thigh are one point"),
        ("reference_frame", {"thigh": "n0-n1"}, "counts only where a direction of the picture is the zero"),
        ("upright", {}, "'upright' is not known"),
    ],
)
def test_what_is_no_line(zero: str, axis: dict[str, str], message: str) -> None:
    with pytest.raises(AnglesError, match=message):
        dp.angles(linkages.chain(313, 200).nodes(313), zero=zero, axis=axis)


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    made = linkages.four_bar(314, 300)
    made.nodes(314).write(tmp_path / "n.parquet")
    command = ["angles", str(tmp_path / "n.parquet"), "-o", str(tmp_path / "a.csv")]
    assert main(command) == 2
    assert "so a rest is no zero. Give --zero vertical" in capsys.readouterr().err
    assert main([*command, "--zero", "horizontal=0.5", "--axis", "crank=A-B"]) == 0
    assert "zero from the picture's horizontal (+- 0.5 and 0.5 and 0.5 deg)" in capsys.readouterr().out
    assert main([*command, "--zero", "horizontal", "--axis", "A-B", "--force"]) == 2
    assert "'A-B' does not name a link and two points. Write upper=pivot-elbow" in capsys.readouterr().err
