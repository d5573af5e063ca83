"""Docstrings of what the package exports: numpydoc, every parameter and every result described."""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Iterator
from operator import attrgetter
from typing import Any

import pydpend as dp
import pytest
from numpydoc.docscrape import NumpyDocString
from numpydoc.validate import validate

WANTED = {
    "GL05", "GL06", "GL07", "GL08", "SS01", "SS02", "SS03", "SS06", "PR01", "PR02", "PR03", "PR04", "PR05", "PR07",
    "PR08", "PR09", "PR10", "RT01", "RT03", "RT04", "RT05",
}  # fmt: skip
"""numpydoc's checks that hold here: sections and their order, a summary of one line, every parameter with type and
words, the result. Not those that ask for examples and references everywhere, and for summaries that begin with a verb:
a function is called after what it gives, and so is its summary."""

GIVEN = (
    "nodes.Node",
    "nodes.Joint",
    "kinematics.LinkJoint",
    "kinematics.Rest",
    "kinematics.Shape",
    "encoder.Hold",
    "simulation.Event",
    "simulation.Ensemble",
    "linear.Modes",
    "linear.Section",
    "linear.Exponent",
    "damping.Estimate",
    "damping.EnergyCurve",
    "damping.Residuals",
    "damping.Identifiability",
    "damping.Term",
    "damping.Interval",
    "damping.Window",
    "damping.result.TenCoefficients",
)
"""Classes that nobody imports, of results that the exported functions give."""

LISTS = ("Parameters", "Attributes")


def functions() -> Iterator[str]:
    """Every exported function, and every public method that a class of pydpend defines."""
    for name in dp.__all__:
        exported = getattr(dp, name)
        if not inspect.isclass(exported):
            yield name
            continue
        for method, member in inspect.getmembers(exported):
            plain = inspect.isfunction(member) or inspect.ismethod(member)
            if plain and not method.startswith("_") and member.__module__.startswith("pydpend"):
                yield f"{name}.{method}"


def classes() -> list[str]:
    return [*(name for name in dp.__all__ if inspect.isclass(getattr(dp, name))), *GIVEN]


def named(path: str) -> Any:
    return attrgetter(path)(dp)


def members(cls: Any) -> list[str]:
    """What a class is made of: its fields, or the parameters of its constructor."""
    if dataclasses.is_dataclass(cls):
        return [f.name for f in dataclasses.fields(cls)]
    if issubclass(cls, tuple):
        return list(cls._fields)
    if issubclass(cls, Exception):
        return []
    return list(inspect.signature(cls).parameters)


@pytest.mark.parametrize("name", list(functions()))
def test_a_function_tells_its_parameters_and_its_result(name: str) -> None:
    found = validate(f"pydpend.{name}")["errors"]
    assert not [(code, said) for code, said in found if code in WANTED]


@pytest.mark.parametrize("name", classes())
def test_a_class_tells_what_it_is_made_of(name: str) -> None:
    cls = named(name)
    found = validate(f"pydpend.{name}")["errors"]
    # The fields of a result are attributes to whoever reads it, and no parameters.
    assert not [(code, said) for code, said in found if code in WANTED - {"PR01"}]
    text = NumpyDocString(inspect.getdoc(cls) or "")
    told = {one for part in LISTS for entry in text[part] for one in entry.name.split(", ")}
    assert not set(members(cls)) - told
    for part in LISTS:
        for entry in text[part]:
            assert entry.type, entry.name
            assert entry.desc, entry.name
            assert entry.desc[-1].endswith("."), entry.name
    if dataclasses.is_dataclass(cls):
        assert not told - set(members(cls))


@pytest.mark.parametrize("name", classes())
def test_a_property_has_words_and_a_type(name: str) -> None:
    for called, member in inspect.getmembers(named(name), lambda m: isinstance(m, property)):
        if called.startswith("_"):
            continue
        assert inspect.getdoc(member), called
        assert inspect.signature(member.fget).return_annotation is not inspect.Signature.empty, called
