"""Scenario files: a mission and the conflicts on it, read from YAML."""

from collections.abc import Sequence
from dataclasses import field
from pathlib import Path
from typing import Annotated, Literal

from annotated_types import Ge, Gt, Le, Len, Lt
from pydantic import dataclasses as checked

from companion.errors import ConfigError
from companion.geodesy import GeoPoint, LocalFrame
from sim.files import STRICT, has_key, names_in, read_named
from sim.receivers.mavlink import ALL_VALID
from sim.vehicle import MissionItem, takeoff_item, waypoint_item

SCENARIO_FOLDER = Path(__file__).with_name("scenarios")
FORMATION_FOLDER = SCENARIO_FOLDER / "formations"
DEFAULT_SCENARIO = "two-intruders"

# "px4" is 1.16, which is flown in OFFBOARD; 1.18 in GUIDED_COURSE.
Autopilot = Literal["ardupilot", "px4", "px4-1.18"]


@checked.dataclass(frozen=True, config=STRICT)
class Home:
    """The home position; heights in the file are above it."""

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
    """A take-off (always the first item) and the waypoints after it."""

    takeoff_height_m: Annotated[float, Gt(0.0), Le(500.0)]
    waypoints: Annotated[tuple[Waypoint, ...], Len(1)]


@checked.dataclass(frozen=True, config=STRICT)
class Start:
    """On the ground at home, or in the air at a place, on the way to the first waypoint.

    `heading_deg` is the runway's direction, or the course in the air.
    """

    where: Literal["ground", "air"] = "ground"
    heading_deg: Annotated[float, Ge(0.0), Lt(360.0)] = 0.0
    north_m: float = 0.0
    east_m: float = 0.0
    height_m: Annotated[float, Ge(0.0), Le(5000.0)] = 0.0


@checked.dataclass(frozen=True, config=STRICT)
class Conflict:
    """An intruder, defined by its closest approach to the vehicle on its undisturbed mission.

    `meet_at_s` counts from the start of the scenario. `from_deg` is the direction it comes from, relative to
    our course at that moment and clockwise: 0 head-on, 90 from the right, 180 from behind. It passes `miss_m`
    to our right (negative: left) and `miss_height_m` above us.
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
        """Refuse an address that is not 24 bits in hexadecimal."""
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
    """The content of a scenario file."""

    description: str
    duration_s: Annotated[float, Gt(0.0), Le(7200.0)]
    home: Home
    mission: MissionPlan
    start: Start = field(default_factory=Start)
    wind: Wind = field(default_factory=Wind)
    intruders: tuple[Conflict, ...] = ()
    receiver: Receiver = field(default_factory=Receiver)

    def __post_init__(self) -> None:
        """Refuse intruders that do not fit."""
        check_conflicts(self.intruders, self.duration_s)

    @property
    def home_place(self) -> GeoPoint:
        """Home as a place."""
        return GeoPoint(self.home.lat_deg, self.home.lon_deg, self.home.altitude_m)

    @property
    def frame(self) -> LocalFrame:
        """The local frame around home, common to all aircraft."""
        return LocalFrame(self.home.lat_deg, self.home.lon_deg)

    @property
    def items(self) -> list[MissionItem]:
        """The mission items for the vehicle."""
        places = [self.place(w.north_m, w.east_m, w.height_m) for w in self.mission.waypoints]
        return [takeoff_item(self.mission.takeoff_height_m), *map(waypoint_item, places)]

    def place(self, north_m: float, east_m: float, height_m: float) -> GeoPoint:
        """A place relative to home."""
        return self.frame.to_geo(north_m, east_m, -(self.home.altitude_m + height_m))


def check_conflicts(conflicts: Sequence[Conflict], duration_s: float) -> None:
    """Refuse two aircraft with one address, and meetings after the end, by `ValueError`."""
    addresses = [int(conflict.icao, 16) for conflict in conflicts]
    if len(set(addresses)) < len(addresses):
        raise ValueError("intruders: two of them have the same icao")
    for conflict in conflicts:
        if conflict.meet_at_s > duration_s:
            raise ValueError(f"intruders: {conflict.callsign} meets us after duration_s")


def scenario_names() -> list[str]:
    """Names of the scenarios of one vehicle that come with the project."""
    return names_in(SCENARIO_FOLDER)


def load_scenario(name_or_path: str | Path) -> Scenario:
    """Read a scenario of one vehicle by name or from a file; `ConfigError` names file and key."""
    if has_members(name_or_path):
        raise ConfigError(f"{name_or_path}: a scenario of a formation, which only `companion-sim demo` flies")
    return read_named(name_or_path, SCENARIO_FOLDER, Scenario, "scenario")


def has_members(name_or_path: str | Path) -> bool:
    """Whether a scenario, by name or file, is one of a formation."""
    path = Path(name_or_path)
    if path.suffix in (".yaml", ".yml"):
        return has_key(path, "formation")
    return str(name_or_path) in names_in(FORMATION_FOLDER)
