"""ArduPlane: in GUIDED it flies the 4300x commands, and of position targets the height alone.

It ignores SET_POSITION_TARGET_LOCAL_NED without an answer. Of SET_POSITION_TARGET_GLOBAL_INT it ignores
course and speed; the message is sent complete for its height and for other readers.
"""

import math
from collections import deque
from collections.abc import Mapping
from typing import ClassVar

from companion.airspace.fences import ardupilot_fence
from companion.autopilots.adapter import Adapter, GuidanceCommand, RefusedValue
from companion.autopilots.parameters import DEGREE_RAD, LimitSource, Named, ParameterTable
from companion.autopilots.value_commands import ValueCommands
from companion.avoidance import Control
from companion.geodesy import GeoPoint, LocalFrame, course_deg, wrap_pi
from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import CommandResult, Fact, NavigationTarget, Parameter, Sender
from companion.model import PriorFlightState
from companion.units import STANDARD_GRAVITY_MPS2

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
    22: "QAUTOTUNE",
    23: "QACRO",
    24: "THERMAL",
    25: "LOITER_QLAND",
    26: "AUTOLAND",
}
LOITER, GUIDED = 12, 15

# Each heading command resets the heading controller's integrator: it is sent on change, and repeated slowly
# in case it was lost.
_HEADING_CHANGE_RAD = math.radians(1.0)
_HEADING_REPEAT_S = 2.0
_SPEED_CHANGE_MPS = 0.3
_HEIGHT_CHANGE_M = 1.0
_SPEED_AND_HEIGHT_REPEAT_S = 10.0
_SETPOINT_INTERVAL_S = 0.2
_MAX_SETPOINTS_PER_S = 10
_POINT_AHEAD_M = 500.0
# A course by DO_REPOSITION: so far ahead that the aircraft never gets there to circle, and that the course
# to the point stays the one commanded.
_PLACE_AHEAD_M = 10_000.0
_PLACE_WITHIN_FENCE_M = 1_500.0  # a place beyond the autopilot's fence is refused
_PLACE_REPEAT_S = 10.0
# The target is reported twice a second: it may be a place before the newest one.
_PLACES_KNOWN, _SAME_PLACE_M = 8, 50.0
# The speed is commanded only when it differs by more than gusts and climbs make it vary.
_SPEED_KEPT_MPS = 1.5
# A refused value is moderated by this. A speed at the limit may be refused because the autopilot rounds it.
_SPEED_STEP_MPS = 1.0
_HEIGHT_STEP_M = 2.0  # 0 and -1 m above mean sea level mean "none" and are denied
_TYPE_MASK = (
    mavlink.POSITION_TARGET_TYPEMASK_AX_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_AY_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_AZ_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE
)
_TAKES_TRAFFIC = ("ADSB_TYPE", "ADSB_ENABLE")  # before 4.1 the latter
_AVOIDANCE_ACTS_FROM = 2.0  # AVD_F_ACTION: 0 does nothing, 1 reports

# The options of the firmware that Companion flies by. A build may lack the first three.
_CONTROLS = {
    mavlink.MAV_CMD_GUIDED_CHANGE_HEADING: Control.HEADING,
    mavlink.MAV_CMD_GUIDED_CHANGE_SPEED: Control.SPEED,
    mavlink.MAV_CMD_GUIDED_CHANGE_ALTITUDE: Control.HEIGHT,
    mavlink.MAV_CMD_DO_REPOSITION: Control.HEADING,
}


