"""Keeps a link open for as long as the service lives, whatever happens to cables, hosts and peers."""

import asyncio
import logging
import time
from collections.abc import Callable, Sequence

from companion.errors import LinkDownError, LinkError
from companion.links.backoff import STEADY_S, Backoff, LinkState
from companion.links.link import Link, OnFrames

_log = logging.getLogger("companion")

# What opens at all opens at once; waiting longer for a name or a peer would keep the others from flying.
_PATIENCE_AT_START_S = 0.25


class Reconnect:
    """Runs one link and opens it again, with growing waits, whenever it fails. Others do not notice."""

    def __init__(self, link: Link, clock_s: Callable[[], float] = time.monotonic) -> None:
        self.link = link
        self._clock_s = clock_s
        self._backoff = Backoff()

    @property
    def state(self) -> LinkState:
        """How it is with the link."""
        return self._backoff.state

    async def run(self, on_frames: OnFrames) -> None:
        """Until the link is closed, or `on_frames` raises."""
        while True:
            self._backoff.opening()
            try:
                await self._run_once(on_frames)
            except LinkError as error:
                level = self._backoff.failed(self._clock_s())
                _log.log(level, "%s; trying again until it works", error)
            else:
                return
            await asyncio.sleep(self._backoff.wait_s(self._clock_s()))

    async def _run_once(self, on_frames: OnFrames) -> None:
        await self.link.open()
        self._backoff.opened(self._clock_s())
        later = asyncio.get_running_loop().call_later(STEADY_S, self._steady)
        try:
            await self.link.run(on_frames)
        finally:
            later.cancel()

    def _steady(self) -> None:
        if self._backoff.steady(self._clock_s()):
            _log.info("%s: works again", self.link.address)


async def open_at_start(links: Sequence[Link]) -> None:
    """Open all that can be opened at once; the others go on opening, and are left to `Reconnect`.

    `LinkError` for one that can never be opened, a port to listen on that is in use or forbidden; then all
    are closed.
    """
    tasks = [asyncio.create_task(_why_never(link), name=f"opening {link.address}") for link in links]
    _opening.update(tasks)
    for task in tasks:
        task.add_done_callback(_opening.discard)
    if tasks:
        await asyncio.wait(tasks, timeout=_PATIENCE_AT_START_S)
    for task in tasks:
        error = task.result() if task.done() else None
        if error is not None:
            for link in links:
                link.close()
            raise error


_opening: set[asyncio.Task[LinkError | None]] = set()  # the event loop forgets tasks that nobody else knows


async def _why_never(link: Link) -> LinkError | None:
    try:
        await link.open()
    except LinkDownError:
        return None
    except LinkError as error:
        return error
    return None
