"""The page's addresses: its own files, the film's pictures and rows, and what a person changes."""

from __future__ import annotations

import importlib.resources
from collections.abc import Awaitable, Callable
from typing import Any

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from pydpend.errors import PydpendError, speaking
from pydpend.page.edits_file import ChangedElsewhere
from pydpend.page.guard import Guard
from pydpend.page.session import Session
from pydpend.page.words import PageWords

TYPES = {"html": "text/html", "css": "text/css", "js": "text/javascript"}
STATIC = (
    "index.html",
    "page.css",
    "page.js",
    "api.js",
    "film.js",
    "steps.js",
    "check.js",
    "dom.js",
    "keys.js",
    "draw.js",
)
"""The page's own files; nothing else of the disk is served."""
PLOTS = ("uPlot.iife.min.js", "uPlot.min.css")
"""The report's plotting library."""

Answer = Callable[[Request], Awaitable[Response]]


def app_of(session: Session, port: int, *, framed: bool, alive: Callable[[bool], None]) -> Guard:
    """The server's application. ``alive`` is told of every request, False of the one with which a page leaves."""

    def static(request: Request) -> Response:
        name = request.path_params.get("name", "index.html")
        if name in STATIC:
            folder = importlib.resources.files("pydpend.page") / "static"
        elif name in PLOTS:
            folder = importlib.resources.files("pydpend.report") / "assets"
        else:
            return JSONResponse({"error": "there is no such file"}, status_code=404)
        body = (folder / name).read_bytes()
        return Response(body, media_type=TYPES[name.rsplit(".", 1)[-1]])

    async def enter(request: Request) -> Response:
        answer = guard.opened((await _body(request)).get("token"))
        return answer or JSONResponse({"error": "the token is wrong: open the address once more"}, 403)

    def state(request: Request) -> Any:
        return session.state()

    def frame(request: Request) -> Response:
        low, high, width = (_number(request, name) for name in ("low", "high", "width"))
        index = int(request.path_params["index"])
        body = session.jpeg(index, low, high, None if width is None else max(16, int(width)))
        return Response(body, media_type="image/jpeg", headers={"cache-control": "private, max-age=600"})

    def rows(request: Request) -> Any:
        first, last = (_number(request, name) or 0 for name in ("first", "last"))
        return session.rows(int(first), int(last))

    def detections(request: Request) -> Any:
        index, node = int(request.path_params["index"]), request.query_params.get("node")
        return session.detections(index, _number(request, "threshold"), node)

    def curve(request: Request) -> Any:
        return session.curve(request.query_params.get("node", ""))

    def changing(change: Callable[[dict[str, Any]], Any]) -> Answer:
        async def answer(request: Request) -> Response:
            said = await _body(request)

            def done() -> Response:
                change(said)
                return JSONResponse(session.state())

            return await _told(done)

        return answer

    def reading(read: Callable[[Request], Any]) -> Answer:
        async def answer(request: Request) -> Response:
            alive(True)

            def done() -> Response:
                found = read(request)
                return found if isinstance(found, Response) else JSONResponse(found)

            return await _told(done)

        return answer

    async def leave(request: Request) -> Response:
        alive(False)
        return JSONResponse({"ok": True})

    routes = [
        Route("/", static),
        Route("/static/{name}", static),
        Route("/api/session", enter, methods=["POST"]),
        Route("/api/state", reading(state)),
        Route("/api/frame/{index:int}", reading(frame)),
        Route("/api/rows", reading(rows)),
        Route("/api/detections/{index:int}", reading(detections)),
        Route("/api/curve", reading(curve)),
        Route("/api/choose", changing(session.choose), methods=["POST"]),
        Route("/api/arrange", changing(session.arrange), methods=["POST"]),
        Route("/api/decide", changing(session.decide), methods=["POST"]),
        Route("/api/undo", changing(lambda said: session.undo()), methods=["POST"]),
        Route("/api/leave", leave, methods=["POST"]),
    ]
    guard = Guard(Starlette(routes=routes), port, framed)
    return guard


async def _body(request: Request) -> dict[str, Any]:
    try:
        said = await request.json()
    except ValueError:
        return {}
    return said if isinstance(said, dict) else {}


async def _told(done: Callable[[], Response]) -> Response:
    """The answer, or what was wrong in the page's words."""

    def answer() -> Response:
        with speaking(PageWords()):
            try:
                return done()
            except ChangedElsewhere as problem:
                return JSONResponse({"error": str(problem)}, status_code=409)
            except PydpendError as problem:
                return JSONResponse({"error": str(problem)}, status_code=400)
            except OSError as problem:
                said = f"{problem.filename or 'the disk'}: {problem.strerror or problem}"
                return JSONResponse({"error": said}, status_code=507)

    return await run_in_threadpool(answer)


def _number(request: Request, name: str) -> float | None:
    text = request.query_params.get(name, "")
    try:
        value = float(text)
    except ValueError:
        return None
    return value if abs(value) < 1e12 else None
