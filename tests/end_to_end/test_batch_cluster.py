"""A batch on a real scheduler with two real workers: one killed in a film, the scheduler restarted, bad films."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import pytest
from pydpend.batching.jobs import Job
from pydpend.batching.recording import Fault, analyse_job

from tests.support.small_cluster import check, everything_happens


def test_everything_happens_and_nothing_is_lost(tmp_path: Path) -> None:
    """``python -m tests.validation.validate_batch`` does it with 200 films."""
    rows = everything_happens(tmp_path, 12)
    check(tmp_path, rows, 12, 2)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({}, "worker tcp://x on here does not see /nowhere/a.mp4. Check the name"),
        ({"results": "/nowhere/results"}, "does not see the folder /nowhere/results"),
        ({"token": "another"}, "does not see the folder"),
        ({"version": "9.9"}, "worker tcp://x on here has pydpend"),
    ],
)
def test_a_worker_that_lacks_something_is_named(tmp_path: Path, change: dict[str, str], said: str) -> None:
    from pydpend.analyse.stages import version

    (tmp_path / "batch.json").write_text(json.dumps({"token": "t"}), "utf-8")
    job = Job("a", "/nowhere/a.mp4", {}, str(tmp_path), key="k", token="t", version=version())
    ended = analyse_job(dataclasses.replace(job, **change), "tcp://x on here")  # type: ignore[arg-type]
    assert ended.fault is Fault.UNSEEN
    assert ended.fault.may_pass
    assert said in ended.reason
