"""The parts of the site that are made from the programs and not written: commands, Python, contents.

A page says where they go by a comment, ``<!-- site: commands -->``, which GitHub does not show.
"""

from __future__ import annotations

import importlib
import itertools
import os
import re
import subprocess
import sys
from functools import partial
from pathlib import Path
from typing import Any

import pydpend as dp
from pydpend.citing import bibtex
from pydpend.cli import ALL

from tools import messages

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
PLACE = re.compile(r"^<!-- site: (\w+) -->$", re.M)


def connect(app: Any) -> None:
    """Has Sphinx fill the places of each page as it is read."""
    app.connect("source-read", _filled)


def _filled(app: Any, name: str, source: list[str]) -> None:
    page = DOCS / f"{name}.md"
    text = PLACE.sub(lambda place: PARTS[place[1]](), source[0])
    source[0] = relinked(text, page.parent, page.parent)


PAGES_OF = {
    "CHANGELOG.md": "docs/about/changelog.md",
    "CONTRIBUTING.md": "docs/about/contributing.md",
    "README.md": "docs/index.md",
    "crates/tracker/benches/README.md": "docs/validation/speed.md",
}
"""Files of the repository outside docs and their pages on the site."""


def relinked(text: str, written_in: Path, shown_in: Path) -> str:
    """A page's text with its links as from another folder, and to pages of the site where there are such."""

    def link(found: re.Match[str]) -> str:
        name, sign, anchor = found[1].partition("#")
        at = Path(os.path.normpath(written_in / name))
        if at.is_dir():
            at /= "README.md"
        at = ROOT / PAGES_OF.get(os.path.relpath(at, ROOT), at)
        return f"]({os.path.relpath(at, shown_in)}{sign}{anchor})"

    return re.sub(r"\]\((?!\w+:|#)([^)\s]+)\)", link, text)


def commands() -> str:
    """Each command of ``pydpend`` with all of its ``--help``, 100 columns wide."""
    wide = os.environ | {"COLUMNS": "100"}
    helps = {
        name: subprocess.run(
            [sys.executable, "-m", "pydpend", name, "--help"],
            env=wide,
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for name in sorted(ALL)
    }
    return "\n".join(f"## pydpend {name}\n\n```text\n{text.rstrip()}\n```\n" for name, text in helps.items())


def python() -> str:
    """Each public name of the package by the module that it lives in, from its docstring."""
    sections = []
    for module, names in dp._HOMES.items():
        about = (importlib.import_module(f"pydpend.{module}").__doc__ or "").strip().splitlines()[0]
        lines = [
            f"## {module.partition('.')[0].replace('_', ' ').capitalize()}",
            "",
            about,
            "",
            "```{eval-rst}",
        ]
        for name in names:
            found = getattr(dp, name)
            if isinstance(found, type):
                lines += [f".. autoclass:: pydpend.{name}"]
                lines += [] if issubclass(found, BaseException) else ["   :members:"]
            else:
                lines += [f".. autofunction:: pydpend.{name}"]
            lines += [""]
        sections.append("\n".join([*lines, "```", ""]))
    return "\n".join(sections)


def every_message() -> str:
    """The messages that the sources spell out, under the part that says them."""
    sections = []
    for part, said in itertools.groupby(messages.every(), lambda said: said.part):
        lines = [f"- {_literal(one.words)}" for one in said]
        sections.append("\n".join([f"## {part}", "", *lines, ""]))
    return "\n".join(sections)


def _literal(text: str) -> str:
    """Text in which Markdown finds nothing of its own but names in backquotes."""
    return re.sub(r"([\\*_\[\]<>#|$~{}])", r"\\\1", text)


def of_repository(name: str, page: str) -> str:
    """A page of the repository from outside docs, without its title."""
    text = (ROOT / name).read_text("utf-8").split("\n", 1)[1]
    return relinked(text, (ROOT / name).parent, (ROOT / page).parent)


def citation() -> str:
    """The entries for BibTeX, of this version."""
    return f"```text\n{bibtex(dp.__version__)}```"


PARTS = {
    "commands": commands,
    "python": python,
    "messages": every_message,
    "citation": citation,
    **{
        Path(page).stem: partial(of_repository, name, page)
        for name, page in PAGES_OF.items()
        if name != "README.md"
    },
}
