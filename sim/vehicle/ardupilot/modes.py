"""ArduPlane's flight modes, and their flags in HEARTBEAT."""

from enum import IntEnum


class Mode(IntEnum):
    """ArduPlane's numbers in HEARTBEAT.custom_mode."""

    MANUAL = 0
    CIRCLE = 1
    STABILIZE = 2
    FBWA = 5
    FBWB = 6
    CRUISE = 7
    AUTO = 10
    RTL = 11
    LOITER = 12
    TAKEOFF = 13
    AVOID_ADSB = 14
    GUIDED = 15


# The pilot's sticks fly these modes; in all others the autopilot navigates.
PILOTED = frozenset({Mode.MANUAL, Mode.STABILIZE, Mode.FBWA, Mode.FBWB, Mode.CRUISE})

_CUSTOM_MODE_ENABLED = 1
_GUIDED_ENABLED = 8
_STABILIZE_ENABLED = 16
_MANUAL_INPUT_ENABLED = 64
_SAFETY_ARMED = 128


def base_mode(mode: Mode, *, armed: bool) -> int:
    """HEARTBEAT.base_mode as recorded: 81 in MANUAL, 89 in AUTO, plus 128 when armed."""
    flags = _CUSTOM_MODE_ENABLED | _STABILIZE_ENABLED | _MANUAL_INPUT_ENABLED
    if mode not in PILOTED:
        flags |= _GUIDED_ENABLED
    if armed:
        flags |= _SAFETY_ARMED
    return flags
