"""Kinematics of our aircraft: its position and motion, the wind around it and the terrain below it."""

import math

from companion.autopilots.adapter import GuidanceCommand
from companion.geodesy import GeoPoint, LocalFrame, wrap_two_pi
from companion.mavlink.facts import AirData, OwnPosition, TerrainReport, Wind
from companion.model import Guidance, Ownship, Vec2, Vec3

# Time constant of the wind estimate: longer than a gust or the swing of the nose.
_WIND_TIME_CONSTANT_S = 10.0
_WIND_REPORT_FRESH_S = 5.0
# The wind estimate is updated with every position, unless airspeed or heading is missing.
_WIND_ESTIMATE_FRESH_S = 30.0
# A wind estimate above this share of the airspeed comes from a wrong airspeed, as on the ground.
_LARGEST_WIND_SHARE = 0.6
# Wind reports come from a filter that has observed turns, and may be stronger; this is hurricane force.
_STRONGEST_REPORTED_WIND_MPS = 40.0
_TERRAIN_FRESH_S = 10.0
# Ground stations request the terrain of other places too; the reports differ only in their place.
_HERE_M = 300.0
_POSITION_LOST_S = 5.0
_OLD_POSITION_S = 0.5
# A slower airspeed is not measured in flight.
_LEAST_AIRSPEED_MPS = 1.0
# VFR_HUD comes four times a second.
_AIR_DATA_FRESH_S = 3.0
# The statement about the sensor, and the wind, come every second; an autopilot that makes none in this time,
# counted from its first airspeed, is believed to have a sensor.
_SENSOR_AWAITED_S = 5.0
# Without a sensor some firmware reports the ground speed as airspeed: it equals the ground speed, and differs
# from what the reported wind makes of it.
_SAME_SPEED_MPS, _CONTRADICTION_MPS = 0.3, 2.0
# An airspeed computed from the wind is believed within these shares of the cruise airspeed.
_PLAUSIBLE_SHARES = 0.6, 1.6


class WindEstimator:
    """The wind: the newest report, and a running estimate."""

    def __init__(self) -> None:
        self._report: Wind | None = None
        self._report_s = -math.inf
        self._estimate: Vec2 | None = None
        self._estimate_s = -math.inf

    def report(self, fact: Wind, now_s: float) -> None:
        """Store a report, unless it is implausible or exactly 0, as ArduPilot sends without an estimate."""
        speed_mps = math.hypot(fact.north_mps, fact.east_mps)
        if 0.0 < speed_mps <= _STRONGEST_REPORTED_WIND_MPS:
            self._report, self._report_s = fact, now_s

    def observe(self, position: OwnPosition, airspeed_mps: float | None, now_s: float) -> None:
        """Update the estimate: velocity over ground minus velocity through the air, smoothed."""
        if airspeed_mps is None or position.heading_rad is None or airspeed_mps < 1.0:
            return
        north = position.velocity_mps[0] - airspeed_mps * math.cos(position.heading_rad)
        east = position.velocity_mps[1] - airspeed_mps * math.sin(position.heading_rad)
        if self._estimate is None or not 0.0 <= now_s - self._estimate_s <= _WIND_ESTIMATE_FRESH_S:
            self._estimate = north, east
        else:
            share = 1.0 - math.exp((self._estimate_s - now_s) / _WIND_TIME_CONSTANT_S)
            known = self._estimate
            self._estimate = known[0] + share * (north - known[0]), known[1] + share * (east - known[1])
        self._estimate_s = now_s

    def reported_mps(self, now_s: float) -> Vec2 | None:
        """The wind of a fresh report, north and east; `None` without one."""
        report = self._report
        if report is None or not 0.0 <= now_s - self._report_s <= _WIND_REPORT_FRESH_S:
            return None
        return report.north_mps, report.east_mps

    def wind_mps(self, airspeed_mps: float, now_s: float) -> Vec2 | None:
        """Velocity of the air over the ground, north and east; `None` when unknown or too strong.

        A fresh report takes precedence over the estimate.
        """
        reported = self.reported_mps(now_s)
        if reported is not None:
            # The prediction needs an aircraft that makes headway against the wind.
            return reported if math.hypot(*reported) < airspeed_mps else None
        estimate = self._estimate
        if estimate is None or now_s - self._estimate_s > _WIND_ESTIMATE_FRESH_S:
            return None
        return estimate if math.hypot(*estimate) <= _LARGEST_WIND_SHARE * airspeed_mps else None


