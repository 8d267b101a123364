"""Serving the application within bounds: so many connections, so much per message, so long in silence."""

import asyncio
import contextlib
import socket
from collections.abc import Iterator
from typing import cast

import uvicorn
from starlette.applications import Starlette
from uvicorn.protocols.http.h11_impl import H11Protocol, RequestResponseCycle

from companion.errors import CompanionError
from companion.web.settings import Settings

MOST_CONNECTIONS = 128
# Who connects and says nothing is shown out.
_NEXT_WORD_S = 10.0
_MOST_HEADER_BYTES = 16_384
_MOST_MESSAGE_BYTES = 4_096
_PING_S = 10.0
_BACKLOG = 64


class _Bounded(H11Protocol):
    """As uvicorn's, but one too many is closed at once, and a silent one before long."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        self._word_awaited = self.loop.call_soon(_nothing)
        if len(self.connections) > MOST_CONNECTIONS:
            transport.abort()
            return
        self._await_word()

    def on_response_complete(self) -> None:
        super().on_response_complete()
        self._await_word()

    def connection_lost(self, exc: Exception | None) -> None:
        self._word_awaited.cancel()
        super().connection_lost(exc)

    def _await_word(self) -> None:
        """The next whole request, or out."""
        self._word_awaited.cancel()
        self._word_awaited = self.loop.call_later(_NEXT_WORD_S, self._show_out)

    def _show_out(self) -> None:
        cycle, transport = cast("RequestResponseCycle | None", self.cycle), self.transport
        answered = cycle is None or cycle.response_complete
        if answered and not transport.is_closing() and transport.get_protocol() is self:
            transport.abort()


def _nothing() -> None:
    """Nobody is waited for yet."""


def listen(settings: Settings) -> socket.socket:
    """The socket to serve on; `CompanionError` in one line when there is none to be had."""
    family = socket.AF_INET6 if ":" in settings.host else socket.AF_INET
    opened = socket.socket(family, socket.SOCK_STREAM)
    try:
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        opened.bind((settings.host, settings.port))
        opened.listen(_BACKLOG)
    except OSError as error:
        opened.close()
        where = f"{settings.host}:{settings.port}"
        raise CompanionError(f"cannot listen on {where}: {error.strerror or error}") from error
    return opened


async def serve(app: Starlette, opened: socket.socket) -> None:
    """Serve until cancelled."""
    config = uvicorn.Config(
        app,
        http=_Bounded,
        ws="websockets-sansio",
        ws_max_size=_MOST_MESSAGE_BYTES,
        ws_ping_interval=_PING_S,
        ws_ping_timeout=_PING_S,
        ws_per_message_deflate=False,
        h11_max_incomplete_event_size=_MOST_HEADER_BYTES,
        timeout_keep_alive=5,
        timeout_graceful_shutdown=1,
        backlog=_BACKLOG,
        lifespan="off",
        access_log=False,
        log_config=None,
        server_header=False,
    )
    server = _Server(config)
    serving = asyncio.create_task(server.serve(sockets=[opened]), name="server")
    try:
        await asyncio.shield(serving)
    except asyncio.CancelledError:
        server.should_exit = True
        await serving
        raise
    finally:
        opened.close()


class _Server(uvicorn.Server):
    """Leaves the signals to whoever runs it."""

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        """None are."""
        yield
