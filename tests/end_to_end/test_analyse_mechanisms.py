"""`pydpend analyse` of mechanisms that are no double pendulum: rates, ring-down and speeds, and what is not done."""

from __future__ import annotations

import json
import shlex
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pydpend as dp
import pytest
from pydpend.analyse import Options, RunState, analyse
from pydpend.analyse.options import read_config, write_config
from pydpend.cli import main
from pydpend.errors import OptionError
from pydpend.report import report_page
from pydpend.report.page import Chart, Page, Table

from tests.support import linkages
from tests.unit.test_ring_down import swing


def answers(page: Page) -> dict[str, str]:
    """The page's first table."""
    table = next(b for b in page.sections[0].blocks if isinstance(b, Table))
    return {row[0]: row[1] for row in table.rows}


@pytest.fixture(scope="module")
def four_bar(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("four")
    linkages.four_bar(51, 800).nodes(51).write(folder / "n.parquet")
    words = [
        "analyse",
        str(folder / "n.parquet"),
        "-o",
        str(folder / "run"),
        "--estimator",
        "linkage",
        "--quiet",
    ]
    words += ["--zero", "vertical", "--axis", "crank=A-B", "--axis", "rocker=D-C", "--scale", "A-D=0.2100"]
    assert main([*words, "--scale", "n0-n1=0.0470", "--points", "B,n1"]) == 0
    return folder


def test_a_four_bar_has_rates_and_speeds_in_metres(four_bar: Path) -> None:
    made, here = linkages.four_bar(51, 800), four_bar / "run" / "n"
    states = pq.read_table(here / "states.parquet")
    rate = np.gradient(made.phi_rad[:, 2], made.t_s)
    error = (states["w_rocker_rad_s"].to_numpy() - rate)[20:-20]
    assert np.sqrt(np.mean(error**2)) < 0.05
    points = pq.read_table(here / "points.parquet")
    # A px of the made mechanism is a millimetre by both distances.
    speed = np.hypot(*np.gradient(made.joints[2][2] / 1000, made.t_s, axis=0).T)
    error = (points["speed_B_m_s"].to_numpy() - speed)[30:-30]
    assert np.sqrt(np.mean(error**2)) < 0.01 * speed.mean()
    # The line of the crank through its joints is the truth's, which the mean of its markers is not.
    angle = dp.read_angles(here / "angles.parquet").select("crank").phi_rad[:, 0] - made.phi_rad[:, 0]
    assert abs(np.degrees(np.mean(np.angle(np.exp(1j * angle))))) < 0.05


def test_the_report_of_a_four_bar_has_them_and_says_what_was_not_done(four_bar: Path) -> None:
    page = report_page(four_bar / "run")
    charts = {b.id for s in page.sections for b in s.blocks if isinstance(b, Chart)}
    assert {"r0-w", "r0-a", "r0-speed"} <= charts
    assert answers(page)["scale"].startswith("1.0000")
    record = json.loads((four_bar / "run" / "run.json").read_text("utf-8"))["facts"]
    assert record["not_done"] == {}
    assert "3 links (crank, coupler, rocker)" in record["does_not_apply"]["fit"]
    assert page.warnings == ()


def test_the_command_in_the_report_does_the_same_again(
    four_bar: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = shlex.split(json.loads((four_bar / "run" / "run.json").read_text("utf-8"))["facts"]["command"])
    assert main([*words[1:], "--dry-run"]) == 0
    todo = [line for line in capsys.readouterr().out.splitlines() if line.startswith("to do")]
    # A stage that does not apply leaves nothing to keep.
    assert todo == ["to do  Damping fit"]


def test_a_single_pendulum_has_its_ring_down_without_a_mass(tmp_path: Path) -> None:
    dp.write_angles(swing(52, 20.0, 0.2, a=0.03), tmp_path / "a.parquet")
    done = analyse(Options(inputs=(str(tmp_path / "a.parquet"),)), tmp_path / "run")
    assert done.status is RunState.DONE
    assert "no masses are given" in done.reasons["fit"]
    stored = json.loads((tmp_path / "run" / "a" / "swing.json").read_text("utf-8"))
    assert stored["laws"] == ["viscous"]
    assert stored["rates"][0] == pytest.approx(0.03, abs=4 * stored["rates_sigma"][0])
    page = report_page(tmp_path / "run")
    assert answers(page)["damping of the amplitude"].startswith("viscous 0.0")
    compared = next(
        b for s in page.sections for b in s.blocks if isinstance(b, Table) and b.header[0] == "laws"
    )
    assert {"viscous", "quadratic", "dry"} <= {row[0] for row in compared.rows}
    for figure in ("phase", "amplitudes"):
        assert main(["plot", figure, str(tmp_path / "run"), "-o", str(tmp_path / f"{figure}.svg")]) == 0


def test_why_a_motion_has_no_period_is_said_in_the_report(tmp_path: Path) -> None:
    t = np.arange(2000) / 200
    phi = np.random.default_rng(53).normal(3 * t, 1e-3)[:, None]
    turning = dp.LinkAngles(t, phi, np.full_like(phi, 1e-3), name="turns")
    dp.write_angles(turning, tmp_path / "a.parquet")
    assert analyse(Options(inputs=(str(tmp_path / "a.parquet"),)), tmp_path / "run").status is RunState.DONE
    assert any("no period and no Q: " in line for line in report_page(tmp_path / "run").warnings)


def test_two_links_without_a_joint_are_no_double_pendulum(tmp_path: Path) -> None:
    made = linkages.four_bar(54, 800)
    made.nodes(54).write(tmp_path / "n.parquet")
    one = Options(inputs=(str(tmp_path / "n.parquet"),), bodies="crank,rocker", zero="vertical")
    assert "share no joint" in analyse(one, tmp_path / "run").reasons["fit"]


def test_what_is_not_there_is_named_and_the_rest_is_done(tmp_path: Path) -> None:
    made = linkages.four_bar(55, 800)
    made.nodes(55).write(tmp_path / "n.parquet")
    base = {"inputs": (str(tmp_path / "n.parquet"),), "zero": "vertical"}
    for settings, stage, said in (
        (
            {"axis": ("crnk=A-B",)},
            "n/angles",
            "there is no link 'crnk'. The links are crank, coupler, rocker",
        ),
        ({"scale": ("A-Q=0.2",)}, "n/points", "'A-Q' names no two points. Give two of n0, n1"),
        ({"points": "B,elbow"}, "n/points", "there is no point 'elbow'. There are n0"),
        ({"origin": "n1"}, "n/points", "n1 moves by"),
    ):
        done = analyse(Options(**base, **settings), tmp_path / "run")  # type: ignore[arg-type]
        assert done.status is RunState.PARTLY
        assert said in done.reasons[stage]
        assert (tmp_path / "run" / "report.html").exists()


def test_scales_that_disagree_and_metres_that_are_none_are_warnings(tmp_path: Path) -> None:
    linkages.four_bar(56, 800).nodes(56).write(tmp_path / "n.parquet")
    base = Options(
        inputs=(str(tmp_path / "n.parquet"),), zero="vertical", scale=("A-D=0.2100", "n0-n1=0.0570")
    )
    analyse(base, tmp_path / "run")
    assert any(
        "two scales disagree: n0-n1 gives" in w or "A-D gives" in w
        for w in report_page(tmp_path / "run").warnings
    )
    analyse(Options(inputs=base.inputs, zero="vertical", scale=("A-D=210",)), tmp_path / "mm")
    assert any("the picture is 640 m wide" in w for w in report_page(tmp_path / "mm").warnings)


def test_a_bodys_only_two_places_have_no_speed(tmp_path: Path) -> None:
    made = linkages.four_bar(57, 800)
    hidden = np.zeros((800, 9), bool)
    hidden[2:, 8] = True
    made.nodes(57, hidden=hidden).write(tmp_path / "n.parquet")
    base = {"inputs": (str(tmp_path / "n.parquet"),), "zero": "vertical"}
    assert "n8 has 2 places" in analyse(Options(**base, points="n8"), tmp_path / "run").reasons["n/points"]  # type: ignore[arg-type]
    assert analyse(Options(**base), tmp_path / "run").status is RunState.DONE  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"axis": ("crank",)}, "does not name a link and two points"),
        ({"axis": ("crank=A-B", "crank=A-n1")}, "crank is given twice"),
        ({"pivot": ("320,5", "100,200")}, "does not name a link and its place"),
        ({"scale": ("A-D=210mm",)}, "'210mm' has the unit mm. Write metres"),
        ({"scale": ("A-D",)}, "does not name two points and their distance in m"),
    ],
)
def test_words_that_say_nothing_are_refused_before_anything_is_done(
    settings: dict[str, tuple[str, ...]], said: str
) -> None:
    with pytest.raises(OptionError, match=said):
        Options(inputs=("film.mp4",), **settings)  # type: ignore[arg-type]


def test_they_are_kept_in_a_file_of_options(tmp_path: Path) -> None:
    told = Options(
        inputs=("n.parquet",),
        axis=("crank=A-B",),
        pivot=("bob=1,2",),
        scale=("A-D=0.21",),
        origin="A",
        points="B",
    )
    (tmp_path / "o.toml").write_text(write_config(told), "utf-8")
    assert read_config(tmp_path / "o.toml") == told
