"""Conditions about traffic: what is near and not avoided, contradicts itself, or is not heard any more."""

import math
from collections.abc import Iterable, Iterator

from companion.geodesy import wrap_two_pi
from companion.mavlink.dialect import mavlink
from companion.model import Ownship
from companion.output.notice import Condition
from companion.traffic import Concern, ConcernKind

# A missing altitude, a contradiction or a silence of less than this is usual.
_LASTING_S = 2.0
# The keys of conditions about traffic begin with this.
TRAFFIC_KEY = "traffic "
_ODD = {
    ConcernKind.TWO_PLACES: "is reported in two places",
    ConcernKind.TWO_HEIGHTS: "is reported at two heights",
}


def traffic_conditions(concerns: Iterable[Concern], own: Ownship | None) -> Iterator[Condition]:
    """The conditions that the concerns are; those about us or about many are not repeated."""
    for concern in concerns:
        text, matters = _words(concern, own)
        yield Condition(
            f"{TRAFFIC_KEY}{concern.kind}: {'' if concern.kind is ConcernKind.LEFT_OUT else concern.name}",
            mavlink.MAV_SEVERITY_WARNING if matters else mavlink.MAV_SEVERITY_NOTICE,
            text,
            matters=matters,
            after_s=0.0 if concern.kind is ConcernKind.LOST else _LASTING_S,
        )


def _words(concern: Concern, own: Ownship | None) -> tuple[str, bool]:
    """The text, and whether it is repeated."""
    name, where = concern.name, _where(concern, own)
    match concern.kind:
        case ConcernKind.HEIGHT_UNKNOWN:
            return f"{name}{where}: height unknown", True
        case ConcernKind.OLD_REPORTS:
            return f"{name}{where}: reports {concern.seconds:.0f} s old", True
        case ConcernKind.NOT_HEARD:
            return f"{name}{where}: not heard for {concern.seconds:.0f} s", True
        case ConcernKind.LOST:
            return f"{name} lost, not heard for {concern.seconds:.0f} s", False
        case ConcernKind.OWN_SHADOW:
            return f"{name} is our own shadow, {concern.seconds:.0f} s late", False
        case ConcernKind.OWN_ADDRESS:
            return f"{name} is not our address, flies elsewhere", False
        case ConcernKind.LEFT_OUT:
            return f"Too much traffic, {name} aircraft left out", True
        case _:
            return f"{name} {_ODD[concern.kind]}", True


def _where(concern: Concern, own: Ownship | None) -> str:
    """Clock and distance: " 2 o'clock 1.8 km"."""
    if concern.distance_m is None or concern.bearing_rad is None:
        return ""
    distance = f" {concern.distance_m / 1000.0:.1f} km"
    if own is None:
        return distance
    hour = round(math.degrees(wrap_two_pi(concern.bearing_rad - own.heading_rad)) / 30.0) % 12 or 12
    return f" {hour} o'clock{distance}"
