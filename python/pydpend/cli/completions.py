"""Prints completions for a shell.

Where each shell looks for them:

  pydpend completions bash > ~/.local/share/bash-completion/completions/pydpend
  pydpend completions zsh > ~/.zfunc/_pydpend
  pydpend completions fish > ~/.config/fish/completions/pydpend.fish
"""

from __future__ import annotations

import argparse
from pathlib import Path

HELP = "completions for a shell, on standard output"

SHELLS = ("bash", "zsh", "fish", "tcsh", "powershell")


def add_arguments(p: argparse.ArgumentParser) -> None:
    """The command's arguments."""
    p.add_argument("shell", choices=SHELLS, help="whose completions")


def run(args: argparse.Namespace) -> int:
    """Prints them."""
    import shtab

    from pydpend.cli import parser

    whole = parser()
    _name_files(whole)
    print(shtab.complete(whole, args.shell))
    return 0


def _name_files(p: argparse.ArgumentParser) -> None:
    """Arguments that take words of no list complete to file names. argparse shows its arguments only here."""
    import shtab

    for action in p._actions:
        if isinstance(action, argparse._SubParsersAction):
            for sub in action.choices.values():
                _name_files(sub)
        elif action.nargs != 0 and action.choices is None and action.type in (None, str, Path):
            # shtab looks for an attribute that argparse does not declare.
            action.complete = shtab.FILE  # type: ignore[attr-defined]
