"""The page of a film from Python; what serves it is loaded when a page is opened, and may not be installed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pydpend.errors import ArgumentError, fault
from pydpend.output import AnyPath
from pydpend.typed import typed

if TYPE_CHECKING:
    from pydpend.page.serve import EditPage


@typed()
def edit(film: AnyPath, rig: AnyPath | None = None, run: AnyPath | None = None) -> EditPage:
    """A page on which a film's markers are seen, chosen and corrected; in a notebook it is shown in a frame.

    Parameters
    ----------
    film : path-like
        The film.
    rig : path-like, optional
        A rig file to begin with; that of an earlier page of the film, or found in it, if not given.
    run : path-like, optional
        Folder for the decisions (``NAME.edits.toml``), the rig and the table; the film's own if not given.

    Returns
    -------
    pydpend.page.serve.EditPage
        The page, served on this machine until its ``close()``; its ``url`` is for a browser, its ``edits`` the file.

    Raises
    ------
    SourceError
        If the film cannot be opened.
    ArgumentError
        If there is no such film, the folder cannot be made, its file of decisions is no TOML, or the extra ``page``
        is not installed.
    """
    return opened(film, rig, run, framed=True)


def opened(film: AnyPath, rig: AnyPath | None, run: AnyPath | None, *, framed: bool) -> EditPage:
    """The page, served; ``framed`` lets a notebook on this machine show it in a frame."""
    try:
        from pydpend.page.serve import EditPage
    except ModuleNotFoundError as problem:
        advice = "Install it with `pip install 'pydpend[page]'`"
        raise ArgumentError(fault("page", f"{problem.name} is not installed", advice)) from None
    return EditPage(film, rig, run, framed=framed).start()
