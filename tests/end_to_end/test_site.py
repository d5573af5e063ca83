"""The site is made without a warning; every page is reached from its front page by links that lead somewhere."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote

import pydpend as dp
import pytest
from pydpend import errors
from pydpend.citing import bibtex
from pydpend.cli import ALL
from pydpend.fit_status import FitStatus
from pydpend.marker_status import STATUS_WORDS

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The whole site; warnings are errors, and no proxy or server is there to ask."""
    folder = tmp_path_factory.mktemp("site")
    nowhere = dict.fromkeys(("http_proxy", "https_proxy", "HTTP_PROXY", "HTTPS_PROXY"), "http://127.0.0.1:9")
    strictly = ["-q", "-W", "--keep-going", "-D", "nb_execution_mode=off", "-d", f"{folder}/trees"]
    done = subprocess.run(
        [sys.executable, "-m", "sphinx", *strictly, "docs", f"{folder}/html"],
        cwd=ROOT,
        env=os.environ | nowhere,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return folder / "html"


class Page(HTMLParser):
    """The links, pictures and places of a page."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.targets: list[str] = []
        self.loaded: list[str] = []
        self.places: set[str] = set()
        self.feed(path.read_text("utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attrs}
        self.places |= {given[name] for name in ("id", "name") if name in given}
        if tag == "a" and "href" in given:
            self.targets.append(given["href"])
        if tag in ("img", "script", "iframe") and "src" in given:
            self.loaded.append(given["src"])
        if tag == "link" and given.get("rel") in ("stylesheet", "icon"):
            self.loaded.append(given["href"])


def local(targets: list[str]) -> Iterator[tuple[str, str]]:
    """File and place of each target that is on the site."""
    for target in targets:
        if not re.match(r"\w+:", target):
            name, _, place = target.partition("#")
            yield unquote(name.partition("?")[0]), unquote(place)


def test_every_page_is_reached_and_every_link_leads_somewhere(site: Path) -> None:
    pages: dict[Path, Page] = {}
    waiting = [site / "index.html"]
    dead = []
    while waiting:
        path = waiting.pop()
        if path in pages:
            continue
        page = pages[path] = Page(path)
        for name, _ in local([*page.targets, *page.loaded]):
            to = (path.parent / name).resolve() if name else path
            if not to.exists():
                dead.append(f"{path.name}: {name}")
            elif to.suffix == ".html":
                waiting.append(to)
    for path, page in pages.items():
        for name, place in local(page.targets):
            to = (path.parent / name).resolve() if name else path
            if place and to in pages and place not in pages[to].places:
                dead.append(f"{path.name}: {name}#{place}")
    assert dead == []
    written = {p.relative_to(DOCS).with_suffix(".html") for p in DOCS.rglob("*.md")} - {Path("README.html")}
    assert {p.relative_to(site) for p in pages} >= written


def test_nothing_is_loaded_from_elsewhere(site: Path) -> None:
    asked = {
        src
        for path in site.rglob("*.html")
        for src in Page(path).loaded
        if re.match(r"(\w+:)?//", src)
    }  # fmt: skip
    assert asked == set()


def test_the_contents_of_the_site_name_each_page(site: Path) -> None:
    front = Page(site / "index.html")
    named = {name for name, _ in local(front.targets)}
    written = {str(p.relative_to(DOCS).with_suffix(".html")) for p in DOCS.rglob("*.md")}
    assert sorted(written - named - {"README.html", "index.html"}) == []


def test_commands_and_public_names_are_on_their_pages(site: Path) -> None:
    commands = Page(site / "reference/commands.html").places
    assert {f"pydpend-{name}" for name in ALL} <= commands
    python = Page(site / "reference/python.html").places
    assert {f"pydpend.{name}" for name in dp.__all__} <= python


def kinds_of_fault() -> list[str]:
    """The names of `FaultKind`, from its source."""
    source = (ROOT / "crates/tracker/src/error.rs").read_text("utf-8")
    return re.findall(r'FaultKind::\w+ => "(\w+)"', source)


def test_troubleshooting_has_an_entry_for_each_kind_and_no_other() -> None:
    text = (DOCS / "troubleshooting.md").read_text("utf-8")
    sections = {
        part.split("\n", 1)[0]: re.findall(r"^### (.*)$", part, re.M) for part in text.split("\n## ")[1:]
    }
    raised = [
        name
        for name, value in vars(errors).items()
        if isinstance(value, type) and issubclass(value, errors.PydpendError)
    ]
    assert sections == {
        "Often asked": [],
        "Exit status": ["0", "1", "2", "130"],
        "Kinds of the tracker's errors": kinds_of_fault(),
        "Errors in Python": raised,
        "Warnings": ["RecordingWarning", "ModelWarning", "note"],
        "What became of a marker": [
            *(STATUS_WORDS[k] for k in (1, 2)),
            "missing from a frame",
            *STATUS_WORDS[3:],
        ],
        "How a fit ended": [status.value for status in FitStatus],
    }
    warned = re.findall(
        r"^class (\w+)\(UserWarning\)", "\n".join(p.read_text("utf-8") for p in python_sources()), re.M
    )
    assert sorted(warned) == ["ModelWarning", "RecordingWarning"]


def python_sources() -> list[Path]:
    """The package's modules."""
    return sorted((ROOT / "python/pydpend").rglob("*.py"))


def test_every_refusal_with_words_is_listed(site: Path) -> None:
    page = re.sub(r"<[^>]*>", "", (site / "reference/messages.html").read_text("utf-8"))
    # One of each way in which sources make a message: Python's fault and bare error, Rust's with and without advice.
    for words in (
        "there is no header line with the names",
        "there is no free decay: the links move by",
        "it is there already. Choose another name, or replace it with",
        "the header is cut or points outside the file. Copy the recording again",
    ):
        assert words in page, words
    listed = page.count("…")
    assert listed > 500


def test_the_entries_for_bibtex_say_what_the_citation_file_says() -> None:
    cff = (ROOT / "CITATION.cff").read_text("utf-8")
    (title, paper) = re.findall(r'^ *-? *title: "?([^"\n]*)"?$', cff, re.M)
    entry = bibtex("1.2.3")
    assert f"{{{title}}}" in entry
    assert f"{{{paper}}}" in entry
    assert "{1.2.3}" in entry
    for name in re.findall(r"family-names: (\w+)", cff):
        assert name in entry
