"""Writes a run folder's page."""

from __future__ import annotations

from pathlib import Path

from pydpend.output import write_text
from pydpend.report.content import report_page
from pydpend.report.page import Page, render
from pydpend.run_folder import PAGE


def write_report(folder: str | Path) -> Page:
    """Writes ``report.html`` into a run folder and returns what it shows."""
    page = report_page(folder)
    write_text(Path(folder) / PAGE, render(page))
    return page
