"""Constants, their files and their refusals."""

from __future__ import annotations

import inspect
import re
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from pydpend.coefficients import FREE, FULL, JOINT_OF, LAW_OF, PAPER, RATIO_UNITS, WORDS
from pydpend.errors import ModelError
from pydpend.model import (
    CONSTANTS,
    FORCES,
    LAW_TABLE,
    Damping,
    Model,
    ModelWarning,
    derived,
    published,
    read_model,
)

# Errata section 0, g mm2 and g mm2/s2, and the rounding they are printed with.
EXPECTED = {
    "psi_kg_m2": (3.431e6, 3.7e4, 1e3, 1e3),
    "lambda_kg_m2": (4.193e5, 6.6e3, 1e2, 1e2),
    "zeta_kg_m2": (18.6, 9.2, 0.1, 0.1),
    "sigma_j": (4.502e8, 5.0e6, 1e5, 1e5),
    "kappa_j": (8.136e7, 1.5e6, 1e4, 1e5),
    "a3_kg_m2": (1.426e6, 2.6e4, 1e3, 1e3),
}


@pytest.mark.parametrize("name", EXPECTED)
def test_derived_constants_are_those_of_the_errata(name: str) -> None:
    value, sigma, digit, sigma_digit = EXPECTED[name]
    model = derived("A")
    assert abs(getattr(model, name) * 1e9 - value) <= digit / 2
    assert abs(model.sigmas()[name] * 1e9 - sigma) <= sigma_digit / 2


def test_masses_carried_by_the_joints() -> None:
    model = derived("A")
    assert model.m1_kg == pytest.approx(0.3057, abs=1e-12)
    assert model.m2_kg == pytest.approx(0.1225, abs=1e-12)


def test_trackers_and_tape_at_their_assumed_places() -> None:
    model = derived("A", trackers=True)
    for name, value, digit in (
        ("psi_kg_m2", 3.473e6, 1e3),
        ("lambda_kg_m2", 4.288e5, 1e2),
        ("sigma_j", 4.554e8, 1e5),
        ("kappa_j", 8.305e7, 1e4),
        ("a3_kg_m2", 1.455e6, 1e3),
    ):
        assert abs(getattr(model, name) * 1e9 - value) <= digit / 2


def test_published_constants_warn_of_what_is_wrong() -> None:
    with pytest.warns(ModelWarning) as said:
        model = published()
    text = "\n".join(str(w.message) for w in said)
    assert "lambda breaks the parallel-axis bound" in text
    assert "psi_kg_m2 of Table 7 is +59 %" in text
    assert "sigma_j of Table 7 is +51 %" in text
    assert model.psi_kg_m2 == pytest.approx(5.47e-3)
    assert derived("A").problems() == []


def test_configuration_b_needs_values() -> None:
    with pytest.raises(ModelError, match=r"m_1 \(upper arm mass\).*no value"):
        derived("B")


def test_a_negative_mass_names_the_part() -> None:
    with pytest.raises(ModelError, match=r"part 9 \(lower arm\).*m_9 is -1"):
        derived("A", given={"m_9": -1.0})


PARTS = """
name = "two bars"
g_m_s2 = 9.8086
l1_m = 0.17272
[[part]]
name = "upper"
body = 1
mass_kg = 0.09384
inertia_kg_m2 = 4.375e-4
place_m = [0.10857, 0.0002]
[[part]]
name = "lower"
body = 2
mass_kg = [0.13760, 0.001]
inertia_kg_m2 = 1.2688e-3
place_m = 0.11678
"""


def test_two_bars_from_a_file_of_parts(tmp_path: Path) -> None:
    path = tmp_path / "bars.toml"
    path.write_text(PARTS)
    model = read_model(path)
    # The textbook double pendulum, by hand.
    assert 2 * model.psi_kg_m2 == pytest.approx(
        4.375e-4 + 0.09384 * 0.10857**2 + 0.1376 * 0.17272**2, rel=1e-12
    )
    assert 2 * model.lambda_kg_m2 == pytest.approx(1.2688e-3 + 0.1376 * 0.11678**2, rel=1e-12)
    assert model.a3_kg_m2 == pytest.approx(0.1376 * 0.17272 * 0.11678, rel=1e-12)
    assert model.sigma_j == pytest.approx(9.8086 * (0.09384 * 0.10857 + 0.1376 * 0.17272), rel=1e-12)
    assert model.kappa_j == pytest.approx(9.8086 * 0.1376 * 0.11678, rel=1e-12)
    assert model.sigmas()["kappa_j"] == pytest.approx(9.8086 * 0.001 * 0.11678, rel=1e-9)
    half = np.sqrt(3 * 1.2688e-3 / 0.1376)
    assert model.lower_outer_m == pytest.approx(0.11678 + half, rel=1e-12)


