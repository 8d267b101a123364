"""The intent of a member of a formation, in V2_EXTENSION: no message of the common set has its fields.

`message_type` is 0xCA91, from the range that MAVLink leaves to everyone; the payload is little-endian:

| offset | type | content |
|---|---|---|
| 0 | uint8 | version, 1 |
| 1 | uint8 | flags, bit 0 first: goal at place, goal by course, flies an answer, proposes, answers, ends |
| 2 | uint16 | counter, which orders the messages of one sender |
| 4 | int32 x 2, float | place of the goal [1e-7 deg], its altitude above mean sea level [m] |
| 16 | uint16 x 2 | course to the goal [cdeg], airspeed [cm/s] |
| 20 | uint16 x 3 | least and largest airspeed [cm/s], largest rate of turn [mrad/s] |
| 26 | uint16 x 2, float | the answer flown: course [cdeg], airspeed [cm/s], altitude [m] |
| 34 | uint16 x 3, float | the proposal: its number (0: none), course, airspeed, altitude |
| 44 | int32 x 2 | the place after that of the goal [1e-7 deg]; 0, 0: none |
| 52 | (uint8, uint16) x n | system id of each other member, and its newest proposal that was heard |

A frame has 69 bytes and 3 for each other member: 96 in a formation of ten, 288 a second at three a second.
"""

import math
import struct
from itertools import islice
from typing import Final

from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import Fact, MemberIntent, Sender
from companion.mavlink.translate.wire import (
    FULL_CIRCLE_CDEG,
    Translation,
    angle_rad,
    is_altitude,
    position_deg,
)
from companion.model import Guidance, LatLon, Proposal

INTENT: Final = 0xCA91
_VERSION: Final = 1
_AT_PLACE, _BY_COURSE, _FLIES, _PROPOSES, _ANSWERS, _IS_END = (1 << bit for bit in range(6))
_LAYOUT = struct.Struct("<BBHiifHHHHHHHfHHHfii")
_HEARD = struct.Struct("<BH")
_MOST_HEARD: Final = 64
_PAYLOAD_BYTES: Final = 249


def intent_message(intent: MemberIntent) -> Message:
    """The V2_EXTENSION of an intent, to all systems."""
    place, flown, proposal = intent.goal_deg, intent.flown, intent.proposal
    proposed = None if proposal is None else proposal.guidance
    flags = (
        _AT_PLACE * (place is not None)
        | _BY_COURSE * (intent.goal_course_rad is not None)
        | _FLIES * (flown is not None)
        | _PROPOSES * (proposed is not None)
        | _ANSWERS * intent.answers
        | _IS_END * intent.goal_is_end
    )
    payload = _LAYOUT.pack(
        _VERSION,
        flags,
        intent.counter & 0xFFFF,
        *_e7(place),
        intent.goal_altitude_m,
        _cdeg(intent.goal_course_rad or 0.0),
        _hundredths(intent.goal_airspeed_mps),
        _hundredths(intent.min_airspeed_mps),
        _hundredths(intent.max_airspeed_mps),
        _hundredths(intent.max_turn_rate_radps * 10.0),
        *_packed(flown),
        0 if proposal is None else proposal.number,
        *_packed(proposed),
        *_e7(intent.then_deg),
    )
    heard = list(islice(sorted(intent.heard.items()), _MOST_HEARD))
    payload += b"".join(_HEARD.pack(system_id, number) for system_id, number in heard)
    # A number is never 0, so that the zeros that fill the payload are no entries.
    return mavlink.MAVLink_v2_extension_message(0, 0, 0, INTENT, payload.ljust(_PAYLOAD_BYTES, b"\0"))


def _e7(place: LatLon | None) -> tuple[int, int]:
    return (0, 0) if place is None else (round(place[0] * 1e7), round(place[1] * 1e7))


def _cdeg(course_rad: float) -> int:
    return round(math.degrees(course_rad) * 100.0) % FULL_CIRCLE_CDEG


def _hundredths(value: float) -> int:
    return min(max(round(value * 100.0), 0), 0xFFFF)


def _packed(guidance: Guidance | None) -> tuple[int, int, float]:
    if guidance is None:
        return 0, 0, 0.0
    return _cdeg(guidance.course_rad), _hundredths(guidance.airspeed_mps), guidance.altitude_m


def _intent(message: Message, sender: Sender, _received_s: float) -> Fact | None:
    """The intent; `None` for other extensions, other versions, and numbers that cannot be meant."""
    payload = bytes(message.payload)
    if message.message_type != INTENT or len(payload) < _LAYOUT.size or payload[0] != _VERSION:
        return None
    (
        _, flags, counter, lat_e7, lon_e7, altitude_m, course_cdeg, airspeed_cmps, min_cmps, max_cmps, turn,
        flown_cdeg, flown_cmps, flown_m, number, proposed_cdeg, proposed_cmps, proposed_m,
        then_lat_e7, then_lon_e7,
    ) = _LAYOUT.unpack_from(payload)  # fmt: skip
    place = position_deg(lat_e7, lon_e7) if flags & _AT_PLACE else None
    flown = _guidance(flown_cdeg, flown_cmps, flown_m) if flags & _FLIES else None
    proposed = _guidance(proposed_cdeg, proposed_cmps, proposed_m) if flags & _PROPOSES else None
    unusable = (
        not is_altitude(altitude_m)
        or (place is None and flags & _AT_PLACE)
        or (flown is None and flags & _FLIES)
        or (proposed is None and flags & _PROPOSES)
        or not 0 < min_cmps <= max_cmps
        or turn == 0
    )
    if unusable:
        return None
    return MemberIntent(
        sender,
        counter,
        place,
        position_deg(then_lat_e7, then_lon_e7),
        angle_rad(course_cdeg) if flags & _BY_COURSE else None,
        altitude_m,
        airspeed_cmps / 100.0,
        bool(flags & _IS_END),
        min_cmps / 100.0,
        max_cmps / 100.0,
        turn / 1000.0,
        flown,
        Proposal(number, proposed) if number else None,
        dict(_heard_in(payload)),
        bool(flags & _ANSWERS),
    )


def _guidance(course_cdeg: int, airspeed_cmps: int, altitude_m: float) -> Guidance | None:
    course_rad = angle_rad(course_cdeg)
    if course_rad is None or not is_altitude(altitude_m):
        return None
    return Guidance(course_rad, airspeed_cmps / 100.0, altitude_m)


def _heard_in(payload: bytes) -> list[tuple[int, int]]:
    end = _LAYOUT.size + _HEARD.size * ((len(payload) - _LAYOUT.size) // _HEARD.size)
    found = [(system_id, number) for system_id, number in _HEARD.iter_unpack(payload[_LAYOUT.size : end])]
    return [(system_id, number) for system_id, number in found if number]


TRANSLATIONS: dict[int, Translation] = {mavlink.MAVLINK_MSG_ID_V2_EXTENSION: _intent}
