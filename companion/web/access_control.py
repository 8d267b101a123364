"""Access control: checks the host name, the origin and the token of requests.

A page of another server can make a browser send us any request. It cannot read the answers, but it could
give commands; with a host name of its own that points at us (DNS rebinding) it could read as well. Therefore
the host name must be one of ours, and commands and WebSockets must come from our own page.
"""

import hmac
import socket
from ipaddress import ip_address
from urllib.parse import urlsplit

from starlette.datastructures import Headers
from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocketClose

from companion.web.settings import Settings

_SAFE_METHODS = frozenset({"GET", "HEAD"})
_LONGEST_QUERY = 1024
_SECURITY_HEADERS = (
    (b"content-security-policy", b"default-src 'self'; frame-ancestors 'none'; base-uri 'none'"),
    (b"x-content-type-options", b"nosniff"),
    (b"x-frame-options", b"DENY"),
    (b"referrer-policy", b"no-referrer"),
    (b"cross-origin-resource-policy", b"same-origin"),
    (b"cache-control", b"no-cache"),
)


class AccessControl:
    """ASGI middleware: refuses requests of other sites, and adds security headers to every answer."""

    def __init__(self, app: ASGIApp, settings: Settings) -> None:
        self._app = app
        self._origins = frozenset(settings.origins)
        names = {"localhost", *(urlsplit(origin).hostname or "" for origin in settings.origins)}
        if not settings.is_local:
            name = socket.gethostname().lower()
            names |= {name, f"{name}.local", settings.host.lower()}
        self._names = frozenset(names)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Refuse a request, or pass it on."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        refused, status = self._refusal(scope, Headers(scope=scope)), 403
        if len(scope.get("query_string", b"")) > _LONGEST_QUERY:
            refused, status = "the query is too long", 414
        if refused is not None and scope["type"] == "websocket":
            await WebSocketClose(code=1008, reason=refused)(scope, receive, send)
        elif refused is not None:
            await JSONResponse({"error": refused}, status_code=status)(scope, receive, _with_headers(send))
        else:
            await self._app(scope, receive, _with_headers(send) if scope["type"] == "http" else send)

    def _refusal(self, scope: Scope, headers: Headers) -> str | None:
        host, origin = headers.get("host", ""), headers.get("origin")
        if not self._is_our_name(host):
            return "unknown host name: name it in web.origins"
        is_command = scope["type"] == "websocket" or scope["method"] not in _SAFE_METHODS
        if is_command and origin is not None and not self._is_our_page(origin, host):
            return "refused: the page comes from another server"
        return None

    def _is_our_name(self, host: str) -> bool:
        try:
            name = (urlsplit(f"//{host}").hostname or "") if _is_plain(host) else ""
        except ValueError:
            return False
        try:
            ip_address(name)
        except ValueError:
            return name in self._names
        return True

    def _is_our_page(self, origin: str, host: str) -> bool:
        return origin in self._origins or origin in (f"http://{host}", f"https://{host}")


def has_token(authorization: str | None, settings: Settings) -> bool:
    """True when the header `Authorization: Bearer TOKEN` has the token; compared in constant time."""
    if settings.token is None or authorization is None:
        return False
    kind, _, token = authorization.partition(" ")
    return kind.lower() == "bearer" and hmac.compare_digest(token.strip().encode(), settings.token.encode())


def _is_plain(host: str) -> bool:
    return host.isascii() and host.isprintable() and not set(host) & set("/?#@\\ ")


def _with_headers(send: Send) -> Send:
    async def send_with_headers(message: Message) -> None:
        if message["type"] == "http.response.start":
            message = {**message, "headers": [*message.get("headers", ()), *_SECURITY_HEADERS]}
        await send(message)

    return send_with_headers
