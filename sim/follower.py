"""Receivers in a process of their own, which follow position and clock of a vehicle in another process."""

import asyncio
import logging
import math
import time
from collections.abc import Callable, Sequence

from companion.geodesy import GeoPoint
from companion.links import Link, Reconnect
from companion.mavlink.dialect import Encoder, Message, mavlink
from companion.mavlink.framing import Frame, decode
from sim.receiver import Carrier
from sim.receiver_output import ReceiverOutput
from sim.receivers.mavlink import ADSB_RECEIVER
from sim.vehicle.vehicle import BOOTED_BEFORE_S
from sim.world import World

_log = logging.getLogger("sim")

_REQUEST_PERIOD_S = 1.0
_POSITION_INTERVAL_US = 100_000
# A boot clock that is so far behind has started again.
_REBOOTED_S = 1.0
_GROUND_SPEED_MPS, _GROUND_HEIGHT_MM = 5.0, 1_000


class Follower:
    """Flies the intruders of a scenario around a fake vehicle that flies the same scenario.

    The boot clock in its GLOBAL_POSITION_INT says how long it has flown, also if it flies faster than real
    time. When that clock starts again, so does the scenario.
    """

    def __init__(
        self,
        vehicle: Link,
        outputs: Sequence[ReceiverOutput],
        build: Callable[[float], World],
        clock_s: Callable[[], float] = time.time,
    ) -> None:
        """`build` makes the world of the scenario from the time of its start."""
        self._vehicle, self._outputs, self._build, self._clock_s = vehicle, list(outputs), build, clock_s
        self._encoder = Encoder()
        self._world: World | None = None
        self._flown_s = 0.0

    async def run(self) -> None:
        """Run until `close`. `LinkError` (in a group) if a link can never be opened."""
        async with asyncio.TaskGroup() as tasks:
            for output in self._outputs:
                await output.open()
                tasks.create_task(output.run(), name=f"receiver {output.link.address}")
            requesting = tasks.create_task(self._request_positions(), name="requests")
            await Reconnect(self._vehicle).run(self._receive)
            requesting.cancel()

    def close(self) -> None:
        """Close all links; `run` returns."""
        self._vehicle.close()
        for output in self._outputs:
            output.close()

    async def _request_positions(self) -> None:
        """Make the vehicle know us, and request its position at 10 Hz: it does so for each link."""
        while True:
            for message in (_heartbeat(), _interval()):
                self._vehicle.send(self._encoder.encode(message, *ADSB_RECEIVER))
            await asyncio.sleep(_REQUEST_PERIOD_S)

    def _receive(self, frames: list[Frame], link: Link) -> None:
        for frame in frames:
            is_position = frame.message_id == mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT
            if is_position and frame.component_id == mavlink.MAV_COMP_ID_AUTOPILOT1:
                message = decode(frame, link.counters)
                if message is not None:
                    self._follow(message)

    def _follow(self, position: Message) -> None:
        flown_s = position.time_boot_ms / 1000.0 - BOOTED_BEFORE_S
        carrier = _carrier(position)
        if self._world is None or flown_s < self._flown_s - _REBOOTED_S:
            self._begin(flown_s, carrier)
        assert self._world is not None
        self._flown_s = max(self._flown_s, flown_s)
        for output in self._outputs:
            output.step(self._world.start_s + self._flown_s, carrier)

    def _begin(self, flown_s: float, carrier: Carrier) -> None:
        _log.info("the vehicle has flown for %.0f s of the scenario", flown_s)
        self._world, self._flown_s = self._build(self._clock_s() - flown_s), flown_s
        for output in self._outputs:
            receiver = self._world.receiver_of(output.name)
            receiver.skip_to(self._world.start_s + flown_s, carrier)
            output.switch_on(receiver)


def _carrier(position: Message) -> Carrier:
    velocity_mps = (position.vx / 100.0, position.vy / 100.0, position.vz / 100.0)
    is_slow = math.hypot(*velocity_mps) < _GROUND_SPEED_MPS
    return Carrier(
        GeoPoint(position.lat / 1e7, position.lon / 1e7, position.alt / 1000.0),
        velocity_mps,
        on_ground=is_slow and position.relative_alt < _GROUND_HEIGHT_MM,
    )


def _heartbeat() -> Message:
    return mavlink.MAVLink_heartbeat_message(
        mavlink.MAV_TYPE_ADSB, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, mavlink.MAV_STATE_ACTIVE, 3
    )


def _interval() -> Message:
    return mavlink.MAVLink_command_long_message(
        1,
        mavlink.MAV_COMP_ID_AUTOPILOT1,
        mavlink.MAV_CMD_SET_MESSAGE_INTERVAL,
        0,
        mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
        _POSITION_INTERVAL_US,
        *[0.0] * 5,
    )
