"""A flight over real UDP on loopback with faults: vehicle, receiver, faulty relay and companion.

All share the time of a `VirtualTimeLoop`.
"""

import asyncio
import contextlib
import socket
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass, field, replace
from typing import Any

from companion.avoidance import AvoidanceParams
from companion.avoidance.params import CostWeights
from companion.clock import Clock
from companion.control.state_machine import State
from companion.engine import Engine, EngineConfig
from companion.links import open_link
from companion.links.udp import UdpInLink
from companion.mavlink.dialect import Message
from companion.mavlink.facts import Sender
from companion.mavlink.framing import FrameSplitter, decode
from companion.model import Vec3
from companion.recording.recorder import Recorder
from companion.runtime import Runtime
from companion.sources.receiver import Piece
from sim.clock import ScaledClock
from sim.faults import Faults
from sim.files import checked_from
from sim.metrics import FlightScore
from sim.relay import Relay
from sim.scenario import Autopilot, Scenario
from sim.server import VehicleServer
from sim.traffic import AdsbReceiver
from sim.vehicle import FakeVehicle, Truth
from sim.world import World, build_world

START_S = 1_700_000_000.0
HOLD = 5  # COM_OBL_RC_ACT, as recommended
# Climbs are allowed for a PX4 whose setpoint can become invalid in them, if they are the cheapest way.
# Conflicts do not wait, so that there is time for the faults.
AT_ONCE = EngineConfig(avoidance=AvoidanceParams(reserve_s=60.0))
CLIMBS = EngineConfig(avoidance=AvoidanceParams(reserve_s=60.0, weights=CostWeights(spared_height=0.0)))
_QUERIES = frozenset({511, 512})  # requests for rates and messages, which change no flight

# Late enough for a turn to suffice, so that no climb is needed.
MEET_AT_S = 70.0
HEAD_ON: dict[str, Any] = {
    "description": "One aircraft head-on at our height.",
    "duration_s": 300,
    "home": {"lat_deg": -35.36, "lon_deg": 149.16, "altitude_m": 584.0},
    "mission": {"takeoff_height_m": 50, "waypoints": [{"north_m": 20000, "east_m": 0, "height_m": 300}]},
    "start": {"where": "air", "height_m": 300},
    "intruders": [
        {"icao": "A00001", "callsign": "HEAD1", "meet_at_s": MEET_AT_S, "from_deg": 0, "speed_mps": 60}
    ],
}


class Notes(Recorder):
    """A recorder in memory: every message that the companion sent, with its time."""

    def __init__(self) -> None:
        self.sent_messages: list[tuple[float, Message]] = []

    @property
    def problem(self) -> None:
        return None

    def received(self, time_us: int, raw: bytes) -> None:
        """Ignored."""

    def heard(self, time_us: int, piece: Piece, us: Sender) -> None:
        """Ignored."""

    def sent(self, time_us: int, raw: bytes) -> None:
        (frame,) = FrameSplitter().feed(raw)
        message = decode(frame)
        assert message is not None
        self.sent_messages.append((time_us / 1e6, message))

    def decision(self, time_us: int, line: str) -> None:
        """Ignored."""

    def state(self, time_us: int, line: str) -> None:
        """Ignored."""

    def text(self, time_us: int, severity: int, text: str) -> None:
        """Ignored."""

    async def run(self) -> None:
        await asyncio.Event().wait()

    def close(self) -> None:
        """Do nothing."""

    def commands(self, since_s: float = 0.0) -> list[Message]:
        """The commands sent: mode, setpoints, guidance, parameters; without requests for messages."""
        return [
            message
            for sent_s, message in self.sent_messages
            if sent_s >= since_s
            and message.get_type().startswith(("COMMAND_LONG", "COMMAND_INT", "SET_", "PARAM_SET"))
            and getattr(message, "command", None) not in _QUERIES
        ]

    def texts(self) -> list[str]:
        """The operator's texts, chunks joined."""
        texts: list[str] = []
        for _, message in self.sent_messages:
            if message.get_type() == "STATUSTEXT":
                text = message.text if isinstance(message.text, str) else message.text.decode()
                if message.id and message.chunk_seq:
                    texts[-1] += text
                else:
                    texts.append(text)
        return texts


class DeafReceiver(AdsbReceiver):
    """An ADS-B receiver that receives nothing while it is `deaf`."""

    deaf = False

    def reports(self, now_s: float, own_m: Vec3 | None = None) -> list[Message]:
        heard = super().reports(now_s, own_m)
        return [] if self.deaf else heard


