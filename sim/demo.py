"""The demonstration: vehicle, receiver of traffic, intruders and companion over real sockets on loopback.

All share one clock, which may run faster than real time; apart from that they run as in flight.
"""

import asyncio
import contextlib
import socket
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from companion.address import is_of_receiver, parse_receiver_address
from companion.engine import Engine, EngineConfig
from companion.links import Link, ReceiverLink, open_link
from companion.mavlink.dialect import Encoder
from companion.model import Snapshot
from companion.recording.recorder import Recorder
from companion.runtime import Runtime
from companion.web import Display
from companion.web.settings import Settings
from sim.clock import ScaledClock
from sim.metrics import FlightScore, score_of
from sim.receiver_output import ReceiverOutput, heard_at, local_address
from sim.receivers.mavlink import ADSB_RECEIVER
from sim.scenario import Autopilot, Scenario
from sim.server import VehicleServer
from sim.vehicle import Truth
from sim.world import World, build_world

_RECEIVER_PERIOD_S = 0.05


@dataclass(frozen=True)
class DemoOptions:
    """Options of a demonstration. `record`: recording folder or `None`; `display`: web settings or `None`.

    `receiver`: the format of a receiver at the companion; `None` for the autopilot's own one for ADS-B.
    """

    scenario: Scenario
    speedup: float = 8.0
    avoidance: bool = True
    record: Path | None = None
    display: Settings | None = None
    engine: EngineConfig = field(default_factory=EngineConfig)
    seed: int = 0
    autopilot: Autopilot = "ardupilot"
    receiver: str | None = None


@dataclass
class DemoState:
    """The present state of the demonstration, and its result at the end."""

    options: DemoOptions
    world: World
    score: FlightScore
    clock: ScaledClock
    truth: Truth
    runtime: Runtime | None
    recording: Path | None
    started_s: float = field(default_factory=time.perf_counter)
    engaged: bool = False
    resumed: bool = False
    uncontrolled: bool = False
    ended: asyncio.Event = field(default_factory=asyncio.Event)

    @property
    def elapsed_s(self) -> float:
        """Simulated seconds since the start."""
        return self.truth.time_s - self.world.start_s

    def snapshot(self) -> Snapshot | None:
        """The companion's snapshot; `None` without a companion."""
        return None if self.runtime is None else self.runtime.engine.snapshot(self.clock.now_s())

    @property
    def nmac(self) -> bool:
        """True if any encounter was a near mid-air collision."""
        return any(encounter.nmac for encounter in self.score.encounters.values())

    @property
    def passed(self) -> bool:
        """True without near mid-air collision or loss of control, with the mission finished."""
        return self.truth.mission_completed and not self.nmac and not self.uncontrolled

    def observe(self, truth: Truth) -> None:
        """Update with the vehicle's state after a step."""
        self.truth = truth
        if truth.mission_completed or self.elapsed_s >= self.options.scenario.duration_s:
            self.ended.set()
        self.score.update(truth.time_s, truth.position_m)
        self.engaged |= truth.companion_flies
        self.resumed |= self.engaged and truth.on_mission
        self.uncontrolled |= truth.uncontrolled
        if self.runtime is not None and self.runtime.engine.supervisor.flying:
            self.score.note_action(truth.time_s, self.runtime.engine.decision.threats)

    def report(self) -> dict[str, object]:
        """The JSON report."""
        runtime = self.runtime
        latencies_ms = sorted(1e3 * s for s in runtime.latencies_s) if runtime is not None else []
        return {
            "mission_completed": self.truth.mission_completed,
            "resumed": self.resumed,
            "setpoints_sent": 0 if runtime is None else runtime.setpoints_sent,
            "encounters": [encounter.report() for encounter in self.score.encounters.values()],
            "max_deviation_m": round(self.score.max_deviation_m, 1),
            "latency_ms": {"p50": _quantile(latencies_ms, 0.5), "p99": _quantile(latencies_ms, 0.99)},
            "avoidance": self.options.avoidance,
            "autopilot": self.options.autopilot,
            "receiver": self.options.receiver,
            "uncontrolled": self.uncontrolled,
            "simulated_s": round(self.elapsed_s, 1),
            "wall_s": round(time.perf_counter() - self.started_s, 1),
            "speedup": self.options.speedup,
            "clock_slipped_s": round(self.clock.slipped_s, 1),
            "recording": None if self.recording is None else str(self.recording),
        }


