"""How PX4 passes ADSB_VEHICLE on: once each, to every channel, the one it came from included."""

from collections import deque
from collections.abc import Iterable

from companion.mavlink.dialect import Message
from sim.vehicle.adsb import copy_of

_QUEUED = 16


class EchoedTraffic:
    """Reports on their way to each channel; when more come than leave, the oldest are lost."""

    def __init__(self) -> None:
        self._queues: dict[int, deque[Message]] = {}

    def receive(self, report: Message, channels: Iterable[int]) -> None:
        """Take a report for all channels."""
        for channel in channels:
            self._queues.setdefault(channel, deque(maxlen=_QUEUED)).append(copy_of(report))

    def take(self, channel: int) -> list[Message]:
        """What is to be sent on a channel now."""
        queue = self._queues.get(channel, deque())
        reports = list(queue)
        queue.clear()
        return reports

    def clear(self) -> None:
        """Forget all, as after a reboot."""
        self._queues.clear()
