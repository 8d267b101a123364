"""Concerns about traffic as JSON values, for the record and the display."""

from typing import Any

from companion.geodesy import course_deg
from companion.traffic import Concern, ConcernKind

# Tracks exist of these: they are avoided, though there is something odd about them.
_AVOIDED = frozenset(
    {ConcernKind.NOT_HEARD, ConcernKind.TWO_PLACES, ConcernKind.TWO_HEIGHTS, ConcernKind.OWN_ADDRESS}
)


def concern_values(concern: Concern) -> dict[str, Any]:
    """Kind, name, whether it is avoided all the same, distance, bearing from true north, and seconds."""
    bearing_rad, distance_m = concern.bearing_rad, concern.distance_m
    return {
        "kind": str(concern.kind),
        "name": concern.name,
        "avoided": concern.kind in _AVOIDED,
        "distance_m": None if distance_m is None else round(distance_m),
        "bearing_deg": None if bearing_rad is None else round(course_deg(bearing_rad), 1) % 360.0,
        "seconds": round(concern.seconds, 1),
    }
