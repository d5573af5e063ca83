"""The report of the bundled film in a real browser: its own film and plots together, for everybody, as text only."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, Page
from pydpend.analyse import Options, analyse
from pydpend.nodes import Rig, read_nodes
from pydpend.report import report_page

from tests.support.browsing import open_report, until

HOSTILE = "<script>alert(1)</script>"
# No slash can be in a file's name; the dollar signs and the brace would be a formula in a figure.
HOSTILE_FILE = "<img src=x onerror=alert(1)> $a_{ .parquet"

PICTURE = """() => {
  const v = document.querySelector('video'), c = document.createElement('canvas');
  c.width = v.videoWidth; c.height = v.videoHeight;
  c.getContext('2d').drawImage(v, 0, 0);
  const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;
  let bright = 0, x = 0, y = 0;
  for (let i = 0; i < d.length; i += 4) {
    if (d[i] + d[i + 1] + d[i + 2] > 300) { bright++; x += (i / 4) % c.width; y += i / 4 / c.width; }
  }
  return [bright, x / bright, y / bright];
}"""
"""How many bright pixels the film shows now, and their centre."""


RANGE = """id => {
  const c = window.pydpendReport.groups.get('r0').charts.find(c => c.root.parentElement.id === id);
  return [c.scales.x.min, c.scales.x.max];
}"""


@pytest.fixture
def opened(browser: Browser, demo_run: Path) -> Iterator[Page]:
    with open_report(browser, demo_run / "report.html") as page:
        until(page, "document.querySelector('video').readyState >= 2")
        yield page


def film_time(page: Page) -> float:
    """Recorded time that the film shows, from its own clock."""
    now = float(page.evaluate("document.querySelector('video').currentTime"))
    about = page.evaluate(
        "(() => { const f = window.pydpendReport.data.films[0]; return [f.rate_hz, f.times]; })()"
    )
    raw = page.evaluate(
        "key => Array.from(new Float64Array(Uint8Array.from(atob(window.pydpendReport.data.arrays[key]),"
        " c => c.charCodeAt(0)).buffer))",
        about[1],
    )
    return float(raw[int(now * about[0])])


def cursor_time(page: Page) -> float:
    return float(page.evaluate("window.pydpendReport.groups.get('r0').time"))


def click_at(page: Page, chart: str, share: float) -> float:
    """Clicks into a chart and returns the time there."""
    over = page.locator(f"#{chart} .u-over")
    over.scroll_into_view_if_needed()
    box = over.bounding_box()
    assert box is not None
    scale = page.evaluate(RANGE, chart)
    # Between pixels, as a mouse is on a fine screen.
    page.mouse.click(box["x"] + share * box["width"] + 0.4, box["y"] + box["height"] / 2)
    page.wait_for_timeout(100)
    assert page.evaluate(RANGE, chart) == scale, "a click is no zoom"
    return float(scale[0] + share * (scale[1] - scale[0]))


@pytest.mark.parametrize("chart", ["r0-phi", "r0-status"])
def test_a_click_takes_the_film_there(opened: Page, chart: str) -> None:
    first = opened.evaluate(PICTURE)
    wanted = click_at(opened, chart, 0.6)
    until(
        opened, "!document.querySelector('video').seeking && document.querySelector('video').currentTime > 1"
    )
    # A pixel of the plot is 5 s / 500; the film has one frame in 3.
    assert film_time(opened) == pytest.approx(wanted, abs=0.02)
    until(opened, f"Math.abs(window.pydpendReport.groups.get('r0').time - {film_time(opened)}) < 1e-6")
    # The mouse goes, the cursor stays where the film is.
    opened.mouse.move(2, 2)
    until(
        opened,
        "window.pydpendReport.groups.get('r0').charts.every("
        f"c => Math.abs(c.posToVal(c.cursor.left, 'x') - {film_time(opened)}) < 0.02)",
    )
    then = opened.evaluate(PICTURE)
    assert min(first[0], then[0]) > 200
    assert np.hypot(first[1] - then[1], first[2] - then[2]) > 20


def test_the_cursor_follows_the_film_and_its_keys(opened: Page) -> None:
    opened.evaluate("document.querySelector('video').play()")
    until(opened, "window.pydpendReport.groups.get('r0').time > 0.05")
    opened.evaluate("document.querySelector('video').pause()")
    until(opened, "!document.querySelector('video').seeking")
    opened.focus("#r0-phi")
    opened.keyboard.press("ArrowRight")
    until(opened, "!document.querySelector('video').seeking")
    step = 0.003
    for key, sign in (("ArrowRight", 1), ("ArrowLeft", -1)):
        before = film_time(opened)
        until(opened, f"Math.abs(window.pydpendReport.groups.get('r0').time - {before}) < 1e-6")
        opened.keyboard.press(key)
        until(opened, f"Math.abs(window.pydpendReport.groups.get('r0').time - {before + sign * step}) < 1e-6")
        assert film_time(opened) == pytest.approx(before + sign * step, abs=1e-9)
        assert cursor_time(opened) == pytest.approx(before + sign * step, abs=1e-6)


@pytest.mark.parametrize(("scheme", "width"), [("light", 1100), ("dark", 1100), ("light", 390)])
def test_nobody_is_shut_out(browser: Browser, demo_run: Path, scheme: str, width: int) -> None:
    """Contrast, names and roles, headings, tables: the rules of axe-core."""
    with open_report(browser, demo_run / "report.html", scheme=scheme, width=width) as page:
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        found = Axe().run(page)
    wrong = [(v["id"], [n["target"] for n in v["nodes"]][:3]) for v in found.response["violations"]]
    assert wrong == []


def test_the_keyboard_reaches_everything(opened: Page) -> None:
    reached = []
    for _ in range(180):
        opened.keyboard.press("Tab")
        reached.append(
            opened.evaluate(
                "(document.activeElement.id || document.activeElement.textContent || '').trim().slice(0, 20)"
            )
        )
    assert reached[0] == "Skip to the results"
    for wanted in ("Angles", "◀ frame", "frame ▶", "r0-phi", "r0-status", "e0-energy", "show all"):
        assert wanted in reached, reached


def test_it_prints(opened: Page) -> None:
    opened.emulate_media(media="print")
    shown = "s => getComputedStyle(document.querySelector(s)).display !== 'none'"
    assert not opened.evaluate(shown, "nav")
    assert opened.evaluate(shown, "#r0-phi canvas")
    pages = opened.pdf(format="A4").count(b"/Type /Page\n")
    assert 3 <= pages <= 15


def test_the_answer_comes_first_and_in_words(opened: Page) -> None:
    answer = opened.inner_text("#answer")
    assert answer.index("Of the energy lost") < answer.index("mu_v1") < answer.index("markers seen")
    assert "viscous friction, upper joint" in answer
    assert "The last part predicted from a fit to the rest" in answer
    # psi of Table 8's parts: 3.431e6 +- 3.7e4 g mm2.
    assert "This 1.1 % is common to all coefficients" in answer.replace("\u00a0", " ")
    # One line an option, and still a command.
    said = opened.inner_text("#reproduce pre")
    assert said.startswith("pydpend analyse ")
    assert "\\\n    --calibration" in said


def test_an_energy_fit_whose_laws_miss_is_warned_of(demo_run: Path, tmp_path: Path) -> None:
    nodes = str(demo_run / "drop" / "nodes.parquet")
    # Of its few energies no more than two laws are determined.
    options = Options(inputs=(nodes,), zero="-178,-182", start_s=0.6, method="energy", laws="mu_v1,mu_q1")
    analyse(options, tmp_path / "run")
    page = report_page(tmp_path / "run")
    # The film has constant dry torques, which are none of the paper's laws.
    assert any("do not take out the energy" in w for w in page.warnings)


@pytest.fixture(scope="module")
def hostile(demo_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of nodes whose names and whose file's name would like to be a program."""
    nodes = read_nodes(demo_run / "drop" / "nodes.parquet")
    value = json.loads(nodes.rig.to_json())
    value["node"][0]["name"] = HOSTILE
    value["body"][0]["name"] = HOSTILE
    for part in value["node"]:
        part["body"] = HOSTILE if part["body"] == "upper" else part["body"]
    for joint in value["joint"]:
        joint["bodies"] = [HOSTILE if b == "upper" else b for b in joint["bodies"]]
    folder = tmp_path_factory.mktemp("hostile")
    replace(nodes, rig=Rig.from_json(json.dumps(value))).write(folder / HOSTILE_FILE)
    analyse(Options(inputs=(str(folder / HOSTILE_FILE),), zero="-178,-182", start_s=0.6), folder / "run")
    return folder / "run"


def test_names_are_text(browser: Browser, hostile: Path) -> None:
    with open_report(browser, hostile / "report.html") as page:
        assert HOSTILE_FILE in page.inner_text("h1")
        assert HOSTILE in page.inner_text("#r0-nodes table")
        assert HOSTILE_FILE in page.inner_text("#reproduce")
        assert page.evaluate("document.querySelectorAll('img').length") == 0
