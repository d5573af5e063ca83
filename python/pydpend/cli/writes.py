"""The files that a command writes: none that is there already is replaced unless ``--force`` says so."""

from __future__ import annotations

import argparse

from pydpend.output import AnyPath, check_new


def add_force(p: argparse.ArgumentParser) -> None:
    """The flag ``--force``, of every command that writes files."""
    p.add_argument("--force", action="store_true", help="replace files that are there already")


def check_files(args: argparse.Namespace, *files: AnyPath | None) -> None:
    """Raises ArgumentError for a file that must not be written; ``None`` is one that is not asked for."""
    check_new(files, replace=args.force)
