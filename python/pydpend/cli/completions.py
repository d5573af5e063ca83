"""Prints completions for a shell.

Where each shell looks for them:

  pydpend completions bash > ~/.local/share/bash-completion/completions/pydpend
  pydpend completions zsh > ~/.zfunc/_pydpend
  pydpend completions fish > ~/.config/fish/completions/pydpend.fish
"""

from __future__ import annotations

import argparse

HELP = "completions for a shell, on standard output"

SHELLS = ("bash", "zsh", "fish", "tcsh", "powershell")


def add_arguments(p: argparse.ArgumentParser) -> None:
    """The command's arguments."""
    p.add_argument("shell", choices=SHELLS, help="whose completions")


def run(args: argparse.Namespace) -> int:
    """Prints them."""
    import shtab

    from pydpend.cli import parser

    print(shtab.complete(parser(), args.shell))
    return 0
