"""What the set-up scripts say where something is missing: one line, with what to do, and nothing half made is left."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """A source tree with nothing but what the scripts read, and a ``bin`` that goes before all others."""
    shutil.copytree(ROOT / "tools", tmp_path / "tools")
    for name in ("Cargo.toml", "pyproject.toml"):
        shutil.copy(ROOT / name, tmp_path)
    (tmp_path / "bin").mkdir()
    return tmp_path


def program(tree: Path, name: str, body: str) -> None:
    path = tree / "bin" / name
    path.write_text(f"#!/bin/bash\n{body}\n")
    path.chmod(0o755)


def said(tree: Path, script: str, *arguments: str, **environment: str) -> str:
    """The one line with which a script refuses."""
    path = f"{tree / 'bin'}:{os.environ['PATH']}"
    run = subprocess.run(
        [str(tree / "tools" / script), *arguments],
        capture_output=True,
        text=True,
        env={**os.environ, "PATH": path, **environment},
        timeout=60,
    )
    assert run.returncode == 1, run
    lines = run.stderr.strip().splitlines()
    assert len(lines) == 1, run.stderr
    return lines[0]


def test_an_old_cargo_is_told_from_none(tree: Path) -> None:
    program(tree, "cargo", "echo 'cargo 1.63.0 (Debian)'")
    assert said(tree, "ready.sh") == "cargo is 1.63.0, and 1.89 or later is needed. Run: rustup update stable"
    # With nothing on the path but what the script itself needs.
    (tree / "bin" / "cargo").unlink()
    for name in ("bash", "dirname"):
        (tree / "bin" / name).symlink_to(shutil.which(name) or name)
    only = said(tree, "ready.sh", PATH=str(tree / "bin"))
    assert only == "cargo is missing. Install Rust with rustup (https://rustup.rs)."


def test_a_missing_library_is_named(tree: Path) -> None:
    program(tree, "cargo", "echo cargo 1.99.0")
    program(tree, "pkg-config", '[ "$2" != libswscale ]')
    line = said(tree, "ready.sh")
    assert line.startswith("pkg-config does not find libswscale. Install its development package")


def test_a_home_that_cannot_be_written_is_named(tree: Path) -> None:
    program(tree, "cargo", "echo cargo 1.99.0")
    program(tree, "pkg-config", "true")
    (tree / "file").touch()
    line = said(tree, "ready.sh", CARGO_HOME=str(tree / "file"))
    assert f"{tree}/file cannot be written to" in line
    assert line.endswith(f"export CARGO_HOME={tree}/target/cargo-home")


def test_a_full_disk_is_told_before_the_build(tree: Path) -> None:
    program(tree, "cargo", "echo cargo 1.99.0")
    program(tree, "pkg-config", "true")
    program(tree, "df", "printf 'Filesystem\\n/dev/x 100 99 1200000 1%% /\\n'")
    line = said(tree, "ready.sh", CARGO_HOME=str(tree / "home"))
    assert line.startswith(f"1200 MB are free in {tree}, and a first build takes 3500 MB.")


def test_an_old_python_is_refused(tree: Path) -> None:
    program(tree, "python3.10", "exit 1")
    line = said(tree, "venv.sh", PYTHON="python3.10")
    assert line.startswith("python3.10 is not Python 3.11 or later. Install it, or name one")


def test_an_environment_that_was_not_made_whole_is_not_kept(tree: Path) -> None:
    # As Debian's python3 does without python3-venv: it makes the folder with the interpreter, and then fails.
    program(
        tree,
        "python3",
        '[ "$1" = -c ] && exit 0; mkdir -p .venv/bin; echo exit 1 >.venv/bin/python; echo no ensurepip; exit 1',
    )
    line = said(tree, "venv.sh", PYTHON="python3")
    assert line == "python3 cannot make .venv (no ensurepip). Install python3-venv, or free some space."
    assert not (tree / ".venv").exists()


@pytest.mark.parametrize(
    ("pip", "begins"),
    [
        (
            "ERROR: NewConnectionError: Failed to establish a new connection",
            "pip cannot reach the package index.",
        ),
        ("ERROR: [Errno 28] No space left on device", "The disk is full."),
    ],
)
def test_what_kept_pip_from_installing_is_one_line(tree: Path, pip: str, begins: str) -> None:
    folder = tree / ".venv" / "bin"
    folder.mkdir(parents=True)
    (folder / "python").write_text(f"#!/bin/bash\necho many words\necho '{pip}' >&2\nexit 1\n")
    (folder / "python").chmod(0o755)
    assert said(tree, "pip.sh", "numpy").startswith(begins)
