"""Floor and ceiling of an avoidance, from limits above home and terrain and from the autopilot's fence."""

import math
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple, Self

from companion.airspace.fences import FenceSettings
from companion.avoidance import Envelope


class HeightLimits(NamedTuple):
    """`min_height_m` is above home and above the terrain, all others above home; `None`: no such limit."""

    min_height_m: float
    max_height_m: float | None = None
    fence_min_height_m: float | None = None
    fence_max_height_m: float | None = None

    @classmethod
    def within_fence(cls, min_height_m: float, max_height_m: float | None, fence: FenceSettings) -> Self:
        """The given limits with those of the autopilot's fence, inside its margin."""
        low_m, high_m = fence.min_height_m, fence.max_height_m
        return cls(
            min_height_m,
            max_height_m,
            None if low_m is None else low_m + fence.margin_m,
            None if high_m is None else high_m - fence.margin_m,
        )


def limit_heights(
    envelope: Envelope, limits: HeightLimits, home_altitude_m: float, terrain_altitude_m: float | None
) -> Envelope:
    """The envelope with floor and ceiling above mean sea level [m], each the tightest of the known limits.

    Altitudes of home and terrain vary by centimetres all the time; rounding them to whole metres keeps the
    limits constant. Where floor and ceiling cross, the floor takes precedence: the ground is below it.
    """
    home_m = float(round(home_altitude_m))
    floors_m = [home_m + limits.min_height_m]
    if terrain_altitude_m is not None:
        floors_m.append(math.ceil(terrain_altitude_m) + limits.min_height_m)
    if limits.fence_min_height_m is not None:
        floors_m.append(home_m + limits.fence_min_height_m)
    if envelope.min_altitude_m is not None:
        floors_m.append(envelope.min_altitude_m)
    floor_m = max(floors_m)
    max_heights_m = (limits.max_height_m, limits.fence_max_height_m)
    ceilings_m = [home_m + height_m for height_m in max_heights_m if height_m is not None]
    if envelope.max_altitude_m is not None:
        ceilings_m.append(envelope.max_altitude_m)
    ceiling_m = max(min(ceilings_m), floor_m) if ceilings_m else None
    return _with_limits(envelope, floor_m, ceiling_m)


@lru_cache(maxsize=4)
def _with_limits(envelope: Envelope, floor_m: float, ceiling_m: float | None) -> Envelope:
    """Cached, because the limits rarely change from one tick to the next."""
    return replace(envelope, min_altitude_m=floor_m, max_altitude_m=ceiling_m)
