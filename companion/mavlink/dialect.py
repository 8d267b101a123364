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