class Terrain:
    """The height of the terrain below the aircraft, from the newest report."""

    def __init__(self) -> None:
        self._altitude_m = 0.0
        self._at_s = -math.inf

    def observe(self, report: TerrainReport, place: GeoPoint | None, now_s: float) -> None:
        """Store a report, if it is about a place near ours."""
        if place is None:
            return
        here = LocalFrame(place.lat_deg, place.lon_deg)
        away = here.to_ned_m(GeoPoint(report.lat_deg, report.lon_deg, 0.0))
        if math.hypot(away[0], away[1]) > _HERE_M:
            return
        # The autopilot corrects its height above terrain for the error of its altitude against the map.
        self._altitude_m = max(report.terrain_altitude_m, place.altitude_m - report.height_above_terrain_m)
        self._at_s = now_s

    def altitude_m(self, now_s: float) -> float | None:
        """Height of the terrain above mean sea level; `None` when it is unknown."""
        return self._altitude_m if 0.0 <= now_s - self._at_s <= _TERRAIN_FRESH_S else None


class Airspeed:
    """The airspeed as reported, and whether a sensor measures it.

    `sensor_usable` is the autopilot's own statement, `None` while unknown; `cruise_mps` is the airspeed that
    the autopilot's parameters prescribe for the cruise.
    """

    def __init__(self) -> None:
        self.sensor_usable: bool | None = None
        self.cruise_mps: float | None = None
        self._reported_mps: float | None = None
        self._reported_s = -math.inf
        self._first_s: float | None = None

    def observe(self, airspeed_mps: float | None, now_s: float) -> None:
        """Store a reported airspeed, `None` when the report has none."""
        if self._first_s is None:
            self._first_s = now_s
        self._reported_mps, self._reported_s = airspeed_mps, now_s

    def reported_mps(self, position: OwnPosition | None, wind_mps: Vec2 | None, now_s: float) -> float | None:
        """The reported airspeed at `now_s`, unless it is known to be none; `wind_mps` is a reported wind."""
        airspeed_mps = self._reported_mps
        if airspeed_mps is None or airspeed_mps <= _LEAST_AIRSPEED_MPS or self.sensor_usable is False:
            return None
        if now_s - self._reported_s > _AIR_DATA_FRESH_S:
            return None
        return None if _is_ground_speed(airspeed_mps, position, wind_mps) else airspeed_mps

    def sensor_awaited(self, now_s: float) -> bool:
        """Whether the autopilot may still say that it has no sensor."""
        if self.sensor_usable is not None or self._first_s is None:
            return False
        return now_s - self._first_s < _SENSOR_AWAITED_S

    def substitute_mps(self, position: OwnPosition | None, wind_mps: Vec2 | None) -> float:
        """The airspeed by the reported wind, otherwise the cruise airspeed, otherwise the ground speed."""
        if position is None:
            return self.cruise_mps or 0.0
        if wind_mps is not None:
            through_air_mps = _through_air_mps(position, wind_mps)
            low, high = _PLAUSIBLE_SHARES
            if self.cruise_mps is None or low <= through_air_mps / self.cruise_mps <= high:
                return through_air_mps
        return self.cruise_mps or math.hypot(*position.velocity_mps[:2])


def _through_air_mps(position: OwnPosition, wind_mps: Vec2) -> float:
    return math.hypot(position.velocity_mps[0] - wind_mps[0], position.velocity_mps[1] - wind_mps[1])


def _is_ground_speed(airspeed_mps: float, position: OwnPosition | None, wind_mps: Vec2 | None) -> bool:
    """Whether a reported airspeed is only the ground speed."""
    if position is None or wind_mps is None:
        return False
    if abs(airspeed_mps - math.hypot(*position.velocity_mps[:2])) > _SAME_SPEED_MPS:
        return False
    return abs(airspeed_mps - _through_air_mps(position, wind_mps)) > _CONTRADICTION_MPS


