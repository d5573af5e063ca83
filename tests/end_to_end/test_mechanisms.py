"""Mechanisms that an independent renderer drew, tracked without settings: the kinds that went wrong once."""

from __future__ import annotations

from pathlib import Path

import pydpend as dp
import pytest
from pydpend.cli import main

from tests.validation.validate_mechanisms import run


@pytest.mark.parametrize("kind", ["cart and pole, 2 + 2", "rectangle and rhombus", "four-bar"])
def test_every_marker_has_its_name_and_its_body(kind: str, tmp_path: Path) -> None:
    got = run(kind, 4, tmp_path)
    assert (got.status, got.wrong, got.false) == (0, 0, 0)
    assert got.coverage > 0.98
    assert got.bodies_right


@pytest.mark.parametrize("seed", [1, 2])
def test_a_chain_of_single_markers_is_named_also_where_they_go_by_each_other(
    seed: int, tmp_path: Path
) -> None:
    got = run("one a link, three links", seed, tmp_path)
    assert (got.status, got.wrong, got.false) == (0, 0, 0)
    assert got.coverage > 0.99
    assert got.bodies_right


def test_bodies_are_made_of_what_moves_before_clutter_and_have_angles(tmp_path: Path) -> None:
    got = run("clutter and a hand", 1, tmp_path)
    assert (got.wrong, got.false) == (0, 0)
    assert got.coverage > 0.9
    assert got.bodies_right
    nodes = dp.read_nodes(tmp_path / "nodes.parquet")
    assert [len(j.bodies) for j in nodes.rig.joints] == [1, 2]
    table = tmp_path / "angles.parquet"
    assert main(["angles", str(tmp_path / "nodes.parquet"), "--zero", "vertical", "-o", str(table)]) == 0
    assert table.exists()
