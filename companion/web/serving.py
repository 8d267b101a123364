"""The web server, with bounds on connections, message sizes and silence."""

import asyncio
import contextlib
import errno
import socket
from collections.abc import Iterator
from typing import cast

import uvicorn
from starlette.types import ASGIApp
from uvicorn.protocols.http.h11_impl import H11Protocol, RequestResponseCycle

from companion.errors import PORT_IN_USE, CompanionError
from companion.web.settings import Settings

MOST_CONNECTIONS = 128
_REQUEST_TIMEOUT_S = 10.0  # from connection or last answer to the next complete request
_MOST_HEADER_BYTES = 16_384
_MOST_MESSAGE_BYTES = 4_096
_PING_S = 10.0
_BACKLOG = 64


class _BoundedProtocol(H11Protocol):
    """Uvicorn's protocol that closes a connection too many at once, and a silent one after a timeout."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        self._timeout = self.loop.call_later(_REQUEST_TIMEOUT_S, self._close_if_idle)
        if len(self.connections) > MOST_CONNECTIONS:
            transport.abort()

    def on_response_complete(self) -> None:
        super().on_response_complete()
        self._timeout.cancel()
        self._timeout = self.loop.call_later(_REQUEST_TIMEOUT_S, self._close_if_idle)

    def connection_lost(self, exc: Exception | None) -> None:
        self._timeout.cancel()
        super().connection_lost(exc)

    def _close_if_idle(self) -> None:
        """Close the connection unless an answer is being sent or it has become a WebSocket."""
        cycle, transport = cast("RequestResponseCycle | None", self.cycle), self.transport
        answered = cycle is None or cycle.response_complete
        if answered and not transport.is_closing() and transport.get_protocol() is self:
            transport.abort()


def listen(settings: Settings) -> socket.socket:
    """The listening socket; `CompanionError` when the address cannot be used."""
    family = socket.AF_INET6 if ":" in settings.host else socket.AF_INET
    listening = socket.socket(family, socket.SOCK_STREAM)
    try:
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind((settings.host, settings.port))
        listening.listen(_BACKLOG)
    except OSError as error:
        listening.close()
        where = f"{settings.host}:{settings.port}"
        why = PORT_IN_USE if error.errno == errno.EADDRINUSE else error.strerror or str(error)
        raise CompanionError(f"cannot listen on {where}: {why}") from error
    return listening


async def serve(app: ASGIApp, listening: socket.socket) -> None:
    """Serve until cancelled."""
    config = uvicorn.Config(
        app,
        http=_BoundedProtocol,
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
    serving = asyncio.create_task(server.serve(sockets=[listening]), name="server")
    try:
        await asyncio.shield(serving)
    except asyncio.CancelledError:
        server.should_exit = True
        await serving
        raise
    finally:
        listening.close()


class _Server(uvicorn.Server):
    """A server without signal handlers: the caller handles signals."""

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Capture none."""
        yield
