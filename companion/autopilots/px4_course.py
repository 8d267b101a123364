"""GUIDED_COURSE, PX4's way since 1.18: course, height and speed by one command each, without a stream.

Read in its source and flown in its simulation:
- On entry it holds course and height, and flies the cruise speed.
- A course is denied in any other mode, and so is a heading; DO_CHANGE_ALTITUDE is refused for now in all
  other modes but Hold, whose height it changes.
- DO_CHANGE_ALTITUDE is acknowledged for any height; one outside the fence is not flown, which only the
  reported target shows. DO_CHANGE_SPEED is acknowledged for any speed.
- Without commands it flies on for ever.
- PX4 sends its heartbeat once a second, and more often only on request.
"""

import math
from collections import deque
from collections.abc import Mapping
from typing import ClassVar

from companion.autopilots import px4_modes
from companion.autopilots.adapter import Adapter, GuidanceCommand, RefusedValue
from companion.autopilots.px4_way import Way
from companion.autopilots.value_commands import ValueCommands
from companion.avoidance import Control
from companion.geodesy import course_deg
from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import CommandResult, Fact, Heartbeat, NavigationTarget
from companion.units import STANDARD_GRAVITY_MPS2

_COURSE = mavlink.MAV_CMD_GUIDED_CHANGE_HEADING
_HEIGHT = mavlink.MAV_CMD_DO_CHANGE_ALTITUDE
_SPEED = mavlink.MAV_CMD_DO_CHANGE_SPEED
_CONTROLS = {_COURSE: Control.HEADING, _HEIGHT: Control.HEIGHT, _SPEED: Control.SPEED}

_COURSE_CHANGE_RAD = math.radians(1.0)
_HEIGHT_CHANGE_M = 1.0
_SPEED_CHANGE_MPS = 0.3
# An acknowledged command may have met another mode, or been undone.
_REPEAT_S = 2.0
# The mode is acknowledged, and shown, some hundredths of a second before it takes commands.
_SETTLED_S = 0.1
# A refusal may be the first sign of a mode change: nothing more is sent before heartbeats had time to come.
# It counts when they still show the mode, and not just after the entry.
_AFTER_REFUSAL_S, _ENTRY_S = 0.6, 1.0
# The cruise speed is flown anyway: another one is commanded when it differs by more than gusts make it vary.
_SPEED_KEPT_MPS = 1.0
# The target is reported twice a second: this long after a height was acknowledged it shows that height. While
# it does, the height is not repeated: another one would be someone else's order.
_REPORTED_S = 3.0
_SHOWN_AFTER_S, _SAME_HEIGHT_M = 2.0, 1.0
_OWN_HEIGHTS_KNOWN, _FORMER_HEIGHTS_KNOWN = 50, 8
# Until this long after the first command, the target may be one from before.
_FORMER_TARGETS_S = 3.0


