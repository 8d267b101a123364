"""PX4 fixed wing: what its ways of flying share, and which of them is flown.

Since 1.18 that is GUIDED_COURSE (`px4_course`), unless the vehicle lacks the mode or refuses it; before,
OFFBOARD (`px4_offboard`). The way changes only when nothing is left of an earlier take-over.
"""

from collections.abc import Mapping
from typing import ClassVar

from companion.airspace.fences import px4_fence
from companion.autopilots import px4_modes, px4_traffic
from companion.autopilots.adapter import Adapter, GuidanceCommand, RefusedValue
from companion.autopilots.parameters import DEGREE_RAD, LimitSource, Named, ParameterTable
from companion.autopilots.px4_course import GuidedCourse
from companion.autopilots.px4_offboard import LOST_STREAM_PARAMETER, TRIM, Offboard
from companion.autopilots.px4_way import Way
from companion.avoidance import Control
from companion.mavlink.dialect import AVAILABLE_MODES, Message, mavlink
from companion.mavlink.facts import (
    AutopilotVersion,
    AvailableMode,
    CommandResult,
    Fact,
    NavigationTarget,
    Parameter,
    Sender,
)
from companion.model import PriorFlightState

MODES = px4_modes.MODES
# From this version on, leaving OFFBOARD at another height than commanded keeps the attitude setpoint valid.
_VALID_AFTER_CLIMBS_FROM = 1, 17
_GUIDED_COURSE_FROM = 1, 18
# PX4 answers a mode that it does not have as one that it cannot enter now.
_POSTPONED_FOR_GOOD = 3
_MODES_TRIES, _MODES_RETRY_S = 4, 3.0

PARAMETERS = ParameterTable(
    limits=(
        LimitSource("min_airspeed_mps", (Named("FW_AIRSPD_MIN"),)),
        LimitSource("max_airspeed_mps", (Named("FW_AIRSPD_MAX"),)),
        LimitSource("cruise_airspeed_mps", (Named(TRIM),)),
        LimitSource("max_bank_rad", (Named("FW_R_LIM", DEGREE_RAD),)),
        LimitSource("max_climb_mps", (Named("FW_T_CLMB_MAX"),)),
        LimitSource("max_sink_mps", (Named("FW_T_SINK_MAX"),)),
        # Rates of a change of height, well below the maximum rates.
        LimitSource("max_climb_mps", (Named("FW_T_CLMB_R_SP"),)),
        LimitSource("max_sink_mps", (Named("FW_T_SINK_R_SP"),)),
        LimitSource("loiter_radius_m", (Named("NAV_LOITER_RAD"),)),
    ),
    first=(LOST_STREAM_PARAMETER, *px4_traffic.FIRST),
    others=(
        *px4_traffic.OTHERS,
        "GF_ACTION",
        "GF_MAX_HOR_DIST",
        "GF_MAX_VER_DIST",
        "COM_OF_LOSS_T",
    ),
    fence=px4_fence,
)


class _AvailableModes:
    """The modes that the vehicle lists; requested until all are known, or not answered."""

    def __init__(self) -> None:
        self._selectable: dict[int, bool] = {}
        self._indices: set[int] = set()
        self._total: int | None = None
        self._tries = 0
        self._next_s: float | None = None

    def observe(self, fact: AvailableMode) -> None:
        """Store a mode."""
        self._selectable[fact.custom_mode] = fact.selectable
        self._indices.add(fact.index)
        self._total = fact.total

    def lacks(self, custom_mode: int) -> bool:
        """Whether the vehicle lists the mode as one that cannot be chosen, or all modes without this one."""
        return not self._selectable.get(custom_mode, not self._complete)

    def is_due(self, now_s: float) -> bool:
        """Whether to request the list now; if so, it counts as requested."""
        waits = self._next_s is not None and 0.0 <= self._next_s - now_s <= _MODES_RETRY_S
        if self._complete or waits or self._tries >= _MODES_TRIES:
            return False
        self._tries, self._next_s = self._tries + 1, now_s + _MODES_RETRY_S
        return True

    @property
    def _complete(self) -> bool:
        """Whether all modes are known."""
        return self._total is not None and len(self._indices) >= self._total


