"""What a user of the package sees: names, one line for people, plain values, tables."""

from __future__ import annotations

import dataclasses
import importlib
import importlib.util
import inspect
import json
import pkgutil
import re
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import polars as pl
import pyarrow as pa
import pydpend as dp
import pytest
from pydpend import _native
from pydpend.encoder import EncoderSignal
from pydpend.json_text import JsonResult
from pydpend.tabular import TableResult
from pydpend.tracking import OverlayFilm

from tests.support.drawn_nodes import some_nodes
from tests.support.made_results import (
    calibration,
    comparison,
    ensemble,
    fit,
    how_far,
    many,
    motion,
    outcome,
    prediction,
    score,
    section,
    simulation,
    trials,
)


def signal() -> EncoderSignal:
    return EncoderSignal(np.arange(5.0), np.ones(5))


RESULTS: dict[str, Callable[[], Any]] = {
    "Nodes": some_nodes,
    "LinkAngles": motion,
    "LinkStates": lambda: dp.states(motion()),
    "Model": lambda: dp.derived("A"),
    "DampingFit": fit,
    "Simulation": simulation,
}


@pytest.mark.parametrize("kind", RESULTS)
def test_a_result_is_one_line_and_a_small_table(kind: str) -> None:
    result = RESULTS[kind]()
    line = repr(result)
    assert line.startswith(f"<{kind}")
    assert "\n" not in line
    assert len(line) < 120
    page = result._repr_html_()
    assert page.startswith("<table>")
    assert 2 <= page.count("<tr>") < 20
    assert len(page) < 5000


@pytest.mark.parametrize(
    "made", [comparison, prediction, trials, calibration, lambda: comparison().sync, signal]
)
def test_other_results_are_one_line(made: Callable[[], Any]) -> None:
    line = repr(made())
    assert line.startswith(f"<{type(made()).__name__}")
    assert "\n" not in line
    assert len(line) < 160


@pytest.mark.parametrize(
    ("made", "rows", "column"),
    [
        (motion, 1001, "phi2_rad"),
        (lambda: dp.states(motion()), 1001, "sigma_w1_rad_s"),
        (simulation, 10, "tau_c1_j"),
        (comparison, 1001, "residual_rad"),
        (fit, 6, "sigma"),
        (signal, 5, "voltage_v"),
        (lambda: EncoderSignal(np.arange(5.0), np.ones(5), "rad"), 5, "phi1_rad"),
        (calibration, 4, "residual_v"),
        (prediction, 8, "phi2_rms_deg"),
        (trials, 6, "value2"),
        (lambda: fit().energy[0], 976, "mu_v2_j"),
        (lambda: fit().residuals[0], 976, "phi2_sigma_rad"),
        (lambda: dp.Film("clean", frames=3).truth(), 27, "visible"),
        (lambda: OverlayFilm("a.mp4", np.arange(4), np.arange(4.0), 30), 4, "time_s"),
        (section, 9, "w2_rad_s"),
        (ensemble, 6, "energy_j"),
        (some_nodes, 150, "x_px"),
    ],
)
def test_a_table_goes_to_pandas_arrow_and_polars(
    made: Callable[[], TableResult], rows: int, column: str
) -> None:
    result = made()
    frame, table = result.to_dataframe(), result.to_arrow()
    assert list(frame.columns) == table.column_names
    assert column in table.column_names
    assert 0.9 * rows <= len(frame) == table.num_rows <= rows
    assert pa.table(result).equals(table)
    assert pl.DataFrame(result).columns == table.column_names
    if isinstance(result, TableResult):
        assert table.column_names == list(result.to_columns())
        np.testing.assert_allclose(frame[column], np.asarray(result.to_columns()[column], dtype=np.float64))


def test_what_has_plain_values_has_them_as_text_too() -> None:
    rig = some_nodes().rig
    assert json.loads(rig.to_json()) == rig.to_dict()
    assert dp.Rig.from_json(rig.to_json()) == rig
    with pytest.raises(dp.RigError, match="missing field"):
        dp.Rig.from_json("{}")


JSON: dict[str, Callable[[], JsonResult]] = {
    "DampingFit": fit,
    "Prediction": prediction,
    "Trials": trials,
    "Comparison": comparison,
    "Synchronisation": lambda: comparison().sync,
    "Calibration": calibration,
    "Score": score,
    "Outcome": outcome,
    "Batch": many,
    "Status": how_far,
}


@pytest.mark.parametrize("kind", JSON)
def test_a_result_goes_to_json_and_back(kind: str) -> None:
    result = JSON[kind]()
    assert type(result).__name__ == kind
    text = result.to_json()
    assert json.loads(text) == result.to_dict()
    again = type(result).from_json(text)
    assert again.to_json() == text
    for field in dataclasses.fields(again):  # type: ignore[arg-type]
        one, other = getattr(result, field.name), getattr(again, field.name)
        # What is in tables of their own is empty.
        if isinstance(one, float | int | str) and one == one:
            assert other == one, field.name