class Kinematics:
    """The newest position and air data; without a position, velocity and heights are 0."""

    def __init__(self) -> None:
        self.position: OwnPosition | None = None
        self.position_s = -math.inf
        self.wind = WindEstimator()
        self.airspeed = Airspeed()
        # From VFR_HUD. It may have an offset, so that only its change since the last position is used.
        self._altitude_m: float | None = None
        self._altitude_at_position_m: float | None = None
        self._altitude_s = -math.inf

    def observe_position(self, fact: OwnPosition, now_s: float) -> None:
        """Store a position, received at `now_s`."""
        self.position, self.position_s = fact, now_s
        self._altitude_at_position_m = self._altitude_m
        airspeed_mps = self._reported_airspeed_mps()
        # Without a sensor the autopilot cruises at about its cruise airspeed.
        self.wind.observe(fact, self.airspeed.cruise_mps if airspeed_mps is None else airspeed_mps, now_s)

    def observe_air_data(self, fact: AirData, now_s: float) -> None:
        """Store airspeed and altitude."""
        self.airspeed.observe(fact.airspeed_mps, now_s)
        self._altitude_m, self._altitude_s = fact.altitude_m, now_s

    def position_lost(self, now_s: float) -> bool:
        """Whether the position is too old for any use."""
        return now_s - self.position_s > _POSITION_LOST_S

    def place(self) -> GeoPoint | None:
        """The position, with height above mean sea level."""
        if self.position is None:
            return None
        return GeoPoint(self.position.lat_deg, self.position.lon_deg, self.position.altitude_m)

    def altitude_m(self) -> float:
        """Height above mean sea level."""
        return 0.0 if self.position is None else self.position.altitude_m

    def home_altitude_m(self) -> float | None:
        """Height of home above mean sea level."""
        if self.position is None:
            return None
        return self.position.altitude_m - self.position.height_above_home_m

    def velocity_mps(self) -> Vec3:
        """Velocity over ground, north-east-down."""
        return (0.0, 0.0, 0.0) if self.position is None else self.position.velocity_mps

    def course_rad(self) -> float:
        """Course over ground in [-pi, pi]."""
        north_mps, east_mps, _ = self.velocity_mps()
        return math.atan2(east_mps, north_mps)

    @property
    def airspeed_measured(self) -> bool:
        """Whether the airspeed is measured by a sensor."""
        return self.measured_airspeed_mps() is not None

    def measured_airspeed_mps(self) -> float | None:
        """Airspeed as a sensor measures it; `None` without one: then no speed may be commanded."""
        return None if self.airspeed.sensor_awaited(self.position_s) else self._reported_airspeed_mps()

    def airspeed_mps(self) -> float:
        """Airspeed for predictions: as reported, or what the wind or the cruise airspeed make likely.

        Ground speed is used only where nothing else is known: in a wind it is no airspeed.
        """
        reported_mps = self._reported_airspeed_mps()
        if reported_mps is not None:
            return reported_mps
        return self.airspeed.substitute_mps(self.position, self.wind.reported_mps(self.position_s))

    def _reported_airspeed_mps(self) -> float | None:
        wind_mps = self.wind.reported_mps(self.position_s)
        return self.airspeed.reported_mps(self.position, wind_mps, self.position_s)

    def ownship(self, frame: LocalFrame) -> Ownship | None:
        """Ownship in the local frame, valid at the time when the position was received."""
        position, place = self.position, self.place()
        if position is None or place is None:
            return None
        return Ownship(
            time_s=self.position_s,
            position_m=frame.to_ned_m(place),
            velocity_mps=position.velocity_mps,
            airspeed_mps=self.airspeed_mps(),
            heading_rad=self.course_rad() if position.heading_rad is None else position.heading_rad,
            wind_mps=self.wind.wind_mps(self.airspeed_mps(), self.position_s),
        )

    def guidance(self) -> Guidance:
        """The present course, airspeed and height."""
        return Guidance(wrap_two_pi(self.course_rad()), self.airspeed_mps(), self.altitude_m())

    def command(self, guidance: Guidance, max_bank_rad: float) -> GuidanceCommand | None:
        """The guidance with what a setpoint needs besides; `None` without a position."""
        position = self.position
        if position is None:
            return None
        altitude_m = position.altitude_m + self._climbed_since_position_m()
        place = GeoPoint(position.lat_deg, position.lon_deg, altitude_m)
        airspeed_mps = self.measured_airspeed_mps()
        return GuidanceCommand(guidance, place, self.velocity_mps(), airspeed_mps, max_bank_rad)

    def _climbed_since_position_m(self) -> float:
        """The climb since the last position [m] from VFR_HUD, if that position is old; otherwise 0."""
        if self._altitude_m is None or self._altitude_at_position_m is None:
            return 0.0
        is_old = self._altitude_s - self.position_s > _OLD_POSITION_S
        return self._altitude_m - self._altitude_at_position_m if is_old else 0.0
