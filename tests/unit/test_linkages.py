"""The linkage estimator on chains and loops: at the Cramer-Rao bound, as uncertain as it says, with its joints."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pydpend as dp
import pytest
from numpy.typing import NDArray
from pydpend.errors import AnglesError
from pydpend.kinematics.body_view import BodyView
from pydpend.kinematics.camera_slopes import linkage_slopes
from pydpend.kinematics.estimators import poses_of
from pydpend.kinematics.linkage_frames import fit_linkage
from pydpend.kinematics.markers import body_markers
from pydpend.kinematics.structure import Structure

from tests.support import linkages
from tests.support.linkages import Made

Floats = NDArray[np.float64]


def chain_bound(made: Made) -> Floats:
    """Cramer-Rao bounds (T, L) of a chain's angles, its geometry known, by the lever of each joint on each marker."""
    links = len(made.links)
    pivots = [place for _, _, place in made.joints]
    information = np.zeros((made.t_s.size, links, links))
    for k, places in enumerate(made.places_px):
        levers = [pivots[j + 1] - pivots[j] for j in range(k)]
        for m in range(places.shape[1]):
            slopes = [*levers, places[:, m] - pivots[k]]
            for a, one in enumerate(slopes):
                for b, other in enumerate(slopes):
                    # A quarter turn of both leaves their product.
                    information[:, a, b] += (one * other).sum(axis=1) / linkages.SIGMA_PX**2
    return np.asarray(np.sqrt(np.einsum("taa->ta", np.linalg.inv(information))))


def crank_bound(made: Made) -> Floats:
    """The same of a mechanism of one degree of freedom: all places and angles follow the crank's."""
    turned = np.gradient(made.phi_rad[:, 0])
    moves = sum(
        ((np.gradient(p, axis=0) / turned[:, None, None]) ** 2).sum(axis=(1, 2)) for p in made.places_px
    )
    crank = linkages.SIGMA_PX / np.sqrt(moves)
    return np.asarray(crank[:, None] * np.abs(np.gradient(made.phi_rad, axis=0) / turned[:, None]))


def error_of(found: dp.LinkAngles, made: Made) -> Floats:
    """Errors but for whole turns and the zero, which is one of all frames."""
    error = np.angle(np.exp(1j * (found.phi_rad - made.phi_rad)))
    return np.asarray(error - np.nanmean(error, axis=0))


CASES: dict[str, tuple[Callable[[int], Made], Callable[[Made], Floats]]] = {
    "triple": (linkages.chain, chain_bound),
    "four-bar": (linkages.four_bar, crank_bound),
}


@pytest.mark.parametrize("kind", CASES)
def test_errors_are_at_the_bound_and_as_stated(kind: str) -> None:
    make, bound_of = CASES[kind]
    squares, bounds, pulls = [], [], []
    for seed in (201, 202, 203):
        made = make(seed)
        found = dp.angles(made.nodes(seed), "linkage", zero="reference_frame")
        error = error_of(found, made)
        squares.append((error**2).mean(axis=0))
        bounds.append((bound_of(made) ** 2).mean(axis=0))
        pulls.append(((error / found.sigma_rad) ** 2).mean(axis=0))
    assert (np.sqrt(np.mean(squares, axis=0) / np.mean(bounds, axis=0)) < 1.1).all()
    assert (np.abs(np.sqrt(np.mean(pulls, axis=0)) - 1) < 0.1).all()


def test_a_slider_s_angle_is_by_its_own_markers_and_the_others_by_the_joints() -> None:
    made = linkages.slider_crank(204)
    found = dp.angles(made.nodes(204), "linkage", zero="reference_frame")
    rigid = dp.angles(made.nodes(204), zero="reference_frame")
    assert (np.abs(linkages.rms(error_of(found, made) / found.sigma_rad) - 1) < 0.1).all()
    better = linkages.rms(error_of(found, made)) / linkages.rms(error_of(rigid, made))
    assert (better < (0.5, 0.5, 1.05)).all()


def test_joints_lengths_and_how_a_loop_closes() -> None:
    made = linkages.four_bar(205)
    linkage = dp.find_linkage(made.nodes(205))
    for ends, true in ((("A", "B"), 70.0), (("B", "C"), 200.0), (("D", "C"), 160.0)):
        length, sigma = linkage.lengths[ends]
        assert abs(length - true) < 4 * sigma
        assert sigma < 0.02
    found = dp.angles(made.nodes(205), "linkage", zero="vertical")
    joints = {j["name"]: j for j in found.meta["linkage"]["joints"]}
    assert [name for name, j in joints.items() if j["closes_loop"]] == ["C"]
    for joint in joints.values():
        assert joint["rms_px"] == pytest.approx(joint["expected_px"], rel=0.1)
    # Joints from the motion make the picture's vertical a zero that no marker of the reference picture spoils.
    off = np.angle(np.exp(1j * (found.phi_rad - made.phi_rad))).mean(axis=0)
    assert (np.abs(off) < np.radians(0.01)).all()


