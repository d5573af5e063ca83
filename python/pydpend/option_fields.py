"""Options as fields of a frozen class: what each means, which words it may be, and the kind of its value.

The command line makes its flags from these, the TOML form its keys. What the class's docstring says of a field is what
it means.
"""

from __future__ import annotations

import ast
import dataclasses
import inspect
import re
from dataclasses import Field
from functools import cache
from typing import Any, Literal

Kind = Literal["flag", "whole", "number", "texts", "text"]


def option(default: Any, *, choices: tuple[str, ...] = (), of: str = "") -> Any:
    """A field with its default. ``choices``: the words that it may be; ``of``: the one method that has the option."""
    return dataclasses.field(default=default, metadata={"choices": choices, "of": of})


def choices_of(field: Field[Any]) -> tuple[str, ...]:
    """The words that an option may be; empty where it is free."""
    words: tuple[str, ...] = field.metadata.get("choices", ())
    return words


def method_of(field: Field[Any]) -> str:
    """The one method that has the option, "" where all have it."""
    return str(field.metadata.get("of", ""))


def kind_of_value(field: Field[Any]) -> Kind:
    """The type of the value that a command line or a file gives for the option."""
    declared = str(field.type)
    kinds: tuple[tuple[str, Kind], ...] = (
        ("tuple", "texts"),
        ("bool", "flag"),
        ("int", "whole"),
        ("float", "number"),
    )
    return next((kind for start, kind in kinds if declared.startswith(start)), "text")


def flag_of(name: str) -> str:
    """The flag of an option: ``start_s`` is ``--start``."""
    return "--" + name.removesuffix("_s").removesuffix("_deg").replace("_", "-")


_ENTRY = re.compile(r"^(\w+) : .*\n((?:    .*(?:\n|$))+)", re.MULTILINE)
"""A parameter in a numpydoc docstring: its name, and the lines that describe it."""


@cache
def meanings(options: type) -> dict[str, str]:
    """The description of each parameter in a class's docstring, those of the classes that it extends too."""
    out: dict[str, str] = {}
    for part in reversed(options.__mro__):
        if not dataclasses.is_dataclass(part):
            continue
        # From the source, because Python may run without docstrings (-OO).
        body = ast.parse(inspect.cleandoc(inspect.getsource(part))).body[0]
        assert isinstance(body, ast.ClassDef)
        text = ast.get_docstring(body) or ""
        out |= {name: inspect.cleandoc(said).strip() for name, said in _ENTRY.findall(text)}
    return out
