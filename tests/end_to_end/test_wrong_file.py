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

FIT = (
    '{"method": "trajectory", "coefficients": {}, "parameters": {'
    '"psi": 1, "lambda": 1, "zeta": 0, "a3": 0, "sigma": 1, "kappa": 1, "m1": 1, "m2": 1, "l1": 1, "g": 9.81, '
    '"lower_inner": 0, "lower_outer": 0}}'
)
"""The least that a fit holds."""


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
    "export": ("export {} -o OUT.mat", {"drop.mp4": "a film", "encoder.csv": "an encoder recording"}),
    "import": ("import {} -o OUT.csv", {"drop.mp4": "a film", "motion.parquet": "an angles table"}),
    "find-rig": ("find-rig {} -o OUT.csv", {"drop.mp4": "a film", "motion.parquet": "an angles table"}),
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
    (tmp_path / "FIT" / "fit.json").write_text(FIT)
    film = DEMO / "drop.mp4"
    words = {"FILM": film, "ENCODER": DEMO / "encoder.csv", "OUT": tmp_path / "out", "FIT": tmp_path / "FIT"}
    assert main([str(words.get(word, word)) for word in line.split()]) == 2
    stem = film.with_suffix("")
    assert (
        f"it is a film, not an angles table. Next: `pydpend track {film} -o {stem}.parquet`, then `pydpend angles "
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


KINDS = {
    "film": "a film",
    "pictures": "a folder of pictures",
    "nodes.csv": "a node table",
    "truth.csv": "the truth of a film",
    "angles.csv": "an angles table",
    "encoder.csv": "an encoder recording",
    "holds": "a folder of tables",
    "calibration.json": "an encoder calibration",
    "rig.toml": "a rig file",
    "scene.toml": "a scene to film",
    "model.toml": "a pendulum's model file",
    "config.toml": "a file of options",
    "run": "a run folder",
    "fit": "a damping fit",
    "page.html": "a page for a browser",
    "arrays.npz": "a NumPy archive",
}
"""Every kind of file, and what it is called."""

PLACES: dict[str, tuple[str, ...]] = {
    "angles {} -o OUT.csv": ("nodes.csv",),
    "fit {} -o OUT": ("angles.csv",),
    "fit MOTION --model {} -o OUT": ("model.toml",),
    "compare {} ENCODER -o OUT": ("angles.csv",),
    "compare MOTION {} -o OUT": ("encoder.csv", "angles.csv"),
    "compare MOTION ENCODER --calibration {} -o OUT": ("calibration.json", "holds", "encoder.csv"),
    "calibrate {} -o OUT.json": ("encoder.csv", "holds"),
    "predict {} --fit FIT -o OUT": ("angles.csv",),
    "predict MOTION --fit {} -o OUT": ("fit",),
    "plot energy {} -o OUT.pdf": ("run",),
    "plot {} -o OUT.pdf": (),
    "animate {} -o OUT.mp4": ("run",),
    "export {} -o OUT.mat": ("nodes.csv", "angles.csv"),
    "import {} -o OUT.csv": ("nodes.csv",),
    "analyse {} -o OUT": ("film", "pictures", "nodes.csv", "angles.csv"),
    "analyse FILM --rig {} -o OUT": ("rig.toml",),
    "analyse FILM --encoder {} -o OUT": ("encoder.csv", "angles.csv"),
    "analyse FILM --encoder ENCODER --calibration {} -o OUT": ("calibration.json", "holds", "encoder.csv"),
    "analyse FILM --model {} -o OUT": ("model.toml",),
    "analyse FILM --zero {} -o OUT": ("film", "pictures", "nodes.csv"),
    "analyse FILM --config {} -o OUT": ("config.toml",),
    "{}": (),
}
"""Every place of a file on the command line, and which kinds belong there."""


@pytest.fixture(scope="module")
def kinds(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A file or folder of each kind; what is behind their beginnings does not matter."""
    folder = tmp_path_factory.mktemp("kinds")
    for name, text in {
        "nodes.csv": "frame,time_s,node,body,x_px,y_px,sigma_px,area_px,status\n",
        "truth.csv": "frame,time_s,node,body,x_px,y_px,visible\n",
        "angles.csv": "time_s,phi1_rad,phi2_rad\n",
        "encoder.csv": "time_s,voltage_v\n",
        "calibration.json": '{"offset_v": 0, "slope_v_per_rad": 0.1, "holds": []}',
        "rig.toml": "[[node]]\nname = 'n0'\n",
        "model.toml": "[[part]]\nname = 'bar'\n",
        "config.toml": "inputs = []\n",
        "page.html": "<!DOCTYPE html>\n",
        "run/run.json": "{}",
        "fit/fit.json": FIT,
        "pictures/a_001.png": "",
    }.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text)
    np.savez(folder / "arrays.npz", phi=np.arange(3.0))
    places = {"film": DEMO / "drop.mp4", "holds": DEMO / "calibration", "scene.toml": DEMO / "scene.toml"}
    return {name: places.get(name, folder / name) for name in KINDS}


@pytest.mark.parametrize("line", PLACES)
def test_every_kind_of_file_in_every_place_is_named_with_what_comes_next(
    line: str, kinds: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = {"MOTION": DEMO / "motion.parquet", "ENCODER": DEMO / "encoder.csv", "FILM": kinds["film"]}
    words |= {"FIT": kinds["fit"], "OUT": tmp_path / "out", "OUT.csv": tmp_path / "out.csv"}
    words |= {f"OUT.{ending}": tmp_path / f"out.{ending}" for ending in ("json", "pdf", "mp4", "mat")}
    for name, path in kinds.items():
        if name in PLACES[line]:
            continue
        argv = [str(path if word == "{}" else words.get(word, word)) for word in line.split()]
        assert main(argv) == 2, argv
        said = capsys.readouterr().err
        assert f"it is {KINDS[name]}" in said, (argv, said)
        wanted = r"Next: `(pydpend|tracker) \w+ |Give its |Its page is |Open it in|Write its arrays"
        assert re.search(wanted, said), (argv, said)
        assert said.count("\n") == 1, (argv, said)
