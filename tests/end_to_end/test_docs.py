"""The commands of the tutorial and of the how-to are run as they stand on the page."""

from __future__ import annotations

import csv
import json
import os
import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent.parent


def commands(page: str) -> str:
    """The shell blocks of a page, in order."""
    return "\n".join(re.findall(r"^```sh\n(.*?)^```$", (ROOT / page).read_text("utf-8"), re.M | re.S))


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
    done = followed("docs/tutorial/film-to-damping.md", tmp_path)
    assert done.returncode == 0, done.stderr
    # Tried without being done: only the fit depends on the laws.
    assert re.findall(r"^to do +(.*)$", done.stdout, re.M) == ["Damping fit"]
    with (tmp_path / "out/tutorial/run/fit/coefficients.csv").open(encoding="utf-8") as f:
        found = {row["name"]: (float(row["value"]), float(row["sigma"])) for row in csv.DictReader(f)}
    truth = json.loads((ROOT / "fixtures/demo/truth.json").read_text("utf-8"))["damping"]
    page = (ROOT / "docs/tutorial/film-to-damping.md").read_text("utf-8")
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
    done = followed("docs/how-to/your-pendulum.md", tmp_path)
    assert done.returncode == 0, done.stderr
    for name in ("rig.toml", "rig.png", "try.parquet", "run.toml"):
        assert (tmp_path / "out/own" / name).stat().st_size > 100


def test_angles_and_encoder(tmp_path: Path) -> None:
    page = "docs/how-to/angles-and-encoder.md"
    done = followed(page, tmp_path)
    assert done.returncode == 0, done.stderr
    printed = re.findall(r"^(\S.*)$", done.stdout, re.M)
    for line in re.findall(
        r"^    (phi\d: .*|zero from .*|\d+ holds: .*|linearity .*|gain .*|residual RMS .*)$",
        (ROOT / page).read_text("utf-8"),
        re.M,
    ):
        # The words are the page's; the numbers too, but for the last digits that a better tracker moves.
        words = re.sub(r"[-+]?\d[\d.]*", "#", line)
        (same,) = [p for p in printed if re.sub(r"[-+]?\d[\d.]*", "#", p) == words and p[:4] == line[:4]]
        for said, found in zip(re.findall(r"\d[\d.]*", line), re.findall(r"\d[\d.]*", same), strict=True):
            assert float(found) == pytest.approx(float(said), rel=0.15, abs=0.01)
    for name in (
        "angles.png",
        "methods.png",
        "calibration.png",
        "comparison/compare.png",
        "comparison/compare.json",
    ):
        assert (tmp_path / "out/angles" / name).stat().st_size > 1000
