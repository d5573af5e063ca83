"""Tracks of other programs: whose they are, the same places from every form, and what is refused."""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pydpend as dp
import pytest
from pydpend.cli import main
from pydpend.kinds import kind_of, misplaced
from pydpend.nodes import Nodes
from pydpend.track_forms import FORMS, form_of

from tests.support import foreign_tracks
from tests.support.foreign_tracks import BODIES, BUNDLED, IMAGE_PX, NAMES, RATE_HZ, TRACKS, WRITERS, truth

pytestmark = pytest.mark.filterwarnings("ignore:No analog data:UserWarning:c3d")

DIGITS: dict[str, float] = {"walk.trc": 5.1e-6, "walk.c3d": 2e-5}
"""Half of the last digit that a form has: five decimals of TRC, 24 bits of C3D at 480."""

UPWARDS = ("xypts.csv", "kinovea.csv", "kinovea.txt", "qualisys.tsv", "walk.trc", "walk.c3d")
"""Forms with y up."""

RENAMED = ("trackpy.csv", "laptrack.csv", "spots.csv", "model.xml", "tracks.xml", "xypts.csv")
"""Forms that number points in place of naming them."""


def in_order(nodes: Nodes) -> list[int]:
    """Where the truth's points stand: by name, or where a form has numbers, in order."""
    names = nodes.rig.names
    return [names.index(n) for n in NAMES] if set(names) == set(NAMES) else list(range(4))


def same_places(nodes: Nodes, atol: float = 1e-12) -> None:
    """As in the truth, but for the place of frame 20 that a network is not sure of."""
    expected = truth()
    assert nodes.frame.tolist() == list(range(60))
    np.testing.assert_allclose(nodes.t_s, np.arange(60) / RATE_HZ, rtol=0, atol=1e-12)
    found = nodes.xy_px[:, in_order(nodes)]
    if np.isnan(found[20, 0]).all():
        expected[20, 0] = np.nan
    np.testing.assert_allclose(found, expected, rtol=0, atol=atol)
    nodes.check()


def written(name: str, folder: Path) -> tuple[Path, dict[str, Any]]:
    write, settings = WRITERS[name]
    write(folder / name, truth())
    size = {"image_px": IMAGE_PX} if name in UPWARDS else {}
    return folder / name, {**settings, **size}


@pytest.mark.parametrize("name", BUNDLED)
def test_a_file_that_its_own_library_wrote_is_read(name: str) -> None:
    nodes = dp.read_tracks(TRACKS / name, **BUNDLED[name])
    same_places(nodes)
    unsure = name.startswith(("deeplabcut", "movement"))
    assert np.isnan(nodes.xy_px[20, in_order(nodes)[0], 0]) == unsure
    assert any("confidence below 0.6" in note for note in nodes.notes) == unsure


def test_a_project_of_sleap_is_read_with_its_own_library() -> None:
    pytest.importorskip("sleap_io", reason="sleap-io is not installed: pip install --group fixtures")
    nodes = dp.read_tracks(TRACKS / "sleap.slp", fps=RATE_HZ)
    # It holds 24 bits of each number: 400 px to within 1.6e-5.
    same_places(nodes, 1.6e-5)
    assert nodes.rig.image_px == IMAGE_PX


@pytest.mark.parametrize("name", WRITERS)
def test_a_file_of_a_documented_form_is_read(name: str, tmp_path: Path) -> None:
    path, settings = written(name, tmp_path)
    nodes = dp.read_tracks(path, **settings)
    same_places(nodes, DIGITS.get(name, 1e-12))
    assert set(nodes.rig.names) == set(NAMES) or name in RENAMED


@pytest.mark.parametrize("name", [*BUNDLED, "sleap.slp", *WRITERS])
def test_whose_a_file_is_does_not_depend_on_its_name(name: str, tmp_path: Path) -> None:
    if name in WRITERS:
        path, _ = written(name, tmp_path)
    else:
        path = Path(shutil.copy(TRACKS / name, tmp_path / name))
    form = form_of(path)
    other = path.rename(tmp_path / "odd.mp4")
    assert form_of(other) == form
    assert form in FORMS
    assert kind_of(other) == ("nodes" if name == "truth.csv" else "tracks")


