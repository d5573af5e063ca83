"""A file in the wrong place is named as what it is, with the command that takes it."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from pydpend.cli import main
from pydpend.kinds import kind_of

ROOT = Path(__file__).parent.parent.parent
DEMO = ROOT / "fixtures" / "demo"


def test_one_function_knows_what_a_file_is(tmp_path: Path) -> None:
    np.savetxt(tmp_path / "holds.csv", [[0.0, 1.0]], delimiter=",", header="time_s,voltage_v", comments="")
    known = {
        DEMO / "drop.mp4": "film",
        DEMO / "motion.parquet": "angles",
        DEMO / "encoder.csv": "encoder",
        DEMO / "calibration": "tables",
        DEMO / "scene.toml": "scene",
        tmp_path / "holds.csv": "encoder",
        tmp_path / "none": "unknown",
        ROOT / "README.md": "unknown",
    }
    assert {path: kind_of(path) for path in known} == known


READERS = {
    "angles": (
        "angles {} -o OUT.csv",
        {"motion.parquet": "an angles table", "encoder.csv": "an encoder recording"},
    ),
    "fit": (
        "fit {} -o OUT",
        {"drop.mp4": "a film", "encoder.csv": "an encoder recording", "scene.toml": "a scene"},
    ),
    "compare": ("compare {} ENCODER -o OUT", {"encoder.csv": "an encoder recording", "drop.mp4": "a film"}),
    "calibrate": ("calibrate {} -o OUT.json", {"drop.mp4": "a film", "scene.toml": "a scene"}),
    "predict": ("predict MOTION --fit {} -o OUT", {"motion.parquet": "an angles table"}),
    "plot": ("plot energy {} -o OUT.pdf", {"motion.parquet": "an angles table", "drop.mp4": "a film"}),
    "animate": ("animate {} -o OUT.mp4", {"drop.mp4": "a film"}),
    "export": ("export {} -o OUT.mat", {"drop.mp4": "a film", "motion.parquet": "an angles table"}),
    "analyse": ("analyse {} -o OUT", {"scene.toml": "a scene", "encoder.csv": "an encoder recording"}),
}


@pytest.mark.parametrize("command", READERS)
def test_a_file_in_the_wrong_place_is_named_with_the_next_command(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    line, files = READERS[command]
    for file, noun in files.items():
        argv = line.replace("{}", str(DEMO / file)).replace("MOTION", str(DEMO / "motion.parquet")).split()
        argv = [
            str(DEMO / "encoder.csv") if w == "ENCODER" else w.replace("OUT", str(tmp_path / "out"))
            for w in argv
        ]
        assert main(argv) == 2, argv
        said = capsys.readouterr().err
        assert f"it is {noun}" in said, said
        assert re.search(r"Next: `(pydpend|tracker) \w+ ", said), said
        assert said.count("\n") == 1


@pytest.mark.parametrize(
    "line", ["compare FILM ENCODER -o OUT", "fit FILM -o OUT", "predict FILM --fit FIT -o OUT"]
)
def test_a_film_in_place_of_angles_is_told_the_whole_way(
    line: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "FIT").mkdir()
    (tmp_path / "FIT" / "fit.json").write_text(
        '{"method": "trajectory", "coefficients": {}, "parameters": {'
        '"psi": 1, "lambda": 1, "zeta": 0, "a3": 0, "sigma": 1, "kappa": 1, "m1": 1, "m2": 1, "l1": 1, "g": 9.81, '
        '"lower_inner": 0, "lower_outer": 0}}'
    )
    film = DEMO / "drop.mp4"
    words = {"FILM": film, "ENCODER": DEMO / "encoder.csv", "OUT": tmp_path / "out", "FIT": tmp_path / "FIT"}
    assert main([str(words.get(word, word)) for word in line.split()]) == 2
    stem = film.with_suffix("")
    assert (
        f"it is a film, not an angles table. Next: `tracker track {film} -o {stem}.parquet`, then `pydpend angles "
        f"{stem}.parquet -o {stem}-angles.parquet`, and give what that makes"
    ) in capsys.readouterr().err


@pytest.mark.parametrize("savez", [np.savez, np.savez_compressed])
def test_a_numpy_archive_is_named(
    savez: Callable[..., None], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "run.npz"
    savez(path, phi1=np.arange(5.0), t=np.arange(5.0))
    assert kind_of(path) == "npz"
    for line in (
        f"angles {path}",
        f"compare {path} {DEMO / 'encoder.csv'}",
        f"compare {DEMO / 'motion.parquet'} {path}",
    ):
        assert main([*line.split(), "-o", str(tmp_path / "out.csv")]) == 2
        said = capsys.readouterr().err
        assert "it is a NumPy archive (.npz), not " in said
        assert 'run.npy", numpy.load("' in said
        assert 'run.npz")["phi1"])' in said
        assert said.count("\n") == 1
