"""Scenarios: a mission and the conflicts on it, read from YAML, and the world that they make."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

from annotated_types import Ge, Gt, Le, Len, Lt
from pydantic import dataclasses as checked

from companion.errors import ConfigError
from companion.geodesy import GeoPoint, LocalFrame
from companion.model import Vec2
from sim.files import STRICT, read_checked
from sim.traffic import ALL_VALID, AdsbReceiver, Intruder, ReceiverModel
from sim.vehicle import (
    FakeArduPlane,
    FakePx4,
    FakeVehicle,
    MissionItem,
    Truth,
    takeoff_item,
    waypoint_item,
)

SCENARIO_FOLDER = Path(__file__).with_name("scenarios")
DEFAULT_SCENARIO = "two-intruders"

Autopilot = Literal["ardupilot", "px4"]

# The same aircraft under either autopilot: PX4 is given the speeds that ArduPlane's defaults have.
_PX4_PARAMETERS = {"FW_AIRSPD_TRIM": 22.0, "FW_AIRSPD_MAX": 30.0}


@checked.dataclass(frozen=True, config=STRICT)
class Home:
    """Where the vehicle starts from and what heights are counted from."""

    lat_deg: Annotated[float, Ge(-85.0), Le(85.0)]
    lon_deg: Annotated[float, Ge(-180.0), Le(180.0)]
    altitude_m: Annotated[float, Ge(-500.0), Le(5000.0)]


@checked.dataclass(frozen=True, config=STRICT)
class Wind:
    """Velocity of the air over the ground."""

    north_mps: Annotated[float, Ge(-15.0), Le(15.0)] = 0.0
    east_mps: Annotated[float, Ge(-15.0), Le(15.0)] = 0.0


@checked.dataclass(frozen=True, config=STRICT)
class Waypoint:
    """A place relative to home."""

    north_m: float
    east_m: float
    height_m: Annotated[float, Ge(0.0), Le(5000.0)]


@checked.dataclass(frozen=True, config=STRICT)
class MissionPlan:
    """A take-off (always item 1) and the waypoints after it."""

    takeoff_height_m: Annotated[float, Gt(0.0), Le(500.0)]
    waypoints: Annotated[tuple[Waypoint, ...], Len(1)]


@checked.dataclass(frozen=True, config=STRICT)
class Start:
    """On the ground at home, or in the air at a place, on the way to the first waypoint.

    `heading_deg` is where the runway points, or the course in the air.
    """

    where: Literal["ground", "air"] = "ground"
    heading_deg: Annotated[float, Ge(0.0), Lt(360.0)] = 0.0
    north_m: float = 0.0
    east_m: float = 0.0
    height_m: Annotated[float, Ge(0.0), Le(5000.0)] = 0.0


@checked.dataclass(frozen=True, config=STRICT)
class Conflict:
    """An intruder by the closest approach it would have to the vehicle on its undisturbed mission.

    `meet_at_s` counts from the start of the scenario. `from_deg` is the direction it comes from, relative to
    our course at that moment and clockwise: 0 head-on, 90 from the right, 180 from behind. It passes `miss_m`
    to the right of us (negative: left) and `miss_height_m` above.
    """

    icao: str
    callsign: Annotated[str, Len(1, 8)]
    meet_at_s: Annotated[float, Ge(0.0)]
    from_deg: Annotated[float, Ge(-360.0), Le(360.0)]
    speed_mps: Annotated[float, Gt(0.0), Le(300.0)]
    climb_mps: Annotated[float, Ge(-30.0), Le(30.0)] = 0.0
    miss_m: float = 0.0
    miss_height_m: float = 0.0

    def __post_init__(self) -> None:
        """Refuse addresses that are not 24 bits in hexadecimal."""
        try:
            address = int(self.icao, 16)
        except ValueError:
            address = -1
        if not 0 < address <= 0xFF_FFFF:
            raise ValueError(f"icao {self.icao!r} is no address of 6 hexadecimal digits")


@checked.dataclass(frozen=True, config=STRICT)
class Receiver:
    """The ADS-B receiver; see `ReceiverModel`."""

    horizontal_sigma_m: Annotated[float, Ge(0.0)] = 0.0
    vertical_sigma_m: Annotated[float, Ge(0.0)] = 0.0
    speed_sigma_mps: Annotated[float, Ge(0.0)] = 0.0
    climb_sigma_mps: Annotated[float, Ge(0.0)] = 0.0
    delay_s: Annotated[float, Ge(0.0), Le(10.0)] = 0.0
    loss: Annotated[float, Ge(0.0), Le(1.0)] = 0.0
    range_m: Annotated[float, Gt(0.0)] = 20_000.0
    flags: Annotated[int, Ge(0), Le(65_535)] = ALL_VALID
    barometric: bool = False
    altitude_offset_m: float = 0.0


@checked.dataclass(frozen=True, config=STRICT)
class Scenario:
    """All of a scenario file."""

    description: str
    duration_s: Annotated[float, Gt(0.0), Le(7200.0)]
    home: Home
    mission: MissionPlan
    start: Start = field(default_factory=Start)
    wind: Wind = field(default_factory=Wind)
    intruders: tuple[Conflict, ...] = ()
    receiver: Receiver = field(default_factory=Receiver)

    def __post_init__(self) -> None:
        """Refuse what cannot be built: two aircraft of one address, meetings after the end."""
        addresses = [int(conflict.icao, 16) for conflict in self.intruders]
        if len(set(addresses)) < len(addresses):
            raise ValueError("intruders: two of them have the same icao")
        for conflict in self.intruders:
            if conflict.meet_at_s > self.duration_s:
                raise ValueError(f"intruders: {conflict.callsign} meets us after duration_s")

    @property
    def home_place(self) -> GeoPoint:
        """Home as a place."""
        return GeoPoint(self.home.lat_deg, self.home.lon_deg, self.home.altitude_m)

    @property
    def frame(self) -> LocalFrame:
        """The local frame around home in which everything moves."""
        return LocalFrame(self.home.lat_deg, self.home.lon_deg)

    @property
    def items(self) -> list[MissionItem]:
        """The mission for the vehicle."""
        places = [self.place(w.north_m, w.east_m, w.height_m) for w in self.mission.waypoints]
        return [takeoff_item(self.mission.takeoff_height_m), *map(waypoint_item, places)]

    def place(self, north_m: float, east_m: float, height_m: float) -> GeoPoint:
        """A place relative to home."""
        return self.frame.to_geo(north_m, east_m, -(self.home.altitude_m + height_m))


@dataclass(frozen=True, slots=True)
class World:
    """A scenario come alive at `start_s`: the vehicle already on its way, the traffic, and who hears it."""

    start_s: float
    frame: LocalFrame
    vehicle: FakeVehicle
    intruders: tuple[Intruder, ...]
    receiver: AdsbReceiver


def scenario_names() -> list[str]:
    """The scenarios that come with the project."""
    return sorted(path.stem for path in SCENARIO_FOLDER.glob("*.yaml"))


def load_scenario(name_or_path: str | Path) -> Scenario:
    """Read a scenario by name or from a file; `ConfigError` says which file and key."""
    path = Path(name_or_path)
    if path.suffix not in (".yaml", ".yml"):
        path = SCENARIO_FOLDER / f"{name_or_path}.yaml"
        if not path.is_file():
            known = ", ".join(scenario_names()) or "none installed"
            raise ConfigError(f"{name_or_path}: no such scenario; there are: {known}")
    return read_checked(path, Scenario)


def make_vehicle(scenario: Scenario, start_s: float, autopilot: Autopilot = "ardupilot") -> FakeVehicle:
    """The scenario's vehicle on its mission and armed: about to take off, or in the air on the way."""
    start = scenario.start
    heading_rad = math.radians(start.heading_deg)
    kind = FakePx4 if autopilot == "px4" else FakeArduPlane
    options: dict[str, Any] = {
        "mission": scenario.items,
        "wind_mps": (scenario.wind.north_mps, scenario.wind.east_mps),
        "parameters": _PX4_PARAMETERS if autopilot == "px4" else {},
    }
    if start.where == "air":
        return kind.airborne(
            scenario.home_place,
            start_s,
            position=scenario.place(start.north_m, start.east_m, start.height_m),
            course_rad=heading_rad,
            sequence=kind.first_item + 1,
            **options,
        )
    vehicle = kind(scenario.home_place, start_s, heading_rad=heading_rad, **options)
    vehicle.start_mission()
    vehicle.arm()
    return vehicle


