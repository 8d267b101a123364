"""The demonstration of a formation: every vehicle and every companion on its own, over sockets on loopback.

As in the demonstration of one aircraft, all share one clock. Each companion has a link to its autopilot, and
one to the network between the members.
"""

import asyncio
import contextvars
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

from companion.engine import Engine, EngineConfig
from companion.links import Link, open_link
from companion.links.udp import UdpInLink, UdpLink
from companion.recording.recorder import Recorder
from companion.runtime import Runtime
from companion.web.display import Display, MemberDisplay
from companion.web.settings import Settings
from sim.clock import ScaledClock
from sim.demo import DemoOptions, DemoState, free_ports, links_of_companion, receivers_of, report_traffic
from sim.members.comparison import Compared, fly_alone, safety_report
from sim.members.engines import engine_config
from sim.members.hub import Ends, Hub
from sim.members.network import Network
from sim.members.pace import Pace
from sim.members.scenario import FormationScenario
from sim.members.score import FormationScore
from sim.members.world import MemberWorld, build_worlds
from sim.server import VehicleServer
from sim.vehicle import Truth

# The member whose companion runs: lines of its log show whose they are.
MEMBER: contextvars.ContextVar[str] = contextvars.ContextVar("member", default="")

_HERE = "udpin:127.0.0.1"


@dataclass(frozen=True)
class FormationOptions:
    """Options of a demonstration, as in `DemoOptions`; members record into folders of their names.

    `compare`: fly each layer alone afterwards.
    """

    scenario: FormationScenario
    speedup: float = 8.0
    avoidance: bool = True
    record: Path | None = None
    display: Settings | None = None
    engine: EngineConfig = field(default_factory=EngineConfig)
    seed: int = 0
    receiver: str | None = None
    compare: bool = True


@dataclass
class FormationState:
    """The present state of the demonstration, and its result at the end."""

    options: FormationOptions
    clock: ScaledClock
    worlds: list[MemberWorld]
    members: list[DemoState]
    score: FormationScore
    alone: dict[str, Compared] = field(default_factory=dict)
    started_s: float = field(default_factory=time.perf_counter)

    @property
    def named(self) -> list[tuple[str, DemoState]]:
        """The members with their names."""
        return [(own.member.name, state) for own, state in zip(self.worlds, self.members, strict=True)]

    @property
    def elapsed_s(self) -> float:
        """Simulated seconds since the start."""
        return max(state.elapsed_s for state in self.members)

    @property
    def mission_completed(self) -> bool:
        """True if every member finished its mission."""
        return all(state.truth.mission_completed for state in self.members)

    @property
    def passed(self) -> bool:
        """True if every member passed, and no two came too near."""
        return all(state.passed for state in self.members) and not self.score.separation_lost

    @property
    def compared(self) -> dict[str, Compared]:
        """This flight, and those with each layer alone."""
        flown = Compared.of(self.score, mission_completed=self.mission_completed)
        return {"companion" if self.options.avoidance else "none": flown, **self.alone}

    def observe(self, place: int, truth: Truth) -> None:
        """Update with a vehicle's state after a step; a member that has finished is not judged any more."""
        own, state = self.worlds[place], self.members[place]
        if not state.ended.is_set():
            state.observe(truth)
        self.score.add(own.member.name, own.moment(truth, completed=state.ended.is_set()))

    def report(self) -> dict[str, object]:
        """The JSON report; each of `members` has the keys of a demonstration of one aircraft."""
        network = self.options.scenario.network
        return {
            "mission_completed": self.mission_completed,
            "separation_lost": self.score.separation_lost,
            "avoidance": self.options.avoidance,
            "network": {"loss": network.loss, "delay_s": network.delay_s},
            "members": [
                {"name": own.member.name, "system_id": own.member.system_id, **state.report()}
                for own, state in zip(self.worlds, self.members, strict=True)
            ],
            "pairs": [pair.report() for pair in self.score.pairs.values()],
            "safety_value": safety_report(self.compared),
            "simulated_s": round(self.elapsed_s, 1),
            "wall_s": round(time.perf_counter() - self.started_s, 1),
            "speedup": self.options.speedup,
            "clock_slipped_s": round(self.clock.slipped_s, 1),
        }