@pytest.mark.parametrize("kind", JSON)
def test_a_text_that_is_no_result_is_one_line(kind: str) -> None:
    cls = type(JSON[kind]())
    for text in ("", "[]", "{}", '{"status": 1}'):
        with pytest.raises(dp.PydpendError) as caught:
            cls.from_json(text, "mine.json")
        assert str(caught.value).startswith("mine.json")
        assert "\n" not in str(caught.value)


ODD: tuple[Any, ...] = (None, "x", -1, [1], {})


def places(value: Any, above: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Where something stands in a document; of lists the first two."""
    inside = (
        value.items() if isinstance(value, dict) else enumerate(value[:2]) if isinstance(value, list) else ()
    )
    for key, held in inside:
        yield (*above, key)
        yield from places(held, (*above, key))


@pytest.mark.parametrize("kind", JSON)
def test_an_odd_value_anywhere_is_one_line_or_does_no_harm(kind: str) -> None:
    """Null, text, a number below zero, a list or a table in place of each value; and each value left out."""
    result = JSON[kind]()
    whole = result.to_json()
    refused: list[str] = []
    for place in places(json.loads(whole)):
        # The fits in trials are those of a fit.
        if place[0] in ("joint", "each") and len(place) > 2:
            continue
        for odd in (*ODD, "leave out"):
            document = json.loads(whole)
            held = document
            for key in place[:-1]:
                held = held[key]
            if odd == "leave out":
                held.pop(place[-1])
            else:
                held[place[-1]] = odd
            try:
                found = type(result).from_json(json.dumps(document), "mine.json")
            except dp.PydpendError as problem:
                refused.append(str(problem))
                continue
            found.to_json()
            if isinstance(found, TableResult):
                found.to_arrow()
    assert len(refused) > 20
    assert not [said for said in refused if "\n" in said]


@pytest.mark.parametrize(
    ("windows", "said"),
    [
        ({"x": [[0.0, 1.0]]}, "key windows.x: 'x' is no length of a window in s"),
        ({"-1": [[0.0, 1.0]]}, "key windows.-1: '-1' is no length of a window in s"),
        ({"1": [[0.0, 1.0], [0.0]]}, "key windows.1: its lists are of different lengths"),
        ({"1": [[0.0]]}, "key windows.1: a start and the error of one link or two are expected"),
        (
            {"1": [[0.0, 1.0, 1.0, 1.0]]},
            "key windows.1: a start and the error of one link or two are expected",
        ),
    ],
)
def test_odd_windows_of_a_prediction_are_one_line(windows: dict[str, Any], said: str) -> None:
    text = json.dumps(prediction().to_dict() | {"windows": windows})
    with pytest.raises(dp.FitError, match=re.escape(said)):
        dp.Prediction.from_json(text)


def test_every_json_result_goes_there_and_back() -> None:
    """A class that comes later is tried above too."""
    for module in pkgutil.walk_packages(dp.__path__, "pydpend."):
        if not module.name.endswith(("__main__", "_native")):
            importlib.import_module(module.name)
    assert {cls.__name__ for cls in JsonResult.__subclasses__()} == set(JSON)


def test_no_function_hides_a_module() -> None:
    for name in dp.__all__:
        if not inspect.isclass(getattr(dp, name)):
            assert importlib.util.find_spec(f"pydpend.{name}") is None, name
    for package in ("encoder", "kinematics", "damping", "model", "report", "components"):
        module = importlib.import_module(f"pydpend.{package}")
        for name in module.__all__:
            assert importlib.util.find_spec(f"pydpend.{package}.{name}") is None, f"{package}.{name}"


def test_the_version_is_the_compiled_half_s() -> None:
    assert dp.__version__ == _native.VERSION


def test_results_that_hold_arrays_are_compared_by_identity() -> None:
    """A dataclass's own comparison asks arrays for one truth value."""
    wrong = []
    for module in pkgutil.walk_packages(dp.__path__, "pydpend."):
        if module.name.endswith(("__main__", "_native")):
            continue
        for name, cls in inspect.getmembers(importlib.import_module(module.name), inspect.isclass):
            if cls.__module__ != module.name or not dataclasses.is_dataclass(cls):
                continue
            compared = [str(f.type) for f in dataclasses.fields(cls) if f.compare]
            holds = any(kind in text for text in compared for kind in ("Floats", "Ints", "NDArray", "Array"))
            if holds and cls.__eq__ is not object.__eq__:
                wrong.append(f"{module.name}.{name}")
    assert not wrong
    one = simulation()
    assert one != simulation()
    assert {one: 1}[one] == 1