def build_world(
    scenario: Scenario, start_s: float, *, seed: int = 0, autopilot: Autopilot = "ardupilot"
) -> World:
    """The vehicle and its traffic. The intruders are aimed at where the undisturbed vehicle will be."""
    scout = make_vehicle(scenario, start_s, autopilot)
    aimed: dict[str, Intruder] = {}
    for conflict in sorted(scenario.intruders, key=lambda c: c.meet_at_s):
        scout.step(start_s + conflict.meet_at_s)
        aimed[conflict.icao] = aim(conflict, scout.truth)
    intruders = tuple(aimed[conflict.icao] for conflict in scenario.intruders)
    receiver = AdsbReceiver(
        intruders, scenario.frame, start_s, model=_receiver_model(scenario.receiver), seed=seed
    )
    vehicle = make_vehicle(scenario, start_s, autopilot)
    return World(start_s, scenario.frame, vehicle, intruders, receiver)


def aim(conflict: Conflict, truth: Truth) -> Intruder:
    """The intruder that is closest to the vehicle when that is where `truth` says, both flying straight."""
    own_north_mps, own_east_mps, _ = truth.velocity_mps
    own_course_rad = math.atan2(own_east_mps, own_north_mps)
    course_rad = own_course_rad + math.radians(conflict.from_deg) + math.pi
    north_mps = conflict.speed_mps * math.cos(course_rad)
    east_mps = conflict.speed_mps * math.sin(course_rad)
    aside_n, aside_e = _aside(north_mps - own_north_mps, east_mps - own_east_mps, own_course_rad)
    return Intruder(
        icao=int(conflict.icao, 16),
        callsign=conflict.callsign,
        anchor_s=truth.time_s,
        position_m=(
            truth.position_m[0] + conflict.miss_m * aside_n,
            truth.position_m[1] + conflict.miss_m * aside_e,
            truth.position_m[2] - conflict.miss_height_m,
        ),
        velocity_mps=(north_mps, east_mps, -conflict.climb_mps),
    )


