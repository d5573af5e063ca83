"""How fast a report opens in Chromium and how smoothly it scrolls: `python tools/report_speed.py REPORT.html`."""

from __future__ import annotations

import shutil
import statistics
import sys
import time
from pathlib import Path

from playwright.sync_api import sync_playwright

FRAMES = """() => {
  window.gaps = []; let last = performance.now();
  const tick = (now) => { window.gaps.push(now - last); last = now; requestAnimationFrame(tick); };
  requestAnimationFrame(tick);
}"""


def main(report: Path, runs: int = 5) -> int:
    """Opens it ``runs`` times in fresh pages, scrolls to the end each time and zooms once."""
    chromium = shutil.which("chromium")
    if chromium is None:
        print("chromium is not installed", file=sys.stderr)
        return 1
    opening, gaps, zooms = [], [], []
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
            zooms.append(
                page.evaluate(
                    """() => { const [g] = [...window.pydpendReport.groups.values()], t = performance.now();
                    const [a, b] = [g.charts[0].scales.x.min, g.charts[0].scales.x.max];
                    for (const c of g.charts) { c.setScale('x', {min: a + 0.2 * (b - a), max: a + 0.7 * (b - a)}); }
                    return performance.now() - t; }"""
                )
            )
            page.close()
        browser.close()
    gaps.sort()
    print(f"opens in {statistics.median(opening):.2f} s (median of {runs}, most {max(opening):.2f} s)")
    print(
        f"scrolling: a picture every {statistics.median(gaps):.1f} ms, 99 % within "
        f"{gaps[int(0.99 * len(gaps))]:.1f} ms, longest {gaps[-1]:.1f} ms, of {len(gaps)}"
    )
    print(f"a zoom of all plots of a group: {statistics.median(zooms):.1f} ms")
    return 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
