"""How Sphinx makes the site of these pages: `make docs` (docs/decisions/0022)."""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / "python")]

from pydpend import _native  # noqa: E402

from tools import site_pages  # noqa: E402

project = "pydpend"
author = "The pydpend developers"
copyright = author
version = release = _native.VERSION

extensions = ["myst_nb", "numpydoc", "sphinx.ext.autodoc"]
root_doc = "index"
# Pages of the repository's own: the site shows docs/README.md as a part of its front page.
exclude_patterns = ["README.md"]

# Anchors of headings are those that GitHub gives them, so that one link serves both.
myst_heading_anchors = 4
# `make docs` runs the notebooks and keeps what came out for the next time; the tests run them beside the site.
nb_execution_mode = "cache"
nb_execution_cache_path = str(ROOT / "out" / "site-notebooks")
nb_execution_timeout = 600
nb_execution_raise_on_error = True


# Types stand in the docstrings, with shapes and units.
autodoc_typehints = "none"
autodoc_member_order = "bysource"
numpydoc_show_class_members = False

html_theme = "furo"
html_title = f"pydpend {version}"
html_show_sphinx = False
html_copy_source = False


def setup(app):
    """Fills in the pages that are made from the programs themselves."""
    site_pages.connect(app)
