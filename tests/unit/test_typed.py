"""Every public function and constructor refuses an argument of another type in one line that names it."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pydpend as dp
import pytest
from pydpend.typed import check

from tests.support import two_links as rig
from tests.support.drawn_nodes import some_nodes
from tests.support.made_results import calibration, motion

WRONG: tuple[tuple[str, tuple[Any, ...]], ...] = (
    (r"^(float|float \| None)$", ("x", "2", [1.0], {"a": 1}, True)),
    (r"^(int|int \| None)$", ("x", "2", 2.5, [1], {"a": 1}, True)),
    (r"^bool( \| None)?$", ("no", 3, [], {})),
    (r"^str( \| None)?$", (5, 2.5, [1], {"a": 1})),
    (r"^(Path|AnyPath|StrPath|str \| os\.PathLike\[str\])( \| None)?$", (5, 2.5, [1], {"a": 1}, True)),
    (
        r"^(Nodes|LinkAngles|Model|Damping|EncoderSignal|Calibration|Rig)( \| None)?$",
        ("h.csv", 5, [1], {"a": 1}),
    ),
    (r"^(Polarity|Centroid|Decoder|Interlaced|Codec|Unit|Method|Literal\[.*\])( \| None)?$", (5, [1], True)),
    (
        r"^(Floats|Array|NDArray\[.*\]|(npt\.)?ArrayLike)( \| None)?$",
        ("x", ["x"], {"a": 1}, [[1.0], [1.0, 2.0]]),
    ),
    (r"^(Progress|Progress \| None)$", (5, "yes", [1])),
    (r"^dict\[", (5, "x", [1])),
    (r"^(tuple\[float, float\])$", (5, "x", (1.0,), (1.0, "x"), (1.0, 2.0, 3.0))),
    (r"^(Sequence\[(str|float)\])( \| None)?$", (5, "x", [1j])),
)
"""Values that are of no type that an annotation names, by the annotation."""

ANY: Any = dp
"""The package, as who does not check types calls it."""

NEVER = (object(), 1j)
"""Values that no function takes."""

GIVEN: dict[str, Any] = {
    "nodes": rig.film(np.arange(50) / 50, np.zeros((50, 2)), 1),
    "result": motion(),
    "places": dp.places(rig.film(np.arange(50) / 50, np.zeros((50, 2)), 1)),
    "angles": motion(),
    "video": motion(),
    "encoder": motion(),
    "model": dp.derived("A"),
    "damping": dp.Damping(),
    "holds": [],
    "signal": dp.EncoderSignal(np.arange(3.0), np.zeros(3)),
    "state": [0.0, 0.0, 0.0, 0.0],
    "states": [[0.0, 0.0, 0.0, 0.0]],
    "t_s": np.arange(3.0),
    "phi_rad": np.zeros((3, 2)),
    "w_rad_s": np.zeros((3, 2)),
    "scene": "no-such-scene.toml",
    "rig": some_nodes().rig,
    "image": np.zeros((8, 8), np.uint8),
    "images": [np.zeros((8, 8), np.uint8)],
    "duration_s": 1.0,
    "length_m": 0.1,
    "frame": 0,
    "body": "upper",
    "text": "{}",
    "volts": np.zeros(3),
}
"""Values for what has to be given, by its name."""

OF_TYPE: dict[str, Any] = {
    "float": 1.0,
    "Floats": np.zeros((3, 2)),
    "NDArray[np.float64]": np.zeros((3, 2)),
    "NDArray[np.float32]": np.zeros((3, 2)),
    "NDArray[np.int64]": np.zeros((3, 2)),
    "NDArray[np.uint8]": np.zeros((3, 2)),
    "ArrayLike": np.zeros((3, 2)),
    "tuple[int, int]": (8, 8),
    "tuple[Node, ...]": (),
    "tuple[str, ...]": (),
}
"""Values for what has no entry there, by the annotation; a path that leads nowhere for anything else."""

RESULTS: dict[str, Callable[[], Any]] = {
    "Calibration": calibration,
    "LinkAngles": motion,
    "Model": lambda: dp.derived("A"),
    "Nodes": some_nodes,
    "Rig": lambda: some_nodes().rig,
    "Tracker": lambda: dp.Tracker(some_nodes().rig),
    "Film": lambda: dp.Film("clean", frames=3),
}


def calls() -> Iterator[tuple[str, Any]]:
    """Every exported function and constructor, and every method that takes something."""
    for name in dp.__all__:
        exported = getattr(dp, name)
        if not inspect.isclass(exported):
            yield name, exported
        elif name in RESULTS:
            if name != "Calibration":
                yield name, exported
            result = RESULTS[name]()
            for method, _ in inspect.getmembers(type(result), callable):
                if not method.startswith("_") and method not in ("of_table", "from_json"):
                    yield f"{name}.{method}", getattr(result, method)


CALLS = {name: call for name, call in calls() if inspect.signature(call).parameters}


def wrong_values(note: str) -> tuple[Any, ...]:
    """The values that are wrong for an annotation."""
    found = next((values for pattern, values in WRONG if re.match(pattern, note)), ())
    nothing = () if "None" in note or note in ("Any", "Progress") else (None,)
    return () if note == "Any" else (*found, *nothing, *NEVER)


def given(key: str, note: str) -> Any:
    """A value that may be given for an argument."""
    by_type = np.zeros((3, 1, 2)) if key == "xy_px" else OF_TYPE.get(note, "nowhere.csv")
    fits = key in GIVEN and not (note.startswith(("NDArray", "tuple")) and key in ("frame", "nodes"))
    return GIVEN[key] if fits else by_type


@pytest.mark.parametrize("name", CALLS)
def test_a_wrong_type_is_one_line_that_names_the_argument(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    call = CALLS[name]
    parameters = {
        key: p for key, p in inspect.signature(call).parameters.items() if p.kind is not p.VAR_KEYWORD
    }
    needed = {
        key: given(key, str(p.annotation))
        for key, p in parameters.items()
        if p.default is p.empty and p.kind is not p.VAR_POSITIONAL
    }
    tried = 0
    for key, parameter in parameters.items():
        for wrong in wrong_values(str(parameter.annotation)):
            several = parameter.kind is parameter.VAR_POSITIONAL
            with pytest.raises(dp.PydpendError) as refused:
                call(*[wrong] * several, **(needed if several else {**needed, key: wrong}))
            said = str(refused.value)
            assert said.startswith(key), (key, wrong, said)
            assert "\n" not in said
            assert len(said) < 400
            tried += 1
    assert tried >= 2 or "Any" in str(inspect.signature(call))


def test_numbers_of_numpy_and_what_numpy_makes_arrays_of_are_taken() -> None:
    assert ANY.find_rest(motion(), np.float32(0.5)) is not None
    assert len(ANY.find_rest(motion(), np.array(0.5))) == len(dp.find_rest(motion(), 0.5))
    assert len(ANY.simulate(GIVEN["model"], ANY.Damping(np.int64(0)), (0, 0, 0, 0), range(3)).t_s) == 3


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (
            lambda: ANY.track("a", threads="2"),
            "threads: a whole number is needed, and this is '2'. Write threads=2",
        ),
        (
            lambda: ANY.track("a", threads=2.0),
            "threads: a whole number is needed, and this is 2.0. Write threads=2",
        ),
        (
            lambda: ANY.track("a", markers="3"),
            "markers: a whole number is needed, and this is '3'. Write markers=3",
        ),
        (
            lambda: ANY.track("a", fps="29.97"),
            "fps: a number is needed, and this is '29.97'. Write fps=29.97",
        ),
        (lambda: ANY.track(None), "path: a path is needed, and this is None"),
        (lambda: ANY.track("a", force="no"), "force: True or False is needed, and this is 'no'"),
        (lambda: ANY.write_angles(motion(), 5), "path: a path is needed, and this is 5"),
        (
            lambda: ANY.find_rest(motion(), "x" * 99),
            f"at_least_s: a number is needed, and this is '{'x' * 12}...{'x' * 13}'",
        ),
        (
            lambda: ANY.read_angles("a.csv", hanging_rad="x"),
            "hanging_rad: a number or a sequence, each a number, is needed, and this is 'x'",
        ),
        (
            lambda: ANY.angles(some_nodes(), bodies="upper"),
            "bodies: a sequence, each text, is needed, and this is 'upper'",
        ),
    ],
)
def test_what_is_given_is_told_and_the_number_that_was_meant(call: Callable[[], object], said: str) -> None:
    with pytest.raises(dp.WrongTypeError) as refused:
        call()
    assert str(refused.value) == said


def test_what_lacks_or_is_too_much_is_told_in_pythons_words() -> None:
    with pytest.raises(TypeError, match="missing 1 required positional argument: 'path'"):
        ANY.track()
    with pytest.raises(TypeError, match="unexpected keyword argument 'frame_rate'"):
        ANY.track("a.mp4", frame_rate=3)


@pytest.mark.parametrize(
    ("hint", "right", "wrong"),
    [
        (
            float | tuple[float, float],
            (1, np.float64(2), (1, 2.0), [1, 2], np.zeros(2)),
            ((1,), "1", None, (1, "2")),
        ),
        (list[float], ([], [1.0], np.arange(3), range(3)), ("12", {1.0}, {"a": 1}, np.array(["a"]))),
        (tuple[str, ...], ((), ("a",), ["a", "b"]), ("ab", (1,))),
        (Callable[[int], int] | None, (len, None), (3,)),
    ],
)
def test_what_a_type_means_to_a_caller(hint: Any, right: tuple[Any, ...], wrong: tuple[Any, ...]) -> None:
    for value in right:
        check("x", value, hint)
    for value in wrong:
        with pytest.raises(dp.WrongTypeError, match=r"^x: "):
            check("x", value, hint)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: dp.read_angles(""), "'': the name is empty"),
        (lambda: dp.export(some_nodes(), ""), "'': the name is empty"),
        (lambda: dp.read_angles("a\0b"), "'a\\x00b': the name holds a NUL"),
        (lambda: dp.write_angles(motion(), "a\0b.csv"), "'a\\x00b.csv': the name holds a NUL"),
        (
            lambda: dp.detect(np.zeros((9, 9), np.uint8), depth_bits=10**30),
            f"depth_bits: {10**30} is out of range",
        ),
        (lambda: dp.track("a", frames=(0, 10**30)), f"frames: {10**30} is out of range"),
        (lambda: dp.track("a", fps=10**400), "fps: a number of many digits is out of range"),
        (lambda: dp.Film("clean", seed=-1), "seed: -1 is out of range"),
        (lambda: dp.Film("clean", frames=2).image(-1), "frame: -1 is out of range"),
        (lambda: dp.states(motion(), seed=-1), "seed: -1 is below 0"),
        (lambda: dp.states(motion(), stretch_s=float("nan")), "stretch_s: nan is no length"),
        (lambda: dp.find_rest(motion(), float("nan")), "at_least_s: nan is no length"),
    ],
)
def test_a_value_of_the_right_type_that_cannot_be_is_one_line(call: Callable[[], object], said: str) -> None:
    with pytest.raises(dp.PydpendError) as refused:
        call()
    assert str(refused.value).startswith(said)
    assert "\n" not in str(refused.value)
