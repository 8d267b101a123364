"""From messages to facts: the one place for the units, sentinels, flags and traps of MAVLink fields.

A field that its sender marked as invalid, left unset, or filled with an implausible value becomes `None`. A
message without any usable field gives no fact. No message that can be decoded raises an error. One file for
each protocol; a new source of traffic is a new file and an entry in `_TRANSLATIONS`.
"""

import functools
import re
import struct
from collections import namedtuple
from itertools import islice
from typing import Any

from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import Fact, Sender
from companion.mavlink.framing import Frame
from companion.mavlink.translate import adsb, commands, missions, parameters, remote_id, telemetry, utm
from companion.mavlink.translate.wire import Translation


def to_fact(message: Message, received_s: float) -> Fact | None:
    """The fact in a message; `None` if its id is not in `WANTED`, or nothing in it is usable."""
    translate = _TRANSLATIONS.get(message.get_msgId())
    if translate is None:
        return None
    return translate(message, _sender(message.get_srcSystem(), message.get_srcComponent()), received_s)


def frame_to_fact(frame: Frame, received_s: float) -> Fact | None:
    """The fact in a frame; several times faster than `to_fact`, because no pymavlink message is made."""
    translate = _TRANSLATIONS.get(frame.message_id)
    if translate is None:
        return None
    layout, fields, arrays = _LAYOUTS[frame.message_id]
    payload = frame.payload.ljust(layout.size, b"\0")  # MAVLink 2 cuts off the zeros at the end
    values = layout.unpack_from(payload)
    message = fields._make(_with_arrays(values, arrays) if arrays else values)
    return translate(message, _sender(frame.system_id, frame.component_id), received_s)


def _with_arrays(values: tuple[Any, ...], lengths: tuple[int, ...]) -> list[Any]:
    """A flat row of fields with the items of each array in a list; `lengths` is 0 for other fields."""
    remaining = iter(values)
    return [list(islice(remaining, length)) if length else next(remaining) for length in lengths]


@functools.lru_cache(maxsize=256)
def _sender(system_id: int, component_id: int) -> Sender:
    return Sender(system_id, component_id)


_TRANSLATIONS: dict[int, Translation] = {
    **telemetry.TRANSLATIONS,
    **missions.TRANSLATIONS,
    **commands.TRANSLATIONS,
    **parameters.TRANSLATIONS,
    **adsb.TRANSLATIONS,
    **utm.TRANSLATIONS,
    **remote_id.TRANSLATIONS,
}


_Layout = tuple[struct.Struct, Any, tuple[int, ...]]


def _layout(message_id: int) -> _Layout:
    """The layout of a payload, the named tuple for its fields, and the lengths of its arrays, if any.

    An array of bytes stays one field, like a text.
    """
    kind = mavlink.mavlink_map[message_id]
    layout = struct.Struct(re.sub(r"(\d+)B", r"\1s", kind.unpacker.format))
    bytewise = {n for n, type_ in zip(kind.fieldnames, kind.fieldtypes, strict=True) if type_ in _BYTEWISE}
    lengths = zip(kind.ordered_fieldnames, kind.array_lengths, strict=True)
    arrays = tuple(0 if name in bytewise else length for name, length in lengths)
    return layout, namedtuple(kind.msgname, kind.ordered_fieldnames), arrays if any(arrays) else ()


_BYTEWISE = frozenset({"char", "uint8_t"})
_LAYOUTS: dict[int, _Layout] = {wanted: _layout(wanted) for wanted in _TRANSLATIONS} | missions.LAYOUTS

WANTED: frozenset[int] = frozenset(_TRANSLATIONS)
"""Ids of the messages that can give a fact."""
