"""The network between members over real sockets: frames of each vehicle and companion reach the others."""

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

from companion.links import Link, open_all
from companion.mavlink.dialect import Message
from companion.mavlink.framing import Frame, decode
from sim.clock import ScaledClock
from sim.members.network import Network, is_broadcast, is_of_vehicle

_PERIOD_S = 0.02


@dataclass(frozen=True, slots=True)
class Ends:
    """The links of the network to one member: from its vehicle, and from and to its companion."""

    vehicle: Link
    companion: Link


class Hub:
    """Passes on what members send to each other, with the losses and the delay of the network.

    A vehicle's heartbeat and position go out, and all that its companion broadcasts. What has a target is for
    that member's own autopilot.
    """

    def __init__(self, network: Network, ends: Sequence[Ends], clock: ScaledClock) -> None:
        self._network = network
        self._ends = list(ends)
        self._clock = clock

    async def run(self) -> None:
        """Run until cancelled; `LinkError` if a link cannot be opened."""
        links = [link for ends in self._ends for link in (ends.vehicle, ends.companion)]
        try:
            await open_all(links)
            async with asyncio.TaskGroup() as tasks:
                for place, ends in enumerate(self._ends):
                    tasks.create_task(ends.vehicle.run(partial(self._from_vehicle, place)))
                    tasks.create_task(ends.companion.run(partial(self._from_companion, place)))
                tasks.create_task(self._deliver(), name="network")
        finally:
            for link in links:
                link.close()

    def _from_vehicle(self, place: int, frames: list[Frame], _link: Link) -> None:
        for frame in frames:
            if is_of_vehicle(frame.message_id):
                self._send(place, frame, decode(frame))

    def _from_companion(self, place: int, frames: list[Frame], _link: Link) -> None:
        for frame in frames:
            message = decode(frame)
            if is_broadcast(message):
                self._send(place, frame, message)

    def _send(self, place: int, frame: Frame, message: Message | None) -> None:
        if message is not None:
            address = (frame.system_id, frame.component_id)
            self._network.send(place, message, address, self._clock.now_s())

    async def _deliver(self) -> None:
        while True:
            now_s = self._clock.now_s()
            for place, ends in enumerate(self._ends):
                for raw in self._network.arrived(place, now_s):
                    ends.companion.send(raw)
            await asyncio.sleep(_PERIOD_S / self._clock.speedup)
