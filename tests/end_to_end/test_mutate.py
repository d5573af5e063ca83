"""A few damaged files of every kind; `python -m tests.validation.mutate` (in `make validate`) tries 300 of each."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from tests.support.mutants import mutant
from tests.support.mutated_formats import FORMATS
from tests.validation.mutate import BAD, tried

MUTANTS = 3
"""Enough to see that a format's commands still answer; the sweep finds what is rare."""


@pytest.mark.parametrize("name", FORMATS)
def test_damage_is_read_or_refused_in_one_line(name: str, tmp_path: Path) -> None:
    found = tried(name, FORMATS[name], MUTANTS, 3, tmp_path, None)
    assert sum(found.counts.values()) == MUTANTS
    # Frames that a damaged container loses without a word are counted by the sweep.
    assert not set(found.counts) & (set(BAD) - {"frames lost"}), found.bad


def test_mutants_are_the_same_from_the_same_seed() -> None:
    data = bytes(range(256)) * 8
    for text in (True, False):
        made = [mutant(data, text, random.Random(f"1 x {k}")) for k in range(50)]
        assert made == [mutant(data, text, random.Random(f"1 x {k}")) for k in range(50)]
        assert sum(damaged != data for damaged, _ in made) > 40