def test_a_form_in_place_of_another_file_is_named_with_the_command_that_reads_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, _ = written("xypts.csv", tmp_path)
    said = str(misplaced(path, ("angles",)))
    assert said.startswith(f"{path}: it is a table of DLTdv (xypts). Next: dp.read_tracks(")
    with pytest.raises(dp.TableError, match="it is a table of DLTdv"):
        dp.read_nodes(path)
    assert main(["angles", str(path), "-o", str(tmp_path / "a.csv")]) == 2
    assert "`pydpend import" in capsys.readouterr().err
    (tmp_path / "note.txt").write_text("Dear all,\n", "utf-8")
    with pytest.raises(dp.TableError, match=r"it is of no form of tracks that is known\. docs/how-to"):
        dp.read_tracks(tmp_path / "note.txt")
    with pytest.raises(dp.TableError, match="there is no such file"):
        dp.read_tracks(tmp_path / "none.csv")


def test_angles_of_imported_tracks_are_those_of_the_motion(tmp_path: Path) -> None:
    path, settings = written("tab.trk", tmp_path)
    nodes = dp.read_tracks(path, bodies=BODIES, **settings)
    assert nodes.rig.bodies == ("upper", "lower")
    t_s = nodes.t_s
    phi = np.stack([0.5 * np.cos(9 * t_s), 0.8 * np.sin(14 * t_s)], axis=1)
    angles = dp.angles(nodes, zero=[*phi[0]])
    # Two markers 80 and 100 px apart, each coordinate uncertain by 0.05 px: sigma sqrt(2) / distance.
    bound = foreign_noise() * np.sqrt(2) / np.array([80, 100])
    off = angles.phi_rad - phi
    assert (np.nanstd(off, axis=0) < 1.3 * bound).all()
    # The sigma of 0.05 px is found from the places, to within the 5 % that their number allows (see test_bare_nodes).
    np.testing.assert_allclose(np.nanmedian(angles.sigma_rad, axis=0), bound, rtol=0.15)


def foreign_noise() -> float:
    return 0.05


def test_files_of_one_point_each_become_one_table(tmp_path: Path) -> None:
    paths = []
    for n in range(4):
        foreign_tracks.osp_text(tmp_path / f"{n}.txt", truth(), n)
        paths.append(tmp_path / f"{n}.txt")
    nodes = dp.read_tracks(paths, unit="px", image_px=IMAGE_PX)
    assert nodes.rig.names == tuple(f"mass_{n}" for n in NAMES)
    same_places(nodes)
    text = paths[3].read_text("utf-8").replace("\n0.016\t", "\n0.0161\t")
    paths[3].write_text(text, "utf-8")
    with pytest.raises(
        dp.TableError, match=r"3\.txt: its time 0\.0161 s is not that of .*0\.txt, which has 0\.016 s"
    ):
        dp.read_tracks(paths, unit="px")
    with pytest.raises(dp.TableError, match=r"mass_pin is in another of the files too"):
        dp.read_tracks([paths[0], paths[0]], unit="px")


def test_a_table_of_t_x_and_y_is_tracks_only_where_tracks_are_asked_for(tmp_path: Path) -> None:
    """It may be an encoder's, which reads its columns by name."""
    foreign_tracks.osp_text(tmp_path / "bob.txt", truth())
    text = (tmp_path / "bob.txt").read_text("utf-8").partition("\n")[2]
    (tmp_path / "bob.txt").write_text(text, "utf-8")
    assert kind_of(tmp_path / "bob.txt") == "unknown"
    nodes = dp.read_tracks(tmp_path / "bob.txt", unit="px", image_px=IMAGE_PX)
    assert nodes.rig.names == ("bob",)
    np.testing.assert_allclose(nodes.xy_px[:, 0], truth()[:, 0], atol=1e-12)


