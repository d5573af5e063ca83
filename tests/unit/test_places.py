"""Places in metres: scales by known distances, averaged and compared, origins, and uncertainties."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pydpend as dp
import pytest
from pydpend.errors import AnglesError
from pydpend.kinematics.metres import last_digit

from tests.support import linkages

MM_PER_PX = 1.25
"""Scale of the made mechanism."""


def metres(px: float) -> float:
    return px * MM_PER_PX / 1000


def test_markers_and_joints_in_metres_from_the_first_pivot() -> None:
    made = linkages.four_bar(401)
    found = dp.places(made.nodes(401), scale={"A-D": (metres(210), 1e-6)})
    assert found.unit == "m"
    assert found.meta["origin"] == {"point": "A"}
    scale = found.meta["scale"]
    assert scale["m_per_px"] == pytest.approx(MM_PER_PX / 1000, abs=4 * scale["sigma_m_per_px"])
    origin = made.joints[0][2]
    truth = {f"n{i}": p for i, p in enumerate(np.concatenate(made.places_px, axis=1).swapaxes(0, 1))}
    truth |= {name: p for name, _, p in made.joints}
    assert set(found.names) == set(truth)
    for k, name in enumerate(found.names):
        error = found.xy[:, k] - metres(1) * (truth[name] - origin) * [1, -1]
        pull = np.sqrt(np.mean((error / found.sigma[:, k, None]) ** 2))
        # A joint's sigma is the greater of its coordinates', and most of it one error of all frames.
        assert (0.9 < pull < 1.1) if name.startswith("n") else pull < 2.5, name
        assert np.abs(error).max() < metres(0.4)
    columns = found.to_columns()
    assert {"x_n0_m", "y_B_m", "sigma_C_m"} <= set(columns)


def test_without_a_scale_places_are_px_and_the_origin_is_what_is_said() -> None:
    made = linkages.chain(402, 300)
    nodes = made.nodes(402)
    found = dp.places(nodes, ["n1", "n7"], origin=(100.0, 50.0))
    assert found.unit == "px"
    np.testing.assert_allclose(found.xy[:, 0], (nodes.xy_px[:, 1] - [100, 50]) * [1, -1], atol=1e-9)
    assert list(found.to_columns()) == [
        "frame",
        "time_s",
        "x_n1_px",
        "y_n1_px",
        "sigma_n1_px",
        "x_n7_px",
        "y_n7_px",
        "sigma_n7_px",
    ]


def test_two_scales_that_disagree_are_named_with_both_values() -> None:
    made = linkages.four_bar(403, 600)
    nodes = made.nodes(403)
    good = {"A-D": (metres(210), 2e-5), "n0-n1": (metres(np.hypot(43, 19)), 2e-5)}
    found = dp.places(nodes, scale=good)
    assert not [n for n in found.meta["notes"] if "disagree" in n]
    assert found.meta["scale"]["m_per_px"] == pytest.approx(MM_PER_PX / 1000, rel=5e-4)
    bad = good | {"B-C": (metres(203), 2e-5)}
    found = dp.places(nodes, scale=bad)
    (note,) = [n for n in found.meta["notes"] if "A-D gives" in n and "B-C gives" in n]
    assert re.search(r"A-D gives 1\.2(49|50)\d* \+- .* and B-C gives 1\.268\d* \+- ", note)
    sure = min(s["sigma"] for s in found.meta["scale"]["from"])
    assert found.meta["scale"]["sigma_m_per_px"] > sure


def test_a_distance_between_places_in_the_picture() -> None:
    made = linkages.chain(404, 300)
    found = dp.places(made.nodes(404), scale={"100,20-500,20": 0.5})
    assert found.meta["scale"]["m_per_px"] == pytest.approx(0.5 / 400)
    # Two places pointed at to 1 px each, and a length to 0.1 / sqrt(12) m.
    relative = np.hypot(np.sqrt(2) / 400, 0.1 / np.sqrt(12) / 0.5)
    assert found.meta["scale"]["sigma_m_per_px"] == pytest.approx(0.5 / 400 * relative, rel=0.01)


@pytest.mark.parametrize(
    ("keywords", "message"),
    [
        ({"scale": {"n0-n4": 0.1}}, "n0-n4: their distance goes from .* Name two points of one link"),
        ({"scale": {"n0-nine": 0.1}}, "'n0-nine' names no two points"),
        ({"scale": {"n0-n1": -0.1}}, "is no length"),
        ({"scale": {"n0-n1": (0.1, 0.1, 0.1)}}, "is no length"),
        ({"points": ["n0", "n99"]}, "there is no point 'n99'"),
        ({"origin": "n1"}, "n1 moves by"),
        ({"origin": "hook"}, "there is no point 'hook'"),
        ({"origin": (1.0, 2.0, 3.0)}, "is no place"),
    ],
)
def test_what_is_no_scale_or_origin(keywords: dict[str, Any], message: str) -> None:
    with pytest.raises(AnglesError, match=message):
        dp.places(linkages.chain(405, 300).nodes(405), **keywords)


def test_the_last_digit() -> None:
    assert [last_digit(t) for t in ("0.1719", "0.170", "12", "1.2e-4", "5e3")] == pytest.approx(
        [1e-4, 1e-3, 1, 1e-5, 1e3]
    )
