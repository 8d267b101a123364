"""The MAVLink dialect: the one place that imports pymavlink, which packs and unpacks messages; no I/O."""

from typing import Any, TypeAlias

from pymavlink.dialects.v20 import ardupilotmega

# pymavlink's generated code is untyped: message fields are attributes created at run time.
mavlink: Any = ardupilotmega
Message: TypeAlias = Any

CRC_EXTRA: dict[int, int] = {message_id: kind.crc_extra for message_id, kind in mavlink.mavlink_map.items()}
MAX_PAYLOAD: dict[int, int] = {
    message_id: kind.unpacker.size for message_id, kind in mavlink.mavlink_map.items()
}

AEROPLANE: int = mavlink.MAV_TYPE_FIXED_WING
# VTOLs fly as a wing at times, which their EXTENDED_SYS_STATE shows.
VTOLS = frozenset(range(19, 26))  # MAV_TYPE_VTOL_...
# A heartbeat of any other type comes from a station, a receiver or another component.
VEHICLES: frozenset[int] = frozenset(
    {
        AEROPLANE,
        *VTOLS,
        mavlink.MAV_TYPE_QUADROTOR,
        mavlink.MAV_TYPE_COAXIAL,
        mavlink.MAV_TYPE_HELICOPTER,
        mavlink.MAV_TYPE_AIRSHIP,
        mavlink.MAV_TYPE_FREE_BALLOON,
        mavlink.MAV_TYPE_ROCKET,
        mavlink.MAV_TYPE_GROUND_ROVER,
        mavlink.MAV_TYPE_SURFACE_BOAT,
        mavlink.MAV_TYPE_SUBMARINE,
        mavlink.MAV_TYPE_HEXAROTOR,
        mavlink.MAV_TYPE_OCTOROTOR,
        mavlink.MAV_TYPE_TRICOPTER,
        mavlink.MAV_TYPE_FLAPPING_WING,
        mavlink.MAV_TYPE_KITE,
        mavlink.MAV_TYPE_PARAFOIL,
        mavlink.MAV_TYPE_DODECAROTOR,
        mavlink.MAV_TYPE_DECAROTOR,
    }
)


def is_vehicle(vehicle_type: int, autopilot: int) -> bool:
    """Whether a heartbeat with this MAV_TYPE and MAV_AUTOPILOT is that of a vehicle's autopilot."""
    return vehicle_type in VEHICLES and autopilot != mavlink.MAV_AUTOPILOT_INVALID


class Encoder:
    """Packs messages into MAVLink 2 frames; each (system, component) has its own sequence numbers."""

    def __init__(self) -> None:
        self._packers: dict[tuple[int, int], Any] = {}

    def encode(self, message: Message, system_id: int, component_id: int) -> bytes:
        """The frame of `message` as sent by this address; `struct.error` if a field is out of range."""
        packer = self._packers.get((system_id, component_id))
        if packer is None:
            packer = mavlink.MAVLink(None, system_id, component_id)
            self._packers[system_id, component_id] = packer
        raw: bytes = message.pack(packer)
        packer.seq = (packer.seq + 1) % 256
        return raw