class Px4FixedWing(Adapter):
    """Guidance for PX4 1.13 and later."""

    name: ClassVar[str] = "PX4"
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
        self._parameters: dict[str, float] = {}
        self._offboard = Offboard(self, self._parameters)
        self._course = GuidedCourse(self, self._parameters)
        self._way: Way = self._offboard
        self._version: tuple[int, int] | None = None
        self._modes = _AvailableModes()
        self._course_refused = False

    @staticmethod
    def mode_name(custom_mode: int) -> str:
        """The mode's name as ground stations show it."""
        return px4_modes.name_of(custom_mode)

    # --- the way of flying

    def choose_way(self) -> None:
        """GUIDED_COURSE from 1.18 on, unless the vehicle lacks it or refused it; otherwise OFFBOARD."""
        usable = not self._course_refused and Control.HEADING not in self._course.lost_controls
        listed = not self._modes.lacks(px4_modes.GUIDED_COURSE)
        self._way = self._course if self._since(_GUIDED_COURSE_FROM) and usable and listed else self._offboard

    def fall_back(self, postponements: int) -> bool:
        """OFFBOARD after GUIDED_COURSE was refused, or postponed for too long; true when that is new."""
        if self._way is not self._course or 0 < postponements < _POSTPONED_FOR_GOOD:
            return False
        self._course_refused = True
        self._way = self._offboard
        return True

    def _since(self, version: tuple[int, int]) -> bool:
        """Whether the firmware is known to be at least of this version."""
        return self._version is not None and self._version >= version

    @property
    def guided_mode(self) -> int:
        """The mode of the present way."""
        return self._way.mode

    @property
    def entry_s(self) -> float:
        """How long OFFBOARD needs setpoints before it is requested."""
        return self._way.entry_s

    @property
    def heartbeat_interval_s(self) -> float | None:
        """How often the present way needs heartbeats."""
        return self._way.heartbeat_interval_s

    @property
    def exit_s(self) -> float:
        """How long OFFBOARD needs level setpoints before it is left."""
        return self._way.exit_s

    @property
    def fallback_mode(self) -> int:
        """HOLD loiters at the present position."""
        return px4_modes.HOLD

    def setpoint_loss_mode(self) -> int | None:
        """The mode of COM_OBL_RC_ACT after OFFBOARD; GUIDED_COURSE stays."""
        return self._way.setpoint_loss_mode

    @property
    def last_setpoint_s(self) -> float:
        """The newest setpoint that OFFBOARD needs."""
        return self._way.last_setpoint_s

    @property
    def invalid_after_climbs(self) -> bool:
        """True up to 1.16: leaving OFFBOARD in a climb makes the attitude setpoint NaN."""
        return not self._since(_VALID_AFTER_CLIMBS_FROM)

    def set_mode(self, custom_mode: int) -> Message:
        """DO_SET_MODE with main and sub mode."""
        return self.command_long(
            mavlink.MAV_CMD_DO_SET_MODE,
            mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED,
            *px4_modes.parts(custom_mode),
        )

    def restore_mode(self, before: PriorFlightState) -> list[Message]:
        """HOLD is entered at the place that was circled before; all other modes by number."""
        if before.mode == px4_modes.HOLD and before.target is not None:
            return [self.reposition(before.target)]
        return super().restore_mode(before)

    def entering(self, command: GuidanceCommand, now_s: float) -> list[Message]:
        """What the present way needs while its mode is entered."""
        return self._way.entering(command, now_s)

    def command(self, command: GuidanceCommand, now_s: float, *, urgent: bool) -> list[Message]:
        """Messages of the present way that fly the command."""
        return self._way.command(command, now_s, urgent=urgent)

    def leaving(self, command: GuidanceCommand, now_s: float) -> list[Message]:
        """What the present way needs while its mode is left."""
        return self._way.leaving(command, now_s)

    @property
    def lost_controls(self) -> frozenset[Control]:
        """The controls that the present way cannot fly."""
        return self._way.lost_controls

    def setpoint_invalid(self, now_s: float) -> bool:
        """Whether OFFBOARD has left the attitude setpoint NaN; no other way does."""
        return self._way is self._offboard and self._offboard.setpoint_invalid(now_s)

    def is_foreign_target(self, target: NavigationTarget) -> bool:
        """Whether someone else gave GUIDED_COURSE another height."""
        return self._way is self._course and self._course.is_foreign_target(target)

    def restarted(self) -> None:
        """Forget what the autopilot refused, and which modes it has."""
        super().restarted()
        self._modes, self._course_refused = _AvailableModes(), False
        for way in (self._offboard, self._course):
            way.restarted()

    def refusals(self) -> list[str]:
        """Commands, and what else was refused since the last call, in words."""
        return [*super().refusals(), *self._way.refusals()]

    def refused_values(self) -> list[RefusedValue]:
        """Values that were refused since the last call."""
        return self._way.refused_values()

    # --- what comes and goes

    def drop_commands(self) -> None:
        """Drop all commands under way, and restore the speed parameter."""
        super().drop_commands()
        self._offboard.drop_commands()
        self._course.drop_commands()

    def observe(self, fact: Fact, now_s: float) -> None:
        """Process answers, parameters, the version, the modes, targets and attitude setpoints."""
        ways: tuple[Way, ...] = (self._offboard, self._course)
        if isinstance(fact, CommandResult):
            ways = (self._way,) if self.commands.is_pending(fact.command) else ()
        super().observe(fact, now_s)
        if isinstance(fact, AutopilotVersion):
            self._version = fact.major, fact.minor
        elif isinstance(fact, AvailableMode):
            self._modes.observe(fact)
        elif isinstance(fact, Parameter):
            self._parameters[fact.name] = fact.value
        for way in ways:
            way.observe(fact, now_s)

    def tick(self, now_s: float) -> list[Message]:
        """Commands and the speed parameter, when they are due; the list of modes from 1.18 on."""
        messages = [*super().tick(now_s), *self._offboard.tick(now_s)]
        if self._since(_GUIDED_COURSE_FROM) and self._modes.is_due(now_s):
            all_modes = 0
            messages.append(self.command_long(mavlink.MAV_CMD_REQUEST_MESSAGE, AVAILABLE_MODES, all_modes))
        return messages

    @property
    def changed_parameters(self) -> dict[str, float]:
        """The original FW_AIRSPD_TRIM while it is changed."""
        return self._offboard.changed_parameters

    def restore_parameters(self, values: dict[str, float]) -> None:
        """Restore what a former run changed and did not restore."""
        self._offboard.restore_parameters(values)

    # --- for the operator

    def other_avoider(self, parameters: Mapping[str, float]) -> str | None:
        """PX4's own avoidance, if it does more than warn in the modes that we fly."""
        return px4_traffic.acting(parameters, offboard=self._way is self._offboard)

    @property
    def traffic_parameters(self) -> tuple[str, ...]:
        """The parameters of PX4's own avoidance."""
        return *px4_traffic.FIRST, *px4_traffic.OTHERS

    def advice(self, parameters: Mapping[str, float]) -> list[str]:
        """What to change, and what is flown instead of a mode that was refused."""
        advice = px4_traffic.receiver_advice(parameters)
        if self._course_refused:
            advice.append("GUIDED_COURSE refused, flying OFFBOARD")
        return advice + (self._offboard.advice() if self._way is self._offboard else [])
