"""The end of a text: a number that a cut shortened is doubted, a line that a program wrote without an end is not."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pydpend as dp
import pytest
from pydpend.cli import main
from pydpend.plain_text import doubt

FORMS = {"{:.3f},{:.4f}": ",", "{:.3f};{:.6e}": ";", "{:.3f} {:.4f}": " ", "{:.3f}\t{:8.5f}": "\t"}
"""Forms of a line, and what parts their fields."""


def text_of(form: str, separator: str, rows: int = 30) -> str:
    values = 2.7 + 0.01 * np.random.default_rng(1).standard_normal(rows)
    lines = [form.format(k / 1000, v) for k, v in enumerate(values)]
    return f"time_s{separator}voltage_v\n" + "\n".join(lines)


def tried(path: Path, text: str) -> tuple[str, str]:
    """The warning and the error of reading a text."""
    path.write_text(text)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        try:
            notes = dp.read_encoder(path).notes
        except dp.PydpendError as problem:
            return "", str(problem)
    told = "".join(str(w.message) for w in said)
    assert all(issubclass(w.category, dp.RecordingWarning) for w in said)
    assert not told or any(note in told for note in notes)
    return told, ""


@pytest.mark.parametrize(("form", "separator"), FORMS.items())
def test_a_table_cut_inside_its_last_line_is_doubted_or_refused(
    form: str, separator: str, tmp_path: Path
) -> None:
    whole = text_of(form, separator)
    assert tried(tmp_path / "e.csv", whole) == ("", "") == tried(tmp_path / "e.csv", whole + "\n")
    # Up to the whole last line: then the file ends as a shorter one would.
    for cut in range(1, len(whole.rpartition("\n")[2])):
        warned, refused = tried(tmp_path / "e.csv", whole[:-cut])
        assert "line 31" in warned + refused, (cut, whole[-12:])
        assert "cut off there" in warned + refused or "is not a number" in refused


@pytest.mark.parametrize(
    ("above", "last", "is_doubted"),
    [
        (["0.5", "1", "0.25", "2"], "1", False),  # as short as another
        (["0.5", "0.25", "0.75", "0.125"], "1", True),
        (["1.5", "2.5", "3.5"], "4.", True),
        (["1.", "2.", "3."], "4.", False),  # a program that writes no digit after a point
        (["98", "99", "100", "101"], "10", True),  # falls back
        (["0", "1", "0", "1"], "1", False),
        (["1.25", "1.50"], "1.", False),  # too few to say
        (["up", "down", "up", "up"], "u", False),  # words
        (["", "", "", "1.25"], "", False),
    ],
)
def test_what_is_doubted_of_a_last_field(above: list[str], last: str, is_doubted: bool) -> None:
    text = "\n".join(["a,b", *(f"7,{field}" for field in above), f"7,{last}"])
    assert bool(doubt(text, 1, ",")) is is_doubted
    assert doubt(text + "\n", 1, ",") == ""


def test_the_command_line_says_so_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for turns in (-1, 0, 1):
        values = 2.5 + 0.65 * turns + 1e-4 * np.random.default_rng(turns + 1).standard_normal(40)
        lines = "\n".join(f"{k / 1000:.3f},{v:.5f}" for k, v in enumerate(values))
        (tmp_path / f"hold_{360 * turns:+d}deg.csv").write_text(
            f"time_s,voltage_v\n{lines}"[: -3 * (turns == 0) or None]
        )
    holds = [str(p) for p in sorted(tmp_path.glob("hold*"))]
    assert main(["calibrate", *holds, "-o", str(tmp_path / "c.json")]) == 0
    said = capsys.readouterr().err
    assert said.count("warning: ") == 1
    assert "hold_+0deg.csv, line 41: the file ends with" in said
    assert "Warning" not in said
