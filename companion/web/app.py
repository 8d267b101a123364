"""The web application: page, state, health and metrics, and the one command: a change of role.

| address | what |
|---|---|
| `GET /` | the page |
| `GET /api/state` | the newest state, see `state.md`; 503 while there is none |
| `WS /ws` | all states, ten a second; a slow viewer misses some |
| `GET /api/info` | `kind` (live, replay), `title`, `duration_s`, `height_unit`, `may_command` |
| `GET /api/timeline` | of a replay: each change of layer or manoeuvre, with time and words |
| `POST /api/role` | `{"role": "off"|"advise"|"fly"}` with `Authorization: Bearer TOKEN` |
| `GET /healthz` | 200 while the flying loop sends snapshots and the autopilot answers, else 503 |
| `GET /metrics` | metrics for Prometheus |
"""

import asyncio
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket, WebSocketDisconnect

from companion.load import OVERLOADED
from companion.model import Role
from companion.ownship.autopilot_queries import UNANSWERED
from companion.web.access_control import AccessControl, has_token
from companion.web.metrics import Metrics
from companion.web.settings import Settings
from companion.web.source import LiveSource, Source, View

STATIC = Path(__file__).parent / "static"
MOST_VIEWERS = 64
_MOST_BODY_BYTES = 1024
_ROLE_PATIENCE_S = 2.0  # for a requested role to take effect
_LONGEST_MESSAGE = 256
_TOO_MANY = 1013


def build(
    source: Source,
    settings: Settings,
    ask_role: Callable[[str], None] = lambda _: None,
    *,
    beside: Sequence[Route] = (),
) -> Starlette:
    """The application for a source of states, with the routes `beside`; calls `ask_role` with each role."""
    return _Handlers(source, settings, ask_role).app(beside)


