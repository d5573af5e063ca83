"""The tiles at the top of the report, and what its buttons save."""

from __future__ import annotations

import csv
import io
import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pydpend as dp
import pytest
from playwright.sync_api import Browser, Page
from pydpend.report.page import Light
from pydpend.report.recording import Part
from pydpend.report.tiles import tiles

from tests.support.browsing import open_report, until


@pytest.fixture(scope="module")
def opened(browser: Browser, demo_run: Path) -> Iterator[Page]:
    with open_report(browser, demo_run / "report.html") as page:
        yield page


def saved(page: Page, tools: str, form: str) -> str:
    """The text that a button saves."""
    with page.expect_download() as download:
        page.click(f"{tools} >> [data-save={form}]")
    return Path(download.value.path()).read_text("utf-8")


def test_the_tiles_of_the_demo(opened: Page, demo_run: Path) -> None:
    assert opened.locator(".tile h3").all_inner_texts() == [
        "Film",
        "Angles",
        "Energy lost",
        "How it was measured",
    ]
    until(opened, "document.querySelector('#tile-film canvas') !== null")
    assert opened.evaluate("document.querySelector('#tile-film canvas').width") > 100
    assert opened.inner_text("#tile-angles .light") == "good"
    said = opened.inner_text("#tile-measures")
    for words in ("reference recording", "none given", "1000 per s", "aimed by eye"):
        assert words in said
    # As many percent as there are: of the laws and of the joints.
    for group in range(2):
        bars = opened.locator("#tile-energy .bars").nth(group).locator(".bar")
        styles = bars.evaluate_all("bars => bars.map((bar) => bar.getAttribute('style'))")
        assert sum(float(style.split("width: ")[1].split("%")[0]) for style in styles) == pytest.approx(
            100, abs=0.2
        )


def test_a_chart_is_saved_as_it_is_seen(opened: Page) -> None:
    opened.focus("#r0-phi")
    for _ in range(3):
        opened.keyboard.press("+")
    chart = "window.pydpendReport.charts().find((c) => c.spec.id === 'r0-phi').u.scales.x"
    until(opened, f"Math.abs({chart}.min - window.pydpendReport.groups.get('r0').range[0]) < 1e-12")
    first, last = opened.evaluate(f"[{chart}.min, {chart}.max]")
    assert last - first < 4
    rows = list(csv.reader(io.StringIO(saved(opened, "[data-chart=r0-phi]", "csv"))))
    assert rows[0] == ["time (s)", "phi1 (deg)", "phi2 (deg)"]
    t = np.array([float(row[0]) for row in rows[1:]])
    # A frame each millisecond.
    assert first <= t[0] < first + 1e-3
    assert last - 1e-3 < t[-1] <= last
    drawing = ET.fromstring(saved(opened, "[data-chart=r0-phi]", "svg"))
    texts = [e.text for e in drawing.iter("{http://www.w3.org/2000/svg}text")]
    assert {"Angles", "phi1 (deg)", "phi2 (deg)", "time (s)"} <= set(texts)
    strokes = [
        e.get("stroke")
        for e in drawing.iter("{http://www.w3.org/2000/svg}path")
        if e.get("stroke-width") == "1.25"
    ]
    assert len(set(strokes)) == 2
    with opened.expect_download() as download:
        opened.click("[data-chart=r0-phi] [data-save=png]")
    assert Path(download.value.path()).read_bytes()[:4] == b"\x89PNG"
    markers = saved(opened, "[data-chart=r0-status]", "csv").splitlines()
    assert markers[0] == "marker,status,from_s,to_s"
    assert {line.split(",")[0] for line in markers[1:]} == {f"n{k}" for k in range(9)}
    opened.keyboard.press("0")


def test_tables_are_saved(opened: Page) -> None:
    table = "#answer .tools >> nth=0"
    rows = list(csv.reader(io.StringIO(saved(opened, table, "csv"))))
    assert rows[0][:3] == ["coefficient", "symbol", "value"]
    tex = saved(opened, table, "tex")
    assert tex.count(r"\\") == len(rows)
    assert "mu\\_v1" in tex
    assert r"$\pm$" in tex
    assert "$^{-4}$" in tex or "$^{-5}$" in tex
    assert not set(tex) & set("±×⁻⁴⁵²−")


def test_the_page_names_its_files_and_its_bibtex(opened: Page, demo_run: Path) -> None:
    links = opened.locator(".files a").evaluate_all("a => a.map(x => x.getAttribute('href'))")
    assert {"run.json", "README.txt", "fit/fit.json", "drop/angles.parquet"} <= set(links)
    assert [name for name in links if not (demo_run / name).is_file()] == []
    assert f"version = {{{dp.__version__}}}" in opened.inner_text("#reproduce")


def part(zero_deg: float | None, lacking: float = 0.0, notes: tuple[str, ...] = ()) -> Part:
    phi = np.zeros((1000, 2))
    phi[: round(1000 * lacking), 0] = math.nan
    zero = {} if zero_deg is None else {"zero": {"from": "rest", "sigma_rad": [math.radians(zero_deg)] * 2}}
    return Part(
        "drop.mp4",
        angles=dp.LinkAngles(np.arange(1000) / 500, phi, np.full(phi.shape, 1e-3)),
        meta={**zero, "notes": list(notes)},
    )


@pytest.mark.parametrize(
    ("given", "light", "reason"),
    [
        (
            part(0.001),
            Light.GOOD,
            "100.0 % of the frames have all angles, and the zero is known to 0.0010 deg.",
        ),
        (part(0.001, 0.2), Light.BAD, "Only 80 % of the frames have all angles."),
        (part(0.001, 0.05), Light.LOOK, "5.0 % of the frames lack an angle."),
        (part(1.0), Light.LOOK, "The zero is known to 1.0 deg only: a film hanging still tells it better."),
        (part(5.7), Light.BAD, "The zero is known to 5.7 deg only."),
        (part(0.001, notes=("two rests disagree",)), Light.LOOK, "A warning is about them."),
        (part(None), Light.LOOK, "How well their zero is known is not stated."),
    ],
)
def test_the_traffic_light_has_its_reason(given: Part, light: Light, reason: str) -> None:
    tile = tiles([given], None)[1]
    assert (tile.light, tile.note) == (light, reason)


def test_of_several_recordings_the_worst_is_told() -> None:
    good, bad = part(0.001), part(5.7)
    bad.label = "other.mp4"
    tile = tiles([good, bad], None)[1]
    assert tile.light is Light.BAD
    assert tile.note.startswith("other.mp4: ")
