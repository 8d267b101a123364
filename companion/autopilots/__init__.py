"""One file per autopilot: its modes and parameters, and the messages that make it fly a guidance."""

from companion.autopilots import ardupilot, px4
from companion.autopilots.adapter import Adapter, is_setpoint
from companion.autopilots.ardupilot import ArduPlane
from companion.autopilots.px4 import Px4FixedWing
from companion.mavlink.dialect import mavlink
from companion.mavlink.facts import Sender

NAMES = {"ardupilot": mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, "px4": mavlink.MAV_AUTOPILOT_PX4}

# Mode names as ground stations show them.
MODES_OF = {"ardupilot": frozenset(ardupilot.MODES.values()), "px4": px4.MODES}
MODE_NAMES = MODES_OF["ardupilot"] | MODES_OF["px4"]
# Modes that are flown by hand, that take off or land, or in which something else avoids or sends setpoints.
NEVER_TAKEN = frozenset(
    {
        "MANUAL", "STABILIZE", "STABILIZED", "TRAINING", "ACRO", "RATTITUDE", "FBWA", "ALTCTL", "POSCTL",
        "AUTOTUNE", "INITIALISING", "READY", "TAKEOFF", "LAND", "AUTOLAND", "LOITER_QLAND", "QSTABILIZE",
        "QHOVER", "QLOITER", "QLAND", "QRTL", "QAUTOTUNE", "QACRO", "AVOID_ADSB", "OFFBOARD", "SIMPLE",
        "TERMINATION", "ALTITUDE_CRUISE", "POSITION_SLOW", "PRECLAND", "VTOL_TAKEOFF", "DESCEND",
        "GUIDED_COURSE", *(f"EXTERNAL{number}" for number in range(1, 9)),
    }
)  # fmt: skip

_KINDS: dict[int, type[Adapter]] = {
    mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA: ArduPlane,
    mavlink.MAV_AUTOPILOT_PX4: Px4FixedWing,
}


def choose(autopilot: int, target: Sender) -> Adapter | None:
    """An adapter for the MAV_AUTOPILOT of a heartbeat; `None` when there is none."""
    kind = _KINDS.get(autopilot)
    return None if kind is None else kind(target)


__all__ = [
    "MODES_OF",
    "MODE_NAMES",
    "NAMES",
    "NEVER_TAKEN",
    "Adapter",
    "ArduPlane",
    "Px4FixedWing",
    "choose",
    "is_setpoint",
]
