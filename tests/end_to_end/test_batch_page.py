"""The page of a batch in a browser: 5000 rows, sorted and chosen, what comes from files as text, for everybody."""

from __future__ import annotations

import random
import subprocess
from pathlib import Path
from typing import Any

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, Page
from pydpend.batching.agreement import write_agreement
from pydpend.batching.page import kind_of_warning, write_index

ROWS = 5000
HOSTILE = "<img src=x onerror=\"document.title='taken'\"></script><b>&amp;"


def made_rows(count: int) -> list[dict[str, Any]]:
    """Rows of a year's films: half without a warning, some failed."""
    draw = random.Random(1)
    out = []
    for k in range(count):
        row: dict[str, Any] = {"name": f"drop_{k:04}", "path": f"/films/drop_{k:04}.mp4", "version": "0.1.0"}
        kind = draw.random()
        if kind < 0.05:
            reason = "its process was ended by SIGSEGV"
            out.append(row | {"state": "failed", "light": "red", "reason": reason, "warnings": []})
            continue
        said = [] if kind < 0.5 else [f"drop_{k:04}.mp4: {k} frames were lost"]
        row |= {"state": "done", "light": "yellow" if said else "green", "warnings": said}
        row |= {"reason": said[0] if said else "", "report": f"runs/drop_{k:04}/report.html"}
        row |= {
            "fit_status": "converged",
            "rig_file": "/films/rig.toml",
            "chi2": draw.gauss(1, 0.02),
            "seconds": 3.0,
        }
        row |= {"mu_v1": draw.gauss(1e-4, 1e-6), "mu_v1_sigma": 1e-6, "duration_s": float(k), "seen": 0.99}
        row["curve"] = [[draw.randrange(-180, 180) for _ in range(96)] for _ in range(2)]
        row["sketch"] = {"size": [1000, 1000], "bodies": [[[500, 300], [520, 400]], [[540, 500]]]}
        out.append(row)
    return out


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("page") / "year"
    folder.mkdir()
    rows = made_rows(ROWS)
    rows[0] |= {
        "name": HOSTILE,
        "reason": HOSTILE,
        "warnings": [HOSTILE],
        "light": "yellow",
        "state": "partly",
    }
    rows[1] |= {"mu_v1": 2e-4}
    write_index(folder, rows, ROWS + 2, write_agreement(folder, rows))
    return folder


def opened(browser: Browser, results: Path, scheme: Any = "light") -> Page:
    page = browser.new_page(color_scheme=scheme)
    page.goto((results / "index.html").as_uri())
    return page


def names(page: Page) -> list[str]:
    return page.locator("#table tbody th").all_inner_texts()


def test_rows_are_sorted_and_chosen(browser: Browser, results: Path) -> None:
    page = opened(browser, results)
    problems: list[object] = []
    page.on("pageerror", lambda problem: problems.append(problem))
    assert page.locator("h1").inner_text() == f"year: {ROWS + 2} recordings"
    assert "2 recordings have not ended yet" in page.locator("header").inner_text()
    assert page.locator("form output").inner_text() == f"{ROWS} of {ROWS} recordings"
    # Few of them are drawn, and more when they are asked for.
    first = len(names(page))
    assert first < 200
    page.locator("#more button").click()
    assert len(names(page)) == 2 * first
    # By a number, down, then up; what has none stands last.
    length = page.get_by_role("button", name="length")
    length.click()
    assert names(page)[0] in (HOSTILE, "drop_0001", "drop_0002")
    length.click()
    assert names(page)[0] >= "drop_4990"
    assert page.locator("th[aria-sort=descending]").count() == 1
    page.get_by_role("button", name="result").click()
    assert page.locator("#table tbody tr").first.inner_text().split("\t")[1].strip() == "no result"
    page.get_by_label("no warning").uncheck()
    page.get_by_label("no result").uncheck()
    page.locator("select[name=warning]").select_option(index=1)
    shown = int(page.locator("form output").inner_text().split()[0])
    assert 2350 < shown < 2650  # half, by four standard deviations of 35
    page.get_by_label("Name or reason").fill("drop_12")
    assert 20 < int(page.locator("form output").inner_text().split()[0]) < 80
    assert all(name.startswith("drop_12") for name in names(page))
    assert problems == []
    page.close()


def test_names_and_reasons_are_text(browser: Browser, results: Path) -> None:
    page = opened(browser, results)
    page.get_by_label("Name or reason").fill("onerror")
    assert names(page) == [HOSTILE]
    assert page.locator("#table tbody td.why").inner_text() == HOSTILE
    assert page.locator("#table img").count() == 0
    assert page.title() != "taken"
    page.close()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_page_is_for_everybody(browser: Browser, results: Path, scheme: str) -> None:
    page = opened(browser, results, scheme)
    found = Axe().run(page)
    assert found.response["violations"] == []
    page.close()


def test_recordings_that_stand_apart_are_named(results: Path) -> None:
    text = (results / "index.html").read_text("utf-8")
    assert "drop_0001 stands apart from the others" in text


def test_the_film_is_the_picture_where_there_is_one(browser: Browser, tmp_path: Path) -> None:
    film = tmp_path / "runs" / "a b" / "overlay.mp4"
    film.parent.mkdir(parents=True)
    command = [
        "ffmpeg",
        "-v",
        "error",
        "-f",
        "lavfi",
        "-i",
        "testsrc=size=64x64:rate=10:duration=1",
        str(film),
    ]
    subprocess.run(command, check=True)
    row = made_rows(30)[-1] | {"name": "a b", "overlay": "runs/a b/overlay.mp4"}
    write_index(tmp_path, [row, row | {"name": "gone", "overlay": "runs/gone.mp4"}], 2, None)
    page = opened(browser, tmp_path)
    page.wait_for_function("document.querySelectorAll('video').length == 1")
    video = page.locator("video")
    assert "a%20b" in str(video.get_attribute("src"))
    # Chromium of Debian plays H.264; the one that is gone shows its markers.
    assert page.locator("svg.sketch").get_attribute("aria-label") == "markers of gone"
    page.close()


def test_a_warning_is_of_a_kind() -> None:
    said = [kind_of_warning(f"drop_{k}.mp4: {k}.5 s and {k}e-3 px were lost", f"drop_{k}") for k in (1, 2)]
    assert said == ["# s and # px were lost"] * 2
