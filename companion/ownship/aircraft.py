"""Our aircraft: the autopilot we belong to, and the newest of everything it said."""

import math

from companion.autopilots import Adapter, choose
from companion.autopilots.adapter import GuidanceCommand
from companion.geodesy import GeoPoint, LocalFrame
from companion.mavlink.dialect import mavlink
from companion.mavlink.facts import (
    AirData,
    AutopilotVersion,
    Fact,
    FenceStatus,
    Heartbeat,
    LandedState,
    MissionProgress,
    NavigationTarget,
    OwnPosition,
    RcChannels,
    Sender,
    SystemTime,
    TerrainReport,
    Wind,
)
from companion.model import Goal, Guidance, Ownship, PriorFlightState, Vec3
from companion.ownship.mission import Mission
from companion.ownship.sticks import Sticks
from companion.ownship.terrain import Terrain
from companion.ownship.wind import WindEstimator
from companion.units import wrap_two_pi

_TARGET_FRESH_S = 10.0
# MISSION_CURRENT comes once a second.
_PROGRESS_FRESH_S = 5.0
# Further apart than this, the mission's item and the autopilot's own target are different places.
_SAME_PLACE_M = 150.0
# For so long they may differ while one waypoint follows another.
_DIFFERENCE_S = 5.0
_MISSION_MODES = frozenset({"AUTO", "MISSION"})
# Without heartbeats for so long the autopilot is gone or restarting.
_HEARTBEAT_LOST_S = 5.0
# Not a message of many a second for so long: the link is gone, and ours do not arrive either.
_SILENCE_S = 1.0
# Its mode is heard once a second, what it steers to several times.
_SILENCE_KNOWN_S, _TOLD_AFTER_S = 2.5, 1.0
_BLIND_S = 5.0
# FENCE_STATUS comes once a second.
_FENCE_HEARD_S = 10.0
_OLD_POSITION_S = 0.5
# EXTENDED_SYS_STATE comes once a second as soon as it is asked for; not every firmware has it.
_LANDED_STATE_AWAITED_S = 4.0
_ELSEWHERE_M = 100.0
# MAV_STATE of an autopilot that deals with an emergency by itself.
_FAILSAFE = frozenset(
    {
        mavlink.MAV_STATE_CRITICAL,
        mavlink.MAV_STATE_EMERGENCY,
        mavlink.MAV_STATE_POWEROFF,
        mavlink.MAV_STATE_FLIGHT_TERMINATION,
    }
)
# Aeroplanes, and those VTOLs that fly as such.
_FIXED_WINGS = frozenset({mavlink.MAV_TYPE_FIXED_WING, *range(19, 26)})


