"""PX4's flight modes, and their flags in HEARTBEAT."""

from enum import IntEnum
from typing import Literal

Firmware = Literal["1.16", "1.18"]
_AUTO = 4


def _custom_mode(main: int, sub: int = 0) -> int:
    return main << 16 | sub << 24


class Px4Mode(IntEnum):
    """HEARTBEAT.custom_mode: the main mode in its third byte, the sub mode in the fourth."""

    MANUAL = _custom_mode(1)
    ALTCTL = _custom_mode(2)
    POSCTL = _custom_mode(3)
    READY = _custom_mode(_AUTO, 1)
    TAKEOFF = _custom_mode(_AUTO, 2)
    HOLD = _custom_mode(_AUTO, 3)
    MISSION = _custom_mode(_AUTO, 4)
    RETURN = _custom_mode(_AUTO, 5)
    LAND = _custom_mode(_AUTO, 6)
    GUIDED_COURSE = _custom_mode(_AUTO, 19)  # since 1.18
    ACRO = _custom_mode(5)
    OFFBOARD = _custom_mode(6)
    STABILIZED = _custom_mode(7)


# In these modes the sticks bypass the position controller, so its invalid setpoint has no effect.
WITHOUT_POSITION_CONTROL = frozenset({Px4Mode.MANUAL, Px4Mode.ACRO, Px4Mode.STABILIZED})
PILOTED = WITHOUT_POSITION_CONTROL | {Px4Mode.ALTCTL, Px4Mode.POSCTL}

_CUSTOM_MODE_ENABLED = 1
_AUTO_ENABLED = 4
_GUIDED_ENABLED = 8
_STABILIZE_ENABLED = 16
_MANUAL_INPUT_ENABLED = 64
_SAFETY_ARMED = 128
_UNSTABILIZED = frozenset({Px4Mode.MANUAL, Px4Mode.ACRO})


def modes_of(firmware: Firmware) -> tuple[Px4Mode, ...]:
    """The modes of a version."""
    return tuple(mode for mode in Px4Mode if firmware == "1.18" or mode is not Px4Mode.GUIDED_COURSE)


def mode_of(main: float, sub: float, firmware: Firmware = "1.18") -> Px4Mode | None:
    """The mode for DO_SET_MODE's two numbers, None if unknown; `sub` matters only in AUTO."""
    for mode in modes_of(firmware):
        if mode >> 16 & 0xFF == main and (main != _AUTO or mode >> 24 == sub):
            return mode
    return None


def base_mode(mode: Px4Mode, *, armed: bool) -> int:
    """HEARTBEAT.base_mode."""
    flags = _CUSTOM_MODE_ENABLED
    if mode in PILOTED:
        flags |= _MANUAL_INPUT_ENABLED
    else:
        flags |= _AUTO_ENABLED | _GUIDED_ENABLED
    if mode not in _UNSTABILIZED:
        flags |= _STABILIZE_ENABLED
    if armed:
        flags |= _SAFETY_ARMED
    return flags