class _Handlers:
    def __init__(self, source: Source, settings: Settings, ask_role: Callable[[str], None]) -> None:
        self._source = source
        self._settings = settings
        self._ask_role = ask_role
        self._viewers = 0
        self._metrics = Metrics(source, lambda: self._viewers) if isinstance(source, LiveSource) else None

    def app(self, beside: Sequence[Route]) -> Starlette:
        return Starlette(
            routes=[
                *beside,
                Route("/", self._index),
                Route("/api/state", self._state),
                Route("/api/info", self._info),
                Route("/api/timeline", self._timeline),
                Route("/api/role", self._role, methods=["POST"]),
                Route("/healthz", self._health),
                Route("/metrics", self._prometheus),
                WebSocketRoute("/ws", self._stream),
                Mount("/static", StaticFiles(directory=STATIC)),
            ],
            middleware=[Middleware(AccessControl, settings=self._settings)],
            exception_handlers={404: _not_found, 405: _method_not_allowed},
        )

    async def _index(self, _: Request) -> Response:
        return FileResponse(STATIC / "index.html")

    async def _state(self, _: Request) -> Response:
        text = self._source.newest()
        if text is None:
            return _error(503, "no state yet")
        return Response(text, media_type="application/json")

    async def _info(self, _: Request) -> Response:
        several = {"members": self._settings.members} if self._settings.members else {}
        return JSONResponse(
            {
                "kind": self._source.kind,
                "title": self._settings.title,
                "duration_s": self._source.duration_s,
                "height_unit": "ft" if self._settings.feet else "m",
                "may_command": self._settings.token is not None and self._metrics is not None,
                **several,
            }
        )

    async def _timeline(self, _: Request) -> Response:
        return JSONResponse({"layers": self._source.layers()})

    async def _health(self, _: Request) -> Response:
        if not isinstance(self._source, LiveSource):
            return JSONResponse({"status": "ok", "kind": self._source.kind})
        if not self._source.is_fresh:
            return JSONResponse({"status": "the flying loop is silent"}, status_code=503)
        snapshot = self._source.snapshot
        known = snapshot is not None and snapshot.autopilot is not None
        holding = () if snapshot is None else snapshot.conditions
        unanswered = next((one.text for one in holding if one.key == UNANSWERED), None)
        overloaded = next((one.text for one in holding if one.key == OVERLOADED), None)
        return JSONResponse(
            {
                "status": unanswered or overloaded or "ok",
                "kind": "live",
                "autopilot_known": known,
                "conditions": [one.text for one in holding],
            },
            status_code=200 if unanswered is None else 503,
        )

    async def _prometheus(self, _: Request) -> Response:
        if self._metrics is None:
            return _error(404, "a replay has no metrics")
        return Response(self._metrics.text(), media_type="text/plain; version=1.0.0; charset=utf-8")

    async def _role(self, request: Request) -> Response:
        if not isinstance(self._source, LiveSource) or self._settings.token is None:
            return _error(403, "this display is read-only: no token is configured")
        if not has_token(request.headers.get("authorization"), self._settings):
            return _error(401, "the token is missing or wrong", {"WWW-Authenticate": "Bearer"})
        body = await _small_json(request)
        role = None if body is None else body.get("role")
        if not isinstance(role, str) or role.upper() not in Role.__members__:
            return _error(400, f"role must be one of {', '.join(r.name.lower() for r in Role)}")
        role = role.lower()
        if not self._source.is_fresh:
            return _error(503, "the flying loop is silent")
        self._ask_role(role)
        if await self._takes_effect(self._source, role):
            return JSONResponse({"role": role})
        return _error(409, f"the role did not change to {role}")

    @staticmethod
    async def _takes_effect(source: LiveSource, role: str) -> bool:
        """True when a snapshot shows the role: not the next one, which may be older than the request."""
        asked_at = source.sequence
        try:
            async with asyncio.timeout(_ROLE_PATIENCE_S):
                while (
                    source.sequence < asked_at + 2 or source.snapshot is None or source.snapshot.role != role
                ):
                    await source.changed.wait()
        except TimeoutError:
            return False
        return True

    async def _stream(self, socket: WebSocket) -> None:
        if self._viewers >= MOST_VIEWERS:
            await socket.close(_TOO_MANY, "too many viewers")
            return
        self._viewers += 1
        try:
            await socket.accept()
            view = self._source.view()
            receiving = asyncio.create_task(_receive(socket, view), name="viewer's messages")
            sending = asyncio.create_task(_send(socket, view), name="viewer's states")
            await asyncio.wait({receiving, sending}, return_when=asyncio.FIRST_COMPLETED)
            for task in (receiving, sending):
                task.cancel()
            await asyncio.gather(receiving, sending, return_exceptions=True)
        finally:
            self._viewers -= 1


async def _send(socket: WebSocket, view: View) -> None:
    async for text in view.states():
        await socket.send_text(text)


async def _receive(socket: WebSocket, view: View) -> None:
    """Handle messages until the viewer is gone. Malformed ones are ignored; a long one ends the stream."""
    while True:
        try:
            text = await socket.receive_text()
        except (WebSocketDisconnect, KeyError):  # KeyError: a frame of bytes
            return
        if len(text) > _LONGEST_MESSAGE:
            await socket.close(1009)
            return
        try:
            message = json.loads(text)
        except (ValueError, RecursionError):
            continue
        if isinstance(message, dict):
            view.control(message)


async def _small_json(request: Request) -> Mapping[str, Any] | None:
    body = b""
    async for piece in request.stream():
        body += piece
        if len(body) > _MOST_BODY_BYTES:
            return None
    try:
        content = json.loads(body)
    except (ValueError, RecursionError):
        return None
    return content if isinstance(content, dict) else None


def _error(status: int, text: str, headers: Mapping[str, str] | None = None) -> Response:
    return JSONResponse({"error": text}, status_code=status, headers=headers)


async def _not_found(_: Request, __: Exception) -> Response:
    return _error(404, "not found")


async def _method_not_allowed(_: Request, error: Exception) -> Response:
    allowed = error.headers if isinstance(error, HTTPException) else None
    return _error(405, "method not allowed", allowed)
