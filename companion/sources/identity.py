"""What a transmitter says of itself: address, emitter category, callsign and transponder code."""

import re
from typing import Final

from companion.mavlink.translate.adsb import EMITTER_KINDS
from companion.model import TrafficKind, adsb_key

_CALLSIGN: Final = re.compile(r"[A-Z0-9](?:[A-Z0-9 -]{0,6}[A-Z0-9])?")
_SQUAWK: Final = re.compile(r"[0-7]{4}")
_CATEGORY: Final = re.compile(r"[A-D][0-7]")
_CATEGORY_SETS: Final = "ABCD"


def address_key(address: int, *, is_icao: bool) -> str:
    """The key of a 24-bit address: other addresses than those of ICAO have a prefix; "" for address 0."""
    if address == 0:
        return ""
    return adsb_key(address) if is_icao else f"~{adsb_key(address)}"


def emitter_kind(category: str) -> TrafficKind:
    """The kind of an emitter category such as "A1", eight in a set; an aircraft if that is unknown."""
    if not _CATEGORY.fullmatch(category):
        return TrafficKind.AIRCRAFT
    number = 8 * _CATEGORY_SETS.index(category[0]) + int(category[1])
    return EMITTER_KINDS.get(number, TrafficKind.AIRCRAFT)


def callsign(text: str) -> str | None:
    """The callsign without padding; `None` if it is empty or has letters that no callsign has."""
    stripped = text.strip().upper()
    return stripped if _CALLSIGN.fullmatch(stripped) else None


def squawk(text: str) -> int | None:
    """A transponder code: four octal digits, as a decimal number; `None` for anything else."""
    return int(text) if _SQUAWK.fullmatch(text) else None