def test_another_table_of_pandas_is_not_deeplabcut_s(tmp_path: Path) -> None:
    pd.DataFrame({"a": [1.0]}).to_hdf(tmp_path / "t.h5", key="data")
    assert form_of(tmp_path / "t.h5") is None
    read = pd.read_hdf(TRACKS / "deeplabcut.h5")
    read.to_hdf(tmp_path / "dlc.h5", key="df_with_missing", format="table")
    same_places(dp.read_tracks(tmp_path / "dlc.h5", fps=RATE_HZ))


def test_a_pickle_in_an_hdf5_makes_nothing_but_names(tmp_path: Path) -> None:
    import h5py

    pd.read_hdf(TRACKS / "deeplabcut.h5").to_hdf(tmp_path / "dlc.h5", key="df_with_missing", format="table")
    with h5py.File(tmp_path / "dlc.h5", "r+") as file:
        attributes = file["df_with_missing"].attrs
        attributes["non_index_axes"] = np.bytes_(f"cposix\nsystem\n(Vtouch {tmp_path}/made\ntR.")

    with pytest.raises(
        dp.TableError, match=r"dlc\.h5: it cannot be read \(a pickle in it asks for posix\.system\)"
    ):
        dp.read_tracks(tmp_path / "dlc.h5", fps=RATE_HZ)
    assert not (tmp_path / "made").exists()


def test_decimal_commas_of_kinovea(tmp_path: Path) -> None:
    foreign_tracks.kinovea_csv(tmp_path / "k.csv", truth(), comma=True)
    same_places(dp.read_tracks(tmp_path / "k.csv", unit="px", image_px=IMAGE_PX))


def test_columns_of_qualisys_may_be_named(tmp_path: Path) -> None:
    foreign_tracks.qualisys(tmp_path / "q.tsv", truth(), titles=True)
    nodes = dp.read_tracks(tmp_path / "q.tsv", image_px=IMAGE_PX)
    same_places(nodes)
    assert "3 points at exactly (0, 0, 0) are gaps" in nodes.notes
    assert "the plane is xz: x is to the right, z is up" in nodes.notes
    assert nodes.meta["settings"]["import"]["px_per_m"] == 1000


def test_tables_in_memory() -> None:
    import pyarrow as pa
    import xarray as xr

    for name in ("truth", "trackpy", "laptrack"):
        frame = pd.read_csv(TRACKS / f"{name}.csv")
        same_places(dp.read_tracks(frame, **BUNDLED[f"{name}.csv"]))
        same_places(dp.read_tracks(pa.Table.from_pandas(frame), **BUNDLED[f"{name}.csv"]))
    indexed = pd.read_csv(TRACKS / "trackpy.csv").set_index("frame", drop=False)
    same_places(dp.read_tracks(indexed, fps=RATE_HZ))
    same_places(dp.read_tracks(pd.read_hdf(TRACKS / "deeplabcut.h5"), fps=RATE_HZ))
    with xr.open_dataset(TRACKS / "movement.nc", engine="h5netcdf") as dataset:
        same_places(dp.read_tracks(dataset))
    with pytest.raises(dp.TableError, match="the table: its columns are of no form that is known: a, b"):
        dp.read_tracks(pd.DataFrame({"a": [1], "b": [2]}))
    with pytest.raises(dp.WrongTypeError, match="a int is no table"):
        dp.read_tracks(7)


