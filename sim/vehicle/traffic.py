"""ADS-B reports inside a fake autopilot: the list for its own avoidance, and the copy that it forwards."""

import math

from companion.geodesy import GeoPoint, LocalFrame
from companion.mavlink.dialect import Message, mavlink

_TIMEOUT_S = 5.0
_PLACED = mavlink.ADSB_FLAGS_VALID_COORDS | mavlink.ADSB_FLAGS_VALID_ALTITUDE


class HeardTraffic:
    """The last report of each address, kept for five seconds."""

    def __init__(self) -> None:
        self._heard: dict[int, tuple[float, Message]] = {}

    def receive(self, report: Message, now_s: float) -> None:
        """Store a report; one without position or height is ignored."""
        if report.flags & _PLACED == _PLACED:
            self._heard[int(report.ICAO_address)] = (now_s, report)

    def is_within(
        self, here: GeoPoint, horizontal_m: float, vertical_m: float, now_s: float, *, ahead_s: float = 0.0
    ) -> bool:
        """True if any aircraft is inside that cylinder around a place, wider by its own way in `ahead_s`."""
        if not self._heard:
            return False
        frame = LocalFrame(here.lat_deg, here.lon_deg)
        for heard_s, report in self._heard.values():
            if now_s - heard_s > _TIMEOUT_S:
                continue
            there = GeoPoint(report.lat / 1e7, report.lon / 1e7, report.altitude / 1e3)
            north_m, east_m, _ = frame.to_ned_m(there)
            near = math.hypot(north_m, east_m) <= horizontal_m + ahead_s * report.hor_velocity / 100.0
            if near and abs(there.altitude_m - here.altitude_m) <= vertical_m:
                return True
        return False

    def clear(self) -> None:
        """Delete all reports."""
        self._heard.clear()


def copy_of(report: Message) -> Message:
    """A new ADSB_VEHICLE with the same fields, to be sent from the autopilot's own address."""
    return mavlink.MAVLink_adsb_vehicle_message(
        ICAO_address=report.ICAO_address,
        lat=report.lat,
        lon=report.lon,
        altitude_type=report.altitude_type,
        altitude=report.altitude,
        heading=report.heading,
        hor_velocity=report.hor_velocity,
        ver_velocity=report.ver_velocity,
        callsign=report.callsign.encode("ascii", errors="replace"),
        emitter_type=report.emitter_type,
        tslc=report.tslc,
        flags=report.flags,
        squawk=report.squawk,
    )
