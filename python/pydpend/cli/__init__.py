"""The command line ``pydpend``: one module per command, this dispatcher, and nothing else.

A command's module has ``HELP`` (one line), ``add_arguments(parser)`` and ``run(args) -> int``; those of the tracker are
run by the compiled half (`tracker`).
Exit status: 0 done; 1 done, but something was left out and said; 2 an error, in one line on stderr;
130 interrupted.
"""

from __future__ import annotations

import argparse
import importlib
import os
import signal
import sys
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from typing import Any

from pydpend.cli import tracker
from pydpend.cli.reads import read_by
from pydpend.cli.words import RENAMED, CommandLine, unknown_command, unknown_option
from pydpend.errors import PydpendError, RecordingWarning, listed, speaking
from pydpend.number_words import number
from pydpend.output import keeping
from pydpend.terminal import Shown, shortened

COMMANDS: tuple[str, ...] = (
    "analyse",
    "batch",
    "edit",
    "angles",
    "states",
    "calibrate",
    "compare",
    "fit",
    "predict",
    "plot",
    "animate",
    "import",
    "find-rig",
    "export",
    "completions",
)
"""Commands that Python runs."""

ALL = (*COMMANDS, *tracker.COMMANDS)
"""Every command; where several have an option, an earlier one is named."""

MODULES = {"import": "import_tracks", "find-rig": "find_rig"}
"""Modules of commands whose names are no names of Python's."""


def _version() -> str:
    from pydpend import _native

    return _native.VERSION


def _number(word: str) -> float:
    try:
        return number(word)
    except ValueError as problem:
        raise argparse.ArgumentTypeError(str(problem)) from None


def _whole_number(word: str) -> int:
    try:
        return int(word)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{word!r} is not a whole number") from None


class Parser(argparse.ArgumentParser):
    """argparse's, saying what is wrong in one line and taking no option by half its name."""

    def __init__(self, **given: Any) -> None:
        super().__init__(**given, allow_abbrev=False, exit_on_error=False)
        self.register("type", float, _number)
        self.register("type", int, _whole_number)

    def error(self, message: str) -> Any:
        """Ends the program with one line."""
        self.exit(2, f"{self.prog}: {shortened(message)}. See `{self.prog} --help`\n")

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        choices: Iterable[Any] | None = action.choices
        if choices is not None and value not in choices:
            known = listed(str(choice) for choice in choices)
            raise argparse.ArgumentError(action, f"{value!r} is not known. Give {known}")


def parser() -> Parser:
    """The whole command line."""
    return _parsers()[0]


