"""The stored mission: ArduPilot keeps home as item 0 and flies from item 1, PX4 flies from item 0."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from companion.geodesy import GeoPoint

NAV_WAYPOINT = 16
NAV_LOITER_UNLIM = 17
NAV_LOITER_TURNS = 18
NAV_LOITER_TIME = 19
NAV_RETURN_TO_LAUNCH = 20
NAV_LAND = 21
NAV_TAKEOFF = 22
DO_JUMP = 177
DO_CHANGE_SPEED = 178

LOITERS = frozenset({NAV_LOITER_UNLIM, NAV_LOITER_TURNS, NAV_LOITER_TIME})
NAVIGATION = LOITERS | {NAV_WAYPOINT, NAV_RETURN_TO_LAUNCH, NAV_LAND, NAV_TAKEOFF}
SUPPORTED = NAVIGATION | {DO_JUMP, DO_CHANGE_SPEED}
_FOR_EVER = -1

# MAV_FRAME, in pairs of float and integer coordinates
ABSOLUTE_FRAMES = frozenset({0, 5})
RELATIVE_FRAMES = frozenset({3, 6})
TERRAIN_FRAMES = frozenset({10, 11})  # no terrain here: taken as height above home
GLOBAL_FRAMES = ABSOLUTE_FRAMES | RELATIVE_FRAMES | TERRAIN_FRAMES

_NAMES = {
    NAV_WAYPOINT: "WP",
    NAV_LOITER_UNLIM: "LoitUnlim",
    NAV_LOITER_TURNS: "LoitTurns",
    NAV_LOITER_TIME: "LoitTime",
    NAV_RETURN_TO_LAUNCH: "RTL",
    NAV_LAND: "Land",
    NAV_TAKEOFF: "Takeoff",
    DO_JUMP: "Jump",
    DO_CHANGE_SPEED: "SetSpeed",
}


@dataclass(frozen=True, slots=True)
class MissionItem:
    """One item: command, its first four parameters, and a place; `frame` defines its height."""

    command: int
    params: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    lat_e7: int = 0
    lon_e7: int = 0
    altitude_m: float = 0.0
    frame: int = 3
    autocontinue: int = 1

    @property
    def name(self) -> str:
        """ArduPlane's name of the command in its texts."""
        return _NAMES.get(self.command, str(self.command))

    def altitude_amsl_m(self, home_altitude_m: float) -> float:
        """Height above mean sea level."""
        return self.altitude_m + (0.0 if self.frame in ABSOLUTE_FRAMES else home_altitude_m)

    def place_or_zero(self) -> GeoPoint:
        """Its latitude and longitude unchanged, its height in its own frame."""
        return GeoPoint(self.lat_e7 / 1e7, self.lon_e7 / 1e7, self.altitude_m)

    def place(self, here: GeoPoint, home_altitude_m: float) -> GeoPoint:
        """Its place; latitude and longitude 0 mean "here", as in ArduPilot."""
        altitude_m = self.altitude_amsl_m(home_altitude_m)
        if self.lat_e7 == 0 and self.lon_e7 == 0:
            return GeoPoint(here.lat_deg, here.lon_deg, altitude_m)
        return GeoPoint(self.lat_e7 / 1e7, self.lon_e7 / 1e7, altitude_m)


def home_item(home: GeoPoint) -> MissionItem:
    """Item 0 of an ArduPilot mission."""
    return MissionItem(
        NAV_WAYPOINT,
        lat_e7=round(home.lat_deg * 1e7),
        lon_e7=round(home.lon_deg * 1e7),
        altitude_m=home.altitude_m,
        frame=0,
    )


def waypoint_item(place: GeoPoint, *, acceptance_m: float = 0.0) -> MissionItem:
    """A waypoint at an absolute height."""
    return MissionItem(
        NAV_WAYPOINT,
        params=(0.0, acceptance_m, 0.0, 0.0),
        lat_e7=round(place.lat_deg * 1e7),
        lon_e7=round(place.lon_deg * 1e7),
        altitude_m=place.altitude_m,
        frame=0,
    )


