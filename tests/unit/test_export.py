"""Other programs' forms, read back by those programs' libraries or by their own rules."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pydpend as dp
import pytest
from pydpend.cli import main
from pydpend.exporting import export
from pydpend.nodes import SEEN, Nodes

from tests.support.drawn_nodes import some_nodes


def test_c3d_has_the_points_and_knows_which_are_missing(tmp_path: Path) -> None:
    import ezc3d

    nodes = some_nodes()
    export(nodes, tmp_path / "t.c3d", px_per_m=2000)
    file = ezc3d.c3d(str(tmp_path / "t.c3d"))
    points = file["data"]["points"]
    assert file["parameters"]["POINT"]["LABELS"]["value"] == ["n0", "n1", "n2"]
    assert file["parameters"]["POINT"]["UNITS"]["value"] == ["mm"]
    assert file["parameters"]["POINT"]["RATE"]["value"][0] == pytest.approx(500)
    # C3D holds 32-bit numbers: 240 mm to within 2e-5.
    np.testing.assert_allclose(points[0].T, nodes.xy_px[..., 0] / 2, atol=2e-5)
    np.testing.assert_allclose(points[1].T, (479 - nodes.xy_px[..., 1]) / 2, atol=2e-5)
    residuals = file["data"]["meta_points"]["residuals"][0].T
    assert np.array_equal(residuals < 0, ~nodes.seen)


def test_trc_has_a_header_and_leaves_empty_what_is_not_seen(tmp_path: Path) -> None:
    nodes = some_nodes()
    export(nodes, tmp_path / "t.trc")
    lines = (tmp_path / "t.trc").read_text().split("\n")
    assert lines[0] == "PathFileType\t4\t(X/Y/Z)\tt.trc"
    assert lines[2].split("\t") == ["500", "500", "50", "3", "px", "500", "11", "50"]
    assert lines[3] == "Frame#\tTime\tn0\t\t\tn1\t\t\tn2"
    assert lines[5] == ""
    for t in range(50):
        cells = lines[6 + t].split("\t")
        assert int(cells[0]) == nodes.frame[t] + 1
        assert float(cells[1]) == nodes.t_s[t]
        places = np.array([float(c) if c else np.nan for c in cells[2:]]).reshape(3, 3)
        np.testing.assert_allclose(places[:, 0], nodes.xy_px[t, :, 0], atol=1e-6)
        np.testing.assert_allclose(places[:, 1], 479 - nodes.xy_px[t, :, 1], atol=1e-6)


def test_dltdv_counts_from_one_and_from_below(tmp_path: Path) -> None:
    nodes = some_nodes()
    export(nodes, tmp_path / "t.csv")
    header, *rows = (tmp_path / "t.csv").read_text().splitlines()
    assert header == "pt1_cam1_X,pt1_cam1_Y,pt2_cam1_X,pt2_cam1_Y,pt3_cam1_X,pt3_cam1_Y"
    values = np.array([[float(c) for c in row.split(",")] for row in rows])
    assert values.shape == (60, 6), "one row per video frame, from the first on"
    assert np.isnan(values[:10]).all()
    np.testing.assert_allclose(values[10:, 0::2], nodes.xy_px[..., 0] + 1, atol=1e-6)
    np.testing.assert_allclose(values[10:, 1::2], 480 - nodes.xy_px[..., 1], atol=1e-6)


def test_mat_holds_everything(tmp_path: Path) -> None:
    from scipy.io import loadmat

    nodes = some_nodes()
    export(nodes, tmp_path / "t.mat")
    content = loadmat(tmp_path / "t.mat", squeeze_me=True)
    np.testing.assert_array_equal(content["x_px"], nodes.xy_px[..., 0])
    np.testing.assert_array_equal(content["time_s"], nodes.t_s)
    np.testing.assert_array_equal(content["status"], nodes.status)
    assert list(content["node"]) == ["n0", "n1", "n2"]


@pytest.mark.filterwarnings("ignore:No analog data")
def test_readers_that_are_not_the_writers_agree(tmp_path: Path) -> None:
    """Each form through a library that has no part in writing it, first frame to last."""
    import c3d
    import mat4py
    import pandas as pd
    from trc import TRCData

    nodes = some_nodes()
    up_px = np.where(nodes.seen[..., None], nodes.xy_px, np.nan)
    up_px[..., 1] = 479 - up_px[..., 1]
    for ending in ("c3d", "csv", "mat"):
        export(nodes, tmp_path / f"t.{ending}", px_per_m=2000)

    with (tmp_path / "t.c3d").open("rb") as file:
        reader = c3d.Reader(file)
        assert (reader.point_rate, reader.first_frame, reader.last_frame) == (500, 11, 60)
        assert [str(label) for label in reader.point_labels] == ["n0", "n1", "n2"]
        points = np.array([points for _, points, _ in reader.read_frames()])
    places = np.where(points[..., 3:4] < 0, np.nan, points[..., :2])
    np.testing.assert_allclose(places, up_px / 2, atol=2e-5)

    # This reader splits at any white space, so it cannot know which cell is empty: all nodes are seen here.
    columns = {name: np.nan_to_num(getattr(nodes, name), nan=0.5) for name in ("sigma_px", "area_px")}
    xy_px = np.where(nodes.seen[..., None], nodes.xy_px, np.arange(3)[:, None])
    whole = replace(nodes, xy_px=xy_px, status=np.full((50, 3), SEEN, dtype=np.uint8), **columns)
    export(whole, tmp_path / "whole.trc", px_per_m=2000)
    trc = TRCData()
    trc.load(str(tmp_path / "whole.trc"))
    assert (trc["DataRate"], trc["Units"], trc["Markers"]) == (500, "mm", ["n0", "n1", "n2"])
    assert trc["Time"] == list(nodes.t_s)
    places = np.array([trc[name] for name in nodes.rig.names]).transpose(1, 0, 2)[..., :2]
    np.testing.assert_allclose(places[..., 0], whole.xy_px[..., 0] / 2, atol=1e-6)
    np.testing.assert_allclose(places[..., 1], (479 - whole.xy_px[..., 1]) / 2, atol=1e-6)

    clicked = pd.read_csv(tmp_path / "t.csv").to_numpy()[10:].reshape(50, 3, 2)
    np.testing.assert_allclose(clicked, up_px + 1, atol=1e-6)

    mat = mat4py.loadmat(str(tmp_path / "t.mat"))
    assert mat["node"] == list(nodes.rig.names)
    np.testing.assert_array_equal(np.array(mat["y_px"]), nodes.xy_px[..., 1])


def _from_frame(first: int, count: int) -> Nodes:
    """A table of `count` frames from `first` on at 500 Hz: the drawn one again and again."""
    nodes = some_nodes()
    again = np.arange(count) % len(nodes)
    frame = first + np.arange(count)
    columns = {name: getattr(nodes, name)[again] for name in ("xy_px", "sigma_px", "area_px", "status")}
    return replace(nodes, frame=frame, t_s=frame / 500, **columns)


@pytest.mark.filterwarnings("ignore:No analog data")
def test_c3d_ends_where_its_numbers_do(tmp_path: Path) -> None:
    import c3d
    import ezc3d

    # The last number that every reader takes for itself; a table before it and one up to it are read back whole.
    for first, count in [(65484, 50), (64534, 1000)]:
        export(_from_frame(first, count), tmp_path / "t.c3d")
        assert ezc3d.c3d(str(tmp_path / "t.c3d"))["data"]["points"].shape[2] == count
        with (tmp_path / "t.c3d").open("rb") as file:
            reader = c3d.Reader(file)
            assert (reader.first_frame, reader.last_frame) == (first + 1, 65534)
            assert len(list(reader.read_frames())) == count
    (tmp_path / "t.c3d").unlink()
    # One frame more, many more, and a first number that would begin anew.
    for first, count, numbers in [
        (64535, 1000, "64536 to 65535"),
        (0, 70000, "1 to 70000"),
        (70000, 50, "70001 to 70050"),
    ]:
        nodes = _from_frame(first, count)
        with pytest.raises(
            dp.TableError, match=rf"t.c3d: its frames would have the numbers {numbers}, .* end at 65534"
        ):
            export(nodes, tmp_path / "t.c3d")
        assert list(tmp_path.iterdir()) == []
    export(nodes, tmp_path / "t.trc")
    export(nodes, tmp_path / "t.mat")


def test_what_a_form_cannot_hold_is_refused(tmp_path: Path) -> None:
    nodes = some_nodes()
    uneven = nodes.t_s.copy()
    uneven[30:] += 0.01
    for name in ("t.c3d", "t.trc"):
        with pytest.raises(dp.TableError, match="after frame 39 the step is"):
            export(replace(nodes, t_s=uneven), tmp_path / name)
    with pytest.raises(dp.ArgumentError, match="the ending is none of"):
        export(nodes, tmp_path / "t.doc")
    with pytest.raises(dp.ArgumentError, match="no scale"):
        export(nodes, tmp_path / "t.trc", px_per_m=-1)
    with pytest.raises(dp.TableError, match="cannot be written"):
        export(nodes, tmp_path / "nowhere" / "t.trc")
    assert list(tmp_path.iterdir()) == []


def test_the_command_line_writes_and_does_not_overwrite(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    some_nodes().write(tmp_path / "t.parquet")
    arguments = ["export", str(tmp_path / "t.parquet"), "-o", str(tmp_path / "t.trc")]
    assert main([*arguments, "--json"]) == 0
    assert '"frames": 50' in capsys.readouterr().out
    assert main(arguments) == 2
    assert "it is there already" in capsys.readouterr().err
    assert main([*arguments, "--force"]) == 0
