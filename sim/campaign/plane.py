"""An aircraft for campaigns: the fake vehicle's dynamics with a minimal ArduPlane.

It flies the legs of its route in AUTO and the 4300x commands in GUIDED; ArduPlane obeys no others. As in
ArduPlane, AUTO begins a new straight sloped line where it is entered. It emits facts instead of messages,
which saves packing and unpacking; the fake vehicle tests the bytes.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from companion.autopilots.ardupilot import GUIDED
from companion.geodesy import LocalFrame, wrap_pi
from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import (
    AirData,
    AirspeedSensor,
    CommandResult,
    Fact,
    Heartbeat,
    HeightAbove,
    LandedState,
    MissionCount,
    MissionItem,
    MissionProgress,
    NavigationTarget,
    OwnPosition,
    Sender,
    Wind,
)
from companion.model import Vec3
from companion.units import STANDARD_GRAVITY_MPS2
from sim.campaign.route import Route
from sim.compiled.airframe_step import L1_TIME_S
from sim.dynamics import ARDUPLANE, Airframe, FixedWing
from sim.path import off_leg

AUTOPILOT = Sender(1, 1)
AUTO = 10
_COMPANION = 196  # component
# The largest distance before a corner at which the turn begins (WP_RADIUS).
_TURN_M = 90.0
# A smaller difference of height is flown at once (ALT_SLOPE_MIN).
_LEAST_SLOPE_M = 15.0
# Origin of the campaigns' flat frame.
FRAME = LocalFrame(45.0, 10.0)
_ACTIVE = 4  # MAV_STATE_ACTIVE


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of the campaign's aircraft, as in the comparison of the peers: 30 degrees, 2.54 m/s.

    `dynamics`: the airframe with its lags, as fitted to recorded flights. `slack_m`: distance of floor and
    ceiling from the mission's height, `None` unless the height is locked.
    """

    min_airspeed_mps: float = 20.0
    max_airspeed_mps: float = 30.0
    max_bank_rad: float = math.radians(30.0)
    max_climb_mps: float = 2.54
    slack_m: float | None = None
    dynamics: Airframe = ARDUPLANE

    def airframe(self) -> Airframe:
        """The dynamics within these limits."""
        return replace(
            self.dynamics,
            bank_limit_rad=self.max_bank_rad,
            airspeed_min_mps=self.min_airspeed_mps,
            airspeed_max_mps=self.max_airspeed_mps,
            climb_limit_mps=self.max_climb_mps,
            sink_limit_mps=self.max_climb_mps,
        )


