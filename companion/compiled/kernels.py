"""The inner loops of a decision: relative motion, the potential field, flying ahead, separation and cost.

This one source runs in two ways, which give the same bits. Where a C compiler was found at installation,
Cython compiled it, and Python imports the extension; otherwise Python runs this file, about thirty times more
slowly. After a change run `make setup`: until then Python imports the old extension.

The callers in `companion.avoidance` explain what is computed and why; this file has the arithmetic. Numbers
are double precision, and operations are neither reordered nor fused. Arrays have rows or tracks first and the
T times of the prediction last, and are C-contiguous unless a docstring says otherwise. Arrays with lengths
that do not match raise `ValueError`. Inputs are not changed.

Rules for a change, so that both ways stay equal:
- Read an array through `_lists`, with one pair of brackets for each index: lists are what plain Python reads
  fastest.
- Never divide by zero, and pass no infinity to `sin`, `cos` or `fmod`: C continues, but Python raises.
- `hypot` is the C library's. `math.hypot` of Python rounds differently.
"""

from __future__ import annotations

import numpy as np

try:
    import cython as c
except ImportError:
    from companion.compiled import no_cython as c

if c.compiled:
    from cython.cimports.cpython.mem import PyMem_Free, PyMem_Malloc
    from cython.cimports.libc.math import asin, atan2, cos, fabs, fmod, hypot, sin, sqrt
else:
    from math import asin, atan2, cos, fabs, fmod, sin, sqrt

    def hypot(north, east):
        """The C library's hypot."""
        return abs(complex(north, east))


COMPILED = c.compiled

INFINITY = c.declare(c.double, float("inf"))
PI = c.declare(c.double, 3.141592653589793)
TO_THE_LEFT_RAD = c.declare(c.double, -PI / 180.0)


@c.cfunc
@c.inline
def _lists(array):
    """The array itself where compiled, otherwise nested lists of its numbers."""
    return array if c.compiled else array.tolist()


@c.cfunc
@c.exceptval(-1)
def _expect(fits: c.bint) -> c.bint:
    if not fits:
        raise ValueError("arrays of lengths that do not match")
    return fits


@c.cfunc
@c.inline
@c.exceptval(check=False)
def _between(value: c.double, low: c.double, high: c.double) -> c.double:
    return low if value < low else high if value > high else value


@c.cfunc
@c.inline
@c.exceptval(check=False)
def _wrap_pi(angle_rad: c.double) -> c.double:
    """The same angle in [-pi, pi)."""
    turned = fmod(angle_rad + PI, 2.0 * PI)
    return turned + PI if turned < 0.0 else turned - PI


@c.cfunc
@c.inline
@c.exceptval(check=False)
def _crab_rad(
    course_rad: c.double, airspeed_mps: c.double, north_mps: c.double, east_mps: c.double,
) -> c.double:  # fmt: skip
    """Angle by which the nose must be left of a course to hold it in this wind (wind triangle)."""
    across_mps = east_mps * cos(course_rad) - north_mps * sin(course_rad)
    return asin(_between(across_mps / max(airspeed_mps, 1e-3), -1.0, 1.0))


@c.final
@c.cclass
class _Scratch:
    """Memory for `count` numbers, not initialized: C memory where compiled, otherwise a list."""

    value: c.pointer[c.double]

    def __init__(self, count: c.Py_ssize_t):
        if c.compiled:
            self.value = c.cast(c.pointer[c.double], PyMem_Malloc(max(count, 1) * c.sizeof(c.double)))
            if not self.value:
                raise MemoryError
        else:
            self.value = [0.0] * count

    def __dealloc__(self):
        if c.compiled:
            PyMem_Free(self.value)


@c.final
@c.cclass
class Times:
    """The T moments of a prediction, checked once.

    `turned_s` is how long a rate of turn has acted by the middle of each step, and `shares` is each step's
    share of the whole time, both (T - 1,).
    """

    count: c.Py_ssize_t
    times_s: c.const[c.double][::1]
    turned_s: c.const[c.double][::1]
    shares: c.const[c.double][::1]

    def __init__(self, times_s, turned_s, shares):
        self.times_s, self.turned_s, self.shares = _lists(times_s), _lists(turned_s), _lists(shares)
        self.count = len(self.times_s)
        _expect(self.count >= 2 and len(self.turned_s) + 1 == self.count)
        _expect(len(self.shares) + 1 == self.count)


@c.final
@c.cclass
class Others:
    """Tracks as the loops need them, checked once: positions and velocities (N, 3), the rest (N,)."""

    count: c.Py_ssize_t
    position_m: c.const[c.double][:, ::1]
    velocity_mps: c.const[c.double][:, ::1]
    turn_radps: c.const[c.double][::1]
    horizontal_m: c.const[c.double][::1]
    vertical_m: c.const[c.double][::1]
    buffer_m: c.const[c.double][::1]
    grounded: c.const[c.uchar][::1]

    def __init__(self, tracks):
        self.position_m, self.velocity_mps = _lists(tracks.position_m), _lists(tracks.velocity_mps)
        self.turn_radps, self.buffer_m = _lists(tracks.turn_radps), _lists(tracks.buffer_m)
        self.horizontal_m = _lists(tracks.protected_horizontal_m)
        self.vertical_m = _lists(tracks.protected_vertical_m)
        self.grounded = _lists(tracks.grounded.view(np.uint8))
        self.count = len(self.position_m)
        _expect(tracks.position_m.shape[1] == 3 and tracks.velocity_mps.shape[1] == 3)
        _expect(len(self.velocity_mps) == self.count and len(self.turn_radps) == self.count)
        _expect(len(self.horizontal_m) == self.count and len(self.vertical_m) == self.count)
        _expect(len(self.grounded) == self.count and len(self.buffer_m) == self.count)