_MISSION_RESTART = "MIS_RESTART"
# Versions before 4.5 have other names and units.
PARAMETERS = ParameterTable(
    limits=(
        LimitSource("min_airspeed_mps", (Named("AIRSPEED_MIN"), Named("ARSPD_FBW_MIN"))),
        LimitSource("max_airspeed_mps", (Named("AIRSPEED_MAX"), Named("ARSPD_FBW_MAX"))),
        LimitSource("cruise_airspeed_mps", (Named("AIRSPEED_CRUISE"), Named("TRIM_ARSPD_CM", 0.01))),
        LimitSource(
            "max_bank_rad", (Named("ROLL_LIMIT_DEG", DEGREE_RAD), Named("LIM_ROLL_CD", 0.01 * DEGREE_RAD))
        ),
        LimitSource("max_climb_mps", (Named("TECS_CLMB_MAX"),)),
        LimitSource("max_sink_mps", (Named("TECS_SINK_MAX"),)),
        LimitSource("loiter_radius_m", (Named("WP_LOITER_RAD"),)),
    ),
    first=("AVD_ENABLE", "AVD_F_ACTION"),
    others=(
        _MISSION_RESTART,
        *_TAKES_TRAFFIC,
        "FENCE_ENABLE",
        "FENCE_ACTION",
        "FENCE_AUTOENABLE",
        "FENCE_TYPE",
        "FENCE_OPTIONS",
        "FENCE_RADIUS",
        "FENCE_ALT_MIN",
        "FENCE_ALT_MAX",
        "FENCE_MARGIN",
    ),
    fence=ardupilot_fence,
    mission_total="MIS_TOTAL",
    fence_total="FENCE_TOTAL",
    stall_prevention=True,
)


