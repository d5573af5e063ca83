"""The files that a command reads, so that none of them is replaced by what it writes."""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pydpend.errors import SourceError

WRITTEN = ("output", "figure", "methods_figure")
"""Arguments that name what is written."""


def read_by(args: argparse.Namespace) -> Iterator[Path]:
    """Files that the arguments name or lead to. A run folder leads to the recordings that it was made from."""
    from pydpend.run_folder import RECORD

    for name, value in vars(args).items():
        if name in WRITTEN:
            continue
        for word in value if isinstance(value, (list, tuple)) else [value]:
            if not isinstance(word, (str, Path)) or not str(word):
                continue
            path = Path(word)
            try:
                there = path.exists()
            except (OSError, ValueError):
                # A list of words may be longer than any name.
                continue
            if there:
                yield from _run_folder(path) if (path / RECORD).exists() else _files(path)


def _files(path: Path) -> Iterator[Path]:
    from pydpend._native import recording_files

    yield path
    if path.is_file():
        try:
            yield from recording_files(path)
        except SourceError:
            # The command itself says what is wrong with it.
            return


def _run_folder(path: Path) -> Iterator[Path]:
    from pydpend.run_folder import RECORD

    try:
        run: Any = json.loads((path / RECORD).read_text("utf-8"))
        stages = [name for done in run["stages"].values() for name in done["files"]]
        inputs = [str(i["path"]) for i in run["facts"]["inputs"]]
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return
    yield path / RECORD
    for name in stages:
        yield path / name
    for name in inputs:
        if Path(name).exists():
            yield from _files(Path(name))
