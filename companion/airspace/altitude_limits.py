"""How low and how high an avoidance may go: above home, above the terrain, within the autopilot's fence."""

import math
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

from companion.avoidance import Envelope


class HeightLimits(NamedTuple):
    """`min_height_m` above home and above the terrain, all others above home; `None`: no such limit."""

    min_height_m: float
    max_height_m: float | None = None
    fence_min_height_m: float | None = None
    fence_max_height_m: float | None = None


def limit_heights(
    envelope: Envelope, limits: HeightLimits, home_altitude_m: float, terrain_altitude_m: float | None
) -> Envelope:
    """The envelope with floor and ceiling above mean sea level, the tightest of all that are known.

    Barometer, home and terrain move by centimetres all the time; whole metres keep decisions from following.
    Where floor and ceiling cross, the floor counts: there is nothing to hit above.
    """
    home_m = float(round(home_altitude_m))
    floors = [home_m + limits.min_height_m]
    if terrain_altitude_m is not None:
        floors.append(math.ceil(terrain_altitude_m) + limits.min_height_m)
    if limits.fence_min_height_m is not None:
        floors.append(home_m + limits.fence_min_height_m)
    if envelope.min_altitude_m is not None:
        floors.append(envelope.min_altitude_m)
    floor_m = max(floors)
    heights = (limits.max_height_m, limits.fence_max_height_m)
    ceilings = [home_m + height for height in heights if height is not None]
    if envelope.max_altitude_m is not None:
        ceilings.append(envelope.max_altitude_m)
    ceiling_m = max(min(ceilings), floor_m) if ceilings else None
    return _between(envelope, floor_m, ceiling_m)


@lru_cache(maxsize=4)
def _between(envelope: Envelope, floor_m: float, ceiling_m: float | None) -> Envelope:
    """Asked for at every tick, mostly for the same."""
    return replace(envelope, min_altitude_m=floor_m, max_altitude_m=ceiling_m)
