"""Angles from node tables: estimators against truth and Cramer-Rao bound, bad markers, zero, turns."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from numpy.typing import NDArray
from pydpend.errors import AnglesError
from pydpend.kinematics import LinkAngles, angles, find_linkage, find_rest, pair_angles
from pydpend.kinematics.estimators import Method
from pydpend.kinematics.markers import body_markers

from tests.support import two_links as rig

Floats = NDArray[np.float64]


def tumbling(rows: int, seed: int, fps: float = 1000.0) -> tuple[Floats, Floats]:
    """Smooth angles over many turns, at rates up to about 20 and 50 rad/s."""
    rng = np.random.default_rng(seed)
    t = np.arange(rows) / fps
    a, b = rng.uniform(0.6, 1.4, 2)
    phi = np.stack(
        [
            8 * np.sin(a * t) + 1.2 * np.sin(7 * a * t + seed),
            30 * np.sin(0.9 * b * t) + 2.5 * np.sin(9 * b * t + seed),
        ],
        axis=1,
    )
    return t, phi


def bounds(phi: Floats, method: Method) -> Floats:
    """Cramer-Rao bounds (T, L) of the two estimators, written out here from the layout of the rig."""
    up, low, e = rig.UPPER_PX, rig.LOWER_PX, rig.ELBOW_PX
    if method == "rigid":
        arms = [((p - p.mean(axis=0)) ** 2).sum() for p in (up, low)]
        return np.broadcast_to(rig.SIGMA_PX / np.sqrt(arms), phi.shape)
    # With pivot and shape known: markers of the lower link move with both angles.
    i11 = (up**2).sum() + low.shape[0] * (e @ e)
    i22 = (low**2).sum()
    turn = phi[:, 1] - phi[:, 0]
    total = low.sum(axis=0)
    i12 = np.cos(turn) * (e @ total) - np.sin(turn) * (e[1] * total[0] - e[0] * total[1])
    determinant = i11 * i22 - i12**2
    return np.asarray(rig.SIGMA_PX * np.sqrt(np.stack([i22 / determinant, i11 / determinant], axis=1)))


@pytest.mark.parametrize("method", ["rigid", "linkage"])
@pytest.mark.parametrize("seed", [0, 1])
def test_errors_are_at_the_bound_and_as_stated(method: Method, seed: int) -> None:
    t, phi = tumbling(25_000, seed)
    found = angles(rig.film(t, phi, seed), method, zero="reference_frame")
    # The rig's places in its reference picture are rough by 0.3 px: that is a turn common to all frames.
    error = found.phi_rad - phi
    error -= error.mean(axis=0)
    bound = bounds(phi, method)
    # RMS over 25 000 frames scatters by 1 / sqrt(2 T) = 0.45 %; the issue allows 5 %.
    np.testing.assert_allclose(np.sqrt((error**2).mean(axis=0) / (bound**2).mean(axis=0)), 1.0, atol=0.05)
    # Standard deviation of error over stated sigma: 0.95-1.05.
    np.testing.assert_allclose((error / found.sigma_rad).std(axis=0), 1.0, atol=0.05)


@pytest.mark.parametrize("tick_s", [1e-3, 1 / 90_000])
@pytest.mark.parametrize("method", ["rigid", "linkage", "pairwise"])
def test_half_a_tick_of_the_times_is_in_the_uncertainty(method: Method, tick_s: float) -> None:
    # A variable rate of 70 to 130 per s: true instants, and the ticks to which the container rounds them.
    rng = np.random.default_rng(9)
    true_s = np.cumsum(rng.uniform(1 / 130, 1 / 70, 6000))
    t = np.round(true_s / tick_s) * tick_s

    def motion(at: Floats) -> Floats:
        return np.stack([3 * np.sin(4.1 * at), 4 * np.sin(5.3 * at + 1)], axis=1)

    nodes = rig.film(t, motion(true_s), 9)
    silent = angles(nodes, method, zero="reference_frame")
    time = {"kind": "variable", "sigma_s": tick_s / np.sqrt(12)}
    found = angles(dataclasses.replace(nodes, meta={"time": time}), method, zero="reference_frame")
    np.testing.assert_array_equal(found.phi_rad, silent.phi_rad)
    assert found.meta["time"] == time
    error = found.phi_rad - motion(t)
    pull = ((error - error.mean(axis=0)) / found.sigma_rad).std(axis=0)
    # 6000 frames: 0.9 % scatter of the standard deviation; the issue asks for 5 % elsewhere.
    np.testing.assert_allclose(pull, 1.0, atol=0.05)
    if tick_s == 1e-3 and method != "pairwise":
        assert ((error - error.mean(axis=0)) / silent.sigma_rad).std(axis=0).min() > 3


def test_linkage_gains_what_the_levers_promise() -> None:
    t, phi = tumbling(3000, 3)
    gain = bounds(phi, "rigid") / bounds(phi, "linkage")
    nodes = rig.film(t, phi, 3)
    one = angles(nodes, "rigid", zero="reference_frame").sigma_rad
    two = angles(nodes, "linkage", zero="reference_frame").sigma_rad
    # The stated gain is the bound's, up to the residuals' scale (3000 frames: 1 %).
    np.testing.assert_allclose(one / two, gain, rtol=0.03)
    assert np.median(gain[:, 0]) > 2.8
    assert np.median(gain[:, 1]) > 1.2


@pytest.mark.parametrize("stated", [0.4, 2.5])
@pytest.mark.parametrize("method", ["rigid", "linkage", "pairwise"])
def test_residuals_put_wrong_stated_sigmas_right(method: Method, stated: float) -> None:
    t, phi = tumbling(4000, 4)
    found = angles(rig.film(t, phi, 4, stated=stated), method, zero="reference_frame")
    error = found.phi_rad - phi
    # 4000 frames: 1.1 % scatter of the standard deviation.
    np.testing.assert_allclose(((error - error.mean(axis=0)) / found.sigma_rad).std(axis=0), 1.0, atol=0.05)
    assert found.meta["bodies"][0]["sigma_scale"] == pytest.approx(1 / stated, rel=0.05)


@pytest.mark.parametrize("method", ["rigid", "linkage"])
def test_markers_of_no_weight_say_nothing_about_the_others(method: Method) -> None:
    # Half hidden markers are stated at 1.3 px though most are right to 0.05: they hardly move an angle, and their small
    # residuals must not make the others look better than they are. Centres of moving markers err more along their way.
    t, phi = tumbling(6000, 21)
    rng = np.random.default_rng(21)
    unsure = np.zeros((t.size, 9), dtype=bool)
    unsure[rng.random(t.size) < 0.3, 4:6] = True
    nodes = rig.film(t, phi, 21)
    way = np.gradient(rig.places(phi), axis=0)
    way /= np.hypot(way[..., 0], way[..., 1])[..., None]
    along = 0.04 * rng.standard_normal((t.size, 9))
    nodes = dataclasses.replace(
        nodes,
        xy_px=nodes.xy_px + along[..., None] * way,
        sigma_px=np.where(unsure, 1.3, nodes.sigma_px).astype(np.float32),
    )
    found = angles(nodes, method, zero="reference_frame")
    error = found.phi_rad - phi
    pull = ((error - error.mean(axis=0)) / found.sigma_rad).std(axis=0)
    # 6000 frames: 0.9 % scatter of the standard deviation, as much again of the scale; the issue asks for 5 %.
    np.testing.assert_allclose(pull, 1.0, atol=0.05)


@pytest.mark.parametrize("method", ["rigid", "linkage"])
def test_markers_covered_at_their_edge_are_found_out_over_the_recording(method: Method) -> None:
    # Beside two hidden markers a third is off by 0.3 px, and its sigma says 0.075: too little to be left out by the
    # frame, with three others to judge by; in all such frames together it shows.
    t, phi = tumbling(6000, 22)
    rng = np.random.default_rng(22)
    hidden, moved = np.zeros((t.size, 9), dtype=bool), np.zeros((t.size, 9, 2))
    crossed = (np.arange(t.size) // 40) % 5 == 0
    hidden[crossed, 4:6] = True
    moved[crossed, 3] = 0.3 * rng.standard_normal((crossed.sum(), 2))
    nodes = rig.film(t, phi, 22, hidden=hidden, moved_px=moved)
    nodes.sigma_px[crossed, 3] = 0.075
    found = angles(nodes, method, zero="reference_frame")
    error = found.phi_rad - phi
    pull = ((error - error.mean(axis=0)) / found.sigma_rad)[crossed].std(axis=0)
    # 1200 frames: 2 % scatter; without the doubt it is 1.7 for phi2 (rigid).
    np.testing.assert_allclose(pull, 1.0, atol=0.1)


def test_pivot_and_link_length_of_ten_seconds() -> None:
    t, phi = tumbling(10_000, 5)
    found = find_linkage(rig.film(t, phi, 5))
    np.testing.assert_allclose(found.shape.pivot_px * [1, -1], rig.PIVOT_PX, atol=0.02)
    assert found.length_px == pytest.approx(float(np.hypot(*rig.ELBOW_PX)), rel=1e-4)
    scale, sigma = found.metres_per_px(0.19, 1e-5)
    assert scale == pytest.approx(0.19 / np.hypot(*rig.ELBOW_PX), rel=1e-4)
    assert sigma == pytest.approx(scale * np.hypot(1e-5 / 0.19, found.length_sigma_px / found.length_px))


def test_uncertainties_of_the_shape_are_what_repeats_scatter_by() -> None:
    t, phi = tumbling(400, 6)
    pulls = []
    for seed in range(60):
        found = find_linkage(rig.film(t, phi, seed))
        pivot = (found.shape.pivot_px * [1, -1] - rig.PIVOT_PX) / found.pivot_sigma_px
        pulls.append([*pivot, (found.length_px - np.hypot(*rig.ELBOW_PX)) / found.length_sigma_px])
    # chi2 of 60 repeats: the standard deviation is 1 within 3 / sqrt(120) = 0.27.
    np.testing.assert_allclose(np.std(pulls, axis=0), 1.0, atol=0.27)
    np.testing.assert_allclose(np.mean(pulls, axis=0), 0.0, atol=4 / np.sqrt(60))


@pytest.mark.parametrize("method", ["rigid", "linkage"])
def test_one_bad_marker_is_left_out(method: Method) -> None:
    t, phi = tumbling(3000, 7)
    rng = np.random.default_rng(7)
    moved = np.zeros((t.size, 9, 2))
    bad = rng.random(t.size) < 0.05
    which = rng.integers(3, 9, t.size)
    moved[bad, which[bad]] = rng.uniform(1.0, 40.0, (bad.sum(), 1)) * np.array([0.6, -0.8])
    found = angles(rig.film(t, phi, 7, moved_px=moved), method, zero="reference_frame")
    error = (found.phi_rad - phi)[:, 1]
    error -= np.median(error)
    assert np.isfinite(error).all()
    # A marker of six left out: the error grows, but no angle is off by more than five of its sigmas.
    assert np.abs(error / found.sigma_rad[:, 1]).max() < 5.0
    if method == "rigid":
        assert sum(found.meta["bodies"][1]["markers_left_out"].values()) >= bad.sum()


def test_a_bad_one_of_three_is_left_out_or_the_frame_is() -> None:
    t, phi = tumbling(3000, 8)
    moved = np.zeros((t.size, 9, 2))
    rng = np.random.default_rng(8)
    bad = rng.random(t.size) < 0.1
    turn = rng.uniform(0, 2 * np.pi, bad.sum())
    moved[bad, rng.integers(0, 3, bad.sum())] = 3.0 * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    found = angles(rig.film(t, phi, 8, moved_px=moved), zero="reference_frame")
    error = (found.phi_rad - phi)[:, 0]
    pull = (error - np.nanmedian(error)) / found.sigma_rad[:, 0]
    assert np.nanmax(np.abs(pull)) < 5.5
    assert np.isnan(error).sum() == found.meta["bodies"][0]["doubtful_frames"] < 0.5 * bad.sum()


def test_linkage_sees_through_what_hides_all_but_one_marker() -> None:
    t, phi = tumbling(2000, 9)
    hidden = np.zeros((t.size, 9), dtype=bool)
    hidden[500:600, [0, 1, 4, 5, 6, 7, 8]] = True
    hidden[700:720, :3] = True
    nodes = rig.film(t, phi, 9, hidden=hidden)
    alone = angles(nodes, "rigid", zero="reference_frame", gaps="stop")
    linked = angles(nodes, "linkage", zero="reference_frame")
    assert np.isnan(alone.phi_rad[500:600]).all()
    assert alone.meta["notes"]
    error = linked.phi_rad - phi
    error -= np.median(error, axis=0)
    assert np.abs(error / linked.sigma_rad).max() < 5.5


def test_pairwise_mean_is_right_in_all_orientations_where_the_plain_mean_is_not() -> None:
    rng = np.random.default_rng(10)
    phi = np.concatenate([np.zeros((1, 2)), rng.uniform(-np.pi, np.pi, (2000, 2))])
    nodes = rig.film(np.arange(2001) / 1000.0, phi, 10, sigma_px=0.01)
    for k, body in enumerate(body_markers(nodes)):
        pairs = pair_angles(body)
        turn = np.angle(np.exp(1j * (phi[:, k] - phi[0, k])))
        wrong = np.abs(np.angle(np.exp(1j * (pairs.mean_rad - turn)))) > np.radians(1)
        assert not wrong.any()
        values = []
        n = body.xy_px.shape[1]
        for i in range(n):
            for j in range(i + 1, n):
                v = body.xy_px[:, j] - body.xy_px[:, i]
                direction = np.arctan2(v[:, 1], v[:, 0])
                values.append(direction - direction[0])
        plain = np.abs(np.angle(np.exp(1j * (np.mean(values, axis=0) - turn)))) > np.radians(5)
        # ERRATA 26 has 28 % with three markers and 40 % with six; the slimmer the layout the fewer.
        assert plain.mean() > 0.02


def test_sign_is_counter_clockwise_and_mirrored_turns_it() -> None:
    t = np.arange(500) / 500.0
    phi = np.stack([0.8 * t, -0.5 * t], axis=1)
    nodes = rig.film(t, phi, 11)
    # Counter-clockwise from hanging: the upper link's lowest marker goes right and up (image y falls).
    assert nodes.xy_px[-1, 2, 0] > nodes.xy_px[0, 2, 0] + 50
    assert nodes.xy_px[-1, 2, 1] < nodes.xy_px[0, 2, 1] - 20
    found = angles(nodes, zero="reference_frame")
    np.testing.assert_allclose(found.phi_rad, phi, atol=0.01)
    np.testing.assert_allclose(angles(nodes, zero="reference_frame", mirrored=True).phi_rad, -phi, atol=0.01)


def test_zero_from_rest_at_the_start_and_not_from_the_hold_upside_down() -> None:
    t, phi = rig.drop(1.0, 500, 12, rest_s=1.0)
    up = phi[t <= 2.5][-1]
    held = np.repeat(up[None], 600, axis=0)
    at = np.flatnonzero(t > 2.5)[0]
    phi = np.concatenate([phi[:at], held, phi[at:]])
    t = np.arange(phi.shape[0]) / 500
    nodes = rig.film(t, phi, 12, reference_rad=(2.0, -1.0))
    found = angles(nodes)
    rests = found.meta["zero"]["rests"]
    assert [r["hanging"] for r in rests] == [True, False]
    # 500 frames at rest: the zero is known to sigma / sqrt(500), far below one angle's error.
    error = (found.phi_rad - phi).mean(axis=0)
    np.testing.assert_array_less(np.abs(error), 5 * np.array(found.meta["zero"]["sigma_rad"]))


def test_zero_from_rest_at_the_end_only() -> None:
    t, phi = rig.drop(1.0, 500, 15, rest_s=1.0)
    # Backwards in time: it moves first and is let down to hang at last.
    phi = phi[::-1].copy()
    nodes = rig.film(t, phi, 15, reference_rad=(2.0, -1.0))
    found = angles(nodes)
    (rest,) = found.meta["zero"]["rests"]
    assert rest["hanging"]
    # Whole turns common to a recording are a choice of its first frame.
    turns = 2 * np.pi * np.rint((found.phi_rad - phi)[0] / (2 * np.pi))
    error = (found.phi_rad - turns - phi).mean(axis=0)
    np.testing.assert_array_less(np.abs(error), 5 * np.array(found.meta["zero"]["sigma_rad"]))


def test_zero_given_and_from_a_reference_recording() -> None:
    t, phi = tumbling(1500, 13)
    nodes = rig.film(t, phi, 13, reference_rad=(0.4, -0.7))
    with pytest.raises(AnglesError, match="no stretch"):
        angles(nodes)
    given = angles(nodes, zero=(0.4, -0.7))
    turns = 2 * np.pi * np.rint((phi - given.phi_rad)[0] / (2 * np.pi))
    # The rig's places are rough by 0.3 px over arms of 60-100 px: a common turn of some mrad.
    np.testing.assert_allclose(given.phi_rad + turns, phi, atol=0.02)
    hanging = rig.film(np.arange(600) / 1000, np.zeros((600, 2)), 14)
    methods: tuple[Method, ...] = ("rigid", "linkage")
    for method in methods:
        found = angles(nodes, method, zero=hanging)
        assert np.abs((found.phi_rad + turns - phi).mean(axis=0)).max() < 2e-4
    with pytest.raises(AnglesError, match="one finite angle"):
        angles(nodes, zero=(1.0,))


def test_a_rest_is_no_better_known_than_its_frames_differ() -> None:
    # Compressed film repeats a still picture, so its error does not average out: slowly changing, or always the same.
    rng = np.random.default_rng(18)
    t = np.arange(1000) / 500
    sigma = np.full((t.size, 1), 1e-4)
    for phi, least, most in (
        (1e-4 * rng.standard_normal(t.size), 2e-6, 5e-6),
        (1e-4 * np.repeat(rng.standard_normal(20), 50), 1e-5, 6e-5),
        (np.full(t.size, 1e-4) + 1e-6 * rng.standard_normal(t.size), 1e-4, 1e-4),
    ):
        (rest,) = find_rest(LinkAngles(t, phi[:, None], sigma))
        # White: 1e-4 / sqrt(1000) = 3.2e-6. Twenty pictures: 1e-4 / sqrt(20) = 2.2e-5. One picture: its own sigma.
        assert least <= rest.sigma_rad[0] <= most


def test_rest_that_swings_is_no_rest() -> None:
    t = np.arange(5000) / 500
    slow = np.radians(1.0) * np.sin(2 * np.pi * 1.1 * t)
    still = np.where(t > 7, 0.0, slow)
    sigma = np.full((t.size, 1), 1e-4)
    assert find_rest(LinkAngles(t, slow[:, None], sigma)) == []
    (rest,) = find_rest(LinkAngles(t, still[:, None], sigma))
    assert 6.9 < rest.start_s < 7.2
    assert rest.stop_s > 9.9


def test_a_hundred_tumbling_runs_with_occlusions_lose_no_turn() -> None:
    wrong = refused = gaps = 0
    for seed in range(100):
        t, phi = tumbling(1500, seed, 500.0)
        rng = np.random.default_rng(seed)
        hidden = np.zeros((t.size, 9), dtype=bool)
        for _ in range(12):
            start, length = rng.integers(30, t.size - 60), rng.integers(1, 30)
            nodes = slice(0, 3) if rng.random() < 0.4 else slice(3, 9)
            hidden[start : start + length, nodes] = True
            gaps += 1
        hidden[:20] = False
        found = angles(rig.film(t, phi, seed, hidden=hidden), zero=(0.0, 0.0), gaps="stop")
        refused += len(found.meta["notes"])
        error = found.phi_rad - phi
        error -= 2 * np.pi * np.rint(error[0] / (2 * np.pi))
        wrong += int(np.nanmax(np.abs(error)) > 0.1)
    assert wrong == 0
    # Gaps up to 60 ms at up to 50 rad/s: most can be counted, so that refusing is not the way to be right.
    assert refused < 0.3 * 200


def test_a_gap_that_may_lose_a_turn_is_an_error_and_a_shorter_one_is_counted() -> None:
    t = np.arange(2000) / 1000
    w = 20.0
    phi = np.stack([w * t, -w * t], axis=1)
    limit = np.pi / w
    for length, refused in ((int(limit * 1000) - 4, False), (int(limit * 1000) + 4, True)):
        hidden = np.zeros((t.size, 9), dtype=bool)
        hidden[1000 : 1000 + length, 3:] = True
        nodes = rig.film(t, phi, 15, hidden=hidden)
        if refused:
            with pytest.raises(
                AnglesError, match=r"frames 1000 to 11\d\d, body lower: not seen .* turn may be lost"
            ):
                angles(nodes, zero=(0.0, 0.0))
            cut = angles(nodes, zero=(0.0, 0.0), gaps="stop")
            assert np.isnan(cut.phi_rad[1000:, 1]).all()
            assert np.isfinite(cut.phi_rad[:, 0]).all()
        else:
            found = angles(nodes, zero=(0.0, 0.0)).phi_rad
            assert np.isfinite(found[~hidden[:, [0, 3]]]).all()
            assert np.nanmax(np.abs(found - phi)) < 0.02


def test_one_link_and_bad_tables() -> None:
    t, phi = tumbling(500, 16)
    single = angles(rig.film(t, phi[:, :1], 16), "linkage", zero=0.0)
    assert single.links == 1
    error = single.phi_rad - phi[:, :1]
    assert np.abs(error - error.mean()).max() < 5.5 * single.sigma_rad.max()
    nodes = rig.film(t, phi, 16)
    never = dataclasses.replace(
        nodes, status=np.where(np.arange(9) < 3, 1, 0)[None].repeat(500, 0).astype(np.uint8)
    )
    with pytest.raises(AnglesError, match="no node of the body lower is ever seen"):
        angles(never, zero="reference_frame")
    only = dataclasses.replace(
        nodes, status=np.where(np.arange(9) < 4, 1, 0)[None].repeat(500, 0).astype(np.uint8)
    )
    with pytest.raises(AnglesError, match="never shows two"):
        angles(only, zero="reference_frame")
    sigma = nodes.sigma_px.copy()
    sigma[3, 2] = 0
    with pytest.raises(AnglesError, match=r"frame 3, node n2.*sigma_px"):
        angles(dataclasses.replace(nodes, sigma_px=sigma), zero="reference_frame")
    still = rig.film(t, np.zeros((500, 2)), 17)
    with pytest.raises(AnglesError, match="turn too little"):
        angles(still, "linkage")
    np.testing.assert_allclose(angles(still, zero=still).phi_rad, 0.0, atol=0.005)
    with pytest.raises(AnglesError, match="no body 'middle'"):
        angles(nodes, bodies=("upper", "middle"))
    with pytest.raises(AnglesError, match="not known"):
        angles(nodes, "best")  # type: ignore[arg-type]


def test_single_frames_between_short_gaps_lose_no_turn() -> None:
    # Seen in one frame of three for a while, as when the links cross: no run is long enough for a rate of its own.
    from pydpend.kinematics.unwrap import unwrap

    t, phi = tumbling(3000, 5)
    truth = phi[:, 1]
    seen = np.ones(t.size, dtype=bool)
    seen[1000:1060] = np.arange(60) % 3 == 0
    wrapped = np.where(seen, np.angle(np.exp(1j * truth)), np.nan)
    found, lost = unwrap(t, wrapped)
    assert lost == []
    error = (found - truth)[seen]
    assert np.abs(error - error[0]).max() < 1e-9
