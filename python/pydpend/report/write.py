"""Writes a run folder's page."""

from __future__ import annotations

from pathlib import Path

from pydpend.report.content import report_page
from pydpend.report.page import render


def write_report(folder: str | Path) -> Path:
    """Writes ``report.html`` into a run folder and returns its path."""
    path = Path(folder) / "report.html"
    temporary = path.with_name("report.html.new")
    temporary.write_text(render(report_page(folder)), encoding="utf-8")
    temporary.replace(path)
    return path
