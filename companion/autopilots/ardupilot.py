"""ArduPlane. What it obeys in GUIDED: the 4300x commands, and of position targets the height alone.

SET_POSITION_TARGET_LOCAL_NED is acknowledged by silence and not flown, and so are the course and speed of
SET_POSITION_TARGET_GLOBAL_INT; the latter is sent whole all the same, for its height and for who listens.
"""

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

from companion.autopilots.adapter import Adapter, GuidanceCommand, RefusedValue
from companion.autopilots.commands import Outcome
from companion.autopilots.limits import ARDUPLANE, ParameterTable
from companion.avoidance.envelope import Control
from companion.geodesy import LocalFrame
from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import CommandResult, Fact, Sender
from companion.model import PriorFlightState
from companion.units import STANDARD_GRAVITY_MPS2, course_deg, wrap_pi

MODES = {
    0: "MANUAL",
    1: "CIRCLE",
    2: "STABILIZE",
    3: "TRAINING",
    4: "ACRO",
    5: "FBWA",
    6: "FBWB",
    7: "CRUISE",
    8: "AUTOTUNE",
    10: "AUTO",
    11: "RTL",
    12: "LOITER",
    13: "TAKEOFF",
    14: "AVOID_ADSB",
    15: "GUIDED",
    16: "INITIALISING",
    17: "QSTABILIZE",
    18: "QHOVER",
    19: "QLOITER",
    20: "QLAND",
    21: "QRTL",
    24: "THERMAL",
    25: "LOITER_QLAND",
    26: "AUTOLAND",
}
LOITER, GUIDED = 12, 15

# Each heading command resets the heading controller's integrator: sent on change, and slowly against loss.
_HEADING_CHANGE_RAD = math.radians(1.0)
_HEADING_REPEAT_S = 2.0
_SPEED_CHANGE_MPS = 0.3
_HEIGHT_CHANGE_M = 1.0
_SPEED_AND_HEIGHT_REPEAT_S = 10.0
_SETPOINT_INTERVAL_S = 0.2
_MAX_SETPOINTS_PER_S = 10
_POINT_AHEAD_M = 500.0
# A value at the very limit is refused when the autopilot rounds it the other way; so much inside it is flown.
_SPEED_INSIDE_MPS = 1.0
_HEIGHT_ASIDE_M = 2.0  # 0 and -1 m above mean sea level stand for "none", and are denied
_TYPE_MASK = (
    mavlink.POSITION_TARGET_TYPEMASK_AX_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_AY_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_AZ_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE
)


_AVD_ACTS = 2.0  # 0 does nothing, 1 reports

_CONTROLS = {
    mavlink.MAV_CMD_GUIDED_CHANGE_HEADING: Control.HEADING,
    mavlink.MAV_CMD_GUIDED_CHANGE_SPEED: Control.SPEED,
    mavlink.MAV_CMD_GUIDED_CHANGE_ALTITUDE: Control.HEIGHT,
}


class _Sent(NamedTuple):
    value: float
    at_s: float


@dataclass(slots=True)
class _Refused:
    """A value that was refused: tried once more, moderated, and given up when that is refused too."""

    value: float
    given_up: bool = False