@c.cfunc
@c.inline
@c.exceptval(check=False)
def _fly_ahead(
    ahead_m: c.pointer[c.double], start: c.Py_ssize_t, others: Others, n: c.Py_ssize_t,
    turn_radps: c.double, times: Times,
) -> c.void:  # fmt: skip
    """Write the places of track `n` at all times, with this turn: north, east, 2 T numbers from `start`."""
    times_s: c.const[c.double][::1] = times.times_s
    turned_s: c.const[c.double][::1] = times.turned_s
    north_m, east_m = others.position_m[n][0], others.position_m[n][1]
    north_mps, east_mps = others.velocity_mps[n][0], others.velocity_mps[n][1]
    ahead_m[start], ahead_m[start + 1] = north_m, east_m
    if turn_radps == 0.0:
        for i in range(1, times.count):
            ahead_m[start + 2 * i] = north_m + north_mps * times_s[i]
            ahead_m[start + 2 * i + 1] = east_m + east_mps * times_s[i]
        return
    for i in range(1, times.count):
        step_s = times_s[i] - times_s[i - 1]
        ahead = step_s * cos(turn_radps * turned_s[i - 1])
        across = step_s * sin(turn_radps * turned_s[i - 1])
        north_m = north_m + north_mps * ahead - east_mps * across
        east_m = east_m + east_mps * ahead + north_mps * across
        ahead_m[start + 2 * i], ahead_m[start + 2 * i + 1] = north_m, east_m


def columns(rows):
    """Rows of tracks as arrays: positions and velocities, both (N, 3), and the other numbers, one row each.

    A row is a position, a velocity and a tuple of further numbers, equally many in all rows.
    """
    count: c.Py_ssize_t = len(rows)
    further: c.Py_ssize_t = len(rows[0][2]) if count else 0
    positions, velocities = np.empty((count, 3)), np.empty((count, 3))
    others = np.empty((further, count))
    position_m: c.double[:, ::1] = positions
    velocity_mps: c.double[:, ::1] = velocities
    other: c.double[:, ::1] = others
    for n in range(count):
        position, velocity, rest = rows[n]
        _expect(len(rest) == further)
        position_m[n, 0], position_m[n, 1], position_m[n, 2] = position
        velocity_mps[n, 0], velocity_mps[n, 1], velocity_mps[n, 2] = velocity
        for i in range(further):
            other[i, n] = rest[i]
    return positions, velocities, others


def tracks_ahead(tracks, times: Times):
    """Positions of tracks at the times, north and east, (N, T, 2)."""
    others: Others = tracks.others
    scratch: _Scratch = _Scratch(2 * times.count)
    ahead = scratch.value
    result = np.empty((others.count, times.count, 2))
    ahead_m: c.double[:, :, ::1] = result
    for n in range(others.count):
        _fly_ahead(ahead, 0, others, n, others.turn_radps[n], times)
        for i in range(times.count):
            ahead_m[n, i, 0], ahead_m[n, i, 1] = ahead[2 * i], ahead[2 * i + 1]
    return result


def velocities_until_closest(tracks, path_m, times: Times):
    """Mean velocities of tracks until they are closest to a ground path (T, 2), at least one step, (N, 3)."""
    others: Others = tracks.others
    path: c.const[c.double][:, ::1] = _lists(path_m)
    _expect(len(path) == times.count and path_m.shape[1] == 2)
    result = np.array(tracks.velocity_mps)
    mean_mps: c.double[:, ::1] = result
    scratch: _Scratch = _Scratch(2 * times.count)
    ahead_m = scratch.value
    for n in range(others.count):
        if others.turn_radps[n] == 0.0:
            continue
        _fly_ahead(ahead_m, 0, others, n, others.turn_radps[n], times)
        nearest, least2 = 0, INFINITY
        for i in range(times.count):
            north, east = ahead_m[2 * i] - path[i][0], ahead_m[2 * i + 1] - path[i][1]
            off2 = north * north + east * east
            if off2 < least2:
                nearest, least2 = i, off2
        nearest = max(nearest, 1)
        mean_mps[n, 0] = (ahead_m[2 * nearest] - ahead_m[0]) / times.times_s[nearest]
        mean_mps[n, 1] = (ahead_m[2 * nearest + 1] - ahead_m[1]) / times.times_s[nearest]
    return result


