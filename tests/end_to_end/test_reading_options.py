"""Every command and function that reads a film takes every option of reading and detecting."""

from __future__ import annotations

import argparse
import inspect
import re
import subprocess
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pydpend as dp
import pytest
from pydpend import _typing, tracking
from pydpend.analyse import Options, plan
from pydpend.cli import analyse as command
from pydpend.cli import main
from pydpend.errors import ArgumentError, OptionError, TrackerError
from pydpend.option_fields import flag_of
from pydpend.reading_options import WORDS, OpenOptions, ReadingOptions

ROOT = Path(__file__).resolve().parents[2]
OPENING = [f.name for f in fields(OpenOptions)]
READING = [f.name for f in fields(ReadingOptions)]


@pytest.mark.parametrize(
    ("function", "names"),
    [(dp.track, READING), (dp.setup, READING), (dp.info, OPENING), (dp.overlay, OPENING)],
)
def test_functions_take_every_option_with_its_default(function: object, names: list[str]) -> None:
    given = inspect.signature(function).parameters  # type: ignore[arg-type]
    plain = ReadingOptions()
    for name in names:
        # What interlaced film is can be told of interlaced film too.
        if (function, name) != (dp.info, "interlaced"):
            assert given[name].default == getattr(plain, name), name


@pytest.mark.parametrize(
    ("name", "names"), [("track", READING), ("setup", READING), ("info", OPENING), ("overlay", OPENING)]
)
def test_the_program_tracker_takes_every_option(name: str, names: list[str]) -> None:
    program = ROOT / "target" / "release" / "tracker"
    text = subprocess.run([program, name, "--help"], check=True, capture_output=True, text=True).stdout
    assert {flag_of(n) for n in names} <= set(re.findall(r"--[a-z-]+", text))


def test_analyse_takes_every_option() -> None:
    parser = argparse.ArgumentParser()
    command.add_arguments(parser)
    dests = {action.dest for action in parser._actions}
    assert set(READING) <= dests
    assert {f.name for f in fields(Options)} >= set(READING)


def test_words_are_those_of_the_compiled_half() -> None:
    for name in ("polarity", "centroid", "decoder", "interlaced"):
        assert list(get_args(getattr(_typing, name.capitalize()))) == WORDS[name]


@pytest.fixture(scope="module")
def film(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("reading") / "clean.mraw"
    dp.film("clean", path, frames=60)
    return path


def test_what_is_asked_of_a_film_is_done(film: Path) -> None:
    nodes = dp.track(film, frames="10..50", progress=False)
    assert nodes.frame.tolist() == list(range(10, 50))
    seen = nodes.xy_px[np.isfinite(nodes.xy_px).all(axis=2)]
    (x0, y0), (x1, y1) = (seen.min(axis=0) - 20).tolist(), (seen.max(axis=0) + 20).tolist()
    same = dp.track(film, frames=(10, 50), region=(x0, y0, x1, y1), progress=False)
    assert np.array_equal(same.xy_px, nodes.xy_px, equal_nan=True)
    # Without the left half some markers are not seen at times.
    right = f"{(x0 + x1) / 2},{y0},{x1},{y1}"
    half = dp.track(film, nodes.rig, frames=range(10, 50), region=right, progress=False)
    x = half.xy_px[..., 0]
    assert np.isnan(x).sum() > np.isnan(nodes.xy_px[..., 0]).sum()
    assert np.nanmin(x) > (x0 + x1) / 2 - 1


def test_every_centre_can_be_followed_and_is_the_one_that_was_asked_for(film: Path) -> None:
    found = {c: dp.track(film, centroid=c, progress=False) for c in ("disc", "weighted", "contour")}
    said = {c: n.meta["settings"]["detect"]["centroid"] for c, n in found.items()}
    assert said == {"disc": "disc", "weighted": "intensity_weighted", "contour": "contour"}
    truth = dp.Film("clean", frames=60).truth().xy_px
    for centroid, nodes in found.items():
        assert np.isfinite(nodes.xy_px).all(axis=2).mean() > 0.8, centroid
        # Each node's nearest true marker, in frames where it is seen.
        apart = np.linalg.norm(nodes.xy_px[:, :, None] - truth[:, None], axis=3).min(axis=2)
        off = np.sqrt(np.nanmean(apart**2))
        # Of discs a few thousandths of a pixel, by intensity some thousandths, by whole pixels' outlines hundredths.
        assert off < {"disc": 0.01, "weighted": 0.03, "contour": 0.15}[centroid], (centroid, off)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"region": "1,2,3"}, "region: expected X0,Y0,X1,Y1"),
        ({"region": (1, 2, 3)}, "region: expected X0,Y0,X1,Y1"),
        ({"frames": "5-9"}, "frames: .*expected A..B"),
        ({"frames": "9..5"}, "frames: .* holds no frame"),
        ({"min_area_px": -1.0}, "min_area_px: it is not an area"),
        ({"centroid": "centre"}, "centroid: .* is not known. Give disc, weighted or contour"),
        ({"threads": 0}, "threads: 0 is out of range"),
    ],
)
def test_what_makes_no_sense_is_refused_with_its_name(
    options: dict[str, object], said: str, film: Path
) -> None:
    with pytest.raises(ArgumentError, match=said):
        dp.track(film, progress=False, **options)  # type: ignore[arg-type]


