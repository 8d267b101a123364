"""Runs a fake vehicle on asyncio: advances its time and connects its channels to links."""

import asyncio
from collections.abc import Callable, Sequence
from functools import partial

from companion.links import Link
from companion.mavlink.dialect import Encoder
from companion.mavlink.framing import Frame, decode
from sim.clock import ScaledClock
from sim.receiver import carrier_of
from sim.receiver_output import ReceiverOutput
from sim.traffic import AdsbReceiver
from sim.vehicle import FakeVehicle, Outgoing, Truth
from sim.vehicle.flight import STEP_S

# The shared clock's largest lead over the vehicle [simulated seconds]. It also bounds the work of one step:
# if the machine cannot keep up with the speedup, the clock waits. Twice this, for the way to the companion
# and back, must be less than the gap in the setpoints that an autopilot tolerates.
_LONGEST_LEAD_S = 0.15
_RECEIVER_CHANNEL = -1


class VehicleServer:
    """Runs one vehicle in the time of `clock`; link number n is the vehicle's channel n.

    Reports of `receiver` reach the vehicle as from a receiver at its serial port; `beside` are receivers on
    the vehicle that send to links of their own. `observe` is called with the truth after each step. A link
    that loses its peer only loses messages.
    """

    def __init__(
        self,
        vehicle: FakeVehicle,
        links: Sequence[Link],
        clock: ScaledClock,
        *,
        receiver: AdsbReceiver | None = None,
        beside: Sequence[ReceiverOutput] = (),
        observe: Callable[[Truth], None] | None = None,
        stream_rate_hz: float = 2.0,
    ) -> None:
        """The vehicle's time must not be later than that of the clock."""
        self._vehicle = vehicle
        self._links = list(links)
        self._clock = clock
        self._receiver = receiver
        self._beside = list(beside)
        self._observe = observe
        self._encoders = [Encoder() for _ in self._links]
        self._boots = vehicle.boots
        self._closed = False
        for channel in range(len(self._links)):
            vehicle.add_channel(channel, stream_rate_hz=stream_rate_hz)
        clock.hold_at(vehicle.time_s + _LONGEST_LEAD_S, self)

    @property
    def overruns(self) -> int:
        """Number of times that the machine was too slow for the speedup; see `clock.slipped_s`."""
        return self._clock.overruns

    async def run(self) -> None:
        """Run until `close`. `LinkError` (in a group) if a link cannot be opened."""
        try:
            async with asyncio.TaskGroup() as tasks:
                for channel, link in enumerate(self._links):
                    await link.open()
                    run = link.run(partial(self._receive, channel))
                    tasks.create_task(run, name=f"vehicle link {link.address}")
                for output in self._beside:
                    await output.open()
                    tasks.create_task(output.run(), name=f"receiver {output.link.address}")
                tasks.create_task(self._fly(), name="vehicle")
        finally:
            self.close()

    def close(self) -> None:
        """Stop; `run` returns. A second call does nothing."""
        self._closed = True
        for link in self._links:
            link.close()
        for output in self._beside:
            output.close()

    async def _fly(self) -> None:
        vehicle, clock = self._vehicle, self._clock
        try:
            while not self._closed:
                self._advance(clock.now_s())
                clock.hold_at(vehicle.time_s + _LONGEST_LEAD_S, self)
                await clock.sleep_until(vehicle.time_s + STEP_S)
        finally:
            clock.let_go(self)

    def _advance(self, now_s: float) -> None:
        vehicle = self._vehicle
        now_s = min(now_s, vehicle.time_s + _LONGEST_LEAD_S)
        if self._receiver is not None:
            for report in self._receiver.reports(now_s, vehicle.flight.aircraft.position_m):
                vehicle.receive(report, now_s, _RECEIVER_CHANNEL)
        before_s = vehicle.time_s
        self._send(vehicle.step(now_s))
        if vehicle.time_s > before_s and (self._observe is not None or self._beside):
            truth = vehicle.truth
            for output in self._beside:
                output.step(truth.time_s, carrier_of(truth))
            if self._observe is not None:
                self._observe(truth)

    def _receive(self, channel: int, frames: list[Frame], link: Link) -> None:
        now_s = self._clock.now_s()
        for frame in frames:
            message = decode(frame, link.counters)
            if message is not None:
                self._vehicle.receive(message, now_s, channel)
        self._advance(now_s)  # send answers at once

    def _send(self, outgoing: Sequence[Outgoing]) -> None:
        vehicle = self._vehicle
        if vehicle.boots != self._boots:
            self._boots = vehicle.boots
            self._encoders = [Encoder() for _ in self._links]
        for channel, message in outgoing:
            if 0 <= channel < len(self._links):
                data = self._encoders[channel].encode(message, vehicle.system_id, vehicle.component_id)
                self._links[channel].send(data)
