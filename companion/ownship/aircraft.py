"""Our aircraft: its autopilot, and the newest of everything that it has reported."""

import math

from companion.autopilots import Adapter
from companion.geodesy import GeoPoint, LocalFrame
from companion.mavlink.facts import (
    AirData,
    AirspeedSensor,
    AutopilotVersion,
    Fact,
    FenceStatus,
    Heartbeat,
    LandedState,
    LinkAnswer,
    MissionProgress,
    NavigationTarget,
    OtherVehicle,
    OwnPosition,
    RcChannels,
    Sender,
    SystemTime,
    TerrainReport,
    Wind,
)
from companion.model import Goal, PriorFlightState
from companion.ownship.autopilot_state import Contact, FlightState, Identity, Sticks
from companion.ownship.kinematics import Kinematics, Terrain
from companion.ownship.legs import Leg
from companion.ownship.mission import Mission
from companion.ownship.navigation import Navigation
from companion.ownship.position_gate import Place, PositionGate

# PX4 leaves its guided mode a second after the last setpoint.
_SETPOINTS_LOST_S = 0.9
# A change of mode is judged when it is seen: this long after it at the latest.
_JUDGED_WITHIN_S = 2.5
# Reading the mission takes some seconds, more on a slow link. An autopilot that does not answer at all is
# flown without it after the first time, one whose answers arrive after the second.
_MISSION_AWAITED_S, _MISSION_READ_S = 6.0, 60.0
# Lower than this in a descent, a mission that is not known may be about to land.
_MAY_LAND_BELOW_M = 200.0
_DESCENT_MPS = 0.5
# EXTENDED_SYS_STATE is requested at adoption and comes once a second; not every firmware sends it.
_LANDED_STATE_AWAITED_S = 4.0