@c.cfunc
@c.inline
@c.exceptval(check=False)
def _approach_angle(
    north: c.double, east: c.double, north_mps: c.double, east_mps: c.double, still_mps: c.double,
) -> c.double:  # fmt: skip
    """Angle from the line of sight to a velocity, positive to the left; pi without motion."""
    if hypot(north_mps, east_mps) < still_mps:
        return PI
    # In north-east coordinates a positive cross product turns clockwise, to the right.
    return atan2(-(north * east_mps - east * north_mps), north * north_mps + east * east_mps)


def relative_motion(
    position_m, velocity_mps, own_north_m: c.double, own_east_m: c.double, own_down_m: c.double,
    own_north_mps: c.double, own_east_mps: c.double, own_down_mps: c.double, still_mps: c.double,
):  # fmt: skip
    """Positions relative to ownship, ownship's velocities relative to the others, both (N, 3), and (4, N).

    The four rows are, over ground: distance, closing speed, time to the closest approach, approach angle.
    A speed below `still_mps` counts as no motion.
    """
    places: c.const[c.double][:, ::1] = _lists(position_m)
    others_mps: c.const[c.double][:, ::1] = _lists(velocity_mps)
    count = len(places)
    _expect(position_m.shape[1] == 3 and velocity_mps.shape[1] == 3 and len(others_mps) == count)
    positions, velocities, rows = np.empty((count, 3)), np.empty((count, 3)), np.empty((4, count))
    rel_m: c.double[:, ::1] = positions
    own_mps: c.double[:, ::1] = velocities
    row: c.double[:, ::1] = rows
    for n in range(count):
        north_m, east_m = places[n][0] - own_north_m, places[n][1] - own_east_m
        north_mps, east_mps = own_north_mps - others_mps[n][0], own_east_mps - others_mps[n][1]
        rel_m[n, 0], rel_m[n, 1], rel_m[n, 2] = north_m, east_m, places[n][2] - own_down_m
        own_mps[n, 0], own_mps[n, 1], own_mps[n, 2] = north_mps, east_mps, own_down_mps - others_mps[n][2]
        along = north_m * north_mps + east_m * east_mps
        speed2 = north_mps * north_mps + east_mps * east_mps
        distance_m = hypot(north_m, east_m)
        row[0, n] = distance_m
        row[1, n] = max(along / max(distance_m, 1e-9), 0.0)
        row[2, n] = along / speed2 if speed2 > still_mps * still_mps else INFINITY
        row[3, n] = _approach_angle(north_m, east_m, north_mps, east_mps, still_mps)
    return positions, velocities, rows


def approach_angles(rel_position_m, own_rel_velocity_mps, still_mps: c.double):
    """Angles from the lines of sight to the velocities, positive to the left, (N,); pi without motion.

    Both arrays are (N, 2) or wider and may have any layout.
    """
    rel_m: c.const[c.double][:, :] = _lists(rel_position_m)
    own_mps: c.const[c.double][:, :] = _lists(own_rel_velocity_mps)
    count = len(rel_m)
    _expect(len(own_mps) == count)
    _expect(rel_position_m.shape[1] >= 2 and own_rel_velocity_mps.shape[1] >= 2)
    result = np.empty(count)
    alpha_rad: c.double[::1] = result
    for n in range(count):
        alpha_rad[n] = _approach_angle(rel_m[n][0], rel_m[n][1], own_mps[n][0], own_mps[n][1], still_mps)
    return result


def half_angles(distance_m, radius_m):
    """Half angles that circles subtend, (N,); pi within them."""
    distances_m: c.const[c.double][::1] = _lists(distance_m)
    radii_m: c.const[c.double][::1] = _lists(radius_m)
    count = len(distances_m)
    _expect(len(radii_m) == count)
    result = np.empty(count)
    beta_rad: c.double[::1] = result
    for n in range(count):
        if distances_m[n] <= radii_m[n]:
            beta_rad[n] = PI
        else:
            beta_rad[n] = asin(min(radii_m[n] / max(distances_m[n], 1e-9), 1.0))
    return result


def reaches(
    distance_m, closing_mps, protected_m, outer_m: c.double, outer_s: c.double, inner_m: c.double,
    inner_s: c.double,
):  # fmt: skip
    """Distances to the protected circles, and how far the outer and the inner layer reach, (3, N)."""
    distances_m: c.const[c.double][::1] = _lists(distance_m)
    closings_mps: c.const[c.double][::1] = _lists(closing_mps)
    radii_m: c.const[c.double][::1] = _lists(protected_m)
    count = len(distances_m)
    _expect(len(closings_mps) == count and len(radii_m) == count)
    result = np.empty((3, count))
    reach_m: c.double[:, ::1] = result
    for n in range(count):
        reach_m[0, n] = distances_m[n] - radii_m[n]
        reach_m[1, n] = max(outer_m, outer_s * closings_mps[n])
        reach_m[2, n] = max(inner_m, inner_s * closings_mps[n])
    return result


@c.cfunc
@c.inline
@c.exceptval(check=False)
def _early(to_closest_s: c.double, near_s: c.double, far_s: c.double) -> c.double:
    return _between((to_closest_s - near_s) / max(far_s - near_s, 1e-3), 0.0, 1.0)


def early(to_closest_s: c.double, near_s: c.double, far_s: c.double):
    """0 where the closest approach is within `near_s`, 1 from `far_s` on."""
    return _early(to_closest_s, near_s, far_s)


