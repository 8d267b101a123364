"""Types of `kernels.py`, whose own annotations are C types."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from companion.model import Vec3

_Array = NDArray[np.float64]

COMPILED: bool

class Times:
    def __init__(self, times_s: _Array, turned_s: _Array, shares: _Array) -> None: ...

class Others:
    def __init__(self, tracks: object) -> None: ...

def columns(rows: Sequence[tuple[Vec3, Vec3, tuple[float, ...]]]) -> tuple[_Array, _Array, _Array]: ...
def tracks_ahead(tracks: object, times: Times) -> _Array: ...
def velocities_until_closest(tracks: object, path_m: _Array, times: Times) -> _Array: ...
def relative_motion(
    position_m: _Array,
    velocity_mps: _Array,
    own_north_m: float,
    own_east_m: float,
    own_down_m: float,
    own_north_mps: float,
    own_east_mps: float,
    own_down_mps: float,
    still_mps: float,
) -> tuple[_Array, _Array, _Array]: ...
def approach_angles(rel_position_m: _Array, own_rel_velocity_mps: _Array, still_mps: float) -> _Array: ...
def half_angles(distance_m: _Array, radius_m: _Array) -> _Array: ...
def reaches(
    distance_m: _Array,
    closing_mps: _Array,
    protected_m: _Array,
    outer_m: float,
    outer_s: float,
    inner_m: float,
    inner_s: float,
) -> _Array: ...
def early(to_closest_s: float, near_s: float, far_s: float) -> float: ...
def too_near(
    closest: _Array,
    entered_s: _Array,
    to_closest_s: _Array,
    buffer_m: _Array,
    protected_m: _Array,
    share_near: float,
    share_far: float,
    near_s: float,
    far_s: float,
) -> NDArray[np.bool_]: ...
def repulsion_magnitudes(surface: _Array, reach: float, gain: float, contact: float) -> _Array: ...
def repulsion(rel_position: _Array, magnitude: _Array) -> tuple[float, float]: ...
def pushes_across(
    own_rel_velocity_mps: _Array, magnitude: _Array, least: float, course_rad: float
) -> tuple[float, float]: ...
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
    times: Times,
) -> _Array: ...
def altitudes(
    now_m: float,
    climb_mps: float,
    target_m: _Array,
    response_s: float,
    max_sink_mps: float,
    max_climb_mps: float,
    times: Times,
) -> _Array: ...
def separation(paths: object, tracks: object, times: Times, count: int, buffers: bool) -> _Array: ...
def losses(
    paths: object,
    tracks: object,
    maneuvers: object,
    weights: object,
    breach_ratio: float,
    times: Times,
    count: int,
    soon: int,
) -> _Array: ...
def heights_to_pass(
    tracks: object,
    own_rel_velocity_mps: _Array,
    to_closest_s: _Array,
    conflict: NDArray[np.bool_],
    longest_s: float,
    horizon_s: float,
    room: float,
) -> tuple[float, float, float]: ...
def add_efforts(
    cost: _Array,
    commands: object,
    weights: object,
    of_outcome: _Array,
    course_rad: float,
    airspeed_mps: float,
    altitude_m: float,
    flown_rad: float,
    wrong: tuple[bool, bool, bool, bool],
    spares_heights: bool,
    held: object | None,
    same_course_rad: float,
    same_height_m: float,
    switched: float,
) -> None: ...
def outcomes(
    paths: object,
    tracks: object,
    then: int,
    mission_m: _Array,
    aside: float,
    unresolved: float,
    ours_north_mps: float,
    ours_east_mps: float,
    altitude_m: float,
    times: Times,
) -> _Array: ...
