"""The command line ``pydpend``: one module per command, this dispatcher, and nothing else.

A command's module has ``HELP`` (one line), ``add_arguments(parser)`` and ``run(args) -> int``.
Exit status: 0 done; 1 done, but something was left out and said; 2 an error, in one line on stderr;
130 interrupted.
"""

from __future__ import annotations

import argparse
import importlib
import os
import signal
import sys

from pydpend.errors import PydpendError

COMMANDS: tuple[str, ...] = (
    "analyse",
    "angles",
    "calibrate",
    "compare",
    "fit",
    "predict",
    "plot",
    "animate",
    "export",
    "completions",
)


def _version() -> str:
    from pydpend import _tracker

    return _tracker.VERSION


def parser() -> argparse.ArgumentParser:
    """The whole command line. Imports each command's module, which imports nothing heavy at its top."""
    top = argparse.ArgumentParser(
        prog="pydpend",
        description="From node tables and angles to encoder comparison, damping and a report.",
    )
    top.add_argument("--version", action="version", version=f"pydpend {_version()}")
    commands = top.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name in COMMANDS:
        module = importlib.import_module(f"pydpend.cli.{name}")
        sub = commands.add_parser(
            name,
            help=module.HELP,
            description=module.__doc__,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        module.add_arguments(sub)
        sub.set_defaults(run=module.run)
    return top


def _look_up_numpy() -> None:
    """Lets the compiled half find NumPy's C interface with Ctrl-C held back: interrupted there, it would panic."""
    held = {signal.SIGINT}
    signal.pthread_sigmask(signal.SIG_BLOCK, held)
    try:
        import numpy as np

        from pydpend import _tracker
        from pydpend.coefficients import parameters
        from pydpend.model import derived

        _tracker.unit_powers(parameters(derived("A")), np.zeros((0, 4)), np.zeros((0, 2)))
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, held)


def main(argv: list[str] | None = None) -> int:
    """Runs one command and returns its exit status."""
    args = parser().parse_args(argv)
    try:
        _look_up_numpy()
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


if __name__ == "__main__":
    sys.exit(main())
