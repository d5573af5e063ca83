"""Advice names what the caller can do: keywords in Python, flags and commands at a terminal, and only such as exist."""

from __future__ import annotations

import argparse
import ast
import importlib
import inspect
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import fields
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pydpend as dp
import pydpend.analyse
import pytest
from pydpend.cli import COMMANDS, _parsers, main
from pydpend.cli.tracker import COMMANDS as TRACKER_COMMANDS
from pydpend.cli.words import RENAMED, flags_of, options_of
from pydpend.errors import FitOptionError, Message, PydpendError, Setting, Step, fault, speaking
from pydpend.kinematics import LinkAngles
from pydpend.plots import folder as figures
from pydpend.plots.moving import check_film

from tests.support import two_links
from tests.support.drawn_nodes import some_nodes

ROOT = Path(__file__).parent.parent.parent
TRACKER = ROOT / "target" / "release" / "tracker"
PYDPEND = Path(sys.executable).with_name("pydpend")
PACKAGE = ROOT / "python" / "pydpend"
DEMO = ROOT / "fixtures" / "demo"
TRACKER_SOURCE = ROOT / "crates" / "tracker" / "src"

FLAG = re.compile(r"(?<![\w-])--[a-z][a-z0-9-]*")
KEYWORD = re.compile(r"\b[a-z_]+=(?:'|\.\.\.|True|False)")


def library() -> Iterator[tuple[Path, ast.Module]]:
    """Every module of the library; the command line is none."""
    for path in sorted(PACKAGE.rglob("*.py")):
        if "cli" not in path.relative_to(PACKAGE).parts:
            yield path, ast.parse(path.read_text("utf-8"))


def calls(name: str) -> Iterator[ast.Call]:
    for _, tree in library():
        for node in ast.walk(tree):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == name:
                yield node


def literals(call: ast.Call) -> list[str]:
    return [a.value for a in call.args if isinstance(a, ast.Constant) and isinstance(a.value, str)]


def rust_settings() -> set[str]:
    text = (TRACKER_SOURCE / "message.rs").read_text("utf-8")
    return set(re.findall(r'Self::\w+ => "(\w+)"', text))


def keywords() -> set[str]:
    """Every keyword of the public functions, their classes' methods and the options of an analysis."""
    found = {f.name for f in fields(pydpend.analyse.Options)}
    functions: list[Callable[..., Any]] = [figures.figure_of, figures.chosen, check_film]
    for name in dp.__all__:
        thing = getattr(dp, name)
        if inspect.isclass(thing):
            functions += [f for _, f in inspect.getmembers(thing, inspect.isfunction)]
        elif callable(thing):
            functions.append(thing)
    for function in functions:
        found |= set(inspect.signature(function).parameters)
    return found


def flags() -> dict[str, set[str]]:
    """The flags of every command."""
    return {f"pydpend {name}": set(options_of(p)) for name, p in _parsers()[1].items()}


PYTHON_ONLY = {"link_length_sigma_m", "progress"}
"""Settings that no command has."""


def test_every_setting_that_a_message_names_is_a_keyword_and_a_flag() -> None:
    named = {literals(c)[0] for function in ("Setting", "one_of") for c in calls(function) if literals(c)}
    assert {"estimator", "unwrap", "zero", "bodies", "rate_hz", "start_s"} <= named
    named |= rust_settings()
    assert not named - keywords(), "no public function has these"
    known = set().union(*flags().values())
    # Under their flags' own names, which the parsers tell: dest is the keyword.
    dests = {a.dest for p in _parsers()[1].values() for a in p._actions}
    assert not {n for n in named - PYTHON_ONLY if n not in dests and not known & set(flags_of(n))}


