"""One class of options for every way to a damping fit: checked, frozen, the key of a run's stages."""

from __future__ import annotations

from dataclasses import FrozenInstanceError, fields, replace
from pathlib import Path
from typing import Any, cast, get_type_hints

import pydpend as dp
import pytest
from pydpend.analyse import Options, plan
from pydpend.cli import parser
from pydpend.errors import FitOptionError
from pydpend.fit_options import FitKeywords, FitOptions
from pydpend.option_fields import meanings

from tests.support.free_decays import measured, released

DEMO = Path(__file__).parent.parent.parent / "fixtures" / "demo"

OTHER: dict[str, Any] = {
    "method": "energy",
    "laws": "paper",
    "ratios": "fixed",
    "free": "tilt",
    "clock": True,
    "angle_maps": True,
    "pinned": True,
    "ten_coefficients": True,
    "intervals": "profile",
    "comparison": False,
    "prediction": False,
    "start_s": 0.6,
    "stop_s": 3.0,
}
"""A value of each option that is not its default."""


def changed(name: str) -> FitOptions:
    """Options of which one is not as it is by itself, beside what it needs."""
    needs = {"ten_coefficients": FitOptions(method="energy", laws="paper")}
    return replace(needs.get(name, FitOptions()), **{name: OTHER[name]})


def test_every_option_is_a_field_a_keyword_and_a_flag() -> None:
    names = {f.name for f in fields(FitOptions)}
    assert set(OTHER) == names
    assert set(get_type_hints(FitKeywords)) | {"method", "laws"} == names
    assert all(meanings(FitOptions)[name] for name in names)
    assert names <= {f.name for f in fields(Options)}
    for words in (["fit", "a", "-o", "b"], ["analyse"]):
        assert names <= set(vars(parser().parse_args(words)))


@pytest.mark.parametrize("name", sorted(OTHER))
def test_every_option_is_in_the_key_of_the_fit(name: str) -> None:
    plain = FitOptions(method="energy", laws="paper") if name == "ten_coefficients" else FitOptions()
    assert changed(name).key() != plain.key()
    given: dict[str, Any] = {f.name: getattr(changed(name), f.name) for f in fields(FitOptions)}
    base: dict[str, Any] = {f.name: getattr(plain, f.name) for f in fields(FitOptions)}
    keys = []
    for options in (given, base):
        stages = plan(Options(inputs=(str(DEMO / "motion.parquet"),), **options), Path("run"))
        keys.append({s.name: s.key for s in stages}["fit"])
    assert keys[0] != keys[1]


def test_stages_are_done_again_only_for_what_they_depend_on(tmp_path: Path) -> None:
    """The prediction of recordings from each other knows nothing of intervals and of the comparison of terms."""
    other = tmp_path / "other.csv"
    other.write_text("time_s,phi1_rad,phi2_rad\n0,0.5,0.6\n0.01,0.51,0.62\n", encoding="utf-8")

    def keys(**given: Any) -> dict[str, str]:
        options = Options(inputs=(str(DEMO / "motion.parquet"), str(other)), **given)
        return {s.name: s.key for s in plan(options, tmp_path)}

    plain, more, others = keys(), keys(intervals="profile", comparison=False), keys(laws="paper")
    assert plain["fit"] != more["fit"]
    assert plain["prediction"] == more["prediction"] != others["prediction"]
    # What the programs do by themselves is no other fit when it is asked for.
    assert keys(comparison=True)["fit"] == plain["fit"]


def test_options_cannot_be_changed_and_take_names_and_truth_values() -> None:
    options = FitOptions(laws=("mu_v1", "tau_c1"), free=["tilt"], ratios=False)
    assert options == FitOptions(laws="mu_v1,tau_c1", free="tilt", ratios="fixed")
    assert hash(options) == hash(FitOptions(laws="mu_v1,tau_c1", free="tilt", ratios="fixed"))
    with pytest.raises(FrozenInstanceError):
        options.laws = "full"  # type: ignore[misc]
    assert FitOptions.of(options, laws="paper").laws == "paper"
    assert FitOptions.of(options, laws=None) == options
    assert type(FitOptions.of(Options(start_s=1.0), pinned=True)) is FitOptions
    for wrong in ({"laws": ()}, {"laws": ""}, {"start_s": float("nan")}, {"start_s": 2.0, "stop_s": 1.0}):
        with pytest.raises(FitOptionError):
            FitOptions(**cast(dict[str, Any], wrong))


def test_options_and_keywords_are_the_same_to_a_fit() -> None:
    angles, model = measured(released(3, 4.0, 250.0), 3, 0.05), dp.derived("A")
    given = FitOptions(laws="mu_v1,mu_v2", ratios="fixed", start_s=0.1, stop_s=4.0)
    one = dp.fit_damping(angles, model, options=given)
    two = dp.fit_damping(angles, model, laws=["mu_v1", "mu_v2"], ratios=False, start_s=0.1, stop_s=4.0)
    assert one.coefficients == two.coefficients
    three = dp.fit_damping(angles, model, options=given, laws="mu_v1")
    assert set(three.coefficients) == {"mu_v1"}


@pytest.mark.parametrize(
    ("keyword", "advice"),
    [
        ("law", "Did you mean laws?"),
        ("start", "Did you mean start_s?"),
        ("angle_map", "Did you mean angle_maps?"),
        ("Clock", "Did you mean clock?"),
        ("ten", "Known are method, laws, ratios, "),
    ],
)
def test_a_keyword_that_is_none_is_named_with_the_nearest(keyword: str, advice: str) -> None:
    angles = measured(released(3, 4.0, 250.0), 3, 0.05)
    with pytest.raises(FitOptionError) as caught:
        dp.fit_damping(angles, dp.derived("A"), **{keyword: True})  # type: ignore[arg-type]
    assert str(caught.value).startswith(f"{keyword}: it is no option of a damping fit. {advice}")
    assert "\n" not in str(caught.value)
