"""What of a track or of ownship is believed: a number that cannot be real is left out, not the aircraft.

An aircraft that is left out would be flown through. Only without a position there is nothing to avoid.
"""

import math
from dataclasses import replace
from typing import Final

from companion.model import Ownship, Track, TrafficKind, Vec3

# Nothing is further away, faster, or climbs faster than this.
_FURTHEST_M, _FASTEST_MPS = 4.1e7, 1500.0
# A state of another time is taken as one of now.
_OLDEST_S: Final = 3600.0
# Aircraft in forward flight turn no faster; a number beyond the second one is no rate of turn.
_FASTEST_TURN_RADPS, _NO_TURN_RADPS = math.radians(20.0), 4.0
_LARGEST_UNCERTAINTY_M: Final = 1e6
_LARGEST_VOLUME_M: Final = 20_000.0
# Of an aircraft that this avoidance can fly.
_FASTEST_OWN_MPS, _STRONGEST_WIND_MPS = 400.0, 120.0


def relevant_track(track: Track, now_s: float) -> Track | None:
    """The track without numbers that cannot be real; `None` for a surface vehicle or without a position."""
    if track.kind is TrafficKind.SURFACE_VEHICLE:
        return None
    north_m, east_m, down_m = track.position_m
    # Comparisons with NaN are false.
    if not (
        -_FURTHEST_M < north_m < _FURTHEST_M
        and -_FURTHEST_M < east_m < _FURTHEST_M
        and -_FURTHEST_M < down_m < _FURTHEST_M
    ):
        return None
    north_mps, east_mps, down_mps = track.velocity_mps
    if (
        -_FASTEST_MPS < north_mps < _FASTEST_MPS
        and -_FASTEST_MPS < east_mps < _FASTEST_MPS
        and -_FASTEST_MPS < down_mps < _FASTEST_MPS
        and -_FASTEST_TURN_RADPS <= track.turn_radps <= _FASTEST_TURN_RADPS
        and -_OLDEST_S <= now_s - track.time_s <= _OLDEST_S
        and 0.0 <= track.vertical_uncertainty_m <= _LARGEST_UNCERTAINTY_M
        and track.protected_horizontal_m is None
        and track.protected_vertical_m is None
    ):
        return track
    return _repaired(track, now_s)


def _repaired(track: Track, now_s: float) -> Track:
    is_now = not -_OLDEST_S <= now_s - track.time_s <= _OLDEST_S
    uncertain_m = track.vertical_uncertainty_m
    return replace(
        track,
        time_s=now_s if is_now else track.time_s,
        velocity_mps=track.velocity_mps if _is_velocity(track.velocity_mps) else (0.0, 0.0, 0.0),
        turn_radps=_turn_radps(track.turn_radps),
        vertical_uncertainty_m=min(max(uncertain_m, 0.0), _LARGEST_UNCERTAINTY_M)
        if uncertain_m > 0.0
        else 0.0,
        protected_horizontal_m=_volume_m(track.protected_horizontal_m),
        protected_vertical_m=_volume_m(track.protected_vertical_m),
    )


def _is_velocity(velocity_mps: Vec3) -> bool:
    return all(-_FASTEST_MPS < one < _FASTEST_MPS for one in velocity_mps)


def _turn_radps(turn_radps: float) -> float:
    """A rate of turn, limited; 0 if it is none."""
    if not abs(turn_radps) <= _NO_TURN_RADPS:
        return 0.0
    return min(max(turn_radps, -_FASTEST_TURN_RADPS), _FASTEST_TURN_RADPS)


def _volume_m(size_m: float | None) -> float | None:
    """The size of a protected volume; `None`, the usual one, if it cannot be meant."""
    return size_m if size_m is not None and 0.0 <= size_m <= _LARGEST_VOLUME_M else None


def credible_ownship(own: Ownship, now_s: float) -> Ownship:
    """Ownship without numbers that cannot be real: instead, speed over ground, no wind, the time now."""
    airspeed_mps, wind_mps, time_s = own.airspeed_mps, own.wind_mps, own.time_s
    if (
        0.0 <= airspeed_mps <= _FASTEST_OWN_MPS
        and -_OLDEST_S <= now_s - time_s <= _OLDEST_S
        and (wind_mps is None or math.hypot(*wind_mps) <= _STRONGEST_WIND_MPS)
        and _is_velocity(own.velocity_mps)
    ):
        return own
    velocity_mps = own.velocity_mps if _is_velocity(own.velocity_mps) else (0.0, 0.0, 0.0)
    return replace(
        own,
        time_s=time_s if -_OLDEST_S <= now_s - time_s <= _OLDEST_S else now_s,
        velocity_mps=velocity_mps,
        # Without an airspeed, that over ground is used.
        airspeed_mps=airspeed_mps if 0.0 <= airspeed_mps <= _FASTEST_OWN_MPS else 0.0,
        wind_mps=None if wind_mps is None or math.hypot(*wind_mps) > _STRONGEST_WIND_MPS else wind_mps,
    )
