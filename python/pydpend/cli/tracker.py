"""The tracker's commands among those of ``pydpend``, read and run by the compiled half.

What is known of them here serves the list of commands, completions and advice.
"""

from __future__ import annotations

import argparse
import json
import sys
from typing import Any, TypedDict

COMMANDS: tuple[str, ...] = ("info", "setup", "track", "check", "overlay", "film", "score")


class Argument(TypedDict):
    """An argument of a command: no flags where it is given by its place, no value where it is a switch."""

    name: str
    flags: list[str]
    value: str | None
    help: str | None
    choices: list[str]


class Command(TypedDict):
    """A command of the tracker."""

    name: str
    about: str
    arguments: list[Argument]


def described() -> dict[str, Command]:
    """The tracker's commands by their names."""
    from pydpend import _native

    commands: list[Command] = json.loads(_native.commands())
    return {command["name"]: command for command in commands if command["name"] in COMMANDS}


def add_arguments(p: argparse.ArgumentParser, command: Command) -> None:
    """The command's arguments, as far as they are known here."""
    for argument in command["arguments"]:
        told: dict[str, Any] = {"help": (argument["help"] or "").replace("%", "%%")}
        if argument["flags"]:
            told["dest"] = argument["name"]
        if argument["value"] is None:
            told["action"] = "store_true"
        else:
            told |= {"metavar": argument["value"], "choices": argument["choices"] or None}
        p.add_argument(*(argument["flags"] or [argument["name"]]), **told)


def run(argv: list[str]) -> int:
    """Runs a command with its arguments and returns its exit status."""
    from pydpend import _native

    sys.stdout.flush()
    return _native.command(argv)