def too_near(
    closest, entered_s, to_closest_s, buffer_m, protected_m, share_near: c.double, share_far: c.double,
    near_s: c.double, far_s: c.double,
):  # fmt: skip
    """Which tracks come closer than a share of their volume with its buffer, (N,).

    The share is `share_far` while there is time, and `share_near` when there is none, also if the volume is
    entered soon.
    """
    closests: c.const[c.double][::1] = _lists(closest)
    entries_s: c.const[c.double][::1] = _lists(entered_s)
    to_closests_s: c.const[c.double][::1] = _lists(to_closest_s)
    buffers_m: c.const[c.double][::1] = _lists(buffer_m)
    radii_m: c.const[c.double][::1] = _lists(protected_m)
    count = len(closests)
    _expect(len(entries_s) == count and len(to_closests_s) == count)
    _expect(len(buffers_m) == count and len(radii_m) == count)
    result = np.empty(count, dtype=bool)
    near: c.uchar[::1] = result.view(np.uint8)
    for n in range(count):
        left_s = min(to_closests_s[n], entries_s[n] + near_s)
        share = share_near + (share_far - share_near) * _early(left_s, near_s, far_s)
        near[n] = closests[n] < (1.0 + buffers_m[n] / radii_m[n]) * share
    return result


def repulsion_magnitudes(surface, reach: c.double, gain: c.double, contact: c.double):
    """Magnitudes of repulsive forces by distance to the surface, (N,); constant within `contact`."""
    distances: c.const[c.double][::1] = _lists(surface)
    count = len(distances)
    result = np.empty(count)
    magnitude: c.double[::1] = result
    for n in range(count):
        inverse = 1.0 / max(distances[n], contact)
        magnitude[n] = gain * max(inverse - 1.0 / reach, 0.0) * inverse * inverse
    return result


def repulsion(rel_position, magnitude):
    """The sum of forces of these magnitudes away from positions (N, 2+) of any layout, north and east."""
    places: c.const[c.double][:, :] = _lists(rel_position)
    magnitudes: c.const[c.double][::1] = _lists(magnitude)
    count = len(magnitudes)
    _expect(len(places) == count and rel_position.shape[1] >= 2)
    north = east = 0.0
    for n in range(count):
        share = magnitudes[n] / max(hypot(places[n][0], places[n][1]), 1e-9)
        north -= places[n][0] * share
        east -= places[n][1] * share
    return north, east


def pushes_across(own_rel_velocity_mps, magnitude, least: c.double, course_rad: c.double):
    """The sum of pushes across velocities (N, 2+), to the right of a course, north and east.

    No push is weaker than `least`.
    """
    own_mps: c.const[c.double][:, :] = _lists(own_rel_velocity_mps)
    magnitudes: c.const[c.double][::1] = _lists(magnitude)
    count = len(magnitudes)
    _expect(len(own_mps) == count and own_rel_velocity_mps.shape[1] >= 2)
    north = east = 0.0
    along_north, along_east = cos(course_rad), sin(course_rad)
    for n in range(count):
        north_mps, east_mps = own_mps[n][0], own_mps[n][1]
        share = max(magnitudes[n], least) / max(hypot(north_mps, east_mps), 1e-6)
        if along_north * north_mps + along_east * east_mps < 0.0:
            share = -share
        north -= share * east_mps
        east += share * north_mps
    return north, east


def ground_paths(
    north_m: c.double, east_m: c.double, course_rad: c.double, crab_rad: c.double, airspeed_mps: c.double,
    wind_north_mps: c.double, wind_east_mps: c.double, target_rad, target_mps,
    turn_acceleration_mps2: c.double, max_rate_radps: c.double, response_s: c.double,
    acceleration_mps2: c.double, times: Times,
):  # fmt: skip
    """Ground paths by eq. 2 to target courses and airspeeds (H,), (H, T, 2)."""
    courses_rad: c.const[c.double][::1] = _lists(target_rad)
    speeds_mps: c.const[c.double][::1] = _lists(target_mps)
    times_s: c.const[c.double][::1] = times.times_s
    rows = len(courses_rad)
    _expect(len(speeds_mps) == rows)
    result = np.empty((rows, times.count, 2))
    path_m: c.double[:, :, ::1] = result
    nose_rad = course_rad - crab_rad
    windy = wind_north_mps != 0.0 or wind_east_mps != 0.0
    for h in range(rows):
        path_m[h, 0, 0], path_m[h, 0, 1] = north_m, east_m
        through_north_m = through_east_m = 0.0
        # An aircraft that speeds up in a turn turns more slowly: the rate of the greater speed fits both.
        rate_radps = min(turn_acceleration_mps2 / max(speeds_mps[h], airspeed_mps, 1.0), max_rate_radps)
        to_turn_rad = turn_rad = _wrap_pi(courses_rad[h] - course_rad)
        flown_mps, flown_rad, north, east = -1.0, nose_rad, cos(nose_rad), sin(nose_rad)
        for i in range(1, times.count):
            step_s = times_s[i] - times_s[i - 1]
            middle_s = times_s[i - 1] + 0.5 * step_s
            speed_mps = airspeed_mps + _between(
                speeds_mps[h] - airspeed_mps, -acceleration_mps2 * middle_s, acceleration_mps2 * middle_s
            )
            if windy and speed_mps != flown_mps:
                turn_rad = to_turn_rad + crab_rad - _crab_rad(
                    courses_rad[h], speed_mps, wind_north_mps, wind_east_mps
                )  # fmt: skip
            flown_mps = speed_mps
            most_rad = rate_radps * max(middle_s - response_s, 0.0)
            heading_rad = nose_rad + _between(turn_rad, -most_rad, most_rad)
            if heading_rad != flown_rad:
                flown_rad, north, east = heading_rad, cos(heading_rad), sin(heading_rad)
            through_north_m += step_s * speed_mps * north
            through_east_m += step_s * speed_mps * east
            path_m[h, i, 0] = north_m + wind_north_mps * times_s[i] + through_north_m
            path_m[h, i, 1] = east_m + wind_east_mps * times_s[i] + through_east_m
    return result


