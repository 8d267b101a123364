"""Mode S messages as transponders send them: ADS-B squitters of version 2, and replies to radars.

Source: RTCA DO-260B 2.2.3.2 and A.1.7 (squitters, compact position reports), ICAO Annex 10 volume IV 3.1.2
(formats, altitude code, parity). Written apart from the decoder, which a foreign library reads.
"""

import math
from typing import Final

from companion.geodesy import course_deg
from companion.units import FOOT_M, KNOT_MPS
from sim.receivers.encoder import Transmission

_GENERATOR: Final = 0x1FFF409
_ALTITUDE_STEP_FT, _ALTITUDE_ZERO_FT, _MAX_STEPS = 25.0, -1000.0, 2047
_CLIMB_STEP_FPM, _MAX_CLIMB = 64.0, 511
_DIFFERENCE_STEP_FT, _MAX_DIFFERENCE = 25.0, 127  # the last one: more than 3,137.5 ft
_MAX_SPEED_CODE: Final = 1022
_LETTERS: Final = "#ABCDEFGHIJKLMNOPQRSTUVWXYZ#####_###############0123456789######"
# Type code and the two supplements of a position by its NIC, in the air (table 2-14) and on the ground.
_AIRBORNE_TYPES: Final = {
    11: (9, 0, 0),
    10: (10, 0, 0),
    9: (11, 1, 1),
    8: (11, 0, 0),
    7: (12, 0, 0),
    6: (13, 0, 0),
    5: (14, 0, 0),
    4: (15, 0, 0),
    3: (16, 1, 1),
    2: (16, 0, 0),
    1: (17, 0, 0),
}
_SURFACE_TYPES: Final = {11: (5, 0, 0), 10: (6, 0, 0), 9: (7, 1, 0), 8: (7, 0, 0), 7: (8, 1, 1), 6: (8, 1, 0)}
_UNKNOWN_AIRBORNE, _UNKNOWN_SURFACE = (18, 0, 0), (8, 0, 0)
# Speeds on the ground (table 2-20): the first code, the speed it begins at, and the step [kt].
_MOVEMENTS: Final = (
    (109, 100.0, 5.0),
    (94, 70.0, 2.0),
    (39, 15.0, 1.0),
    (13, 2.0, 0.5),
    (9, 1.0, 0.25),
    (2, 0.125, 0.125),
)
_STANDING, _FASTEST = 1, 124


def parity(message: bytes) -> int:
    """The 24 parity bits of a message without them (Annex 10 volume IV 3.1.2.3.3)."""
    bits = 8 * len(message)
    rest = int.from_bytes(message, "big") << 24
    for shift in range(bits - 1, -1, -1):
        if rest >> (shift + 24) & 1:
            rest ^= _GENERATOR << shift
    return rest


def with_parity(message: bytes, overlay: int = 0) -> bytes:
    """A message with its parity, over which the address of a reply is laid."""
    return message + (parity(message) ^ overlay).to_bytes(3, "big")


def squitter(address: int, content: int, *, capability: int = 5) -> bytes:
    """An extended squitter (DF17) with 56 bits of content."""
    return with_parity(
        bytes((17 << 3 | capability,)) + address.to_bytes(3, "big") + content.to_bytes(7, "big")
    )


def other_squitter(address: int, content: int, control: int) -> bytes:
    """A squitter that is not of a transponder (DF18): the control field says of what."""
    return _extended(18 << 3 | control, address, content)


def _extended(first: int, address: int, content: int) -> bytes:
    return with_parity((first << 80 | address << 56 | content).to_bytes(11, "big"))


def all_call(address: int, *, capability: int = 5) -> bytes:
    """An all-call reply, or acquisition squitter (DF11)."""
    return with_parity(bytes((11 << 3 | capability,)) + address.to_bytes(3, "big"))


def altitude_reply(address: int, altitude_ft: float, *, status: int = 0) -> bytes:
    """A reply to a radar with the altitude (DF4)."""
    twelve = altitude_code(altitude_ft)
    code = twelve >> 6 << 7 | twelve & 0x3F  # the bit M, 0, in the middle
    return with_parity((4 << 27 | status << 24 | code).to_bytes(4, "big"), address)


def altitude_code(altitude_ft: float) -> int:
    """The altitude in 12 bits, in steps of 25 ft; 0 (unknown) above 50,175 ft."""
    steps = round((altitude_ft - _ALTITUDE_ZERO_FT) / _ALTITUDE_STEP_FT)
    return steps >> 4 << 5 | 1 << 4 | steps & 0xF if 0 <= steps <= _MAX_STEPS else 0


def longitude_zones(lat_deg: float) -> int:
    """NL: how many longitude zones there are at a latitude (A.1.7.2)."""
    if abs(lat_deg) >= 87.0:
        return 2 if abs(lat_deg) == 87.0 else 1
    turn = 1.0 - (1.0 - math.cos(math.pi / 30.0)) / math.cos(math.radians(lat_deg)) ** 2
    return math.floor(2.0 * math.pi / math.acos(turn))