def test_every_step_that_a_message_names_can_be_typed_and_called() -> None:
    steps = [literals(c) for c in calls("Step")]
    files = (TRACKER_SOURCE / "message.rs", TRACKER_SOURCE / "kind" / "next_step.rs")
    source = "".join(file.read_text("utf-8") for file in files)
    steps += [list(pair) for pair in re.findall(r'Step::known\(\s*"([^"]*)",\s*"([^"]*)"', source)]
    steps += [
        list(pair)
        for pair in re.findall(
            r'format!\("(pydpend [^"]*)"[^;]*?\),\s*format!\("((?:dp|pydpend)[^"]*)"', source
        )
    ]
    assert len(steps) > 10
    known = flags()
    for command, call in steps:
        words = command.replace("{file}", "x").split()
        if words[0] == "pydpend":
            assert set(FLAG.findall(command)) - {"--help"} <= known[" ".join(words[:2])], command
        else:
            assert any(set(FLAG.findall(command)) <= f for f in known.values()), command
        found: Any = {"dp": dp, "pydpend": pydpend, "nodes": SimpleNamespace(status=0)}
        head, *rest = re.split(r"\(", call)[0].split(".")
        thing = found[head]
        for name in rest:
            inside = getattr(thing, name, None)
            thing = importlib.import_module(f"{thing.__name__}.{name}") if inside is None else inside


def test_no_text_of_the_library_writes_flags_or_keywords_itself() -> None:
    wrong = []
    for path, tree in library():
        docs = {
            id(n.value)
            for n in ast.walk(tree)
            if isinstance(n, ast.Expr) and isinstance(n.value, ast.Constant)
        }
        docs |= {id(a) for c in ast.walk(tree) if isinstance(c, ast.Call) and isinstance(c.func, ast.Name)
                 and c.func.id == "Step" for a in c.args}  # fmt: skip
        for node in ast.walk(tree):
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docs:
                said = node.value
                # A style sheet's variables (--s0, --line) are no flags, "--no-" is put before what a parser knows.
                if (
                    FLAG.search(said) and not re.fullmatch(r"\W*--[a-z0-9-]+|.*\bvar\(--s", said)
                ) or KEYWORD.search(said):
                    wrong.append(f"{path.name}: {said!r}")
    for file in sorted(TRACKER_SOURCE.rglob("*.rs")):
        if "cli" in file.parts or file.name in ("message.rs", "next_step.rs"):
            continue
        code = re.sub(r"//.*", "", file.read_text("utf-8").split("#[cfg(test)]")[0])
        wrong += [f"{file.name}: {s}" for s in re.findall(r'"(?:[^"\\]|\\.)*"', code) if FLAG.search(s)]
    assert not wrong, "\n".join(wrong)


def wrapped(folder: Path) -> Path:
    """An angles table whose angles are kept within one turn."""
    t = np.arange(600) / 100
    phi = np.angle(np.exp(1j * 4 * t))
    path = folder / "wrapped.csv"
    np.savetxt(
        path, np.column_stack([t, phi, phi]), delimiter=",", header="time_s,phi1_rad,phi2_rad", comments=""
    )
    return path


def unlike(folder: Path) -> Path:
    path = folder / "unlike.csv"
    path.write_text("t,theta\n" + "".join(f"{0.01 * i},{0.1 * i}\n" for i in range(99)), encoding="utf-8")
    return path


FIT = ("fit", str(DEMO / "motion.parquet"))


def motion() -> LinkAngles:
    return dp.read_angles(DEMO / "motion.parquet")


