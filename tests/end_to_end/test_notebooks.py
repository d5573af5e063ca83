"""The notebooks of the documentation run from their first cell to their last, and say what they should."""

from __future__ import annotations

from pathlib import Path

import nbclient
import pytest
from myst_nb.core.read import read_myst_markdown_notebook

FOLDER = Path(__file__).parents[2] / "docs" / "notebooks"
NOTEBOOKS = sorted(path.stem for path in FOLDER.glob("*.md"))


def test_there_are_the_five() -> None:
    assert {"first-track", "single-pendulum", "four-bar", "damping-fit", "many-trials"} <= set(NOTEBOOKS)


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_a_notebook_runs_and_shows_its_figures(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", str(FOLDER.parents[1] / "python"))
    notebook = read_myst_markdown_notebook((FOLDER / f"{name}.md").read_text("utf-8"), add_source_map=False)
    # The limit is for one that hangs: they take a minute of processor time together.
    client = nbclient.NotebookClient(
        notebook, timeout=600, kernel_name="python3", resources={"metadata": {"path": str(FOLDER)}}
    )
    client.execute()
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    assert [output for output in outputs if output.get("name") == "stderr"] == []
    drawn = sum("plot(" in cell.source for cell in notebook.cells if cell.cell_type == "code")
    assert sum("image/png" in output.get("data", {}) for output in outputs) == drawn > 0