def compact_position(lat_deg: float, lon_deg: float, *, is_odd: bool, is_surface: bool) -> int:
    """The format bit, latitude and longitude of 17 bits each (A.1.7.3)."""
    scale = 2 ** (19 if is_surface else 17)
    lat_zone_deg = 360.0 / (60 - is_odd)
    lat = math.floor(scale * (lat_deg % lat_zone_deg) / lat_zone_deg + 0.5)
    encoded_lat_deg = lat_zone_deg * (lat / scale + math.floor(lat_deg / lat_zone_deg))
    lon_zone_deg = 360.0 / max(longitude_zones(encoded_lat_deg) - is_odd, 1)
    lon = math.floor(scale * (lon_deg % lon_zone_deg) / lon_zone_deg + 0.5)
    return is_odd << 34 | (lat & 0x1FFFF) << 17 | lon & 0x1FFFF


def position(aircraft: Transmission, *, is_odd: bool) -> int:
    """The position message: in the air with the barometric altitude, on the ground with the speed."""
    compact = compact_position(
        aircraft.place.lat_deg, aircraft.place.lon_deg, is_odd=is_odd, is_surface=aircraft.on_ground
    )
    if not aircraft.on_ground:
        type_code, _, nic_b = _AIRBORNE_TYPES.get(aircraft.nic, _UNKNOWN_AIRBORNE)
        altitude = altitude_code(aircraft.pressure_altitude_m / FOOT_M)
        return type_code << 51 | nic_b << 48 | altitude << 36 | compact
    type_code = _SURFACE_TYPES.get(aircraft.nic, _UNKNOWN_SURFACE)[0]
    north_mps, east_mps, _ = aircraft.velocity_mps
    track = round(course_deg(math.atan2(east_mps, north_mps)) * 128.0 / 360.0) % 128
    speed_kt = math.hypot(north_mps, east_mps) / KNOT_MPS
    return type_code << 51 | _movement(speed_kt) << 44 | 1 << 43 | track << 36 | compact


def _movement(speed_kt: float) -> int:
    for code, begin_kt, step_kt in _MOVEMENTS:
        if speed_kt >= begin_kt:
            return min(code + int((speed_kt - begin_kt) / step_kt), _FASTEST)
    return _STANDING


def velocity(aircraft: Transmission) -> int:
    """The airborne velocity over ground, climb, and the difference of the two altitudes."""
    north_mps, east_mps, down_mps = aircraft.velocity_mps
    east_kt, north_kt = east_mps / KNOT_MPS, north_mps / KNOT_MPS
    is_fast = max(abs(east_kt), abs(north_kt)) >= _MAX_SPEED_CODE
    step_kt = 4.0 if is_fast else 1.0
    climb_fpm = -down_mps / FOOT_M * 60.0
    difference_ft = (aircraft.place.altitude_m - aircraft.pressure_altitude_m) / FOOT_M
    return (
        19 << 51
        | (2 if is_fast else 1) << 48
        | aircraft.nacv << 43
        | _signed(east_kt, step_kt, _MAX_SPEED_CODE, 10) << 32
        | _signed(north_kt, step_kt, _MAX_SPEED_CODE, 10) << 21
        | 1 << 20  # the rate of climb is barometric
        | _signed(climb_fpm, _CLIMB_STEP_FPM, _MAX_CLIMB, 9) << 10
        | _signed(difference_ft, _DIFFERENCE_STEP_FT, _MAX_DIFFERENCE, 7)
    )


def _signed(value: float, step: float, highest: int, bits: int) -> int:
    """A sign and a number of steps, from 1 as 0 means unknown."""
    return (value < 0.0) << bits | min(round(abs(value) / step) + 1, highest)


def identification(aircraft: Transmission) -> int:
    """Callsign and emitter category."""
    category_set, category = divmod(aircraft.category, 8)
    text = 0
    for letter in f"{aircraft.callsign[:8]:8}".replace(" ", "_"):
        text = text << 6 | max(_LETTERS.find(letter), 0)
    return (4 - category_set) << 51 | category << 48 | text


def operational_status(aircraft: Transmission) -> int:
    """Version, accuracy and integrity (2.2.3.2.7.2)."""
    types, unknown = (
        (_SURFACE_TYPES, _UNKNOWN_SURFACE) if aircraft.on_ground else (_AIRBORNE_TYPES, _UNKNOWN_AIRBORNE)
    )
    _, nic_a, second = types.get(aircraft.nic, unknown)
    nic_c = second if aircraft.on_ground else 0
    return (
        31 << 51
        | aircraft.on_ground << 48
        | nic_c << 36
        | 2 << 13  # the version
        | nic_a << 12
        | aircraft.nacp << 8
        | aircraft.sil << 4
        | (not aircraft.on_ground) << 3  # the barometric altitude is checked
    )
