"""Mechanisms that an independent renderer drew, tracked without settings: the kinds that went wrong once."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.validation.validate_mechanisms import run


@pytest.mark.parametrize("kind", ["cart and pole, 2 + 2", "rectangle and rhombus", "four-bar"])
def test_every_marker_has_its_name_and_its_body(kind: str, tmp_path: Path) -> None:
    got = run(kind, 4, tmp_path)
    assert (got.status, got.wrong, got.false) == (0, 0, 0)
    assert got.coverage > 0.98
    assert got.bodies_right
