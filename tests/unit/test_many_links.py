"""Angles of mechanisms with any number of links: names, tables there and back, refusals with a way on."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pydpend as dp
import pytest
from pydpend.cli import main
from pydpend.errors import AnglesError, FitError
from pydpend.kinematics import LinkJoint

from tests.support import linkages


def test_three_links_of_a_chain_have_their_angles_their_joints_and_a_zero_from_rest() -> None:
    made = linkages.chain(1, rest_s=1.0)
    found = dp.angles(made.nodes(1))
    assert found.link_names == ("thigh", "shank", "foot")
    assert found.joints == (LinkJoint("joint1", ("thigh", "shank")), LinkJoint("joint2", ("shank", "foot")))
    assert found.meta["zero"]["from"] == "rest"
    error = found.phi_rad - made.phi_rad
    # The zero is the mean of 500 frames at rest: its error is common and a twentieth of a frame's.
    assert (linkages.rms(error / found.sigma_rad) < 1.1).all()
    assert (linkages.rms(error / found.sigma_rad) > 0.9).all()
    np.testing.assert_allclose(found.theta_rad, np.diff(found.phi_rad, axis=1))
    theta = np.diff(made.phi_rad, axis=1)
    pull = (found.theta_rad - theta) / found.sigma_theta_rad
    assert (np.abs(linkages.rms(pull) - 1) < 0.1).all()


def test_a_four_bar_has_absolute_angles_from_the_vertical_and_a_rest_is_refused_with_the_way_on() -> None:
    made = linkages.four_bar(2)
    nodes = made.nodes(2, joint_error_px=0.0)
    with pytest.raises(AnglesError, match=r"close a loop at C \(coupler and rocker\).*zero='vertical'"):
        dp.angles(nodes)
    found = dp.angles(nodes, zero="vertical")
    # The rig's joints are exact, and its markers err by 0.05 px over an arm of 20 px.
    off = np.angle(np.exp(1j * (found.phi_rad - made.phi_rad)))
    assert (np.abs(off.mean(axis=0)) < np.radians(0.3)).all()
    assert (np.abs(off.std(axis=0) / linkages.rms(found.sigma_rad) - 1) < 0.1).all()
    assert [j.name for j in found.joints] == ["B", "C"]


def test_a_slider_keeps_its_angle() -> None:
    made = linkages.slider_crank(3)
    found = dp.angles(made.nodes(3), zero="reference_frame")
    assert found.link_names == ("crank", "rod", "slider")
    turned = made.phi_rad - made.phi_rad[0]
    off = found.phi_rad - turned
    assert (np.abs((off - off.mean(axis=0)).std(axis=0) / linkages.rms(found.sigma_rad) - 1) < 0.1).all()


@pytest.mark.parametrize("ending", ["parquet", "csv"])
def test_a_table_of_named_links_there_and_back(tmp_path: Path, ending: str) -> None:
    made = linkages.four_bar(4, frames=200)
    names = ("crank", 'the "long", one', "rocker")
    nodes = made.nodes(4)
    found = dp.angles(nodes, zero="reference_frame")
    found = replace(found, link_names=names, joints=(LinkJoint("B", names[:2]),))
    dp.write_angles(found, tmp_path / f"a.{ending}")
    back = dp.read_angles(tmp_path / f"a.{ending}")
    assert back.link_names == names
    assert back.joints == found.joints
    assert back.meta == found.meta | {"name": found.name}
    for part in ("t_s", "phi_rad", "sigma_rad", "frame", "camera_rad", "theta_rad", "sigma_camera_theta_rad"):
        np.testing.assert_array_equal(getattr(back, part), getattr(found, part))
    columns = found.to_columns()
    assert list(columns)[:5] == [
        "frame",
        "time_s",
        "phi_crank_rad",
        'phi_the "long", one_rad',
        "phi_rocker_rad",
    ]
    assert {"sigma_phi_crank_rad", "camera5_phi_rocker_rad", "theta_B_rad", "sigma_theta_B_rad"} <= set(
        columns
    )


def test_anyones_table_of_three_links(tmp_path: Path) -> None:
    file = tmp_path / "three.csv"
    file.write_text("time_s,phi1_deg,phi2_deg,phi3_deg,sigma2_deg\n0,0,1,2,0.1\n1,3,4,5,0.1\n")
    found = dp.read_angles(file, hanging_rad=[0.0, 0.0, np.pi])
    assert found.link_names == ("link1", "link2", "link3")
    np.testing.assert_allclose(np.degrees(found.phi_rad[1]), [3, 4, -175])
    np.testing.assert_allclose(np.degrees(found.sigma_rad[1]), [np.nan, 0.1, np.nan])
    file.write_text("time_s,phi_hip_deg,phi_knee_rad\n0,0,1\n1,3,4\n")
    assert dp.read_angles(file).link_names == ("hip", "knee")
    file.write_text("time_s,phi1_deg,phi3_deg\n0,0,1\n1,3,4\n")
    with pytest.raises(AnglesError, match="no column phi2_rad or phi2_deg, and there are later ones"):
        dp.read_angles(file)
    file.write_text("time_s,phi_hip_deg,phi_knee_deg,phi_toe_deg\n0,0,1,400\n1,3,4,inf\n")
    with pytest.raises(AnglesError, match="line 3, column phi_toe_deg: the angle is infinite"):
        dp.read_angles(file)


def test_some_links_of_many() -> None:
    found = dp.angles(linkages.chain(5, 400).nodes(5), zero="vertical")
    two = found.select("shank", "thigh")
    assert two.link_names == ("shank", "thigh")
    np.testing.assert_array_equal(two.phi_rad, found.phi_rad[:, [1, 0]])
    assert two.meta["zero"]["sigma_rad"] == [found.meta["zero"]["sigma_rad"][k] for k in (1, 0)]
    assert two.joints == found.joints[:1]
    assert list(two.to_columns())[:4] == ["frame", "time_s", "phi1_rad", "phi2_rad"]
    with pytest.raises(AnglesError, match=r"no link 'toe'\. The links are thigh, shank, foot"):
        found.select("toe")


def test_a_fit_of_three_links_says_how_to_take_two() -> None:
    found = dp.angles(linkages.chain(6, 400).nodes(6), zero="vertical")
    for pinned in (False, True):
        with pytest.raises(FitError, match=r"3 links \(thigh, shank, foot\).*dp\.LinkAngles\.select"):
            dp.fit_damping(found, dp.derived("A"), pinned=pinned)


def test_the_command_on_three_links(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    made = linkages.chain(7, 400)
    made.nodes(7).write(tmp_path / "n.parquet")
    out, figure = str(tmp_path / "a.csv"), str(tmp_path / "a.svg")
    command = ["angles", str(tmp_path / "n.parquet"), "-o", out]
    assert main([*command, "--zero", "vertical", "--figure", figure]) == 0
    said = capsys.readouterr().out
    assert "phi_thigh: 400 of 400 frames" in said
    assert "phi_foot: 400 of 400 frames" in said
    assert dp.read_angles(out).link_names == made.links
    assert "thigh" in Path(figure).read_text()
    assert main([*command, "--bodies", "shank,foot", "--zero", "reference_frame", "--force"]) == 0
    assert dp.read_angles(out).link_names == ("shank", "foot")
    assert main([*command, "--bodies", "shank,shank", "--force"]) == 2
    assert "no body, or one twice" in capsys.readouterr().err
