"""Node tables and arrays that no tracker of ours made: what is read, what is assumed, what is refused."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pydpend as dp
import pytest
from pydpend.cli import main
from pydpend.nodes import MISSING, SEEN

from tests.support.drawn_nodes import some_nodes

T_S = np.arange(1000) / 250
NOISE_PX = 0.05
NAMES = ("pin", "mid", "tip")
BODIES = {"bob": NAMES}


def swing() -> tuple[Any, Any]:
    """A link of three markers that swings about (320, 100) px: its angle in rad (T,) and its places (T, 3, 2)."""
    phi = 0.6 * np.exp(-T_S / 5) * np.cos(2 * np.pi * 1.1 * T_S)
    places = [np.stack([320 + r * np.sin(phi), 100 + r * np.cos(phi)], axis=1) for r in (60, 110, 160)]
    noise = NOISE_PX * np.random.default_rng(5).standard_normal((T_S.size, 3, 2))
    return phi, np.stack(places, axis=1) + noise


def long_frame() -> Any:
    import pandas as pd

    _, xy = swing()
    return pd.DataFrame(
        {
            "frame": np.repeat(np.arange(T_S.size), 3),
            "time_s": np.repeat(T_S, 3),
            "node": np.tile(NAMES, T_S.size),
            "body": "bob",
            "x_px": xy[..., 0].ravel(),
            "y_px": xy[..., 1].ravel(),
        }
    )


def test_arrays_become_nodes_whose_angles_are_those_of_the_motion() -> None:
    phi, xy = swing()
    nodes = dp.Nodes.from_arrays(T_S, xy, names=NAMES, bodies=BODIES, image_px=(640, 480))
    nodes.check()
    np.testing.assert_array_equal(nodes.xy_px, xy)
    # Of 6 x 992 residuals, the scatter of a standard deviation is 1 / sqrt(2 x 5952) = 0.9 %, more as they overlap.
    assert nodes.sigma_px[0, 0] == pytest.approx(NOISE_PX, rel=0.05)
    assert ["no uncertainty is given" in note for note in nodes.notes] == [True]
    assert nodes.rig.reference_frame == 0
    angles = dp.angles(nodes, zero=[phi[0]])
    off = angles.phi_rad[:, 0] - phi
    # The Cramer-Rao bound of three markers at -50, 0 and 50 px from their middle; std takes the zero off.
    bound = NOISE_PX / np.hypot(50, 50)
    assert np.std(off) == pytest.approx(bound, rel=0.1)
    assert np.median(angles.sigma_rad) == pytest.approx(bound, rel=0.1)


@pytest.mark.parametrize("form", ["csv", "tsv", "parquet", "renamed.csv"])
def test_a_table_of_anyone_s_is_read_from_any_file(form: str, tmp_path: Path) -> None:
    _, xy = swing()
    frame = long_frame()
    path = tmp_path / f"t.{form}"
    if form == "parquet":
        frame.to_parquet(path)
    else:
        # repr's digits give each number back to the last bit.
        frame.to_csv(path, index=False, sep="\t" if form == "tsv" else ",")
    nodes = dp.read_nodes(path)
    np.testing.assert_array_equal(nodes.xy_px, xy)
    np.testing.assert_array_equal(nodes.t_s, T_S)
    assert nodes.rig.bodies == ("bob",)
    assert nodes.complete
    assert {n.name for n in nodes.rig.nodes} == set(NAMES)
    nodes.write(tmp_path / "ours.parquet")
    back = dp.read_nodes(tmp_path / "ours.parquet")
    assert back.notes == nodes.notes
    np.testing.assert_array_equal(back.xy_px, xy)


def test_rows_in_any_order_and_rows_that_are_not_there(tmp_path: Path) -> None:
    frame = long_frame()
    kept = frame.drop(index=[4, 5, 2999]).sample(frac=1, random_state=1)
    kept.drop(columns="body").to_csv(tmp_path / "t.csv", index=False)
    nodes = dp.read_nodes(tmp_path / "t.csv")
    order = [nodes.rig.names.index(name) for name in NAMES]
    lost = np.argwhere(nodes.status[:, order] == MISSING).tolist()
    assert lost == [[1, 1], [1, 2], [999, 2]]
    assert "3 of 3000 rows are not there: these nodes are missing" in nodes.notes
    assert any("no bodies are given" in note for note in nodes.notes)
    assert set(nodes.rig.bodies) == set(NAMES)


def test_what_stands_beside_the_places_is_kept(tmp_path: Path) -> None:
    nodes = some_nodes()
    nodes.to_dataframe().to_csv(tmp_path / "t.csv", index=False)
    back = dp.read_nodes(tmp_path / "t.csv")
    for name in ("frame", "t_s", "xy_px", "status"):
        np.testing.assert_array_equal(getattr(back, name), getattr(nodes, name), err_msg=name)
    for name in ("sigma_px", "area_px"):
        np.testing.assert_array_equal(getattr(back, name), getattr(nodes, name), err_msg=name)


HEADER = "frame,time_s,node,x_px,y_px"
FAULTS: dict[str, tuple[str, str]] = {
    "twice": ("0,0.0,a,1.5,2\n0,0.0,a,3.5,4\n", "line 3: a has a second place in frame 0, the first is in line 2"),
    "times": ("0,0.0,a,1.5,2\n0,0.5,b,3.5,4\n", "line 3: b is at 0.5 s in frame 0, and others of this frame at 0.0 s"),
    "back": ("0,0.5,a,1.5,2\n1,0.25,a,3.5,4\n", "frame 1: its time 0.25 s comes after 0.5 s of frame 0"),
    "no time": ("0,0.5,a,1.5,2\n1,,a,3.5,4\n", "frame 1: the time is no number"),
    "half": ("0,0.0,a,1.5,\n", "frame 0: the place of a is (1.5, nan)"),
    "frame": ("0.5,0.0,a,1.5,2\n", "line 2: the frame is 0.5, and a whole number from 0 is expected"),
    "word": ("0,0.0,a,left,2\n", "line 2, column x_px: 'left' is not a number"),
    "nothing": ("0,0.0,a,,\n", "no point is seen in any frame"),
}  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS)
def test_what_is_wrong_in_a_table_is_named_with_its_place(fault: str, tmp_path: Path) -> None:
    rows, said = FAULTS[fault]
    (tmp_path / "t.csv").write_text(f"{HEADER}\n{rows}", "utf-8")
    with pytest.raises(dp.TableError, match=re.escape(said)) as caught:
        dp.read_nodes(tmp_path / "t.csv")
    assert "t.csv" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_columns_that_contradict_are_named(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    path.write_text("frame,time_s,node,body,x_px,y_px\n0,0.0,a,one,1.5,2\n1,0.1,a,two,1.5,2\n", "utf-8")
    with pytest.raises(dp.TableError, match="line 3: a is of 'two' here and of 'one' in line 2"):
        dp.read_nodes(path)
    path.write_text(f"{HEADER},status\n0,0.0,a,1.5,2,found\n", "utf-8")
    with pytest.raises(dp.TableError, match="line 2, column status: the status 'found' is not known"):
        dp.read_nodes(path)
    path.write_text(f"{HEADER},status\n0,0.0,a,,,seen\n", "utf-8")
    with pytest.raises(dp.TableError, match="frame 0: a is seen by its status and has no place"):
        dp.read_nodes(path)
    path.write_text("frame,node,x_px,y_px\n0,a,1.5,2\n", "utf-8")
    with pytest.raises(dp.TableError, match="there is no column time_s"):
        dp.read_nodes(path)


def test_uneven_times_are_read_and_told(tmp_path: Path) -> None:
    rows = "".join(f"{i},{t!r},a,{i}.5,2\n" for i, t in enumerate((0.0, 0.1, 0.2, 0.5, 0.6)))
    (tmp_path / "t.csv").write_text(f"{HEADER}\n{rows}", "utf-8")
    nodes = dp.read_nodes(tmp_path / "t.csv")
    assert nodes.status.tolist() == [[SEEN]] * 5
    (note,) = [n for n in nodes.notes if "evenly" in n]
    assert note.startswith(
        "times are not evenly spaced: 0.3 s a frame after frame 2, 0.1 s in the middle; 1 of 4"
    )


WRONG: list[tuple[dict[str, Any], str]] = [
    ({"t_s": [0, 1]}, r"t_s and xy_px: the shapes are \(2,\) and \(3, 2, 2\)"),
    ({"t_s": [0, 1, 1]}, r"t_s, frame 2: its time 1.0 s comes after 1.0 s of frame 1"),
    ({"t_s": "abc"}, "t_s: an array of numbers is needed, and this is 'abc'"),
    ({"names": ["a"]}, "names: 1 names for 2 nodes"),
    ({"names": ["a", "a"]}, "names: the name 'a' is empty or there twice"),
    ({"bodies": {"rod": ["n0", "n7"]}}, "bodies: the body 'rod' has a node 'n7' that is not there"),
    ({"bodies": {"rod": ["n0"], "bar": ["n0"]}}, "bodies: the node 'n0' is in 'rod' and in 'bar'"),
    ({"bodies": ["rod"]}, "bodies: 1 bodies for 2 nodes"),
    ({"bodies": "rod"}, "bodies: a dictionary or a sequence, each text, is needed, and this is 'rod'"),
    ({"bodies": {"n1": ["n0"]}}, "bodies: the node 'n1' is in no body, and a body has its name"),
    ({"sigma_px": [1, 2, 3, 4]}, "sigma_px: its shape does not fit"),
    ({"sigma_px": 0.0}, "sigma_px, frame 0: the uncertainty of n0 is 0 px"),
    ({"frame": [0, 2, 1]}, "frame: it is no number of each frame"),
]


@pytest.mark.parametrize(("change", "said"), WRONG)
def test_arrays_that_do_not_fit_are_named(change: dict[str, Any], said: str) -> None:
    given: dict[str, Any] = {"t_s": [0, 1, 2], "xy_px": np.arange(12.0).reshape(3, 2, 2)} | change
    with pytest.raises(dp.PydpendError, match=said):
        dp.Nodes.from_arrays(given.pop("t_s"), given.pop("xy_px"), **given)


def test_nodes_never_seen_together_have_a_rig_without_reference_picture() -> None:
    xy = np.arange(12.0).reshape(3, 2, 2)
    xy[0, 0] = xy[1:, 1] = np.nan
    nodes = dp.Nodes.from_arrays([0, 1, 2], xy, frame=[5, 7, 9])
    nodes.check()
    assert nodes.rig.reference_frame is None
    assert any("no frame shows all nodes: n0 stand" in n for n in nodes.notes)
    assert [(n.x_px, n.y_px) for n in nodes.rig.nodes] == [(4.0, 5.0), (2.0, 3.0)]


def test_the_command_line_says_what_is_assumed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = pa.Table.from_pandas(long_frame()).replace_schema_metadata(None)
    pq.write_table(table, tmp_path / "t.parquet")
    command = ["angles", str(tmp_path / "t.parquet"), "--zero", "vertical", "-o", str(tmp_path / "a.csv")]
    assert main(command) == 0
    said = capsys.readouterr()
    assert "phi1: 1000 of 1000 frames" in said.out
    assert "note: no uncertainty is given" in said.err
