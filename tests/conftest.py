"""What several test files look at, made once: the run of the bundled film, and a browser."""

from __future__ import annotations

import shutil
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, sync_playwright
from pydpend.analyse import Options, analyse

# A shell starts what runs in its background with SIGINT ignored, and Python leaves it so: Ctrl-C could not be tested.
signal.signal(signal.SIGINT, signal.default_int_handler)

DEMO = Path(__file__).parent.parent / "fixtures" / "demo"


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """For two workers (`make test`): who looks at the demo's run goes to the one that makes it, others file by file."""
    for item in items:
        fixtures = getattr(item, "fixturenames", ())
        item.add_marker(pytest.mark.xdist_group("demo" if "demo_run" in fixtures else item.path.name))


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


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    """Debian's Chromium; `make test` installs it."""
    names = ("chromium", "chromium-browser", "google-chrome")
    found = next((path for name in names if (path := shutil.which(name)) is not None), None)
    if found is None:
        pytest.fail("chromium is not installed; `make test` installs it")
    flags = ["--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-sync"]
    with sync_playwright() as driver:
        running = driver.chromium.launch(executable_path=found, args=flags)
        yield running
        running.close()
