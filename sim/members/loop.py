"""Closed loop of a formation: all engines and fake vehicles in lockstep, with the bytes of the wire."""

from collections.abc import Sequence
from dataclasses import dataclass

from companion.avoidance.params import Layers
from companion.engine import Engine, Transmit
from companion.mavlink.dialect import Message
from companion.mavlink.framing import FrameSplitter
from sim.closed_loop import ClosedLoop, Flight
from sim.members.engines import engine_of
from sim.members.network import Network, is_broadcast, is_of_vehicle
from sim.members.scenario import FormationScenario
from sim.members.score import FormationScore
from sim.members.world import MemberWorld, build_worlds

NETWORK_CHANNEL = 2  # of the vehicle
_STEP_S = 0.05


@dataclass
class FormationFlight:
    """The record of a flight: that of each member by name, and the score of all together."""

    members: dict[str, Flight]
    score: FormationScore
    elapsed_s: float = 0.0

    @property
    def mission_completed(self) -> bool:
        """True if every member reached its last waypoint."""
        return all(flight.mission_completed for flight in self.members.values())


class MemberLoop(ClosedLoop):
    """One member: its engine and vehicle, and in `sent` what it sends to the others, with the address."""

    def __init__(self, own: MemberWorld, engine: Engine | None, start_us: int) -> None:
        super().__init__(own.scenario, engine, start_us=start_us, world=own.world, score=own.score)
        self.own = own
        self.world.vehicle.add_channel(NETWORK_CHANNEL)
        self.sent: list[tuple[Message, tuple[int, int]]] = []
        self._network_splitter = FrameSplitter()

    def pass_on(self, message: Message) -> None:
        """Send the vehicle's heartbeat and position to the others."""
        if is_of_vehicle(message.get_msgId()):
            vehicle = self.world.vehicle
            self.sent.append((message, (vehicle.system_id, vehicle.component_id)))

    def transmitted(self, effect: Transmit) -> None:
        """Send what the companion broadcasts to the others, too."""
        if effect.to == "all" and is_broadcast(effect.message):
            self.sent.append((effect.message, effect.sender))

    def hear(self, frames: Sequence[bytes]) -> None:
        """Take in frames of other members."""
        if self.engine is None:
            return
        for raw in frames:
            self._take_in(self._network_splitter, raw)


class FormationLoop:
    """One scenario flown by the engines of its members (`None`: a member without avoidance).

    The seed decides what the network loses and what the receivers measure. `clock_errors_s` are the errors
    of the members' clocks.
    """

    def __init__(
        self,
        scenario: FormationScenario,
        engines: Sequence[Engine | None],
        *,
        seed: int = 0,
        start_us: int = 1_700_000_000_000_000,
        clock_errors_s: Sequence[float] = (),
    ) -> None:
        self.scenario = scenario
        errors_us = [round(error_s * 1e6) for error_s in clock_errors_s] or [0] * len(scenario.formation)
        errors_s = [error_us / 1e6 for error_us in errors_us]
        worlds = build_worlds(scenario, start_us / 1e6, seed=seed, clock_errors_s=errors_s)
        self.members = [
            MemberLoop(own, engine, start_us + error_us)
            for own, engine, error_us in zip(worlds, engines, errors_us, strict=True)
        ]
        self.network = Network(scenario.network, len(self.members), seed=seed)
        names = [member.name for member in scenario.formation]
        flights = [loop.flight for loop in self.members]
        self.flight = FormationFlight(dict(zip(names, flights, strict=True)), FormationScore(names))
        self._steps = 0
        self._score()

    def run(self, seconds: float | None = None) -> FormationFlight:
        """Fly for `seconds` (default: the scenario's duration, or until all missions are completed)."""
        until = self._steps + round((self.scenario.duration_s if seconds is None else seconds) / _STEP_S)
        while self._steps < until and not (seconds is None and self.flight.mission_completed):
            self.step()
        return self.flight

    def step(self) -> None:
        """Fly for one step."""
        for place, member in enumerate(self.members):
            member.hear(self.network.arrived(place, self._steps * _STEP_S))
        self._steps += 1
        self.flight.elapsed_s = self._steps * _STEP_S
        for place, member in enumerate(self.members):
            member.step()
            for message, address in member.sent:
                self.network.send(place, message, address, self.flight.elapsed_s)
            member.sent.clear()
        self._score()

    def _score(self) -> None:
        for member in self.members:
            flight = member.flight
            moment = member.own.moment(flight.truth, completed=flight.mission_completed)
            self.flight.score.add(member.own.member.name, moment)


def fly_formation(
    scenario: FormationScenario, *, layers: Layers | None = Layers.BOTH, seed: int = 0
) -> FormationFlight:
    """Fly a formation to its end; `layers` `None`: without avoidance."""
    engines = [None if layers is None else engine_of(member, layers) for member in scenario.formation]
    return FormationLoop(scenario, engines, seed=seed).run()
