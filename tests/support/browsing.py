"""A report in a real browser."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from playwright.sync_api import Browser, Page


@contextmanager
def open_report(
    browser: Browser, html: Path, *, scheme: str = "light", width: int = 1100, touch: bool = False
) -> Iterator[Page]:
    """The page, ready. At the end no console error, no dialog and no request to anywhere has been seen."""
    problems: list[str] = []
    context = browser.new_context(
        viewport={"width": width, "height": 900},
        color_scheme="dark" if scheme == "dark" else "light",
        has_touch=touch,
    )
    page = context.new_page()
    page.on("console", lambda m: problems.append(m.text) if m.type in ("error", "warning") else None)
    page.on("pageerror", lambda e: problems.append(str(e)))
    page.on("dialog", lambda d: problems.append(f"dialog {d.message}"))
    page.on(
        "request",
        lambda r: None if r.url.startswith(("file:", "data:", "blob:")) else problems.append(r.url),
    )
    page.goto(html.as_uri())
    until(page, "window.pydpendReport?.ready === true")
    yield page
    context.close()
    assert problems == []


def until(page: Page, condition: str, seconds: float = 30.0) -> None:
    """Polls: the page's content policy forbids the driver's own waiting, which compiles text in the page."""
    end = time.monotonic() + seconds
    while not page.evaluate(condition):
        assert time.monotonic() < end, f"not within {seconds} s: {condition}"
        page.wait_for_timeout(20)
