"""The command line as a whole: help that teaches, completions that work, errors that name the flag."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from pydpend.cli import COMMANDS, main, parser
from pydpend.cli.completions import SHELLS
from pydpend.cli.plot import FIGURES
from pydpend.plots.folder import DRAWINGS

ROOT = Path(__file__).parent.parent.parent
DEMO = ROOT / "fixtures" / "demo"
TRACKER = ROOT / "target" / "release" / "tracker"


@pytest.mark.parametrize("command", COMMANDS)
def test_every_help_has_an_example_that_the_parser_takes(
    command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as left:
        main([command, "--help"])
    assert left.value.code == 0
    shown = capsys.readouterr().out
    examples = [line.split() for line in shown.splitlines() if line.startswith(f"  pydpend {command} ")]
    assert examples, shown
    for words in examples:
        words = words[1 : words.index(">") if ">" in words else None]
        parser().parse_args(words)


@pytest.mark.parametrize(
    "command", ["info", "setup", "track", "overlay", "check", "film", "score", "completions"]
)
def test_every_help_of_the_tracker_has_an_example(command: str) -> None:
    shown = subprocess.run([TRACKER, command, "--help"], capture_output=True, text=True, check=True).stdout
    text, _, below = shown.partition("Examples:")
    examples = [line.split() for line in below.splitlines() if line.startswith(f"  tracker {command} ")]
    assert examples, shown
    for words in examples:
        # Every flag of an example is one that the help explains.
        assert all(word in text for word in words if word.startswith("-")), words


def test_the_figures_of_the_command_are_those_of_the_folder() -> None:
    assert tuple(DRAWINGS) == FIGURES


@pytest.mark.parametrize("shell", SHELLS)
def test_completions(shell: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["completions", shell]) == 0
    text = capsys.readouterr().out
    assert all(command in text for command in COMMANDS)
    assert "calibration" in text


def test_bash_completes_commands_flags_and_choices(capsys: pytest.CaptureFixture[str]) -> None:
    bash = shutil.which("bash")
    assert bash is not None
    main(["completions", "bash"])
    script = capsys.readouterr().out

    def completed(*words: str) -> set[str]:
        asked = " ".join(f"'{w}'" for w in words)
        program = (
            f"{script}\nCOMP_WORDS=({asked}); COMP_CWORD={len(words) - 1}\n"
            "f=$(complete -p pydpend | sed -E 's/.*-F ([^ ]+).*/\\1/')\n"
            f'$f pydpend "{words[-1]}" "{words[-2]}"\n'
            'printf "%s\\n" "${COMPREPLY[@]}"'
        )
        done = subprocess.run([bash, "-c", program], capture_output=True, text=True, check=False)
        return set(done.stdout.split())

    assert {"analyse", "animate"} <= completed("pydpend", "an")
    assert "--calibration" in completed("pydpend", "analyse", "--cal")
    assert {"calibration", "comparison", "coefficients"} <= completed("pydpend", "plot", "c")
    assert completed("pydpend", "analyse", "--method", "e") == {"energy"}
    assert str(DEMO) in completed("pydpend", "analyse", "--encoder", str(DEMO)[:-1])
    assert str(DEMO) in completed("pydpend", "fit", str(DEMO)[:-1])


def test_completions_end_quietly_when_nobody_reads_them() -> None:
    for program in ([TRACKER], [Path(sys.executable).with_name("pydpend")]):
        reading, writing = os.pipe()
        os.close(reading)
        done = subprocess.run(
            [*program, "completions", "zsh"], stdout=writing, stderr=subprocess.PIPE, check=False
        )
        os.close(writing)
        assert (done.returncode, done.stderr) == (0, b"")


@pytest.mark.parametrize(
    ("words", "flag"),
    [
        ("analyse MOTION", "-o"),
        ("analyse -o OUT", "INPUTS"),
        ("analyse MOTION -o OUT --fps 0", "--fps"),
        ("analyse MOTION -o OUT --threads 0", "--threads"),
        ("analyse MOTION -o OUT --start 3 --stop 2", "--start"),
        ("analyse MOTION -o OUT --method guess", "--method"),
        ("analyse MOTION -o OUT --laws mu_v9", "--laws"),
        ("analyse MOTION -o OUT --estimator guess", "--estimator"),
        ("analyse MOTION -o OUT --model none.toml", "--model"),
        ("analyse MOTION -o OUT --encoder none.csv", "--encoder"),
        ("analyse MOTION -o OUT --calibration none", "--calibration"),
        ("analyse MOTION -o OUT --rig none.toml", "--rig"),
        ("analyse MOTION -o OUT --zero nonsense", "--zero"),
        ("analyse MOTION -o OUT --columns nonsense", "--columns"),
        ("fit MOTION -o OUT --columns nonsense", "--columns"),
        ("predict MOTION --fit OUT --windows x -o OUT", "--windows"),
        ("calibrate CALIBRATION -o OUT.json --angles-deg x", "--angles-deg"),
        ("calibrate CALIBRATION -o OUT.json --range-v 5,1", "--range-v"),
    ],
)
def test_an_error_names_the_flag(
    words: str, flag: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    named = {
        "MOTION": str(DEMO / "motion.parquet"),
        "CALIBRATION": str(DEMO / "calibration"),
        "OUT": str(tmp_path / "out"),
        "OUT.json": str(tmp_path / "out.json"),
    }
    try:
        status = main([named.get(word, word) for word in words.split()])
    except SystemExit as left:
        status = int(left.code or 0)
    said = capsys.readouterr().err
    assert status == 2, said
    last = said.splitlines()[-1]
    assert named.get(flag, flag) in last
    assert "Traceback" not in said
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("ending", ["png", "svg", "pdf"])
def test_each_figure_alone(ending: str, demo_run: Path, tmp_path: Path) -> None:
    magic = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}[ending]
    for figure in (
        "nodes",
        "angles",
        "calibration",
        "comparison",
        "residuals",
        "energy",
        "coefficients",
        "shares",
    ):
        path = tmp_path / f"{figure}.{ending}"
        assert main(["plot", figure, str(demo_run), "-o", str(path)]) == 0
        assert path.read_bytes().startswith(magic)
        if ending != "png":
            break


def test_a_figure_that_is_not_there_says_which_are(
    demo_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["plot", "prediction", str(demo_run), "-o", str(tmp_path / "p.png")]) == 2
    assert "It has nodes, neighbours, web, angles" in capsys.readouterr().err
    assert main(["plot", "energy", str(tmp_path), "-o", str(tmp_path / "p.png")]) == 2
    assert "not a run folder" in capsys.readouterr().err
    assert main(["plot", "energy", str(demo_run), "-o", str(tmp_path / "p.bmp")]) == 2
    assert "Use .png, .svg or .pdf" in capsys.readouterr().err


def test_the_film_beside_the_simulation(demo_run: Path, tmp_path: Path) -> None:
    film = tmp_path / "beside.mp4"
    words = ["animate", str(demo_run), "--start", "1", "--length", "0.2", "-o", str(film)]
    assert main(words) == 0
    count = subprocess.run(
        [
            "ffprobe", "-v", "error", "-count_frames", "-show_entries", "stream=nb_read_frames",
            "-of", "csv=p=0", str(film),
        ],
        capture_output=True,
        text=True,
        check=True,
    )  # fmt: skip
    # 0.2 s, five times slowed, 25 a second.
    assert int(count.stdout.strip().strip(",")) == pytest.approx(25, abs=1)
