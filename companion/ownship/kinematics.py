"""Position, velocity, airspeed and wind of our aircraft."""

import math

from companion.autopilots.adapter import GuidanceCommand
from companion.geodesy import GeoPoint, LocalFrame
from companion.mavlink.facts import AirData, OwnPosition
from companion.model import Guidance, Ownship, Vec3
from companion.ownship.wind import WindEstimator
from companion.units import wrap_two_pi

_POSITION_LOST_S = 5.0
_OLD_POSITION_S = 0.5
# A slower airspeed is not measured in flight.
_LEAST_AIRSPEED_MPS = 1.0


class Kinematics:
    """The newest position and air data; without a position, velocity and heights are 0."""

    def __init__(self) -> None:
        self.position: OwnPosition | None = None
        self.position_s = -math.inf
        self.wind = WindEstimator()
        self._airspeed_mps: float | None = None
        # By VFR_HUD. It may have an offset, so that only its change since the last position is used.
        self._altitude_m: float | None = None
        self._altitude_at_position_m: float | None = None
        self._altitude_s = -math.inf

    def observe_position(self, fact: OwnPosition, now_s: float) -> None:
        """Store a position, received at `now_s`."""
        self.position, self.position_s = fact, now_s
        self._altitude_at_position_m = self._altitude_m
        self.wind.observe(fact, self._airspeed_mps, now_s)

    def observe_air_data(self, fact: AirData, now_s: float) -> None:
        """Store airspeed and altitude."""
        self._airspeed_mps = fact.airspeed_mps
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

    def airspeed_mps(self) -> float:
        """Airspeed; ground speed where no airspeed is measured."""
        if self._airspeed_mps is not None and self._airspeed_mps > _LEAST_AIRSPEED_MPS:
            return self._airspeed_mps
        return math.hypot(*self.velocity_mps()[:2])

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
        return GuidanceCommand(guidance, place, self.velocity_mps(), self.airspeed_mps(), max_bank_rad)

    def _climbed_since_position_m(self) -> float:
        """The climb since the last position by VFR_HUD, if that position is old; otherwise 0."""
        if self._altitude_m is None or self._altitude_at_position_m is None:
            return 0.0
        is_old = self._altitude_s - self.position_s > _OLD_POSITION_S
        return self._altitude_m - self._altitude_at_position_m if is_old else 0.0
