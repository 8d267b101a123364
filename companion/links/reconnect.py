"""Opens links, and opens them again whenever a cable, host or peer fails."""

import asyncio
import logging
import time
from collections.abc import Callable, Sequence

from companion.errors import LinkDownError, LinkError
from companion.links.backoff import STEADY_S, Backoff, LinkState
from companion.links.link import Link, OnFrames

_log = logging.getLogger("companion")

# A link that works opens at once; a longer wait for a name or a peer would delay the start of the others.
_LONGEST_WAIT_AT_START_S = 0.25


class Reconnect:
    """Runs one link, and opens it again after growing waits whenever it fails; other links continue."""

    def __init__(self, link: Link, clock_s: Callable[[], float] = time.monotonic) -> None:
        self.link = link
        self.problem: str | None = None  # why the link is down, without its address
        self._clock_s = clock_s
        self._backoff = Backoff()

    @property
    def state(self) -> LinkState:
        """The present state of the link."""
        return self._backoff.state

    async def run(self, on_frames: OnFrames) -> None:
        """Pass received frames to `on_frames` until the link is closed or `on_frames` raises."""
        while True:
            self._backoff.opening()
            try:
                await self._run_once(on_frames)
            except LinkError as error:
                level = self._backoff.failed(self._clock_s())
                self.problem = str(error).removeprefix(f"{self.link.address}: ")
                _log.log(level, "%s; trying again until it works", error)
            else:
                return
            await asyncio.sleep(self._backoff.wait_s(self._clock_s()))

    async def _run_once(self, on_frames: OnFrames) -> None:
        await self.link.open()
        self._backoff.opened(self._clock_s())
        self.problem = None
        timer = asyncio.get_running_loop().call_later(STEADY_S, self._log_recovery)
        try:
            await self.link.run(on_frames)
        finally:
            timer.cancel()

    def _log_recovery(self) -> None:
        if self._backoff.steady(self._clock_s()):
            _log.info("%s: works again", self.link.address)


async def open_all(links: Sequence[Link]) -> None:
    """Open the links that can be opened at once; the others are left to `Reconnect`.

    `LinkError` if one can never be opened, such as a port to listen on that is in use or forbidden; then all
    links are closed.
    """
    tasks = [asyncio.create_task(_permanent_error(link), name=f"opening {link.address}") for link in links]
    _opening.update(tasks)
    for task in tasks:
        task.add_done_callback(_opening.discard)
    if tasks:
        await asyncio.wait(tasks, timeout=_LONGEST_WAIT_AT_START_S)
    for task in tasks:
        error = task.result() if task.done() else None
        if error is not None:
            for link in links:
                link.close()
            raise error


# The event loop keeps only weak references to tasks.
_opening: set[asyncio.Task[LinkError | None]] = set()


async def _permanent_error(link: Link) -> LinkError | None:
    try:
        await link.open()
    except LinkDownError:
        return None
    except LinkError as error:
        return error
    return None