def test_constants_from_a_file(tmp_path: Path) -> None:
    right = derived("A")
    lines = [f"{name} = {getattr(right, name)!r}" for name in CONSTANTS]
    path = tmp_path / "c.toml"
    path.write_text("g_m_s2 = 9.81\n[constants]\n" + "\n".join(lines))
    model = read_model(path)
    assert np.array_equal(model.constants(), right.constants())


def test_table_8_as_a_file_of_parts_gives_the_same_constants() -> None:
    """The example of docs/reference/model.md is configuration A: same numbers through the user's own way."""
    model = read_model(Path(__file__).parents[2] / "docs" / "reference" / "model-a.toml")
    right = derived("A")
    np.testing.assert_allclose(model.constants(), right.constants(), rtol=1e-12)
    # The file's numbers are independent where Table 8's identical parts are fully correlated, but the upper
    # bearings' balls are 16 g mm2 of psi's 3.4e6.
    assert model.covariance is not None
    assert right.covariance is not None
    np.testing.assert_allclose(np.diag(model.covariance), np.diag(right.covariance), rtol=1e-3)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("place_m = 0.11678", "at = 'elbow'"), r"part 2 \(lower\): at is 'elbow'"),
        (("body = 1", "body = 3"), r"part 1 \(upper\): body is 3"),
        (("mass_kg = 0.09384", "mass_kg = -0.1"), r"part 1 \(upper\): mass is negative"),
        (("mass_kg = 0.09384", "mass_lb = 0.1"), "unknown key 'mass_lb'"),
        (("mass_kg = 0.09384", ""), r"part 1 \(upper\): no mass"),
        (("l1_m = 0.17272", ""), "no l1"),
        (("place_m = 0.11678", "place_m = nan"), "place_m is nan"),
        (("place_m = 0.11678", "place_m = 0.11678\nacross_mm = 30"), "do not balance across"),
        (("g_m_s2 = 9.8086", "g_m_s2 = -9.8"), "g_m_s2 is -9.8"),
    ],
)
def test_a_bad_file_says_where(tmp_path: Path, change: tuple[str, str], message: str) -> None:
    path = tmp_path / "bad.toml"
    path.write_text(PARTS.replace(*change))
    with pytest.raises(ModelError, match=message) as error:
        read_model(path)
    assert str(path) in str(error.value)


def test_impossible_constants_are_refused() -> None:
    right = {n: getattr(derived("A"), n) for n in CONSTANTS}
    with pytest.raises(ModelError, match="not positive definite"):
        Model(**(right | {"a3_kg_m2": 3e-3}))
    with pytest.raises(ModelError, match="sigma_j is nan"):
        Model(**(right | {"sigma_j": float("nan")}))
    with pytest.raises(ModelError, match="parallel-axis"):
        Model(**(right | {"lambda_kg_m2": 2e-4, "a3_kg_m2": 1e-3})).checked()
    with pytest.raises(ModelError, match="tau_c1 is -1"):
        Damping(tau_c1=-1.0)


def test_energy_of_the_drop_is_that_of_the_errata() -> None:
    model = derived("A")
    energy = float(model.energy([np.pi, np.pi], [0.0, 0.0]))
    # Errata: 2 (sigma + kappa) = 1.063 J.
    assert energy == pytest.approx(1.063, abs=5e-4)
    w = np.array([1.5, -2.5])
    phi = np.array([0.4, -1.1])
    assert float(model.kinetic(phi, w)) == pytest.approx(float(w @ model.mass_matrix(phi) @ w / 2), rel=1e-14)


def test_damping_has_the_coefficients_of_the_compiled_table_with_their_units() -> None:
    assert [f.name for f in fields(Damping)] == list(LAW_TABLE)
    said = dict(
        re.findall(r"^    (\w[\w, ]*) : float\n((?:        .*\n)+)", inspect.getsource(Damping), re.MULTILINE)
    )
    words = {name: text for names, text in said.items() for name in names.split(", ")}
    for name, law in LAW_TABLE.items():
        assert f", {law.unit}" in words[name], name
        assert law.words
        assert law.source


def test_lists_of_coefficients_are_those_of_the_compiled_table() -> None:
    assert PAPER == ("mu_v1", "mu_v2", "mu_q1", "mu_q2", "rmu1", "rmu2")
    assert (*PAPER, "tau_c1", "tau_c2", "strip_drag") == FULL
    assert (*FULL, "offset1", "offset2") == FORCES
    assert set(FREE) | set(FULL) == set(LAW_TABLE)
    assert [LAW_OF[n] for n in FULL] == [*("viscous",) * 2, *("drag",) * 2, *("dry",) * 4, "drag"]
    assert [n for n in FULL if JOINT_OF[n] == "upper"] == ["mu_v1", "mu_q1", "rmu1", "tau_c1"]
    assert RATIO_UNITS == {"lambda": "1", "sigma": "1/s2", "kappa": "1/s2", "a3": "1"}
    assert all(WORDS[n] for n in (*LAW_TABLE, *RATIO_UNITS))
