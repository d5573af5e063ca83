"""A film's page asked over its socket, and driven in a browser."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from http.client import HTTPConnection
from typing import Any
from urllib.parse import urlsplit

from playwright.sync_api import Browser, Page

from tests.support.browsing import until


@dataclass
class Answer:
    """Status, headers and body of an answer."""

    status: int
    headers: dict[str, str]
    body: bytes

    @property
    def json(self) -> Any:
        return json.loads(self.body)


@dataclass
class Client:
    """Whoever asks a page's server."""

    url: str
    cookie: str | None = None

    @property
    def host(self) -> str:
        return urlsplit(self.url).netloc

    @property
    def token(self) -> str:
        return urlsplit(self.url).fragment

    def ask(
        self,
        path: str,
        said: Any = None,
        *,
        host: str | None = None,
        origin: str | None = "own",
        kind: str = "application/json",
    ) -> Answer:
        """A change where something is said, else a question. ``path`` is sent as it is."""
        connection = HTTPConnection(self.host, timeout=20)
        body = None if said is None else json.dumps(said).encode()
        headers = {"Host": host or self.host}
        if self.cookie is not None:
            headers["Cookie"] = self.cookie
        if body is not None:
            headers["Content-Type"] = kind
            if origin is not None:
                headers["Origin"] = f"http://{self.host}" if origin == "own" else origin
        elif origin not in (None, "own"):
            headers["Origin"] = str(origin)
        connection.request("GET" if body is None else "POST", path, body, headers)
        answer = connection.getresponse()
        got = Answer(answer.status, {k.lower(): v for k, v in answer.getheaders()}, answer.read())
        connection.close()
        return got

    def enter(self) -> Client:
        """With the cookie."""
        cookie = self.ask("/api/session", {"token": self.token}).headers["set-cookie"]
        self.cookie = cookie.partition(";")[0]
        return self

    def state(self) -> Any:
        return self.ask("/api/state").json

    def settled(self, seconds: float = 60) -> Any:
        """The state once nothing runs."""
        end = time.monotonic() + seconds
        while (state := self.state())["work"]["busy"]:
            assert time.monotonic() < end, state["work"]
            time.sleep(0.05)
        return state


@contextmanager
def open_page(
    browser: Browser, url: str, *, scheme: str = "light", width: int = 1280, height: int = 800
) -> Iterator[Page]:
    """The page in a browser, ready. At the end no console error and no request elsewhere has been seen."""
    problems: list[str] = []
    context = browser.new_context(
        viewport={"width": width, "height": height}, color_scheme="dark" if scheme == "dark" else "light"
    )
    page = context.new_page()
    own = url.partition("#")[0]
    page.on("console", lambda m: problems.append(m.text) if m.type in ("error", "warning") else None)
    page.on("pageerror", lambda e: problems.append(str(e)))
    page.on("dialog", lambda d: problems.append(f"dialog {d.message}"))
    page.on(
        "request", lambda r: None if r.url.startswith((own, "blob:", "data:")) else problems.append(r.url)
    )
    page.goto(url)
    until(page, "window.pydpendEdit !== undefined")
    yield page
    context.close()
    assert problems == [], problems


def settled(page: Page, seconds: float = 120) -> None:
    """Waits until the page shows the table of a run that is over."""
    page.wait_for_timeout(50)
    until(page, "pydpendEdit.state.work.busy === false && !pydpendEdit.loading", seconds)
