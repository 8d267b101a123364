"""PX4 fixed wing: in OFFBOARD it flies a stream of setpoints of position with velocity.

Measured on PX4 1.16:
- A setpoint of velocity alone is acknowledged, but freezes attitude and thrust.
- A masked height, or no velocity, makes the attitude setpoint NaN.
- Leaving OFFBOARD with a setpoint at another height than the aircraft's makes it NaN too; entering OFFBOARD
  with position and velocity sometimes does.

Therefore OFFBOARD is entered with velocity alone, position with velocity follows when the heartbeat shows
OFFBOARD, and OFFBOARD is left with a setpoint at the aircraft's own height. The only speed command is the
parameter FW_AIRSPD_TRIM, which is restored afterwards.
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar

from companion.airspace.fences import px4_fence
from companion.autopilots.adapter import Adapter, GuidanceCommand
from companion.autopilots.parameters import DEGREE_RAD, LimitSource, Named, ParameterTable
from companion.autopilots.temporary_parameter import TemporaryParameter
from companion.avoidance.envelope import Control
from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import AttitudeTarget, AutopilotVersion, Fact, Parameter, Sender
from companion.model import PriorFlightState

_MAIN_MODES = {
    1: "MANUAL",
    2: "ALTCTL",
    3: "POSCTL",
    5: "ACRO",
    6: "OFFBOARD",
    7: "STABILIZED",
    8: "RATTITUDE",
}
_AUTO_MODES = {1: "READY", 2: "TAKEOFF", 3: "HOLD", 4: "MISSION", 5: "RETURN", 6: "LAND", 8: "FOLLOW"}
MODES = frozenset(_MAIN_MODES.values()) | frozenset(_AUTO_MODES.values())
_AUTO = 4
_HOLD = _AUTO << 16 | 3 << 24
_RETURN = _AUTO << 16 | 5 << 24
_LAND = _AUTO << 16 | 6 << 24
_OFFBOARD = 6 << 16
# The mode that COM_OBL_RC_ACT enters when the setpoints end. Its other values enter position, altitude or
# manual mode, which wait for sticks, and which a pilot may have chosen himself.
_LOST_STREAM_MODES = {3: _RETURN, 4: _LAND, 5: _HOLD}
LOST_STREAM_PARAMETER = "COM_OBL_RC_ACT"
_TRIM = "FW_AIRSPD_TRIM"
_TRAFFIC_AVOID_ACTS_FROM = 2.0  # NAV_TRAFF_AVOID: 0 is off, 1 warns

_VELOCITY_ONLY = 3527
_POSITION_AND_VELOCITY = 3520
# The magnitude of the velocity is ignored, but zero makes the attitude setpoint NaN.
_DIRECTION_MPS = 15.0
_STREAM_INTERVAL_S = 0.1
_SETTLED_S = 0.1
# From this version on, leaving OFFBOARD at another height than commanded keeps the attitude setpoint valid.
_VALID_AFTER_CLIMBS_FROM = 1, 17
# ATTITUDE_TARGET comes five times a second; a single message may be old.
_INVALID_FOR_S = 0.3
_INVALID_KNOWN_S = 2.0
_RECOVERY_S = 1.6
_SPEED_CHANGE_MPS = 0.5
_LOWEST_TRIM_MPS, _HIGHEST_TRIM_MPS = 3.0, 150.0
# The speed is changed only when it differs by more than gusts and climbs make it vary.
_SPEED_KEPT_MPS = 1.0

PARAMETERS = ParameterTable(
    limits=(
        LimitSource("min_airspeed_mps", (Named("FW_AIRSPD_MIN"),)),
        LimitSource("max_airspeed_mps", (Named("FW_AIRSPD_MAX"),)),
        LimitSource("cruise_airspeed_mps", (Named(_TRIM),)),
        LimitSource("max_bank_rad", (Named("FW_R_LIM", DEGREE_RAD),)),
        LimitSource("max_climb_mps", (Named("FW_T_CLMB_MAX"),)),
        LimitSource("max_sink_mps", (Named("FW_T_SINK_MAX"),)),
        # Rates of a change of height, well below the maximum rates.
        LimitSource("max_climb_mps", (Named("FW_T_CLMB_R_SP"),)),
        LimitSource("max_sink_mps", (Named("FW_T_SINK_R_SP"),)),
        LimitSource("loiter_radius_m", (Named("NAV_LOITER_RAD"),)),
    ),
    first=(LOST_STREAM_PARAMETER, "NAV_TRAFF_AVOID"),
    others=(
        "GF_ACTION",
        "GF_MAX_HOR_DIST",
        "GF_MAX_VER_DIST",
        "COM_OF_LOSS_T",
    ),
    fence=px4_fence,
)


class Px4FixedWing(Adapter):
    """Guidance for PX4 1.13 and later; a custom mode is main << 16 | sub << 24."""

    name: ClassVar[str] = "PX4"
    entry_s: ClassVar[float] = 0.6
    exit_s: ClassVar[float] = 0.5
    intervals_s: ClassVar[dict[int, float]] = {
        mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 0.1,
        mavlink.MAVLINK_MSG_ID_VFR_HUD: 0.25,
        mavlink.MAVLINK_MSG_ID_SYS_STATUS: 1.0,
        mavlink.MAVLINK_MSG_ID_ADSB_VEHICLE: 0.2,
        mavlink.MAVLINK_MSG_ID_SCALED_PRESSURE: 1.0,
        mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: 1.0,
        mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 1.0,
        mavlink.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT: 0.5,
        mavlink.MAVLINK_MSG_ID_ATTITUDE_TARGET: 0.2,
        mavlink.MAVLINK_MSG_ID_RC_CHANNELS: 0.2,
        mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: 1.0,
        mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: 2.0,
        mavlink.MAVLINK_MSG_ID_WIND_COV: 1.0,
        mavlink.MAVLINK_MSG_ID_HOME_POSITION: 5.0,
    }
    mission_mode: ClassVar[str] = "MISSION"
    climbs_first_m: ClassVar[float] = 10.0  # NAV_FW_ALT_RAD by default
    parameters: ClassVar[ParameterTable] = PARAMETERS

    def __init__(self, target: Sender) -> None:
        super().__init__(target)
        self._streamed_s = -math.inf
        self._guided_since_s: float | None = None
        self._invalid_since_s: float | None = None
        self._invalid_s = -math.inf  # the last time
        self._recover_until_s = -math.inf
        self._version: tuple[int, int] | None = None
        self._parameters: dict[str, float] = {}
        self._trim = TemporaryParameter()
        self._refusal_reported = False

    @staticmethod
    def mode_name(custom_mode: int) -> str:
        """The mode's name as ground stations show it."""
        main, sub = custom_mode >> 16 & 0xFF, custom_mode >> 24 & 0xFF
        if main == _AUTO:
            return _AUTO_MODES.get(sub, f"AUTO {sub}")
        return _MAIN_MODES.get(main, f"MODE {main}")

    @property
    def guided_mode(self) -> int:
        """OFFBOARD, the only mode that takes setpoints."""
        return _OFFBOARD

    @property
    def fallback_mode(self) -> int:
        """HOLD loiters at the present position."""
        return _HOLD

    def setpoint_loss_mode(self) -> int | None:
        """The mode of COM_OBL_RC_ACT, a second after the last setpoint."""
        return _LOST_STREAM_MODES.get(int(self._parameters.get(LOST_STREAM_PARAMETER, 0.0)))

    @property
    def last_setpoint_s(self) -> float:
        """The newest setpoint of the stream."""
        return self._streamed_s

    @property
    def invalid_after_climbs(self) -> bool:
        """True up to 1.16: leaving OFFBOARD in a climb makes the attitude setpoint NaN."""
        return self._version is None or self._version < _VALID_AFTER_CLIMBS_FROM

    def set_mode(self, custom_mode: int) -> Message:
        """DO_SET_MODE with main and sub mode."""
        main, sub = custom_mode >> 16 & 0xFF, custom_mode >> 24 & 0xFF
        return self.command_long(
            mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, main, sub
        )

    def restore_mode(self, before: PriorFlightState) -> list[Message]:
        """HOLD is entered at the place that was circled before; all other modes by number."""
        if before.mode == _HOLD and before.target is not None:
            return [self.reposition(before.target)]
        return super().restore_mode(before)

    def entering(self, command: GuidanceCommand, now_s: float) -> list[Message]:
        """Velocity alone, along the present course."""
        self._guided_since_s = None
        return self._stream(command, _VELOCITY_ONLY, now_s)

    def command(self, command: GuidanceCommand, now_s: float, *, urgent: bool) -> list[Message]:
        """A line through our position along the course at the commanded height; speed is a parameter."""
        if self._guided_since_s is None:
            self._guided_since_s = now_s
        if now_s - self._guided_since_s < _SETTLED_S - 1e-3 or self._recovering(now_s):
            return self._stream(command, _VELOCITY_ONLY, now_s)
        if self._speed_is_wanted(command):
            self._trim.change(command.guidance.airspeed_mps, _SPEED_CHANGE_MPS)
        return self._stream(command, _POSITION_AND_VELOCITY, now_s, urgent=urgent)

    def _speed_is_wanted(self, command: GuidanceCommand) -> bool:
        """Whether to change the speed: never without a sensor, and not while the present one is wanted."""
        if command.airspeed_mps is None or Control.SPEED in self.lost_controls:
            return False
        differs = abs(command.guidance.airspeed_mps - command.airspeed_mps) > _SPEED_KEPT_MPS
        return differs or self._trim.original is not None

    @property
    def lost_controls(self) -> frozenset[Control]:
        """The speed, while FW_AIRSPD_TRIM is unknown or after PX4 did not accept it."""
        unknown = self._trim.value is None
        return frozenset({Control.SPEED}) if unknown or self._trim.refused else frozenset()

    def restarted(self) -> None:
        """Forget what the autopilot refused."""
        super().restarted()
        self._trim.refused = False

    def refusals(self) -> list[str]:
        """Commands, and the speed parameter, that were refused since the last call, in words."""
        refusals = super().refusals()
        if self._trim.refused and not self._refusal_reported:
            refusals.append(f"{_TRIM} not accepted")
        self._refusal_reported = self._trim.refused
        return refusals

    def setpoint_invalid(self, now_s: float) -> bool:
        """Whether the attitude setpoint has been NaN for a while: then only the sticks fly the aircraft."""
        since_s, last_s = self._invalid_since_s, self._invalid_s
        confirmed = since_s is not None and last_s - since_s >= _INVALID_FOR_S
        return confirmed and now_s - last_s <= _INVALID_KNOWN_S

    def leaving(self, command: GuidanceCommand, now_s: float) -> list[Message]:
        """Straight on at the present height; velocity alone at first if OFFBOARD was entered just now."""
        course_rad = math.atan2(command.velocity_mps[1], command.velocity_mps[0])
        level = replace(command.guidance, course_rad=course_rad, altitude_m=command.position.altitude_m)
        self._trim.restore()
        if self._guided_since_s is None:
            self._guided_since_s = now_s + self.entry_s - _SETTLED_S
        settled = now_s - self._guided_since_s >= _SETTLED_S - 1e-3
        mask = _POSITION_AND_VELOCITY if settled else _VELOCITY_ONLY
        return self._stream(replace(command, guidance=level), mask, now_s)

    def drop_commands(self) -> None:
        """Drop all commands under way, and restore the speed parameter."""
        super().drop_commands()
        self._trim.restore()

    def observe(self, fact: Fact, now_s: float) -> None:
        """Process answers, parameters, the version, and the validity of the attitude setpoint."""
        super().observe(fact, now_s)
        if isinstance(fact, AttitudeTarget):
            self._observe_attitude(fact, now_s)
        elif isinstance(fact, AutopilotVersion):
            self._version = fact.major, fact.minor
        elif isinstance(fact, Parameter):
            self._parameters[fact.name] = fact.value
            if fact.name == _TRIM:
                self._trim.observe(fact.value, now_s)

    def tick(self, now_s: float) -> list[Message]:
        """Commands and the speed parameter, when they are due to be sent or repeated."""
        trim_mps = self._trim.due(now_s)
        trim = [] if trim_mps is None else [self.set_parameter(_TRIM, trim_mps)]
        return [*super().tick(now_s), *trim]

    def other_avoider(self, parameters: Mapping[str, float]) -> str | None:
        """NAV_TRAFF_AVOID, if it does more than warn."""
        action = parameters.get("NAV_TRAFF_AVOID", 0.0)
        return f"NAV_TRAFF_AVOID {action:.0f}" if action >= _TRAFFIC_AVOID_ACTS_FROM else None

    def advice(self, parameters: Mapping[str, float]) -> list[str]:
        """COM_OBL_RC_ACT, if PX4 would wait for sticks when the setpoints end."""
        action = parameters.get(LOST_STREAM_PARAMETER)
        if action is None or int(action) in _LOST_STREAM_MODES:
            return []
        return [f"{LOST_STREAM_PARAMETER} {action:.0f}: set 5 (Hold)"]

    @property
    def changed_parameters(self) -> dict[str, float]:
        """The original FW_AIRSPD_TRIM while it is changed."""
        return {} if self._trim.original is None else {_TRIM: self._trim.original}

    def restore_parameters(self, values: dict[str, float]) -> None:
        """Restore what a former run changed and did not restore, if it is a speed that can be flown."""
        if _LOWEST_TRIM_MPS <= values.get(_TRIM, 0.0) <= _HIGHEST_TRIM_MPS:
            self._trim.restore(values[_TRIM])

    def _stream(
        self, command: GuidanceCommand, mask: int, now_s: float, *, urgent: bool = False
    ) -> list[Message]:
        due = urgent or not 0.0 <= now_s - self._streamed_s < _STREAM_INTERVAL_S - 1e-3
        if not due:
            return []
        self._streamed_s = now_s
        course_rad = command.guidance.course_rad
        if mask == _VELOCITY_ONLY:
            course_rad = math.atan2(command.velocity_mps[1], command.velocity_mps[0])
        return [
            mavlink.MAVLink_set_position_target_global_int_message(
                int(now_s * 1000.0) % 2**32,
                self.target.system_id,
                self.target.component_id,
                mavlink.MAV_FRAME_GLOBAL_INT,
                mask,
                round(command.position.lat_deg * 1e7),
                round(command.position.lon_deg * 1e7),
                command.position.altitude_m if mask == _VELOCITY_ONLY else command.guidance.altitude_m,
                _DIRECTION_MPS * math.cos(course_rad),
                _DIRECTION_MPS * math.sin(course_rad),
                0.0,
                0.0,
                0.0,
                0.0,
                0.0,
                0.0,
            )
        ]

    def _recovering(self, now_s: float) -> bool:
        """Whether velocity alone is streamed, which makes an invalid attitude setpoint valid again."""
        if self.setpoint_invalid(now_s) and now_s >= self._recover_until_s + _RECOVERY_S:
            self._recover_until_s = now_s + _RECOVERY_S
        return now_s < self._recover_until_s

    def _observe_attitude(self, fact: AttitudeTarget, now_s: float) -> None:
        if fact.finite:
            self._invalid_since_s = None
            return
        self._invalid_s = now_s
        if self._invalid_since_s is None:
            self._invalid_since_s = now_s
