"""A run folder that comes from anyone: nothing outside it is deleted, written or drawn, and what is odd is one line."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from pydpend.analyse import Options, analyse
from pydpend.analyse.contents import about, made_by
from pydpend.analyse.folder import RUN_SCHEMA, RunFolder, RunFolderError
from pydpend.cli import main
from pydpend.errors import PydpendError
from pydpend.recording_folder import RunFileError
from pydpend.run_folder import read_run


def test_every_file_of_a_run_is_one_that_its_stage_makes(demo_run: Path) -> None:
    stages = json.loads((demo_run / "run.json").read_text())["stages"]
    for stage, done in stages.items():
        assert done["files"]
        for name in done["files"]:
            assert made_by(stage, name), (stage, name)
            assert about(name)
    assert made_by("fit", "fit/energy-12.csv")
    assert made_by("prediction", "trial_2/windows.csv")
    assert made_by("prediction", "prediction.json")
    assert not made_by("fit", "fit/energy.txt")
    assert not made_by("fit", "fit/shares-2.png")


OUTSIDE = (
    "../precious.txt",
    "../fit.json",
    "/tmp/fit.json",
    "drop/../../fit.json",
    "drop/../../precious/fit.json",
    "fit/../../fit.json",
    "./fit.json",
    "drop//fit.json",
    "other/fit.json",
    "drop/notes.txt",
    "drop/sub/fit.json",
    "drop\\..\\fit.json",
    "fit.json",
    "",
    "..",
    "drop/energy/../../../fit.json",
    "drop/energy\n.csv",
)


@pytest.mark.parametrize("name", OUTSIDE)
def test_names_that_no_stage_makes_are_refused(tmp_path: Path, name: str) -> None:
    folder = tmp_path / "run"
    folder.mkdir()
    precious = [tmp_path / n for n in ("precious.txt", "fit.json")]
    for path in precious:
        path.write_text("mine")
    done = {"key": "", "files": {name: ""}, "message": "", "seconds": 1.0}
    for stage in ("drop/angles", "../drop/angles", "fit"):
        if stage == "fit" and name.startswith("fit/") and ".." not in name:
            continue
        record = {"schema": RUN_SCHEMA, "facts": {}, "stages": {stage: done}, "begun": {}}
        (folder / "run.json").write_text(json.dumps(record))
        with pytest.raises(RunFolderError, match="is no file that this stage makes") as caught:
            RunFolder.open(folder)
        assert "\n" not in str(caught.value)
    assert all(path.read_text() == "mine" for path in precious)


@pytest.mark.parametrize("which", ["drop", "fit", "unfinished"])
def test_a_folder_that_is_a_link_is_refused(tmp_path: Path, which: str) -> None:
    elsewhere, folder = tmp_path / "elsewhere", tmp_path / "run"
    elsewhere.mkdir()
    folder.mkdir()
    (elsewhere / "angles.json").write_text("mine")
    (folder / which).symlink_to(elsewhere)
    done = {"key": "", "files": {"drop/angles.json": ""}, "message": "", "seconds": 1.0}
    record = {"schema": RUN_SCHEMA, "facts": {}, "stages": {"drop/angles": done}, "begun": {}}
    (folder / "run.json").write_text(json.dumps(record))
    with pytest.raises(RunFolderError, match="is a link to another place"):
        RunFolder.open(folder)
    assert (elsewhere / "angles.json").read_text() == "mine"


def test_a_link_in_the_place_of_a_temporary_file_is_not_written_through(tmp_path: Path) -> None:
    precious, run = tmp_path / "precious.txt", RunFolder.open(tmp_path / "run")
    precious.write_text("mine")
    os.symlink(precious, run.path / "run.json.new")
    run.save()
    assert precious.read_text() == "mine"
    assert json.loads((run.path / "run.json").read_text())["stages"] == {}


def _set(*keys: str | int, to: Any) -> Callable[[dict[str, Any]], Any]:
    def change(value: dict[str, Any]) -> Any:
        at: Any = value
        for key in keys[:-1]:
            at = at[key]
        at[keys[-1]] = to
        return value

    return change


ODD: dict[str, tuple[Callable[[dict[str, Any]], Any], str]] = {
    "a list": (lambda value: [value], "a table is expected, the JSON is a list"),
    "a number": (lambda value: 3, "a table is expected, the JSON is a number"),
    "no schema": (lambda value: {k: v for k, v in value.items() if k != "schema"}, "there is no key schema"),
    "a schema in words": (_set("schema", to="3"), "key schema: a whole number from 0"),
    "a schema beyond all": (_set("schema", to=10**30), "key schema: a whole number from 0"),
    "a newer schema": (_set("schema", to=99), "schema 99 is not known"),
    "stages in a list": (_set("stages", to=[]), "key stages: a table is expected, not []"),
    "a stage in words": (
        _set("stages", "drop/angles", to="done"),
        "key stages.drop/angles: a table is expected",
    ),
    "seconds in words": (
        _set("stages", "drop/angles", "seconds", to="1"),
        "seconds: a number is expected, not '1'",
    ),
    "seconds that are none": (
        _set("stages", "drop/angles", "seconds", to=float("nan")),
        "a finite number is expected",
    ),
    "digests in words": (_set("facts", "digests", to={"/a": "b"}), "key facts.digests./a: a list of values"),
    "digests too short": (_set("facts", "digests", to={"/a": [1]}), "size, time of change and SHA-256"),
    "begun in a list": (_set("begun", to=[1]), "key begun: a table is expected, not [1]"),
}


@pytest.mark.parametrize("kind", ODD)
def test_an_odd_record_is_one_line(
    demo_options: Options, tmp_path: Path, kind: str, capsys: pytest.CaptureFixture[str]
) -> None:
    change, message = ODD[kind]
    done = {"key": "", "files": {}, "message": "", "seconds": 1.0}
    record = {"schema": RUN_SCHEMA, "facts": {}, "stages": {"drop/angles": done}, "begun": {}}
    (tmp_path / "run.json").write_text(json.dumps(change(record)))
    assert main(["analyse", *demo_options.inputs, "-o", str(tmp_path)]) == 2
    said = capsys.readouterr().err
    assert message in said
    assert said.count("\n") == 1
    assert "run.json" in said


def test_names_of_recordings_stay_in_the_folder(tmp_path: Path) -> None:
    for name in ("../other", "/etc", "..", "", "a/b"):
        recording = {"name": name, "label": "drop.mp4", "path": "drop.mp4", "kind": "film"}
        (tmp_path / "run.json").write_text(json.dumps({"facts": {"recordings": [recording]}}))
        with pytest.raises(
            RunFileError, match=r"key facts\.recordings\[0\]\.name: .* is no folder of the run"
        ):
            read_run(tmp_path)


def test_a_damaged_file_is_made_again(tmp_path: Path) -> None:
    """A bit that flips keeps the size: the file's SHA-256 tells, and the stage is done again."""
    motion = Path(__file__).parent.parent.parent / "fixtures" / "demo" / "motion.parquet"
    options = Options(inputs=(str(motion),), comparison=False, prediction=False, start_s=0.6)
    folder = tmp_path / "run"
    assert analyse(options, folder).stages["motion/angles"] == "done"
    angles = folder / "motion" / "angles.parquet"
    whole = angles.read_bytes()
    angles.write_bytes(whole[:500] + bytes([whole[500] ^ 16]) + whole[501:])
    again = analyse(options, folder)
    assert again.stages["motion/angles"] == "done"
    assert angles.read_bytes() == whole
    assert set(analyse(options, folder).stages.values()) == {"kept"}


