"""Evidence: what a target is, by its place and motion first, then by what it says of itself.

What moves fast or is far above the ground flies, whatever its category or its "on the ground" says. What
stands still at the height of our home for some time is on the ground. Where the height is uncertain, it
flies.

A stated rate (velocity, climb) counts while it agrees with the positions: their residuals against the
integral of the stated rate are fitted by a line, whose slope is the error of the rate. The noise of positions
differs between senders, so that its variance is estimated with the slope, from an inverse-gamma prior (Gelman
et al., Bayesian Data Analysis, 3rd ed. 2013, 14.2).
"""

import math
from typing import Final, NamedTuple

from companion.geodesy import LocalFrame
from companion.model import LatLon, TrafficKind
from companion.traffic.altitude_datums import SeaLevelAltitude

# Noise of positions and altitudes of which little is known yet: the filters', and more for coarse senders.
NOISE_SHARE: Final = 4.0 / 3.0
_MOST_POINTS, _LEAST_POINTS = 8, 3
# The first points are near each other, so that an error is found soon; the others reach further back.
_SPACING_S, _CLOSE_POINTS = 0.5, 4
_LONGEST_GAP_S: Final = 12.0
_LONGEST_S: Final = 30.0
# Weight of the prior, in degrees of freedom: of the usual noise, and of what was learnt of the sender's.
_PRIOR_FREEDOM, _LEARNT_FREEDOM = 4.0, 24.0
# One in ten thousand windows of a correct rate has a larger slope, in standard deviations (two axes).
# Later ones, of which there are many, must be clearer by the second number for each point.
_SIGNIFICANT, _MORE_SIGNIFICANT = 4.3, 0.4
# Time stamps are off by one or two seconds, evenly: the position along the path by this much of a second's
# way.
_TIMING_S: Final = 0.55
_WRONG_SHARE, _RIGHT_SHARE = 0.25, 0.15
# Most rates are right: then all points are compared only so often.
_SKIPPED, _PLAINLY_SHARE = 4, 0.5
# A line through so many places continues within so many sigmas, and as far as the aircraft can turn away.
_LINE_POINTS, _LINE_SIGMAS, _ACCELERATION_MPS2 = 4, 3.0, 5.0
# A rate that was wrong must agree for this long.
_REGAINED_S: Final = 15.0


class _Point(NamedTuple):
    time_s: float
    residual: complex
    place: tuple[float, ...]


