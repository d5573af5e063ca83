"""Flags made from the fields of a class of options, and the options that they give."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from dataclasses import Field
from typing import Any

from pydpend.option_fields import choices_of, flag_of, kind_of_value, meanings


def add_fields(p: argparse._ActionsContainer, options: type, fields: Iterable[Field[Any]]) -> None:
    """A flag for each field of the class ``options``; one that is not given is None."""
    docs = meanings(options)
    for f in fields:
        text = docs[f.name].replace("``", "").replace("%", "%%")
        kind = kind_of_value(f)
        if kind == "flag":
            action = argparse.BooleanOptionalAction
            p.add_argument(flag_of(f.name), dest=f.name, action=action, default=None, help=text)
        else:
            adds = "append" if kind == "texts" else "store"
            number = {"number": float, "whole": int}.get(kind, str)
            choices = choices_of(f) or None
            unit = "S" if f.name.endswith("_s") else None
            told = text if f.default in (None, "", ()) else f"{text} (default {f.default})"
            p.add_argument(
                flag_of(f.name),
                dest=f.name,
                type=number,
                choices=choices,
                metavar=unit,
                help=told,
                action=adds,
            )


def given(args: argparse.Namespace, fields: Iterable[Field[Any]]) -> dict[str, Any]:
    """The options of these fields that the command line gives."""
    values = {f.name: getattr(args, f.name) for f in fields}
    told = {name: value for name, value in values.items() if value is not None}
    return {name: tuple(value) if isinstance(value, list) else value for name, value in told.items()}
