"""PX4 fixed wing. What it obeys in OFFBOARD: a stream of position with velocity, entered and left with care.

Measured on 1.16: velocity alone is acknowledged and freezes attitude and thrust; a masked height or no
velocity turns the attitude setpoint into NaN; so does leaving position-with-velocity at another height than
the aircraft's, and now and then entering with it. Hence: enter by velocity alone, go over to position with
velocity when the heartbeat shows OFFBOARD, never back; leave with the height where the aircraft is. Speed is
FW_AIRSPD_TRIM and nothing else; it is put back to what it was.
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar

from companion.autopilots.adapter import Adapter, GuidanceCommand
from companion.autopilots.limits import PX4, ParameterTable
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
# COM_OBL_RC_ACT: what it does when the stream of setpoints ends. In position, altitude or manual mode it
# waits for sticks, and whoever is found there may be the pilot himself.
_LOST_STREAM_MODES = {3: _RETURN, 4: _LAND, 5: _HOLD}
LOST_STREAM_PARAMETER = "COM_OBL_RC_ACT"
_TRIM = "FW_AIRSPD_TRIM"
_NAV_TRAFF_ACTS = 2.0  # 0 is off, 1 warns

_VELOCITY_ONLY = 3527
_POSITION_AND_VELOCITY = 3520
# The size of the velocity is ignored; only zero would be harmful.
_DIRECTION_MPS = 15.0
_STREAM_INTERVAL_S = 0.1
_SETTLED_S = 0.1
# Until then, leaving OFFBOARD at another height than was commanded costs the attitude setpoint.
_SURVIVES_CLIMBS_FROM = 1, 17
# The attitude setpoint is seen five times a second: not one message alone, which may be old.
_POISONED_S = 0.3
_POISON_SEEN_S = 2.0
_RECOVERY_S = 1.6
_SPEED_CHANGE_MPS = 0.5
_SPEED_REPEAT_S = 1.0
# For so long a request may be under way.
_LATE_S = 10.0
# Without an answer to so many requests the parameter is left alone.
_SPEED_TRIES = 5


class Px4FixedWing(Adapter):
    """Guidance for PX4 1.13 and later. Modes: heartbeat custom_mode = main << 16 | sub << 24."""

    name: ClassVar[str] = "PX4"
    entry_s: ClassVar[float] = 0.6
    exit_s: ClassVar[float] = 0.5
    intervals_s: ClassVar[dict[int, float]] = {
        mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 0.1,
        mavlink.MAVLINK_MSG_ID_VFR_HUD: 0.25,
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
    parameters: ClassVar[ParameterTable] = PX4

    def __init__(self, target: Sender) -> None:
        super().__init__(target)
        self._streamed_s = -math.inf
        self._guided_since_s: float | None = None
        self._not_a_number_since_s: float | None = None
        self._not_a_number_s = -math.inf  # the last time
        self._recover_until_s = -math.inf
        self._version: tuple[int, int] | None = None
        self._parameters: dict[str, float] = {}
        self._trim_before_mps: float | None = None  # while it is changed
        self._trim_wanted_mps: float | None = None
        self._trim_lent_mps: float | None = None  # what was asked for last
        self._trim_restored: tuple[float, float] | None = None  # to what [m/s], when [s]
        self._trim_asked_s = -math.inf
        self._trim_tries = 0

    @staticmethod
    def mode_name(custom_mode: int) -> str:
        """The mode's name as ground stations show it."""
        main, sub = custom_mode >> 16 & 0xFF, custom_mode >> 24 & 0xFF
        if main == _AUTO:
            return _AUTO_MODES.get(sub, f"AUTO {sub}")
        return _MAIN_MODES.get(main, f"MODE {main}")

    @property
    def guided_mode(self) -> int:
        """OFFBOARD takes setpoints."""
        return _OFFBOARD

    @property
    def fallback_mode(self) -> int:
        """HOLD circles where it is until somebody decides."""
        return _HOLD

    def left_behind_mode(self) -> int | None:
        """A second after the last setpoint: what COM_OBL_RC_ACT says."""
        return _LOST_STREAM_MODES.get(int(self._parameters.get(LOST_STREAM_PARAMETER, 0.0)))

    @property
    def loses_itself_in_climbs(self) -> bool:
        """Up to 1.16: when a pilot takes over in a climb, or the companion dies in it, all becomes NaN."""
        return self._version is None or self._version < _SURVIVES_CLIMBS_FROM

    def set_mode(self, custom_mode: int) -> Message:
        """DO_SET_MODE with main and sub mode."""
        main, sub = custom_mode >> 16 & 0xFF, custom_mode >> 24 & 0xFF
        return self.command_long(
            mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, main, sub
        )

    def give_back(self, before: PriorFlightState) -> list[Message]:
        """HOLD is entered at the place that was circled before, all other modes by name."""
        if before.mode == _HOLD and before.target is not None:
            return [self.reposition(before.target)]
        return super().give_back(before)

    def entering(self, flown: GuidanceCommand, now_s: float) -> list[Message]:
        """Velocity alone, along the course that is flown now."""
        self._guided_since_s = None
        return self._stream(flown, _VELOCITY_ONLY, now_s)

    def command(self, flown: GuidanceCommand, now_s: float, *, urgent: bool) -> list[Message]:
        """The line through our own position along the course, at its height; the speed as a parameter."""
        if self._guided_since_s is None:
            self._guided_since_s = now_s
        if now_s - self._guided_since_s < _SETTLED_S - 1e-3 or self._recovering(now_s):
            return self._stream(flown, _VELOCITY_ONLY, now_s)
        self._want_trim(flown.guidance.airspeed_mps)
        return self._stream(flown, _POSITION_AND_VELOCITY, now_s, urgent=urgent)

    def setpoint_invalid(self, now_s: float) -> bool:
        """Whether the attitude setpoint is no number: then it flies nothing but the sticks."""
        since_s, last_s = self._not_a_number_since_s, self._not_a_number_s
        seen = since_s is not None and last_s - since_s >= _POISONED_S
        return seen and now_s - last_s <= _POISON_SEEN_S

    def leaving(self, flown: GuidanceCommand, now_s: float) -> list[Message]:
        """Straight on at the height where it is; when it was entered late, by velocity alone at first."""
        course_rad = math.atan2(flown.velocity_mps[1], flown.velocity_mps[0])
        level = replace(flown.guidance, course_rad=course_rad, altitude_m=flown.position.altitude_m)
        self._restore_trim()
        if self._guided_since_s is None:
            self._guided_since_s = now_s + self.entry_s - _SETTLED_S
        settled = now_s - self._guided_since_s >= _SETTLED_S - 1e-3
        mask = _POSITION_AND_VELOCITY if settled else _VELOCITY_ONLY
        return self._stream(replace(flown, guidance=level), mask, now_s)

    def stand_back(self) -> None:
        """Forget what was asked; the speed is put back, whoever flies."""
        super().stand_back()
        self._restore_trim()

    def observe(self, fact: Fact, now_s: float) -> None:
        """Take note of answers, parameters, and of an attitude setpoint that is no number any more."""
        super().observe(fact, now_s)
        if isinstance(fact, AttitudeTarget):
            self._learn_attitude(fact, now_s)
        elif isinstance(fact, AutopilotVersion):
            self._version = fact.major, fact.minor
        elif isinstance(fact, Parameter):
            self._parameters[fact.name] = fact.value
            if fact.name == _TRIM:
                self._learn_trim(now_s)

    def tick(self, now_s: float) -> list[Message]:
        """Commands and the speed that are due to be sent again."""
        return [*super().tick(now_s), *self._set_trim(now_s)]

    def other_avoider(self, parameters: Mapping[str, float]) -> str | None:
        """The navigator's reaction to traffic, if it does more than warn."""
        action = parameters.get("NAV_TRAFF_AVOID", 0.0)
        return f"NAV_TRAFF_AVOID {action:.0f}" if action >= _NAV_TRAFF_ACTS else None

    def advice(self, parameters: Mapping[str, float]) -> list[str]:
        """What it does when we fall silent is its most important setting."""
        action = parameters.get(LOST_STREAM_PARAMETER)
        if action is None or int(action) in _LOST_STREAM_MODES:
            return []
        return [f"{LOST_STREAM_PARAMETER} {action:.0f}: set 5 (Hold), or it waits for sticks if we die"]

    @property
    def borrowed(self) -> dict[str, float]:
        """Parameters that we changed, with the values to put back."""
        return {} if self._trim_before_mps is None else {_TRIM: self._trim_before_mps}

    def put_back(self, values: dict[str, float]) -> None:
        """Put back what another companion, since killed, had changed."""
        if _TRIM in values:
            self._trim_before_mps = values[_TRIM]
            self._restore_trim()

    def _stream(
        self, flown: GuidanceCommand, mask: int, now_s: float, *, urgent: bool = False
    ) -> list[Message]:
        due = urgent or not 0.0 <= now_s - self._streamed_s < _STREAM_INTERVAL_S - 1e-3
        if not due:
            return []
        self._streamed_s = now_s
        course_rad = flown.guidance.course_rad
        if mask == _VELOCITY_ONLY:
            course_rad = math.atan2(flown.velocity_mps[1], flown.velocity_mps[0])
        return [
            mavlink.MAVLink_set_position_target_global_int_message(
                int(now_s * 1000.0) % 2**32,
                self.target.system_id,
                self.target.component_id,
                mavlink.MAV_FRAME_GLOBAL_INT,
                mask,
                round(flown.position.lat_deg * 1e7),
                round(flown.position.lon_deg * 1e7),
                flown.position.altitude_m if mask == _VELOCITY_ONLY else flown.guidance.altitude_m,
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
        """Velocity alone for a while brings a poisoned controller back."""
        if self.setpoint_invalid(now_s) and now_s >= self._recover_until_s + _RECOVERY_S:
            self._recover_until_s = now_s + _RECOVERY_S
        return now_s < self._recover_until_s

    def _learn_attitude(self, fact: AttitudeTarget, now_s: float) -> None:
        if fact.finite:
            self._not_a_number_since_s = None
            return
        self._not_a_number_s = now_s
        if self._not_a_number_since_s is None:
            self._not_a_number_since_s = now_s

    # --- speed

    def _learn_trim(self, now_s: float) -> None:
        """What was asked for is there, or there again: a datagram that came late, or twice."""
        if self._trim_is(self._trim_wanted_mps):
            if self._trim_before_mps is not None and self._trim_wanted_mps == self._trim_before_mps:
                self._trim_restored = self._trim_before_mps, now_s
                self._trim_before_mps = None
            self._trim_wanted_mps = None
        elif self._trim_restored is not None and self._trim_before_mps is None:
            before_mps, restored_s = self._trim_restored
            if self._trim_is(self._trim_lent_mps) and now_s - restored_s <= _LATE_S:
                self._trim_before_mps = before_mps
                self._restore_trim()

    def _want_trim(self, airspeed_mps: float) -> None:
        now_mps = self._parameters.get(_TRIM) if self._trim_wanted_mps is None else self._trim_wanted_mps
        if now_mps is None or abs(airspeed_mps - now_mps) <= _SPEED_CHANGE_MPS:
            return
        if self._trim_before_mps is None:
            self._trim_before_mps = self._parameters[_TRIM]
        self._trim_wanted_mps, self._trim_tries = airspeed_mps, 0
        self._trim_lent_mps = airspeed_mps
        self._trim_asked_s = -math.inf

    def _restore_trim(self) -> None:
        before_mps = self._trim_before_mps
        if before_mps is not None and self._trim_wanted_mps != before_mps:
            self._trim_wanted_mps, self._trim_tries = before_mps, 0
            self._trim_asked_s = -math.inf

    def _trim_is(self, wanted_mps: float | None) -> bool:
        return wanted_mps is not None and abs(self._parameters[_TRIM] - wanted_mps) < 0.01

    def _set_trim(self, now_s: float) -> list[Message]:
        wanted_mps = self._trim_wanted_mps
        if wanted_mps is None:
            return []
        # Nobody may ever answer: the waits grow.
        patience_s = _SPEED_REPEAT_S * 2.0 ** min(max(self._trim_tries - _SPEED_TRIES, 0), 5)
        if 0.0 <= now_s - self._trim_asked_s < patience_s:
            return []
        restoring = wanted_mps == self._trim_before_mps
        if self._trim_tries >= _SPEED_TRIES and not restoring:
            return []
        self._trim_asked_s = now_s
        self._trim_tries += 1
        return [
            mavlink.MAVLink_param_set_message(
                self.target.system_id,
                self.target.component_id,
                _TRIM.encode("ascii"),
                wanted_mps,
                mavlink.MAV_PARAM_TYPE_REAL32,
            )
        ]
