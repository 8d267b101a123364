"""From tracks to arrays: which tracks are relevant, and the protected volume around each."""

import math
from collections.abc import Sequence

import numpy as np

from companion.avoidance.geometry import position_at
from companion.avoidance.params import AvoidanceParams
from companion.avoidance.tracks import Tracks
from companion.compiled import kernels
from companion.model import Track, TrafficKind

# Larger distances and speeds than these cannot be real.
_FURTHEST_M, _FASTEST_MPS = 4.1e7, 1e4


def is_relevant(track: Track) -> bool:
    """Whether a track is finite, has realistic values, and is an aircraft or an obstacle."""
    north_m, east_m, down_m = track.position_m
    north_mps, east_mps, down_mps = track.velocity_mps
    across_m, aloft_m = track.protected_horizontal_m, track.protected_vertical_m
    # Comparisons with NaN are false.
    sound = (
        math.isfinite(track.time_s)
        and -_FURTHEST_M < north_m < _FURTHEST_M
        and -_FURTHEST_M < east_m < _FURTHEST_M
        and -_FURTHEST_M < down_m < _FURTHEST_M
        and -_FASTEST_MPS < north_mps < _FASTEST_MPS
        and -_FASTEST_MPS < east_mps < _FASTEST_MPS
        and -_FASTEST_MPS < down_mps < _FASTEST_MPS
        and (across_m is None or -_FURTHEST_M < across_m < _FURTHEST_M)
        and (aloft_m is None or -_FURTHEST_M < aloft_m < _FURTHEST_M)
        and not math.isnan(track.vertical_uncertainty_m)
    )
    return sound and track.kind is not TrafficKind.SURFACE_VEHICLE


def protected_tracks(now_s: float, tracks: Sequence[Track], params: AvoidanceParams) -> Tracks:
    """The tracks extrapolated to `now_s`, with their protected volumes, margins included.

    The uncertainty of a height is added to the volume before the margin: even if the whole error is against
    us, the bare volume is kept.
    """
    rows = []
    for track in tracks:
        grounded = track.kind is TrafficKind.OBSTACLE
        aloft_m = params.obstacle_vertical_m if grounded else params.well_clear_vertical_m
        if track.protected_vertical_m is not None:
            aloft_m = track.protected_vertical_m
        uncertain_m = max(track.vertical_uncertainty_m, 0.0)
        values = (
            protected_horizontal_m(track, params),
            (max(aloft_m, 1.0) + uncertain_m) * (1.0 + params.vertical_margin),
            track.turn_radps,
            grounded,
        )
        rows.append((position_at(track, now_s), track.velocity_mps, values))
    position, velocity, (across, aloft, turns, on_ground) = kernels.columns(rows)
    ids = tuple(track.track_id for track in tracks)
    return Tracks(ids, position, velocity, across, aloft, on_ground > 0.0, np.zeros(len(ids)), turns)


def protected_horizontal_m(track: Track, params: AvoidanceParams) -> float:
    """Radius of the protected volume, margin included."""
    across_m = track.protected_horizontal_m
    if across_m is None:
        grounded = track.kind is TrafficKind.OBSTACLE
        across_m = params.obstacle_horizontal_m if grounded else params.well_clear_horizontal_m
    return max(across_m, 1.0) * (1.0 + params.horizontal_margin)
