"""PX4 fixed wing: understood, not flown. Decisions are made and announced; no command is sent."""

from typing import ClassVar

from companion.autopilots.adapter import Adapter, Flown
from companion.mavlink.dialect import Message, mavlink

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
_HOLD = 3
_OFFBOARD = 6


class Px4FixedWing(Adapter):
    """PX4's modes: heartbeat custom_mode = main << 16 | sub << 24."""

    name: ClassVar[str] = "PX4"
    can_fly: ClassVar[bool] = False
    intervals_s: ClassVar[dict[int, float]] = {
        mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 0.1,
        mavlink.MAVLINK_MSG_ID_VFR_HUD: 0.25,
        mavlink.MAVLINK_MSG_ID_ADSB_VEHICLE: 0.2,
        mavlink.MAVLINK_MSG_ID_SCALED_PRESSURE: 1.0,
        mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: 1.0,
        mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 1.0,
    }

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
        return _OFFBOARD << 16

    @property
    def fallback_mode(self) -> int:
        """HOLD circles where it is until somebody decides."""
        return _AUTO << 16 | _HOLD << 24

    def set_mode(self, custom_mode: int) -> Message:
        """DO_SET_MODE with main and sub mode."""
        main, sub = custom_mode >> 16 & 0xFF, custom_mode >> 24 & 0xFF
        return self.command_long(
            mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, main, sub
        )

    def command(self, flown: Flown, now_s: float, *, urgent: bool) -> list[Message]:  # noqa: ARG002
        """Nothing: this autopilot is not commanded."""
        return []