def test_analyse_does_not_take_what_its_inputs_have_no_use_for(film: Path, tmp_path: Path) -> None:
    table = tmp_path / "nodes.parquet"
    dp.track(film, output=table, progress=False)
    with pytest.raises(OptionError, match="polarity"):
        plan(Options(inputs=(str(table),), polarity="dark"), tmp_path / "run")
    # Another option is another film's nodes: the stage is done again.
    keys = {
        options.polarity: plan(options, tmp_path / "run")[0].key
        for options in (Options(inputs=(str(film),), polarity=p) for p in ("auto", "bright"))
    }
    assert keys["auto"] != keys["bright"]


def test_an_error_says_its_kind_as_data(film: Path, tmp_path: Path) -> None:
    """What the library's `FaultKind` says, beside the words."""
    empty, text = tmp_path / "empty.mp4", tmp_path / "text.mp4"
    empty.touch()
    text.write_text("no film at all\n" * 100)
    table = tmp_path / "t.csv"
    dp.track(film, output=table, progress=False)
    calls: dict[str, Callable[[], object]] = {
        "missing": lambda: dp.info(tmp_path / "none.mp4"),
        "damaged": lambda: dp.info(empty),
        "unsupported": lambda: dp.info(text),
        "exists": lambda: dp.track(film, output=table, progress=False),
        "setting": lambda: dp.info(film, fps=-1.0),
    }
    for kind, call in calls.items():
        with pytest.raises(TrackerError) as raised:
            call()
        assert raised.value.kind == kind, raised.value


def photron(folder: Path, color_type: str) -> Path:
    """A Photron recording of one frame whose header says how its pixels are coloured."""
    values: dict[str, int | str] = {
        "Image Width": 64,
        "Image Height": 64,
        "Record Rate(fps)": 500,
        "Total Frame": 1,
    }
    values |= {"Color Type": color_type, "Color Bit": 8, "EffectiveBit Depth": 8}
    header = folder / "film.cih"
    lines = ["#Camera Information Header", *(f"{name} : {value}" for name, value in values.items())]
    header.write_text("\n".join(lines) + "\n")
    header.with_suffix(".mraw").write_bytes(bytes(64 * 64))
    return header


def test_a_fault_of_a_camera_s_file_says_its_kind(tmp_path: Path) -> None:
    header_of_norpix = b"\xed\xfe\0\0N\0o\0r\0p\0i\0x\0" + bytes(100)
    cut = {"cut.seq": header_of_norpix, "cut.tif": b"II*\0" + b"\xff" * 20}
    for name, content in cut.items():
        (tmp_path / name).write_bytes(content)
    interlaced = tmp_path / "interlaced.mpg"
    lines = "testsrc=size=64x64:rate=25:duration=0.4,tinterlace=4,fieldorder=tff"
    coded = ["-flags", "+ilme+ildct", "-c:v", "mpeg2video"]
    subprocess.run(["ffmpeg", "-v", "error", "-f", "lavfi", "-i", lines, *coded, interlaced], check=True)
    calls: list[tuple[str, Callable[[], object]]] = [
        *(("damaged", lambda name=name: dp.info(tmp_path / name)) for name in cut),
        ("unsupported", lambda: dp.info(photron(tmp_path, "Color"))),
        ("unsupported", lambda: dp.track(interlaced, progress=False)),
    ]
    assert dp.info(photron(tmp_path, "Mono"))["width"] == 64
    for kind, call in calls:
        with pytest.raises(TrackerError) as raised:
            call()
        assert raised.value.kind == kind, raised.value


def test_the_threads_that_analyse_is_given_are_those_of_tracking(
    film: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    used: list[int | None] = []

    def track(*args: Any, threads: int | None = None, **kwargs: Any) -> dp.Nodes:
        used.append(threads)
        return dp.track(*args, threads=threads, **kwargs)

    monkeypatch.setattr(tracking, "track", track)
    words = ["analyse", str(film), "--quiet", "--zero", "reference_frame", "--no-overlay", "-o"]
    tables = []
    for count in (1, 2):
        # What comes after tracking needs a longer decay than this film has.
        main([*words, str(tmp_path / f"run{count}"), "--threads", str(count)])
        (table,) = (tmp_path / f"run{count}").rglob("nodes.parquet")
        tables.append(table.read_bytes())
    assert used == [1, 2]
    assert tables[0] == tables[1]
    capsys.readouterr()
    for wrong in ("0", "-1", "two", "1.5"):
        assert main([*words, str(tmp_path / "none"), f"--threads={wrong}"]) == 2
        assert "--threads" in capsys.readouterr().err
    assert not (tmp_path / "none").exists()


def test_a_count_of_a_damaged_film_says_so_by_its_status(tmp_path: Path) -> None:
    whole = ROOT / "fixtures" / "demo" / "drop.mp4"
    damaged, cut = tmp_path / "damaged.mp4", tmp_path / "cut.mkv"
    data = bytearray(whole.read_bytes())
    data[len(data) // 2 : len(data) // 2 + 400] = bytes(400)
    damaged.write_bytes(data)
    program = ROOT / "target" / "release" / "tracker"
    subprocess.run(["ffmpeg", "-v", "error", "-i", whole, "-c", "copy", "-frames:v", "500", cut], check=True)
    cut.write_bytes(cut.read_bytes()[:-5000])
    for film, status, said in (
        (whole, 0, "5001"),
        (damaged, 1, "cannot be decoded"),
        (cut, 1, "the file ends"),
    ):
        counted = subprocess.run(
            [program, "info", "--count", film], capture_output=True, text=True, check=False
        )
        assert counted.returncode == status, counted
        assert said in counted.stdout + counted.stderr
        # Without a count nothing of it is decoded.
        assert subprocess.run([program, "info", film], capture_output=True, check=False).returncode == 0
