"""The display's own process: serves the snapshots that arrive on standard input, and ends when it closes."""

import asyncio
import contextlib
import json
import os
import sys
from collections.abc import Mapping
from typing import Any

from starlette.types import ASGIApp

from companion.errors import CompanionError
from companion.web.app import build
from companion.web.display import unpack
from companion.web.live_snapshot import LiveSnapshot
from companion.web.members import Members
from companion.web.serving import listen, serve
from companion.web.settings import Settings
from companion.web.source import LiveSource

_PIPE_BYTES = 1 << 20


def report(**message: Any) -> None:
    """Write a line to the flying process. If that has ended, so do we, by the end of standard input."""
    with contextlib.suppress(OSError):
        sys.stdout.write(json.dumps(message) + "\n")
        sys.stdout.flush()


async def main() -> None:
    """Serve until standard input closes."""
    loop = asyncio.get_running_loop()
    reader = asyncio.StreamReader(limit=_PIPE_BYTES)
    await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(reader), sys.stdin)
    settings = await unpack(reader)
    assert isinstance(settings, Settings)
    sources = {name: LiveSource() for name in settings.members or ("",)}
    listening = listen(settings)
    app = Members(sources, settings) if settings.members else _alone(sources[""], settings)
    serving = asyncio.create_task(serve(app, listening), name="serving")
    report(serving=settings.url)
    receiving = asyncio.create_task(_receive(reader, sources), name="snapshots")
    done, _ = await asyncio.wait({serving, receiving}, return_when=asyncio.FIRST_COMPLETED)
    for task in done:
        task.result()


def _alone(source: LiveSource, settings: Settings) -> ASGIApp:
    return build(source, settings, lambda role: report(role=role))


async def _receive(reader: asyncio.StreamReader, sources: Mapping[str, LiveSource]) -> None:
    """Show what arrives: the snapshots of one aircraft, or of several with their names."""
    with contextlib.suppress(EOFError):
        while True:
            item = await unpack(reader)
            name, snapshot = item if isinstance(item, tuple) else ("", item)
            if isinstance(snapshot, LiveSnapshot):
                sources[name].show(snapshot)


async def _main_then_exit() -> None:
    """Exit at once at the end, without waiting for open connections."""
    code = 1
    try:
        await main()
        code = 0
    except (CompanionError, EOFError) as error:
        report(problem=str(error) or "no settings received")
    except Exception as error:  # noqa: BLE001 - reported to the flying process, which restarts us
        report(problem=f"internal error: {error!r}")
    os._exit(code)


if __name__ == "__main__":
    asyncio.run(_main_then_exit())