def altitudes(
    now_m: c.double, climb_mps: c.double, target_m, response_s: c.double, max_sink_mps: c.double,
    max_climb_mps: c.double, times: Times,
):  # fmt: skip
    """Altitudes on the way to target altitudes (Z,), (Z, T): the present climb first, then at the limit."""
    targets_m: c.const[c.double][::1] = _lists(target_m)
    times_s: c.const[c.double][::1] = times.times_s
    result = np.empty((len(targets_m), times.count))
    altitude_m: c.double[:, ::1] = result
    for z in range(len(targets_m)):
        to_go_m = targets_m[z] - (now_m + climb_mps * response_s)
        for i in range(times.count):
            before_m = now_m + climb_mps * min(times_s[i], response_s)
            acting_s = max(times_s[i] - response_s, 0.0)
            altitude_m[z, i] = before_m + _between(
                to_go_m, -max_sink_mps * acting_s, max_climb_mps * acting_s
            )
    return result


@c.final
@c.cclass
class _Paths:
    """Paths as the loops need them, checked: over ground (H, T, 2), altitudes (Z, T), rows of both (K,).

    `ground_m` and `altitude_m` are flat.
    """

    grounds: c.Py_ssize_t
    heights: c.Py_ssize_t
    rows: c.Py_ssize_t
    ground_m: c.const[c.double][::1]
    altitude_m: c.const[c.double][::1]
    ground_of: c.const[c.Py_ssize_t][::1]
    height_of: c.const[c.Py_ssize_t][::1]

    def __init__(self, paths, times: c.Py_ssize_t):
        grounds, heights = paths.ground_m, paths.altitude_m
        self.ground_of, self.height_of = _lists(paths.ground_of), _lists(paths.height_of)
        self.grounds, self.heights, self.rows = len(grounds), len(heights), len(self.ground_of)
        _expect(grounds.ndim == 3 and grounds.shape[1] == times and grounds.shape[2] == 2)
        _expect(heights.ndim == 2 and heights.shape[1] == times)
        _expect(len(self.height_of) == self.rows)
        self.ground_m, self.altitude_m = _lists(grounds.reshape(-1)), _lists(heights.reshape(-1))
        for k in range(self.rows):
            _expect(0 <= self.ground_of[k] < self.grounds and 0 <= self.height_of[k] < self.heights)


@c.final
@c.cclass
class _Squares:
    """Squared distances of paths from one track, in protected volumes: over ground (H, T), in height (Z, T).

    One square root for each row is then enough, except within a volume. `square` is flat: ground path `h` is
    at `h * times`, altitude `z` at `(grounds + z) * times`; then comes the track, north and east.
    """

    times: c.Py_ssize_t
    scratch: _Scratch
    square: c.pointer[c.double]

    def __init__(self, paths: _Paths, times: c.Py_ssize_t):
        self.times = times
        self.scratch = _Scratch((paths.grounds + paths.heights + 2) * times)
        self.square = self.scratch.value

    @c.cfunc
    @c.exceptval(check=False)
    def measure(
        self, paths: _Paths, others: Others, n: c.Py_ssize_t, turn_radps: c.double, sink_mps: c.double,
        times: Times, count: c.Py_ssize_t,
    ) -> c.void:  # fmt: skip
        """Measure from track `n`, turning and sinking at these rates, at the first `count` times."""
        track: c.Py_ssize_t = (paths.grounds + paths.heights) * self.times
        square = self.square
        per_horizontal2 = 1.0 / (others.horizontal_m[n] * others.horizontal_m[n])
        per_vertical2 = 1.0 / (others.vertical_m[n] * others.vertical_m[n])
        _fly_ahead(square, track, others, n, turn_radps, times)
        ground_m: c.const[c.double][::1] = paths.ground_m
        for h in range(paths.grounds):
            at = h * self.times
            for i in range(count):
                north = ground_m[2 * (at + i)] - square[track + 2 * i]
                east = ground_m[2 * (at + i) + 1] - square[track + 2 * i + 1]
                square[at + i] = (north * north + east * east) * per_horizontal2
        altitude_m: c.const[c.double][::1] = paths.altitude_m
        times_s: c.const[c.double][::1] = times.times_s
        now_down_m, grounded = others.position_m[n][2], others.grounded[n]
        for z in range(paths.heights):
            at = (paths.grounds + z) * self.times
            for i in range(count):
                down_m = now_down_m + sink_mps * times_s[i]
                above_m = altitude_m[z * self.times + i] + down_m
                if grounded and above_m < 0.0:
                    above_m = 0.0
                square[at + i] = above_m * above_m * per_vertical2