class ArduPlane(Adapter):
    """Guidance for ArduPlane 4.1 and later."""

    name: ClassVar[str] = "ArduPlane"
    intervals_s: ClassVar[dict[int, float]] = {
        # The mode is heard by heartbeat: the sooner, the sooner a pilot who takes the aircraft has it.
        mavlink.MAVLINK_MSG_ID_HEARTBEAT: 0.2,
        mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 0.1,
        mavlink.MAVLINK_MSG_ID_VFR_HUD: 0.25,
        mavlink.MAVLINK_MSG_ID_ADSB_VEHICLE: 0.2,
        mavlink.MAVLINK_MSG_ID_SCALED_PRESSURE: 1.0,
        mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: 1.0,
        mavlink.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT: 0.5,
        mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 1.0,
        mavlink.MAVLINK_MSG_ID_RC_CHANNELS: 0.2,
        mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: 1.0,
        mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: 2.0,
        mavlink.MAVLINK_MSG_ID_WIND: 1.0,
        mavlink.MAVLINK_MSG_ID_HOME_POSITION: 5.0,
        mavlink.MAVLINK_MSG_ID_FENCE_STATUS: 1.0,
        mavlink.MAVLINK_MSG_ID_TERRAIN_REPORT: 1.0,
    }
    places: ClassVar[frozenset[str]] = frozenset({"LOITER", "CIRCLE"})
    courses: ClassVar[frozenset[str]] = frozenset({"CRUISE", "FBWB"})
    parameters: ClassVar[ParameterTable] = ARDUPLANE

    def __init__(self, target: Sender) -> None:
        super().__init__(target)
        self._sent: dict[int, _Sent] = {}
        self._refused: dict[int, _Refused] = {}
        self._given_up: list[RefusedValue] = []
        self._setpoints_s: deque[float] = deque(maxlen=_MAX_SETPOINTS_PER_S)

    @staticmethod
    def mode_name(custom_mode: int) -> str:
        """The mode's name as ground stations show it."""
        return MODES.get(custom_mode, f"MODE {custom_mode}")

    @property
    def guided_mode(self) -> int:
        """GUIDED is the only mode that takes the 4300x commands."""
        return GUIDED

    @property
    def fallback_mode(self) -> int:
        """LOITER circles where it is until somebody decides."""
        return LOITER

    def left_behind_mode(self) -> int | None:
        """GUIDED with a heading flies on for ever."""
        return GUIDED

    def set_mode(self, custom_mode: int) -> Message:
        """DO_SET_MODE; entering GUIDED clears all targets, so everything is to be sent afresh."""
        return self.command_long(
            mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, custom_mode
        )

    def give_back(self, before: PriorFlightState) -> list[Message]:
        """Who was in GUIDED before goes on to where he was going; all other modes are entered by name."""
        if before.mode == GUIDED and before.target is not None:
            return [self.reposition(before.target)]
        return super().give_back(before)

    def stand_back(self) -> None:
        """Forget what was sent and asked."""
        super().stand_back()
        self._sent.clear()
        self._refused.clear()
        self._given_up.clear()

    def observe(self, fact: Fact, now_s: float) -> None:
        """A guided command refused is tried once more with a moderate value, then given up."""
        super().observe(fact, now_s)
        if not isinstance(fact, CommandResult) or fact.command not in _CONTROLS:
            return
        if self.desk.outcome(fact.command) is not Outcome.REFUSED or fact.command not in self._sent:
            return
        refused = self._refused.get(fact.command)
        wanted = self._sent[fact.command].value
        if refused is None or refused.value != wanted:
            self._refused[fact.command] = _Refused(wanted)
            del self._sent[fact.command]  # so that it is news
        elif not refused.given_up:
            refused.given_up = True
            self._given_up.append(RefusedValue(_CONTROLS[fact.command], wanted))

    def other_avoider(self, parameters: Mapping[str, float]) -> str | None:
        """AP_Avoidance, if it does more than report."""
        if parameters.get("AVD_ENABLE", 0.0) < 1.0 or parameters.get("AVD_F_ACTION", 0.0) < _AVD_ACTS:
            return None
        return f"AVD_ENABLE with AVD_F_ACTION {parameters['AVD_F_ACTION']:.0f}"

    def refused_values(self) -> list[RefusedValue]:
        """What it will not fly, not even moderated, since the last call."""
        given_up, self._given_up = self._given_up, []
        return given_up

    def command(self, flown: GuidanceCommand, now_s: float, *, urgent: bool) -> list[Message]:
        """Heading, speed and height commands where they changed, and the position target stream."""
        wanted = flown.guidance
        heading = (mavlink.MAV_CMD_GUIDED_CHANGE_HEADING, wanted.course_rad)
        speed = (mavlink.MAV_CMD_GUIDED_CHANGE_SPEED, wanted.airspeed_mps)
        height = (mavlink.MAV_CMD_GUIDED_CHANGE_ALTITUDE, wanted.altitude_m)
        messages = []
        if self._news(*heading, now_s, _HEADING_CHANGE_RAD, _HEADING_REPEAT_S, circular=True):
            messages.append(self.desk.ask(self._change_heading(flown), now_s))
        if self._news(*speed, now_s, _SPEED_CHANGE_MPS, _SPEED_AND_HEIGHT_REPEAT_S):
            messages.append(self.desk.ask(self._change_speed(flown), now_s))
        if self._news(*height, now_s, _HEIGHT_CHANGE_M, _SPEED_AND_HEIGHT_REPEAT_S):
            messages.append(self.desk.ask(self._change_height(flown), now_s))
        if self._setpoint_due(now_s, urgent=urgent):
            self._setpoints_s.append(now_s)
            messages.append(self._position_target(flown, now_s))
        return messages

    def _news(
        self,
        command: int,
        value: float,
        now_s: float,
        change: float,
        repeat_s: float,
        *,
        circular: bool = False,
    ) -> bool:
        """Whether a value differs from the one last sent, or that is too long ago; notes it as sent then."""
        sent = self._sent.get(command)
        if sent is not None and now_s - sent.at_s < repeat_s:
            off = value - sent.value
            if abs(wrap_pi(off) if circular else off) <= change:
                return False
        self._sent[command] = _Sent(value, now_s)
        return True

    def _setpoint_due(self, now_s: float, *, urgent: bool) -> bool:
        times_s = self._setpoints_s
        if not times_s or now_s < times_s[-1]:
            return True
        if len(times_s) == _MAX_SETPOINTS_PER_S and now_s - times_s[0] < 1.0:
            return False
        # A thousandth less, as ticks fall on tenths that have no exact binary number.
        return urgent or now_s - times_s[-1] >= _SETPOINT_INTERVAL_S - 1e-3

    def _change_heading(self, flown: GuidanceCommand) -> Message:
        lateral_mps2 = STANDARD_GRAVITY_MPS2 * math.tan(flown.max_bank_rad)
        course_over_ground = 0
        return self.command_int(
            mavlink.MAV_CMD_GUIDED_CHANGE_HEADING,
            course_over_ground,
            course_deg(flown.guidance.course_rad),
            lateral_mps2,
        )

    def _change_speed(self, flown: GuidanceCommand) -> Message:
        wanted_mps = flown.guidance.airspeed_mps
        if self._was_refused(mavlink.MAV_CMD_GUIDED_CHANGE_SPEED, wanted_mps):
            wanted_mps = _towards(flown.airspeed_mps, wanted_mps, _SPEED_INSIDE_MPS)
        airspeed, as_fast_as_possible = 0, 0.0
        return self.command_int(
            mavlink.MAV_CMD_GUIDED_CHANGE_SPEED, airspeed, wanted_mps, as_fast_as_possible
        )

    def _change_height(self, flown: GuidanceCommand) -> Message:
        wanted_m = flown.guidance.altitude_m
        if self._was_refused(mavlink.MAV_CMD_GUIDED_CHANGE_ALTITUDE, wanted_m):
            wanted_m = _towards(flown.position.altitude_m, wanted_m, _HEIGHT_ASIDE_M)
        return self.command_int(mavlink.MAV_CMD_GUIDED_CHANGE_ALTITUDE, z_m=wanted_m)

    def _was_refused(self, command: int, value: float) -> bool:
        refused = self._refused.get(command)
        return refused is not None and refused.value == value

    def _position_target(self, flown: GuidanceCommand, now_s: float) -> Message:
        """A point ahead on the commanded course, the velocity along it, yaw and height."""
        guidance, position = flown.guidance, flown.position
        north, east = math.cos(guidance.course_rad), math.sin(guidance.course_rad)
        ahead = LocalFrame(position.lat_deg, position.lon_deg).to_geo(
            _POINT_AHEAD_M * north, _POINT_AHEAD_M * east, -guidance.altitude_m
        )
        ground_speed_mps = math.hypot(flown.velocity_mps[0], flown.velocity_mps[1])
        climb_mps = max(-2.0, min(2.0, 0.5 * (guidance.altitude_m - position.altitude_m)))
        return mavlink.MAVLink_set_position_target_global_int_message(
            int(now_s * 1000.0) % 2**32,
            self.target.system_id,
            self.target.component_id,
            mavlink.MAV_FRAME_GLOBAL,
            _TYPE_MASK,
            round(ahead.lat_deg * 1e7),
            round(ahead.lon_deg * 1e7),
            guidance.altitude_m,
            ground_speed_mps * north,
            ground_speed_mps * east,
            -climb_mps,
            0.0,
            0.0,
            0.0,
            wrap_pi(guidance.course_rad),
            0.0,
        )


def _towards(present: float, wanted: float, step: float) -> float:
    """The wanted value, moderated by a step towards the present one, at most as far as that."""
    return wanted + min(max(present - wanted, -step), step)
