"""Node tables: both forms, other programs' readers, Arrow, and what is refused."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pydpend as dp
import pytest
from pydpend.nodes import MISSING, SEEN, Node, Nodes, Rig
from pydpend.plots.nodes import nodes_figure

from tests.support.drawn_nodes import RIG, some_nodes


def same(a: Nodes, b: Nodes) -> None:
    for name in ("frame", "t_s", "xy_px", "sigma_px", "area_px", "status"):
        left, right = getattr(a, name), getattr(b, name)
        assert left.dtype == right.dtype
        np.testing.assert_array_equal(left, right, err_msg=name)
    assert a.rig == b.rig


@pytest.mark.parametrize("name", ["t.parquet", "t.csv"])
def test_what_is_written_is_read_back(tmp_path: Path, name: str) -> None:
    nodes = some_nodes()
    nodes.write(tmp_path / name)
    back = dp.read_nodes(tmp_path / name)
    same(nodes, back)
    assert back.meta["source"]["name"] == "drop.mp4"
    assert back.complete


def long_form(nodes: Nodes) -> list[tuple[Any, ...]]:
    rows = []
    for t in range(len(nodes)):
        for n, node in enumerate(nodes.rig.nodes):
            place = nodes.xy_px[t, n]
            rows.append(
                (
                    int(nodes.frame[t]),
                    float(nodes.t_s[t]),
                    node.name,
                    node.body,
                    None if np.isnan(place[0]) else float(place[0]),
                    None if np.isnan(place[1]) else float(place[1]),
                    dp.nodes.STATUS_WORDS[nodes.status[t, n]],
                )
            )
    return rows


COLUMNS = ["frame", "time_s", "node", "body", "x_px", "y_px", "status"]


def test_pandas_polars_and_duckdb_read_the_file_without_us(tmp_path: Path) -> None:
    import duckdb
    import pandas as pd
    import polars as pl

    nodes = some_nodes()
    path = tmp_path / "t.parquet"
    nodes.write(path)
    expected = long_form(nodes)
    frame = pd.read_parquet(path)[COLUMNS].astype(object)
    assert [tuple(None if v != v else v for v in row) for row in frame.itertuples(index=False)] == expected
    assert pl.read_parquet(path).select(COLUMNS).rows() == expected
    found = duckdb.sql(f"select {', '.join(COLUMNS)} from '{path}'")
    assert found is not None
    assert found.fetchall() == expected


def test_names_in_the_file_are_coded_and_rows_ordered(tmp_path: Path) -> None:
    some_nodes().write(tmp_path / "t.parquet")
    schema = pq.read_schema(tmp_path / "t.parquet")
    for name in ("node", "body", "status"):
        assert pa.types.is_dictionary(schema.field(name).type)
    meta = pq.read_metadata(tmp_path / "t.parquet").metadata
    assert meta[b"pydpend.schema_version"] == b"1"
    assert json.loads(meta[b"pydpend.rig"])["node"][0]["name"] == "n0"


def keys(path: Path) -> dict[bytes, bytes]:
    """Our keys of a file's metadata, which whoever writes it again must keep."""
    return {k: v for k, v in pq.read_metadata(path).metadata.items() if k.startswith(b"pydpend.")}


def test_a_flipped_bit_of_the_rows_is_told(tmp_path: Path) -> None:
    path = tmp_path / "t.parquet"
    nodes = some_nodes()
    nodes.write(path)
    whole = path.read_bytes()
    length = int(pq.read_metadata(path).metadata[b"pydpend.row_bytes_crc32"].split()[0])
    assert length > len(whole) / 4
    for at in range(4, length, max(1, length // 60)):
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 1 << at % 8]) + whole[at + 1 :])
        with pytest.raises(dp.PydpendError, match="damaged"):
            dp.read_nodes(path)
    path.write_bytes(whole)
    same(nodes, dp.read_nodes(path))


def test_a_table_that_pyarrow_wrote_again_is_read(tmp_path: Path) -> None:
    nodes = some_nodes()
    nodes.write(tmp_path / "t.parquet")
    table = pq.read_table(tmp_path / "t.parquet")
    plain = pa.schema(
        [f.with_type(pa.large_string()) if pa.types.is_dictionary(f.type) else f for f in table.schema],
        metadata=keys(tmp_path / "t.parquet"),
    )
    again = table.cast(plain).select(list(reversed(table.column_names)))
    pq.write_table(again, tmp_path / "again.parquet", compression="zstd", row_group_size=40)
    same(nodes, dp.read_nodes(tmp_path / "again.parquet"))


