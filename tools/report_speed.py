"""How fast a report opens in Chromium and how smoothly it scrolls: `python tools/report_speed.py REPORT.html`."""

from __future__ import annotations

import math
import shutil
import statistics
import sys
import time
from pathlib import Path

from playwright.sync_api import Page, sync_playwright

FRAMES = """() => {
  window.gaps = []; let last = performance.now();
  const tick = (now) => { window.gaps.push(now - last); last = now; requestAnimationFrame(tick); };
  requestAnimationFrame(tick);
}"""


def zoom_and_move(page: Page) -> list[float]:
    """Zooms into the first plot with the wheel and moves along it, all plots of its group with it; gaps in ms."""
    over = page.locator(".chart .u-over").first
    over.scroll_into_view_if_needed()
    box = over.bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + box["height"] / 2)
    page.evaluate("window.gaps.length = 0")
    for key, count, turn in (
        ("Control", 8, -100),
        ("Shift", 40, 100),
        ("Shift", 40, -100),
        ("Control", 8, 100),
    ):
        page.keyboard.down(key)
        for _ in range(count):
            page.mouse.wheel(0, turn)
            page.wait_for_timeout(16)
        page.keyboard.up(key)
    gaps: list[float] = page.evaluate("window.gaps")
    return gaps


def drag(page: Page) -> list[float]:
    """Zooms to a quarter and drags the plot to and fro by the mouse, all plots of its group with it; gaps in ms."""
    over = page.locator(".chart .u-over").first
    box = over.bounding_box()
    assert box is not None
    x, y = box["x"] + 0.5 * box["width"], box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.keyboard.down("Control")
    for _ in range(6):
        page.mouse.wheel(0, -100)
        page.wait_for_timeout(16)
    page.keyboard.up("Control")
    page.wait_for_timeout(300)
    page.evaluate("window.gaps.length = 0")
    page.keyboard.down("Shift")
    page.mouse.down()
    for k in range(120):
        page.mouse.move(x + 0.4 * box["width"] * math.sin(k / 19), y)
        page.wait_for_timeout(16)
    page.mouse.up()
    page.keyboard.up("Shift")
    gaps: list[float] = page.evaluate("window.gaps")
    return gaps


def main(report: Path, runs: int = 5) -> int:
    """Opens it ``runs`` times in fresh pages, each time scrolls to the end, zooms and moves by wheel and dragging."""
    chromium = shutil.which("chromium")
    if chromium is None:
        print("chromium is not installed", file=sys.stderr)
        return 1
    opening, gaps, pans, drags = [], [], [], []
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=chromium, args=["--no-sandbox", "--disable-gpu"])
        for _ in range(runs):
            page = browser.new_page(viewport={"width": 1100, "height": 900})
            begun = time.perf_counter()
            page.goto(report.resolve().as_uri(), wait_until="load")
            while not page.evaluate("window.pydpendReport?.ready === true"):
                page.wait_for_timeout(5)
            # Two frames later it is on the screen.
            page.evaluate("new Promise(f => requestAnimationFrame(() => requestAnimationFrame(f)))")
            opening.append(time.perf_counter() - begun)
            page.evaluate(FRAMES)
            page.mouse.move(550, 450)
            end = page.evaluate("document.documentElement.scrollHeight")
            for _ in range(0, end, 100):
                page.mouse.wheel(0, 100)
                page.wait_for_timeout(16)
            gaps += page.evaluate("window.gaps")
            pans += zoom_and_move(page)
            drags += drag(page)
            page.close()
        browser.close()
    print(f"opens in {statistics.median(opening):.2f} s (median of {runs}, most {max(opening):.2f} s)")
    for what, times in (
        ("scrolling", gaps),
        ("zooming and moving by the wheel", pans),
        ("moving by dragging", drags),
    ):
        times.sort()
        print(
            f"{what}: a picture every {statistics.median(times):.1f} ms, 99 % within "
            f"{times[int(0.99 * len(times))]:.1f} ms, longest {times[-1]:.1f} ms, of {len(times)}"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
