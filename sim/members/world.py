"""The worlds of the members: each has its own vehicle and receiver, and all have the same intruders."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from sim.members.scenario import FormationScenario, Member
from sim.members.score import Moment
from sim.metrics import FlightScore, score_against
from sim.scenario import Scenario
from sim.traffic import AdsbReceiver, Intruder
from sim.vehicle import FakeVehicle, Truth
from sim.world import World, aim, flown_by, make_vehicle, receiver_model


@dataclass(frozen=True, slots=True)
class MemberWorld:
    """One member's part: its own scenario, its world, and the score of its flight."""

    member: Member
    scenario: Scenario
    world: World
    score: FlightScore

    def moment(self, truth: Truth, *, completed: bool) -> Moment:
        """What the score of the formation needs of the vehicle's state."""
        under_way = not truth.on_ground and not completed
        return Moment(truth.time_s - self.world.start_s, truth.position_m, under_way)


def build_worlds(
    scenario: FormationScenario, start_s: float, *, seed: int = 0, clock_errors_s: Sequence[float] = ()
) -> list[MemberWorld]:
    """The members' worlds; intruders are aimed at future positions of the undisturbed members.

    The clock of member number n is wrong by `clock_errors_s[n]`: its world begins that much later.
    """
    intruders = _intruders(scenario)
    return [
        _world(
            scenario, member, start_s + (clock_errors_s[n] if clock_errors_s else 0.0), intruders, seed + n
        )
        for n, member in enumerate(scenario.formation)
    ]


def _world(
    scenario: FormationScenario, member: Member, start_s: float, intruders: Sequence[Intruder], seed: int
) -> MemberWorld:
    own = scenario.scenario_of(member)
    traffic = tuple(replace(one, anchor_s=start_s + one.anchor_s) for one in intruders)
    receiver = AdsbReceiver(traffic, own.frame, start_s, model=receiver_model(own.receiver), seed=seed)
    world = World(start_s, own.frame, _vehicle(own, member, start_s), traffic, receiver)
    planned = flown_by(_vehicle(own, member, start_s), scenario.duration_s, 1.0)
    return MemberWorld(member, own, world, score_against(planned, world))


def _intruders(scenario: FormationScenario) -> list[Intruder]:
    """The intruders, in seconds since the start."""
    scouts = {one.name: _vehicle(scenario.scenario_of(one), one, 0.0) for one in scenario.formation}
    aimed: dict[str, Intruder] = {}
    for conflict in sorted(scenario.intruders, key=lambda c: c.meet_at_s):
        scouts[conflict.member].step(conflict.meet_at_s)
        aimed[conflict.icao] = aim(conflict, scouts[conflict.member].truth)
    return [aimed[conflict.icao] for conflict in scenario.intruders]


def _vehicle(scenario: Scenario, member: Member, start_s: float) -> FakeVehicle:
    return make_vehicle(
        scenario, start_s, member.autopilot, system_id=member.system_id, cruise_mps=member.airspeed_mps
    )
