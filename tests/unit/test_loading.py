"""What is not needed is not loaded: a program starts with what its command uses, the package with its names."""

from __future__ import annotations

import ast
import json
import subprocess
import sys
from pathlib import Path

import pydpend as dp
import pytest

PACKAGE = Path(dp.__file__).parent
HEAVY = {"numpy", "scipy", "pyarrow", "matplotlib", "jinja2", "tqdm", "nptdms", "asyncio"}
"""Top-level packages that take tens of milliseconds each to load."""


def loaded(code: str) -> set[str]:
    """The heavy packages, and the modules of ours, that are loaded once some lines are run."""
    program = f"""
import json, sys
try:
    {code}
finally:
    print(json.dumps([n for n in sys.modules if n.startswith("pydpend.")
                      or n.partition(".")[0] in {HEAVY!r}]), file=sys.stderr)
"""
    words = [sys.executable, "-c", program]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    names: list[str] = json.loads(next(line for line in done.stderr.splitlines() if line.startswith("[")))
    return {n if n.startswith("pydpend.") else n.partition(".")[0] for n in names}


@pytest.mark.parametrize(
    "words",
    [
        ["--version"],
        ["--help"],
        ["help"],
        ["track", "--help"],
        ["info", "none.mp4"],
        ["plot", "--help"],
        ["angles", "--help"],
        ["no-command"],
    ],
)
def test_help_and_the_trackers_commands_load_nothing_heavy(words: list[str]) -> None:
    found = loaded(f"from pydpend.cli import main; main({words!r})")
    assert not found & HEAVY
    assert "pydpend._native" in found


def test_a_command_that_computes_loads_what_it_needs() -> None:
    """The lists above could be empty for another reason."""
    assert "numpy" in loaded("from pydpend.cli import main; main(['fit', 'none.csv', '-o', 'none'])")


def test_the_package_loads_a_name_when_it_is_used() -> None:
    assert loaded("import pydpend; dir(pydpend)") == set()
    assert loaded("import pydpend; pydpend.PydpendError") == {"pydpend.errors", "pydpend.terminal"}
    assert "numpy" in loaded("import pydpend; pydpend.Nodes")
    assert {"numpy", "pydpend.damping"} <= loaded("from pydpend import fit_damping")


def test_each_public_name_is_at_home_where_type_checkers_find_it() -> None:
    tree = ast.parse((PACKAGE / "__init__.py").read_text("utf-8"))
    checked = next(node for node in tree.body if isinstance(node, ast.If))
    imports = [node for node in checked.body if isinstance(node, ast.ImportFrom)]
    told = {str(n.module).removeprefix("pydpend."): tuple(a.name for a in n.names) for n in imports}
    assert {home: tuple(sorted(names)) for home, names in told.items()} == dp._HOMES
    assert sorted(name for names in told.values() for name in names) == sorted(dp.__all__)


def test_the_package_knows_its_names_and_no_others() -> None:
    assert {*dp.__all__, "__version__"} <= set(dir(dp))
    for name in dp.__all__:
        assert getattr(dp, name) is getattr(dp, name)
    assert dp.errors.PydpendError is dp.PydpendError
    with pytest.raises(AttributeError, match="module 'pydpend' has no attribute 'no_name'"):
        _ = dp.no_name  # type: ignore[attr-defined]
    with pytest.raises(ImportError, match="no_name"):
        from pydpend import no_name  # type: ignore[attr-defined]  # noqa: F401
