"""Messages of the library in the words of the command line: settings are flags, steps are commands to type.

Also what is said of words on the command line that are not known: the nearest that are, and new names of old options.
"""

from __future__ import annotations

import argparse
import difflib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property

from pydpend.errors import Setting, Step, listed
from pydpend.kinds import misplaced

VALUES: Mapping[tuple[str, object], str] = {("ratios", True): "free", ("ratios", False): "fixed"}
"""Values that are words on the command line and truth values in Python."""

UNITS = ("_s", "_deg", "_rad")
"""Units that a keyword ends in and its flag may not."""


def flags_of(keyword: str) -> tuple[str, ...]:
    """The flags that a keyword may have: ``start_s`` has ``--start-s`` or ``--start``."""
    bare = next((keyword.removesuffix(unit) for unit in UNITS if keyword.endswith(unit)), keyword)
    return tuple(dict.fromkeys(f"--{n.replace('_', '-')}" for n in (keyword, bare)))


class CommandLine:
    """The program ``pydpend`` at a command. A setting that the command has not is named with one that has it."""

    made_by = "pydpend.cli:front_end"
    """Function that makes one in another process."""

    def __init__(self, commands: Callable[[], Mapping[str, argparse.ArgumentParser]], command: str) -> None:
        self._all = commands
        self._command = command

    @cached_property
    def _commands(self) -> Mapping[str, argparse.ArgumentParser]:
        """Every command's arguments, this one's first; made when a message names a setting."""
        commands = self._all()
        return {self._command: commands[self._command], **commands}

    def setting(self, setting: Setting) -> str:
        """``--method energy``."""
        owner, flag = self._owner(setting.name)
        if isinstance(setting.value, bool) and (setting.name, setting.value) not in VALUES:
            said = flag if setting.value else f"--no-{flag.removeprefix('--')}"
        elif setting.value is None:
            said = flag
        else:
            said = f"{flag} {VALUES.get((setting.name, setting.value), setting.value)}"
        return said if owner == f"pydpend {self._command}" else f"{said} (of `{owner}`)"

    def step(self, step: Step) -> str:
        """The command to type."""
        return f"`{step.command}`"

    def _owner(self, keyword: str) -> tuple[str, str]:
        """The command that has the flag of a keyword, this one if it can be, and the flag."""
        for command, parser in self._commands.items():
            named = [
                word
                for a in parser._actions
                if a.dest == keyword
                for word in a.option_strings
                if word.startswith("--") and not word.startswith("--no-")
            ]
            for flag in (*named, *flags_of(keyword)):
                if flag in options_of(parser):
                    return f"pydpend {command}", flag
        return "pydpend track", flags_of(keyword)[0]


def options_of(parser: argparse.ArgumentParser) -> list[str]:
    """All flags of a command."""
    return [flag for action in parser._actions for flag in action.option_strings]


@dataclass(frozen=True)
class Renamed:
    """An option's new name, and what else is new about it; then the old one is refused and not taken."""

    flag: str
    also: str = ""


RENAMED: Mapping[str, Mapping[str, Renamed]] = {
    "angles": {"--method": Renamed("--estimator")},
    "analyse": {"--encoder-column": Renamed("--column")},
    "fit": {"--hanging-rad": Renamed("--hanging", "in degrees")},
    "predict": {"--hanging-rad": Renamed("--hanging", "in degrees")},
    "animate": {"--fps": Renamed("--play-fps")},
}
"""Old names of options, by command."""


def unknown_command(word: str, known: Iterable[str]) -> str:
    """The message for a command that is none."""
    said = misplaced(word, ())
    if said is not None:
        return str(said)
    near = difflib.get_close_matches(word.lower(), list(known), 1, 0.6)
    advice = f"Did you mean {near[0]}?" if near else f"Give {listed(known)}"
    return f"{word!r} is not a command. {advice}"


def unknown_option(word: str, command: str, commands: Mapping[str, argparse.ArgumentParser]) -> str:
    """The message for an option that a command has not."""
    flag = word.partition("=")[0]
    flags = options_of(commands[command])
    near = difflib.get_close_matches(flag.lower(), flags, 1, 0.7) or [
        f for f in flags if len(flag) > 3 and f.startswith(flag)
    ]
    others = [name for name, parser in commands.items() if flag in options_of(parser)]
    if others:
        there = listed(f"`pydpend {name}`" for name in others)
        near_words = f"; did you mean {near[0]}?" if near else ""
        return f"{flag}: is not an option of `pydpend {command}` but of {there}{near_words}"
    if near:
        return f"{flag}: is not an option of `pydpend {command}`. Did you mean {near[0]}?"
    return f"{flag}: is not an option of `pydpend {command}`. See `pydpend {command} --help`"
