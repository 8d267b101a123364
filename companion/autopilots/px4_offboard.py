"""OFFBOARD, PX4's way up to 1.17: it flies a stream of setpoints of position with velocity.

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

from companion.autopilots import px4_modes
from companion.autopilots.adapter import Adapter, GuidanceCommand
from companion.autopilots.px4_way import Way
from companion.autopilots.temporary_parameter import TemporaryParameter
from companion.avoidance import Control
from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import AttitudeTarget, Fact, Parameter

LOST_STREAM_PARAMETER = "COM_OBL_RC_ACT"
# The mode that it enters when the setpoints end. Its other values enter position, altitude or manual mode,
# which wait for sticks, and which a pilot may have chosen himself.
_LOST_STREAM_MODES = {3: px4_modes.RETURN, 4: px4_modes.LAND, 5: px4_modes.HOLD}
TRIM = "FW_AIRSPD_TRIM"

_VELOCITY_ONLY = 3527
_POSITION_AND_VELOCITY = 3520
# The magnitude of the velocity is ignored, but zero makes the attitude setpoint NaN.
_DIRECTION_MPS = 15.0
_STREAM_INTERVAL_S = 0.1
_SETTLED_S = 0.1
# ATTITUDE_TARGET comes five times a second; a single message may be old.
_INVALID_FOR_S = 0.3
_INVALID_KNOWN_S = 2.0
_RECOVERY_S = 1.6
_SPEED_CHANGE_MPS = 0.5
_LOWEST_TRIM_MPS, _HIGHEST_TRIM_MPS = 3.0, 150.0
# The speed is changed only when it differs by more than gusts and climbs make it vary.
_SPEED_KEPT_MPS = 1.0


class Offboard(Way):
    """Streams setpoints, watches the attitude setpoint, and borrows FW_AIRSPD_TRIM."""

    mode: ClassVar[int] = px4_modes.OFFBOARD
    entry_s: ClassVar[float] = 0.6
    exit_s: ClassVar[float] = 0.5

    def __init__(self, adapter: Adapter, parameters: Mapping[str, float]) -> None:
        super().__init__(adapter, parameters)
        self._streamed_s = -math.inf
        self._guided_since_s: float | None = None
        self._invalid_since_s: float | None = None
        self._invalid_s = -math.inf  # the last time
        self._recover_until_s = -math.inf
        self._trim = TemporaryParameter()
        self._refusal_reported = False

    @property
    def setpoint_loss_mode(self) -> int | None:
        """The mode of COM_OBL_RC_ACT, a second after the last setpoint."""
        return _LOST_STREAM_MODES.get(int(self._parameters.get(LOST_STREAM_PARAMETER, 0.0)))

    @property
    def last_setpoint_s(self) -> float:
        """The newest setpoint of the stream."""
        return self._streamed_s

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

    def observe(self, fact: Fact, now_s: float) -> None:
        """Process the validity of the attitude setpoint, and the speed parameter."""
        if isinstance(fact, AttitudeTarget):
            self._observe_attitude(fact, now_s)
        elif isinstance(fact, Parameter) and fact.name == TRIM:
            self._trim.observe(fact.value, now_s)

    def tick(self, now_s: float) -> list[Message]:
        """The speed parameter, when it is due to be sent or repeated."""
        trim_mps = self._trim.due(now_s)
        return [] if trim_mps is None else [self._adapter.set_parameter(TRIM, trim_mps)]

    def drop_commands(self) -> None:
        """Restore the speed parameter."""
        self._trim.restore()

    def restarted(self) -> None:
        """Forget that the speed was refused."""
        self._trim.refused = False

    def setpoint_invalid(self, now_s: float) -> bool:
        """Whether the attitude setpoint has been NaN for a while: then only the sticks fly the aircraft."""
        since_s, last_s = self._invalid_since_s, self._invalid_s
        confirmed = since_s is not None and last_s - since_s >= _INVALID_FOR_S
        return confirmed and now_s - last_s <= _INVALID_KNOWN_S

    @property
    def lost_controls(self) -> frozenset[Control]:
        """The speed, while FW_AIRSPD_TRIM is unknown or after PX4 did not accept it."""
        unknown = self._trim.value is None
        return frozenset({Control.SPEED}) if unknown or self._trim.refused else frozenset()

    def refusals(self) -> list[str]:
        """The speed parameter, once after it was refused."""
        news = self._trim.refused and not self._refusal_reported
        self._refusal_reported = self._trim.refused
        return [f"{TRIM} not accepted"] if news else []

    def advice(self) -> list[str]:
        """COM_OBL_RC_ACT, if PX4 would wait for sticks when the setpoints end."""
        action = self._parameters.get(LOST_STREAM_PARAMETER)
        if action is None or int(action) in _LOST_STREAM_MODES:
            return []
        return [f"{LOST_STREAM_PARAMETER} {action:.0f}: set 5 (Hold)"]

    @property
    def changed_parameters(self) -> dict[str, float]:
        """The original FW_AIRSPD_TRIM while it is changed."""
        return {} if self._trim.original is None else {TRIM: self._trim.original}

    def restore_parameters(self, values: dict[str, float]) -> None:
        """Restore what a former run changed and did not restore, if it is a speed that can be flown."""
        if _LOWEST_TRIM_MPS <= values.get(TRIM, 0.0) <= _HIGHEST_TRIM_MPS:
            self._trim.restore(values[TRIM])

    def _speed_is_wanted(self, command: GuidanceCommand) -> bool:
        """Whether to change the speed: never without a sensor, and not while the present one is wanted."""
        if command.airspeed_mps is None or Control.SPEED in self.lost_controls:
            return False
        differs = abs(command.guidance.airspeed_mps - command.airspeed_mps) > _SPEED_KEPT_MPS
        return differs or self._trim.original is not None

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
                self._adapter.target.system_id,
                self._adapter.target.component_id,
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