def test_what_a_file_does_not_say_is_asked_for(tmp_path: Path) -> None:
    with pytest.raises(
        dp.TableError, match=r"it has no times and no rate: DeepLabCut counts frames alone\. .*fps=\.\.\."
    ):
        dp.read_tracks(TRACKS / "deeplabcut.csv")
    path, _ = written("kinovea.csv", tmp_path)
    with pytest.raises(
        dp.TableError,
        match=r"Kinovea does not say its unit of length\. Give px, m, cm, mm, um or in with unit",
    ):
        dp.read_tracks(path)
    for name, write in (("f.trc", foreign_tracks.trc), ("f.c3d", foreign_tracks.c3d)):
        write(tmp_path / name, truth(), "furl")
        with pytest.raises(dp.TableError, match=rf"{name}: its unit of length 'furl ?' is not known"):
            dp.read_tracks(tmp_path / name)
        same_places(dp.read_tracks(tmp_path / name, unit="mm", image_px=IMAGE_PX), DIGITS[f"walk.{name[2:]}"])


def test_lengths_are_millimetres_of_pixels(tmp_path: Path) -> None:
    metres = truth() / 1000
    metres[..., 1] = 0.479 - metres[..., 1]
    frame = pd.read_csv(TRACKS / "trackpy.csv")
    frame[["x", "y"]] /= 1000
    nodes = dp.read_tracks(frame, fps=RATE_HZ, unit="m")
    same_places(nodes, 1e-9)
    assert "the unit is taken to be m, and the file says px" in nodes.notes
    assert "places are in m and not in pixels: 1 px stands for 1 mm" in nodes.notes


def test_y_up_without_a_picture_puts_the_origin_somewhere_and_says_where(tmp_path: Path) -> None:
    path, _ = written("xypts.csv", tmp_path)
    nodes = dp.read_tracks(path, fps=RATE_HZ)
    about = nodes.meta["settings"]["import"]
    x, y = about["x_px_of_0"], about["y_px_of_0"]
    np.testing.assert_allclose(nodes.xy_px[..., 0] - x, truth()[..., 0], atol=1e-12)
    np.testing.assert_allclose(y - nodes.xy_px[..., 1], 479 - truth()[..., 1], atol=1e-12)
    assert (nodes.xy_px[nodes.seen] >= 0).all()
    assert any("y is up and the pictures' height is not known" in note for note in nodes.notes)
    down = dp.read_tracks(path, fps=RATE_HZ, y_axis="down")
    np.testing.assert_allclose(down.xy_px[..., 1], 479 - truth()[..., 1], atol=1e-12)


def test_points_and_confidence_are_chosen() -> None:
    nodes = dp.read_tracks(
        TRACKS / "deeplabcut.csv", fps=100, nodes=["tip", "pin"], min_confidence=0.2, sigma_px=0.5
    )
    assert nodes.rig.names == ("tip", "pin")
    np.testing.assert_array_equal(nodes.xy_px, truth()[:, [3, 0]])
    assert nodes.t_s[59] == 0.59
    assert (nodes.sigma_px[nodes.seen] == 0.5).all()
    assert nodes.meta["source"]["rate_origin"] == "user"
    with pytest.raises(dp.PydpendError, match="there is no point 'toe'"):
        dp.read_tracks(TRACKS / "deeplabcut.csv", fps=100, nodes=["toe"])


def test_points_that_move_in_space_are_not_taken_for_a_plane(tmp_path: Path) -> None:
    xyz = np.random.default_rng(1).uniform(0, 100, (20, 2, 3))
    lines = [
        "PathFileType\t4\t(X/Y/Z)\ts.trc",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
        "100\t100\t20\t2\tmm\t100\t1\t20",
        "Frame#\tTime\ta\t\t\tb\t\t",
        "\t\tX1\tY1\tZ1\tX2\tY2\tZ2",
        "",
        *(
            "\t".join([str(i + 1), repr(i / 100), *map(repr, row.ravel().tolist())])
            for i, row in enumerate(xyz)
        ),
    ]
    (tmp_path / "s.trc").write_text("\n".join(lines), "utf-8")
    with pytest.raises(
        dp.TableError, match=r"points move along all three axes .* Give xy, xz or yz with plane"
    ):
        dp.read_tracks(tmp_path / "s.trc")
    nodes = dp.read_tracks(tmp_path / "s.trc", plane="yz", image_px=(101, 101))
    np.testing.assert_allclose(nodes.xy_px[..., 0], xyz[..., 1])
    np.testing.assert_allclose(nodes.xy_px[..., 1], 100 - xyz[..., 2])
    assert any("points move along x too" in note for note in nodes.notes)


