"""The commands of the tutorial and of the how-to are run as they stand on the page."""

from __future__ import annotations

import csv
import json
import os
import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent


def commands(page: str) -> str:
    """The shell blocks of a page, in order."""
    return "\n".join(
        re.findall(r"^```sh\n(.*?)^```$", (ROOT / "docs" / page).read_text("utf-8"), re.M | re.S)
    )


def followed(page: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """Follows a page in a folder that has the project's fixtures and programs."""
    for name in ("fixtures", "target", ".venv"):
        (folder / name).symlink_to(ROOT / name)
    return subprocess.run(
        ["bash", "-euo", "pipefail", "-c", commands(page)],
        cwd=folder,
        env=os.environ,
        capture_output=True,
        text=True,
        check=False,
    )


def test_the_tutorial(tmp_path: Path) -> None:
    done = followed("tutorial.md", tmp_path)
    assert done.returncode == 0, done.stderr
    # Tried without being done: only the fit depends on the laws.
    assert re.findall(r"^to do +(.*)$", done.stdout, re.M) == ["Damping fit"]
    with (tmp_path / "out/tutorial/run/fit/coefficients.csv").open(encoding="utf-8") as f:
        found = {row["name"]: (float(row["value"]), float(row["sigma"])) for row in csv.DictReader(f)}
    truth = json.loads((ROOT / "fixtures/demo/truth.json").read_text("utf-8"))["damping"]
    page = (ROOT / "docs/tutorial.md").read_text("utf-8")
    table = re.findall(r"^\| (\w+) \| ([\d.e+-]+) ± ([\d.e+-]+) \| ([\d.e+-]+) \|", page, re.M)
    assert {row[0] for row in table} == set(truth)
    for name, value, sigma, made in table:
        assert float(made) == truth[name]
        # The page may be older than the estimator: half a standard error is not worth a new page.
        assert float(value) == pytest.approx(found[name][0], abs=0.5 * found[name][1])
        assert float(sigma) == pytest.approx(found[name][1], rel=0.2)
    for name in ("energy.pdf", "comparison.png", "beside.mp4", "run/report.html"):
        assert (tmp_path / "out/tutorial" / name).stat().st_size > 1000


def test_the_how_to(tmp_path: Path) -> None:
    done = followed("your-pendulum.md", tmp_path)
    assert done.returncode == 0, done.stderr
    for name in ("rig.toml", "rig.png", "try.parquet", "run.toml"):
        assert (tmp_path / "out/own" / name).stat().st_size > 100
