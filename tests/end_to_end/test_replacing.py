"""No command replaces a file that is there already unless ``--force`` says so."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from pydpend.cli import COMMANDS, main, parser
from pydpend.cli.words import options_of
from pydpend.errors import AnglesError, OptionError
from pydpend.kinematics import read_angles
from pydpend.number_words import numbers

from tests.end_to_end.test_output import angles, nodes, refused

DEMO = Path(__file__).parent.parent.parent / "fixtures" / "demo"

ZERO = ["--bodies", "upper,lower", "--zero", "reference_frame"]


def calibrating(at: Path) -> list[str]:
    return ["calibrate", str(DEMO / "calibration"), "-o", str(at / "c.json"), "--figure", str(at / "c.svg")]


def angles_as_csv(at: Path) -> list[str]:
    figures = ["--figure", str(at / "a.svg"), "--methods-figure", str(at / "m.svg")]
    return ["angles", str(at.parent / "nodes.parquet"), "-o", str(at / "a.csv"), *figures, *ZERO]


def angles_as_parquet(at: Path) -> list[str]:
    return ["angles", str(at.parent / "nodes.parquet"), "-o", str(at / "a.parquet"), *ZERO]


def comparing(at: Path) -> list[str]:
    given = ["--calibration", str(DEMO / "calibration")]
    return ["compare", str(DEMO / "motion.parquet"), str(DEMO / "encoder.csv"), *given, "-o", str(at)]


def exporting(at: Path) -> list[str]:
    return ["export", str(at.parent / "nodes.parquet"), "-o", str(at / "n.mat")]


@pytest.mark.parametrize("command", [calibrating, angles_as_csv, angles_as_parquet, comparing, exporting])
def test_each_file_that_a_command_writes_stops_it(
    command: Callable[[Path], list[str]], tmp_path: Path
) -> None:
    nodes().write(tmp_path / "nodes.parquet")
    out = tmp_path / "out"
    out.mkdir()
    words = command(out)
    assert main(words) == 0
    written = sorted(out.iterdir())
    assert written
    for file in written:
        shutil.rmtree(out)
        out.mkdir()
        file.write_text("mine")
        refused(words, f"{file}: it is there already. Choose another name, or replace it with --force")
        assert [(p, p.read_text()) for p in out.iterdir()] == [(file, "mine")]
    assert main([*words, "--force"]) == 0
    assert sorted(out.iterdir()) == written
    assert all(p.read_bytes() != b"mine" for p in written)


def test_a_figure_or_a_film_is_not_replaced(tmp_path: Path) -> None:
    (tmp_path / "mine.svg").write_text("mine")
    (tmp_path / "nowhere").mkdir()
    (tmp_path / "link.mp4").symlink_to(tmp_path / "nothing.mp4")
    refused(["plot", "energy", str(tmp_path / "nowhere"), "-o", str(tmp_path / "mine.svg")], "--force")
    # A link that leads nowhere is there, too.
    refused(["animate", str(tmp_path / "nowhere"), "-o", str(tmp_path / "link.mp4")], "--force")
    refused(["angles", "x.parquet", "-o", "a.csv", "--figure", "./a.csv"], "two outputs have this name")


def test_every_command_that_names_an_output_has_the_flag() -> None:
    """``analyse`` and ``batch`` go on with their folders, and take none that is not one."""
    (subparsers,) = [a for a in parser()._actions if a.dest == "command"]
    assert isinstance(subparsers.choices, dict)
    writing = {name for name in COMMANDS if "-o" in options_of(subparsers.choices[name])}
    forced = {name for name in COMMANDS if "--force" in options_of(subparsers.choices[name])}
    assert writing - forced == {"analyse", "batch"}


def test_a_folder_that_is_no_run_is_left_alone(tmp_path: Path) -> None:
    from pydpend.kinematics import write_angles

    write_angles(angles(), tmp_path / "angles.parquet")
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "report.html").write_text("mine")
    refused(
        ["analyse", str(tmp_path / "angles.parquet"), "-o", str(tmp_path / "run"), "--quiet"],
        "is not empty and not a run of pydpend",
    )
    assert (tmp_path / "run" / "report.html").read_text() == "mine"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["fit", "a.csv", "-o", "d", "--start", "0,125"], "--start: '0,125' is not a number. Write 0.125"),
        (["fit", "a.csv", "-o", "d", "--stop", ",5"], "--stop: ',5' is not a number. Write .5"),
        (["animate", "run", "-o", "a.mp4", "--length", "1_0"], "--length: '1_0' is not a number"),
        (["analyse", "a.csv", "-o", "d", "--threads", "2,5"], "--threads: '2,5' is not a whole number"),
        (
            ["predict", "a.csv", "--fit", "F", "-o", "d", "--windows", "0,125,5"],
            "0 s is no length of a window",
        ),
        (["predict", "a.csv", "--fit", "F", "-o", "d", "--windows", "1,05"], "1,05 may be one number or two"),
        (
            ["predict", "a.csv", "--fit", "F", "-o", "d", "--windows", "1,5"],
            "--windows: '1,5' may be one number or two. Write 1.5, or 1.0,5.0",
        ),
        (
            ["predict", "a.csv", "--fit", "F", "-o", "d", "--windows", " 12,25"],
            "Write 12.25, or 12.0,25.0",
        ),
        (["predict", "a.csv", "--fit", "F", "-o", "d", "--windows", "0,5;1"], "not a list of numbers"),
        (["angles", "N", "-o", "a.csv", "--zero", "12,05,-3,5"], "12,05 may be one number or two"),
        (["angles", "N", "-o", "a.csv", "--zero=-3,02"], "-3,02 may be one number or two"),
        (["calibrate", "c", "-o", "c.json", "--range-v", "0,05,10"], "0,05 may be one number or two"),
    ],
)
def test_decimal_commas_in_options_are_refused(
    words: list[str], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    nodes().write("nodes.parquet")
    refused(["nodes.parquet" if word == "N" else word for word in words], message)


def test_lists_of_numbers_are_read() -> None:
    assert numbers("0.5,1,2", "windows") == [0.5, 1.0, 2.0]
    assert numbers("-360, 0,1e2", "angles_deg") == [-360.0, 0.0, 100.0]
    for text in ("", "1,,2", "nan", "inf,1", "1,2,"):
        with pytest.raises(OptionError, match="is not a list of numbers"):
            numbers(text, "windows")


@pytest.mark.parametrize(
    ("words", "what"),
    [
        ("angles nodes.parquet -o -", "file"),
        ("fit angles.parquet -o -", "folder"),
        ("compare angles.parquet encoder.csv --calibration c.json -o -", "folder"),
        ("analyse angles.parquet -o -", "folder"),
        ("predict angles.parquet --fit F -o -", "folder"),
        ("export nodes.parquet -o -", "file"),
        ("animate run -o -", "file"),
    ],
)
def test_standard_output_is_no_output(
    words: str, what: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from pydpend.kinematics import write_angles

    monkeypatch.chdir(tmp_path)
    nodes().write("nodes.parquet")
    write_angles(angles(), tmp_path / "angles.parquet")
    (tmp_path / "encoder.csv").write_text("time_s,phi1_rad\n0,0\n")
    before = sorted(p.name for p in tmp_path.iterdir())
    ends = {"file": "the output is a file", "folder": "the results need a folder"}
    refused(words.split(), f"-: standard output is not possible: {ends[what]}")
    assert sorted(p.name for p in tmp_path.iterdir()) == before


@pytest.mark.parametrize("word", ["nan", "inf", "-inf", "1e400"])
def test_a_number_that_is_not_finite_is_the_options_fault(
    word: str, capsys: pytest.CaptureFixture[str]
) -> None:
    for given in (["fit", "a.csv", "--hanging"], ["analyse", "a.csv", "--hanging"], ["fit", "a.csv", "--start"],
                  ["animate", "run", "--speed"], ["export", "n.csv", "--px-per-m"]):  # fmt: skip
        assert main([*given[:-1], f"{given[-1]}={word}", "-o", "out"]) == 2
        assert f"{given[-1]}: {word!r} is not a finite number" in capsys.readouterr().err
    with pytest.raises(AnglesError, match=r"hanging_rad: .* is no angle at which links hang"):
        read_angles(DEMO / "motion.parquet", hanging_rad=float(word))