class StatedRate:
    """A stated rate along two axes (north, east as one complex number) or one (the imaginary part is 0)."""

    __slots__ = (
        "_axes",
        "_floor_mps",
        "_integral",
        "_last",
        "_learnt_m2",
        "_learnt_windows",
        "_points",
        "_right_since_s",
        "_sigma_m",
        "_skipped",
        "trusted",
    )

    def __init__(self, sigma_m: float, floor_mps: float, axes: int) -> None:
        self._sigma_m, self._floor_mps, self._axes = sigma_m, floor_mps, axes
        self._points: list[_Point] = []
        self._integral = 0j
        self._last: tuple[float, complex] | None = None  # time and stated rate of the last report
        self._right_since_s: float | None = None
        self._learnt_m2, self._learnt_windows = 0.0, 0.0
        self._skipped = 0
        self.trusted = True

    @property
    def places(self) -> list[tuple[float, ...]]:
        """Time and place of the reports that are compared, the oldest first."""
        return [(point.time_s, *point.place) for point in self._points]

    def continues(self, time_s: float, place: tuple[float, float]) -> bool:
        """Whether a place (latitude, longitude) is on the line of the last ones, whatever rate is stated."""
        if len(self._points) < 2:
            return False
        first, last = self._points[-min(len(self._points), _LINE_POINTS)], self._points[-1]
        elapsed_s = time_s - last.time_s
        if not 0.0 <= elapsed_s <= _LONGEST_GAP_S:
            return False
        share = elapsed_s / (last.time_s - first.time_s)
        frame = LocalFrame(last.place[0], last.place[1])
        back_m = complex(*frame.to_north_east_m(first.place[0], first.place[1]))
        off_m = complex(*frame.to_north_east_m(*place)) + share * back_m
        noise_m = self._sigma_m * math.sqrt(1.0 + (1.0 + share) ** 2 + share**2)
        return abs(off_m) <= _LINE_SIGMAS * noise_m + 0.5 * _ACCELERATION_MPS2 * elapsed_s**2

    def receive(
        self, time_s: float, position_m: complex, stated_mps: complex | None, place: tuple[float, ...]
    ) -> bool:
        """Compare a position and the stated rate with those before; returns whether the rate is to be used.

        `place` is kept for `places`.
        """
        if stated_mps is None:
            return self.trusted
        last, self._last = self._last, (time_s, stated_mps)
        if last is None or not 0.0 <= time_s - last[0] <= _LONGEST_GAP_S:
            self._points.clear()
            self._integral = position_m
        else:
            self._integral += 0.5 * (last[1] + stated_mps) * (time_s - last[0])
        points = self._points
        spacing_s = _SPACING_S if len(points) < _CLOSE_POINTS else 1.4 * _SPACING_S
        if points and time_s - points[-1].time_s < spacing_s - 1e-3:
            return self.trusted
        while points and (len(points) >= _MOST_POINTS or time_s - points[0].time_s > _LONGEST_S):
            del points[0]
        points.append(_Point(time_s, position_m - self._integral, place))
        if len(points) >= _LEAST_POINTS and not self._is_plainly_right():
            self._judge(time_s, stated_mps)
        return self.trusted

    def _is_plainly_right(self) -> bool:
        """Whether first and last agree, so that only every fourth time all are compared."""
        self._skipped = (self._skipped + 1) % _SKIPPED if self.trusted else 0
        first, last = self._points[0], self._points[-1]
        drift_mps = abs(last.residual - first.residual) / (last.time_s - first.time_s)
        return self._skipped != 0 and drift_mps < _PLAINLY_SHARE * self._floor_mps

    def _judge(self, time_s: float, stated_mps: complex) -> None:
        count = len(self._points)
        middle_s = sum(point.time_s for point in self._points) / count
        mean = sum(point.residual for point in self._points) / count
        spread = sum((point.time_s - middle_s) ** 2 for point in self._points)
        slope = sum((point.time_s - middle_s) * point.residual for point in self._points) / spread
        error_mps, freedom = abs(slope), self._axes * (count - 2)
        faster_mps = max(abs(stated_mps), abs(stated_mps + slope))
        floor_mps = max(self._floor_mps, _WRONG_SHARE * faster_mps)
        scatter = sum(
            abs(point.residual - mean - slope * (point.time_s - middle_s)) ** 2 for point in self._points
        )
        sigma_mps = math.sqrt(self._variance_m2(scatter, freedom, faster_mps) / spread)
        significant = _SIGNIFICANT + _MORE_SIGNIFICANT * max(count - _CLOSE_POINTS - 1, 0)
        if error_mps > floor_mps and error_mps > significant * sigma_mps:
            self.trusted, self._right_since_s = False, None
        elif error_mps > max(self._floor_mps, _RIGHT_SHARE * faster_mps):
            self._right_since_s = None
        elif not self.trusted:
            self._right_since_s = time_s if self._right_since_s is None else self._right_since_s
            if time_s - self._right_since_s >= _REGAINED_S:
                self.trusted = True

    def _variance_m2(self, scatter_m2: float, freedom: int, speed_mps: float) -> float:
        """The variance of a position along each axis, and what is learnt of it from this window."""
        usual_m2 = self._sigma_m**2 + (_TIMING_S * speed_mps) ** 2
        windows = self._learnt_windows
        prior = min(_PRIOR_FREEDOM + windows, _LEARNT_FREEDOM)
        share = windows / (windows + _PRIOR_FREEDOM)
        expected_m2 = usual_m2 + share * (max(self._learnt_m2, 0.5 * usual_m2) - usual_m2)
        if self.trusted and freedom >= self._axes * (_MOST_POINTS - 2):
            self._learnt_windows = min(windows + 1.0, _LEARNT_FREEDOM)
            self._learnt_m2 += (scatter_m2 / freedom - self._learnt_m2) / self._learnt_windows
        return (prior * expected_m2 + scatter_m2) / (prior + freedom)


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
