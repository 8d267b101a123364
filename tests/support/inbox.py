"""What the tests of links share: frames to send, and an inbox for received ones."""

import asyncio
from collections.abc import Callable

from companion.links import Link
from companion.mavlink.dialect import Encoder, mavlink
from companion.mavlink.framing import Frame

ENCODER = Encoder()


def frame(number: int = 0) -> bytes:
    return ENCODER.encode(mavlink.MAVLink_mission_current_message(number), 1, 1)


class Inbox:
    """Stores what a link hands over, and lets a test wait for it."""

    def __init__(self) -> None:
        self.batches: list[list[bytes]] = []
        self._arrived = asyncio.Event()

    def __call__(self, frames: list[Frame], _link: Link) -> None:
        self.batches.append([one.raw for one in frames])
        self._arrived.set()

    @property
    def raws(self) -> list[bytes]:
        return [raw for batch in self.batches for raw in batch]

    async def until(self, count: int) -> None:
        async with asyncio.timeout(5.0):
            while len(self.raws) < count:
                self._arrived.clear()
                await self._arrived.wait()


async def until(condition: Callable[[], bool]) -> None:
    """Wait for a condition that sets no event; the timeout only ends a test that has failed."""
    async with asyncio.timeout(10.0):
        while not condition():  # noqa: ASYNC110 - see above
            await asyncio.sleep(0.005)