class ArduPlane(Adapter):
    """Guidance for ArduPlane 4.1 and later."""

    name: ClassVar[str] = "ArduPlane"
    intervals_s: ClassVar[dict[int, float]] = {
        # The heartbeat carries the mode: at this rate a pilot's mode change is known within 0.2 s.
        mavlink.MAVLINK_MSG_ID_HEARTBEAT: 0.2,
        mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 0.1,
        mavlink.MAVLINK_MSG_ID_VFR_HUD: 0.25,
        mavlink.MAVLINK_MSG_ID_SYS_STATUS: 1.0,
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
    mission_mode: ClassVar[str] = "AUTO"
    keeps_guided_target: ClassVar[bool] = True
    home_is_item_0: ClassVar[bool] = True
    forgets_mission_speed: ClassVar[bool] = True
    loiter_modes: ClassVar[frozenset[str]] = frozenset({"LOITER", "CIRCLE"})
    course_hold_modes: ClassVar[frozenset[str]] = frozenset({"CRUISE", "FBWB"})
    parameters: ClassVar[ParameterTable] = PARAMETERS

    def __init__(self, target: Sender) -> None:
        super().__init__(target)
        self._restarts_mission = False
        self._values = ValueCommands(_CONTROLS)
        self._places: deque[GeoPoint] = deque(maxlen=_PLACES_KNOWN)
        self._setpoints_s: deque[float] = deque(maxlen=_MAX_SETPOINTS_PER_S)

    @staticmethod
    def mode_name(custom_mode: int) -> str:
        """The mode's name as ground stations show it."""
        return MODES.get(custom_mode, f"MODE {custom_mode}")

    @property
    def guided_mode(self) -> int:
        """GUIDED, the only mode that takes the 4300x commands."""
        return GUIDED

    @property
    def fallback_mode(self) -> int:
        """LOITER circles at the present position."""
        return LOITER

    def setpoint_loss_mode(self) -> int | None:
        """GUIDED, which flies on at the last heading without limit."""
        return GUIDED

    def set_mode(self, custom_mode: int) -> Message:
        """DO_SET_MODE. Entering GUIDED clears all targets, which must then be sent again."""
        return self.command_long(
            mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, custom_mode
        )

    def restore_mode(self, before: PriorFlightState) -> list[Message]:
        """GUIDED is entered with its former target; all other modes by number."""
        if before.mode == GUIDED and before.target is not None:
            return [self.reposition(before.target)]
        return super().restore_mode(before)

    def drop_commands(self) -> None:
        """Drop all commands under way, and what is known of those sent."""
        super().drop_commands()
        self._values.forget()
        self._places.clear()

    def restarted(self) -> None:
        """Forget what the autopilot refused."""
        super().restarted()
        self._values.restarted()

    @property
    def lost_controls(self) -> frozenset[Control]:
        """The course without heading commands and repositions, and the speed without speed commands.

        The height is never lost: position targets, which are not acknowledged, command it too.
        """
        lost = set()
        if {mavlink.MAV_CMD_GUIDED_CHANGE_HEADING, mavlink.MAV_CMD_DO_REPOSITION} <= self._values.off:
            lost.add(Control.HEADING)
        if mavlink.MAV_CMD_GUIDED_CHANGE_SPEED in self._values.off:
            lost.add(Control.SPEED)
        return frozenset(lost)

    def observe(self, fact: Fact, now_s: float) -> None:
        """Process answers: a refused guided command is sent once more, moderated, and then given up.

        A command that is unsupported, or refused with every value, is not sent again.
        """
        under_way = isinstance(fact, CommandResult) and self.commands.is_pending(fact.command)
        super().observe(fact, now_s)
        if isinstance(fact, Parameter) and fact.name == _MISSION_RESTART:
            self._restarts_mission = fact.value >= 1.0
        if isinstance(fact, CommandResult) and under_way:
            self._values.answered(fact, self.commands.outcome(fact.command))

    def leaving(self, command: GuidanceCommand, now_s: float) -> list[Message]:  # noqa: ARG002
        """Nothing; a course that is still under way must not arrive after the mode was changed."""
        self.commands.drop(mavlink.MAV_CMD_DO_REPOSITION)
        return []

    @property
    def restarts_mission(self) -> bool:
        """MIS_RESTART, once it is known."""
        return self._restarts_mission

    def other_avoider(self, parameters: Mapping[str, float]) -> str | None:
        """AP_Avoidance, if it does more than report."""
        if (
            parameters.get("AVD_ENABLE", 0.0) < 1.0
            or parameters.get("AVD_F_ACTION", 0.0) < _AVOIDANCE_ACTS_FROM
        ):
            return None
        return f"AVD_ENABLE with AVD_F_ACTION {parameters['AVD_F_ACTION']:.0f}"

    @property
    def traffic_parameters(self) -> tuple[str, ...]:
        """The parameters of AP_Avoidance."""
        return self.parameters.first

    def ignores_traffic(self, parameters: Mapping[str, float]) -> str | None:
        """ADSB_TYPE or ADSB_ENABLE, if it is 0; any other type takes ADSB_VEHICLE from every link."""
        known = (name for name in _TAKES_TRAFFIC if name in parameters)
        return next((f"{name} {parameters[name]:.0f}" for name in known if parameters[name] < 1.0), None)

    def refused_values(self) -> list[RefusedValue]:
        """Values that were refused since the last call, also when moderated."""
        return self._values.refused_values()

    def command(self, command: GuidanceCommand, now_s: float, *, urgent: bool) -> list[Message]:
        """Course, speed and height commands when they changed, and the stream of position targets."""
        messages = [*self._course(command, now_s)]
        if self._speed_is_due(command, now_s):
            messages.append(self.commands.ask(self._change_speed(command), now_s))
        height = (mavlink.MAV_CMD_GUIDED_CHANGE_ALTITUDE, command.guidance.altitude_m)
        if self._values.is_due(*height, now_s, _HEIGHT_CHANGE_M, _SPEED_AND_HEIGHT_REPEAT_S):
            messages.append(self.commands.ask(self._change_height(command), now_s))
        if self._setpoint_due(now_s, urgent=urgent):
            self._setpoints_s.append(now_s)
            messages.append(self._position_target(command, now_s))
        return messages

    def _course(self, command: GuidanceCommand, now_s: float) -> list[Message]:
        """A course command if it is due; by a place far ahead where heading commands are unsupported."""
        kind, repeat_s = mavlink.MAV_CMD_GUIDED_CHANGE_HEADING, _HEADING_REPEAT_S
        if kind in self._values.off:
            kind, repeat_s = mavlink.MAV_CMD_DO_REPOSITION, _PLACE_REPEAT_S
        course_rad = command.guidance.course_rad
        if not self._values.is_due(kind, course_rad, now_s, _HEADING_CHANGE_RAD, repeat_s, circular=True):
            return []
        by_place = kind == mavlink.MAV_CMD_DO_REPOSITION
        message = self._go_far_ahead(command) if by_place else self._change_heading(command)
        return [self.commands.ask(message, now_s)]

    def _speed_is_due(self, command: GuidanceCommand, now_s: float) -> bool:
        """Whether to command the speed: never without a sensor, and not while the present one is wanted."""
        kind, wanted_mps = mavlink.MAV_CMD_GUIDED_CHANGE_SPEED, command.guidance.airspeed_mps
        if command.airspeed_mps is None:
            return False
        if not self._values.was_sent(kind) and abs(wanted_mps - command.airspeed_mps) <= _SPEED_KEPT_MPS:
            return False
        return self._values.is_due(kind, wanted_mps, now_s, _SPEED_CHANGE_MPS, _SPEED_AND_HEIGHT_REPEAT_S)

    def _setpoint_due(self, now_s: float, *, urgent: bool) -> bool:
        times_s = self._setpoints_s
        if not times_s or now_s < times_s[-1]:
            return True
        if len(times_s) == _MAX_SETPOINTS_PER_S and now_s - times_s[0] < 1.0:
            return False
        # Ticks come at tenths of a second, which have no exact binary representation: hence the tolerance.
        return urgent or now_s - times_s[-1] >= _SETPOINT_INTERVAL_S - 1e-3

    def _change_heading(self, command: GuidanceCommand) -> Message:
        lateral_mps2 = STANDARD_GRAVITY_MPS2 * math.tan(command.max_bank_rad)
        course_over_ground = 0
        return self.command_int(
            mavlink.MAV_CMD_GUIDED_CHANGE_HEADING,
            course_over_ground,
            course_deg(command.guidance.course_rad),
            lateral_mps2,
        )

    def _go_far_ahead(self, command: GuidanceCommand) -> Message:
        """A reposition along the course; outside GUIDED, as after a pilot's mode change, it is refused."""
        refused = self._values.was_refused(mavlink.MAV_CMD_DO_REPOSITION, command.guidance.course_rad)
        place = self._ahead(command, _PLACE_WITHIN_FENCE_M if refused else _PLACE_AHEAD_M)
        self._places.append(place)
        return self.reposition(place, change_mode=False)

    def is_own_target(self, target: NavigationTarget) -> bool:
        """Whether a reported navigation target is one of our newest places far ahead."""
        here = LocalFrame(target.lat_deg, target.lon_deg)
        return any(math.hypot(*here.to_ned_m(place)[:2]) <= _SAME_PLACE_M for place in self._places)

    @staticmethod
    def _ahead(command: GuidanceCommand, distance_m: float) -> GeoPoint:
        """The place this far ahead on the commanded course, at the commanded height."""
        guidance, position = command.guidance, command.position
        return LocalFrame(position.lat_deg, position.lon_deg).to_geo(
            distance_m * math.cos(guidance.course_rad),
            distance_m * math.sin(guidance.course_rad),
            -guidance.altitude_m,
        )

    def _change_speed(self, command: GuidanceCommand) -> Message:
        wanted_mps = command.guidance.airspeed_mps
        refused = self._values.was_refused(mavlink.MAV_CMD_GUIDED_CHANGE_SPEED, wanted_mps)
        if refused and command.airspeed_mps is not None:
            wanted_mps = _towards(command.airspeed_mps, wanted_mps, _SPEED_STEP_MPS)
        airspeed, full_acceleration = 0, 0.0
        return self.command_int(mavlink.MAV_CMD_GUIDED_CHANGE_SPEED, airspeed, wanted_mps, full_acceleration)

    def _change_height(self, command: GuidanceCommand) -> Message:
        wanted_m = command.guidance.altitude_m
        if self._values.was_refused(mavlink.MAV_CMD_GUIDED_CHANGE_ALTITUDE, wanted_m):
            wanted_m = _towards(command.position.altitude_m, wanted_m, _HEIGHT_STEP_M)
        return self.command_int(mavlink.MAV_CMD_GUIDED_CHANGE_ALTITUDE, z_m=wanted_m)

    def _position_target(self, command: GuidanceCommand, now_s: float) -> Message:
        """A point ahead on the commanded course at the commanded height, with velocity and yaw along it."""
        guidance, position = command.guidance, command.position
        north, east = math.cos(guidance.course_rad), math.sin(guidance.course_rad)
        ahead = self._ahead(command, _POINT_AHEAD_M)
        ground_speed_mps = math.hypot(command.velocity_mps[0], command.velocity_mps[1])
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
    """The wanted value, moved by at most `step` towards the present one."""
    return wanted + min(max(present - wanted, -step), step)
