"""Mode S messages to traffic reports: ADS-B, ADS-R and TIS-B squitters, and altitudes of other transponders.

Source: ICAO Annex 10 volume IV 3.1.2 (formats and parity), RTCA DO-260B 2.2.3.2 (ADS-B), 2.2.17 (TIS-B) and
2.2.18 (ADS-R). Parity, fields and positions are decoded by pyModeS 3.
"""

import math
from dataclasses import replace
from typing import Any, Final, NamedTuple

from pyModeS import Message
from pyModeS.decoder.bds.bds05 import decode_bds05
from pyModeS.util import altcode, idcode

from companion.model import LatLon, TrafficReport, TrafficSource
from companion.sources.adsb_state import AdsbState, Altitudes
from companion.sources.aircraft_table import AircraftTable
from companion.sources.cpr import CprFrame
from companion.sources.decoder import DecoderCounters
from companion.sources.identity import address_key, callsign, emitter_kind, squawk
from companion.sources.quantities import climb_mps, course_rad, metres, speed_mps

_SHORT_BYTES: Final = 7
_FIRST_LONG_FORMAT: Final = 16
_OTHER_SQUITTER: Final = 18
_IDENTITY_REPLIES: Final = frozenset({5, 21})
# The parity of an all-call reply is overlaid with the code of the interrogator, in seven bits (3.1.2.3.3.2).
_INTERROGATOR_CODES: Final = 128
_ON_GROUND_STATUS: Final = frozenset({1, 3})
_COARSE: Final = 3
# The control field of DF18 (DO-260B table 2-12): the source, whether addresses are those of ICAO, and whether
# the bit IMF may say otherwise. 4 is about the service, 7 is reserved.
_CONTROL: Final = {
    0: (TrafficSource.ADSB, True, False),
    1: (TrafficSource.ADSB, False, False),
    2: (TrafficSource.TISB, True, True),
    _COARSE: (TrafficSource.TISB, True, True),
    5: (TrafficSource.TISB, False, False),
    6: (TrafficSource.ADSR, True, True),
}
_CATEGORY_SETS: Final = {1: "D", 2: "C", 3: "B", 4: "A"}
_SURFACE_POSITIONS, _GEOMETRIC_POSITIONS = range(5, 9), range(20, 23)
# Where IMF stands in the 56 bits of a message, by type code, counted from the last bit (2.2.17.3, 2.2.18.4).
_IMF_SHIFT: Final = {
    **dict.fromkeys((0, *range(9, 19), *_GEOMETRIC_POSITIONS), 48),
    **dict.fromkeys(_SURFACE_POSITIONS, 35),
    19: 47,
    28: 0,
    29: 5,
    31: 0,
}
_COARSE_IMF_SHIFT: Final = 55
# A coarse position has 12 bits where others have 17: the middle of what it stands for is used.
_COARSE_SHIFT, _COARSE_MIDDLE = 5, 16
_COARSE_SPEED_KT, _COARSE_COURSE_DEG = 32.0, 360.0 / 32
# Any aircraft heard in this time is near enough to tell the eight places of a position on the ground apart.
_REFERENCE_S: Final = 600.0


class _Transmitter(NamedTuple):
    """Who sent a message, by which service. The services are apart: their positions are not of one moment."""

    source: TrafficSource
    is_icao: bool
    address: int


class _Squitter(NamedTuple):
    """One squitter: its sender, what is known of it, the 56 bits of content, and those as fields."""

    sender: _Transmitter
    state: AdsbState
    content: int
    fields: dict[str, Any]
    time_s: float

    @property
    def is_adsb(self) -> bool:
        """Whether fields of accuracy mean what they mean in ADS-B, of itself or repeated."""
        return self.sender.source in (TrafficSource.ADSB, TrafficSource.ADSR)


