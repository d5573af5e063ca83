"""Bodies and joints of tracks that say nothing of either, on made mechanisms whose nodes come in any order."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pydpend as dp
import pytest
from numpy.typing import NDArray
from pydpend.cli import main
from pydpend.errors import RigError
from pydpend.nodes import Nodes

from tests.support import linkages
from tests.support.linkages import Made
from tests.unit.test_single_markers import ELBOW_AND_TIP

Floats = NDArray[np.float64]

MADE: dict[str, Callable[[int], Made]] = {
    "four-bar": linkages.four_bar,
    "slider-crank": linkages.slider_crank,
    "triple pendulum": linkages.chain,
    "elbow and tip": lambda seed: linkages.chain(seed, layouts=ELBOW_AND_TIP),
}


def through_a_camera(xy: Floats) -> Floats:
    """Places as a camera 3 deg askew with a bending lens shows them, 4 % between the picture's edges."""
    p = (xy - [320, 256]) / 320
    p = p * (1 + p @ np.array([[0.06], [-0.04]]) + 0.03 * (p**2).sum(axis=-1, keepdims=True))
    return np.asarray(p * [1.004, 1.0] * 320 + [320, 256])


def tracks(
    made: Made,
    seed: int,
    *,
    noise_px: float = 0.05,
    gaps: float = 0.0,
    wild: float = 0.0,
    seen_by: Callable[[Floats], Floats] = np.asarray,
) -> Nodes:
    """The nodes p0, p1, ... in a shuffled order, with gaps of up to 60 frames and wrong places."""
    rng = np.random.default_rng([seed, 3])
    exact = seen_by(np.concatenate(made.places_px, axis=1))
    xy = exact + rng.normal(0, noise_px, exact.shape)
    frames, count = xy.shape[:2]
    for n in range(count):
        while np.isnan(xy[:, n, 0]).mean() < gaps:
            first = rng.integers(frames)
            xy[first : first + rng.integers(5, 60), n] = np.nan
    spoilt = rng.random(xy.shape[:2]) < wild
    xy[spoilt] += rng.normal(0, 40, (int(spoilt.sum()), 2))
    order = rng.permutation(count)
    names = [f"p{i}" for i in order]
    return dp.Nodes.from_arrays(made.t_s, xy[:, order], names=names, image_px=(640, 512))


def bodies_of(nodes: Nodes) -> dict[frozenset[str], str]:
    """The name of each body by its nodes."""
    return {frozenset(n.name for n in nodes.rig.nodes if n.body == b): b for b in nodes.rig.bodies}


def assert_found(made: Made, found: Nodes, within_px: float) -> None:
    """Bodies and joints are the truth's, no more and no fewer, and joints are where they were."""
    members, first = {}, 0
    for link, places in zip(made.links, made.places_px, strict=True):
        members[link] = frozenset(f"p{first + i}" for i in range(places.shape[1]))
        first += places.shape[1]
    got = bodies_of(found)
    assert set(got) == set(members.values())
    called = {link: got[nodes] for link, nodes in members.items()}
    joints = {frozenset(j.bodies): j for j in found.rig.joints}
    assert len(joints) == len(found.rig.joints) == len(made.joints)
    row = found.rig.reference_frame
    for _, links, places in made.joints:
        between = frozenset(called[link] for link in links)
        assert between in joints
        joint = joints[between]
        if row is not None:
            assert np.hypot(*(places[row] - [joint.x_px, joint.y_px])) < within_px, joint
    found.check()


@pytest.mark.parametrize("name", MADE)
@pytest.mark.parametrize("gaps", [0.0, 0.2])
@pytest.mark.parametrize("seed", range(960, 963))
def test_bodies_and_joints_are_the_truths(name: str, gaps: float, seed: int) -> None:
    made = MADE[name](seed)
    # A joint seen in one frame is off by that frame's pose: 0.05 px by markers half as far apart as it is away.
    assert_found(made, dp.find_rig(tracks(made, seed, gaps=gaps)), 0.5)


@pytest.mark.parametrize("name", ["four-bar", "slider-crank", "triple pendulum"])
def test_a_tilted_camera_noise_of_a_network_and_wrong_places_change_nothing(name: str) -> None:
    for seed in (963, 964):
        made = MADE[name](seed)
        assert_found(made, dp.find_rig(tracks(made, seed, noise_px=1.0)), 8.0)
        assert_found(made, dp.find_rig(tracks(made, seed, noise_px=0.5, wild=0.004)), 60.0)
        found = dp.find_rig(tracks(made, seed, seen_by=through_a_camera))
        assert_found(made, found, 40.0)
        assert any("tilted or has a lens" in note for note in found.notes)


def test_bodies_are_called_by_number_from_the_ground_and_a_slider_is_told() -> None:
    found = dp.find_rig(tracks(linkages.slider_crank(965), 965))
    assert found.rig.bodies == ("link1", "link2", "link3")
    assert [j.name for j in found.rig.joints] == ["pivot", "joint1", "joint2"]
    assert [j.bodies for j in found.rig.joints] == [("link1",), ("link1", "link2"), ("link2", "link3")]
    told = [note for note in found.notes if "slides along a line at" in note]
    assert len(told) == 1
    assert told[0].startswith("link3 does not turn")