SAID: dict[str, tuple[Callable[[Path], object], Callable[[Path], list[str]], list[str], list[str]]] = {
    # What it is about: in Python, at the terminal, and words that must be said there.
    "a table within one turn": (
        lambda d: dp.read_angles(wrapped(d)),
        lambda d: ["fit", str(wrapped(d)), "-o", str(d / "out")],
        ["unwrap=True"], ["--unwrap"],
    ),
    "an option of the other method": (
        lambda d: dp.fit_damping(motion(), dp.derived("A"), "energy", angle_maps=True),
        lambda d: [*FIT, "--method", "energy", "--angle-maps", "-o", str(d / "out")],
        ["angle_maps: is", "method='trajectory'"], ["--angle-maps: is", "--method trajectory"],
    ),
    "the paper's ten": (
        lambda d: dp.fit_damping(motion(), dp.derived("A"), ten_coefficients=True),
        lambda d: [*FIT, "--ten-coefficients", "-o", str(d / "out")],
        ["method='energy' and laws='paper'"], ["--method energy and --laws paper"],
    ),
    "a free parameter that is none": (
        lambda d: dp.fit_damping(motion(), dp.derived("A"), free=("foo",)),
        lambda d: [*FIT, "--free", "foo", "-o", str(d / "out")],
        ["free: 'foo' is not known. Give offset1, offset2, added_inertia or tilt"],
        ["--free: 'foo' is not known. Give offset1, offset2, added_inertia or tilt"],
    ),
    "an end before the start": (
        lambda d: dp.fit_damping(motion(), dp.derived("A"), start_s=3.0, stop_s=2.0),
        lambda d: [*FIT, "--start", "3", "--stop", "2", "-o", str(d / "out")],
        ["start_s: 3 s is not before stop_s"], ["--start: 3 s is not before --stop"],
    ),
    "an encoder column that is not known": (
        lambda d: dp.read_encoder(unlike(d), rate_hz=100.0),
        lambda d: ["compare", str(DEMO / "motion.parquet"), str(unlike(d)), "--rate-hz", "100", "-o", str(d / "out")],
        ["column=..."], ["--column"],
    ),
    "a table that is there already": (
        lambda d: dp.track(DEMO / "drop.mp4", output=there(d)),
        lambda d: ["export", str(DEMO / "nodes.none"), "-o", str(there(d))],
        ["force=True"], ["--force"],
    ),
    "a film in place of angles": (
        lambda d: dp.read_angles(DEMO / "drop.mp4"),
        lambda d: ["fit", str(DEMO / "drop.mp4"), "-o", str(d / "out")],
        ["it is a film, not an angles table. Next: dp.track("],
        ["it is a film, not an angles table. Next: `pydpend track ", "drop.parquet`"],
    ),
    "a film in place of nodes": (
        lambda d: dp.read_nodes(DEMO / "drop.mp4"),
        lambda d: ["angles", str(DEMO / "drop.mp4"), "-o", str(d / "a.parquet")],
        ["it is a film, not a node table. Next: dp.track("], ["it is a film, not a node table. Next: `pydpend track "],
    ),
}  # fmt: skip


def there(folder: Path) -> Path:
    path = folder / "there.csv"
    path.write_text("x", encoding="utf-8")
    return path