def test_play_in_a_joint_is_told() -> None:
    made = linkages.four_bar(206)
    loose = [p.copy() for p in made.places_px]
    loose[2] += 0.4 * np.sin(60 * made.t_s)[:, None, None]
    found = dp.angles(replace(made, places_px=tuple(loose)).nodes(206), "linkage", zero="vertical")
    assert any("the two sides of C are 0." in n and "the joint has play" in n for n in found.meta["notes"])


def test_a_link_is_told_by_one_marker_and_by_its_joints_alone() -> None:
    made = linkages.four_bar(207)
    hidden = np.zeros((made.t_s.size, 9), dtype=bool)
    hidden[200:300, 4:6] = True
    hidden[600:650, 3:6] = True
    hidden[900:910, :] = True
    nodes = made.nodes(207, hidden=hidden)
    found = dp.angles(nodes, "linkage", zero="vertical")
    assert found.seen[200:900].all()
    assert not found.seen[900:910].any()
    pull = error_of(found, made) / found.sigma_rad
    for rows in (slice(200, 300), slice(600, 650)):
        assert (linkages.rms(pull[rows]) < 1.3).all()
    assert np.isnan(dp.angles(nodes, zero="vertical").phi_rad[600:650, 1]).all()


@pytest.mark.parametrize("estimator", dp.kinematics.estimators.ESTIMATORS)
@pytest.mark.parametrize("node", [0, 4, 8])
def test_a_node_that_is_never_seen_is_left_out_and_named(node: int, estimator: Any) -> None:
    """The fit of the shape has no place for it, and was singular."""
    made = linkages.chain(212)
    hidden = np.zeros((made.t_s.size, 9), bool)
    hidden[:, node] = True
    # Of another marker beside it, somewhere else for a while, nothing tells which of the two is right.
    nodes = made.nodes(212, hidden=hidden)
    nodes.xy_px[100:110, (node // 3) * 3 + (node + 1) % 3] += 4.0
    found = dp.angles(nodes, estimator, zero="reference_frame")
    assert found.meta["notes"][0].startswith(f"n{node}: never seen")
    error = error_of(found, made)
    error[100:110] = 0.0
    # The worst of 1500 frames of three links is at 4.2 standard deviations.
    assert np.nanmax(np.abs(error) / found.sigma_rad) < 6.0
    assert np.isfinite(error).mean() > 0.95


def test_links_that_hang_on_nothing() -> None:
    made = linkages.chain(208)
    drift = np.stack([20 * np.sin(3 * made.t_s), 15 * np.cos(2 * made.t_s)], axis=1)[:, None]
    moving = replace(made, places_px=tuple(p + drift for p in made.places_px), joints=tuple(made.joints[1:]))
    nodes = moving.nodes(208)
    found = dp.angles(nodes, "linkage", zero="reference_frame")
    rigid = dp.angles(nodes, zero="reference_frame")
    assert (np.abs(linkages.rms(error_of(found, made) / found.sigma_rad) - 1) < 0.1).all()
    assert (linkages.rms(error_of(found, made)) < linkages.rms(error_of(rigid, made))).all()


def test_a_linkage_that_turns_too_little_names_the_joint() -> None:
    made = linkages.chain(209, start_rad=[0.001, 0.001, 0.001])
    with pytest.raises(AnglesError, match="turn too little against each other to find the pivot"):
        dp.angles(made.nodes(209), "linkage", zero="vertical")


def test_the_camera_turns_the_linkage_as_differences_of_films_say() -> None:
    made = linkages.four_bar(210, frames=400)
    nodes = made.nodes(210, sigma_px=0.001)
    found = dp.angles(nodes, "linkage", zero="reference_frame")
    assert found.camera_rad is not None
    # A camera a standard deviation off in one number shows the places moved; the angles follow as stated.
    camera = {"origin": "given", "stretch": [0.0, 0.0], "vanishing": [0.02, 0.0], "k1": 0.0}
    tilted = dp.angles(
        replace(nodes, rig=replace(nodes.rig, camera=camera)), "linkage", zero="reference_frame"
    )
    moved = tilted.phi_rad - found.phi_rad
    moved -= moved.mean(axis=0)
    poses = poses_of(body_markers(nodes))
    linked = fit_linkage(poses, Structure.of(nodes.rig, made.links))
    slopes = linkage_slopes([BodyView.of(nodes, p, mirrored=False) for p in poses], linked)[..., 2]
    expected = 0.02 * (slopes - slopes.mean(axis=0))
    # The second order of a step of 0.02 is some percent.
    assert (linkages.rms(moved - expected) < 0.1 * linkages.rms(expected)).all()