class ModeSDecoder:
    """Combines the messages of each aircraft; a report is a position, or an altitude without one."""

    def __init__(self, counters: DecoderCounters) -> None:
        self._counters = counters
        self._aircraft: AircraftTable[_Transmitter, AdsbState] = AircraftTable(AdsbState)
        self._reference: LatLon | None = None
        self._reference_s = -math.inf

    def decode(self, raw: bytes, received_s: float, *, is_mlat: bool = False) -> list[TrafficReport]:
        """The reports that one message of 7 or 14 bytes completes."""
        if (raw[0] >> 3 < _FIRST_LONG_FORMAT) != (len(raw) == _SHORT_BYTES):
            return self._bad("length of another format")
        message = Message(raw)
        allowed = {17: 1, 18: 1, 11: _INTERROGATOR_CODES}.get(message.df)
        if allowed is not None and message.crc >= allowed:
            return self._bad("wrong parity")
        self._counters.messages += 1
        match message.df:
            case 17 | 18:
                return self._squitter(raw, message, received_s, is_mlat=is_mlat)
            case 11 if message.crc == 0:
                self._aircraft.heard(_transponder(message), received_s)
            case 4 | 5 | 20 | 21:
                return self._reply(raw, message, received_s)
        return []

    def _bad(self, reason: str) -> list[TrafficReport]:
        self._counters.bad[reason] += 1
        return []

    def _squitter(
        self, raw: bytes, message: Message, received_s: float, *, is_mlat: bool
    ) -> list[TrafficReport]:
        content = int.from_bytes(raw[4:11], "big")
        is_other = message.df == _OTHER_SQUITTER
        sender = _sender(message, raw[0] & 7, content, is_mlat=is_mlat) if is_other else _transponder(message)
        if sender is None:
            return []
        if is_mlat:
            sender = sender._replace(source=TrafficSource.MLAT)
        state = self._aircraft.heard(sender, received_s)
        if is_other and raw[0] & 7 == _COARSE:
            return self._coarse(_Squitter(sender, state, content, {}, received_s))
        squitter = _Squitter(sender, state, content, message.decode(), received_s)
        code = squitter.fields["typecode"]
        if code == 0:
            altitude_ft = decode_bds05(content, tc=9)["altitude"]
            return self._altitude(sender, state, received_s, altitude_ft)
        if "cpr_lat" in squitter.fields:
            return self._position(squitter)
        _take(squitter, code)
        return []

    def _reply(self, raw: bytes, message: Message, received_s: float) -> list[TrafficReport]:
        """Replies to a radar have their address in the parity: only one that is known makes them valid."""
        sender = _transponder(message)
        state = self._aircraft.known(sender, received_s)
        if state is None:
            return []
        if message.df in _IDENTITY_REPLIES:
            state.squawk = squawk(idcode(raw.hex()) or "")
            return []
        on_ground = raw[0] & 7 in _ON_GROUND_STATUS
        return self._altitude(sender, state, received_s, altcode(raw.hex()), on_ground=on_ground)

    def _altitude(
        self,
        sender: _Transmitter,
        state: AdsbState,
        received_s: float,
        altitude_ft: int | None,
        *,
        on_ground: bool = False,
    ) -> list[TrafficReport]:
        """A report of an altitude, if there was no position a moment ago."""
        altitude_m = metres(altitude_ft)
        if altitude_m is None or sender.address == 0 or not state.is_altitude_due(received_s):
            return []
        return [_signed(state.altitude_report(received_s, altitude_m, airborne=not on_ground), sender)]

    def _position(self, squitter: _Squitter) -> list[TrafficReport]:
        fields, code = squitter.fields, squitter.fields["typecode"]
        is_surface = code in _SURFACE_POSITIONS
        if is_surface:
            speed, course = speed_mps(fields["groundspeed"]), course_rad(fields["track"])
            squitter.state.take_velocity(squitter.time_s, speed, course)
        if squitter.is_adsb:
            squitter.state.stated.take_type(code, squitter.content >> 48 & 1)
        frame = CprFrame(
            bool(fields["cpr_format"]), fields["cpr_lat"], fields["cpr_lon"], is_surface, squitter.time_s
        )
        return self._reports(squitter, frame, _altitudes(squitter, code))

    def _coarse(self, squitter: _Squitter) -> list[TrafficReport]:
        """A coarse position and velocity of TIS-B (DO-260B 2.2.17.3.5)."""
        content = squitter.content
        speed_code, course_code = content >> 25 & 0x3F, content >> 31 & 0x1F
        if speed_code and content >> 36 & 1:
            speed_kt, course_deg = (speed_code - 1) * _COARSE_SPEED_KT, course_code * _COARSE_COURSE_DEG
            squitter.state.take_velocity(squitter.time_s, speed_mps(speed_kt), course_rad(course_deg))
        lat, lon = ((bits & 0xFFF) << _COARSE_SHIFT | _COARSE_MIDDLE for bits in (content >> 12, content))
        frame = CprFrame(bool(content >> 24 & 1), lat, lon, is_surface=False, time_s=squitter.time_s)
        altitude_ft = decode_bds05(content >> 37 << 36, tc=9)["altitude"]
        return self._reports(squitter, frame, Altitudes(barometric_m=metres(altitude_ft)))

    def _reports(self, squitter: _Squitter, frame: CprFrame, altitudes: Altitudes) -> list[TrafficReport]:
        sender, state, time_s = squitter.sender, squitter.state, squitter.time_s
        is_reference_fresh = time_s - self._reference_s <= _REFERENCE_S
        places = state.positions.positions(frame, self._reference if is_reference_fresh else None)
        if places and not frame.is_surface:
            self._reference, self._reference_s = places[0], time_s
        airborne = not frame.is_surface
        return [
            _signed(state.position_report(sender.source, time_s, place, altitudes, airborne=airborne), sender)
            for place in places
        ]


