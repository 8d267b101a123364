"""Types of the compiled kernels; what they do stands in `kernels.pyx`."""

import numpy as np
from numpy.typing import NDArray

_Array = NDArray[np.float64]

def tracks_ahead(tracks: object, times_s: _Array, turned_s: _Array) -> _Array: ...
def velocities_until_closest(tracks: object, path_m: _Array, times_s: _Array, turned_s: _Array) -> _Array: ...
def relative_motion(
    position_m: _Array,
    velocity_mps: _Array,
    own_position_m: _Array,
    own_velocity_mps: _Array,
    still_mps: float,
) -> tuple[_Array, _Array, _Array, _Array, _Array]: ...
def approach_angles(rel_position_m: _Array, own_rel_velocity_mps: _Array, still_mps: float) -> _Array: ...
def half_angles(distance_m: _Array, radius_m: _Array) -> _Array: ...
def ground_paths(
    north_m: float,
    east_m: float,
    course_rad: float,
    crab_rad: float,
    airspeed_mps: float,
    wind_north_mps: float,
    wind_east_mps: float,
    target_rad: _Array,
    target_mps: _Array,
    turn_acceleration_mps2: float,
    max_rate_radps: float,
    response_s: float,
    acceleration_mps2: float,
    times_s: _Array,
) -> _Array: ...
def altitudes(
    now_m: float,
    climb_mps: float,
    target_m: _Array,
    response_s: float,
    max_sink_mps: float,
    max_climb_mps: float,
    times_s: _Array,
) -> _Array: ...
def separation(
    paths: object,
    tracks: object,
    times_s: _Array,
    turned_s: _Array,
    shares: _Array,
    count: int,
    shells: bool,
) -> tuple[_Array, _Array, _Array]: ...
def losses(
    paths: object,
    tracks: object,
    likely: _Array,
    weights: object,
    lost: float,
    times_s: _Array,
    turned_s: _Array,
    shares: _Array,
    predicted: int,
    count: int,
    soon: int,
) -> tuple[_Array, _Array]: ...
def left_to_pass(
    paths: object,
    tracks: object,
    then: int,
    ours_north_mps: float,
    ours_east_mps: float,
    altitude_m: float,
    times_s: _Array,
    turned_s: _Array,
) -> _Array: ...
