"""Which file needs which, read from the `use` paths of a crate and from the imports of the package.

`.venv/bin/python -m tests.support.module_graph` prints the layers of each: a line needs only the lines above it.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).parent.parent.parent
PACKAGE = ROOT / "python" / "pydpend"
CRATES = {
    "tracker": ROOT / "crates" / "tracker" / "src",
    "dynamics": ROOT / "crates" / "dynamics" / "src",
    "threads": ROOT / "crates" / "threads" / "src",
    "pydpend": ROOT / "crates" / "pydpend" / "src",
}

Module = tuple[str, ...]
Graph = dict[Module, set[Module]]


def circles(graph: Graph) -> list[list[Module]]:
    """Modules that need each other, directly or through others (Tarjan's strongly connected components)."""
    order: dict[Module, int] = {}
    low: dict[Module, int] = {}
    stack: list[Module] = []
    found: list[list[Module]] = []

    def visit(module: Module) -> None:
        order[module] = low[module] = len(order)
        stack.append(module)
        for needed in sorted(graph[module]):
            if needed not in order:
                visit(needed)
            if needed in stack:
                low[module] = min(low[module], low[needed])
        if low[module] == order[module]:
            circle = stack[stack.index(module) :]
            del stack[stack.index(module) :]
            if len(circle) > 1:
                found.append(sorted(circle))

    for module in sorted(graph):
        if module not in order:
            visit(module)
    return found


def layers(graph: Graph) -> list[list[Module]]:
    """Modules by the longest way down to one that needs nothing; the graph has no circles."""
    depth: dict[Module, int] = {}

    def of(module: Module) -> int:
        if module not in depth:
            depth[module] = 1 + max((of(needed) for needed in graph[module]), default=-1)
        return depth[module]

    return [sorted(m for m in graph if of(m) == d) for d in range(1 + max(map(of, graph), default=-1))]


def rooms(graph: Graph) -> Graph:
    """The same between first-level modules."""
    found: Graph = {module[:1]: set() for module in graph if module}
    for module, needed in graph.items():
        if module:
            found[module[:1]] |= {n[:1] for n in needed if n} - {module[:1]}
    return found


def rust_files(source: Path) -> dict[Module, Path]:
    """The files of a crate without its tests; `mod.rs`, `lib.rs` and `main.rs` are the module of their folder."""
    found: dict[Module, Path] = {}
    for file in sorted(source.rglob("*.rs")):
        parts = file.relative_to(source).with_suffix("").parts
        if parts[-1] in ("mod", "lib", "main"):
            parts = parts[:-1]
        if "tests" not in parts and "bin" not in parts:
            found[parts] = file
    return found


def rust_code(file: Path) -> str:
    """A file without comments and without what is compiled for tests only."""
    code = re.sub(r"//[^\n]*", "", file.read_text("utf-8"))
    while (start := re.search(r"#\[cfg\(test\)\]\s*", code)) is not None:
        end, depth = start.end(), 0
        while not (depth == 0 and code[end] in ";}"):
            depth += (code[end] == "{") - (code[end] == "}")
            end += 1 if not (depth == 0 and code[end] == "}") else 0
        code = code[: start.start()] + code[end + 1 :]
    return code


def single_paths(tree: str) -> list[tuple[list[str], str]]:
    """A `use` tree as its paths, each with the name that it binds."""
    tree = tree.strip()
    nested = re.fullmatch(r"(.*?)\{(.*)\}", tree, re.S)
    if nested is None:
        path, _, alias = (part.strip() for part in tree.partition(" as "))
        names = [name.strip() for name in path.split("::") if name.strip() not in ("", "self")] or ["self"]
        return [(["self", *names] if path.startswith("self::") else names, alias or names[-1])]
    items, depth = [""], 0
    for char in nested.group(2):
        depth += (char == "{") - (char == "}")
        if char == "," and depth == 0:
            items.append("")
        else:
            items[-1] += char
    return [pair for item in items if item.strip() for pair in single_paths(nested.group(1) + item.strip())]


class Crate:
    """The files of a crate and what each names."""

    def __init__(self, source: Path) -> None:
        self.files = rust_files(source)
        self.code = {module: rust_code(file) for module, file in self.files.items()}
        self.bound: dict[Module, dict[str, Module]] = {}
        for module, code in self.code.items():
            self.bound[module] = {}
            for tree in re.findall(r"\buse ([^;]+);", code):
                for path, name in single_paths(tree):
                    target = self.absolute(module, path, follow=False)
                    if target is not None:
                        self.bound[module][name] = target

    def absolute(self, module: Module, path: list[str], follow: bool = True) -> Module | None:
        """A path from the crate's root; `None` if it leads out of the crate."""
        first, rest = path[0], tuple(path[1:])
        if first in ("crate", "self"):
            return (module if first == "self" else ()) + rest
        if first == "super":
            up = 1 + next((k for k, name in enumerate(rest) if name != "super"), len(rest))
            return module[: len(module) - up] + rest[up - 1 :]
        if follow and first in self.bound[module]:
            return self.bound[module][first] + rest
        return (*module, first, *rest) if (*module, first) in self.files else None

    def home(self, path: Module) -> Module | None:
        """The file that defines what a path names, found through re-exports; `None` for a file's own name."""
        for _ in range(8):
            known = max(k for k in range(len(path) + 1) if path[:k] in self.files)
            if known == len(path):
                return None
            target = self.bound[path[:known]].get(path[known])
            if target is None or target == path[: known + 1]:
                return path[:known]
            path = target + path[known + 1 :]
        raise ValueError(f"re-exports of {'::'.join(path)} do not end")

    def graph(self) -> Graph:
        """What each file needs: of every path in it, and of every name that it uses, the file that defines it."""
        found: Graph = {}
        for module, code in self.code.items():
            uses = [
                path
                for path in self.bound[module].values()
                # A door hands its own folder on; that is no need.
                if not (self.is_door(module) and path[: len(module)] == module)
            ]
            body = re.sub(r"\buse [^;]+;", "", code)
            paths = (self.absolute(module, path.split("::")) for path in re.findall(r"\b\w+(?:::\w+)+", body))
            homes = {self.home(path) for path in [*uses, *paths] if path is not None}
            found[module] = {home for home in homes if home is not None and home != module}
        return found

    def is_door(self, module: Module) -> bool:
        """Whether a file is the front of a folder, which re-exports."""
        return self.files[module].stem in ("mod", "lib", "main")

    def defined(self, module: Module) -> list[str]:
        """What a file defines beside modules and re-exports."""
        item = r"^(?:pub(?:\([a-z ]+\))? )?(?:unsafe )?((?:fn|struct|enum|union|const|static|trait|impl|type)\b[^\n]*)"
        return re.findall(item, self.code[module], re.M)


def python_graph(package: Path = PACKAGE) -> Graph:
    """What each file of the package imports, when it is loaded or run; what is for type checkers only is left out."""
    files = {tuple(p.relative_to(package).with_suffix("").parts): p for p in sorted(package.rglob("*.py"))}
    files = {(m[:-1] if m[-1] == "__init__" else m): p for m, p in files.items()}
    found: Graph = {}
    for module, file in files.items():
        found[module] = set()
        for node in ast.walk(ast.parse(file.read_text("utf-8"))):
            if isinstance(node, ast.Import):
                names: Iterable[str] = (alias.name for alias in node.names)
            elif isinstance(node, ast.ImportFrom) and node.module is not None:
                names = (f"{node.module}.{alias.name}" for alias in node.names)
            else:
                continue
            for path in (tuple(name.split(".")) for name in names):
                if path[0] == package.name:
                    known = max(k for k in range(len(path)) if path[1 : k + 1] in files)
                    found[module].add(path[1 : known + 1])
        found[module] -= {module, ()}
    return found


def written(graph: Graph) -> str:
    """The layers as lines of text, the lowest first."""
    lines = []
    for depth, layer in enumerate(layers(graph)):
        lines.append(f"{depth:3}  " + "  ".join("::".join(module) or "(front)" for module in layer))
    return "\n".join(lines)


if __name__ == "__main__":
    for crate, source in CRATES.items():
        graph = Crate(source).graph()
        print(f"{crate}, rooms\n{written(rooms(graph))}\n{crate}, files\n{written(graph)}\n")
    print(f"pydpend, rooms\n{written(rooms(python_graph()))}\npydpend, files\n{written(python_graph())}")
