"""One self-contained HTML page for a run folder; imported by nothing but the command line and ``analyse``."""

from __future__ import annotations

from pydpend.report.content import report_page
from pydpend.report.page import Page, render
from pydpend.report.write import write_report

__all__ = ["Page", "render", "report_page", "write_report"]