def _quantile(ordered: list[float], share: float) -> float | None:
    """The quantile of ordered values; `None` without values."""
    if not ordered:
        return None
    return round(ordered[min(int(share * len(ordered)), len(ordered) - 1)], 3)


async def fly_demo(options: DemoOptions, on_start: Callable[[DemoState], None] = lambda _: None) -> DemoState:
    """Fly the scenario until its mission is completed or its time is up; the final state."""
    start_s = float(int(time.time()))
    world = build_world(options.scenario, start_s, seed=options.seed, autopilot=options.autopilot)
    score = score_of(options.scenario, world)
    clock = ScaledClock(options.speedup, start_s=start_s)
    to_companion, to_receiver, from_receiver = free_ports(3)
    beside = receivers_of(options, world, from_receiver)
    recorder, runtime = None, None
    if options.avoidance:
        if options.record is not None:
            recorder = Recorder(options.record, time.time())
        autopilot = open_link(f"udpin:127.0.0.1:{to_companion}")
        links, receivers = links_of_companion(options, autopilot, beside)
        display = None if options.display is None else Display(options.display)
        runtime = Runtime(
            Engine(options.engine),
            links,
            receivers=receivers,
            recorder=recorder,
            clock=clock,
            display=display,
        )
    recording = None if recorder is None else recorder.tlog_path
    state = DemoState(options, world, score, clock, world.vehicle.truth, runtime, recording)
    server = VehicleServer(
        world.vehicle,
        [open_link(f"udpout:127.0.0.1:{to_companion}"), open_link(f"udpin:127.0.0.1:{to_receiver}")],
        clock,
        beside=beside,
        observe=state.observe,
    )
    on_start(state)
    async with asyncio.TaskGroup() as tasks:
        companion = None if runtime is None else tasks.create_task(runtime.run(), name="companion")
        vehicle = tasks.create_task(server.run(), name="vehicle")
        receiver = tasks.create_task(report_traffic(state, to_receiver), name="receiver")
        await state.ended.wait()
        if runtime is not None and companion is not None:
            runtime.stop()
            await companion
        receiver.cancel()
        server.close()
        await vehicle
    return state


def receivers_of(options: DemoOptions, world: World, port: int) -> list[ReceiverOutput]:
    """The receiver at the companion, if there is one."""
    if options.receiver is None:
        return []
    output = ReceiverOutput(options.receiver, local_address(options.receiver, port))
    output.switch_on(world.receiver_of(options.receiver, seed=options.seed))
    return [output]


def links_of_companion(
    options: DemoOptions, autopilot: Link, beside: Sequence[ReceiverOutput]
) -> tuple[list[Link], list[ReceiverLink]]:
    """The links of the companion: to the autopilot, and to its receiver."""
    links, receivers = [autopilot], []
    for output in beside:
        text = heard_at(output.name, output.link.address)
        if is_of_receiver(text):
            # A document changes once a simulated second.
            period_s = 1.0 / options.speedup
            receivers.append(ReceiverLink(text, parse_receiver_address(text), document_period_s=period_s))
        else:
            links.append(open_link(text))
    return links, receivers


async def report_traffic(state: DemoState, port: int) -> None:
    """The ADS-B receiver beside the autopilot: its serial port is a socket here."""
    if state.options.receiver is not None:
        return
    link, encoder = open_link(f"udpout:127.0.0.1:{port}"), Encoder()
    await link.open()
    with contextlib.closing(link):
        while True:
            for report in state.world.receiver.reports(state.clock.now_s(), state.truth.position_m):
                link.send(encoder.encode(report, *ADSB_RECEIVER))
            await asyncio.sleep(_RECEIVER_PERIOD_S / state.clock.speedup)


def free_ports(count: int) -> list[int]:
    """Unused ports on loopback."""
    sockets = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(count)]
    try:
        for each in sockets:
            each.bind(("127.0.0.1", 0))
        return [each.getsockname()[1] for each in sockets]
    finally:
        for each in sockets:
            each.close()