class GuidedCourse(Way):
    """Commands course, height and speed on change, and compares the reported target with the height."""

    mode: ClassVar[int] = px4_modes.GUIDED_COURSE
    # At this rate a pilot's mode change is known almost as soon as with ArduPlane.
    heartbeat_interval_s: ClassVar[float | None] = 0.25

    def __init__(self, adapter: Adapter, parameters: Mapping[str, float]) -> None:
        super().__init__(adapter, parameters)
        self._values = ValueCommands(_CONTROLS)
        self._heights_m: deque[float] = deque(maxlen=_OWN_HEIGHTS_KNOWN)  # commanded
        self._height_taken = False  # one of them was reported as the target since the mode was entered
        self._former_m: deque[float] = deque(maxlen=_FORMER_HEIGHTS_KNOWN)  # reported before
        self._accepted_s: float | None = None  # the height sent last
        self._untaken_m: float | None = None
        self._reported: tuple[float, float] | None = None  # the height of the target, and when
        self._began_s: float | None = None
        self._silent_until_s = -math.inf
        self._refused_s: dict[int, float] = {}  # by command: not counted yet
        self._shown_s = -math.inf  # the newest heartbeat with the mode
        self._height_refused = False  # since the last report of refusals

    @property
    def setpoint_loss_mode(self) -> int | None:
        """GUIDED_COURSE, which flies on at the last course without limit."""
        return self.mode

    @property
    def last_setpoint_s(self) -> float:
        """Never: it does not leave the mode by itself."""
        return -math.inf

    def entering(self, command: GuidanceCommand, now_s: float) -> list[Message]:  # noqa: ARG002
        """Nothing; the targets until the mode is entered are former ones."""
        self._began_s = None
        self._heights_m.clear()
        self._height_taken = False
        return []

    def command(self, command: GuidanceCommand, now_s: float, *, urgent: bool) -> list[Message]:  # noqa: ARG002
        """Course, height and speed when they changed."""
        if self._began_s is None:
            self._began_s = now_s
        if now_s < max(self._silent_until_s, self._began_s + _SETTLED_S - 1e-3):
            return []
        self._count_refusals(self._began_s + _ENTRY_S)
        commands = [
            *self._speed(command, now_s),
            *self._course(command, now_s),
            *self._height(command, now_s),
        ]
        return [self._adapter.commands.ask(one, now_s) for one in commands]

    def leaving(self, command: GuidanceCommand, now_s: float) -> list[Message]:  # noqa: ARG002
        """Nothing: the mode is left by a request alone."""
        return []

    def observe(self, fact: Fact, now_s: float) -> None:
        """Process the answers to our commands, the mode, and the height of the reported target."""
        if isinstance(fact, CommandResult) and fact.command in _CONTROLS:
            self._observe_answer(fact, now_s)
        elif isinstance(fact, Heartbeat) and fact.custom_mode == self.mode:
            self._shown_s = now_s
        elif isinstance(fact, NavigationTarget) and fact.altitude_m is not None:
            self._observe_height(fact.altitude_m, now_s)

    def _observe_answer(self, fact: CommandResult, now_s: float) -> None:
        if fact.result in (mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_IN_PROGRESS):
            if fact.command == _HEIGHT and self._accepted_s is None:
                self._accepted_s = now_s
        else:
            self._silent_until_s = now_s + _AFTER_REFUSAL_S
            self._adapter.commands.drop(fact.command)
            if fact.result != mavlink.MAV_RESULT_UNSUPPORTED:
                self._refused_s[fact.command] = now_s
                return
        self._values.answered(fact, self._adapter.commands.outcome(fact.command))

    def _count_refusals(self, from_s: float) -> None:
        """Count the refusals since `from_s` after which the mode was shown; repeat the others."""
        for command, at_s in self._refused_s.items():
            if from_s <= at_s < self._shown_s:
                self._values.refused(command)
            else:
                self._values.resend(command)
        self._refused_s.clear()

    def drop_commands(self) -> None:
        """Forget what was sent; the heights are still known, as the aircraft may be left in the mode."""
        self._values.forget()
        self._refused_s.clear()
        self._accepted_s = self._untaken_m = None
        self._silent_until_s = -math.inf

    def restarted(self) -> None:
        """Forget what is refused altogether."""
        self._values.restarted()

    @property
    def lost_controls(self) -> frozenset[Control]:
        """The controls whose command is refused altogether."""
        return frozenset(_CONTROLS[command] for command in self._values.off)

    def refusals(self) -> list[str]:
        """A height that was acknowledged and is not flown."""
        refused, self._height_refused = self._height_refused, False
        return ["height not taken, outside PX4's fence?"] if refused else []

    def refused_values(self) -> list[RefusedValue]:
        """Values that were refused, and heights that are not flown."""
        return self._values.refused_values()

    def is_foreign_target(self, target: NavigationTarget) -> bool:
        """Whether the reported height is neither one that we commanded nor one from before."""
        if target.altitude_m is None or not self._heights_m:
            return False
        return not self._is_known(target.altitude_m)

    def _course(self, command: GuidanceCommand, now_s: float) -> list[Message]:
        course_rad = command.guidance.course_rad
        if not self._values.is_due(_COURSE, course_rad, now_s, _COURSE_CHANGE_RAD, _REPEAT_S, circular=True):
            return []
        course_over_ground = 0.0
        lateral_mps2 = STANDARD_GRAVITY_MPS2 * math.tan(command.max_bank_rad)
        return [self._adapter.command_long(_COURSE, course_over_ground, course_deg(course_rad), lateral_mps2)]

    def _height(self, command: GuidanceCommand, now_s: float) -> list[Message]:
        altitude_m = command.guidance.altitude_m
        reported_m = self._reported_m(now_s)
        if reported_m is not None and self._heights_m and not self._is_known(reported_m):
            return []  # someone else's order, which the next heartbeat confirms
        shown = reported_m is not None and abs(reported_m - altitude_m) <= _SAME_HEIGHT_M
        repeat_s = math.inf if shown else _REPEAT_S
        if not self._values.is_due(_HEIGHT, altitude_m, now_s, _HEIGHT_CHANGE_M, repeat_s):
            return []
        if not self._heights_m or self._heights_m[-1] != altitude_m:
            self._heights_m.append(altitude_m)
            self._accepted_s = None
        return [self._adapter.command_long(_HEIGHT, altitude_m, mavlink.MAV_FRAME_GLOBAL)]

    def _speed(self, command: GuidanceCommand, now_s: float) -> list[Message]:
        """The speed: never without a sensor, and not while the cruise speed is wanted."""
        if command.airspeed_mps is None:
            return []
        wanted_mps = self._within_limits(command.guidance.airspeed_mps)
        flown_mps = self._parameters.get("FW_AIRSPD_TRIM", command.airspeed_mps)
        if not self._values.was_sent(_SPEED) and abs(wanted_mps - flown_mps) <= _SPEED_KEPT_MPS:
            return []
        if not self._values.is_due(_SPEED, wanted_mps, now_s, _SPEED_CHANGE_MPS, _REPEAT_S):
            return []
        return [self._adapter.change_speed(wanted_mps)]

    def _within_limits(self, airspeed_mps: float) -> float:
        """The nearest speed between the parameters' limits; PX4 acknowledges any."""
        lowest_mps = self._parameters.get("FW_AIRSPD_MIN", 0.0)
        return max(min(airspeed_mps, self._parameters.get("FW_AIRSPD_MAX", math.inf)), lowest_mps)

    def _reported_m(self, now_s: float) -> float | None:
        """The height of the target reported just now; `None` without a recent report."""
        if self._reported is None or now_s - self._reported[1] > _REPORTED_S:
            return None
        return self._reported[0]

    def _is_known(self, altitude_m: float) -> bool:
        """Whether it is a height that we commanded, or one from before."""
        known_m = (*self._heights_m, *self._former_m)
        return any(abs(altitude_m - height_m) <= _SAME_HEIGHT_M for height_m in known_m)

    def _observe_height(self, altitude_m: float, now_s: float) -> None:
        """Compare the reported height with ours: an earlier one shows that ours was not taken."""
        known, self._reported = self._is_known(altitude_m), (altitude_m, now_s)
        if self._heights_m and abs(altitude_m - self._heights_m[-1]) <= _SAME_HEIGHT_M:
            self._adapter.commands.drop(_HEIGHT)
            self._height_taken = True
        entered = self._began_s is not None and now_s - self._began_s > _FORMER_TARGETS_S
        if not (entered or self._height_taken):
            if not known:
                self._former_m.append(altitude_m)
            return
        due = self._accepted_s is not None and now_s - self._accepted_s >= _SHOWN_AFTER_S
        if not (due and known) or self._heights_m[-1] == self._untaken_m:
            return
        if abs(altitude_m - self._heights_m[-1]) > _SAME_HEIGHT_M:
            self._untaken_m, self._height_refused = self._heights_m[-1], True
            self._values.give_up(_HEIGHT)
