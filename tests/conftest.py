"""The run of the bundled film that several test files look at; made once."""

from __future__ import annotations

from pathlib import Path

import pytest
from pydpend.analyse import Options, analyse

DEMO = Path(__file__).parent.parent / "fixtures" / "demo"


@pytest.fixture(scope="session")
def demo_options() -> Options:
    """Film, encoder, calibration and the film of the hanging pendulum."""
    return Options(
        inputs=(str(DEMO / "drop.mp4"),),
        encoder=str(DEMO / "encoder.csv"),
        calibration=str(DEMO / "calibration"),
        zero=str(DEMO / "hanging.mp4"),
        start_s=0.6,
    )


@pytest.fixture(scope="session")
def demo_run(demo_options: Options, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Its run folder. A test that changes it puts it back."""
    folder = tmp_path_factory.mktemp("run") / "demo"
    outcome = analyse(demo_options, folder)
    assert outcome.status == "done", outcome.stages
    assert set(outcome.stages.values()) == {"done"}
    return folder
