"""The tracker's commands in ``pydpend`` are those of ``tracker``: help, results, words, status and signals."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from pydpend import _native
from pydpend.cli import COMMANDS, main, parser
from pydpend.cli.tracker import COMMANDS as TRACKER_COMMANDS
from pydpend.cli.tracker import described

ROOT = Path(__file__).parent.parent.parent
DEMO = ROOT / "fixtures" / "demo"
TRACKER = ROOT / "target" / "release" / "tracker"
PYDPEND = Path(sys.executable).with_name("pydpend")


def both(*words: str | Path) -> tuple[subprocess.CompletedProcess[str], subprocess.CompletedProcess[str]]:
    """What the two programs do with the same words, with one name in the place of both."""

    def done(program: Path) -> subprocess.CompletedProcess[str]:
        ran = subprocess.run([program, *words], capture_output=True, text=True, check=False)
        named = [text.replace("pydpend", "tracker") for text in (ran.stdout, ran.stderr)]
        return subprocess.CompletedProcess(words, ran.returncode, *named)

    return done(TRACKER), done(PYDPEND)


def test_the_commands_are_all_of_the_trackers() -> None:
    listed = subprocess.run([TRACKER, "--help"], capture_output=True, text=True, check=True).stdout
    names = re.findall(r"^  (\w+) ", listed.split("Commands:")[1].split("Options:")[0], re.M)
    assert set(names) == {*TRACKER_COMMANDS, "completions", "help"}
    assert set(described()) == set(TRACKER_COMMANDS)
    assert not set(TRACKER_COMMANDS) & set(COMMANDS)


@pytest.mark.parametrize("command", TRACKER_COMMANDS)
def test_the_help_is_the_same(command: str) -> None:
    small, whole = both(command, "--help")
    # Lines may break elsewhere only where a name stands, and the names are equally long.
    assert (small.returncode, small.stdout) == (whole.returncode, whole.stdout)
    assert f"  tracker {command} " in small.stdout.split("Examples:")[1]
    for words in (["help", command], [command, "-h"]):
        done = subprocess.run(
            [sys.executable, "-m", "pydpend", *words], capture_output=True, text=True, check=False
        )
        assert done.stdout.startswith(small.stdout[:20])
        assert f"Usage: pydpend {command} " in done.stdout


@pytest.mark.parametrize(
    ("words", "status"),
    [
        (["info", DEMO / "drop.mp4"], 0),
        (["info", DEMO / "drop.mp4", "--json"], 0),
        (["info", "none.mp4"], 2),
        (["info", DEMO / "motion.parquet"], 2),
        (["check", DEMO / "drop.mp4"], 2),
        (["info", DEMO / "drop.mp4", "--decoder", "opencv"], 2),
        (["track", DEMO / "drop.mp4"], 2),
        (["track", "x", "-o", "y.csv", "--treshold", "4"], 2),
        (["track", "x", "-o", "y.csv", "--nothing-near"], 2),
        (["track", "x", "-o", "y.csv", "--polarity", "up"], 2),
        (["track", "x", "-o", "y.csv", "--frames", "5"], 2),
        (["film", "--preset", "clean", "--print-scene"], 0),
        (["film", "--preset", "clean", "--count"], 2),
    ],
)
def test_what_is_said_is_the_same(words: list[str | Path], status: int) -> None:
    small, whole = both(*words)
    assert small.returncode == status, small.stderr
    assert (small.returncode, small.stdout, small.stderr) == (whole.returncode, whole.stdout, whole.stderr)
    if status == 2:
        assert whole.stderr.count("\n") == 1
        assert whole.stderr.startswith("tracker: ")


def test_advice_names_the_program_that_was_called() -> None:
    """A command that both have is named with the program's own name, another with the one that has it."""
    said = {
        program: subprocess.run([program, "info", file], capture_output=True, text=True, check=False).stderr
        for program in (TRACKER, PYDPEND)
        for file in [DEMO / "motion.parquet"]
    }
    assert all("Next: `pydpend fit " in text for text in said.values())
    for program, name in ((TRACKER, "tracker"), (PYDPEND, "pydpend")):
        words: list[str | Path] = [program, "check", DEMO / "drop.mp4"]
        text = subprocess.run(words, capture_output=True, text=True, check=False).stderr
        assert text.startswith(f"{name}: ")
        assert f"Next: `{name} track " in text