def test_the_angles_are_as_good_as_with_the_true_rig() -> None:
    made = linkages.four_bar(966)
    nodes = made.nodes(966)
    bare = dp.Nodes.from_arrays(made.t_s, nodes.xy_px, image_px=(640, 512), sigma_px=linkages.SIGMA_PX)
    found = dp.find_rig(bare)
    names = [
        bodies_of(found)[frozenset(nodes.rig.names[i] for i in nodes.rig.indices(b))] for b in made.links
    ]
    theirs = dp.angles(found, "linkage", zero="vertical").select(*names)
    ours = dp.angles(nodes, "linkage", zero="vertical")
    apart = theirs.phi_rad - ours.phi_rad
    apart -= np.median(apart, axis=0)
    assert np.sqrt(np.mean(apart**2)) < 0.1 * float(np.median(ours.sigma_rad))


def pins(made: Made, places: Sequence[Floats], names: Sequence[str], seed: int) -> Nodes:
    xy = np.stack(places, axis=1)
    xy = xy + np.random.default_rng(seed).normal(0, 0.3, xy.shape)
    return dp.Nodes.from_arrays(made.t_s, xy, names=names, image_px=(640, 512))


def test_nodes_on_the_joints_themselves_as_of_a_leg() -> None:
    made = linkages.chain(967, layouts=linkages.CHAIN[:2])
    hip, knee = (places for _, _, places in made.joints)
    phi = made.phi_rad[:, 1]
    ankle = knee + linkages.LENGTHS_PX[1] * np.stack([np.sin(phi), np.cos(phi)], axis=-1)
    found = dp.find_rig(pins(made, [ankle, hip, knee], ["ankle", "hip", "knee"], 967))
    assert [(n.name, n.body) for n in found.rig.nodes] == [
        ("hip", "link1"),
        ("knee", "link1"),
        ("ankle", "link2"),
    ]
    assert [j.bodies for j in found.rig.joints] == [("link1",), ("link1", "link2")]
    error = dp.angles(found, zero="vertical").phi_rad - made.phi_rad
    # 0.3 px at both ends of 85 and 78 px.
    assert (np.degrees(np.std(error, axis=0)) < 1.2 * np.degrees(0.3 * 2**0.5 / 78)).all()


def test_a_link_without_a_node_of_its_own_is_said() -> None:
    made = linkages.four_bar(968)
    found = dp.find_rig(pins(made, [p for _, _, p in made.joints], ["A", "D", "B", "C"], 968))
    assert set(bodies_of(found)) == {frozenset("AB"), frozenset("CD")}
    assert any("keep their distance: the link between them has no node" in note for note in found.notes)


def test_what_stands_still_and_what_hangs_on_nothing_are_said() -> None:
    made = linkages.chain(969, layouts=linkages.CHAIN[:2])
    nodes = tracks(made, 969)
    rng = np.random.default_rng(969)
    frames = len(nodes)
    screw = np.tile([50.0, 60.0], (frames, 1)) + rng.normal(0, 0.05, (frames, 2))
    fly = np.cumsum(rng.normal(0, 2, (frames, 2)), axis=0)
    xy = np.concatenate([nodes.xy_px, screw[:, None], fly[:, None], np.full((frames, 1, 2), np.nan)], axis=1)
    names = [*nodes.rig.names, "screw", "fly", "ghost"]
    found = dp.find_rig(dp.Nodes.from_arrays(made.t_s, xy, names=names, image_px=(640, 512)))
    assert found.rig.bodies == ("link1", "link2", "link3", "still")
    assert bodies_of(found)[frozenset({"screw", "ghost"})] == "still"
    assert any("link3 (fly) shares no point" in note for note in found.notes)
    assert any("ghost is never seen" in note for note in found.notes)
    assert dp.angles(found, zero="vertical", bodies=["link1", "link2"]).links == 2


def test_what_is_no_mechanism_is_refused() -> None:
    t, rng = np.arange(500) / 100, np.random.default_rng(970)
    still = np.tile([[10.0, 20.0], [200.0, 30.0]], (500, 1, 1)) + rng.normal(0, 0.1, (500, 2, 2))
    with pytest.raises(RigError, match="nothing moves"):
        dp.find_rig(dp.Nodes.from_arrays(t, still))
    loose = np.cumsum(rng.normal(0, 2, (500, 3, 2)), axis=0)
    with pytest.raises(RigError, match="no two nodes keep their distance"):
        dp.find_rig(dp.Nodes.from_arrays(t, loose))
    few = linkages.four_bar(970, 20)
    with pytest.raises(RigError, match="no two nodes keep their distance"):
        dp.find_rig(tracks(few, 970))


def test_the_command_from_anyones_table_to_angles(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    made = linkages.four_bar(971, 800)
    tracks(made, 971).write(tmp_path / "n.parquet")
    rigged = str(tmp_path / "r.parquet")
    assert main(["find-rig", str(tmp_path / "n.parquet"), "-o", rigged]) == 0
    said = capsys.readouterr()
    assert "pivot2: " in said.out
    assert " on the ground, at (" in said.out
    assert main(["angles", rigged, "--zero", "vertical", "-o", str(tmp_path / "a.csv")]) == 0
    assert main(["find-rig", str(tmp_path / "n.parquet"), "-o", rigged, "--force", "--json"]) == 0
