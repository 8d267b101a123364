"""What an autopilot answers: COMMAND_ACK, PARAM_VALUE."""

import math
import struct

from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import CommandResult, Fact, Parameter, Sender
from companion.mavlink.translate.wire import Translation, printable

_INTEGER_RANGES = {
    mavlink.MAV_PARAM_TYPE_UINT8: (0, 2**8 - 1),
    mavlink.MAV_PARAM_TYPE_INT8: (-(2**7), 2**7 - 1),
    mavlink.MAV_PARAM_TYPE_UINT16: (0, 2**16 - 1),
    mavlink.MAV_PARAM_TYPE_INT16: (-(2**15), 2**15 - 1),
    mavlink.MAV_PARAM_TYPE_UINT32: (0, 2**32 - 1),
    mavlink.MAV_PARAM_TYPE_INT32: (-(2**31), 2**31 - 1),
}
_INTEGER_BITS = {
    mavlink.MAV_PARAM_TYPE_UINT8: struct.Struct("<B3x"),
    mavlink.MAV_PARAM_TYPE_INT8: struct.Struct("<b3x"),
    mavlink.MAV_PARAM_TYPE_UINT16: struct.Struct("<H2x"),
    mavlink.MAV_PARAM_TYPE_INT16: struct.Struct("<h2x"),
    mavlink.MAV_PARAM_TYPE_UINT32: struct.Struct("<I"),
    mavlink.MAV_PARAM_TYPE_INT32: struct.Struct("<i"),
}


def _command_result(message: Message, sender: Sender, _received_s: float) -> Fact:
    """MAVLink 1, and senders who do not fill them in, leave the target fields 0."""
    target = None
    if message.target_system:
        target = Sender(message.target_system, message.target_component)
    return CommandResult(sender, message.command, message.result, target)


def _parameter(message: Message, sender: Sender, _received_s: float) -> Fact | None:
    name = printable(message.param_id)
    value = parameter_value(message.param_value, message.param_type)
    if not name or value is None:
        return None
    return Parameter(sender, name, value)


def parameter_value(wire_value: float, param_type: int) -> float | None:
    """The number that `param_value` stands for.

    ArduPilot sends every parameter as the number itself. PX4 puts the bits of an integer where the float
    belongs, so that 1 arrives as 1.4e-45. An integer type is read as bits when the float is no whole number
    of that type's range; bits that look like one are those of integers above 1,065,353,215 only.
    """
    limits = _INTEGER_RANGES.get(param_type)
    if limits is None:
        return wire_value if math.isfinite(wire_value) else None
    if limits[0] <= wire_value <= limits[1] and wire_value == math.floor(wire_value):
        return wire_value
    bits: tuple[int] = _INTEGER_BITS[param_type].unpack(struct.pack("<f", wire_value))
    return float(bits[0])


TRANSLATIONS: dict[int, Translation] = {
    mavlink.MAVLINK_MSG_ID_COMMAND_ACK: _command_result,
    mavlink.MAVLINK_MSG_ID_PARAM_VALUE: _parameter,
}
