"""Triage: which reports come first while there are more than can be processed.

The reports of a threat come first, then those of aircraft that may be near us soon. Of these, one that was
heard before comes before one that was never heard: invented aircraft seldom come back under their address.
"""

import math
from enum import IntEnum
from typing import Final

from companion.model import TrafficReport
from companion.traffic.altitudes import DatumOffsets
from companion.traffic.contact import Contact
from companion.traffic.measurement import is_possible
from companion.traffic.own_aircraft import OwnTrail

# How soon is soon: the outer layer looks about as far ahead.
_SOON_S: Final = 90.0
# An address is heard again within this time, at most so many of them.
_AGAIN_S, _MOST_HEARD = 5.0, 20_000


class Urgency(IntEnum):
    """The order in which reports are processed."""

    THREAT = 0
    NEAR_AGAIN = 1
    NEAR = 2
    AGAIN = 3
    NEW = 4


class Triage:
    """Judges reports by what is known of their keys, and by their places."""

    def __init__(self, contacts: dict[str, Contact], trail: OwnTrail) -> None:
        self._contacts, self._trail = contacts, trail
        self._heard_s: dict[str, float] = {}

    def urgency(self, report: TrafficReport, monotonic_s: float, offsets: DatumOffsets) -> Urgency:
        """The urgency of a report that is received now by the tracker's clock, and not processed yet."""
        if not is_possible(report):
            return Urgency.NEW
        contact = self._contacts.get(report.key)
        hypotheses = () if contact is None else contact.hypotheses
        if any(one.threat for one in hypotheses):
            return Urgency.THREAT
        again = any(one.is_confirmed for one in hypotheses) or self._was_heard(report.key, monotonic_s)
        if self._reach_s(report, monotonic_s, offsets) <= _SOON_S:
            return Urgency.NEAR_AGAIN if again else Urgency.NEAR
        return Urgency.AGAIN if again else Urgency.NEW

    def _reach_s(self, report: TrafficReport, monotonic_s: float, offsets: DatumOffsets) -> float:
        if report.relative_m is not None:
            return 0.0  # from a receiver on board, of short range
        if report.lat_deg is None or report.lon_deg is None:
            return math.inf
        velocity_mps = altitude_m = None
        if report.altitude_m is not None:
            altitude_m = report.altitude_m + offsets[report.altitude_reference].offset_m
        if report.ground_speed_mps is not None and report.course_rad is not None:
            north, east = math.cos(report.course_rad), math.sin(report.course_rad)
            velocity_mps = report.ground_speed_mps * north, report.ground_speed_mps * east
        place_deg = report.lat_deg, report.lon_deg
        return self._trail.reach_s(monotonic_s, place_deg, velocity_mps, altitude_m)

    def _was_heard(self, key: str, monotonic_s: float) -> bool:
        heard_s = self._heard_s.pop(key, None)
        self._heard_s[key] = monotonic_s
        if len(self._heard_s) > _MOST_HEARD:
            del self._heard_s[next(iter(self._heard_s))]
        return heard_s is not None and monotonic_s - heard_s <= _AGAIN_S
