"""How payloads lie on the wire: their layouts, sentinels, plausible ranges, and fields of many messages."""

import functools
import math
import re
import struct
from collections import namedtuple
from collections.abc import Callable, Mapping
from itertools import islice
from typing import Any

from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import Fact, Sender
from companion.mavlink.framing import Frame

Translation = Callable[[Message, Sender, float], Fact | None]
"""From a message, its sender and the time of reception [s] to a fact; `None` if nothing in it is usable."""

Layout = tuple[struct.Struct, Any, tuple[int, ...]]
"""The layout of a payload, the named tuple for its fields, and the lengths of its arrays, if any."""

_BYTEWISE = frozenset({"char", "uint8_t"})
UINT16_MAX = 0xFFFF
INT16_MAX = 0x7FFF
FULL_CIRCLE_CDEG = 36_000
# ADS-B encodes -1,000 to 126,700 ft; altitudes far outside cannot have been measured.
_MIN_ALTITUDE_M = -1_000.0
_MAX_ALTITUDE_M = 40_000.0


def target_of(message: Message) -> Sender:
    """The MAVLink address that a message is sent to."""
    return Sender(message.target_system, message.target_component)


def finite(value: float) -> float | None:
    """The value, or `None` for NaN and infinities."""
    return value if math.isfinite(value) else None


def position_deg(lat_e7: int, lon_e7: int) -> tuple[float, float] | None:
    """Latitude and longitude [deg]; `None` outside the globe (INT32_MAX included) and at 0, 0."""
    lat_deg, lon_deg = lat_e7 / 1e7, lon_e7 / 1e7
    if abs(lat_deg) > 90.0 or abs(lon_deg) > 180.0 or (lat_e7 == 0 and lon_e7 == 0):
        return None
    return lat_deg, lon_deg


def altitude_m(altitude_mm: int) -> float | None:
    """An altitude [m]; `None` if implausible (INT32_MAX included)."""
    metres = altitude_mm / 1000.0
    return metres if is_altitude(metres) else None


def is_altitude(metres: float) -> bool:
    """Whether an altitude [m] is plausible; false for NaN."""
    return _MIN_ALTITUDE_M <= metres <= _MAX_ALTITUDE_M


def angle_rad(angle_cdeg: int) -> float | None:
    """Centidegrees in [0, 36000) as radians; `None` for any other value (UINT16_MAX included)."""
    return math.radians(angle_cdeg / 100.0) if angle_cdeg < FULL_CIRCLE_CDEG else None


def speed_mps(speed_cmps: int, unknown: int) -> float | None:
    """A speed [m/s]; `None` if it equals the sentinel `unknown`."""
    return None if speed_cmps == unknown else speed_cmps / 100.0


def printable(text: str | bytes) -> str | None:
    """The printable ASCII part of a text up to its first NUL, stripped; `None` if that is empty."""
    if isinstance(text, bytes):
        text = text.split(b"\0", 1)[0].decode("ascii", errors="ignore")
    return "".join(letter for letter in text if " " <= letter <= "~").strip() or None


class Translator:
    """The translations of all protocols, by message id; `layouts` replaces those of the dialect."""

    def __init__(self, translations: Mapping[int, Translation], layouts: Mapping[int, Layout]) -> None:
        self._translations = dict(translations)
        self._layouts = {wanted: _layout(wanted) for wanted in translations} | dict(layouts)

    def to_fact(self, message: Message, received_s: float) -> Fact | None:
        """The fact in a message; `None` if it is not translated, or nothing in it is usable."""
        translate = self._translations.get(message.get_msgId())
        if translate is None:
            return None
        return translate(message, _sender(message.get_srcSystem(), message.get_srcComponent()), received_s)

    def frame_to_fact(self, frame: Frame, received_s: float) -> Fact | None:
        """The fact in a frame; several times faster than `to_fact`, because no pymavlink message is made."""
        translate = self._translations.get(frame.message_id)
        if translate is None:
            return None
        layout, fields, arrays = self._layouts[frame.message_id]
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


def _layout(message_id: int) -> Layout:
    """The layout by the dialect. An array of bytes stays one field, like a text."""
    kind = mavlink.mavlink_map[message_id]
    layout = struct.Struct(re.sub(r"(\d+)B", r"\1s", kind.unpacker.format))
    bytewise = {n for n, type_ in zip(kind.fieldnames, kind.fieldtypes, strict=True) if type_ in _BYTEWISE}
    lengths = zip(kind.ordered_fieldnames, kind.array_lengths, strict=True)
    arrays = tuple(0 if name in bytewise else length for name, length in lengths)
    return layout, namedtuple(kind.msgname, kind.ordered_fieldnames), arrays if any(arrays) else ()