def test_a_table_whose_metadata_others_left_out_is_read_and_says_what_is_assumed(tmp_path: Path) -> None:
    import pandas as pd
    import polars as pl

    nodes = some_nodes()
    nodes.write(tmp_path / "t.parquet")
    pd.read_parquet(tmp_path / "t.parquet").to_parquet(tmp_path / "pandas.parquet")
    pl.read_parquet(tmp_path / "t.parquet").write_parquet(tmp_path / "polars.parquet")
    for name in ("pandas", "polars"):
        back = dp.read_nodes(tmp_path / f"{name}.parquet")
        for column in ("frame", "t_s", "xy_px", "sigma_px", "area_px", "status"):
            np.testing.assert_array_equal(getattr(back, column), getattr(nodes, column), err_msg=column)
        assert [(n.name, n.body) for n in back.rig.nodes] == [(n.name, n.body) for n in RIG.nodes]
        assert any("size of the pictures is not known" in note for note in back.notes)
    # pyarrow keeps them by itself.
    pq.write_table(pq.read_table(tmp_path / "t.parquet"), tmp_path / "arrow.parquet")
    same(some_nodes(), dp.read_nodes(tmp_path / "arrow.parquet"))


def test_a_full_disk_leaves_what_was_there(tmp_path: Path) -> None:
    """A file may grow to 20 kB, as on a disk with so much left; what is there already is kept."""
    import resource
    import signal

    small, large = some_nodes(), some_nodes(20_000)
    for name in ("t.parquet", "t.csv"):
        small.write(tmp_path / name)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    quiet = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, before[1]))
        for name in ("t.parquet", "t.csv"):
            with pytest.raises(dp.TableError, match=rf"{name}: it cannot be written \(File too large"):
                large.write(tmp_path / name)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, quiet)
    for name in ("t.parquet", "t.csv"):
        same(small, dp.read_nodes(tmp_path / name))
    assert sorted(p.name for p in tmp_path.iterdir()) == ["t.csv", "t.csv.json", "t.parquet"]


def test_arrow_goes_through_the_capsule() -> None:
    import polars as pl

    nodes = some_nodes()
    table = pa.table(nodes)
    assert table.select(COLUMNS).to_pylist() == [
        dict(zip(COLUMNS, row, strict=True)) for row in long_form(nodes)
    ]
    assert pl.DataFrame(nodes).select(COLUMNS).rows() == long_form(nodes)
    # Polars makes a column of structs of any Arrow stream that is not pyarrow's own.
    column = pl.from_arrow(nodes)
    assert isinstance(column, pl.Series)
    assert column.struct.unnest().select(COLUMNS).rows() == long_form(nodes)
    assert nodes.to_dataframe().shape == (150, 9)


def test_a_rig_survives_its_file(tmp_path: Path) -> None:
    RIG.write(tmp_path / "rig.toml")
    assert Rig.read(tmp_path / "rig.toml") == RIG
    assert list(RIG.indices("upper")) == [0, 1]
    with pytest.raises(dp.ArgumentError, match="third"):
        RIG.indices("third")
    with pytest.raises(dp.RigError, match=r"third"):
        replace(RIG, nodes=(Node("n0", "third", 1.0, 1.0),)).to_toml()
    (tmp_path / "bad.toml").write_text("schema = 1\nimage_px = [1, 'x']\n")
    with pytest.raises(dp.RigError, match=r"bad\.toml, line 2"):
        Rig.read(tmp_path / "bad.toml")


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"t_s": np.zeros(50)}, "row 3: time_s 0 comes after 0"),
        ({"frame": np.zeros(50, dtype=np.int64)}, "row 3: frame 0 comes after frame 0"),
        ({"status": np.full((50, 3), 7, dtype=np.uint8)}, "row 0: status 7 of node n0"),
        ({"status": np.full((50, 3), SEEN, dtype=np.uint8)}, "is seen but its place is"),
        ({"status": np.full((50, 3), MISSING, dtype=np.uint8)}, "is missing but has a place"),
    ],
)
def test_tables_that_are_not_valid_are_refused(tmp_path: Path, change: dict[str, Any], match: str) -> None:
    bad = replace(some_nodes(), **change)
    with pytest.raises(dp.TableError, match=match):
        bad.check()
    with pytest.raises(dp.TableError, match=match):
        bad.write(tmp_path / "t.csv")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"t_s": np.zeros(50, dtype=np.float32)}, "t_s: it is float32"),
        ({"xy_px": np.zeros((50, 3))}, "xy_px: it is float64 of 2 dimensions"),
        ({"xy_px": np.zeros((50, 2, 2))}, "xy_px: its shape does not fit"),
        ({"sigma_px": [1.0]}, "sigma_px: it is no array"),
        ({"meta": {}}, "meta: it lacks schema_version"),
    ],
)
def test_arrays_of_the_wrong_type_or_shape_are_refused(change: dict[str, Any], match: str) -> None:
    with pytest.raises(dp.ArgumentError, match=match) as error:
        replace(some_nodes(), **change).check()
    assert isinstance(error.value, dp.TrackerError)
    assert isinstance(error.value, ValueError)