class Aircraft:
    """Routes each fact to the part that stores it, and answers questions that need several parts.

    The parameters are those of `Identity` and `Sticks`.
    """

    def __init__(
        self,
        system_id: int | None = None,
        autopilot: int | None = None,
        *,
        adopt_after_s: float = 0.0,
        stick_us: float = 0.0,
    ) -> None:
        self.identity = Identity(system_id, autopilot, adopt_after_s)
        self.adapter: Adapter | None = None  # of our autopilot, once it is adopted
        self.sender: Sender | None = None  # its address
        self.contact = Contact()
        self.flight_state = FlightState()
        self.kinematics = Kinematics()
        self.navigation = Navigation(self.kinematics)
        self.terrain = Terrain()
        self.sticks = Sticks(stick_us)
        self.ours = False  # our setpoints are flown, or may be
        self._mission_known_s = -math.inf
        self._mission_arrives = False
        # From the last heartbeat with the former mode to the first one with this mode.
        self.unseen_before_mode_s = math.inf
        self.moved_s = -math.inf  # the last time that its position jumped
        self._gate = PositionGate()
        self._mode_heard = False

    def observe(self, fact: Fact, now_s: float) -> bool:
        """Store a fact; returns whether it came from our autopilot."""
        if isinstance(fact, Heartbeat):
            return self._observe_heartbeat(fact, now_s)
        if fact.sender != self.sender:
            return False
        if isinstance(fact, OtherVehicle):
            self.identity.observe_impostor(now_s)
            return False
        if isinstance(fact, OwnPosition) and not self._is_here(fact, now_s):
            return False
        self.contact.observe(now_s)
        match fact:
            case OwnPosition():
                self.kinematics.observe_position(fact, now_s)
            case AirData():
                self.kinematics.observe_air_data(fact, now_s)
            case AirspeedSensor():
                self.kinematics.airspeed.sensor_usable = fact.usable
            case Wind():
                self.kinematics.wind.report(fact, now_s)
            case LandedState():
                self.flight_state.observe_landed_state(fact)
            case FenceStatus():
                self.flight_state.observe_fence(fact, now_s)
            case TerrainReport():
                self.terrain.observe(fact, self.kinematics.place(), now_s)
            case MissionProgress():
                guided = self.ours and self.guided
                self.navigation.observe_progress(fact, now_s, guided=guided, flown=self._in_mission)
            # Older ones belong to another mode.
            case NavigationTarget() if now_s >= self.flight_state.mode_since_s:
                self.navigation.observe_target(fact, now_s, ours=self.ours, guided=self.guided)
            case AutopilotVersion():
                self.identity.version = fact.version
            case LinkAnswer():
                self.contact.observe_answer(fact.asked_s, now_s)
            case SystemTime():
                self.contact.observe_clock(fact.unix_s, now_s)
            case RcChannels():
                self.sticks.observe(fact, now_s)
            case _:
                pass
        return True

    def _is_here(self, fact: OwnPosition, now_s: float) -> bool:
        """Whether the position is that of our aircraft."""
        if now_s < self.kinematics.position_s:
            return False  # overtaken by a newer one
        place = self._gate.judge(fact, now_s)
        if place is Place.TWO_PLACES:
            self.identity.observe_impostor(now_s)
        if place is Place.MOVED:
            self.moved_s = now_s
        return place in (Place.HERE, Place.MOVED)

    def _observe_heartbeat(self, fact: Heartbeat, now_s: float) -> bool:
        if not self.identity.is_ours(fact, now_s):
            return False
        self.adapter, self.sender = self.identity.adapter, self.identity.sender
        self.contact.observe(now_s)
        if fact.custom_mode != self.flight_state.custom_mode:
            self.unseen_before_mode_s = now_s - self.contact.heartbeat_s
        self.contact.heartbeat_s = max(now_s, self.contact.heartbeat_s)
        self.flight_state.observe_heartbeat(fact, now_s)
        self.enter_mode(fact.custom_mode, now_s)
        if self.guided:
            self.navigation.observe_guided()
        return True

    # --- answers from several parts

    @property
    def mode(self) -> str | None:
        """The mode's name."""
        return None if self.adapter is None else self.adapter.mode_name(self.flight_state.custom_mode)

    @property
    def guided(self) -> bool:
        """Whether the autopilot is in the mode in which our setpoints are obeyed."""
        return self.adapter is not None and self.adapter.is_guided(self.flight_state.custom_mode)

    @property
    def _in_mission(self) -> bool:
        return self.adapter is not None and self.adapter.is_mission(self.flight_state.custom_mode)

    def enter_mode(self, custom_mode: int, now_s: float) -> None:
        """Store the mode, as a heartbeat or an accepted request shows it."""
        if self.ours and not (self.adapter is None or self.adapter.is_guided(custom_mode)):
            self.navigation.refresh_target(now_s)
        if custom_mode != self.flight_state.custom_mode:
            self.flight_state.mode_since_s = now_s
        was_in_mission, self.flight_state.custom_mode = self._in_mission, custom_mode
        self.navigation.legs.first = int(self.adapter is not None and self.adapter.home_is_item_0)
        if self._in_mission and not was_in_mission and self._mode_heard:
            self.navigation.legs.entered(self.kinematics.place())
        self._mode_heard = True

    def left_guided_by_itself(self, now_s: float) -> bool:
        """Whether our setpoints stopped arriving, and the mode is the one that is entered then.

        The same mode while they arrive is someone's choice, and so is one without a failsafe: PX4 reports the
        end of the setpoints as a failsafe until a mode is chosen, also when it is the same one.
        """
        adapter = self.adapter
        if adapter is None or self.guided or self.flight_state.custom_mode != adapter.setpoint_loss_mode():
            return False
        if not self.flight_state.failsafe:
            return False
        seen_now = now_s - self.flight_state.mode_since_s <= _JUDGED_WITHIN_S
        without = self.flight_state.mode_since_s - adapter.last_setpoint_s >= _SETPOINTS_LOST_S
        return (seen_now and without) or self.contact.uplink_interrupted(now_s)

    def flying(self, min_height_m: float) -> bool:
        """Whether it is armed, at least this high above home, and neither taking off nor landing."""
        position = self.kinematics.position
        if not self.flight_state.armed or position is None:
            return False
        if not self.flight_state.may_be_in_the_air or self.taking_off_or_landing():
            return False
        return position.height_above_home_m >= min_height_m

    def in_the_air(self, min_height_m: float) -> bool:
        """Whether it is `flying`, or reports that it is in the air, however low above home."""
        if self.flying(min_height_m):
            return True
        return self.flight_state.armed and self.flight_state.in_the_air and not self.taking_off_or_landing()

    def landed_state_known(self, now_s: float) -> bool:
        """Whether the landed state is known, or has been awaited long enough."""
        awaited_s = now_s - self.identity.adopted_s
        return self.flight_state.landed_state_heard or awaited_s >= _LANDED_STATE_AWAITED_S

    def taking_off_or_landing(self) -> bool:
        """Whether a mission is flown whose item takes off, approaches or lands, as far as that is known."""
        return self._in_mission and self.navigation.taking_off_or_landing()

    def prior_flight_state(self, now_s: float) -> PriorFlightState:
        """The present flight state, to return to later."""
        own = self.kinematics
        target, course_rad = self.navigation.target(now_s), own.course_rad()
        mode, sequence = self.flight_state.custom_mode, self.navigation.sequence
        return PriorFlightState(mode, sequence, target, course_rad, own.altitude_m(), own.airspeed_mps())

    def mission_destination(self, before: PriorFlightState) -> GeoPoint | None:
        """The place that the mission flown before leads to; `None` when there was none or it is unknown."""
        if self.adapter is None or not self.adapter.is_mission(before.mode):
            return None
        return self.navigation.destination(before.sequence)

    def leg(self) -> Leg | None:
        """The leg of the mission where the aircraft belongs; `None`: unknown, or no mission is flown."""
        return self.navigation.leg() if self._in_mission else None

    def goal(self, frame: LocalFrame, now_s: float) -> Goal:
        """The goal of the mission (see `Navigation.goal`)."""
        return self.navigation.goal(frame, now_s, in_mission=self._in_mission)

    # --- the mission

    def note_mission(self, mission: Mission | None, now_s: float, *, arrives: bool) -> None:
        """Store the mission as it is known at `now_s`; `None`: it is not. `arrives`: it is being read."""
        self._mission_arrives = arrives
        if mission is not None:
            self._mission_known_s = now_s
        if mission is self.navigation.mission:
            return
        before = self.navigation.mission
        if before is not None:
            self.navigation.plan_changes += 1
        self.navigation.mission = mission
        self.navigation.legs.learn(mission, self.kinematics.place(), flown=self._in_mission)

    def mission_awaited(self, now_s: float) -> bool:
        """Whether a mission is flown that is not known yet, and may be soon."""
        awaited_s = now_s - max(self.identity.adopted_s, self._mission_known_s)
        longest_s = _MISSION_READ_S if self._mission_arrives else _MISSION_AWAITED_S
        return self._in_mission and self.navigation.mission is None and awaited_s < longest_s

    def may_be_landing(self) -> bool:
        """Whether a mission is flown that is not known, so low and in such a descent that it may land."""
        position = self.kinematics.position
        if position is None or not self._in_mission or self.navigation.mission is not None:
            return False
        descends = position.velocity_mps[2] > _DESCENT_MPS
        return descends and position.height_above_home_m < _MAY_LAND_BELOW_M
