"""The MAVLink dialect: the one place that imports pymavlink, which packs and unpacks messages; no I/O."""

import struct
from typing import Any, ClassVar, TypeAlias

from pymavlink.dialects.v20 import ardupilotmega

# pymavlink's generated code is untyped: message fields are attributes created at run time.
mavlink: Any = ardupilotmega
Message: TypeAlias = Any

AVAILABLE_MODES = 435


class AvailableModesMessage(mavlink.MAVLink_message):  # type: ignore[misc]
    """AVAILABLE_MODES of common.xml, in the form of pymavlink's classes; its dialect lacks the message."""

    id = AVAILABLE_MODES
    msgname = "AVAILABLE_MODES"
    fieldnames: ClassVar = [
        "number_modes", "mode_index", "standard_mode", "custom_mode", "properties", "mode_name"
    ]  # fmt: skip
    ordered_fieldnames: ClassVar = [
        "custom_mode", "properties", "number_modes", "mode_index", "standard_mode", "mode_name"
    ]  # fmt: skip
    fieldtypes: ClassVar = ["uint8_t", "uint8_t", "uint8_t", "uint32_t", "uint32_t", "char"]
    fielddisplays_by_name: ClassVar[dict[str, str]] = {}
    fieldenums_by_name: ClassVar[dict[str, str]] = {}
    fieldunits_by_name: ClassVar[dict[str, str]] = {}
    native_format = bytearray(b"<IIBBBc")
    orders: ClassVar = [2, 3, 4, 0, 1, 5]
    lengths: ClassVar = [1, 1, 1, 1, 1, 1]
    array_lengths: ClassVar = [0, 0, 0, 0, 0, 35]
    crc_extra = 134
    unpacker = struct.Struct("<IIBBB35s")
    instance_field = None
    instance_offset = -1

    def __init__(self, *values: Any) -> None:
        """Make it from the values of `fieldnames`; the name is bytes."""
        super().__init__(self.id, self.msgname)
        self._fieldnames = self.fieldnames
        self._instance_field, self._instance_offset = self.instance_field, self.instance_offset
        for name, value in zip(self.fieldnames, values, strict=True):
            setattr(self, name, value)
        self._name_bytes: bytes = values[-1]
        self.mode_name = self._name_bytes.split(b"\x00", 1)[0].decode("ascii", errors="replace")

    def pack(self, mav: Any, force_mavlink1: bool = False) -> bytes:
        """The frame of the message."""
        fields = [getattr(self, name) for name in self.ordered_fieldnames[:-1]]
        payload = self.unpacker.pack(*fields, self._name_bytes)
        packed: bytes = self._pack(mav, self.crc_extra, payload, force_mavlink1=force_mavlink1)
        return packed


mavlink.mavlink_map.setdefault(AVAILABLE_MODES, AvailableModesMessage)

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