class Plane:
    """One aircraft on its route, in the campaign's frame (north-east-down)."""

    def __init__(
        self, position_m: Vec3, airspeed_mps: float, route: Route, limits: Limits, system_id: int = 1
    ) -> None:
        self.sender, self._companion = Sender(system_id, 1), Sender(system_id, _COMPANION)
        self._route, self._airspeed_mps = route, airspeed_mps
        self._to = 1
        while self._to + 1 < len(route.places_m) and self._is_passed(position_m):
            self._to += 1
        self._from_m, self._to_m = route.leg(self._to)
        course_rad = math.atan2(self._to_m[1] - self._from_m[1], self._to_m[0] - self._from_m[0])
        self._wing = FixedWing(position_m, course_rad, airspeed_mps, airframe=limits.airframe())
        self.mode = AUTO
        self.entered_guided = 0
        self.left_leg: int | None = None  # the number of the leg that was flown at the last take-over
        self.given_back_m: tuple[float, float] | None = None  # `off_leg_m` when AUTO was entered last
        self._answers: list[Fact] = []

    @property
    def position_m(self) -> Vec3:
        """North, east, down [m]."""
        return self._wing.position_m

    @property
    def velocity_mps(self) -> Vec3:
        """Velocity over ground, north-east-down [m/s]."""
        return self._wing.velocity_mps

    @property
    def leg(self) -> int:
        """The number of the present leg."""
        return self._to

    def off_leg_m(self) -> tuple[float, float]:
        """Offset to the right of the present leg between waypoints, and above its slope [m]."""
        aside, above, _ = off_leg(*self._route.leg(self._to), np.array([self._wing.position_m]))
        return float(aside[0]), float(above[0])

    def fly(self, steps: int, dt_s: float) -> NDArray[np.float64]:
        """Fly some steps; returns the position after each, north-east-down [m], (steps, 3)."""
        if self.mode != AUTO:
            return self._wing.fly(steps, dt_s)
        if self._turns_now():
            self._from_m, self._to_m = self._route.leg(self._to + 1)
            self._to += 1
        self._wing.hold_altitude(self._altitude_m())
        return self._wing.fly(steps, dt_s, (self._from_m[:2], self._to_m[:2]))

    def _is_passed(self, position_m: Vec3) -> bool:
        """Whether a place is beyond the end of the present leg."""
        return float(off_leg(*self._route.leg(self._to), np.array([position_m]))[2][0]) > 0.0

    def _turns_now(self) -> bool:
        """Whether the next leg begins here: as early as ArduPlane turns, or beyond the end of the line."""
        if self._to + 1 >= len(self._route.places_m):
            return False
        (north_m, east_m, _), to_m = self._wing.position_m, self._to_m
        leg_rad = math.atan2(to_m[1] - self._from_m[1], to_m[0] - self._from_m[0])
        next_m = self._route.places_m[self._to + 1]
        turn_rad = abs(wrap_pi(math.atan2(next_m[1] - to_m[1], next_m[0] - to_m[0]) - leg_rad))
        early_m = min(_TURN_M, L1_TIME_S * self._airspeed_mps) * min(turn_rad / (math.pi / 2.0), 1.0)
        to_go_n, to_go_e = to_m[0] - north_m, to_m[1] - east_m
        passed = to_go_n * math.cos(leg_rad) + to_go_e * math.sin(leg_rad) <= 0.0
        return passed or math.hypot(to_go_n, to_go_e) <= early_m

    def _altitude_m(self) -> float:
        """Height on the slope of the line flown; nearly level lines are flown at their end's height."""
        if abs(self._to_m[2] - self._from_m[2]) < _LEAST_SLOPE_M:
            return -self._to_m[2]
        above = off_leg(self._from_m, self._to_m, np.array([self._wing.position_m]))[1]
        return -self._wing.position_m[2] - float(above[0])

    def facts(self, now_s: float) -> list[Fact]:
        """The autopilot's position, and its answers since the last call."""
        wing = self._wing
        position_m = wing.position_m
        place = FRAME.to_geo(*position_m)
        answers = self.take_answers()
        position = OwnPosition(
            self.sender,
            now_s,
            place.lat_deg,
            place.lon_deg,
            place.altitude_m,
            place.altitude_m,
            wing.velocity_mps,
            wing.heading_rad,
        )
        return [*answers, position]

    def take_answers(self) -> list[Fact]:
        """The answers since the last call."""
        answers, self._answers = self._answers, []
        return answers

    def heartbeat(self) -> Heartbeat:
        """The present heartbeat."""
        kind, autopilot = mavlink.MAV_TYPE_FIXED_WING, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
        return Heartbeat(self.sender, kind, autopilot, True, self.mode, _ACTIVE)

    def rare_facts(self) -> list[Fact]:
        """The facts that change slowly or never."""
        return [
            AirData(self.sender, self._wing.airspeed_mps),
            AirspeedSensor(self.sender, True),
            Wind(self.sender, 0.0, 0.0),
            LandedState(self.sender, mavlink.MAV_LANDED_STATE_IN_AIR),
            MissionProgress(self.sender, self._to + 1, len(self._route.places_m)),
            NavigationTarget(self.sender, *FRAME.to_geo(*self._to_m)),
        ]

    def execute(self, messages: Iterable[Message]) -> bool:
        """Execute commands; True if the mode changed."""
        before = self.mode
        for message in messages:
            kind = message.get_type()
            if kind == "COMMAND_LONG" and message.command == mavlink.MAV_CMD_DO_SET_MODE:
                self._enter(int(message.param2))
                self._answer(message.command, mavlink.MAV_RESULT_ACCEPTED)
            elif kind == "COMMAND_INT":
                self._execute_guided(message)
            elif kind == "MISSION_REQUEST_LIST":
                count = 0 if message.mission_type else len(self._route.places_m) + 1
                self._answers.append(MissionCount(self.sender, self._companion, message.mission_type, count))
            elif kind == "MISSION_REQUEST_INT":
                self._answers.append(self._item(message.seq))
        return self.mode != before

    def _enter(self, mode: int) -> None:
        if mode == GUIDED and self.mode != GUIDED:
            self.entered_guided += 1
            self.left_leg = self._to
        if mode == AUTO and self.mode != AUTO:
            self._from_m, self.given_back_m = self._wing.position_m, self.off_leg_m()
            self._wing.hold_airspeed(self._airspeed_mps)
        self.mode = mode

    def _item(self, sequence: int) -> MissionItem:
        """An item of the mission: home, then the places of the route."""
        place = FRAME.to_geo(*self._route.places_m[max(sequence - 1, 0)])
        nothing = (0.0, 0.0, 0.0, 0.0)
        command = mavlink.MAV_CMD_NAV_WAYPOINT
        above = HeightAbove.SEA
        return MissionItem(self.sender, self._companion, 0, sequence, command, nothing, *place, above)

    def _execute_guided(self, message: Message) -> None:
        if self.mode != GUIDED:
            self._answer(message.command, mavlink.MAV_RESULT_FAILED)
            return
        if message.command == mavlink.MAV_CMD_GUIDED_CHANGE_HEADING:
            bank_rad = math.atan(message.param3 / STANDARD_GRAVITY_MPS2)
            self._wing.hold_course(math.radians(message.param2), bank_rad)
        elif message.command == mavlink.MAV_CMD_GUIDED_CHANGE_SPEED:
            self._wing.hold_airspeed(message.param2)
        elif message.command == mavlink.MAV_CMD_GUIDED_CHANGE_ALTITUDE:
            self._wing.hold_altitude(message.z)
        else:
            return
        self._answer(message.command, mavlink.MAV_RESULT_ACCEPTED)

    def _answer(self, command: int, result: int) -> None:
        self._answers.append(CommandResult(self.sender, command, result, None))