@c.cfunc
@c.inline
@c.exceptval(check=False)
def _least_of_greater(
    square: c.pointer[c.double], ground: c.Py_ssize_t, height: c.Py_ssize_t, count: c.Py_ssize_t,
) -> c.double:  # fmt: skip
    """The smallest over time of the greater of two rows.

    Two minima are kept side by side, because each step of a minimum has to wait for the step before. Written
    without `min` and `max`, which are slow in plain Python.
    """
    across: c.Py_ssize_t = height - ground
    first = second = INFINITY
    for i in range(ground, ground + count - 1, 2):
        one, other = square[i], square[i + across]
        one = other if other > one else one
        first = one if one < first else first
        one, other = square[i + 1], square[i + across + 1]
        one = other if other > one else one
        second = one if one < second else second
    i = ground + count - 1
    one, other = square[i], square[i + across]
    one = other if other > one else one
    first = one if one < first else first
    return second if second < first else first


def separation(paths, tracks, times: Times, count: c.Py_ssize_t, buffers: c.bint):
    """How K rows keep clear of N tracks in the first `count` times, (4, K, N).

    The four are closest, exposure, nearness, and the time when the volume is entered, inf if never.
    """
    _expect(1 <= count <= times.count)
    flown: _Paths = _Paths(paths, times.count)
    others: Others = tracks.others
    squares: _Squares = _Squares(flown, times.count)
    square = squares.square
    result = np.empty((4, flown.rows, others.count))
    kept: c.double[:, :, ::1] = result
    for n in range(others.count):
        squares.measure(flown, others, n, others.turn_radps[n], others.velocity_mps[n][2], times, count)
        volumes = others.horizontal_m[n] / max(others.buffer_m[n], 1.0)
        for k in range(flown.rows):
            ground: c.Py_ssize_t = flown.ground_of[k] * times.count
            height: c.Py_ssize_t = (flown.grounds + flown.height_of[k]) * times.count
            least = _least_of_greater(square, ground, height, count)
            depth = near = 0.0
            entered_s = INFINITY
            if least < 1.0:
                i = 0
                while max(square[ground + i], square[height + i]) >= 1.0:
                    i += 1
                entered_s = times.times_s[i]
            if least < 1.0 or buffers:
                for i in range(1, count):
                    ratio = max(square[ground + i], square[height + i])
                    if ratio < 1.0 or buffers:
                        ratio = sqrt(ratio)
                        depth += times.shares[i - 1] * max(1.0 - ratio, 0.0)
                        near += times.shares[i - 1] * _between(1.0 - (ratio - 1.0) * volumes, 0.0, 1.0)
            kept[0, k, n], kept[1, k, n] = sqrt(least), depth
            kept[2, k, n], kept[3, k, n] = near if buffers else 0.0, entered_s
    return result


@c.final
@c.cclass
class _Prices:
    """The cost of coming near."""

    margin: c.double
    loss: c.double
    depth: c.double
    exposure: c.double
    breach_ratio: c.double

    def __init__(self, weights, breach_ratio: c.double):
        self.margin, self.loss = weights.margin, weights.loss
        self.depth, self.exposure, self.breach_ratio = weights.depth, weights.exposure, breach_ratio

    @c.cfunc
    @c.inline
    @c.exceptval(check=False)
    def of(
        self, near: c.double, square: c.pointer[c.double], ground: c.Py_ssize_t, height: c.Py_ssize_t,
        shares: c.const[c.double][::1], count: c.Py_ssize_t,
    ) -> c.double:  # fmt: skip
        """The cost of a row that comes as near as `near` to the track measured last; 0 outside its volume."""
        if near >= 1.0:
            return 0.0
        within = 0.0
        for i in range(1, count):
            one, other = square[ground + i], square[height + i]
            ratio = other if other > one else one
            if ratio < 1.0:
                within += shares[i - 1] * (1.0 - sqrt(ratio))
        price = self.margin * (1.0 - near) + self.exposure * within
        if near < self.breach_ratio:
            price += self.loss + self.depth * (self.breach_ratio - near)
        return price