@pytest.mark.parametrize("case", SAID)
def test_each_front_end_says_it_in_its_own_words(
    case: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    call, words, in_python, at_terminal = SAID[case]
    with pytest.raises(PydpendError) as caught:
        call(tmp_path)
    said = str(caught.value)
    assert all(w in said for w in in_python), said
    assert not FLAG.search(said), said
    argv = words(tmp_path)
    assert main(argv) == 2
    line = capsys.readouterr().err.strip()
    assert line.startswith("pydpend: "), line
    assert "\n" not in line
    assert all(w in line for w in at_terminal), line
    assert not KEYWORD.search(line), line
    # Flags within `a command` are that command's.
    own = re.sub(r"`[^`]*`", "", line)
    assert set(FLAG.findall(own)) <= set(options_of(_parsers()[1][argv[0]])), line
    assert not (tmp_path / "out").exists()
    assert str(caught.value) == said, "after the command line, Python's words are Python's"


def test_a_setting_that_a_command_has_not_is_named_with_one_that_has(
    capsys: pytest.CaptureFixture[str],
) -> None:
    from pydpend.cli.words import CommandLine

    with speaking(CommandLine(lambda: _parsers()[1], "plot")):
        assert str(Message.of(Setting("unwrap", True))).startswith("--unwrap (of `pydpend ")
        assert str(Message.of(Setting("threshold"))) == "--threshold (of `pydpend analyse`)"
        assert (
            str("Leave " + Setting("prediction", False) + ".")
            == "Leave --no-prediction (of `pydpend analyse`)."
        )
        assert str(Message.of(Step("pydpend setup", "dp.setup"))) == "`pydpend setup`"
    assert str(Message.of(Setting("prediction", False))) == "prediction=False"
    assert (
        str(fault(Setting("fps"), "is wrong", "Leave " + Setting("fps") + " out"))
        == "fps: is wrong. Leave fps=... out"
    )


def test_options_of_the_other_method_are_refused_by_all(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model, angles = dp.derived("A"), motion()
    wrong: dict[str, tuple[dict[str, Any], list[str], dict[str, Any]]] = {
        "angle_maps": ({"angle_maps": True}, ["--angle-maps"], {"angle_maps": True}),
        "free": ({"free": ["tilt"]}, ["--free", "tilt"], {"free": "tilt"}),
        "ratios": ({"ratios": True}, ["--ratios", "free"], {"ratios": "free"}),
        "intervals": ({"intervals": "profile"}, ["--intervals", "profile"], {"intervals": "profile"}),
        "comparison": ({"comparison": True}, ["--comparison"], {"comparison": True}),
        "prediction": ({"prediction": True}, ["--prediction"], {}),
        "clock": ({"clock": True}, ["--clock"], {"clock": True}),
    }
    for name, (keywords_, flags_, options) in wrong.items():
        with pytest.raises(FitOptionError, match="is an option of the trajectory fit"):
            dp.fit_damping(angles, model, "energy", **keywords_)
        with pytest.raises(ValueError, match="is an option of the trajectory fit"):
            dp.fit_damping(angles, model, "energy", **keywords_)
        for command in ("fit", "analyse") if flags_ else ():
            argv = [command, FIT[1], "--method", "energy", *flags_, "-o", str(tmp_path / "out")]
            assert main(argv) == 2, name
            assert f"--{name.replace('_', '-')}" in capsys.readouterr().err
        if options:
            with pytest.raises(FitOptionError):
                pydpend.analyse.Options(method="energy", **options)
    with pytest.raises(FitOptionError, match="predict: the option is called prediction now"):
        dp.fit_damping(angles, model, predict=True)  # type: ignore[call-arg]
    # What is asked not to be done is not done, whatever the method.
    pydpend.analyse.Options(method="energy", comparison=False, prediction=False, ratios="fixed")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("analyze x", "Did you mean analyse?"),
        ("tarck x", "'tarck' is not a command. Did you mean track?"),
        ("--markr track x", "--markr: is not an option of `pydpend track`. Did you mean --marker"),
        (
            "fit x -o y --marker 1,2",
            "but of `pydpend analyse`, `pydpend batch`, `pydpend setup` or `pydpend track`",
        ),
        ("fitt x", "Did you mean fit?"),
        ("fit x -o y --hanging-rad 3.14", "--hanging-rad: the option is called --hanging now, in degrees"),
        ("fit x -o y --angle-map", "Did you mean --angle-maps?"),
        (
            "fit x -o y --zero rest",
            "is not an option of `pydpend fit` but of `pydpend analyse`, `pydpend batch` or `pydpend angles`",
        ),
        ("fit x -o y --method guess", "--method: 'guess' is not known. Give trajectory or energy"),
        ("compare x y -o z --link 3", "--link: 3 is not known. Give 1 or 2"),
        ("analyse x -o y --estimator guess", "Give rigid, linkage or pairwise"),
        ("plot guess x -o y.png", "Give nodes, neighbours"),
        ("completions guess", "Give bash, zsh"),
        ("fit", "the following arguments are required"),
    ],
)
def test_words_that_are_not_known(words: str, said: str, capsys: pytest.CaptureFixture[str]) -> None:
    try:
        status = main(words.split())
    except SystemExit as left:
        status = int(str(left.code))
    line = capsys.readouterr().err
    assert status == 2
    assert said in line
    assert line.count("\n") == 1


