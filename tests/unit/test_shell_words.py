"""Commands that messages and reports print: pasted into a shell they name the same files, whatever these are called."""

from __future__ import annotations

import ast
import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest
from pydpend.analyse import Options
from pydpend.analyse.provenance import command
from pydpend.errors import Step
from pydpend.kinds import misplaced
from pydpend.report.content import in_lines
from pydpend.terminal import is_plain, shell_word

FILM = Path(__file__).parent.parent.parent / "fixtures" / "demo" / "drop.mp4"

NAMES = (
    b"plain.mp4",
    b"two words.mp4",
    b"it's $x `y`.mp4",
    b"dr\xf6p.mp4",
    b"a\x1b[31mb.mp4",
    b"it's \\ \xff\x1b.mp4",
    "\u202egnp.mp4".encode(),
    b"new\nline.mp4",
)


def given_to(words: str) -> list[bytes]:
    """The words that a shell gives to a program."""
    done = subprocess.run(["bash", "-c", f"printf '%s\\0' {words}"], capture_output=True, check=True)
    return done.stdout.split(b"\0")[:-1]


@pytest.mark.parametrize("name", NAMES)
def test_a_word_is_the_name_and_shows_itself(name: bytes) -> None:
    word = shell_word(os.fsdecode(name))
    assert is_plain(word)
    assert given_to(word) == [name]


@pytest.mark.parametrize("name", NAMES)
def test_the_next_command_can_be_pasted(name: bytes, tmp_path: Path) -> None:
    path = os.path.join(os.fsencode(tmp_path), name)
    shutil.copyfile(FILM, path)
    said = misplaced(os.fsdecode(path), ("angles",))
    assert said is not None
    track, angles = (part for part in said.parts if isinstance(part, Step))
    stem = os.path.splitext(path)[0]
    assert given_to(track.command) == [b"pydpend", b"track", path, b"-o", stem + b".parquet"]
    assert given_to(angles.command)[2:] == [stem + b".parquet", b"-o", stem + b"-angles.parquet"]
    (text,) = re.findall(r"^dp\.track\((.*)\)$", track.call, re.DOTALL)
    assert os.fsencode(ast.literal_eval(text)) == path


def test_the_report_s_command_can_be_pasted() -> None:
    inputs = tuple(map(os.fsdecode, NAMES))
    line = command(Options(inputs=inputs, start_s=-1.0), Path("out 1"))
    expected = [b"pydpend", b"analyse", *NAMES, b"-o", b"out 1", b"--start=-1.0"]
    assert given_to(line) == expected
    assert given_to(in_lines(line)) == expected
