"""One file per autopilot: what it says of itself, and how guidance becomes messages that it obeys."""

from companion.autopilots import ardupilot, px4
from companion.autopilots.adapter import Adapter
from companion.autopilots.ardupilot import ArduPlane
from companion.autopilots.px4 import Px4FixedWing
from companion.mavlink.dialect import mavlink
from companion.mavlink.facts import Sender

NAMES = {"ardupilot": mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, "px4": mavlink.MAV_AUTOPILOT_PX4}

# As ground stations show them.
MODE_NAMES = frozenset(ardupilot.MODES.values()) | px4.MODES

_KINDS: dict[int, type[Adapter]] = {
    mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA: ArduPlane,
    mavlink.MAV_AUTOPILOT_PX4: Px4FixedWing,
}


def choose(autopilot: int, target: Sender) -> Adapter | None:
    """The adapter for the autopilot that a heartbeat names (MAV_AUTOPILOT), or `None`."""
    kind = _KINDS.get(autopilot)
    return None if kind is None else kind(target)


__all__ = ["MODE_NAMES", "NAMES", "Adapter", "ArduPlane", "Px4FixedWing", "choose"]
