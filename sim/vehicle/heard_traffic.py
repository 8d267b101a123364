"""What the autopilot itself knows of other aircraft, for an avoidance of its own."""

import math

from companion.geodesy import GeoPoint, LocalFrame
from companion.mavlink.dialect import Message, mavlink

_TIMEOUT_S = 5.0
_PLACED = mavlink.ADSB_FLAGS_VALID_COORDS | mavlink.ADSB_FLAGS_VALID_ALTITUDE


class HeardTraffic:
    """The last report of every address, for a few seconds."""

    def __init__(self) -> None:
        self._heard: dict[int, tuple[float, Message]] = {}

    def receive(self, report: Message, now_s: float) -> None:
        """Take a report; one without a place or height is no use."""
        if report.flags & _PLACED == _PLACED:
            self._heard[int(report.ICAO_address)] = (now_s, report)

    def is_within(self, here: GeoPoint, horizontal_m: float, vertical_m: float, now_s: float) -> bool:
        """Whether anybody is inside that cylinder around a place."""
        frame = LocalFrame(here.lat_deg, here.lon_deg)
        for heard_s, report in self._heard.values():
            if now_s - heard_s > _TIMEOUT_S:
                continue
            there = GeoPoint(report.lat / 1e7, report.lon / 1e7, report.altitude / 1e3)
            north_m, east_m, _ = frame.to_ned_m(there)
            near = math.hypot(north_m, east_m) <= horizontal_m
            if near and abs(there.altitude_m - here.altitude_m) <= vertical_m:
                return True
        return False

    def clear(self) -> None:
        """Forget everybody."""
        self._heard.clear()
