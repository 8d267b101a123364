"""PX4 fixed wing: understood, not flown. Decisions are made and announced; no command is sent."""

from typing import ClassVar

from companion.autopilots.adapter import Adapter, Flown
from companion.autopilots.commands import Outcome
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
_AUTO = 4
_OFFBOARD = 6


class Px4FixedWing(Adapter):
    """PX4's modes: heartbeat custom_mode = main << 16 | sub << 24."""

    name: ClassVar[str] = "PX4"
    can_fly: ClassVar[bool] = False
    intervals_s: ClassVar[dict[int, float]] = {
        mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 0.1,
        mavlink.MAVLINK_MSG_ID_VFR_HUD: 0.25,
        mavlink.MAVLINK_MSG_ID_ADSB_VEHICLE: 0.2,
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

    def engage(self, now_s: float) -> list[Message]:  # noqa: ARG002
        """Nothing: this autopilot is not commanded."""
        return []

    def engaged(self) -> Outcome | None:
        """Nothing was asked."""
        return None

    def command(self, flown: Flown, now_s: float, *, urgent: bool) -> list[Message]:  # noqa: ARG002
        """Nothing: this autopilot is not commanded."""
        return []

    def release(self, custom_mode: int, now_s: float) -> list[Message]:  # noqa: ARG002
        """Nothing: this autopilot is not commanded."""
        return []
