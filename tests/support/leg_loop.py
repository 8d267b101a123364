"""A closed loop on a mission of one's own, and how far the aircraft is from one of its legs."""

import math
from collections.abc import Sequence
from dataclasses import replace

from companion.control.rejoin import ControlParams, RejoinMode
from companion.control.state_machine import State
from companion.engine import EngineConfig
from companion.model import Vec3
from sim.scenario import Autopilot, load_scenario
from sim.vehicle import MissionItem, takeoff_item, waypoint_item
from sim.vehicle.mission import DO_JUMP
from tests.support.autopilots import PX4
from tests.support.monitored_loop import MonitoredLoop
from tests.support.overrides import HOLDS

ASIDE_M, HEIGHT_M = 30.0, 10.0
_HEIGHT_M = 300.0


class LegLoop(MonitoredLoop):
    """Begins in the air on the way to the mission's first waypoint, item `first`.

    `waypoints` are places north, east and above home [m].
    """

    def __init__(
        self,
        waypoints: Sequence[Vec3 | MissionItem],
        *,
        autopilot: Autopilot = "ardupilot",
        rejoin: RejoinMode = "line",
        wind_mps: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        scenario = load_scenario("clear")
        wind = replace(scenario.wind, north_mps=wind_mps[0], east_mps=wind_mps[1])
        scenario = replace(scenario, intruders=(), duration_s=1.0, wind=wind)
        config = EngineConfig(control=ControlParams(rejoin=rejoin))
        parameters = HOLDS if autopilot == PX4 else {}
        super().__init__(scenario, autopilot=autopilot, config=config, parameters=parameters)
        self.first = 2 if autopilot == "ardupilot" else 1
        self.load(waypoints, self.first)

    def load(self, waypoints: Sequence[Vec3 | MissionItem], sequence: int) -> None:
        """Replace the mission in the vehicle's memory, and fly to an item."""
        flight = self.world.vehicle.flight
        items = [takeoff_item(60.0), *map(self.item, waypoints)]
        flight.mission.replace([takeoff_item(0.0), *items] if self.first == 2 else items)
        flight.select_item(sequence)

    def item(self, place: Vec3 | MissionItem) -> MissionItem:
        """A waypoint at a place relative to home."""
        return place if isinstance(place, MissionItem) else waypoint_item(self.scenario.place(*place))

    @property
    def height_m(self) -> float:
        """Height above home."""
        return -self.world.vehicle.truth.position_m[2] - self.scenario.home.altitude_m

    def off_m(self, start: Vec3, end: Vec3) -> tuple[float, float]:
        """Distance from a leg between two places relative to home: to its right, and above its slope."""
        north_m, east_m, _ = self.world.vehicle.truth.position_m
        leg_n, leg_e = end[0] - start[0], end[1] - start[1]
        length_m = math.hypot(leg_n, leg_e)
        share = ((north_m - start[0]) * leg_n + (east_m - start[1]) * leg_e) / length_m**2
        aside_m = ((east_m - start[1]) * leg_n - (north_m - start[0]) * leg_e) / length_m
        return aside_m, self.height_m - (start[2] + min(max(share, 0.0), 1.0) * (end[2] - start[2]))

    def avoid(self, ahead_m: float = 3500.0, **options: float) -> None:
        """Meet a head-on intruder, and fly until the aircraft is given back."""
        self.intrude(ahead_m, **options)  # type: ignore[arg-type]
        self.until(State.OUTER, State.INNER, limit_s=60.0)
        self.until(State.MONITOR, limit_s=300.0)

    def stays_on(self, start: Vec3, end: Vec3, seconds: float, margin_m: float = 0.0) -> None:
        """Fly on, and assert that the aircraft stays on the leg and its height."""
        for _ in range(round(seconds)):
            self.run(1.0)
            aside_m, above_m = self.off_m(start, end)
            assert abs(aside_m) <= ASIDE_M + margin_m, (aside_m, above_m, self.world.vehicle.truth)
            assert abs(above_m) <= HEIGHT_M, (aside_m, above_m, self.world.vehicle.truth)


def jump(to: int, count: int) -> MissionItem:
    """A DO_JUMP."""
    return MissionItem(DO_JUMP, params=(float(to), float(count), 0.0, 0.0), frame=2)
