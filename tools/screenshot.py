"""The README's picture: the top of the demo's report. Run by `make screenshot` after `make demo`."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

from playwright.sync_api import sync_playwright

ROOT = Path(__file__).resolve().parent.parent
REPORT = ROOT / "out" / "demo" / "report.html"
PICTURE = ROOT / "docs" / "report.png"


def main() -> int:
    """Takes it."""
    chromium = shutil.which("chromium")
    if not REPORT.exists() or chromium is None:
        print("Run `make demo` first; Debian's chromium is needed.", file=sys.stderr)
        return 1
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=chromium, args=["--no-sandbox", "--disable-gpu"])
        page = browser.new_page(viewport={"width": 1100, "height": 1000})
        page.goto(REPORT.as_uri())
        # A moment in the motion, in the film and in the curves.
        page.evaluate("document.getElementById('r0-angles').scrollIntoView()")
        box = page.locator("#r0-phi .u-over").bounding_box()
        assert box is not None
        page.mouse.click(box["x"] + 0.42 * box["width"], box["y"] + box["height"] / 2)
        page.wait_for_timeout(1500)
        page.mouse.move(0, 0)
        page.screenshot(path=PICTURE)
        browser.close()
    print(f"{PICTURE.relative_to(ROOT)}: {PICTURE.stat().st_size / 1000:.0f} kB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