FIT = {
    "shares in a list": (_set("shares", to=[]), "shares", "key shares: a table is expected"),
    "a share in words": (
        _set("shares", "law", "viscous", "value", to="much"),
        "shares",
        "shares.law.viscous.value",
    ),
    "no coefficients": (_set("coefficients", to={"mu_v1": 3}), "coefficients", "coefficients.mu_v1: a table"),
    "a coefficient that is none": (
        _set("coefficients", "mu_v1", "value", to=None),
        "coefficients",
        "not null",
    ),
}


@pytest.mark.parametrize("kind", FIT)
def test_a_figure_of_an_odd_fit_is_one_line(
    demo_run: Path, tmp_path: Path, kind: str, capsys: pytest.CaptureFixture[str]
) -> None:
    change, figure, message = FIT[kind]
    shutil.copytree(demo_run, tmp_path / "run")
    path = tmp_path / "run" / "fit" / "fit.json"
    path.write_text(json.dumps(change(json.loads(path.read_text()))))
    assert main(["plot", figure, str(tmp_path / "run"), "-o", str(tmp_path / "a.png")]) == 2
    said = capsys.readouterr().err
    assert message in said
    assert said.count("\n") == 1


def test_every_figure_of_damaged_tables_is_one_line(demo_run: Path, tmp_path: Path) -> None:
    from pydpend.plots.folder import DRAWINGS, figure_of

    run = tmp_path / "run"
    shutil.copytree(demo_run, run)
    for path in run.rglob("*"):
        if path.suffix in (".parquet", ".csv", ".json") and path.name != "run.json":
            path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    for name in DRAWINGS:
        if name == "maps":
            continue
        with pytest.raises(PydpendError) as caught:
            figure_of(name, run)
        assert "\n" not in str(caught.value)
