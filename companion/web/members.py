"""One page for several aircraft: each has the application of a display, chosen by `?member=NAME`.

| address | what |
|---|---|
| `GET /api/members` | `name`, `fresh`, `system_id`, `autopilot`, `mode`, `state`, `layer`, `flying` of each |
| every other | as of one aircraft, see `app`; without `?member=NAME` the first one's |

`GET /api/info` also has `members`, their names. The page is read-only.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any
from urllib.parse import parse_qs

from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route
from starlette.types import ASGIApp, Receive, Scope, Send

from companion.web.app import build
from companion.web.settings import Settings
from companion.web.source import LiveSource


class Members:
    """The application for several sources, by the name of their aircraft."""

    def __init__(self, sources: Mapping[str, LiveSource], settings: Settings) -> None:
        self._sources = dict(sources)
        settings = replace(settings, token=None)
        self._apps = {name: self._app(source, settings) for name, source in sources.items()}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request to the application of the aircraft that it names."""
        wanted = parse_qs(scope.get("query_string", b"").decode("latin-1")).get("member", [""])[0]
        app = self._apps.get(wanted) or next(iter(self._apps.values()))
        await app(scope, receive, send)

    def _app(self, source: LiveSource, settings: Settings) -> ASGIApp:
        return build(source, settings, beside=[Route("/api/members", self._members)])

    async def _members(self, _: Request) -> Response:
        return JSONResponse([_summary(name, source) for name, source in self._sources.items()])


def _summary(name: str, source: LiveSource) -> dict[str, Any]:
    live = source.snapshot
    known: dict[str, Any] = (
        {}
        if live is None
        else {
            "system_id": live.system_id,
            "autopilot": live.autopilot,
            "mode": live.snapshot.mode,
            "state": live.snapshot.state,
            "layer": str(live.snapshot.decision.layer),
            "flying": live.flying,
        }
    )
    return {"name": name, "fresh": source.is_fresh, **known}