def losses(
    paths, tracks, maneuvers, weights, breach_ratio: c.double, times: Times, count: c.Py_ssize_t,
    soon: c.Py_ssize_t,
):  # fmt: skip
    """The cost of rows by separation from tracks and maneuvers, and their closest separation, (2, K).

    Predicted flights count at the first `count` times; the closest separation is from them alone. A maneuver
    counts at the first `soon` times, weighted with its likelihood.

    The price has no step at the edge of the margin: a path along it is flown slightly differently than
    planned, and that must not change the decision.
    """
    _expect(1 <= count <= times.count and 1 <= soon <= times.count)
    flown: _Paths = _Paths(paths, times.count)
    others: Others = tracks.others
    squares: _Squares = _Squares(flown, times.count)
    square = squares.square
    shares: c.const[c.double][::1] = times.shares
    prices: _Prices = _Prices(weights, breach_ratio)
    of: c.const[c.Py_ssize_t][::1] = _lists(maneuvers.of)
    turn_radps: c.const[c.double][::1] = _lists(maneuvers.turn_radps)
    sink_mps: c.const[c.double][::1] = _lists(maneuvers.sink_mps)
    likely: c.const[c.double][::1] = _lists(maneuvers.likely)
    _expect(len(turn_radps) == len(of) and len(sink_mps) == len(of) and len(likely) == len(of))
    rows = flown.rows
    scratch: _Scratch = _Scratch(2 * rows)
    value = scratch.value  # costs, then squares of the closest separations
    for k in range(rows):
        value[k], value[rows + k] = 0.0, INFINITY
    for n in range(others.count):
        squares.measure(flown, others, n, others.turn_radps[n], others.velocity_mps[n][2], times, count)
        for k in range(rows):
            ground = flown.ground_of[k] * times.count
            height = (flown.grounds + flown.height_of[k]) * times.count
            near2 = _least_of_greater(square, ground, height, count)
            value[k] += prices.of(sqrt(near2), square, ground, height, shares, count)
            value[rows + k] = min(value[rows + k], near2)
    for n in range(len(of)):
        _expect(0 <= of[n] < others.count)
        squares.measure(flown, others, of[n], turn_radps[n], sink_mps[n], times, soon)
        for k in range(rows):
            ground = flown.ground_of[k] * times.count
            height = (flown.grounds + flown.height_of[k]) * times.count
            near2 = _least_of_greater(square, ground, height, soon)
            value[k] += likely[n] * prices.of(sqrt(near2), square, ground, height, shares, soon)
    result = np.empty((2, rows))
    cost: c.double[:, ::1] = result
    for k in range(rows):
        cost[0, k], cost[1, k] = value[k], sqrt(value[rows + k])
    return result


def heights_to_pass(
    tracks, own_rel_velocity_mps, to_closest_s, conflict, longest_s: c.double, horizon_s: c.double,
    room: c.double,
):  # fmt: skip
    """The lowest height over and the highest under all tracks in conflict, (N,), and when all are passed."""
    others: Others = tracks.others
    own_mps: c.const[c.double][:, ::1] = _lists(own_rel_velocity_mps)
    to_closests_s: c.const[c.double][::1] = _lists(to_closest_s)
    relevant: c.const[c.uchar][::1] = _lists(conflict.view(np.uint8))
    _expect(len(own_mps) == others.count and own_rel_velocity_mps.shape[1] == 3)
    _expect(len(to_closests_s) == others.count and len(relevant) == others.count)
    over_m, under_m, passed_s = -INFINITY, INFINITY, 0.0
    for n in range(others.count):
        if not relevant[n]:
            continue
        relative_mps = max(hypot(own_mps[n][0], own_mps[n][1]), 1.0)
        crossing_s = min(others.horizontal_m[n] / relative_mps, longest_s)
        closest_s = _between(to_closests_s[n], 0.0, horizon_s)
        now_m, sink_mps = -others.position_m[n][2], others.velocity_mps[n][2]
        first_m = now_m - sink_mps * max(closest_s - crossing_s, 0.0)
        last_m = now_m - sink_mps * (closest_s + crossing_s)
        room_m = room * others.vertical_m[n]
        over_m = max(over_m, max(first_m, last_m) + room_m)
        under_m = min(under_m, min(first_m, last_m) - room_m)
        passed_s = max(passed_s, closest_s + crossing_s)
    return over_m, under_m, passed_s


def outcomes(
    paths, tracks, then: c.Py_ssize_t, mission_m, aside: c.double, unresolved: c.double,
    onward_north_mps: c.double, onward_east_mps: c.double, altitude_m: c.double, times: Times,
):  # fmt: skip
    """The cost of the places of ground paths at the time with index `then`, (H,).

    `aside` is for each metre from the mission's position at that time, (2,). `unresolved` is for the deepest
    penetration of any volume when flying straight on from there.
    """
    _expect(1 <= then < times.count)
    flown: _Paths = _Paths(paths, times.count)
    others: Others = tracks.others
    mission: c.const[c.double][::1] = _lists(mission_m)
    _expect(len(mission) == 2)
    ground_m: c.const[c.double][::1] = flown.ground_m
    result = np.empty(flown.grounds)
    price: c.double[::1] = result
    deepest_scratch: _Scratch = _Scratch(flown.grounds)
    scratch: _Scratch = _Scratch(2 * times.count)
    deepest, other_m = deepest_scratch.value, scratch.value
    for h in range(flown.grounds):
        deepest[h] = 0.0
    step_s = times.times_s[then] - times.times_s[then - 1]
    for n in range(others.count):
        _fly_ahead(other_m, 0, others, n, others.turn_radps[n], times)
        other_north_m, other_east_m = other_m[2 * then], other_m[2 * then + 1]
        north_mps = (other_north_m - other_m[2 * then - 2]) / step_s - onward_north_mps
        east_mps = (other_east_m - other_m[2 * then - 1]) / step_s - onward_east_mps
        speed2 = max(north_mps * north_mps + east_mps * east_mps, 1.0)
        above_m = altitude_m + others.position_m[n][2] + others.velocity_mps[n][2] * times.times_s[then]
        vertical = (max(above_m, 0.0) if others.grounded[n] else fabs(above_m)) / others.vertical_m[n]
        for h in range(flown.grounds):
            north_m = other_north_m - ground_m[2 * (h * times.count + then)]
            east_m = other_east_m - ground_m[2 * (h * times.count + then) + 1]
            to_go_s = max(-(north_m * north_mps + east_m * east_mps) / speed2, 0.0)
            across_m = hypot(north_m + north_mps * to_go_s, east_m + east_mps * to_go_s)
            deepest[h] = max(deepest[h], 1.0 - max(across_m / others.horizontal_m[n], vertical))
    for h in range(flown.grounds):
        north_m = ground_m[2 * (h * times.count + then)] - mission[0]
        east_m = ground_m[2 * (h * times.count + then) + 1] - mission[1]
        price[h] = aside * hypot(north_m, east_m) + unresolved * deepest[h]
    return result


