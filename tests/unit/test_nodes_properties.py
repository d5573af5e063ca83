"""Any node table that is one survives both forms and Arrow, through Python."""

from __future__ import annotations

import string
import tempfile
from pathlib import Path

import numpy as np
import pyarrow as pa
import pydpend as dp
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from pydpend.nodes import Joint, Node, Nodes, Rig

from tests.support.drawn_nodes import META

# What people call things: also quotes, commas, spaces and letters of any script, but no control characters.
WORDS = st.text(st.characters(exclude_categories=("C", "Z"), include_characters=" "), min_size=1, max_size=8)
PLACES = st.floats(-1e4, 1e5, allow_nan=False)


@st.composite
def tables(draw: st.DrawFn) -> Nodes:
    names = draw(st.lists(WORDS, min_size=1, max_size=5, unique=True))
    bodies = draw(st.lists(WORDS, min_size=1, max_size=min(3, len(names)), unique=True))
    # Every body has a node.
    of = [bodies[i % len(bodies)] for i in range(len(names))]
    width, height = draw(st.integers(2, 9000)), draw(st.integers(1, 9000))
    # Each node has half a strip of its own: two of one body at one place are no rig.
    strip = (width - 1) / 5
    inside = st.tuples(st.floats(0, strip / 2), st.floats(0, height - 1))
    placed = [(x + i * strip, y) for i, (x, y) in enumerate(draw(inside) for _ in names)]
    nodes = tuple(Node(n, b, *at) for n, b, at in zip(names, of, placed, strict=True))
    joints = (Joint(draw(st.sampled_from(string.ascii_letters)), (bodies[0],), draw(PLACES), draw(PLACES)),)
    reference = draw(st.none() | st.integers(0, 1000))
    rig = Rig((width, height), nodes, tuple(bodies), joints, reference)
    frames, n = draw(st.integers(0, 12)), len(names)
    steps = draw(hnp.arrays(np.int64, frames, elements=st.integers(1, 1 << 40)))
    times = draw(st.lists(st.floats(-1e6, 1e9), min_size=frames, max_size=frames, unique=True))
    status = draw(hnp.arrays(np.uint8, (frames, n), elements=st.integers(0, 3)))
    seen = ((status == 1) | (status == 2)).astype(bool)
    xy_px = draw(hnp.arrays(np.float64, (frames, n, 2), elements=PLACES))
    # No two nodes are at one place: the first coordinate grows by more than any two can differ.
    xy_px[..., 0] += np.arange(n) * 3e5
    sigma = draw(hnp.arrays(np.float32, (frames, n), elements=st.floats(2**-60, 2.0**60, width=32)))
    area = draw(hnp.arrays(np.float32, (frames, n), elements=st.floats(0, 2.0**60, width=32)))
    return Nodes(
        np.cumsum(steps) - steps[:1].sum(),
        np.array(sorted(times), dtype=np.float64),
        np.where(seen[..., None], xy_px, np.nan),
        np.where(seen, sigma, np.float32(np.nan)),
        np.where(seen, area, np.float32(np.nan)),
        status,
        rig,
        {**META, "settings": {"note": draw(st.text(max_size=20))}},
    )


def bits(nodes: Nodes) -> list[bytes]:
    """Every number, bit for bit but for the sign of zero and the kind of NaN."""
    columns = (nodes.frame, nodes.t_s, nodes.xy_px, nodes.sigma_px, nodes.area_px, nodes.status)
    return [np.where(np.isnan(c), np.nan, c + c.dtype.type(0)).astype(c.dtype).tobytes() for c in columns]


@pytest.mark.parametrize("name", ["t.parquet", "t.csv"])
@settings(max_examples=50, deadline=None, derandomize=True, database=None)
@given(nodes=tables())
def test_any_table_survives_its_file(name: str, nodes: Nodes) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, name)
        nodes.write(path)
        back = dp.read_nodes(path)
        first = path.read_bytes()
        back.write(path)
        assert path.read_bytes() == first
    assert bits(back) == bits(nodes)
    assert back.rig == nodes.rig
    assert {k: back.meta[k] for k in ("settings", "ending")} == {
        k: nodes.meta[k] for k in ("settings", "ending")
    }


@settings(max_examples=30, deadline=None, derandomize=True, database=None)
@given(nodes=tables())
def test_any_table_crosses_to_arrow(nodes: Nodes) -> None:
    table = pa.table(nodes)
    assert table.num_rows == nodes.status.size
    shape = nodes.status.shape
    x = table["x_px"].to_numpy().reshape(shape)
    np.testing.assert_array_equal(x, nodes.xy_px[..., 0])
    assert table["x_px"].null_count == int((~nodes.seen).sum())
    assert table["node"].to_pylist() == list(nodes.rig.names) * len(nodes)
