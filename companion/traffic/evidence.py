"""Evidence: what a target is, by its place and motion first, then by what it says of itself.

What moves fast or is far above the ground flies, whatever its category or its "on the ground" says. What
stands still at the height of our home for some time is on the ground. Where the height is uncertain, it
flies.
"""

import math
from typing import Final, NamedTuple

from companion.geodesy import LocalFrame
from companion.model import LatLon, TrafficKind
from companion.traffic.altitudes import SeaLevelAltitude

# Faster than vehicles on the surface: 108 km/h; than aircraft that taxi.
_FASTER_THAN_VEHICLES_MPS, _FASTER_THAN_TAXIING_MPS = 30.0, 20.0
# Above home by more than the ground usually is, for what moves and for what does not.
_ABOVE_GROUND_M, _FAR_ABOVE_GROUND_M = 30.0, 100.0
_DRIVING_MPS, _MOVING_MPS = 10.0, 3.0
# Two positions of one place are this far apart at most: three times the error of both.
_DISPLACED_M = 64.0
_DISPLACED_IF_SAID_M, _SAID_MPS = 30.0, 5.0
_DISPLACED_REPORTS = 2
# Parked: this often reported at one place, for this long, at home's height within this, not far from home.
_PARKED_REPORTS, _PARKED_S = 3, 4.0
# What moved before, or states no speed, has to stand for longer.
_STOPPED_S = 20.0
_PARKED_M, _PARKED_WITHIN_M = 15.0, 3_000.0
_PARKED_MPS = 1.5
# A parked aircraft is no threat to one this far above it; if it only says that it stands, this far.
_OVERFLOWN_M, _FAR_BELOW_M = 30.0, 45.0


class Surroundings(NamedTuple):
    """The ground at our home, and our own altitude [m above mean sea level]; `None` where unknown."""

    home_altitude_m: float | None = None
    home: LatLon | None = None
    own_altitude_m: float | None = None


UNKNOWN: Final = Surroundings()


class KindEvidence:
    """What the reports of one target say about its kind."""

    __slots__ = (
        "_at_deg",
        "_displaced",
        "_reports",
        "_since_s",
        "_speed_mps",
        "_stated_mps",
        "moves",
        "on_ground",
        "stated",
        "stated_airborne",
    )

    def __init__(self, stated: TrafficKind) -> None:
        self.stated = stated
        self.stated_airborne = True
        self.moves = False  # its positions do
        self.on_ground = False
        self._at_deg: LatLon | None = None  # where it stands
        self._since_s = 0.0
        self._reports = 0
        self._displaced = 0
        self._speed_mps = 0.0
        self._stated_mps: float | None = None

    def observe(
        self, time_s: float, place_deg: LatLon, stated_mps: float | None, estimated_mps: float
    ) -> None:
        """Process a position, with the speed that the report states and the estimated one."""
        self._speed_mps, self._stated_mps = estimated_mps, stated_mps
        if self._at_deg is None:
            self._stand(time_s, place_deg)
            return
        said = stated_mps is not None and stated_mps > _SAID_MPS
        if self.moves and said:
            return
        off_m = _distance_m(self._at_deg, place_deg)
        if off_m > (_DISPLACED_IF_SAID_M if said else _DISPLACED_M):
            self._displaced += 1
            if self._displaced >= _DISPLACED_REPORTS:
                self.moves = True
                self._stand(time_s, place_deg)
        else:
            self._displaced = 0
            self._reports += 1
        if stated_mps is not None and stated_mps > _MOVING_MPS:
            self._stand(time_s, place_deg if self.moves else self._at_deg)

    def observe_again(self) -> None:
        """Count a repetition of the last report: it still stands there, if it says so."""
        self._reports += 1

    def _stand(self, time_s: float, place_deg: LatLon) -> None:
        self._at_deg, self._since_s, self._reports = place_deg, time_s, 1

    def judge(self, now_s: float, altitude: SeaLevelAltitude | None, around: Surroundings) -> TrafficKind:
        """The kind; `on_ground` is whether it is an aircraft on the ground."""
        above_m = None
        if altitude is not None and around.home_altitude_m is not None:
            above_m = altitude.altitude_m - around.home_altitude_m
        surely_above_m = 0.0
        if altitude is not None and above_m is not None:
            surely_above_m = above_m - altitude.uncertainty_m
        speed_mps, stated = self._speed_mps, self.stated
        self.on_ground = False
        if stated is TrafficKind.OBSTACLE:
            return TrafficKind.AIRCRAFT if self.moves else stated
        high = surely_above_m > _FAR_ABOVE_GROUND_M
        if stated is TrafficKind.SURFACE_VEHICLE:
            high |= surely_above_m > _ABOVE_GROUND_M and speed_mps > _DRIVING_MPS
            if high or speed_mps > _FASTER_THAN_VEHICLES_MPS:
                return TrafficKind.AIRCRAFT
            self.on_ground = not self.stated_airborne
            return stated
        if not self.stated_airborne:
            high |= surely_above_m > _ABOVE_GROUND_M and speed_mps > _MOVING_MPS
            self.on_ground = not high and speed_mps <= _FASTER_THAN_TAXIING_MPS
        elif altitude is not None and above_m is not None:
            self.on_ground = self._is_parked(now_s, abs(above_m) + altitude.uncertainty_m, altitude, around)
        return stated

    def _is_parked(
        self, now_s: float, off_m: float, altitude: SeaLevelAltitude, around: Surroundings
    ) -> bool:
        """Whether it has stood at home's height for some time, at most `off_m` from it, and we are above."""
        if off_m > _PARKED_M:
            return False
        below_m = math.inf if around.own_altitude_m is None else around.own_altitude_m - altitude.altitude_m
        stands = self._stated_mps is not None and not self.moves
        if not (stands and below_m > _FAR_BELOW_M):
            least_s = _PARKED_S if stands else _STOPPED_S
            if self._reports < _PARKED_REPORTS or now_s - self._since_s < least_s:
                return False
        if (self._stated_mps or 0.0) > _PARKED_MPS or self._speed_mps > _MOVING_MPS or self._at_deg is None:
            return False
        if around.home is not None and _distance_m(around.home, self._at_deg) > _PARKED_WITHIN_M:
            return False
        return below_m > _OVERFLOWN_M


def _distance_m(one: LatLon, other: LatLon) -> float:
    north_m, east_m = LocalFrame(*one).to_north_east_m(*other)
    return float((north_m**2 + east_m**2) ** 0.5)
