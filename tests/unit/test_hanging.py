"""Which rest is the zero: holds are no rest that hangs, whatever happens after them; and the picture's vertical."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pydpend as dp
import pytest
from numpy.typing import NDArray
from pydpend.errors import AnglesError
from pydpend.kinematics import LinkAngles, Rest, Swing, angles, parse_zero, roll_sigma
from pydpend.kinematics.rests import lone_sigma
from pydpend.kinematics.vertical import Down
from pydpend.model import Damping, Model, derived
from pydpend.nodes import Joint, Nodes
from pydpend.simulation import simulate

from tests.support import two_links as rig

Floats = NDArray[np.float64]

LIGHT = Damping(mu_v1=2e-5, mu_v2=1e-5, mu_q2=1e-6, tau_c1=1e-3, tau_c2=5e-5)
STRONG = Damping(mu_v1=3e-3, mu_v2=6e-4, tau_c1=1e-3, tau_c2=5e-5)
"""Brings the links to rest within seconds; its dry friction lets them stop within 0.3 deg of hanging."""
BAR = Model.one_link(0.00128, 0.24, 0.3)
FPS = 250.0


def held(
    deg: tuple[float, ...], swing_s: float, *, damping: Damping = LIGHT, hold_s: float = 1.0, fps: float = FPS
) -> tuple[Floats, Floats]:
    """Times and angles (T, L) of links held still at ``deg`` and let go."""
    links = len(deg)
    t = np.arange(round((hold_s + swing_s) * fps)) / fps
    phi = np.tile(np.radians(deg), (t.size, 1))
    free = t >= hold_s
    start = [*phi[0], 0.0, 0.0] if links == 2 else [phi[0, 0], 0.0, 0.0, 0.0]
    model = derived("A") if links == 2 else BAR
    phi[free] = simulate(model, damping, start, t[free], tolerance=1e-9).phi_rad[:, :links]
    return t, phi


def thrown(deg: tuple[float, ...], w: tuple[float, float], throw_s: float) -> tuple[Floats, Floats]:
    """Times and angles (T, 2) of links held still at ``deg`` for a second and thrown with the rates ``w``."""
    t = np.arange(round((1 + throw_s) * FPS)) / FPS
    phi = np.tile(np.radians(deg), (t.size, 1))
    free = t >= 1
    if free.any():
        start = [*phi[0], *w]
        phi[free] = simulate(derived("A"), LIGHT, start, t[free], tolerance=1e-9).phi_rad
    return t, phi


def filmed(t: Floats, phi: Floats, roll_deg: float = 0.0, zero: Any = "rest") -> LinkAngles:
    """The angles of a film whose camera is rolled, the links pointing down in its reference picture."""
    roll = np.radians(roll_deg)
    # Turning the camera about its axis turns everything about the pivot by the same angle.
    return angles(rig.film(t, phi + roll, 41, reference_rad=(roll, roll)), zero=zero)


def off_deg(found: LinkAngles, phi: Floats) -> Floats:
    """By how much each link's zero is wrong, deg; one angle's noise is 0.02 to 0.05 deg."""
    return np.asarray(np.abs(np.degrees(np.median(found.phi_rad - phi, axis=0))))


@pytest.mark.parametrize(
    ("deg", "swing_s", "roll_deg", "said"),
    [
        ((50.0, 50.0), 3.0, 0.0, "held still at about 51 and 50 deg from the picture's vertical"),
        ((50.0, 50.0), 3.0, 5.0, "goes about a direction 50"),
        ((10.0, 10.0), 3.0, -5.0, "goes about a direction"),
        ((5.0, 5.0), 3.0, 0.0, "goes about a direction"),
        ((30.0, -30.0), 3.0, 0.0, "held still at about 31 and 30 deg"),
        ((55.0, 5.0), 3.0, 0.0, "held still at about 56 and 5.1 deg"),
        ((0.0, 40.0), 3.0, 0.0, "held still at about 0.9 and 40 deg"),
        ((88.0, 88.0), 3.0, 5.0, "held still at about 94 and 93 deg"),
        ((178.0, -175.0), 4.0, 0.0, "held still at about 179 and 175 deg"),
        # Let go just before the end: no swing tells yet where the links hang.
        ((50.0, 50.0), 0.15, 0.0, "held still at about 51 and 50 deg"),
        ((10.0, 10.0), 0.2, 0.0, "the motion goes to one side of it only"),
        ((10.0,), 2.0, 0.0, "held still at about 9.4 deg"),
        ((40.0,), 0.6, 5.0, "goes about a direction"),
        ((40.0,), 2.0, 0.0, "held still at about 39 deg"),
        ((80.0,), 2.0, 0.0, "held still at about 79 deg"),
        ((10.0,), 0.2, 0.0, "the motion goes to one side of it only"),
        ((10.0,), 0.06, 0.0, "the motion goes to one side of it only"),
    ],
)
def test_a_hold_is_no_zero(deg: tuple[float, ...], swing_s: float, roll_deg: float, said: str) -> None:
    with pytest.raises(AnglesError, match=re.escape(said)) as refused:
        filmed(*held(deg, swing_s), roll_deg)
    assert "Give zero='vertical' for the picture's vertical" in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_hold_that_creeps_is_no_zero() -> None:
    t, phi = held((50.0, 50.0), 3.0)
    creep = np.radians(0.08) * np.minimum(t - 1, 0)[:, None]
    with pytest.raises(AnglesError, match="goes about a direction 50"):
        filmed(t, phi + creep)


def test_a_hold_before_a_slow_small_swing_is_no_zero() -> None:
    # A heavy bar that swings by 2 deg once in five seconds.
    t = np.arange(1200) / 100
    phi = np.where(t < 1, 1.0, np.cos(2 * np.pi * 0.2 * (t - 1)) * np.exp(-0.02 * (t - 1))) * np.radians(2)
    with pytest.raises(AnglesError, match=r"goes about a direction 2\.0 deg"):
        filmed(t, phi[:, None])


@pytest.mark.parametrize("rate", [15.0, 60.0, 300.0])
def test_a_release_that_creeps_to_its_rest_is_judged_by_the_end(rate: float) -> None:
    """Overdamped (the friction is ``rate`` per s, the swing 1.4 Hz): it never crosses zero."""
    fine = np.arange(0, 20, 1e-4)
    angle, w = np.radians(40.0), 0.0
    motion = np.empty(fine.size)
    for i in range(fine.size):
        motion[i] = angle
        w = (w - 1e-4 * 81.0 * np.sin(angle)) / (1 + 1e-4 * rate)
        angle += 1e-4 * w
    t = np.arange(round(21 * FPS)) / FPS
    phi = np.where(t < 1, np.radians(40.0), np.interp(t - 1, fine, motion))[:, None]
    early = t < 1.6
    with pytest.raises(AnglesError, match="held still at about 39 deg"):
        filmed(t[early], phi[early])
    found = filmed(t, phi, 4.0)
    # A rest moves by no more than 0.1 deg in half a second: from 300 / 81 s before it hangs, at most 0.74 deg.
    assert off_deg(found, phi)[0] < 0.1 + 0.2 * rate / 81
    assert off_deg(found, phi)[0] < 3 * np.degrees(found.meta["zero"]["sigma_rad"][0]) + 0.02


@pytest.mark.parametrize("deg", [(50.0, 50.0), (10.0, 10.0), (40.0,)])
def test_of_two_rests_that_the_swing_goes_about_wins_and_it_is_said(deg: tuple[float, ...]) -> None:
    t, phi = held(deg, 26.0, damping=STRONG, fps=125.0)
    found = filmed(t, phi, 5.0)
    np.testing.assert_array_less(off_deg(found, phi), 0.3)
    (note,) = (n for n in found.meta["notes"] if "camera" not in n)
    told = re.search(
        r"two rests disagree: held still about ([\d.]+)(?: and ([\d.]+))? deg from hanging in 0-1 s", note
    )
    assert told
    assert [float(v) for v in told.groups() if v] == pytest.approx([deg[0]] * (2 if told[2] else 1), abs=0.3)
    assert [r["hanging"] for r in found.meta["zero"]["rests"]] == [False] + [True] * (
        len(found.meta["zero"]["rests"]) - 1
    )


def test_a_rest_in_the_middle_is_the_zero() -> None:
    _, first = held((50.0, 50.0), 3.0, fps=500.0)
    _, second = rig.drop(3.0, 500.0, 3, rest_s=1.0)
    u = np.linspace(0, 1, 400)[:, None]
    caught = first[-1] * (1 - u**3 * (10 - 15 * u + 6 * u * u))
    phi = np.concatenate([first, caught, second])
    found = filmed(np.arange(phi.shape[0]) / 500, phi)
    np.testing.assert_array_less(off_deg(found, phi), 0.2)
    assert any("two rests disagree" in n for n in found.meta["notes"])


@pytest.mark.parametrize("seed", range(3))
def test_hanging_before_a_lift_and_a_fall_over_several_turns_is_the_zero(seed: int) -> None:
    t, phi = rig.drop(12.0, 500.0, seed, rest_s=1.0)
    assert np.ptp(phi[:, 1]) > 2 * np.pi
    found = filmed(t, phi, 5.0)
    np.testing.assert_array_less(off_deg(found, phi), 0.2)
    assert found.meta["zero"]["rests"][0]["verdict"] == "confirmed"
    assert found.meta["notes"] == []


def test_a_film_rolled_by_a_quarter_turn_has_its_zero_from_the_swing() -> None:
    t, phi = rig.drop(12.0, 500.0, 1, rest_s=1.0)
    found = filmed(t, phi, 90.0)
    np.testing.assert_array_less(off_deg(found, phi), 0.2)
    (note,) = found.meta["notes"]
    assert "the film is rolled" in note


@pytest.mark.parametrize("links", [1, 2])
def test_a_recording_that_only_hangs_is_believed_and_one_that_is_only_held_is_not(links: int) -> None:
    t = np.arange(500) / FPS
    still = np.zeros((t.size, links))
    found = angles(jointed(t, still, 5.0))
    np.testing.assert_array_less(off_deg(found, still), 0.2)
    # No surer than the camera's roll of 5 deg.
    assert (np.degrees(found.meta["zero"]["sigma_rad"]) > 4.0).all()
    with pytest.raises(AnglesError, match=r"held still at about (39|41 and 40) deg"):
        angles(jointed(t, still + np.radians(40.0)))


def jointed(t: Floats, phi: Floats, roll_deg: float = 0.0) -> Nodes:
    """The nodes of a film whose rig has the elbow too, the links pointing down in its reference picture."""
    roll = np.radians(roll_deg)
    nodes = rig.film(t, phi + roll, 41, reference_rad=(roll, roll))
    if phi.shape[1] == 1:
        return nodes
    (x, y), c, s = rig.ELBOW_PX, np.cos(roll), np.sin(roll)
    place = rig.PIVOT_PX + np.array([c * x + s * y, -s * x + c * y])
    elbow = Joint("elbow", ("upper", "lower"), float(place[0]), float(place[1]))
    return replace(nodes, rig=replace(nodes.rig, joints=(*nodes.rig.joints, elbow)))


@pytest.mark.parametrize(
    ("deg", "joints", "unknown"),
    [
        ((58.0, 58.0), 0, "upper and lower"),
        ((170.0, 170.0), 0, "upper and lower"),
        ((58.0,), 0, "upper"),
        ((55.0, 0.0), 0, "upper and lower"),
        ((0.0, 0.0), 0, "upper and lower"),
        ((0.0,), 0, "upper"),
        ((0.0, 58.0), 1, "lower"),
        ((0.0, 0.0), 1, "lower"),
    ],
)
def test_links_that_never_move_have_no_zero_without_their_joints(
    deg: tuple[float, ...], joints: int, unknown: str
) -> None:
    t = np.arange(500) / FPS
    phi = np.tile(np.radians(deg), (t.size, 1))
    nodes = jointed(t, phi)
    nodes = replace(nodes, rig=replace(nodes.rig, joints=nodes.rig.joints[:joints]))
    with pytest.raises(
        AnglesError, match=f"nothing says that they hang .* without the joint of {unknown}: it is no"
    ) as e:
        angles(nodes)
    assert "pivot=" in str(e.value)
    assert "zero='vertical'" in str(e.value)
    # What the advice names does it.
    lines = {"upper": "n0-n2", "lower": "n3-n8"}
    links = nodes.rig.bodies
    found = angles(nodes, zero="vertical", axis={name: lines[name] for name in links})
    # The line of two markers is up to atan(15 / 125) = 6.9 deg off the link's.
    np.testing.assert_array_less(off_deg(found, phi), 7.5)
    still = angles(nodes, zero=jointed(t, 0 * phi))
    np.testing.assert_array_less(off_deg(still, phi), 0.2)


@pytest.mark.parametrize(
    "deg", [(58.0, 58.0), (170.0, 170.0), (58.0,), (55.0, 0.0), (0.0, -20.0), (6.5, 7.5)]
)
def test_links_that_never_move_are_held_where_they_do_not_point_down(deg: tuple[float, ...]) -> None:
    t = np.arange(500) / FPS
    with pytest.raises(
        AnglesError, match=r"held still at about [\d.]+( and [\d.]+)? deg from the picture's vertical in"
    ):
        angles(jointed(t, np.tile(np.radians(deg), (t.size, 1))))


def test_a_pivot_pointed_at_says_whether_a_still_link_hangs() -> None:
    t = np.arange(500) / FPS
    for deg in (0.0, 58.0):
        nodes = jointed(t, np.full((t.size, 1), np.radians(deg)))
        nodes = replace(nodes, rig=replace(nodes.rig, joints=()))
        if deg:
            with pytest.raises(AnglesError, match=r"held still at about 5\d deg from the picture's vertical"):
                angles(nodes, pivot=tuple(rig.PIVOT_PX))
        else:
            found = angles(nodes, pivot=tuple(rig.PIVOT_PX))
            assert 0.9 < np.degrees(found.meta["zero"]["sigma_rad"][0]) < 3


@pytest.mark.parametrize(
    ("deg", "w", "throw_s"),
    [
        ((8.0, 8.0), (25.0, -10.0), 3.0),
        ((8.0, 8.0), (25.0, -10.0), 0.8),
        ((8.0, 8.0), (-25.0, 40.0), 3.0),
        ((-8.0, -8.0), (25.0, -10.0), 3.0),
        ((14.0, 14.0), (0.0, 0.0), 1.0),
        ((14.0, 14.0), (0.0, 0.0), 0.02),
        ((14.0, 14.0), (0.0, 0.0), 0.0),
    ],
)
def test_a_hold_that_no_swing_speaks_of_is_refused_by_the_picture(
    deg: tuple[float, ...], w: tuple[float, float], throw_s: float
) -> None:
    t, phi = thrown(deg, w, throw_s)
    if w == (0.0, 0.0) and throw_s > 0.5:
        phi[:] = np.radians(deg)
    with pytest.raises(AnglesError, match="deg from the picture's vertical") as refused:
        filmed(t, phi)
    # Of three seconds the swing tells it itself, if the motion is regular enough.
    seen = (
        "too little of a free swing is seen to say that the links hang there",
        "the swing goes about a direction",
    )
    assert any(said in str(refused.value) for said in (seen if throw_s == 3.0 else seen[:1]))
    assert "Give zero='vertical'" in str(refused.value)


@pytest.mark.parametrize("deg", [(4.0, 4.0), (-5.0, -5.0), (0.0, 0.0)])
@pytest.mark.parametrize("w", [(25.0, -10.0), (-25.0, 40.0)])
def test_a_zero_that_no_swing_confirms_is_as_uncertain_as_its_tilt(
    deg: tuple[float, ...], w: tuple[float, float]
) -> None:
    t, phi = thrown(deg, w, 0.8)
    found = filmed(t, phi)
    sigma = np.degrees(found.meta["zero"]["sigma_rad"])
    # The picture's vertical is off by 0.9 deg for the upper link, and is uncertain by the roll of 1 deg.
    np.testing.assert_array_less(np.hypot(np.abs(deg) - np.array([0.95, 0.1]), 1.0) - 0.1, sigma)
    np.testing.assert_array_less(off_deg(found, phi), 1.3 * sigma)
    (note,) = found.meta["notes"]
    assert "deg from the picture's vertical, but too little of a free swing is seen to confirm it" in note
    assert "the zero's uncertainty says so" in note


@pytest.mark.parametrize(
    ("deg", "swing_s", "damping"),
    [
        ((40.0,), 6.0, Damping(tau_c1=0.03)),
        ((60.0,), 6.0, Damping(tau_c1=0.02)),
        ((50.0,), 6.0, Damping(tau_c1=0.02)),
        ((40.0,), 6.0, Damping(tau_c1=0.08)),
        ((60.0, 60.0), 8.0, Damping(mu_v1=2e-4, tau_c1=2e-2, tau_c2=3e-3)),
    ],
)
def test_a_stop_by_dry_friction_is_no_surer_than_the_swing(
    deg: tuple[float, ...], swing_s: float, damping: Damping
) -> None:
    t, phi = held(deg, swing_s, damping=damping)
    try:
        found = filmed(t, phi)
    except AnglesError as refused:
        assert "the swing goes about a direction" in str(refused)  # noqa: PT017
        return
    np.testing.assert_array_less(off_deg(found, phi), 3 * np.degrees(found.meta["zero"]["sigma_rad"]))
    if len(deg) == 2:
        assert any("from the direction that the swing goes about" in n for n in found.meta["notes"])


@pytest.mark.parametrize("seed", range(3))
def test_a_clean_swing_keeps_its_zero_sure(seed: int) -> None:
    t, phi = rig.drop(12.0, 500.0, seed, rest_s=1.0)
    found = filmed(t, phi)
    # The links hang before the swing, whose own zero is uncertain by 0.2 to 1.4 deg.
    np.testing.assert_array_less(np.degrees(found.meta["zero"]["sigma_rad"]), 0.02)
    np.testing.assert_array_less(off_deg(found, phi), 0.02)


@pytest.mark.parametrize("seed", range(3))
def test_a_rest_held_beside_hanging_is_less_sure_for_it(seed: int) -> None:
    t, phi = rig.drop(3.0, 500.0, seed, rest_s=1.0)
    # The lower link is held 9 deg beside where it hangs, and goes there before the fall.
    phi[:, 1] += np.radians(9.0) * np.clip((1.0 - t) / 0.2, 0.0, 1.0)
    found = filmed(t, phi)
    np.testing.assert_array_less(off_deg(found, phi), 3 * np.degrees(found.meta["zero"]["sigma_rad"]))


@pytest.mark.parametrize("seed", range(100, 103))
@pytest.mark.parametrize("beside_deg", [0.0, 3.0, -4.0, 5.0])
def test_a_lone_rest_before_a_short_swing_is_no_surer_than_swing_and_picture(
    seed: int, beside_deg: float
) -> None:
    """The lower link held beside hanging, where four seconds of tumbling know its zero to 1.9 to 4 deg."""
    t, phi = rig.drop(4.0, 500.0, seed, rest_s=1.0)
    phi[:, 1] += np.radians(beside_deg) * np.clip((1.0 - t) / 0.2, 0.0, 1.0)
    found = filmed(t, phi)
    sigma = np.degrees(found.meta["zero"]["sigma_rad"])
    np.testing.assert_array_less(off_deg(found, phi), 3 * sigma)
    # The picture tells the vertical to 2 deg at best, a swing to 1.5 deg or worse is to be added: 1.2 deg.
    assert 1.2 < sigma[1] < 3.0 + 1.5 * abs(beside_deg)
    assert any(
        re.search(
            r"^the zero of .*lower is the rest in 0-[\d.]+ s alone, and the swing after it confirms", note
        )
        for note in found.meta["notes"]
    )


def test_a_lone_rest_is_doubted_link_by_link_and_a_rest_at_the_end_is_not() -> None:
    def rest(start_s: float) -> Rest:
        return Rest(0, 9, start_s, start_s + 1, np.zeros(2), np.full(2, 1e-4))

    def stated(kept: list[Rest], sigma_deg: tuple[float, float], off_deg: float, tilt_deg: float) -> Floats:
        swing = Swing(np.radians([-off_deg] * 2), np.radians(sigma_deg), np.ones(2), 0.9, False, 2.0)
        down = Down(
            np.radians([-tilt_deg] * 2), np.radians([0.0, np.sqrt(3.0)]), ("upper", "lower"), ("", "")
        )
        return np.degrees(lone_sigma(kept, np.zeros(2), np.full(2, 1e-4), swing, down))

    # Swing and picture are of 2 deg each, and their mean of 2 / sqrt(2) deg.
    assert stated([rest(0.0)], (0.4, 2.0), 0.0, 0.0) == pytest.approx([0.00573, 2**0.5], rel=1e-3)
    assert stated([rest(0.0)], (0.4, 2.0), 3.0, 1.0)[1] == pytest.approx(np.hypot(2.0, 2**0.5))
    # A film rolled by 30 deg says nothing.
    assert stated([rest(0.0)], (0.4, 2.0), 1.0, 30.0)[1] == pytest.approx(np.hypot(1.0, 2.0))
    assert stated([rest(0.0)], (0.4, 2.0), 1.0, np.nan)[1] == pytest.approx(np.hypot(1.0, 2.0))
    # The end of a decay, alone or beside the first rest.
    for kept in ([rest(9.0)], [rest(0.0), rest(9.0)]):
        assert stated(kept, (0.4, 2.0), 0.0, 0.0) == pytest.approx([0.00573, 0.00573], rel=1e-3)


def test_a_lift_by_hand_does_not_speak_against_the_rest() -> None:
    t, phi = rig.drop(0.1, 500.0, 5, rest_s=1.0)
    for links in (1, 2):
        found = filmed(t, phi[:, :links])
        np.testing.assert_array_less(off_deg(found, phi[:, :links]), 0.2)
        (note,) = found.meta["notes"]
        assert "too little of a free swing" in note


def test_the_pictures_vertical_with_the_cameras_roll() -> None:
    t, phi = held((50.0, 50.0), 3.0)
    for roll_deg, zero, stated in (
        (0.0, "vertical", 1.0),
        (2.0, "vertical=2", 2.0),
        (-0.5, "vertical=0.5", 0.5),
    ):
        found = filmed(t, phi, roll_deg, zero)
        sigma = np.degrees(found.meta["zero"]["sigma_rad"])
        off = np.degrees(np.median(found.phi_rad - phi, axis=0))
        # The upper link's line of joints is 0.9 deg off where it hangs; the lower one's markers scatter about its line.
        # The line through the joints is known to a thousandth of a degree.
        assert sigma[0] == pytest.approx(stated, abs=1e-4)
        assert sigma[1] == pytest.approx(np.hypot(stated, 1.72), abs=0.1)
        np.testing.assert_array_less(np.abs(off - [roll_deg + 0.9, roll_deg]), [0.1, 2 * 1.72])
        assert found.meta["zero"]["from"] == "the picture's vertical"


@pytest.mark.parametrize("deg", [20.0, 25.0, 40.0])
@pytest.mark.parametrize("kind", ["given", "recording"])
def test_a_zero_far_from_the_swings_is_told_whoever_gives_it(deg: float, kind: str) -> None:
    t, phi = held((50.0, 50.0), 3.0)
    hung = rig.film(np.arange(300) / FPS, np.full((300, 2), np.radians(deg)), 42)
    with pytest.warns(dp.RecordingWarning) as warned:
        found = filmed(t, phi, zero=hung if kind == "recording" else -np.radians([deg, deg]))
    (note,) = found.meta["notes"]
    assert re.search(r"the swing goes about a direction about [\d.]+ and [\d.]+ deg from the zero", note)
    (warning,) = warned
    assert str(warning.message) == f"nodes: {note}"
    assert warning.filename == __file__
    # The swing knows its zero to 0.5 deg or so, and the given angles are of a picture with a noise of 0.3 px.
    assert np.degrees(found.meta["zero"]["sigma_rad"]) == pytest.approx(deg, abs=1.5)
    np.testing.assert_array_less(off_deg(found, phi), 1.1 * np.degrees(found.meta["zero"]["sigma_rad"]))


def test_directions_of_the_picture_that_the_swing_contradicts_are_told() -> None:
    t, phi = held((50.0, 50.0), 3.0)
    with pytest.warns(dp.RecordingWarning, match=r"from the zero \(the picture's vertical\)"):
        found = filmed(t, phi, 20.0, "vertical")
    zero = found.meta["zero"]
    assert zero["contradicted"] in found.meta["notes"]
    # The film is rolled by 20 deg, and 1 deg is what a camera is taken to be.
    assert np.degrees(zero["sigma_rad"]) == pytest.approx(20, abs=2.5)
    # Turns from the reference picture are right wherever the links hang.
    found = angles(rig.film(t, phi, 41, reference_rad=(np.pi / 6, np.pi / 6)), zero="reference_frame")
    assert "the swing goes about a direction about" in found.meta["zero"]["contradicted"]
    assert "sigma_rad" not in found.meta["zero"]
    np.testing.assert_allclose(off_deg(found, phi), 30, atol=0.1)


def test_a_zero_where_the_links_hang_is_taken_without_a_word() -> None:
    t, phi = held((50.0, 50.0), 3.0)
    hung = rig.film(np.arange(300) / FPS, np.zeros((300, 2)), 42)
    assert filmed(t, phi, zero=(0.0, 0.0)).meta["notes"] == []
    found = filmed(t, phi, zero=hung)
    assert found.meta["notes"] == []
    assert (np.degrees(found.meta["zero"]["sigma_rad"]) < 0.1).all()


def test_zero_in_words() -> None:
    assert parse_zero("rest") == "rest"
    assert parse_zero("vertical=0.5") == "vertical=0.5"
    assert parse_zero("180,-90") == pytest.approx([np.pi, -np.pi / 2])
    assert parse_zero("hanging.parquet") is None
    assert roll_sigma("vertical") == pytest.approx(np.radians(1.0))
    assert roll_sigma("vertical=0.5") == pytest.approx(np.radians(0.5))
    for wrong in ("vertical=", "vertical=x", "vertical=0", "vertical=-1", "vertical=nan", "vertical=60"):
        with pytest.raises(AnglesError, match="number of degrees"):
            roll_sigma(wrong)
    t, phi = held((10.0,), 1.0)
    with pytest.raises(AnglesError, match="'upright' is not known"):
        filmed(t, phi, zero="upright")


@pytest.mark.parametrize("zero", [None, True, b"rest", {"a": 1}, object(), ["a"], [[1.0], [1.0, 2.0]], 1j])
def test_a_zero_of_no_kind_is_refused_with_the_choices(zero: Any) -> None:
    t, phi = held((10.0,), 1.0)
    with pytest.raises(AnglesError, match="is no zero") as refused:
        filmed(t, phi, zero=zero)
    assert "Give rest, vertical, reference_frame, one angle in rad per link, or the Nodes" in str(
        refused.value
    )


def test_angles_that_are_too_many_are_told_in_both_units() -> None:
    t, phi = held((10.0,), 1.0)
    with pytest.raises(
        AnglesError, match=r"2 angle\(s\) for 1 link\(s\): -2, 3 deg \(-0\.0349066, 0\.0523599 rad\)"
    ):
        filmed(t, phi, zero=parse_zero("-2,3"))
    for wrong in (np.nan, [np.inf], [], np.zeros((1, 1))):
        with pytest.raises(AnglesError, match="Give one finite angle per link"):
            filmed(t, phi, zero=wrong)
