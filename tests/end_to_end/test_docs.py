"""The commands of README, tutorial and how-to are run as they stand on the page.

Those on files of the reader's own are run on the project's under these names, a whole analysis with ``--dry-run``.
"""

from __future__ import annotations

import csv
import json
import math
import os
import re
import subprocess
import textwrap
from pathlib import Path

import numpy as np
import pydpend as dp
import pytest

ROOT = Path(__file__).parent.parent.parent


def commands(page: str) -> str:
    """The shell blocks of a page, in order."""
    return "\n".join(re.findall(r"^```sh\n(.*?)^```$", (ROOT / page).read_text("utf-8"), re.M | re.S))


def indented(page: str, beginning: str) -> list[str]:
    """The indented blocks of a page that begin with a pattern, in order."""
    blocks = re.findall(r"^\n((?:    .*\n|\n(?=    ))+)", (ROOT / page).read_text("utf-8"), re.M)
    return [textwrap.dedent(block) for block in blocks if re.match(beginning, block.strip())]


def followed(page: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """Follows a page in a folder that has the project's fixtures and programs."""
    return shell(commands(page), folder)


def shell(script: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """Runs commands in a folder that has the project's fixtures and programs."""
    for name in ("fixtures", "target", ".venv"):
        if not (folder / name).exists():
            (folder / name).symlink_to(ROOT / name)
    return subprocess.run(
        ["bash", "-euo", "pipefail", "-c", script],
        cwd=folder,
        env=os.environ,
        capture_output=True,
        text=True,
        check=False,
    )


NUMBER = r"[-+]?\d[\d.]*(?:e[-+]?\d+)?"


def quoted(page: str) -> list[str]:
    """The lines of a page that programs print: indented, or in backquotes in a sentence."""
    text = (ROOT / page).read_text("utf-8")
    beginnings = (
        r"phi\S*: |zero from |\d+ holds: |linearity |gain |residual RMS |link\d: |damping of |at [\d.]+ rad: "
    )
    return re.findall(rf"^ {{4}}((?:{beginnings}).*)$", text, re.M) + re.findall(r"`(phi\d: [^`]*)`", text)


def printed_so(line: str, printed: str, rel: float = 0.15) -> None:
    """A quoted line was printed: its words to the letter, its numbers to what a better tracker moves."""
    name, _, words = line.partition(": ")
    words = re.sub(NUMBER, "#", words or name)
    # A hundredth covers numbers that scatter about nothing: a zero, a gap of clocks.
    least = 0.0003 if line.startswith("phi") else 0.01
    said = [float(number) for number in re.findall(NUMBER, line)]
    tried = []
    for other in printed.splitlines():
        first, _, rest = other.partition(": ")
        if re.sub(NUMBER, "#", rest or first) == words and (first == name or not rest):
            tried.append([float(number) for number in re.findall(NUMBER, other)])
    assert any(found == pytest.approx(said, rel=rel, abs=least) for found in tried), (line, tried)


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
    fit = json.loads((tmp_path / "out/tutorial/run/fit/fit.json").read_text("utf-8"))
    (chi2,) = re.findall(r"Chi-square is ([\d.]+):", page)
    assert float(chi2) == pytest.approx(fit["chi2"], abs=0.02)
    for name in ("energy.pdf", "comparison.png", "beside.mp4", "run/report.html"):
        assert (tmp_path / "out/tutorial" / name).stat().st_size > 1000


def test_the_how_to(tmp_path: Path) -> None:
    done = followed("docs/how-to/your-pendulum.md", tmp_path)
    assert done.returncode == 0, done.stderr
    for name in ("rig.toml", "rig.png", "try.parquet", "run.toml"):
        assert (tmp_path / "out/own" / name).stat().st_size > 100


def test_other_programs(tmp_path: Path) -> None:
    page = "docs/how-to/other-programs.md"
    done = followed(page, tmp_path)
    assert done.returncode == 0, done.stderr
    assert "read as DeepLabCut; written to out/other/nodes.parquet" in done.stdout
    one, other = (dp.read_angles(tmp_path / f"out/other/{n}.csv").phi_rad for n in ("angles", "angles2"))
    both = np.isfinite(one) & np.isfinite(other)
    # The second is of the same places, but for one in 60 that the first leaves out: the zeros, which the joints give,
    # differ by much less than a frame's noise, 0.05 px at 40 px from the middle of two markers.
    assert both.any(axis=1).sum() >= 59
    np.testing.assert_allclose(one[both], other[both], atol=0.05 / 40)
    (python,) = indented(page, "import numpy")
    done = shell(f".venv/bin/python - <<'END'\n{python}\nprint(again)\nEND", tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "<Nodes arrays: 60 frames x 4 nodes, 98.8 % seen>"


def test_many_recordings(tmp_path: Path) -> None:
    page = "docs/how-to/batch.md"
    done = followed(page, tmp_path)
    assert done.returncode == 0, done.stderr
    assert "0 of 2 recordings done, 2 partly" in done.stdout
    both = "".join(f"print(duckdb.sql({sql!r}).fetchall())\n" for sql in indented(page, "SELECT"))
    polars, python = (indented(page, f"import {name}")[0] for name in ("polars", "pydpend as dp"))
    done = shell(f".venv/bin/python - <<'END'\nimport duckdb\n{both}{polars}{python}\nEND", tmp_path)
    assert done.returncode == 0, done.stderr
    assert "('drop1', 'partly', 60, 0.01" in done.stdout
    assert "sheet_operator" in done.stdout
    assert "Damping fit: drop" in done.stdout
    # The sheet's rate of one film, of all else what the film says.
    assert re.findall(r"drop(\d) +┆ (\d+)\.0", done.stdout) == [("1", "500"), ("3", "1000")]
    assert done.stdout.splitlines()[-1] == "0 of 2 recordings done, 2 partly, 2 of them by earlier calls"


def test_angles_and_encoder(tmp_path: Path) -> None:
    page = "docs/how-to/angles-and-encoder.md"
    done = followed(page, tmp_path)
    assert done.returncode == 0, done.stderr
    lines = quoted(page)
    assert len(lines) == 7
    for line in [*lines, *quoted("docs/explanation/angles.md")]:
        printed_so(line, done.stdout)
    python = "".join(indented(page, r"import pydpend|line = dp"))
    done = shell(f".venv/bin/python - <<'END'\n{python}\nEND", tmp_path)
    assert done.returncode == 0, done.stderr
    gain, offset_s, rms_rad = map(float, done.stdout.split()[-3:])
    assert gain == pytest.approx(1, abs=1e-3)
    assert offset_s == pytest.approx(-0.0137, abs=5e-4)
    assert math.degrees(rms_rad) == pytest.approx(1.375, rel=0.05)
    for name in (
        "angles.png",
        "methods.png",
        "calibration.png",
        "comparison/compare.png",
        "comparison/compare.json",
    ):
        assert (tmp_path / "out/angles" / name).stat().st_size > 1000


def test_other_mechanisms(tmp_path: Path) -> None:
    page = "docs/how-to/mechanisms.md"
    (tmp_path / "tests").symlink_to(ROOT / "tests")
    done = followed(page, tmp_path)
    assert done.returncode == 0, done.stderr
    lines = quoted(page)
    assert len(lines) >= 7
    for line in lines:
        printed_so(line, done.stdout)
    period = float(re.findall(r"period of small ones ([\d.]+)", done.stdout)[0])
    assert period == pytest.approx(2 * math.pi * math.sqrt(0.225 / 9.81), rel=1e-4)
    assert float(re.findall(r"viscous ([\d.]+)", done.stdout)[0]) == pytest.approx(0.025, rel=0.01)
    scale = float(re.findall(r"scale ([\d.]+)", done.stdout)[0])
    assert scale == pytest.approx(1, rel=1e-3)
    python = "".join(indented(page, "import pydpend"))
    done = shell(f".venv/bin/python - <<'END'\n{python}\nEND", tmp_path)
    assert done.returncode == 0, done.stderr
    assert "('link1', 'link2', 'link3') (600, 2)" in done.stdout
    assert (tmp_path / "out/mechanisms/four-bar.png").stat().st_size > 1000


OWN_FILES = """
cp fixtures/demo/drop.mp4 fixtures/demo/hanging.mp4 .
cp fixtures/demo/encoder.csv drop.csv
cp -r fixtures/demo/calibration holds
.venv/bin/pydpend setup drop.mp4 -o rig.toml
.venv/bin/python - <<'END'
import numpy as np, pyarrow.parquet as pq, pydpend as dp
t_s = np.arange(1500) / 250
for k in (1, 2):
    damping = dp.Damping(mu_v1=1e-4, mu_v2=3e-5, tau_c1=1e-3)
    phi = dp.simulate(dp.derived("A"), damping, [2.0 + 0.1 * k, 2.1, 0, 0], t_s).phi_rad
    phi = phi + 8e-4 * np.random.default_rng(k).standard_normal(phi.shape)
    pq.write_table(dp.LinkAngles(t_s, phi, np.full(phi.shape, 8e-4)).to_arrow(), f"trial{k}.parquet")
table = np.column_stack((t_s, np.degrees(phi) + 180))
np.savetxt("encoders.csv", table, delimiter=",", header="t,theta1,theta2", comments="")
END
"""
"""Files of the reader's own, from the project's."""


def test_the_readme(tmp_path: Path) -> None:
    (use,) = indented("README.md", ".venv/bin/pydpend track")
    (python,) = indented("README.md", "import pydpend as dp\n\n    nodes")
    tried = re.sub(r"^(.*pydpend analyse .*)$", r"\1 --dry-run", use, flags=re.M)
    done = shell(f"{OWN_FILES}\n{tried}\n.venv/bin/python - <<'END'\n{python}\nprint(fit)\nEND", tmp_path)
    assert done.returncode == 0, done.stderr
    stages = re.findall(r"^(?:to do|done) +(.*)$", done.stdout, re.M)
    assert {"Tracking drop.mp4", "Encoder beside drop.mp4", "Damping fit"} <= set(stages)
    assert "<DampingFit trajectory: converged" in done.stdout
    assert {"fit.json", "trials.json"} <= {p.name for p in (tmp_path / "both").iterdir()}


def test_what_is_said_of_files_of_ones_own(tmp_path: Path) -> None:
    how_to = "docs/how-to/your-pendulum.md"
    (pendulum,) = re.findall(r"^(cat > out/own/pendulum.toml .*?^END\n)", commands(how_to), re.M | re.S)
    lines = [f"{line.strip()} --dry-run" for line in indented(how_to, "pydpend analyse")]
    linking = (ROOT / "docs/explanation/linking.md").read_text("utf-8")
    (film,) = re.findall(r"`(pydpend film --preset clean --tilt [^`]* --k1 [^`]*)`", linking)
    done = shell(
        "\n".join(
            [
                'export PATH="$PWD/.venv/bin:$PATH"',
                OWN_FILES,
                "mkdir -p out/own",
                pendulum,
                "cp out/own/pendulum.toml .",
                *lines,
                f"{film} --frame-count 5",
            ]
        ),
        tmp_path,
    )
    assert done.returncode == 0, done.stderr
    assert len(lines) == 2
    assert done.stdout.count("Damping fit") == 2
    for name in ("film.mkv", "truth.csv"):
        assert (tmp_path / name).stat().st_size > 1000


def test_the_camera_that_is_found(tmp_path: Path) -> None:
    page = (ROOT / "docs/explanation/linking.md").read_text("utf-8")
    (film,) = re.findall(r"`pydpend (film --preset clean --tilt [^`]* --towards [^`]*)`", page)
    (note,) = re.findall(r"^    pydpend: (note: the camera is .*\n    .*)$", page, re.M)
    done = shell(f".venv/bin/pydpend {film} -q && .venv/bin/pydpend track film.mkv -o nodes.csv", tmp_path)
    assert done.returncode == 0, done.stderr
    assert re.sub(r"\s+", " ", note) in done.stderr


@pytest.mark.parametrize("place", ["## Parts", "## One link"])
def test_a_model_on_the_page_of_models_is_read(place: str, tmp_path: Path) -> None:
    text = (ROOT / "docs/reference/model.md").read_text("utf-8").split(place)[1]
    (block,) = re.findall(r"^\n((?:    .*\n)+)", text.split("\n## ")[0], re.M)
    (tmp_path / "model.toml").write_text(textwrap.dedent(block), "utf-8")
    assert dp.read_model(tmp_path / "model.toml").links == (2 if place == "## Parts" else 1)
