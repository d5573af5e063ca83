"""What a user of the package sees: names, one line for people, plain values, tables."""

from __future__ import annotations

import dataclasses
import importlib
import importlib.util
import inspect
import json
import pkgutil
from collections.abc import Callable
from typing import Any

import numpy as np
import polars as pl
import pyarrow as pa
import pydpend as dp
import pytest
from pydpend import _tracker
from pydpend.encoder import EncoderSignal, compare, encoder_angles
from pydpend.json_text import JsonResult
from pydpend.tabular import TableResult

from tests.drawn_nodes import some_nodes
from tests.free_decays import measured, released


def motion() -> dp.LinkAngles:
    return measured(released(3, 4.0, 250.0), 3, 0.05)


def fit() -> dp.DampingFit:
    return dp.fit_damping(
        motion(), dp.derived("A"), laws="mu_v1,mu_v2", ratios=False, start_s=0.1, stop_s=4.0
    )


def comparison() -> dp.Comparison:
    angles = motion()
    noise = np.random.default_rng(5).normal(0.0, 1e-3, angles.t_s.size)
    return compare(angles, encoder_angles(EncoderSignal(angles.t_s, angles.phi_rad[:, 0] + noise, "rad")))


def simulation() -> dp.Simulation:
    return dp.simulate(dp.derived("A"), dp.Damping(), [0.5, 0.2, 0.0, 0.0], np.arange(0.0, 0.1, 0.01))


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
    ("made", "rows", "column"),
    [
        (motion, 1001, "phi2_rad"),
        (lambda: dp.states(motion()), 1001, "sigma_w1_rad_s"),
        (simulation, 10, "tau_c1_j"),
        (comparison, 1001, "residual_rad"),
        (fit, 6, "sigma"),
    ],
)
def test_a_table_goes_to_pandas_arrow_and_polars(
    made: Callable[[], TableResult], rows: int, column: str
) -> None:
    result = made()
    frame, table = result.to_dataframe(), result.to_arrow()
    assert list(frame.columns) == table.column_names == list(result.to_columns())
    assert column in table.column_names
    assert 0.9 * rows <= len(frame) == table.num_rows <= rows
    assert pa.table(result).equals(table)
    assert pl.DataFrame(result).columns == table.column_names
    np.testing.assert_allclose(frame[column], np.asarray(result.to_columns()[column], dtype=np.float64))


def test_what_has_plain_values_has_them_as_text_too() -> None:
    for result in (fit(), comparison(), some_nodes().rig):
        assert isinstance(result.to_json(), str)
        assert json.loads(result.to_json()) == result.to_dict()
    assert issubclass(dp.DampingFit, JsonResult)
    assert issubclass(dp.Prediction, JsonResult)


def test_no_function_hides_a_module() -> None:
    for name in dp.__all__:
        if not inspect.isclass(getattr(dp, name)):
            assert importlib.util.find_spec(f"pydpend.{name}") is None, name
    for package in ("encoder", "kinematics", "damping", "model", "report", "components"):
        module = importlib.import_module(f"pydpend.{package}")
        for name in module.__all__:
            assert importlib.util.find_spec(f"pydpend.{package}.{name}") is None, f"{package}.{name}"


def test_the_version_is_the_compiled_half_s() -> None:
    assert dp.__version__ == _tracker.VERSION


def test_results_that_hold_arrays_are_compared_by_identity() -> None:
    """A dataclass's own comparison asks arrays for one truth value."""
    wrong = []
    for module in pkgutil.walk_packages(dp.__path__, "pydpend."):
        if module.name.endswith(("__main__", "_tracker")):
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
