"""The page's server on this machine: started, shown in a browser or a notebook, ended."""

from __future__ import annotations

import html
import os
import socket
import threading
import time
from pathlib import Path

import uvicorn

from pydpend.output import AnyPath, results_folder
from pydpend.page.app import app_of
from pydpend.page.session import Session, checked_film

GONE_S = 8.0
"""A page that said goodbye and does not come back in this time (as it does when it is loaded again) is closed."""


class EditPage:
    """A film's page, served until it is closed.

    Attributes
    ----------
    url : str
        The address for a browser on this machine, with the secret that lets it in.
    edits : str
        The file of decisions.
    """

    def __init__(self, film: AnyPath, rig: AnyPath | None, run: AnyPath | None, *, framed: bool) -> None:
        path = checked_film(film)
        folder = path.parent if run is None else results_folder(run)
        self.session = Session(path, folder, None if rig is None else Path(os.fsdecode(rig)))
        self.edits = str(self.session.edits.path)
        self._socket = socket.create_server(("127.0.0.1", 0))
        port = self._socket.getsockname()[1]
        self._left_s: float | None = None
        guard = app_of(self.session, port, framed=framed, alive=self._alive)
        self.url = f"http://127.0.0.1:{port}/#{guard.token}"
        config = uvicorn.Config(
            guard, log_level="warning", lifespan="off", ws="none", http="h11", timeout_graceful_shutdown=2
        )
        self._server = uvicorn.Server(config)
        self._thread: threading.Thread | None = None

    def _alive(self, here: bool) -> None:
        self._left_s = None if here else time.monotonic()

    def start(self) -> EditPage:
        """Serves it from a thread of its own."""
        self._thread = threading.Thread(
            target=self._server.run, kwargs={"sockets": [self._socket]}, daemon=True
        )
        self._thread.start()
        while not self._server.started and self._thread.is_alive():
            time.sleep(0.01)
        return self

    def wait(self) -> None:
        """Returns when the page was closed in the browser. Ctrl-C ends it too."""
        while self._thread is not None and self._thread.is_alive():
            if self._left_s is not None and time.monotonic() - self._left_s > GONE_S:
                return
            time.sleep(0.2)

    def close(self) -> None:
        """Ends the server; every decision is in its file already."""
        self.session.close()
        self._server.should_exit = True
        if self._thread is not None:
            self._thread.join(5)
        self._socket.close()

    def __enter__(self) -> EditPage:
        """The page, served."""
        return self.start() if self._thread is None else self

    def __exit__(self, *_: object) -> None:
        """Ends the server."""
        self.close()

    def __repr__(self) -> str:
        """A line for people."""
        return f"<EditPage {self.session.film.name}: {self.url}>"

    def _repr_html_(self) -> str:
        """The page in a frame, for a notebook on this machine."""
        # A strict cookie is only sent where the frame's host is the notebook's: localhost, as Jupyter has it.
        address = html.escape(self.url.replace("127.0.0.1", "localhost"))
        frame = f'<iframe src="{address}" title="Edit" width="100%" height="800"></iframe>'
        link = f'<a href="{html.escape(self.url)}" target="_blank" rel="noopener">In a page of its own</a>'
        return f"{frame}<p>{link}</p>"