def test_old_names_are_taken_with_a_note(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for command, names in RENAMED.items():
        for old, new in names.items():
            assert new.flag in options_of(_parsers()[1][command])
            assert old not in options_of(_parsers()[1][command])
    status = main(
        ["angles", str(DEMO / "motion.parquet"), "--method", "linkage", "-o", str(tmp_path / "a.csv")]
    )
    said = capsys.readouterr().err
    assert status == 2
    assert said.splitlines()[0] == "pydpend: note: --method is called --estimator now"
    config = tmp_path / "run.toml"
    config.write_text('inputs = []\nencoder_column = "ai0"\n', encoding="utf-8")
    with pytest.raises(PydpendError, match="the option is called column now"):
        pydpend.analyse.read_config(config)
    with pytest.raises(PydpendError, match="Give estimator='linkage'"):
        # The old name, wrong on purpose.
        dp.angles(some_nodes(), method="linkage")  # type: ignore[arg-type]


def test_what_does_nothing_with_these_inputs_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for option in (["--rig", str(DEMO / "scene.toml")], ["--estimator", "linkage"], ["--zero", "1,2"],
                   ["--bodies", "a,b"], ["--mirrored"], ["--link-length-m", "0.2"],
                   ["--calibration", str(DEMO / "calibration")], ["--column", "ai0"], ["--rate-hz", "9"]):  # fmt: skip
        assert main(["analyse", FIT[1], *option, "-o", str(tmp_path / "out")]) == 2, option
        assert option[0] in capsys.readouterr().err
    for option in (["--columns", "time_s=t"], ["--hanging", "180"], ["--clockwise"], ["--unwrap"]):
        assert main(["analyse", str(DEMO / "drop.mp4"), *option, "-o", str(tmp_path / "out")]) == 2, option
        assert option[0] in capsys.readouterr().err
    assert main(["export", FIT[1], "--px-per-m", "900", "-o", str(tmp_path / "out.mat")]) == 2
    assert "--px-per-m: .mat files are in px" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_length_that_nothing_is_made_of_is_refused() -> None:
    t = np.arange(200) / 100
    nodes = two_links.film(t, np.column_stack([np.sin(3 * t), np.sin(5 * t)]), 1)
    for given, said in (
        (
            {"estimator": "pairwise", "link_length_m": 0.17},
            "link_length_m: the pairs of markers give no joints",
        ),
        (
            {"bodies": [nodes.rig.bodies[0]], "link_length_m": 0.17},
            "link_length_m: a single link has no elbow",
        ),
        ({"link_length_m": -1.0}, "link_length_m: -1 m is no length"),
        ({"link_length_sigma_m": 0.01}, "Give link_length_m=..."),
    ):
        with pytest.raises(PydpendError, match=re.escape(said)):
            dp.angles(nodes, zero="reference_frame", **given)


@pytest.mark.parametrize("program", [TRACKER, PYDPEND], ids=["tracker", "pydpend"])
def test_the_trackers_commands_say_the_same(program: Path, tmp_path: Path) -> None:
    def said(*words: str | Path) -> str:
        done = subprocess.run([program, *map(str, words)], capture_output=True, text=True, check=False)
        assert done.returncode == 2, done
        assert done.stderr.count("\n") == 1, done.stderr
        return done.stderr

    out = tmp_path / "out.parquet"
    assert f"it is a scene to film, not a film. Next: `{program.name} film " in said(
        "track", DEMO / "scene.toml", "-o", out
    )
    assert "it is an angles table, not a film. Next: `pydpend fit " in said("info", DEMO / "motion.parquet")
    assert f"it is a film, not a node table. Next: `{program.name} track " in said("check", DEMO / "drop.mp4")
    assert "it is a film, not a rig file" in said(
        "track", DEMO / "drop.mp4", "--rig", DEMO / "drop.mp4", "-o", out
    )
    assert "--force" in said("track", DEMO / "drop.mp4", "-o", there(tmp_path))
    analyse = "Type `pydpend analyse`" if program == TRACKER else "Did you mean analyse?"
    assert analyse in said("analyze", "x")
    assert "Did you mean track?" in said("trakc", "x")
    assert '--polarity <POLARITY>: "up" is not known. Give auto, bright or dark' in said(
        "track", "x", "-o", out, "--polarity", "up"
    )
    assert "--treshold: it is not an option of this command. Did you mean --threshold?" in said(
        "track", "x", "-o", out, "--treshold", "4"
    )
    assert "expected A..B" in said("track", "x", "-o", out, "--frames", "5")
    assert not out.exists()


def test_a_warning_of_the_tracker_speaks_as_its_caller(tmp_path: Path) -> None:
    film = dp.film("clean", tmp_path / "f" / "%03d.png", frames=8)
    rig = tmp_path / "rig.toml"
    rig.write_text(film.rig_toml(), encoding="utf-8")
    nodes = dp.track(tmp_path / "f", rig)
    assert all(isinstance(w, str) for w in nodes.meta["warnings"])
    assert any(w.endswith("Give it with fps=...") for w in nodes.meta["warnings"]), nodes.meta["warnings"]
    words: list[str | Path] = [TRACKER, "track", tmp_path / "f", "--rig", rig, "-o", tmp_path / "n.csv"]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert "note: pictures have no rate; times are frame numbers. Give it with --fps\n" in done.stderr


def test_every_command_has_its_place() -> None:
    assert list(_parsers()[1]) == [*COMMANDS, *TRACKER_COMMANDS]
    assert all(isinstance(p, argparse.ArgumentParser) for p in _parsers()[1].values())
