"""An aircraft for campaigns: the fake vehicle's dynamics with a minimal ArduPlane.

It flies its mission line in AUTO and the 4300x commands in GUIDED; ArduPlane obeys no others. It emits facts
instead of messages, which saves packing and unpacking; the fake vehicle tests the bytes.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from companion.autopilots.ardupilot import GUIDED
from companion.geodesy import LocalFrame
from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import (
    AirData,
    AirspeedSensor,
    CommandResult,
    Fact,
    Heartbeat,
    LandedState,
    NavigationTarget,
    OwnPosition,
    Sender,
    Wind,
)
from companion.model import Vec3
from companion.units import STANDARD_GRAVITY_MPS2
from sim.dynamics import Airframe, FixedWing

AUTOPILOT = Sender(1, 1)
AUTO = 10
# Distance of the mission's next waypoint: no flight reaches it.
_MISSION_M = 50_000.0
# Origin of the campaigns' flat frame.
FRAME = LocalFrame(45.0, 10.0)
_ACTIVE = 4  # MAV_STATE_ACTIVE


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of the campaign's aircraft, as in the comparison of the peers: 30 degrees, 2.54 m/s.

    `slack_m`: distance of floor and ceiling from the mission's height, `None` unless the height is locked.
    """

    min_airspeed_mps: float = 20.0
    max_airspeed_mps: float = 30.0
    max_bank_rad: float = math.radians(30.0)
    max_climb_mps: float = 2.54
    slack_m: float | None = None

    def airframe(self) -> Airframe:
        """The dynamics within these limits."""
        return Airframe(
            bank_limit_rad=self.max_bank_rad,
            airspeed_min_mps=self.min_airspeed_mps,
            airspeed_max_mps=self.max_airspeed_mps,
            climb_limit_mps=self.max_climb_mps,
            sink_limit_mps=self.max_climb_mps,
        )


class Plane:
    """One aircraft on a straight level mission line, in the campaign's frame (north-east-down)."""

    def __init__(self, position_m: Vec3, course_rad: float, airspeed_mps: float, limits: Limits) -> None:
        self._wing = FixedWing(position_m, course_rad, airspeed_mps, airframe=limits.airframe())
        self._start_m, self._course_rad = position_m, course_rad
        self._airspeed_mps = airspeed_mps
        end_m = (
            position_m[0] + _MISSION_M * math.cos(course_rad),
            position_m[1] + _MISSION_M * math.sin(course_rad),
        )
        self._line_m = position_m[:2], end_m
        self._end = FRAME.to_geo(*end_m, position_m[2])
        self.mode = AUTO
        self.entered_guided = 0
        self._answers: list[Fact] = []

    @property
    def position_m(self) -> Vec3:
        """North, east, down [m]."""
        return self._wing.position_m

    @property
    def velocity_mps(self) -> Vec3:
        """Velocity over ground, north-east-down [m/s]."""
        return self._wing.velocity_mps

    def off_line_m(self) -> tuple[float, float]:
        """Offset to the right of the mission line and above its height [m]."""
        north_m, east_m, down_m = self._wing.position_m
        north_m, east_m = north_m - self._start_m[0], east_m - self._start_m[1]
        aside_m = east_m * math.cos(self._course_rad) - north_m * math.sin(self._course_rad)
        return aside_m, self._start_m[2] - down_m

    def fly(self, steps: int, dt_s: float) -> NDArray[np.float64]:
        """Fly some steps; returns the position after each, north-east-down [m], (steps, 3)."""
        return self._wing.fly(steps, dt_s, self._line_m if self.mode == AUTO else None)

    def facts(self, now_s: float) -> list[Fact]:
        """The autopilot's position, and its answers since the last call."""
        wing = self._wing
        position_m = wing.position_m
        place = FRAME.to_geo(*position_m)
        answers, self._answers = self._answers, []
        position = OwnPosition(
            AUTOPILOT,
            now_s,
            place.lat_deg,
            place.lon_deg,
            place.altitude_m,
            place.altitude_m,
            wing.velocity_mps,
            wing.heading_rad,
        )
        return [*answers, position]

    def heartbeat(self) -> Heartbeat:
        """The present heartbeat."""
        kind, autopilot = mavlink.MAV_TYPE_FIXED_WING, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
        return Heartbeat(AUTOPILOT, kind, autopilot, True, self.mode, _ACTIVE)

    def rare_facts(self) -> list[Fact]:
        """The facts that change slowly or never."""
        return [
            AirData(AUTOPILOT, self._wing.airspeed_mps),
            AirspeedSensor(AUTOPILOT, True),
            Wind(AUTOPILOT, 0.0, 0.0),
            LandedState(AUTOPILOT, mavlink.MAV_LANDED_STATE_IN_AIR),
            NavigationTarget(AUTOPILOT, self._end.lat_deg, self._end.lon_deg, self._end.altitude_m),
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
        return self.mode != before

    def _enter(self, mode: int) -> None:
        if mode == GUIDED and self.mode != GUIDED:
            self.entered_guided += 1
        self.mode = mode
        if mode == AUTO:
            self._wing.hold_altitude(-self._start_m[2])
            self._wing.hold_airspeed(self._airspeed_mps)

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
        self._answers.append(CommandResult(AUTOPILOT, command, result, None))
