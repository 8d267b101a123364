"""The display's own process: moments come in by the standard input, and it ends with it."""

import asyncio
import contextlib
import json
import os
import sys
from typing import Any

from companion.errors import CompanionError
from companion.web.app import build
from companion.web.live_snapshot import LiveSnapshot
from companion.web.pipe import unpacked
from companion.web.serving import listen, serve
from companion.web.settings import Settings
from companion.web.source import Live

_PIPE_BYTES = 1 << 20


def say(**what: Any) -> None:
    """A line to the flying process; if that is gone, we end anyway."""
    with contextlib.suppress(OSError):
        sys.stdout.write(json.dumps(what) + "\n")
        sys.stdout.flush()


async def main() -> None:
    """Serve what comes in."""
    loop = asyncio.get_running_loop()
    reader = asyncio.StreamReader(limit=_PIPE_BYTES)
    await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(reader), sys.stdin)
    settings = await unpacked(reader)
    assert isinstance(settings, Settings)
    source = Live()
    opened = listen(settings)
    app = build(source, settings, lambda role: say(role=role))
    serving = asyncio.create_task(serve(app, opened), name="serving")
    say(serving=settings.url)
    taking_in = asyncio.create_task(_take_in(reader, source), name="moments")
    done, _ = await asyncio.wait({serving, taking_in}, return_when=asyncio.FIRST_COMPLETED)
    for task in done:
        task.result()


async def _take_in(reader: asyncio.StreamReader, source: Live) -> None:
    """Show what comes, until nothing comes any more."""
    with contextlib.suppress(EOFError):
        while True:
            moment = await unpacked(reader)
            if isinstance(moment, LiveSnapshot):
                source.show(moment)


async def _main_and_away() -> None:
    """What a viewer left hanging is not waited for."""
    code = 1
    try:
        await main()
        code = 0
    except (CompanionError, EOFError) as error:
        say(problem=str(error) or "it was told nothing")
    except Exception as error:  # noqa: BLE001 - there is nobody else to tell
        say(problem=f"internal error: {error!r}")
    os._exit(code)


if __name__ == "__main__":
    asyncio.run(_main_and_away())