def add_efforts(
    cost: c.double[::1], commands, weights, of_outcome, course_rad: c.double, airspeed_mps: c.double,
    altitude_m: c.double, flown_rad: c.double, wrong, spares_heights: c.bint, held,
    same_course_rad: c.double, same_height_m: c.double, switched: c.double,
):  # fmt: skip
    """Add to `cost`, (K,), the cost of the rows themselves and that of their ground paths' outcome, (H,).

    `course_rad`, `airspeed_mps` and `altitude_m` are the mission's, `flown_rad` is the course flown. `held`
    is the guidance of row 0 or `None`; with it, `switched` is added to the cost of any other row. `wrong` is
    four times whether a way is wrong: up, down, left, right.
    """
    target_rad: c.const[c.double][::1] = _lists(commands.course_rad)
    target_mps: c.const[c.double][::1] = _lists(commands.airspeed_mps)
    target_m: c.const[c.double][::1] = _lists(commands.altitude_m)
    outcome: c.const[c.double][::1] = _lists(of_outcome)
    ground_of: c.const[c.Py_ssize_t][::1] = _lists(commands.ground_of)
    height_of: c.const[c.Py_ssize_t][::1] = _lists(commands.height_of)
    grounds, heights, rows = len(target_rad), len(target_m), len(ground_of)
    _expect(len(target_mps) == grounds and len(outcome) == grounds)
    _expect(len(cost) == rows and len(height_of) == rows)
    turn: c.double = weights.turn / PI
    deviation: c.double = weights.deviation / PI
    speed: c.double = weights.speed / 10.0
    wrong_up: c.double = weights.wrong_sense if wrong[0] else 0.0
    wrong_down: c.double = weights.wrong_sense if wrong[1] else 0.0
    wrong_left: c.double = weights.wrong_side if wrong[2] else 0.0
    wrong_right: c.double = weights.wrong_side if wrong[3] else 0.0
    height: c.double = weights.height / 100.0
    descent: c.double = weights.descent
    spared_height: c.double = weights.spared_height if spares_heights else 0.0
    eased: c.double = weights.ease
    holds = held is not None
    held_rad: c.double = _wrap_pi(held.course_rad - course_rad) if holds else 0.0
    held_m: c.double = held.altitude_m - altitude_m if holds else 0.0
    scratch: _Scratch = _Scratch(2 * (grounds + heights))
    # Prices, then 1 where a command lies on the way to `held`.
    value, eases = scratch.value, grounds + heights
    for h in range(grounds):
        off_rad = _wrap_pi(target_rad[h] - course_rad)
        price = (
            turn * fabs(_wrap_pi(target_rad[h] - flown_rad)) + deviation * fabs(off_rad)
            + speed * fabs(target_mps[h] - airspeed_mps)
        )  # fmt: skip
        if off_rad < TO_THE_LEFT_RAD:
            price += wrong_left
        elif off_rad > -TO_THE_LEFT_RAD:
            price += wrong_right
        value[h] = price + outcome[h]
        value[eases + h] = _lies_between(off_rad, held_rad, same_course_rad)
    for z in range(grounds, grounds + heights):
        off_m = target_m[z - grounds] - altitude_m
        price = height * fabs(off_m)
        if off_m < -1.0:
            price += descent
        if fabs(off_m) > same_height_m:
            price += spared_height + (wrong_up if off_m > 0.0 else wrong_down)
        value[z] = price
        value[eases + z] = _lies_between(off_m, held_m, same_height_m)
    for k in range(rows):
        h, z = ground_of[k], grounds + height_of[k]
        _expect(0 <= h < grounds and grounds <= z < grounds + heights)
        cost[k] += value[h] + value[z]
        if holds and k > 0:
            cost[k] += eased if value[eases + h] and value[eases + z] else switched


@c.cfunc
@c.inline
@c.exceptval(check=False)
def _lies_between(value: c.double, end: c.double, slack: c.double) -> c.bint:
    """Whether a value lies between 0 and an end, give or take `slack`."""
    return min(end, 0.0) - slack <= value <= max(end, 0.0) + slack