class _Service:
    """One member's vehicle, companion and receiver, each with sockets of its own."""

    def __init__(
        self,
        own: MemberWorld,
        options: FormationOptions,
        clock: ScaledClock,
        shared: Display | None,
        sockets: "_Sockets",
    ) -> None:
        self.name = own.member.name
        alone = DemoOptions(
            own.scenario,
            options.speedup,
            options.avoidance,
            engine=options.engine,
            autopilot=own.member.autopilot,
            receiver=options.receiver,
        )
        self._sockets = sockets
        self._beside = receivers_of(alone, own.world, *free_ports(1))
        self.ends = Ends(sockets.from_vehicle, sockets.network)
        self._vehicle_links = [_to(sockets.companion), sockets.receiver, _to(sockets.from_vehicle)]
        self.runtime, recording = None, None
        if options.avoidance:
            recorder = None if options.record is None else Recorder(options.record / self.name, time.time())
            links, receivers = links_of_companion(alone, sockets.companion, self._beside)
            self.runtime = Runtime(
                Engine(engine_config(own.member, base=options.engine)),
                [*links, _to(sockets.network)],
                receivers=receivers,
                recorder=recorder,
                clock=clock,
                display=None if shared is None else MemberDisplay(shared, self.name),
            )
            recording = None if recorder is None else recorder.tlog_path
        truth = own.world.vehicle.truth
        self.state = DemoState(alone, own.world, own.score, clock, truth, self.runtime, recording)
        self._server: VehicleServer | None = None

    @property
    def links(self) -> list[Link]:
        """All links of the vehicle, the companion and the network to them."""
        of_companion = [] if self.runtime is None else self.runtime.links
        return [*self._vehicle_links, *of_companion, self.ends.vehicle, self.ends.companion]

    async def fly(self, observe: Callable[[Truth], None]) -> None:
        """Run the vehicle and its receiver until `land`."""
        vehicle, clock = self.state.world.vehicle, self.state.clock
        self._server = VehicleServer(
            vehicle, self._vehicle_links, clock, beside=self._beside, observe=observe
        )
        port = self._sockets.receiver.local_port
        reporting = asyncio.create_task(report_traffic(self.state, port), name="receiver")
        try:
            await self._server.run()
        finally:
            reporting.cancel()

    def land(self) -> None:
        """End `fly`."""
        if self._server is not None:
            self._server.close()
        self._sockets.close()

    async def accompany(self) -> None:
        """Run the companion until it is stopped."""
        MEMBER.set(self.name)
        if self.runtime is not None:
            await self.runtime.run()


@dataclass(frozen=True, slots=True)
class _Sockets:
    """The sockets of one member that listen: of its companion, of its vehicle, and two of the network."""

    companion: UdpLink
    receiver: UdpLink
    from_vehicle: UdpLink
    network: UdpLink

    @classmethod
    async def open(cls) -> "_Sockets":
        """Open all of them, at ports that are free."""
        return cls(
            await _listening(),
            await _listening(),
            await _listening(listen_only=True),
            await _listening(),
        )

    def close(self) -> None:
        """Close all of them; a second call does nothing."""
        for link in (self.companion, self.receiver, self.from_vehicle, self.network):
            link.close()


async def _listening(*, listen_only: bool = False) -> UdpLink:
    """A link that listens at a free port, and is open: another socket could take a port that is not."""
    link = UdpInLink(_HERE, "127.0.0.1", 0, listen_only=listen_only)
    await link.open()
    link.address = f"{_HERE}:{link.local_port}"
    return link


def _to(listening: UdpLink) -> Link:
    return open_link(f"udpout:127.0.0.1:{listening.local_port}")


async def fly_formation_demo(
    options: FormationOptions, on_start: Callable[[FormationState], None] = lambda _: None
) -> FormationState:
    """Fly the scenario until all missions are completed or its time is up; the final state."""
    scenario, start_s = options.scenario, float(int(time.time()))
    clock = ScaledClock(options.speedup, start_s=start_s)
    names = tuple(member.name for member in scenario.formation)
    shared = None
    if options.display is not None and options.avoidance:
        shared = Display(replace(options.display, members=names))
    worlds = build_worlds(scenario, start_s, seed=options.seed)
    services = [_Service(own, options, clock, shared, await _Sockets.open()) for own in worlds]
    members = [service.state for service in services]
    state = FormationState(options, clock, worlds, members, FormationScore(names))
    for place, member in enumerate(members):
        state.observe(place, member.truth)
    network = Network(scenario.network, len(names), seed=options.seed)
    on_start(state)
    async with asyncio.TaskGroup() as tasks:
        hub = Hub(network, [one.ends for one in services], clock)
        pace = Pace(clock, [link for one in services for link in one.links])
        others = [
            tasks.create_task(hub.run(), name="network"),
            tasks.create_task(pace.run(), name="pace of the clock"),
        ]
        if shared is not None:
            others.append(tasks.create_task(shared.run(), name="display"))
        companions = [tasks.create_task(one.accompany(), name=f"companion {one.name}") for one in services]
        for place, one in enumerate(services):
            tasks.create_task(one.fly(partial(state.observe, place)), name=f"vehicle {one.name}")
        for member in members:
            await member.ended.wait()
        for one in services:
            if one.runtime is not None:
                one.runtime.stop()
        await asyncio.gather(*companions)
        for one in services:
            one.land()
        for task in others:
            task.cancel()
    if options.compare and options.avoidance:
        state.alone = await fly_alone(scenario, options.seed)
    return state
