"""The order of links in a rig without a pivot: told by the motion, refused if wrong, noted where nothing tells."""

from __future__ import annotations

import dataclasses
import warnings

import numpy as np
import pydpend as dp
import pytest
from pydpend.nodes import Joint

from tests.support import two_links as rig


def film(seconds: float, bodies: tuple[str, ...], *, moved: float = 1.0) -> dp.Nodes:
    """The end of a drop, in a rig of these bodies in this order without joints; ``moved``: part of it that is made."""
    t, phi = rig.drop(2.0 + seconds, 500.0, 7)
    t, phi = t[t >= 2.0] - 2.0, phi[t >= 2.0]
    nodes = rig.film(t, phi[0] + moved * (phi - phi[0]), 8)
    keep = np.array([n.body in bodies for n in nodes.rig.nodes])
    order = [i for name in bodies for i, n in enumerate(nodes.rig.nodes) if n.body == name]
    assert sorted(order) == np.flatnonzero(keep).tolist()
    return dataclasses.replace(
        nodes,
        xy_px=nodes.xy_px[:, order],
        sigma_px=nodes.sigma_px[:, order],
        area_px=nodes.area_px[:, order],
        status=nodes.status[:, order],
        rig=dataclasses.replace(
            nodes.rig, nodes=tuple(nodes.rig.nodes[i] for i in order), bodies=bodies, joints=()
        ),
    )


def notes(nodes: dp.Nodes, bodies: tuple[str, ...] | None = None) -> list[str]:
    found = dp.angles(nodes, zero="reference_frame", bodies=bodies)
    return [note for note in found.meta["notes"] if "pivot" in note]


@pytest.mark.parametrize("seconds", [0.2, 1.0])
def test_the_motion_tells_the_order(seconds: float) -> None:
    assert notes(film(seconds, ("upper", "lower"))) == []
    assert notes(film(seconds, ("upper",))) == []
    with pytest.raises(dp.AnglesError) as refused:
        notes(film(seconds, ("lower", "upper")))
    assert str(refused.value) == (
        "nodes: upper turns about a point that stays, and lower, which would be phi1, does not. Name the links from "
        "the pivot outwards, with bodies=...: upper, lower"
    )
    right = dp.angles(film(seconds, ("upper", "lower")), zero="reference_frame")
    named = dp.angles(film(seconds, ("lower", "upper")), zero="reference_frame", bodies=("upper", "lower"))
    np.testing.assert_allclose(named.phi_rad, right.phi_rad, atol=1e-12)


@pytest.mark.parametrize("seconds", [0.2, 1.0])
def test_a_lower_link_alone_is_not_called_the_upper_one_without_a_word(seconds: float) -> None:
    lower = film(seconds, ("lower",))
    assert notes(lower) == [
        "the rig has no pivot, and lower turns about no point that stays, and may hang from a link that was not found: "
        "phi1 is lower, and phi1 need not be the upper link's"
    ]
    # Whoever names it knows which it is.
    assert notes(lower, ("lower",)) == []


@pytest.mark.parametrize("moved", [0.0, 0.002])
@pytest.mark.parametrize("bodies", [("upper", "lower"), ("lower", "upper")])
def test_links_that_hardly_move_tell_no_order(moved: float, bodies: tuple[str, ...]) -> None:
    first, second = bodies
    assert notes(film(0.2, bodies, moved=moved)) == [
        f"the rig has no pivot, and {first} turns too little to show one: phi1 is {first} and phi2 is {second}, "
        "and phi1 need not be the upper link's"
    ]


def test_the_rigs_pivot_tells_the_order() -> None:
    t, phi = rig.drop(1.0, 500.0, 7)
    nodes = rig.film(t, phi, 8)
    elbow = Joint("elbow", ("upper", "lower"), 640.0, 300.0)
    for joints in (nodes.rig.joints, (*nodes.rig.joints, elbow), (elbow, *nodes.rig.joints)):
        of_joints = dataclasses.replace(nodes, rig=dataclasses.replace(nodes.rig, joints=joints))
        with pytest.raises(
            dp.AnglesError, match=r"pivot is of upper, and lower, which would be phi1.*: upper, lower"
        ):
            dp.angles(of_joints, zero=(0.0, 0.0), bodies=("lower", "upper"))
        assert structure_of(of_joints, ("lower",)) == ("lower",)
    # A rig that lists them so is refused as well.
    turned = dataclasses.replace(nodes, rig=dataclasses.replace(nodes.rig, bodies=("lower", "upper")))
    with pytest.raises(dp.AnglesError, match="turns about no place"):
        dp.angles(turned, zero=(0.0, 0.0))


def structure_of(nodes: dp.Nodes, bodies: tuple[str, ...]) -> tuple[str, ...]:
    """The links of the angles of some bodies."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", dp.RecordingWarning)
        return tuple(dp.angles(nodes, zero="reference_frame", bodies=bodies).link_names)