def _parsers(wanted: Iterable[str] = ALL) -> tuple[Parser, dict[str, argparse.ArgumentParser]]:
    """The whole command line, and each command's part of it, with the arguments of the commands that are wanted.

    A command's module imports nothing heavy at its top; to know its arguments may take NumPy and more.
    """
    wanted = set(wanted)
    top = Parser(
        prog="pydpend",
        description="From film to node tables, angles, encoder comparison, damping and a report.",
    )
    top.add_argument("--version", action="version", version=f"pydpend {_version()}")
    commands = top.add_subparsers(dest="command", metavar="COMMAND", required=True, parser_class=Parser)
    films = tracker.described()
    for name in tracker.COMMANDS:
        about = films[name]["about"]
        sub = commands.add_parser(name, help=about, description=about)
        if name in wanted:
            tracker.add_arguments(sub, films[name])
    for name in COMMANDS:
        module = importlib.import_module(f"pydpend.cli.{MODULES.get(name, name)}")
        sub = commands.add_parser(
            name,
            help=module.HELP,
            description=module.__doc__,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        if name in wanted:
            module.add_arguments(sub)
        sub.set_defaults(run=module.run)
    return top, {name: commands.choices[name] for name in ALL}


def _commands() -> dict[str, argparse.ArgumentParser]:
    """Every command with its arguments."""
    return _parsers()[1]


def front_end() -> CommandLine:
    """The front end of ``pydpend analyse``, for processes that another one of the program started."""
    return CommandLine(_commands, COMMANDS[0])


class _Refused(Exception):
    """A command line that cannot be understood."""


def _parse(argv: list[str]) -> tuple[argparse.Namespace, CommandLine]:
    """The arguments, and the front end of their command. Raises _Refused with one line."""
    word = next((w for w in argv if not w.startswith("-")), None)
    if word is not None and word not in ALL:
        with speaking(CommandLine(_commands, COMMANDS[0])):
            raise _Refused(unknown_command(word, ALL))
    if word in tracker.COMMANDS and not {"-h", "--help", "--version"} & set(argv[: argv.index(word)]):
        raise _Refused(unknown_option(argv[0], word, _commands()))
    try:
        with speaking(CommandLine(_commands, word or COMMANDS[0])):
            args, rest = _parsers(() if word is None else (word,))[0].parse_known_args(_renamed(argv, word))
    except argparse.ArgumentError as problem:
        raise _Refused(f"{problem.argument_name}: {problem.message}") from None
    if rest:
        if not rest[0].startswith("-"):
            raise _Refused(f"{rest[0]!r} is one argument too many. See `pydpend {args.command} --help`")
        raise _Refused(unknown_option(rest[0], args.command, _commands()))
    return args, CommandLine(_commands, args.command)


def _renamed(argv: list[str], command: str | None) -> list[str]:
    """Old names of options replaced by new ones, saying so. Raises _Refused where more than the name is new."""
    out = []
    for word in argv:
        flag, sign, value = word.partition("=")
        new = RENAMED.get(command or "", {}).get(flag)
        if new is None:
            out.append(word)
        elif new.also:
            raise _Refused(f"{flag}: the option is called {new.flag} now, {new.also}")
        else:
            print(f"pydpend: note: {flag} is called {new.flag} now", file=sys.stderr)
            out.append(new.flag + sign + value)
    return out


def _look_up_numpy() -> None:
    """Lets the compiled half find NumPy's C interface with Ctrl-C held back: interrupted there, it would panic."""
    held = {signal.SIGINT}
    signal.pthread_sigmask(signal.SIG_BLOCK, held)
    try:
        import numpy as np

        from pydpend import _native
        from pydpend.coefficients import parameters
        from pydpend.model import derived

        _native.unit_powers(parameters(derived("A")), np.zeros((0, 4)), np.zeros((0, 2)))
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, held)


def main(argv: list[str] | None = None) -> int:
    """Runs one command and returns its exit status."""
    words = sys.argv[1:] if argv is None else argv
    if words[:1] == ["help"]:
        words = [*words[1:2], "--help"]
    if words and words[0] in tracker.COMMANDS:
        return tracker.run(words)
    with redirect_stdout(Shown(sys.stdout)), redirect_stderr(Shown(sys.stderr)):
        try:
            args, front = _parse(words)
        except _Refused as problem:
            print(f"pydpend: {shortened(str(problem))}", file=sys.stderr)
            return 2
        with speaking(front):
            return _run(args)


@contextmanager
def _saying() -> Iterator[None]:
    """Warnings of recordings are lines for people meanwhile."""
    others = warnings.showwarning

    def say(message: Warning | str, category: type[Warning], *place: Any, **more: Any) -> None:
        if issubclass(category, RecordingWarning):
            print(f"warning: {message}", file=sys.stderr)
        else:
            others(message, category, *place, **more)

    with warnings.catch_warnings():
        warnings.simplefilter("always", RecordingWarning)
        warnings.showwarning = say
        yield


def _run(args: argparse.Namespace) -> int:
    try:
        _look_up_numpy()
        with keeping(read_by(args)), _saying():
            status: int = args.run(args)
        sys.stdout.flush()
        return status
    except PydpendError as error:
        print(f"pydpend: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("pydpend: interrupted", file=sys.stderr)
        return 130
    except BrokenPipeError:
        # The reader (head, less) has gone; nothing is lost that anyone wants.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except OSError as error:
        # A full disk or a folder that may not be written; the reason is the system's.
        named = "" if error.filename is None else f"{os.fsdecode(error.filename)}: "
        print(f"pydpend: {shortened(named)}{error.strerror or error}", file=sys.stderr)
        return 2
