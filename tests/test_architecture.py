"""Arrows go right only (docs/architecture.md): read from the imports, not from what anyone says."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PACKAGE = ROOT / "python" / "pydpend"

# From left to right. A module may import from its own group and from those to its left.
GROUPS: tuple[tuple[str, ...], ...] = (
    (
        "terminal",
        "output",
        "errors",
        "crossing",
        "_tracker",
        "kinds",
        "documents",
        "instants",
        "units",
        "delimited",
        "columns",
        "arrays",
        "series",
    ),
    ("nodes", "tracking", "filming", "scoring", "export", "components", "bearings"),
    ("coefficients", "model", "fit_options"),
    ("angles",),
    ("encoder",),
    ("simulate", "linear", "states"),
    ("decay", "energy", "damping", "trials"),
    ("plots",),
    ("report",),
    ("analyse",),
    ("cli",),
)
RANK = {name: i for i, group in enumerate(GROUPS) for name in group}


def python_imports(path: Path) -> set[str]:
    """First-level modules of pydpend that a file imports when it is loaded or run."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Import):
            found |= {a.name.split(".")[1] for a in node.names if a.name.startswith("pydpend.")}
        elif isinstance(node, ast.ImportFrom) and node.module is not None:
            if node.module == "pydpend":
                found |= {a.name for a in node.names}
            elif node.module.startswith("pydpend."):
                found.add(node.module.split(".")[1])
    return found


def top_modules() -> list[str]:
    names = {p.stem if p.is_file() else p.name for p in PACKAGE.iterdir()}
    return sorted(n for n in names if re.fullmatch(r"[a-z_]+", n) and n not in ("__init__", "__pycache__"))


@pytest.mark.parametrize("name", [n for n in top_modules() if not n.startswith("_") and n != "py"])
def test_python_arrows_go_right(name: str) -> None:
    assert name in RANK, f"{name} has no place in the flow: give it one in GROUPS"
    path = PACKAGE / name
    files = sorted(path.rglob("*.py")) if path.is_dir() else [path.with_suffix(".py")]
    for file in files:
        for imported in python_imports(file) - {name}:
            assert imported in RANK, f"{file.name} imports {imported}, which has no place in the flow"
            assert RANK[imported] <= RANK[name], (
                f"{file.name}: {name} may not import {imported}, to its right"
            )


def rust_uses(folder: Path) -> set[str]:
    """First-level modules that the files of a Rust module name with `crate::`, tests left out."""
    files = sorted(folder.rglob("*.rs")) if folder.is_dir() else [folder.with_suffix(".rs")]
    found: set[str] = set()
    for file in files:
        if file.name == "tests.rs" or "tests" in file.parts:
            continue
        code = file.read_text("utf-8").split("#[cfg(test)]")[0]
        code = re.sub(r"//.*", "", code)
        found |= set(re.findall(r"crate::([a-z_]+)", code))
        for block in re.findall(r"use crate::\{([^;]*)\};", code):
            found |= set(re.findall(r"(?:^|,)\s*([a-z_]+)(?:::|\s*(?=,|$))", re.sub(r"\{[^}]*\}", "", block)))
    return found


RUST_FORBIDDEN = {
    "frame": {"source", "detect", "track", "table", "pipeline", "rig", "store"},
    "source": {"detect", "track", "table", "pipeline", "rig", "store"},
    "detect": {"source", "track", "table", "pipeline", "store", "film"},
    "rigid": {"source", "track", "discover", "table", "pipeline", "film", "store"},
    "track": {"source", "discover", "table", "pipeline", "film"},
    "table": {"source", "pipeline", "film"},
}


@pytest.mark.parametrize("module", sorted(RUST_FORBIDDEN))
def test_rust_arrows_go_right(module: str) -> None:
    wrong = rust_uses(ROOT / "crates" / "tracker" / "src" / module) & RUST_FORBIDDEN[module]
    if module == "source":
        wrong -= {"rig"}
    assert not wrong, f"{module} may not use {sorted(wrong)}"


def test_the_tracker_knows_no_pendulum_physics() -> None:
    words = re.compile(r"\b(dynamics::|gravity|mu_v|torque)\b")
    for file in sorted((ROOT / "crates" / "tracker" / "src").rglob("*.rs")):
        code = re.sub(r"//.*", "", file.read_text("utf-8"))
        assert not words.search(code), f"{file.name}: {words.search(code)}"


def test_the_crates_below_know_no_python() -> None:
    for crate in ("tracker", "dynamics"):
        manifest = (ROOT / "crates" / crate / "Cargo.toml").read_text("utf-8")
        assert "pyo3" not in manifest
        assert "numpy" not in manifest
