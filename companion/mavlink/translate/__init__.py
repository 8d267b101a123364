"""From messages to facts: the one place that knows the wire's units, sentinels, flags and traps.

Whatever a sender marked as invalid, left unset, or could not mean becomes `None`; a message that says nothing
usable becomes no fact at all. No message that can be decoded makes this raise. One file for each noun; a new
source of traffic is a new file and a line in `_TRANSLATIONS`.
"""

import functools
import re
import struct
from collections import namedtuple
from typing import Any

from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import Fact, Sender
from companion.mavlink.framing import Frame
from companion.mavlink.translate import adsb, air, answers, heights, mission, systems, utm
from companion.mavlink.translate.wire import Translation


def to_fact(message: Message, received_s: float) -> Fact | None:
    """What a message said; `None` if it is none of `WANTED`, or says nothing that can be used."""
    translate = _TRANSLATIONS.get(message.get_msgId())
    if translate is None:
        return None
    return translate(message, _sender(message.get_srcSystem(), message.get_srcComponent()), received_s)


def frame_to_fact(frame: Frame, received_s: float) -> Fact | None:
    """The same straight from a frame, several times as fast as by way of pymavlink's message."""
    translate = _TRANSLATIONS.get(frame.message_id)
    if translate is None:
        return None
    layout, fields = _LAYOUTS[frame.message_id]
    payload = frame.payload.ljust(layout.size, b"\0")  # MAVLink 2 cuts off the zeros at the end
    message = fields._make(layout.unpack_from(payload))
    return translate(message, _sender(frame.system_id, frame.component_id), received_s)


@functools.lru_cache(maxsize=256)
def _sender(system_id: int, component_id: int) -> Sender:
    return Sender(system_id, component_id)


_TRANSLATIONS: dict[int, Translation] = {
    **systems.TRANSLATIONS,
    **air.TRANSLATIONS,
    **heights.TRANSLATIONS,
    **mission.TRANSLATIONS,
    **answers.TRANSLATIONS,
    **adsb.TRANSLATIONS,
    **utm.TRANSLATIONS,
}


def _layout(message_id: int) -> tuple[struct.Struct, Any]:
    """How to unpack a payload, and into what; an array of bytes stays one field, as a text does."""
    kind = mavlink.mavlink_map[message_id]
    layout = struct.Struct(re.sub(r"(\d+)B", r"\1s", kind.unpacker.format))
    return layout, namedtuple(kind.msgname, kind.ordered_fieldnames)


_LAYOUTS: dict[int, tuple[struct.Struct, Any]] = {wanted: _layout(wanted) for wanted in _TRANSLATIONS}

WANTED: frozenset[int] = frozenset(_TRANSLATIONS)
"""Ids of the messages worth decoding."""
