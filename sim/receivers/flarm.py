"""A simulated FLARM receiver: its status, its position, and a relative position for each aircraft.

Source: FTD-012 "Data Port Interface Control Document (ICD)" of FLARM Technology, data port version 9.
"""

import math
from datetime import UTC, datetime
from functools import reduce
from operator import xor
from typing import ClassVar

from companion.geodesy import LocalFrame, course_deg
from companion.units import FOOT_M, KNOT_MPS
from sim.receivers.encoder import ReceiverEncoder, Reception, Transmission

# Aircraft types by emitter category of ADS-B.
_TYPES = {1: "8", 2: "8", 3: "9", 4: "9", 5: "9", 7: "3", 9: "1", 10: "B", 11: "4", 12: "7", 14: "D", 19: "F"}
_MAX_DISTANCE_M = 32_767
_MAX_CLIMB_MPS = 32.7


class FlarmEncoder(ReceiverEncoder):
    """Lines with checksums, one piece for each moment. Without an own position it knows no relative ones."""

    format: ClassVar[str] = "flarm"

    def encode(self, reception: Reception) -> list[bytes]:
        """The sentences of this moment."""
        own = reception.own
        if own is None:
            return [sentence(f"PFLAU,{len(reception.heard)},1,0,1,0,,0,,,")]
        aircraft = [_aircraft(one, own) for one in reception.heard]
        status = f"PFLAU,{len(reception.heard)},1,{1 if own.on_ground else 2},1,0,,0,,,"
        own_lines = (*_position(own, reception.time_s), status)
        return [b"".join(sentence(text) for text in (*own_lines, *aircraft) if text)]


def sentence(text: str) -> bytes:
    """A sentence as a line, with its checksum."""
    return f"${text}*{reduce(xor, text.encode('ascii'), 0):02X}\r\n".encode("ascii")


def _aircraft(one: Transmission, own: Transmission) -> str:
    """PFLAA; empty for an aircraft that is too far away for its fields."""
    frame = LocalFrame(own.place.lat_deg, own.place.lon_deg)
    north_m, east_m = frame.to_north_east_m(one.place.lat_deg, one.place.lon_deg)
    up_m = one.pressure_altitude_m - own.pressure_altitude_m
    if max(abs(north_m), abs(east_m), abs(up_m)) > _MAX_DISTANCE_M:
        return ""
    north_mps, east_mps, down_mps = one.velocity_mps
    track_deg = round(course_deg(math.atan2(east_mps, north_mps))) % 360
    speed_mps = 0 if one.on_ground else round(math.hypot(north_mps, east_mps))
    climb_mps = max(min(-down_mps, _MAX_CLIMB_MPS), -_MAX_CLIMB_MPS)
    position = f"{north_m:.0f},{east_m:.0f},{up_m:.0f}"
    kind = _TYPES.get(one.category, "0")
    return f"PFLAA,0,{position},1,{one.icao:06X},{track_deg},,{speed_mps},{climb_mps:.1f},{kind},0,1,-70"


def _position(own: Transmission, time_s: float) -> tuple[str, str, str]:
    """GPRMC, GPGGA and PGRMZ. The geoid is the ellipsoid here: the simulation knows no other."""
    moment = datetime.fromtimestamp(time_s, UTC)
    time, date = moment.strftime("%H%M%S.%f")[:9], moment.strftime("%d%m%y")
    north_mps, east_mps, _ = own.velocity_mps
    speed_kt = math.hypot(north_mps, east_mps) / KNOT_MPS
    course = course_deg(math.atan2(east_mps, north_mps))
    place = f"{_angle(own.place.lat_deg, 'NS', 2)},{_angle(own.place.lon_deg, 'EW', 3)}"
    return (
        f"GPGGA,{time},{place},1,12,0.8,{own.place.altitude_m:.1f},M,0.0,M,,",
        f"PGRMZ,{own.pressure_altitude_m / FOOT_M:.0f},F,2",
        f"GPRMC,{time},A,{place},{speed_kt:.2f},{course % 360.0:.2f},{date},,,A",
    )


def _angle(angle_deg: float, sides: str, digits: int) -> str:
    """Degrees and minutes with four decimals, and the side."""
    ten_thousandths = round(abs(angle_deg) * 600_000.0)
    degrees, minutes = divmod(ten_thousandths, 600_000)
    return f"{degrees:0{digits}d}{minutes / 10_000.0:07.4f},{sides[angle_deg < 0.0]}"