def test_points_of_two_cameras_are_not_put_into_one_picture(tmp_path: Path) -> None:
    (tmp_path / "d.csv").write_text(
        "pt1_cam1_X,pt1_cam1_Y,pt1_cam2_X,pt1_cam2_Y\n1.5,2.5,3.5,4.5\n1.6,2.6,3.6,4.6\n", "utf-8"
    )
    with pytest.raises(dp.TableError, match="its points are of cameras 1, 2, each with pictures of its own"):
        dp.read_tracks(tmp_path / "d.csv", fps=10)
    nodes = dp.read_tracks(tmp_path / "d.csv", fps=10, nodes=["pt1_cam2"])
    assert nodes.xy_px[:, 0, 0].tolist() == [2.5, 2.6]


CUT = [*BUNDLED, *WRITERS]


@pytest.mark.parametrize("name", CUT)
@pytest.mark.parametrize("part", [0.3, 0.8])
@pytest.mark.filterwarnings("ignore::tables.exceptions.UnclosedFileWarning")
@pytest.mark.filterwarnings("ignore:.*it may be cut off there:pydpend.RecordingWarning")
def test_a_file_that_is_cut_off_is_read_in_part_or_refused_in_one_line(
    name: str, part: float, tmp_path: Path
) -> None:
    if name in WRITERS:
        path, settings = written(name, tmp_path)
    else:
        path, settings = Path(shutil.copy(TRACKS / name, tmp_path / name)), BUNDLED[name]
    whole = path.read_bytes()
    path.write_bytes(whole[: int(part * len(whole))])
    said = ""
    try:
        assert 0 < len(dp.read_tracks(path, **settings)) <= 60
    except dp.PydpendError as problem:
        said = str(problem)
    assert "\n" not in said
    assert (str(path) in said) if said else not name.endswith((".h5", ".nc", ".xml", ".trk", ".kva"))


WORDS: dict[str, tuple[str, str, str]] = {
    "tracks.xml": ('encoding="UTF-8"', 'encoding="pTF-8"', "is not XML .unknown encoding: pTF-8"),
    "kinovea.kva": (";1000<", ";<", "a point of pin is '.*;.*;', and x;y;t is expected"),
    "kinovea.csv": ('"339.1590381213845"', '"1e999"', "frame 0: the place of pin is not finite"),
    "deeplabcut.csv": ("0.91", "much", "line 5, column pin likelihood: 'much.*' is not a number"),
    "spots.csv": (",0.004,1,", ",soon,1,", "line 10, column POSITION_T: 'soon' is not a number"),
    "tab.trk": (
        '<property name="x" type="double">3',
        '<property name="x" type="double">a3',
        "x of a step is 'a3",
    ),
    "model.xml": (' FRAME="0" ', ' FRAME="first" ', "FRAME of a Spot is 'first', which is not a number"),
    "qualisys.tsv": ("\t12.5\t", "\tdeep\t", "line 11, column pin Y: 'deep' is not a number"),
    "walk.trc": ("\n1\t0.000\t", "\n0\t0.000\t", "the frame is 0, and a whole number from 1 is expected"),
    "xypts.csv": ("NaN", "gone", "line 9, column pt4_cam1_X: 'gone' is not a number"),
    "sleap.analysis.csv": (
        "rig,1,",
        "rig,0,",
        "line 3: rig has a second place in frame 0, the first is in line 2",
    ),
}


