"""The program with all its texts in other words: each text of the sources is replaced, at each place by another one.

``python -m tests.support.reworded plain|other FOLDER`` runs commands on what the test put into FOLDER and prints as
JSON their exit statuses and what the pages are made of. What reads its own words does something else in the two.
"""

from __future__ import annotations

import ast
import contextlib
import importlib.abc
import importlib.machinery
import io
import json
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any

PROSE = re.compile(r"[A-Za-z]{2,},? [A-Za-z]{2,}")
WORD = re.compile(r"(?<![\\a-z])[a-z]{3,}")


class Reword(ast.NodeTransformer):
    """Shifts the letters of each text by a number that depends on where it stands."""

    def visit_Expr(self, node: ast.Expr) -> ast.AST:
        """A docstring is no text of the program."""
        return node if isinstance(node.value, ast.Constant) else self.generic_visit(node)

    def visit_Call(self, node: ast.Call) -> ast.AST:
        """Patterns are no texts."""
        of = node.func.value if isinstance(node.func, ast.Attribute) else None
        return node if isinstance(of, ast.Name) and of.id == "re" else self.generic_visit(node)

    def visit_keyword(self, node: ast.keyword) -> ast.AST:
        """matplotlib's places have names of several words."""
        return node if node.arg == "loc" else self.generic_visit(node)

    def visit_FormattedValue(self, node: ast.FormattedValue) -> ast.AST:
        """How a number is written stays."""
        node.value = self.visit(node.value)
        return node

    def visit_Constant(self, node: ast.Constant) -> ast.AST:
        """The text in other words."""
        if not isinstance(node.value, str) or not PROSE.search(node.value):
            return node
        shift = (7 * node.lineno + node.col_offset) % 25 + 1
        other = WORD.sub(lambda m: "".join(chr(97 + (ord(c) - 97 + shift) % 26) for c in m[0]), node.value)
        return ast.copy_location(ast.Constant(other), node)


class Loader(importlib.machinery.SourceFileLoader):
    """Loads a source file in other words, and no compiled file."""

    def get_code(self, fullname: str) -> CodeType:
        """The code of the reworded source."""
        tree = Reword().visit(ast.parse(self.get_data(self.path)))
        return compile(ast.fix_missing_locations(tree), self.path, "exec")


class Finder(importlib.abc.MetaPathFinder):
    """Finds the package's modules for `Loader`."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        """The module's place, with this loader; None for what is not the package's."""
        if fullname.partition(".")[0] != "pydpend":
            return None
        spec = importlib.machinery.PathFinder.find_spec(fullname, path, target)
        if spec is not None and isinstance(spec.loader, importlib.machinery.SourceFileLoader):
            spec.loader = Loader(spec.loader.name, spec.loader.path)
        return spec


def structure(folder: Path) -> Any:
    """What a page is made of, without its words."""
    from pydpend.report import page as parts
    from pydpend.report import report_page

    def shape(block: parts.Block) -> list[Any]:
        match block:
            case parts.Table():
                return [block.kind, len(block.header), len(block.rows)]
            case parts.Listing():
                return [block.kind, len(block.entries)]
            case parts.Chart():
                return [block.kind, block.id, len(block.series)]
            case _:
                return [block.kind]

    page = report_page(folder)
    return [len(page.warnings), {s.id: [shape(b) for b in s.blocks] for s in page.sections}]


def main(words: str, folder: Path) -> None:
    """Runs the commands of ``commands.json`` and prints what came of them."""
    if words == "other":
        sys.meta_path.insert(0, Finder())
    from pydpend.cli import main as run

    out = folder / words
    statuses, said = [], []
    for command in json.loads((folder / "commands.json").read_text("utf-8")):
        text = io.StringIO()
        with contextlib.redirect_stdout(text), contextlib.redirect_stderr(text):
            statuses.append(run([word.replace("OUT", str(out)) for word in command]))
        said.append(text.getvalue())
    pages = {run.name: structure(run) for run in sorted(out.iterdir()) if (run / "run.json").exists()}
    print(json.dumps({"statuses": statuses, "pages": pages, "said": said}))


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]))
