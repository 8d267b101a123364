"""The display's application on a loopback port, with helpers for requests and snapshots."""

import asyncio
import contextlib
import http.client
import json
from collections.abc import AsyncIterator, Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

from starlette.types import ASGIApp

from companion.engine import Engine
from companion.web.app import build
from companion.web.health import Health, LoopTimes
from companion.web.live_snapshot import LiveSnapshot, live_snapshot_of
from companion.web.members import Members
from companion.web.serving import listen, serve
from companion.web.settings import Settings
from companion.web.source import LiveSource, Source
from sim.closed_loop import ClosedLoop
from sim.scenario import load_scenario

TOKEN = "a-token-of-tests"


@dataclass
class Answer:
    """An answer over HTTP."""

    status: int
    headers: dict[str, str]
    body: bytes

    @property
    def json(self) -> Any:
        return json.loads(self.body)


@dataclass
class Site:
    """A running server, and the roles that were asked for."""

    port: int
    roles: list[str]

    async def ask(
        self, path: str, *, method: str = "GET", headers: Mapping[str, str] | None = None, body: bytes = b""
    ) -> Answer:
        """Send one request, by an independent implementation of HTTP."""
        return await asyncio.to_thread(self._ask, path, method, dict(headers or {}), body)

    def _ask(self, path: str, method: str, headers: dict[str, str], body: bytes) -> Answer:
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=10.0)
        with contextlib.closing(connection):
            connection.request(method, path, body=body or None, headers=headers)
            answer = connection.getresponse()
            return Answer(answer.status, {k.lower(): v for k, v in answer.getheaders()}, answer.read())

    @property
    def stream(self) -> str:
        """The address of the WebSocket."""
        return f"ws://127.0.0.1:{self.port}/ws"


@contextlib.asynccontextmanager
async def site(
    source: Source | Mapping[str, LiveSource], settings: Settings | None = None, port: int = 0
) -> AsyncIterator[Site]:
    """Serve a source, or those of several members, until the block ends."""
    settings = replace(settings or Settings(), port=port)
    roles: list[str] = []
    app: ASGIApp
    if isinstance(source, Source):
        listening, app = listen(settings), build(source, settings, roles.append)
    else:
        settings = replace(settings, members=tuple(source))
        listening, app = listen(settings), Members(source, settings)
    running = asyncio.create_task(serve(app, listening))
    try:
        yield Site(listening.getsockname()[1], roles)
    finally:
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)


def health(**changes: Any) -> Health:
    """The health of a service without trouble."""
    return replace(Health.of(12.0, LoopTimes(), ()), **changes)


def snapshot_after(seconds: float, scenario: str = "head-on", **changes: Any) -> LiveSnapshot:
    """The snapshot some seconds after the start of a scenario."""
    engine = Engine()
    loop = ClosedLoop(load_scenario(scenario), engine)
    loop.run(seconds)
    now_s = loop.start_us / 1e6 + seconds
    return replace(live_snapshot_of(engine, now_s, health()), **changes)


@cache
def usual() -> LiveSnapshot:
    """The snapshot in the middle of an avoidance; it is flown when it is first read, not by an import."""
    return snapshot_after(66.0)


def live(snapshot: LiveSnapshot | None = None) -> LiveSource:
    """A live source with at most one snapshot."""
    source = LiveSource()
    if snapshot is not None:
        source.show(snapshot)
    return source