def test_strided_arrays_are_written_as_they_read(tmp_path: Path) -> None:
    nodes = some_nodes(100)
    every_second = Nodes(
        nodes.frame[::2],
        nodes.t_s[::2],
        nodes.xy_px[::2],
        nodes.sigma_px[::2],
        nodes.area_px[::2],
        nodes.status[::2],
        nodes.rig,
        nodes.meta,
    )
    every_second.write(tmp_path / "t.parquet")
    same(every_second, dp.read_nodes(tmp_path / "t.parquet"))


def test_files_that_are_no_node_tables_are_refused(tmp_path: Path) -> None:
    nodes = some_nodes()
    path = tmp_path / "t.parquet"
    nodes.write(path)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(dp.TableError, match=r"t\.parquet: it is not a whole Parquet file"):
        dp.read_nodes(path)
    table = pa.table(nodes)
    path.write_bytes(whole)
    meta = keys(path)
    for wrong, match in [
        (table.drop_columns(["sigma_px"]), "no column sigma_px"),
        (table.slice(1), "not a whole number of frames"),
        (table.slice(1, 147), 'row 0: node is "n1", expected "n0"'),
        (table.set_column(0, "frame", pa.array(["a"] * 150)), "frame"),
        (table.set_column(4, "x_px", pa.array([float("nan")] * 150)), "row 0: column x_px is NaN"),
        (
            table.set_column(1, "time_s", pa.array([None] * 150, pa.float64())),
            "row 0: column time_s is empty",
        ),
    ]:
        pq.write_table(wrong.replace_schema_metadata(meta), path)
        with pytest.raises(dp.TableError, match=match):
            dp.read_nodes(path)
    # Row groups of 40 rows end within a frame of three; what follows must be of the same one.
    frames = table["frame"].to_numpy().copy()
    frames[40:42] += 1
    wrong = table.set_column(0, "frame", pa.array(frames)).replace_schema_metadata(meta)
    pq.write_table(wrong, path, row_group_size=40)
    with pytest.raises(
        dp.TableError, match=r"row 40: frame 24 at 0\.046 s begins before all 3 nodes of frame 23"
    ):
        dp.read_nodes(path)
    newer = {**meta, b"pydpend.schema_version": b"2"}
    pq.write_table(table.replace_schema_metadata(newer), path)
    with pytest.raises(dp.TableError, match="schema version is 2, this program reads version 1"):
        dp.read_nodes(path)
    with pytest.raises(dp.TableError, match="No such file"):
        dp.read_nodes(tmp_path / "none.parquet")


def test_damage_is_told_and_undecoded_frames_are_drawn(tmp_path: Path) -> None:
    nodes = some_nodes()
    damage = {
        "undecoded": {"frames": 2, "stretches": [[35, 36]]},
        "gaps": {
            "places": [{"after": 40, "frames": 3, "cause": "damage"}],
            "lost_frames": 3,
            "lost_places": 1,
            "dropped_frames": 0,
        },
    }
    told = replace(nodes, meta={**nodes.meta, "ending": {"kind": "damaged"}, "damage": damage})
    told.write(tmp_path / "t.parquet")
    back = dp.read_nodes(tmp_path / "t.parquet")
    assert nodes.damage is None
    assert not back.complete
    assert back.damage == (
        "damaged: frames 35-36 cannot be decoded; 3 frames are lost between frames 40 and 41 (gap in the time stamps)"
    )
    assert (back.status[25:27] == dp.nodes.UNDECODED).all()
    assert not back.seen[25:27].any()
    words = back.to_dataframe()["status"]
    assert (words[words == "undecoded"].index // 3).unique().tolist() == [25, 26]
    legend = nodes_figure(back, np.full((50, 3), np.nan)).legends[0]
    assert [t.get_text() for t in legend.get_texts()] == list(dp.nodes.STATUS_WORDS)
    half = back.status.copy()
    half[25, 0] = dp.nodes.MISSING
    with pytest.raises(dp.TableError, match="frame 35 is undecoded for one of the nodes n0 and n1 only"):
        replace(back, status=half).check()
