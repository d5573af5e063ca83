"""Links between the pages lead somewhere, sources name pages that are there, and the index names each page."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = sorted(
    [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *ROOT.glob("crates/*/benches/*.md")],
)


def anchors(page: Path) -> set[str]:
    """The anchors that GitHub gives the headings of a page."""
    headings = re.findall(r"^#+ (.*)$", page.read_text("utf-8"), re.M)
    return {re.sub(r"[^\w\- ]", "", h.lower()).replace(" ", "-") for h in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_every_link_of_a_page_leads_somewhere(page: Path) -> None:
    text = re.sub(r"^```.*?^```$", "", page.read_text("utf-8"), flags=re.M | re.S)
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if "://" in target:
            continue
        name, _, anchor = target.partition("#")
        to = page if not name else page.parent / name
        assert to.exists(), f"{page}: {target}"
        assert not anchor or anchor in anchors(to), f"{page}: {target}"


def test_every_page_that_a_source_names_is_there() -> None:
    named = subprocess.run(
        ["git", "grep", "-hoE", r"\bdocs/[a-zA-Z0-9_/-]+\.(md|toml|png)"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    ).stdout.split()
    assert len(named) > 50
    assert sorted({name for name in named if not (ROOT / name).exists()}) == []


def test_the_indices_name_every_page() -> None:
    docs = ROOT / "docs"
    linked = set()
    for index in (docs / "README.md", docs / "validation/README.md", docs / "decisions/README.md"):
        for target in re.findall(r"\]\(([^)\s#]+)", index.read_text("utf-8")):
            linked.add((index.parent / target).resolve())
    left_out = {page.resolve() for page in docs.rglob("*.md")} - linked
    left_out -= {(docs / name).resolve() for name in ("README.md", "index.md")}
    assert sorted(left_out) == []


def test_each_decision_has_a_number_of_its_own() -> None:
    numbers = [p.name[:4] for p in sorted((ROOT / "docs/decisions").glob("0*.md"))]
    assert len(set(numbers)) == len(numbers)


# Openings that name nothing: the noun stands elsewhere.
RIDDLES = r"(What|It|They|This|That|Those|These|The same)\b"
RUST_RIDDLE = re.compile(r"\s*//[/!] " + RIDDLES)
PYTHON_RIDDLE = re.compile(r'\s*"""' + RIDDLES)


def test_no_documentation_opens_without_a_noun() -> None:
    found = []
    for file in sorted([*(ROOT / "crates").rglob("*.rs"), *(ROOT / "python").rglob("*.py")]):
        riddle = RUST_RIDDLE if file.suffix == ".rs" else PYTHON_RIDDLE
        before = ""
        for number, line in enumerate(file.read_text("utf-8").splitlines(), 1):
            if riddle.match(line) and not before.lstrip().startswith(("///", "//!")):
                found.append(f"{file.relative_to(ROOT)}:{number}: {line.strip()}")
            before = line
    assert found == []
