"""Our aircraft: the autopilot we belong to, and the newest of everything it said."""

import math
from dataclasses import dataclass

from companion.autopilots import Adapter, choose
from companion.geodesy import GeoPoint, LocalFrame
from companion.mavlink.dialect import mavlink
from companion.mavlink.facts import (
    AirData,
    Fact,
    Heartbeat,
    LandedState,
    NavigationTarget,
    OwnPosition,
    Sender,
)
from companion.model import Goal, Ownship, Vec2, Vec3

# Time constant of the wind estimate: longer than a gust or the swing of the nose.
_WIND_TIME_CONSTANT_S = 10.0
_TARGET_FRESH_S = 10.0
# Without heartbeats for so long the autopilot is gone or restarting.
_HEARTBEAT_LOST_S = 5.0
_BLIND_S = 5.0
# Aeroplanes, and those VTOLs that fly as such.
_FIXED_WINGS = frozenset({mavlink.MAV_TYPE_FIXED_WING, *range(19, 26)})


@dataclass(slots=True)
class _Wind:
    north_mps: float
    east_mps: float
    at_s: float


class Aircraft:
    """Adopts the one autopilot that is heard, or the configured one, and keeps to it.

    `autopilot` is a MAV_AUTOPILOT; with it, or a system id, no other is adopted. Without a system id, others
    are waited for: when several are there, none is ours to choose.
    """

    def __init__(
        self, system_id: int | None = None, autopilot: int | None = None, *, adopt_after_s: float = 0.0
    ) -> None:
        self._wanted_system_id = system_id
        self._wanted_autopilot = autopilot
        self._adopt_after_s = adopt_after_s
        self._first_heard_s: float | None = None
        self.adapter: Adapter | None = None
        self.armed = False
        self.custom_mode = 0
        self.heartbeat_s = -math.inf
        self.position: OwnPosition | None = None
        self.position_s = -math.inf
        self.others: set[int] = set()
        self.fixed_wing = False
        self._airspeed_mps: float | None = None
        self._landed_state: int | None = None
        self._target: NavigationTarget | None = None
        self._target_s = -math.inf
        self._wind: _Wind | None = None

    @property
    def sender(self) -> Sender | None:
        """The address of our autopilot."""
        return None if self.adapter is None else self.adapter.target

    @property
    def mode(self) -> str | None:
        """The mode's name."""
        return None if self.adapter is None else self.adapter.mode_name(self.custom_mode)

    @property
    def guided(self) -> bool:
        """Whether it is in the mode that obeys us."""
        return self.adapter is not None and self.adapter.is_guided(self.custom_mode)

    def observe(self, fact: Fact, now_s: float) -> bool:
        """Take a fact in; true when it came from our autopilot."""
        if isinstance(fact, Heartbeat):
            return self._heartbeat(fact, now_s)
        if fact.sender != self.sender:
            return False
        match fact:
            case OwnPosition():
                self.position, self.position_s = fact, now_s
                self._estimate_wind(fact, now_s)
            case AirData():
                self._airspeed_mps = fact.airspeed_mps
            case LandedState():
                self._landed_state = fact.landed_state
            case NavigationTarget():
                # While we fly it, the target is ours and says nothing of the mission.
                if not self.guided:
                    self._target, self._target_s = fact, now_s
            case _:
                pass
        return True

    def enter_mode(self, custom_mode: int, now_s: float) -> None:
        """The autopilot is in this mode: its heartbeat says so, or it accepted our request for it."""
        if self.guided and not (self.adapter is None or self.adapter.is_guided(custom_mode)):
            # The mission's target was not renewed while we flew; it is what is flown to again.
            self._target_s = now_s
        self.custom_mode = custom_mode

    def heard(self, now_s: float) -> bool:
        """Whether the autopilot is there."""
        return now_s - self.heartbeat_s < _HEARTBEAT_LOST_S

    def blind(self, now_s: float) -> bool:
        """Whether own position is too old for anything, and the aircraft better given back."""
        return now_s - self.position_s > _BLIND_S

    def home_altitude_m(self) -> float | None:
        """Height of home above mean sea level."""
        if self.position is None:
            return None
        return self.position.altitude_m - self.position.height_above_home_m

    def flying(self, min_height_m: float) -> bool:
        """Armed, in the air, and neither taking off nor landing."""
        if not self.armed or self.position is None:
            return False
        if self._landed_state not in (None, mavlink.MAV_LANDED_STATE_IN_AIR):
            return False
        return self.position.height_above_home_m >= min_height_m

    def landed(self) -> bool:
        """Disarmed, or known to be on the ground."""
        return not self.armed or self._landed_state == mavlink.MAV_LANDED_STATE_ON_GROUND

    def place(self) -> GeoPoint | None:
        """Where it is."""
        if self.position is None:
            return None
        return GeoPoint(self.position.lat_deg, self.position.lon_deg, self.position.altitude_m)

    def velocity_mps(self) -> Vec3:
        """Velocity over ground, north-east-down."""
        return (0.0, 0.0, 0.0) if self.position is None else self.position.velocity_mps

    def ownship(self, frame: LocalFrame) -> Ownship | None:
        """Ownship in the local frame, valid at the time its position was received."""
        place = self.place()
        if self.position is None or place is None:
            return None
        velocity = self.position.velocity_mps
        return Ownship(
            time_s=self.position_s,
            position_m=frame.to_ned_m(place),
            velocity_mps=velocity,
            airspeed_mps=self._airspeed(),
            heading_rad=self._heading_rad(self.position),
            wind_mps=self._wind_mps(),
        )

    def goal(self, frame: LocalFrame, now_s: float) -> Goal:
        """What the mission wants: the autopilot's own target, or else straight on as it flies now."""
        target = self._target
        speed_mps = self._airspeed()
        if target is not None and now_s - self._target_s < _TARGET_FRESH_S:
            altitude_m = target.altitude_m
            if altitude_m is None and self.position is not None:
                altitude_m = self.position.altitude_m
            position = frame.to_ned_m(GeoPoint(target.lat_deg, target.lon_deg, altitude_m or 0.0))
            return Goal(position_m=position, airspeed_mps=speed_mps, altitude_m=altitude_m)
        north_mps, east_mps, _ = self.velocity_mps()
        altitude_m = None if self.position is None else self.position.altitude_m
        return Goal(course_rad=math.atan2(east_mps, north_mps), airspeed_mps=speed_mps, altitude_m=altitude_m)

    def _heartbeat(self, fact: Heartbeat, now_s: float) -> bool:
        if fact.autopilot == mavlink.MAV_AUTOPILOT_INVALID:
            return False
        if self.adapter is None:
            self._consider(fact, now_s)
        if fact.sender != self.sender:
            if self._is_wanted(fact):
                self.others.add(fact.sender.system_id)
            return False
        self.armed, self.heartbeat_s = fact.armed, now_s
        self.enter_mode(fact.custom_mode, now_s)
        return True

    def _is_wanted(self, fact: Heartbeat) -> bool:
        return self._wanted_system_id in (None, fact.sender.system_id) and self._wanted_autopilot in (
            None,
            fact.autopilot,
        )

    def _consider(self, fact: Heartbeat, now_s: float) -> None:
        """Adopt the sender, unless it is not the one configured, or not the only one."""
        if not self._is_wanted(fact):
            return
        if self._first_heard_s is None:
            self._first_heard_s = now_s
        waited = now_s - self._first_heard_s >= self._adopt_after_s
        alone = not self.others - {fact.sender.system_id}
        if self._wanted_system_id is None and not (waited and alone):
            return
        self.adapter = choose(fact.autopilot, fact.sender)
        self.fixed_wing = fact.vehicle_type in _FIXED_WINGS
        self.others.discard(fact.sender.system_id)

    def _airspeed(self) -> float:
        if self._airspeed_mps is not None and self._airspeed_mps > 1.0:
            return self._airspeed_mps
        return math.hypot(*self.velocity_mps()[:2])

    @staticmethod
    def _heading_rad(position: OwnPosition) -> float:
        if position.heading_rad is not None:
            return position.heading_rad
        return math.atan2(position.velocity_mps[1], position.velocity_mps[0])

    def _estimate_wind(self, position: OwnPosition, now_s: float) -> None:
        """Velocity over ground less velocity through the air, smoothed."""
        if self._airspeed_mps is None or position.heading_rad is None or self._airspeed_mps < 1.0:
            return
        north = position.velocity_mps[0] - self._airspeed_mps * math.cos(position.heading_rad)
        east = position.velocity_mps[1] - self._airspeed_mps * math.sin(position.heading_rad)
        if self._wind is None or now_s < self._wind.at_s:
            self._wind = _Wind(north, east, now_s)
            return
        share = 1.0 - math.exp((self._wind.at_s - now_s) / _WIND_TIME_CONSTANT_S)
        self._wind.north_mps += share * (north - self._wind.north_mps)
        self._wind.east_mps += share * (east - self._wind.east_mps)
        self._wind.at_s = now_s

    def _wind_mps(self) -> Vec2 | None:
        if self._wind is None:
            return None
        # More than this is no wind but a wrong airspeed, as on the ground.
        if math.hypot(self._wind.north_mps, self._wind.east_mps) > 0.6 * self._airspeed():
            return None
        return self._wind.north_mps, self._wind.east_mps
