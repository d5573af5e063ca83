"""The entries with which pydpend and its method are cited, as BibTeX."""

from __future__ import annotations

PAPER = """@techreport{myers2020doublependulum,
  title  = {The Double Pendulum: An Experimental Design Report},
  author = {Myers, A. D. and Tempelman, J. R. and Petrushenko, D. and Khasawneh, F. A.},
  year   = {2020},
}"""
"""The paper whose method is carried on, as in CITATION.cff."""


def bibtex(version: str) -> str:
    """The entries of one version of the program and of the paper.

    Parameters
    ----------
    version : str
        The version that made a result, as ``pydpend.__version__``.

    Returns
    -------
    str
        Two entries of BibTeX, parted by an empty line.
    """
    software = "\n".join(
        [
            "@software{pydpend,",
            "  title   = {pydpend},",
            "  author  = {{The pydpend developers}},",
            f"  version = {{{version}}},",
            "}",
        ]
    )
    return f"{software}\n\n{PAPER}\n"