class Aircraft:
    """Adopts the one autopilot that is heard, or the configured one, and keeps to it.

    `autopilot` is a MAV_AUTOPILOT; with it, or a system id, no other is adopted. Without a system id, others
    are waited for: when several are there, none is ours to choose.
    """

    def __init__(
        self,
        system_id: int | None = None,
        autopilot: int | None = None,
        *,
        adopt_after_s: float = 0.0,
        stick_us: float = 0.0,
    ) -> None:
        self._wanted_system_id = system_id
        self._wanted_autopilot = autopilot
        self._adopt_after_s = adopt_after_s
        self._first_heard_s: float | None = None
        self.adapter: Adapter | None = None
        self.armed = False
        self.custom_mode = 0
        self.heartbeat_s = -math.inf
        self._fact_s = -math.inf
        self._silent_until_s = -math.inf
        self.position: OwnPosition | None = None
        self.position_s = -math.inf
        self.others: set[int] = set()
        self.unwanted_since_s: dict[int, float] = {}  # systems whose autopilot is not the configured one
        self.fixed_wing = False
        self.version: str | None = None
        self.clock_offset_s: float | None = None  # its clock less ours
        self.failsafe = False
        self.fence_breached = False
        self._fence_s = -math.inf
        self.sequence: int | None = None  # of the mission item that is flown
        self.sticks = Sticks(stick_us)
        # It has our setpoints, or may have: where it says that it flies to is nobody's wish but ours.
        self.ours = False
        self._airspeed_mps: float | None = None
        # By VFR_HUD; it counts by how much it changed since the last position.
        self._altitude_m: float | None = None
        self._altitude_then_m: float | None = None
        self._altitude_s = -math.inf
        self._landed_state: int | None = None
        self._landed_state_heard = False
        self._adopted_s = -math.inf
        self._target: NavigationTarget | None = None
        self.target_while_ours: NavigationTarget | None = None
        self._target_s = -math.inf
        # The mission as far as it is known; whoever reads it from the autopilot puts it here.
        self.mission: Mission | None = None
        self.terrain = Terrain()
        self._wind = WindEstimator()
        self._sequence_s = -math.inf
        self._differs_since_s: float | None = None

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
        self._in_touch(now_s)
        match fact:
            case OwnPosition():
                self.position, self.position_s = fact, now_s
                self._altitude_then_m = self._altitude_m
                self._wind.observe(fact, self._airspeed_mps, now_s)
            case AirData():
                self._airspeed_mps = fact.airspeed_mps
                self._altitude_m, self._altitude_s = fact.altitude_m, now_s
            case LandedState():
                self._landed_state, self._landed_state_heard = fact.landed_state, True
            case Wind():
                self._wind.report(fact, now_s)
            case FenceStatus():
                self.fence_breached, self._fence_s = fact.breached, now_s
            case TerrainReport():
                self.terrain.observe(fact, self.place(), now_s)
            case MissionProgress():
                self.sequence, self._sequence_s = fact.sequence, now_s
            case NavigationTarget():
                if self.ours:
                    self.target_while_ours = fact
                else:
                    self._target, self._target_s = fact, now_s
            case AutopilotVersion():
                self.version = fact.version
            case SystemTime():
                self.clock_offset_s = None if fact.unix_s is None else fact.unix_s - now_s
            case RcChannels():
                self.sticks.observe(fact)
            case _:
                pass
        return True

    def enter_mode(self, custom_mode: int, now_s: float) -> None:
        """The autopilot is in this mode: its heartbeat says so, or it accepted our request for it."""
        if self.ours and not (self.adapter is None or self.adapter.is_guided(custom_mode)):
            # The mission's target was not renewed while we flew; it is what is flown to again.
            self._target_s = now_s
        self.custom_mode = custom_mode

    def resume(self, now_s: float) -> None:
        """It is heard again: where it was flying to counts until it says something else."""
        if self._target is not None:
            self._target_s = now_s
        if self.sequence is not None:
            self._sequence_s = now_s

    def heard(self, now_s: float) -> bool:
        """Whether the autopilot is there."""
        return now_s - self.heartbeat_s < _HEARTBEAT_LOST_S

    def in_contact(self, now_s: float) -> bool:
        """Whether it is heard right now, and its mode is known from after the last silence."""
        return now_s - self._fact_s <= _SILENCE_S and self.heartbeat_s >= self._silent_until_s

    def just_back(self, now_s: float) -> bool:
        """Whether a silence ended so lately that it had no time yet to tell how it is."""
        return now_s - self._silent_until_s < _TOLD_AFTER_S

    def left_by_itself(self, now_s: float) -> bool:
        """Whether a silence ended just now, and it is in the mode that it falls into in one."""
        adapter = self.adapter
        if adapter is None or self.guided or now_s - self._silent_until_s > _SILENCE_KNOWN_S:
            return False
        return self.custom_mode == adapter.left_behind_mode()

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
        if self._landed_state not in (None, mavlink.MAV_LANDED_STATE_IN_AIR) or self.taking_off_or_landing():
            return False
        return self.position.height_above_home_m >= min_height_m

    def known(self, now_s: float) -> bool:
        """Whether it had the time to say that it is landing, or has said so."""
        return self._landed_state_heard or now_s - self._adopted_s >= _LANDED_STATE_AWAITED_S

    def landing(self) -> bool:
        """Known to be on its way down to land, or on the ground."""
        return self._landed_state in (mavlink.MAV_LANDED_STATE_ON_GROUND, mavlink.MAV_LANDED_STATE_LANDING)

    def target(self, now_s: float) -> GeoPoint | None:
        """Where the autopilot itself was flying to, or what it circled, if it said so lately."""
        target = self._target
        if target is None or now_s - self._target_s >= _TARGET_FRESH_S:
            return None
        altitude_m = target.altitude_m
        if altitude_m is None:
            altitude_m = 0.0 if self.position is None else self.position.altitude_m
        return GeoPoint(target.lat_deg, target.lon_deg, altitude_m)

    def doing(self, now_s: float) -> PriorFlightState:
        """What it does now, to go back to later."""
        north_mps, east_mps, _ = self.velocity_mps()
        return PriorFlightState(
            self.custom_mode,
            self.sequence,
            self.target(now_s),
            math.atan2(east_mps, north_mps),
            0.0 if self.position is None else self.position.altitude_m,
            self.airspeed_mps(),
        )

    def mission_place(self, before: PriorFlightState) -> GeoPoint | None:
        """Where the mission leads on to that was left, as soon as its items are known."""
        of_mission = self.adapter is not None and self.adapter.mode_name(before.mode) in _MISSION_MODES
        sequence = self.sequence if before.sequence is None else before.sequence
        if not of_mission or self.mission is None or sequence is None:
            return None
        return self.mission.destination(sequence, self.home_altitude_m())

    def sent_elsewhere(self, target: GeoPoint | None) -> bool:
        """Whether somebody gave the guided mode, in which it already was, another target while we fly it."""
        other = self.target_while_ours
        if target is None or other is None:
            return False
        frame = LocalFrame(target.lat_deg, target.lon_deg)
        moved_m = frame.to_ned_m(GeoPoint(other.lat_deg, other.lon_deg, 0.0))[:2]
        return math.hypot(*moved_m) > _ELSEWHERE_M

    def expect(self, system_id: int) -> None:
        """Adopt the autopilot of this system as soon as it is heard: it was ours a moment ago."""
        if self._wanted_system_id is None:
            self._wanted_system_id = system_id

    def flown(self, guidance: Guidance, *, max_bank_rad: float) -> GuidanceCommand | None:
        """Guidance with what a setpoint needs beside it."""
        position = self.position
        if position is None:
            return None
        altitude_m = position.altitude_m + self._climbed_since_m()
        place = GeoPoint(position.lat_deg, position.lon_deg, altitude_m)
        return GuidanceCommand(guidance, place, self.velocity_mps(), self.airspeed_mps(), max_bank_rad)

    def flying_now(self) -> Guidance:
        """What it flies now, as guidance."""
        north_mps, east_mps, _ = self.velocity_mps()
        altitude_m = 0.0 if self.position is None else self.position.altitude_m
        return Guidance(wrap_two_pi(math.atan2(east_mps, north_mps)), self.airspeed_mps(), altitude_m)

    def _climbed_since_m(self) -> float:
        """How much higher it is than its last position says, when that is old."""
        if self._altitude_m is None or self._altitude_then_m is None:
            return 0.0
        old = self._altitude_s - self.position_s > _OLD_POSITION_S
        return self._altitude_m - self._altitude_then_m if old else 0.0

    def taking_off_or_landing(self) -> bool:
        """Whether the mission being flown takes off, approaches or lands, as far as it is known."""
        if self.mode not in _MISSION_MODES or self.mission is None or self.sequence is None:
            return False
        return self.mission.taking_off_or_landing(self.sequence)

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
            airspeed_mps=self.airspeed_mps(),
            heading_rad=self._heading_rad(self.position),
            wind_mps=self._wind.wind_mps(self.airspeed_mps(), self.position_s),
        )

    def goal(self, frame: LocalFrame, now_s: float) -> Goal:
        """What the mission wants: its item, or the autopilot's own target, or else straight on as now.

        Where item and target are different places, what is known of the mission is out of date, and the
        target counts.
        """
        place = self.target(now_s)
        item = self._item_place(now_s)
        if item is None:
            self._differs_since_s = None
        elif not self._different(item, place, frame, now_s):
            place = item
        speed_mps = self.airspeed_mps()
        if place is not None:
            return Goal(position_m=frame.to_ned_m(place), airspeed_mps=speed_mps, altitude_m=place.altitude_m)
        north_mps, east_mps, _ = self.velocity_mps()
        altitude_m = None if self.position is None else self.position.altitude_m
        return Goal(course_rad=math.atan2(east_mps, north_mps), airspeed_mps=speed_mps, altitude_m=altitude_m)

    def mission_outdated(self, now_s: float) -> bool:
        """Whether the autopilot has been flying elsewhere than the mission that is known leads to."""
        since_s = self._differs_since_s
        return since_s is not None and now_s - since_s > _DIFFERENCE_S

    def _item_place(self, now_s: float) -> GeoPoint | None:
        """Where the mission's item leads to that is being flown."""
        if self.mission is None or self.sequence is None or self.mode not in _MISSION_MODES:
            return None
        if now_s - self._sequence_s > _PROGRESS_FRESH_S:
            return None
        return self.mission.destination(self.sequence, self.home_altitude_m())

    def _different(self, item: GeoPoint, target: GeoPoint | None, frame: LocalFrame, now_s: float) -> bool:
        """Whether the mission's item and the autopilot's target are different places; notes since when."""
        away_m = 0.0
        if target is not None:
            here, there = frame.to_ned_m(item), frame.to_ned_m(target)
            away_m = math.hypot(here[0] - there[0], here[1] - there[1])
        if away_m <= _SAME_PLACE_M:
            self._differs_since_s = None
            return False
        if self._differs_since_s is None:
            self._differs_since_s = now_s
        return True

    def _heartbeat(self, fact: Heartbeat, now_s: float) -> bool:
        if fact.autopilot == mavlink.MAV_AUTOPILOT_INVALID:
            return False
        if self.adapter is None:
            self._consider(fact, now_s)
        if fact.sender != self.sender:
            if self._is_wanted(fact):
                self.others.add(fact.sender.system_id)
            else:
                self.unwanted_since_s.setdefault(fact.sender.system_id, now_s)
            return False
        self._in_touch(now_s)
        self.armed, self.heartbeat_s = fact.armed, now_s
        self.failsafe = fact.system_status in _FAILSAFE
        # Of a fence that is switched off nothing is heard any more.
        self.fence_breached &= now_s - self._fence_s < _FENCE_HEARD_S
        self.enter_mode(fact.custom_mode, now_s)
        return True

    def _in_touch(self, now_s: float) -> None:
        if now_s - self._fact_s > _SILENCE_S and math.isfinite(self._fact_s):
            self._silent_until_s = now_s
        self._fact_s = now_s

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
        self._adopted_s = now_s
        self.fixed_wing = fact.vehicle_type in _FIXED_WINGS
        self.others.discard(fact.sender.system_id)

    def airspeed_mps(self) -> float:
        """Speed through the air, or over ground where that is not heard."""
        if self._airspeed_mps is not None and self._airspeed_mps > 1.0:
            return self._airspeed_mps
        return math.hypot(*self.velocity_mps()[:2])

    @staticmethod
    def _heading_rad(position: OwnPosition) -> float:
        if position.heading_rad is not None:
            return position.heading_rad
        return math.atan2(position.velocity_mps[1], position.velocity_mps[0])
