"""Writes a run folder's page."""

from __future__ import annotations

from pathlib import Path

from pydpend.output import write_text
from pydpend.report.content import report_page
from pydpend.report.page import render
from pydpend.run_folder import PAGE


def write_report(folder: str | Path) -> Path:
    """Writes ``report.html`` into a run folder and returns its path."""
    path = Path(folder) / PAGE
    write_text(path, render(report_page(folder)))
    return path
