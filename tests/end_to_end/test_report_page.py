"""The report page in a real browser: plots draw, the film plays, one cursor moves both ways, nothing leaves."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Browser, Page
from pydpend.report import page as p
from pydpend.report import words

from tests.support.browsing import open_report, until

FRAMES, RATE, STEP = 60, 30.0, 0.05
HOSTILE = "<script>alert(1)</script>"
SENTENCE = (
    "0.024 deg noise, 0.0011 deg camera (one error of all frames, which no number of them averages out)" * 2
)


@pytest.fixture(scope="module")
def mp4(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("film") / "film.mp4"
    source = f"testsrc=size=160x120:rate={RATE:g}:duration={FRAMES / RATE:g}"
    subprocess.run(
        [
            "ffmpeg",
            "-v",
            "error",
            "-f",
            "lavfi",
            "-i",
            source,
            "-c:v",
            "libx264",
            "-pix_fmt",
            "yuv420p",
            "-g",
            "10",
            "-movflags",
            "+faststart",
            str(path),
        ],
        check=True,
    )
    return path.read_bytes()


@pytest.fixture(scope="module")
def html(mp4: bytes, tmp_path_factory: pytest.TempPathFactory) -> Path:
    t = np.arange(100_000, dtype=np.float64) * (FRAMES * STEP / 100_000)
    y = np.sin(2 * np.pi * t)
    y[5000:6000] = np.nan
    page = p.Page(
        title=f"Analysis of {HOSTILE}",
        subtitle="pydpend",
        warnings=(f"a node called {HOSTILE}",),
        sections=(
            p.Section("answer", "Results", (p.Table(("quantity", "value"), ((HOSTILE, "1.0 ± 0.1"),)),)),
            p.Section(
                "recording",
                "Recording",
                (
                    p.Table(
                        ("property", "film"),
                        (("phi1", SENTENCE), ("rate", "1000 per s")),
                        numbers=frozenset({1}),
                    ),
                ),
            ),
            p.Section(
                "angles",
                "Angles",
                (
                    p.Film("film", "g", mp4, np.arange(FRAMES, dtype=np.float64) * STEP, RATE, "the film"),
                    p.Chart("one", "Angles", "g", t, (p.Series("phi1", y), p.Series("phi2", 2 * y, 1))),
                    p.Chart(
                        "two",
                        "With a band",
                        "g",
                        t,
                        (p.Series("hi", y + 1), p.Series("lo", y - 1, band=(1, 0)), p.Series("y", y)),
                    ),
                    p.StatusMap(
                        "map",
                        "Nodes",
                        "g",
                        t,
                        (HOSTILE, "n1"),
                        (((1, 0.0, 3.0),), ((1, 0.0, 1.0), (0, 1.0, 3.0))),
                    ),
                    p.Reset("g"),
                ),
            ),
        ),
    )
    path = tmp_path_factory.mktemp("page") / "report.html"
    path.write_text(p.render(page), encoding="utf-8")
    return path


@pytest.fixture
def opened(browser: Browser, html: Path) -> Iterator[Page]:
    with open_report(browser, html) as page:
        yield page


def film_time(page: Page) -> float:
    return float(page.evaluate("document.querySelector('video').currentTime"))


def cursor_time(page: Page) -> float:
    return float(page.evaluate("window.pydpendReport.groups.get('g').time"))


@pytest.mark.parametrize(
    ("said", "meant"),
    [
        (words.digits(0.02), "0.020"),
        (words.digits(66.588, 3), "66.6"),
        (words.digits(1234.5), "1234"),
        (words.with_sigma(2.0026e-3, 1.1e-5), "0.002003 ± 0.000011"),
        (words.with_sigma(2.5e-6, 1.2e-9), "(2.5000 ± 0.0012) × 10⁻⁶"),
        (words.with_sigma(None, 1.0), "–"),
        (words.with_sigma(-38.2, 43.1), "−38 ± 43"),
        (words.quantity(2.5, 0.12, words.with_squares("kg m2")), "2.50\u00a0±\u00a00.12 kg\u00a0m²"),
        (words.between(1.944e-10, 1.0803e-8), "(0.02 to 1.08) × 10⁻⁸"),
        (words.between(0.0, 0.0123), "0.0000 to 0.0123"),
        (words.between(1.9e-5, None), "(1.900 to ?) × 10⁻⁵"),
        (words.signed(-0.0608, 3), "−0.0608"),
        (words.listed(["a", "b", "c"]), "a, b and c"),
        (words.sentence("rmu2: 1.9e-05 +- 1.0e-05 N m s2"), "rmu2: 1.9 × 10⁻⁵ ± 1.0 × 10⁻⁵ N m s²"),
        (words.sentence("converged in 6 steps"), "Converged in 6 steps"),
        (words.sentence("trial1: free decay"), "trial1: free decay"),
    ],
)  # fmt: skip
def test_numbers_as_people_read_them(said: str, meant: str) -> None:
    assert said == meant


def test_plots_draw(opened: Page) -> None:
    # Ink on the canvas: pixels that are neither transparent nor the ground.
    inked = opened.evaluate(
        """() => [...document.querySelectorAll('canvas')].map(c => {
            const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;
            let n = 0; for (let i = 3; i < d.length; i += 4) if (d[i] > 0) n++; return n; })"""
    )
    assert len(inked) == 3
    assert min(inked) > 1000


def test_a_click_in_a_plot_takes_the_film_there(opened: Page) -> None:
    until(opened, "document.querySelector('video').readyState >= 2")
    over = opened.locator("#one .u-over")
    over.scroll_into_view_if_needed()
    box = over.bounding_box()
    assert box is not None
    opened.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    # The middle of the plot is t = 1.5 s, which is film frame 30: its middle is (30 + 0.5) / 30 s.
    until(
        opened,
        "!document.querySelector('video').seeking && document.querySelector('video').currentTime > 0.5",
    )
    assert abs(film_time(opened) - 30.5 / RATE) < 1.01 / RATE


def test_arrow_keys_step_a_frame_and_the_cursor_follows(opened: Page) -> None:
    until(opened, "document.querySelector('video').readyState >= 2")
    opened.focus("#one")
    for _ in range(3):
        before = film_time(opened)
        opened.keyboard.press("ArrowRight")
        until(opened, f"document.querySelector('video').currentTime > {before} + 0.5 / {RATE}")
        until(opened, "!document.querySelector('video').seeking")
    until(opened, f"Math.abs(window.pydpendReport.groups.get('g').time - {3 * STEP}) < 1e-3")
    assert abs(cursor_time(opened) - 3 * STEP) < 1e-3


def test_the_cursor_follows_the_playing_film(opened: Page) -> None:
    until(opened, "document.querySelector('video').readyState >= 2")
    opened.evaluate("document.querySelector('video').play()")
    until(opened, "window.pydpendReport.groups.get('g').time > 0.3")
    opened.evaluate("document.querySelector('video').pause()")


def test_zoom_is_shared_and_undone(opened: Page) -> None:
    over = opened.locator("#two .u-over")
    over.scroll_into_view_if_needed()
    box = over.bounding_box()
    assert box is not None
    y = box["y"] + box["height"] / 2
    opened.mouse.move(box["x"] + 0.25 * box["width"], y)
    opened.mouse.down()
    opened.mouse.move(box["x"] + 0.5 * box["width"], y, steps=5)
    opened.mouse.up()
    ranges = "window.pydpendReport.groups.get('g').charts.map(c => [c.scales.x.min, c.scales.x.max])"
    until(opened, f"{ranges}.every(r => r[1] - r[0] < 1)")
    found = opened.evaluate(ranges)
    assert all(abs(r[0] - 0.75) < 0.05 and abs(r[1] - 1.5) < 0.05 for r in found), found
    opened.click("button[data-reset]")
    until(opened, f"{ranges}.every(r => r[1] - r[0] > 2.9)")


def test_a_drag_with_shift_moves_and_keys_too(opened: Page) -> None:
    over = opened.locator("#two .u-over")
    over.scroll_into_view_if_needed()
    box = over.bounding_box()
    assert box is not None
    x, y = box["x"] + 0.5 * box["width"], box["y"] + box["height"] / 2
    ranges = "window.pydpendReport.groups.get('g').charts.map(c => [c.scales.x.min, c.scales.x.max])"
    opened.mouse.move(x, y)
    opened.keyboard.down("Control")
    opened.mouse.wheel(0, -100)
    opened.keyboard.up("Control")
    # Four fifths of 3 s are left, the middle where it was; a tenth of the plot to the left is 0.24 s on.
    until(opened, f"{ranges}.every(r => Math.abs(r[0] - 0.3) < 0.02 && Math.abs(r[1] - 2.7) < 0.02)")
    opened.keyboard.down("Shift")
    opened.mouse.down()
    opened.mouse.move(x - 0.1 * box["width"], y, steps=4)
    opened.mouse.up()
    opened.keyboard.up("Shift")
    until(opened, f"{ranges}.every(r => Math.abs(r[0] - 0.54) < 0.02 && Math.abs(r[1] - 2.94) < 0.02)")
    opened.focus("#two")
    opened.keyboard.press("Shift+ArrowLeft")
    until(opened, f"{ranges}.every(r => Math.abs(r[0] - 0.3) < 0.02 && Math.abs(r[1] - 2.7) < 0.02)")


def test_charts_stay_within_a_printed_page(opened: Page) -> None:
    opened.set_viewport_size({"width": 680, "height": 900})  # A4 less its margins
    opened.emulate_media(media="print")
    wide = "[...document.querySelectorAll('.chart canvas')].map(c => c.getBoundingClientRect().right)"
    assert max(opened.evaluate(wide)) <= 680
    assert not opened.evaluate("[...document.querySelectorAll('.u-over')].some(o => o.offsetParent !== null)")


def test_two_fingers_zoom_and_one_moves(browser: Browser, html: Path) -> None:
    with open_report(browser, html, width=390, touch=True) as page:
        over = page.locator("#two .u-over")
        over.scroll_into_view_if_needed()
        box = over.bounding_box()
        assert box is not None
        fingers = page.context.new_cdp_session(page)

        def touch(kind: str, *shares: float) -> None:
            points = [
                {"x": box["x"] + s * box["width"], "y": box["y"] + 60, "id": k} for k, s in enumerate(shares)
            ]
            fingers.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

        ranges = "window.pydpendReport.groups.get('g').charts.map(c => [c.scales.x.min, c.scales.x.max])"
        # From 0.4 and 0.6 of the width to 0.25 and 0.75: of the 3 s there stay 3 / 2.5, about the middle.
        touch("touchStart", 0.4, 0.6)
        for share in (0.35, 0.3, 0.25):
            touch("touchMove", share, 1 - share)
        touch("touchEnd")
        until(page, f"{ranges}.every(r => Math.abs(r[0] - 0.9) < 0.03 && Math.abs(r[1] - 2.1) < 0.03)")
        # A quarter of the width to the right: a quarter of what is shown earlier.
        touch("touchStart", 0.5)
        for share in (0.6, 0.7, 0.75):
            touch("touchMove", share)
        touch("touchEnd")
        until(page, f"{ranges}.every(r => Math.abs(r[0] - 0.6) < 0.03 && Math.abs(r[1] - 1.8) < 0.03)")


def test_names_are_text(opened: Page) -> None:
    assert HOSTILE in opened.inner_text("h1")
    assert HOSTILE in opened.inner_text("#warnings")


@pytest.mark.parametrize(("width", "scheme"), [(1100, "light"), (1100, "dark"), (390, "light")])
def test_it_fits_the_width(browser: Browser, html: Path, width: int, scheme: str) -> None:
    context = browser.new_context(
        viewport={"width": width, "height": 800}, color_scheme="dark" if scheme == "dark" else "light"
    )
    page = context.new_page()
    page.goto(html.as_uri())
    until(page, "window.pydpendReport?.ready === true")
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    if width > 1000:
        wide = page.locator("#recording .scroll").evaluate("e => e.scrollWidth - e.clientWidth")
        assert wide <= 0, "a table with a sentence in it is wider than the page"
    context.close()
