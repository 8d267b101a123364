"""Keeps the clock of many services in one process from running ahead of them."""

import asyncio
from collections.abc import Sequence

from companion.links import Link
from sim.clock import ScaledClock

# The clock runs on by at most this between two moments at which everything sent has arrived. The way from a
# vehicle to its companion, and from there over the network, takes no longer.
_LEAD_S = 0.1
# From a socket through the queue of its link to the task that takes the frames, in rounds of the event loop.
_ROUNDS = 3


class Pace:
    """Holds the clock until all that was sent has arrived.

    A round of the event loop takes one datagram from each socket. If the rounds of many services take long,
    their vehicles send more in each than is taken in, and everything would fly on old data.
    """

    def __init__(self, clock: ScaledClock, links: Sequence[Link]) -> None:
        """`links` are those of all services."""
        self._clock = clock
        self._links = links
        clock.hold_at(clock.now_s() + _LEAD_S, self)

    async def run(self) -> None:
        """Run until cancelled."""
        while True:
            await self._arrival()
            self._clock.hold_at(self._clock.now_s() + _LEAD_S, self)
            await asyncio.sleep(_LEAD_S / 2.0 / self._clock.speedup)

    async def _arrival(self) -> None:
        """Wait until no link has anything left to take in."""
        before = -1
        while (received := sum(link.counters.received_bytes for link in self._links)) != before:
            before = received
            for _ in range(_ROUNDS):
                await asyncio.sleep(0)