def _transponder(message: Message) -> _Transmitter:
    """The sender of a message of a transponder: its address is one of ICAO."""
    return _Transmitter(TrafficSource.ADSB, is_icao=True, address=int(message.icao, 16))


def _sender(message: Message, control: int, content: int, *, is_mlat: bool) -> _Transmitter | None:
    """The sender of DF18; `None` for a message that is not about an aircraft.

    Positions from multilateration are sent as TIS-B, with the aircraft's own address.
    """
    known = _CONTROL.get(control)
    if known is None:
        return None
    source, is_icao, has_imf = known
    shift = _COARSE_IMF_SHIFT if control == _COARSE else _IMF_SHIFT.get(content >> 51)
    if has_imf and shift is not None and content >> shift & 1:
        is_icao = False
    return _Transmitter(source, is_icao or is_mlat, int(message.icao, 16))


def _signed(report: TrafficReport, sender: _Transmitter) -> TrafficReport:
    """The report with its sender's address."""
    is_known = sender.is_icao and sender.address != 0
    return replace(
        report,
        key=address_key(sender.address, is_icao=sender.is_icao),
        icao=sender.address if is_known else None,
    )


def _altitudes(squitter: _Squitter, code: int) -> Altitudes:
    """The altitude in a position message.

    Both kinds have the altitude code of transponders (DO-260B 2.2.3.2.3.4); pyModeS reads the geometric one
    as metres.
    """
    if code in _SURFACE_POSITIONS:
        return Altitudes()
    if code in _GEOMETRIC_POSITIONS:
        return Altitudes(geometric_m=metres(decode_bds05(squitter.content, tc=9)["altitude"]))
    return Altitudes(barometric_m=metres(squitter.fields["altitude"]))


def _take(squitter: _Squitter, code: int) -> None:
    """Note what a message says that has no position."""
    state, fields, stated = squitter.state, squitter.fields, squitter.state.stated
    match code:
        case 1 | 2 | 3 | 4:
            state.callsign = callsign(fields["callsign"]) or state.callsign
            state.kind = emitter_kind(f"{_CATEGORY_SETS[code]}{fields['category']}")
        case 19:
            _take_velocity(squitter)
        case 28 if fields["subtype"] == 1:
            state.squawk = squawk(fields["squawk"])
        case 29 if fields["subtype"] == 1:
            stated.take_status(squitter.time_s, fields["nac_p"], fields["sil"])
        case 31 if fields["version"] > 0 and fields["subtype"] in (0, 1):
            stated.take_status(squitter.time_s, fields["nac_p"], fields["sil"])
            stated.version, stated.nic_a = fields["version"], fields["nic_supplement_a"]
            if fields["subtype"] == 1:
                stated.nic_c = fields["capability_class"] >> 4 & 1


def _take_velocity(squitter: _Squitter) -> None:
    """Note an airborne velocity (DO-260B 2.2.3.2.6).

    Subtypes 3 and 4 have an airspeed and a heading, which are no velocity over ground. In TIS-B the bits of
    NACv and of the difference of the altitudes have other meanings.
    """
    state, fields, now_s = squitter.state, squitter.fields, squitter.time_s
    if fields["subtype"] not in (1, 2, 3, 4):
        return
    state.take_climb(now_s, climb_mps(fields["vertical_rate"]))
    state.take_velocity(now_s, *_ground_velocity(squitter.content, fields["subtype"]))
    if squitter.is_adsb:
        state.stated.take_velocity(now_s, fields["nac_v"])
        state.take_difference(now_s, metres(fields["geo_minus_baro"]))


def _ground_velocity(content: int, subtype: int) -> tuple[float | None, float | None]:
    """Speed over ground [m/s] and course [rad], not rounded to whole knots; `None` if unknown."""
    east, north = content >> 32 & 0x3FF, content >> 21 & 0x3FF
    if subtype > 2 or not east or not north:
        return None, None
    east_kt, north_kt = (
        (east - 1) * (-1, 1)[not content >> 42 & 1],
        (north - 1) * (-1, 1)[not content >> 31 & 1],
    )
    speed_kt = math.hypot(east_kt, north_kt) * (4 if subtype == 2 else 1)
    course_deg = math.degrees(math.atan2(east_kt, north_kt)) if speed_kt else None
    return speed_mps(speed_kt), course_rad(course_deg)