@dataclass
class FaultyFlight:
    """A flight as a test observes and disturbs it."""

    autopilot: Autopilot
    world: World
    receiver: DeafReceiver
    clock: ScaledClock
    relay: Relay
    runtime: Runtime
    notes: Notes
    second_port: int  # of the companion's second link, which nothing else uses
    modes: list[str] = field(default_factory=list)  # one entry per change
    was_uncontrolled: bool = False
    engagements: int = 0

    def __post_init__(self) -> None:
        self._score = FlightScore(self.world.intruders, (), self.world.start_s)

    @property
    def vehicle(self) -> FakeVehicle:
        return self.world.vehicle

    @property
    def engine(self) -> Engine:
        return self.runtime.engine

    @property
    def state(self) -> State:
        return self.engine.supervisor.state

    @property
    def now_s(self) -> float:
        return self.clock.now_s()

    @property
    def guided(self) -> bool:
        """True if the aircraft is in the mode that obeys the companion."""
        return self.vehicle.truth.companion_flies

    @property
    def nmac(self) -> bool:
        return any(encounter.nmac for encounter in self._score.encounters.values())

    @property
    def lowc(self) -> bool:
        return any(encounter.lowc for encounter in self._score.encounters.values())

    def observe(self, truth: Truth) -> None:
        if not self.modes or self.modes[-1] != truth.mode:
            self.modes.append(truth.mode)
            self.engagements += truth.companion_flies
        self.was_uncontrolled |= truth.uncontrolled
        self._score.update(truth.time_s, truth.position_m)

    async def until(self, condition: Callable[[], bool], limit_s: float = 60.0) -> None:
        """Fly until a condition is true; the test fails after the limit."""
        async with asyncio.timeout(limit_s):
            while not condition():  # noqa: ASYNC110 - a simulated vehicle sets no events
                await asyncio.sleep(0.05)

    async def engaged(self) -> None:
        """Fly until the companion has flown for a moment."""
        await self.until(lambda: self.guided and self.engine.supervisor.flying)
        await asyncio.sleep(3.0)
        assert self.engine.supervisor.flying

    async def resumed(self, limit_s: float = 180.0) -> None:
        """Fly until the mission has been resumed for some time."""
        await self.until(lambda: self.vehicle.truth.on_mission, limit_s)
        await asyncio.sleep(6.0)
        assert self.vehicle.truth.on_mission
        assert not self.engine.supervisor.flying

    async def fly(self, seconds: float) -> None:
        await asyncio.sleep(seconds)


def free_ports(count: int) -> list[int]:
    """Unused ports on loopback."""
    with contextlib.ExitStack() as open_sockets:
        sockets = [open_sockets.enter_context(socket.socket(type=socket.SOCK_DGRAM)) for _ in range(count)]
        for each in sockets:
            each.bind(("127.0.0.1", 0))
        return [each.getsockname()[1] for each in sockets]


def world_of(
    autopilot: Autopilot, *, below_m: float = 0.0, lost_stream: int = HOLD, start_s: float = START_S
) -> tuple[World, DeafReceiver]:
    """The aircraft on its mission with a head-on intruder, `below_m` lower, which makes it climb."""
    (intruder,) = HEAD_ON["intruders"]
    scenario = HEAD_ON | {"intruders": [intruder | {"miss_height_m": -below_m}]}
    world = build_world(checked_from(scenario, Scenario, "test"), start_s, autopilot=autopilot)
    if autopilot != "ardupilot":
        world.vehicle.parameters.record("COM_OBL_RC_ACT", lost_stream)
    receiver = DeafReceiver(world.intruders, world.frame, start_s)
    return replace(world, receiver=receiver), receiver


@contextlib.asynccontextmanager
async def faulty_flight(
    autopilot: Autopilot,
    *,
    forth: Faults | None = None,
    back: Faults | None = None,
    engine: EngineConfig = AT_ONCE,
    lost_stream: int = HOLD,
    below_m: float = 0.0,
    clock: Clock | None = None,
) -> AsyncIterator[FaultyFlight]:
    """Fly while the block runs; at its end the companion is stopped and must release the aircraft.

    `forth` are the faults from the vehicle to the companion. `clock` is the companion's own clock.
    """
    loop = asyncio.get_running_loop()
    world, receiver = world_of(autopilot, below_m=below_m, lost_stream=lost_stream)
    shared = ScaledClock(1.0, start_s=START_S, monotonic_s=loop.time)
    near, far, second = free_ports(3)
    relay = Relay(f"udpin:127.0.0.1:{far}", f"udpout:127.0.0.1:{near}", forth=forth, back=back)
    links = [UdpInLink(f"udpin:127.0.0.1:{port}", "127.0.0.1", port, loop.time) for port in (near, second)]
    notes = Notes()
    runtime = Runtime(Engine(engine), links, recorder=notes, clock=clock or shared)
    flight = FaultyFlight(autopilot, world, receiver, shared, relay, runtime, notes, second)
    server = VehicleServer(
        world.vehicle,
        [open_link(f"udpout:127.0.0.1:{far}")],
        shared,
        receiver=receiver,
        observe=flight.observe,
    )
    await relay.open()
    running = asyncio.create_task(runtime.run())
    flying = asyncio.create_task(server.run())
    try:
        yield flight
        runtime.stop()
        await running
        assert not flight.was_uncontrolled
    finally:
        running.cancel()
        server.close()
        await asyncio.gather(running, flying, return_exceptions=True)
        relay.close()