def takeoff_item(height_m: float, *, pitch_deg: float = 15.0) -> MissionItem:
    """A take-off to a height above home."""
    return MissionItem(NAV_TAKEOFF, params=(pitch_deg, 0.0, 0.0, 0.0), altitude_m=height_m)


class Mission:
    """The items, the current one, and whether the last waypoint was reached."""

    def __init__(self, home: GeoPoint, items: Sequence[MissionItem] = (), *, has_home: bool = True) -> None:
        """`items` without home; home becomes item 0 if the autopilot keeps it (`has_home`)."""
        self._home = home_item(home)
        self._has_home = has_home
        self.first = 1 if has_home else 0
        self.items: list[MissionItem] = [*([self._home] if has_home else []), *items] if items else []
        self.current = 0
        self.completed = False
        self._jumped: dict[int, int] = {}  # how often each DO_JUMP was executed

    @property
    def total(self) -> int:
        """Number of items without home: MISSION_CURRENT.total."""
        return max(len(self.items) - self.first, 0)

    @property
    def active(self) -> MissionItem | None:
        """The current item; None before the start, after the end and without a mission."""
        return self.items[self.current] if self.first <= self.current < len(self.items) else None

    def replace(self, items: Sequence[MissionItem]) -> None:
        """Store an uploaded list (the vehicle's home replaces the one in it); the mission starts over."""
        self.items = [self._home, *items[1:]] if items and self._has_home else list(items)
        self.current = 0
        self.completed = False
        self._jumped.clear()

    def item_at(self, sequence: int) -> MissionItem | None:
        """The item with that number; with `has_home`, item 0 exists in an empty mission too."""
        if sequence == 0 and self._has_home:
            return self._home
        return self.items[sequence] if 0 <= sequence < len(self.items) else None

    def select(self, sequence: int) -> bool:
        """Make that item the current one; False if it does not exist."""
        if not 0 <= sequence < len(self.items):
            return False
        self.current = sequence
        self.completed = False
        return True

    def advance(self) -> MissionItem | None:
        """The next item, None at the end. The mission is completed after its last waypoint."""
        self.current += 1
        following = self.items[self.current :]
        self.completed = bool(self.items) and not any(
            i.command in (NAV_WAYPOINT, NAV_LAND) for i in following
        )
        return following[0] if following else None

    def jump(self) -> MissionItem | None:
        """Execute the current DO_JUMP: the item that follows by it, `None` at the end."""
        target = self.target_of_jump(self.current)
        if target is None:
            return self.advance()
        self._jumped[self.current] = self._jumped.get(self.current, 0) + 1
        self.select(target)
        return self.items[target]

    def target_of_jump(self, sequence: int) -> int | None:
        """The item that a DO_JUMP leads to; `None` when it is not executed any more, or is no jump."""
        item = self.items[sequence]
        if item.command != DO_JUMP or not 0 <= int(item.params[0]) < len(self.items):
            return None
        count = int(item.params[1])
        over = count != _FOR_EVER and self._jumped.get(sequence, 0) >= count
        return None if over else int(item.params[0])

    def rewind(self) -> None:
        """Restart at the first item."""
        self._jumped.clear()
        self.current = self.first - 1
        self.advance()

    def next_navigation(self) -> MissionItem | None:
        """The navigation item after the active one, for turning early."""
        at = self.current + 1
        for _ in self.items:
            if at >= len(self.items):
                return None
            if self.items[at].command in NAVIGATION:
                return self.items[at]
            target = self.target_of_jump(at)
            at = at + 1 if target is None else target
        return None

    def airspeed_mps(self) -> float | None:
        """The airspeed of the last DO_CHANGE_SPEED before the current item, in the list's order."""
        changes = [item for item in self.items[: self.current] if item.command == DO_CHANGE_SPEED]
        return changes[-1].params[1] if changes and changes[-1].params[0] == 0.0 else None


def is_sane(item: MissionItem) -> bool:
    """True if all numbers are finite and the place is on Earth."""
    numbers = (item.altitude_m, *item.params)
    in_range = abs(item.lat_e7) <= 900_000_000 and abs(item.lon_e7) <= 1_800_000_000
    return in_range and all(math.isfinite(n) for n in numbers)
