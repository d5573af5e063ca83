"""The guard before the page's server: who may ask, and what a browser may do with the answers."""

from __future__ import annotations

import hmac
import secrets
from http.cookies import CookieError, SimpleCookie
from typing import Any

from starlette.responses import JSONResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

LARGEST_BODY_BYTES = 1 << 16
"""A decision is a few hundred bytes, a list of markers a few thousand."""

CHANGING = ("POST", "PUT", "PATCH", "DELETE")


class Guard:
    """Refuses requests of other hosts, other origins and of those without the session's cookie.

    Parameters
    ----------
    app : ASGIApp
        What is guarded.
    port : int
        The server's own.
    framed : bool
        Whether a notebook on this machine may show the page in a frame.
    """

    def __init__(self, app: ASGIApp, port: int, framed: bool = False) -> None:
        self._app = app
        self._hosts = (f"127.0.0.1:{port}", f"localhost:{port}")
        self.token = secrets.token_urlsafe(32)
        self._session = secrets.token_urlsafe(32)
        self._cookie = f"pydpend_{port}"
        around = "http://127.0.0.1:* http://localhost:*" if framed else "'none'"
        self._headers = {
            "content-security-policy": (
                "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; "
                f"connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors {around}"
            ),
            "x-content-type-options": "nosniff",
            "referrer-policy": "no-referrer",
            "cross-origin-resource-policy": "same-origin",
            "cross-origin-opener-policy": "same-origin",
            "cache-control": "no-store",
        }

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answers one request."""
        if scope["type"] != "http":
            return
        refused = self._refused(scope)

        async def safe(message: Message) -> None:
            if message["type"] == "http.response.start":
                extra = [(name.encode(), value.encode()) for name, value in self._headers.items()]
                message = {**message, "headers": [*message.get("headers", []), *extra]}
            await send(message)

        if refused is not None:
            await JSONResponse({"error": refused[1]}, status_code=refused[0])(scope, receive, safe)
            return
        await self._app(scope, receive, safe)

    def opened(self, given: object) -> Response | None:
        """The answer that gives the cookie for the right token, None for a wrong one."""
        if not isinstance(given, str) or not hmac.compare_digest(given.encode(), self.token.encode()):
            return None
        answer = JSONResponse({"ok": True})
        answer.set_cookie(self._cookie, self._session, httponly=True, samesite="strict", path="/")
        return answer

    def _refused(self, scope: Scope) -> tuple[int, str] | None:
        """Status and reason for which a request is refused; None for one that is not."""
        headers: dict[str, str] = {}
        for name, value in scope["headers"]:
            headers[name.decode("latin-1").lower()] = value.decode("latin-1")
        host = headers.get("host", "")
        # A name that an attacker points at 127.0.0.1 (DNS rebinding) comes as the host.
        if host not in self._hosts:
            return 421, "this server answers to 127.0.0.1 and localhost only"
        origin = headers.get("origin")
        if origin is not None and origin != f"http://{host}":
            return 403, "the request comes from another site"
        changing = scope["method"] in CHANGING
        if changing and origin is None:
            return 403, "a change needs the page's own origin"
        if changing and not headers.get("content-type", "").startswith("application/json"):
            return 415, "a change is sent as application/json"
        if changing and not 0 <= _number(headers.get("content-length")) <= LARGEST_BODY_BYTES:
            return 413, "the request is too long, or does not say how long it is"
        path: str = scope["path"]
        if path.startswith("/api/") and path != "/api/session" and not self._knows(headers.get("cookie", "")):
            return 401, "open the page with the address that the program printed"
        return None

    def _knows(self, cookies: str) -> bool:
        try:
            found: Any = SimpleCookie(cookies).get(self._cookie)
        except CookieError:
            return False
        return found is not None and hmac.compare_digest(found.value.encode(), self._session.encode())


def _number(text: str | None) -> int:
    return int(text) if text is not None and text.isascii() and text.isdigit() else -1
