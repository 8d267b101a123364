"""PX4 and ADS-B traffic: reports echoed once to every channel, and its own avoidance (NAV_TRAFF_*)."""

from collections import deque
from collections.abc import Iterable

from companion.mavlink.dialect import Message
from sim.vehicle.outputs import CRITICAL, Text
from sim.vehicle.px4.flight import Px4Flight
from sim.vehicle.px4.modes import Px4Mode
from sim.vehicle.traffic import HeardTraffic, copy_of

_QUEUED = 16
_TRAFFIC_ACTIONS = {2: Px4Mode.RETURN, 3: Px4Mode.LAND, 4: Px4Mode.HOLD}  # NAV_TRAFF_AVOID


class EchoedTraffic:
    """A queue of reports for each channel, the sender's included; a full queue drops its oldest report."""

    def __init__(self) -> None:
        self._queues: dict[int, deque[Message]] = {}

    def receive(self, report: Message, channels: Iterable[int]) -> None:
        """Queue a report for all channels."""
        for channel in channels:
            self._queues.setdefault(channel, deque(maxlen=_QUEUED)).append(copy_of(report))

    def take(self, channel: int) -> list[Message]:
        """The reports to send on a channel now; they leave the queue."""
        queue = self._queues.get(channel, deque())
        reports = list(queue)
        queue.clear()
        return reports

    def clear(self) -> None:
        """Delete everything, as after a reboot."""
        self._queues.clear()


class Px4Avoidance:
    """NAV_TRAFF_AVOID: 1 only warns; higher values change the mode, from OFFBOARD too."""

    def __init__(self, flight: Px4Flight, heard: HeardTraffic) -> None:
        self._flight = flight
        self._heard = heard
        self._was_near = False

    def step(self, now_s: float) -> None:
        """Check the traffic; warn and act once when it comes near."""
        flight, values = self._flight, self._flight.parameters
        wanted = int(values["NAV_TRAFF_AVOID"])
        near = not flight.on_ground and wanted > 0
        near = near and self._heard.is_within(
            flight.place, values["NAV_TRAFF_A_HOR"], values["NAV_TRAFF_A_VER"], now_s
        )
        if near and not self._was_near:
            flight.events.append(Text(CRITICAL, "Traffic alert"))
            if wanted in _TRAFFIC_ACTIONS:
                flight.set_mode(_TRAFFIC_ACTIONS[wanted])
        self._was_near = near