@pytest.mark.parametrize("name", WORDS)
def test_what_is_wrong_in_a_file_is_named_with_its_place(name: str, tmp_path: Path) -> None:
    old, new, said = WORDS[name]
    if name in WRITERS:
        path, settings = written(name, tmp_path)
    else:
        path, settings = Path(shutil.copy(TRACKS / name, tmp_path / name)), BUNDLED[name]
    text = path.read_bytes().decode("utf-8").replace("\r\n", "\n")
    assert old in text
    path.write_text(text.replace(old, new, 1), "utf-8")
    with pytest.raises(dp.TableError, match=said) as caught:
        dp.read_tracks(path, **settings)
    assert name in str(caught.value)


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"fps": 0}, "fps: 0 is no number of frames per s"),
        ({"unit": "ell"}, "unit: 'ell' is not known. Give px, m, cm, mm, um or in"),
        ({"y_axis": "left"}, "y_axis: 'left' is not known"),
        ({"plane": "xy"}, "plane: .* has two coordinates"),
        ({"min_confidence": 2}, "min_confidence: 2 is no confidence"),
        ({"sigma_px": -1.0}, "sigma_px: -1.0 is no number of pixels"),
        ({"image_px": (0, 3)}, r"image_px: \(0, 3\) is no size"),
        ({"image_px": "64"}, "image_px: .* is needed, and this is '64'"),
        ({"fps": "25"}, "fps: a number is needed, and this is '25'"),
        ({"bodies": {"a": ["toe"]}}, "the body 'a' has a node 'toe' that is not there"),
    ],
)
def test_settings_that_make_no_sense_are_refused(settings: dict[str, Any], said: str) -> None:
    with pytest.raises(dp.PydpendError, match=said):
        dp.read_tracks(TRACKS / "deeplabcut.csv", **{"fps": RATE_HZ, **settings})


def test_the_command_makes_a_node_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "n.parquet"
    command = ["import", str(TRACKS / "deeplabcut.csv"), "-o", str(out)]
    assert main(command) == 2
    assert "Give the camera's frames per s with --fps" in capsys.readouterr().err
    whole = [
        *command,
        "--fps",
        "250",
        "--body",
        "upper=pin,mid",
        "--body",
        "lower=elbow,tip",
        "--image-px",
        "640x480",
    ]
    assert main(whole) == 0
    said = capsys.readouterr()
    assert "pin: 59 of 60 frames, body upper" in said.out
    assert f"read as DeepLabCut; written to {out}" in said.out
    assert said.err.count("note: ") == 2
    nodes = dp.read_nodes(out)
    same_places(nodes)
    assert nodes.rig.bodies == ("upper", "lower")
    assert main([*whole, "--force", "--json"]) == 0
    assert '"form": "DeepLabCut"' in capsys.readouterr().out
    for wrong, message in (
        (["--body", "upper"], "'upper' is no body"),
        (["--image-px", "big"], "'big' is no size"),
    ):
        assert main([*command, "--fps", "250", "--force", *wrong]) == 2
        assert re.search(rf"{wrong[0]}: {message}", capsys.readouterr().err)


def test_a_unit_that_puts_places_far_outside_the_pictures_is_refused_by_its_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "t.csv"
    rows = [f"{k},{k / 100},p{n},{100 + 50 * n + k % 7},{200 + 30 * n}" for k in range(20) for n in range(2)]
    path.write_text("frame,time_s,node,x_px,y_px\n" + "\n".join(rows) + "\n")
    size = ["--image-px", "640x480"]
    assert main(["import", str(path), "--unit", "m", *size, "-o", str(tmp_path / "n.parquet")]) == 2
    said = capsys.readouterr().err
    assert "--image-px, frame 0: in m, at 1 px for 1 mm, p0 is at (100000, 200000) px" in said
    assert said.rstrip().endswith(
        "Give the right unit with --unit, the right size with --image-px, or no size"
    )
    with pytest.raises(dp.PydpendError, match="far outside pictures of 64 x 48 px"):
        dp.read_tracks(path, image_px=(64, 48))
    # One place that a tracker got wrong is no wrong unit.
    path.write_text(path.read_text().replace("3,0.03,p1,153,230", "3,0.03,p1,99153,230"))
    assert len(dp.read_tracks(path, image_px=(640, 480))) == 20