def test_a_table_has_the_same_bytes(tmp_path: Path) -> None:
    film = tmp_path / "film.mkv"
    subprocess.run(
        [PYDPEND, "film", "--preset", "clean", "--frame-count", "60", "-o", film, "-q"], check=True
    )
    done = []
    for program, folder in ((TRACKER, tmp_path / "small"), (PYDPEND, tmp_path / "whole")):
        folder.mkdir()
        words: list[str | Path] = [program, "track", film, "-o", "t.csv"]
        done.append(subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False))
    small, whole = done
    assert (small.returncode, small.stdout) == (0, whole.stdout)
    assert small.stdout.startswith("t.csv: 60 frames, 9 nodes")
    for name in sorted(os.listdir(tmp_path / "small")):
        assert (tmp_path / "small" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes(), name
    assert sorted(os.listdir(tmp_path / "small")) == sorted(os.listdir(tmp_path / "whole"))
    small, whole = both("check", tmp_path / "small" / "t.csv")
    assert (small.returncode, small.stdout, small.stderr) == (0, whole.stdout, whole.stderr)


def caught(process: subprocess.Popen[str], wanted: int) -> bool:
    """Whether a process catches a signal by now."""
    status = Path(f"/proc/{process.pid}/status").read_text("ascii")
    (mask,) = [line.split()[1] for line in status.splitlines() if line.startswith("SigCgt:")]
    return bool(int(mask, 16) >> (wanted - 1) & 1)


@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_command_that_waits(sent: int, tmp_path: Path) -> None:
    """The film is a pipe of which nobody writes the rest; the signal is heard nevertheless."""
    reading, writing = os.pipe()
    os.write(writing, b"YUV4MPEG2 W64 H48 F500:1 Ip A1:1 Cmono\nFRAME\n" + bytes(64 * 48))
    words: list[str | Path] = [PYDPEND, "track", "-", "-o", tmp_path / "t.csv"]
    with subprocess.Popen(words, stdin=reading, stderr=subprocess.PIPE, text=True) as process:
        os.close(reading)
        # Python leaves SIGTERM alone; the command catches it.
        while not caught(process, signal.SIGTERM):
            assert process.poll() is None
            time.sleep(0.01)
        process.send_signal(sent)
        _, said = process.communicate(timeout=60)
    os.close(writing)
    assert (process.returncode, said) == (130, "pydpend: interrupted\n")
    assert not (tmp_path / "t.csv").exists()


@pytest.mark.parametrize(
    "words", [["--help"], ["track", "--help"], ["info", DEMO / "drop.mp4"], ["--version"]]
)
def test_it_ends_quietly_when_nobody_reads(words: list[str | Path]) -> None:
    for program in ([PYDPEND], [sys.executable, "-m", "pydpend"]):
        reading, writing = os.pipe()
        os.close(reading)
        done = subprocess.run([*program, *words], stdout=writing, stderr=subprocess.PIPE, check=False)
        os.close(writing)
        assert (done.returncode, done.stderr) == (0, b"")


def test_completions_and_help_know_the_trackers_commands(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["completions", "zsh"]) == 0
    text = capsys.readouterr().out
    for command in described().values():
        assert command["name"] in text
        for argument in command["arguments"]:
            assert all(flag in text for flag in argument["flags"])
    args = parser().parse_args(["track", "a.mp4", "-o", "b.csv", "--polarity", "dark", "--quiet"])
    assert (args.input, args.output, args.polarity, args.quiet) == ("a.mp4", "b.csv", "dark", True)


def test_a_name_that_is_not_utf8_is_the_same_file(tmp_path: Path) -> None:
    name = os.fsdecode(os.fsencode(tmp_path) + b"/f\xf6.mp4")
    Path(name).symlink_to(DEMO / "hanging.mp4")
    small, whole = both("info", name)
    assert (small.returncode, small.stdout) == (0, whole.stdout)
    assert "f\\xf6.mp4" in small.stdout


def test_the_version_is_that_of_the_extension(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as left:
        main(["--version"])
    assert left.value.code == 0
    assert capsys.readouterr().out == f"pydpend {_native.VERSION}\n"
