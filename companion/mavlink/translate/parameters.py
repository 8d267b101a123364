"""The parameter protocol: the autopilot's PARAM_VALUE, and requests to us (PARAM_REQUEST_*, PARAM_SET)."""

import math
import struct

from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import Fact, Parameter, ParameterRequest, ParameterSet, Sender
from companion.mavlink.translate.wire import Translation, finite, printable, target_of

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


def _parameter(message: Message, sender: Sender, _received_s: float) -> Fact | None:
    name = printable(message.param_id)
    value = _value(message)
    if not name or value is None:
        return None
    return Parameter(sender, name, value)


def _list_request(message: Message, sender: Sender, _received_s: float) -> Fact:
    return ParameterRequest(sender, target_of(message), None, None)


def _read_request(message: Message, sender: Sender, _received_s: float) -> Fact | None:
    if message.param_index >= 0:
        return ParameterRequest(sender, target_of(message), None, message.param_index)
    name = printable(message.param_id)
    return None if name is None else ParameterRequest(sender, target_of(message), name, None)


def _set_request(message: Message, sender: Sender, _received_s: float) -> Fact | None:
    name = printable(message.param_id)
    return None if name is None else ParameterSet(sender, target_of(message), name, _value(message))


def _value(message: Message) -> float | None:
    """The number in `param_value`; `None` if it is not finite.

    ArduPilot sends every parameter as the number itself. PX4 sends the bits of an integer in place of the
    float, so that 1 arrives as 1.4e-45. With an integer type, the float is read as bits if it is not a whole
    number in the range of that type; only integers above 1,065,353,215 have bits that look like one.
    """
    wire_value, param_type = message.param_value, message.param_type
    limits = _INTEGER_RANGES.get(param_type)
    if limits is None:
        return finite(wire_value)
    if limits[0] <= wire_value <= limits[1] and wire_value == math.floor(wire_value):
        number: float = wire_value
        return number
    bits: tuple[int] = _INTEGER_BITS[param_type].unpack(struct.pack("<f", wire_value))
    return float(bits[0])


TRANSLATIONS: dict[int, Translation] = {
    mavlink.MAVLINK_MSG_ID_PARAM_VALUE: _parameter,
    mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_LIST: _list_request,
    mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_READ: _read_request,
    mavlink.MAVLINK_MSG_ID_PARAM_SET: _set_request,
}