def _aside(relative_north_mps: float, relative_east_mps: float, own_course_rad: float) -> Vec2:
    """The unit vector across the relative motion, on our right-hand side: the miss lies along it."""
    speed_mps = math.hypot(relative_north_mps, relative_east_mps)
    right_n, right_e = -math.sin(own_course_rad), math.cos(own_course_rad)
    if speed_mps < 1e-6:
        return right_n, right_e
    across_n, across_e = -relative_east_mps / speed_mps, relative_north_mps / speed_mps
    side = 1.0 if across_n * right_n + across_e * right_e >= 0.0 else -1.0
    return side * across_n, side * across_e


def _receiver_model(receiver: Receiver) -> ReceiverModel:
    return ReceiverModel(
        horizontal_sigma_m=receiver.horizontal_sigma_m,
        vertical_sigma_m=receiver.vertical_sigma_m,
        speed_sigma_mps=receiver.speed_sigma_mps,
        climb_sigma_mps=receiver.climb_sigma_mps,
        delay_s=receiver.delay_s,
        loss=receiver.loss,
        range_m=receiver.range_m,
        flags=receiver.flags,
        barometric=receiver.barometric,
        altitude_offset_m=receiver.altitude_offset_m,
    )


def undisturbed(
    scenario: Scenario, start_s: float = 0.0, period_s: float = 0.1, autopilot: Autopilot = "ardupilot"
) -> Sequence[Truth]:
    """What the vehicle does when nothing disturbs it, for the whole of the scenario."""
    vehicle = make_vehicle(scenario, start_s, autopilot)
    truths = [vehicle.truth]
    for number in range(1, int(scenario.duration_s / period_s) + 1):
        vehicle.step(start_s + number * period_s)
        truths.append(vehicle.truth)
    return truths
