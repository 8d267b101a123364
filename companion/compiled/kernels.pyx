# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The inner loops of a decision, compiled: measuring tracks, the field, flying ahead and pricing.

What they compute, and why, stands with their callers in `survey`, `cone`, `potential`, `prediction` and
`pricing`; here is only how. All is in double precision, without reordering or fusing of operations: the same
inputs give the same bits. Arrays run over rows or tracks first and the T times of the prediction last, and
are C-contiguous unless declared otherwise; `ValueError` where lengths do not match. Inputs are not changed.
"""

from cpython.mem cimport PyMem_Free, PyMem_Malloc
from libc.math cimport INFINITY, asin, atan2, cos, fabs, fmod, hypot, sin, sqrt

import numpy as np

cdef double PI = 3.141592653589793
cdef double TO_THE_LEFT_RAD = -PI / 180.0


cdef inline double _between(double value, double low, double high) noexcept nogil:
    return low if value < low else high if value > high else value


cdef inline double _wrap_pi(double angle_rad) noexcept nogil:
    """The same angle in [-pi, pi)."""
    cdef double turned = fmod(angle_rad + PI, 2.0 * PI)
    return turned + PI if turned < 0.0 else turned - PI


cdef inline double _crab_rad(
    double course_rad, double airspeed_mps, double north_mps, double east_mps
) noexcept nogil:
    """How far left of a course the nose must point to hold it: the wind triangle."""
    cdef double across_mps = east_mps * cos(course_rad) - north_mps * sin(course_rad)
    return asin(_between(across_mps / max(airspeed_mps, 1e-3), -1.0, 1.0))


cdef class Times:
    """The T moments of a prediction, checked once; none but these is ever flown ahead to.

    `turned_s` is for how long a rate of turn has acted by the middle of each step, `shares` what each step
    is of the whole time, (T - 1,) both.
    """

    cdef Py_ssize_t count
    cdef const double[::1] times_s, turned_s, shares

    def __cinit__(self, const double[::1] times_s, const double[::1] turned_s, const double[::1] shares):
        self.times_s, self.turned_s, self.shares, self.count = times_s, turned_s, shares, times_s.shape[0]
        _expect(self.count >= 2 and turned_s.shape[0] + 1 == self.count and shares.shape[0] + 1 == self.count)


cdef class Others:
    """Tracks as the loops need them, checked once: places and velocities (N, 3), all else (N,)."""

    cdef Py_ssize_t count
    cdef const double[:, ::1] position_m, velocity_mps
    cdef const double[::1] turn_radps, horizontal_m, vertical_m, shell_m
    cdef const unsigned char[::1] grounded

    def __cinit__(self, tracks):
        self.position_m, self.velocity_mps = tracks.position_m, tracks.velocity_mps
        self.turn_radps, self.shell_m = tracks.turn_radps, tracks.shell_m
        self.horizontal_m, self.vertical_m = tracks.protected_horizontal_m, tracks.protected_vertical_m
        self.grounded = tracks.grounded.view(np.uint8)
        self.count = self.position_m.shape[0]
        _expect_tracks(self.position_m, self.velocity_mps, self.turn_radps)
        _expect(self.horizontal_m.shape[0] == self.count and self.vertical_m.shape[0] == self.count)
        _expect(self.grounded.shape[0] == self.count and self.shell_m.shape[0] == self.count)


cdef inline void _fly_ahead(
    double* ahead_m, Others others, Py_ssize_t n, double turn_radps, Times times
) noexcept:
    """Where track `n` is at all times if it turns like that, north and east, into `ahead_m`, (T, 2)."""
    cdef Py_ssize_t i
    cdef double step_s, ahead, across
    cdef double north_mps = others.velocity_mps[n, 0], east_mps = others.velocity_mps[n, 1]
    cdef double north_m = others.position_m[n, 0], east_m = others.position_m[n, 1]
    cdef const double[::1] times_s = times.times_s
    ahead_m[0], ahead_m[1] = north_m, east_m
    for i in range(1, times.count):
        if turn_radps == 0.0:
            ahead_m[2 * i] = north_m + north_mps * times_s[i]
            ahead_m[2 * i + 1] = east_m + east_mps * times_s[i]
            continue
        step_s = times_s[i] - times_s[i - 1]
        ahead = step_s * cos(turn_radps * times.turned_s[i - 1])
        across = step_s * sin(turn_radps * times.turned_s[i - 1])
        ahead_m[2 * i] = ahead_m[2 * i - 2] + north_mps * ahead - east_mps * across
        ahead_m[2 * i + 1] = ahead_m[2 * i - 1] + east_mps * ahead + north_mps * across


def columns(rows):
    """Rows of tracks as arrays: places and velocities, (N, 3) both, and all else, a row for each.

    A row is a place, a velocity and a tuple of as many other numbers as in every row.
    """
    cdef Py_ssize_t n, i, count = len(rows), others = len(rows[0][2]) if count else 0
    of_places, of_velocities = np.empty((count, 3)), np.empty((count, 3))
    of_all_else = np.empty((others, count))
    cdef double[:, ::1] place_m = of_places, velocity_mps = of_velocities, all_else = of_all_else
    for n in range(count):
        place, velocity, rest = rows[n]
        _expect(len(rest) == others)
        place_m[n, 0], place_m[n, 1], place_m[n, 2] = place
        velocity_mps[n, 0], velocity_mps[n, 1], velocity_mps[n, 2] = velocity
        for i in range(others):
            all_else[i, n] = rest[i]
    return of_places, of_velocities, of_all_else


def tracks_ahead(tracks, Times times not None):
    """Where tracks are at the times, north and east, (N, T, 2)."""
    cdef Py_ssize_t n
    cdef Others others = tracks.others
    result = np.empty((others.count, times.count, 2))
    cdef double[:, :, ::1] ahead_m = result
    for n in range(others.count):
        _fly_ahead(&ahead_m[n, 0, 0], others, n, others.turn_radps[n], times)
    return result


def velocities_until_closest(tracks, const double[:, ::1] path_m, Times times not None):
    """Mean velocities of tracks until they are closest to a ground path (T, 2), at least one step, (N, 3)."""
    cdef Py_ssize_t n, i, nearest
    cdef Others others = tracks.others
    _expect(path_m.shape[0] == times.count and path_m.shape[1] == 2)
    result = np.array(others.velocity_mps)
    cdef double[:, ::1] mean_mps = result
    cdef double[:, ::1] other_m = np.empty((times.count, 2))
    cdef double north, east, off2, least2
    for n in range(others.count):
        if others.turn_radps[n] == 0.0:
            continue
        _fly_ahead(&other_m[0, 0], others, n, others.turn_radps[n], times)
        nearest, least2 = 0, INFINITY
        for i in range(times.count):
            north, east = other_m[i, 0] - path_m[i, 0], other_m[i, 1] - path_m[i, 1]
            off2 = north * north + east * east
            if off2 < least2:
                nearest, least2 = i, off2
        nearest = max(nearest, 1)
        mean_mps[n, 0] = (other_m[nearest, 0] - other_m[0, 0]) / times.times_s[nearest]
        mean_mps[n, 1] = (other_m[nearest, 1] - other_m[0, 1]) / times.times_s[nearest]
    return result


cdef inline double _approach_angle(
    double north, double east, double north_mps, double east_mps, double still_mps
) noexcept nogil:
    """From the line of sight to a velocity, positive to the left; pi without motion."""
    if hypot(north_mps, east_mps) < still_mps:
        return PI
    # In north-east coordinates a positive cross product turns clockwise, to the right.
    return atan2(-(north * east_mps - east * north_mps), north * north_mps + east * east_mps)


def relative_motion(
    const double[:, ::1] position_m, const double[:, ::1] velocity_mps,
    double own_north_m, double own_east_m, double own_down_m,
    double own_north_mps, double own_east_mps, double own_down_mps, double still_mps,
):
    """Places of others from us and our velocities relative to theirs, (N, 3), and four rows of (N,).

    Those are, over ground: distances, closing speeds, times to the closest approach, approach angles. Slower
    than `still_mps` is no motion.
    """
    cdef Py_ssize_t n, count = position_m.shape[0]
    _expect(position_m.shape[1] == 3 and velocity_mps.shape[1] == 3 and velocity_mps.shape[0] == count)
    of_places, of_velocities, of_all_else = np.empty((count, 3)), np.empty((count, 3)), np.empty((4, count))
    cdef double[:, ::1] place_m = of_places, own_mps = of_velocities, all_else = of_all_else
    cdef double north_m, east_m, north_mps, east_mps, distance_m, along, speed2
    for n in range(count):
        north_m, east_m = position_m[n, 0] - own_north_m, position_m[n, 1] - own_east_m
        north_mps, east_mps = own_north_mps - velocity_mps[n, 0], own_east_mps - velocity_mps[n, 1]
        place_m[n, 0], place_m[n, 1], place_m[n, 2] = north_m, east_m, position_m[n, 2] - own_down_m
        own_mps[n, 0], own_mps[n, 1], own_mps[n, 2] = north_mps, east_mps, own_down_mps - velocity_mps[n, 2]
        along = north_m * north_mps + east_m * east_mps
        speed2 = north_mps * north_mps + east_mps * east_mps
        distance_m = hypot(north_m, east_m)
        all_else[0, n] = distance_m
        all_else[1, n] = max(along / max(distance_m, 1e-9), 0.0)
        all_else[2, n] = along / speed2 if speed2 > still_mps * still_mps else INFINITY
        all_else[3, n] = _approach_angle(north_m, east_m, north_mps, east_mps, still_mps)
    return of_places, of_velocities, of_all_else


def approach_angles(
    const double[:, :] rel_position_m, const double[:, :] own_rel_velocity_mps, double still_mps
):
    """Angles from the lines of sight to the velocities, positive to the left, (N,); pi without motion."""
    cdef Py_ssize_t n, count = rel_position_m.shape[0]
    _expect(own_rel_velocity_mps.shape[0] == count)
    _expect(rel_position_m.shape[1] >= 2 and own_rel_velocity_mps.shape[1] >= 2)
    result = np.empty(count)
    cdef double[::1] alpha_rad = result
    for n in range(count):
        alpha_rad[n] = _approach_angle(
            rel_position_m[n, 0], rel_position_m[n, 1],
            own_rel_velocity_mps[n, 0], own_rel_velocity_mps[n, 1], still_mps,
        )
    return result


def half_angles(const double[::1] distance_m, const double[::1] radius_m):
    """Half angles that circles fill, (N,); pi within them."""
    cdef Py_ssize_t n, count = distance_m.shape[0]
    _expect(radius_m.shape[0] == count)
    result = np.empty(count)
    cdef double[::1] beta_rad = result
    for n in range(count):
        beta_rad[n] = PI if distance_m[n] <= radius_m[n] else asin(
            min(radius_m[n] / max(distance_m[n], 1e-9), 1.0)
        )
    return result


def reaches(
    const double[::1] distance_m, const double[::1] closing_mps, const double[::1] protected_m,
    double outer_m, double outer_s, double inner_m, double inner_s,
):
    """Distances to the protected circles, the reach of the outer layer and that of the inner, three of (N,)."""
    cdef Py_ssize_t n, count = distance_m.shape[0]
    _expect(closing_mps.shape[0] == count and protected_m.shape[0] == count)
    result = np.empty((3, count))
    cdef double[:, ::1] reach_m = result
    for n in range(count):
        reach_m[0, n] = distance_m[n] - protected_m[n]
        reach_m[1, n] = max(outer_m, outer_s * closing_mps[n])
        reach_m[2, n] = max(inner_m, inner_s * closing_mps[n])
    return result


cdef inline double _early(double to_closest_s, double near_s, double far_s) noexcept nogil:
    return _between((to_closest_s - near_s) / max(far_s - near_s, 1e-3), 0.0, 1.0)


def early(double to_closest_s, double near_s, double far_s):
    """0 where the closest approach is within `near_s`, 1 from `far_s` on."""
    return _early(to_closest_s, near_s, far_s)


def too_near(
    const double[::1] closest, const double[::1] entered_s, const double[::1] to_closest_s,
    const double[::1] shell_m, const double[::1] protected_m,
    double share_near, double share_far, double near_s, double far_s,
):
    """Who is closer than a share of his volume with its shell, (N,): `share_far` where there is time, else
    `share_near`. There is none where the volume is entered soon."""
    cdef Py_ssize_t n, count = closest.shape[0]
    _expect(entered_s.shape[0] == count and to_closest_s.shape[0] == count)
    _expect(shell_m.shape[0] == count and protected_m.shape[0] == count)
    result = np.empty(count, dtype=bool)
    cdef unsigned char[::1] near = result.view(np.uint8)
    cdef double share
    for n in range(count):
        share = share_near + (share_far - share_near) * _early(
            min(to_closest_s[n], entered_s[n] + near_s), near_s, far_s
        )
        near[n] = closest[n] < (1.0 + shell_m[n] / protected_m[n]) * share
    return result


def repulsion_magnitudes(
    const double[::1] surface, double reach, double gain, double contact
):
    """Lengths of repulsive forces by distances to surfaces, (N,); no closer than `contact`."""
    cdef Py_ssize_t n, count = surface.shape[0]
    result = np.empty(count)
    cdef double[::1] magnitude = result
    cdef double inverse
    for n in range(count):
        inverse = 1.0 / max(surface[n], contact)
        magnitude[n] = gain * max(inverse - 1.0 / reach, 0.0) * inverse * inverse
    return result


def repulsion(const double[:, :] rel_position, const double[::1] magnitude):
    """The sum of forces of these lengths away from places, north and east."""
    cdef Py_ssize_t n, count = magnitude.shape[0]
    _expect(rel_position.shape[0] == count and rel_position.shape[1] >= 2)
    cdef double north = 0.0, east = 0.0, share
    for n in range(count):
        share = magnitude[n] / max(hypot(rel_position[n, 0], rel_position[n, 1]), 1e-9)
        north -= rel_position[n, 0] * share
        east -= rel_position[n, 1] * share
    return north, east


def pushes_across(
    const double[:, :] own_rel_velocity_mps, const double[::1] magnitude, double least, double course_rad
):
    """The sum of pushes across velocities, to the right of a course, north and east; `least` is the weakest."""
    cdef Py_ssize_t n, count = magnitude.shape[0]
    _expect(own_rel_velocity_mps.shape[0] == count and own_rel_velocity_mps.shape[1] >= 2)
    cdef double north = 0.0, east = 0.0, north_mps, east_mps, share
    cdef double along_north = cos(course_rad), along_east = sin(course_rad)
    for n in range(count):
        north_mps, east_mps = own_rel_velocity_mps[n, 0], own_rel_velocity_mps[n, 1]
        share = max(magnitude[n], least) / max(hypot(north_mps, east_mps), 1e-6)
        if along_north * north_mps + along_east * east_mps < 0.0:
            share = -share
        north -= share * east_mps
        east += share * north_mps
    return north, east


def ground_paths(
    double north_m, double east_m, double course_rad, double crab_rad, double airspeed_mps,
    double wind_north_mps, double wind_east_mps,
    const double[::1] target_rad, const double[::1] target_mps,
    double turn_acceleration_mps2, double max_rate_radps, double response_s, double acceleration_mps2,
    Times times not None,
):
    """Ground paths by eq. 2 to target courses and airspeeds (H,), (H, T, 2)."""
    cdef Py_ssize_t h, i, rows = target_rad.shape[0], count = times.count
    _expect(target_mps.shape[0] == rows)
    result = np.empty((rows, count, 2))
    cdef double[:, :, ::1] path_m = result
    cdef const double[::1] times_s = times.times_s
    cdef double step_s, middle_s, rate_radps, most_rad, speed_mps, flown_mps, heading_rad, flown_rad
    cdef double turn_rad, to_turn_rad, nose_rad = course_rad - crab_rad
    cdef double north, east, through_north_m, through_east_m
    cdef bint windy = wind_north_mps != 0.0 or wind_east_mps != 0.0
    for h in range(rows):
        path_m[h, 0, 0], path_m[h, 0, 1] = north_m, east_m
        through_north_m = through_east_m = 0.0
        # Who speeds up in a turn turns slower: the rate of the greater speed is within the limits at both.
        rate_radps = min(turn_acceleration_mps2 / max(target_mps[h], airspeed_mps, 1.0), max_rate_radps)
        to_turn_rad = turn_rad = _wrap_pi(target_rad[h] - course_rad)
        flown_mps, flown_rad, north, east = -1.0, nose_rad, cos(nose_rad), sin(nose_rad)
        for i in range(1, count):
            step_s = times_s[i] - times_s[i - 1]
            middle_s = times_s[i - 1] + 0.5 * step_s
            speed_mps = airspeed_mps + _between(
                target_mps[h] - airspeed_mps, -acceleration_mps2 * middle_s, acceleration_mps2 * middle_s
            )
            if windy and speed_mps != flown_mps:
                turn_rad = to_turn_rad + crab_rad - _crab_rad(
                    target_rad[h], speed_mps, wind_north_mps, wind_east_mps
                )
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
    double now_m, double climb_mps, const double[::1] target_m, double response_s,
    double max_sink_mps, double max_climb_mps, Times times not None,
):
    """Heights on the way to target heights (Z,): the present climb until the command bites, (Z, T)."""
    cdef Py_ssize_t z, i
    cdef double acting_s, before_m, to_go_m
    result = np.empty((target_m.shape[0], times.count))
    cdef double[:, ::1] altitude_m = result
    cdef const double[::1] times_s = times.times_s
    for z in range(target_m.shape[0]):
        for i in range(times.count):
            before_m = now_m + climb_mps * min(times_s[i], response_s)
            acting_s = max(times_s[i] - response_s, 0.0)
            to_go_m = target_m[z] - (now_m + climb_mps * response_s)
            altitude_m[z, i] = before_m + _between(
                to_go_m, -max_sink_mps * acting_s, max_climb_mps * acting_s
            )
    return result


cdef class _Ways:
    """Paths as the loops need them, checked: over ground (H, T, 2), heights (Z, T), rows of both (K,)."""

    cdef Py_ssize_t grounds, heights, rows
    cdef const double[:, :, ::1] ground_m
    cdef const double[:, ::1] altitude_m
    cdef const Py_ssize_t[::1] ground_of, height_of

    def __cinit__(self, paths, Py_ssize_t times):
        cdef Py_ssize_t k
        self.ground_m, self.altitude_m = paths.ground_m, paths.altitude_m
        self.ground_of, self.height_of = paths.ground_of, paths.height_of
        self.grounds, self.heights = self.ground_m.shape[0], self.altitude_m.shape[0]
        self.rows = self.ground_of.shape[0]
        _expect(self.ground_m.shape[1] == times and self.altitude_m.shape[1] == times)
        _expect(self.ground_m.shape[2] == 2 and self.height_of.shape[0] == self.rows)
        for k in range(self.rows):
            _expect(0 <= self.ground_of[k] < self.grounds and 0 <= self.height_of[k] < self.heights)


cdef class _Squares:
    """How far ways are from one track, squared, in volumes: one root for each row does, but in a volume.

    Over ground (H, T) and in height (Z, T).
    """

    cdef Py_ssize_t times
    cdef double* horizontal
    cdef double* vertical
    cdef double* other_m

    def __cinit__(self, _Ways ways, Py_ssize_t times):
        self.times = times
        self.horizontal = <double*> PyMem_Malloc(
            (ways.grounds + ways.heights + 2) * times * sizeof(double)
        )
        if self.horizontal == NULL:
            raise MemoryError
        self.vertical = self.horizontal + ways.grounds * times
        self.other_m = self.vertical + ways.heights * times

    def __dealloc__(self):
        PyMem_Free(self.horizontal)

    cdef void measure(
        self, _Ways ways, Others others, Py_ssize_t n, double turn_radps, double sink_mps,
        Times times, Py_ssize_t count,
    ) noexcept:
        """From track `n` if it turns and sinks like that, at the first `count` times."""
        cdef Py_ssize_t h, z, i
        cdef double north, east, down_m, above_m
        cdef double per_horizontal2 = 1.0 / (others.horizontal_m[n] * others.horizontal_m[n])
        cdef double per_vertical2 = 1.0 / (others.vertical_m[n] * others.vertical_m[n])
        cdef const double* ground_m
        cdef const double* altitude_m
        cdef double* square
        _fly_ahead(self.other_m, others, n, turn_radps, times)
        for h in range(ways.grounds):
            ground_m, square = &ways.ground_m[h, 0, 0], self.horizontal + h * self.times
            for i in range(count):
                north = ground_m[2 * i] - self.other_m[2 * i]
                east = ground_m[2 * i + 1] - self.other_m[2 * i + 1]
                square[i] = (north * north + east * east) * per_horizontal2
        for z in range(ways.heights):
            altitude_m, square = &ways.altitude_m[z, 0], self.vertical + z * self.times
            for i in range(count):
                down_m = others.position_m[n, 2] + sink_mps * times.times_s[i]
                above_m = altitude_m[i] + down_m
                if others.grounded[n] and above_m < 0.0:
                    above_m = 0.0
                square[i] = above_m * above_m * per_vertical2


def separation(paths, tracks, Times times not None, Py_ssize_t count, bint shells):
    """How K rows keep clear of N tracks in the first `count` times, four of (K, N).

    Those are closest, exposure, nearness, and the time when the volume is entered, inf where it is not.
    """
    cdef Py_ssize_t n, k, i
    cdef const double* horizontal
    cdef const double* vertical
    _expect(1 <= count <= times.count)
    cdef _Ways ways = _Ways(paths, times.count)
    cdef Others others = tracks.others
    cdef _Squares squares = _Squares(ways, times.count)
    result = np.empty((4, ways.rows, others.count))
    cdef double[:, :, ::1] kept = result
    cdef double ratio, least, depth, near, volumes, entered_s
    for n in range(others.count):
        squares.measure(ways, others, n, others.turn_radps[n], others.velocity_mps[n, 2], times, count)
        volumes = others.horizontal_m[n] / max(others.shell_m[n], 1.0)
        for k in range(ways.rows):
            horizontal = squares.horizontal + ways.ground_of[k] * times.count
            vertical = squares.vertical + ways.height_of[k] * times.count
            least = _least_of_greater(horizontal, vertical, count)
            depth = near = 0.0
            entered_s = INFINITY
            if least < 1.0:
                i = 0
                while max(horizontal[i], vertical[i]) >= 1.0:
                    i += 1
                entered_s = times.times_s[i]
            if least < 1.0 or shells:
                for i in range(1, count):
                    ratio = max(horizontal[i], vertical[i])
                    if ratio < 1.0 or shells:
                        ratio = sqrt(ratio)
                        depth += times.shares[i - 1] * max(1.0 - ratio, 0.0)
                        near += times.shares[i - 1] * _between(1.0 - (ratio - 1.0) * volumes, 0.0, 1.0)
            kept[0, k, n], kept[1, k, n] = sqrt(least), depth
            kept[2, k, n], kept[3, k, n] = near if shells else 0.0, entered_s
    return result


def losses(
    paths, tracks, surprises, weights, double lost, Times times not None, Py_ssize_t count, Py_ssize_t soon,
):
    """What rows cost by how they keep clear of tracks and of their surprises, and the closest, two of (K,).

    For tracks as they fly the first `count` times matter, and theirs is the closest. Surprises may come true,
    each as likely as it is, and matter at the first `soon` times.

    The margin is priced by how much of it is used, without a step: a flight planned along its edge is flown a
    little differently, and must not be thrown over for that.
    """
    cdef Py_ssize_t n, k
    _expect(1 <= count <= times.count and 1 <= soon <= times.count)
    cdef _Ways ways = _Ways(paths, times.count)
    cdef Others others = tracks.others
    cdef _Squares squares = _Squares(ways, times.count)
    cdef _Prices prices = _Prices(weights, lost)
    cdef const Py_ssize_t[::1] of = surprises.of
    cdef const double[::1] turn_radps = surprises.turn_radps, sink_mps = surprises.sink_mps
    cdef const double[::1] likely = surprises.likely
    _expect(turn_radps.shape[0] == of.shape[0] and sink_mps.shape[0] == of.shape[0])
    _expect(likely.shape[0] == of.shape[0])
    result = np.empty((2, ways.rows))
    cdef double[:, ::1] price = result
    for k in range(ways.rows):
        price[0, k], price[1, k] = 0.0, INFINITY
    for n in range(others.count):
        squares.measure(ways, others, n, others.turn_radps[n], others.velocity_mps[n, 2], times, count)
        for k in range(ways.rows):
            price[1, k] = min(price[1, k], prices.add(&price[0, k], k, 1.0, ways, squares, times, count))
    for n in range(of.shape[0]):
        _expect(0 <= of[n] < others.count)
        squares.measure(ways, others, of[n], turn_radps[n], sink_mps[n], times, soon)
        for k in range(ways.rows):
            prices.add(&price[0, k], k, likely[n], ways, squares, times, soon)
    return result


cdef class _Prices:
    """What coming near costs."""

    cdef double margin, loss, depth, exposure, lost

    def __cinit__(self, weights, double lost):
        self.margin, self.loss = weights.margin, weights.loss
        self.depth, self.exposure, self.lost = weights.depth, weights.exposure, lost

    cdef inline double add(
        self, double* cost, Py_ssize_t k, double likely, _Ways ways, _Squares squares, Times times,
        Py_ssize_t count,
    ) noexcept:
        """Add to `cost` what row `k` costs by how near it comes to what was measured last; how near that is."""
        cdef Py_ssize_t i
        cdef const double* horizontal = squares.horizontal + ways.ground_of[k] * times.count
        cdef const double* vertical = squares.vertical + ways.height_of[k] * times.count
        cdef double ratio, price, within = 0.0, near = sqrt(_least_of_greater(horizontal, vertical, count))
        if near >= 1.0:
            return near
        for i in range(1, count):
            ratio = max(horizontal[i], vertical[i])
            if ratio < 1.0:
                within += times.shares[i - 1] * (1.0 - sqrt(ratio))
        price = self.margin * (1.0 - near) + self.exposure * within
        if near < self.lost:
            price += self.loss + self.depth * (self.lost - near)
        cost[0] += likely * price
        return near


cdef inline double _least_of_greater(
    const double* ones, const double* others, Py_ssize_t count
) noexcept nogil:
    """The least over time of the greater of two; in four strands, as each of them waits for its last step."""
    cdef Py_ssize_t i = 0
    cdef double a, b, c, d
    a = b = c = d = INFINITY
    while i + 4 <= count:
        a = min(a, max(ones[i], others[i]))
        b = min(b, max(ones[i + 1], others[i + 1]))
        c = min(c, max(ones[i + 2], others[i + 2]))
        d = min(d, max(ones[i + 3], others[i + 3]))
        i += 4
    while i < count:
        a = min(a, max(ones[i], others[i]))
        i += 1
    return min(min(a, b), min(c, d))


def heights_to_pass(
    tracks, const double[:, ::1] own_rel_velocity_mps, const double[::1] to_closest_s, conflict,
    double longest_s, double horizon_s, double room,
):
    """The lowest height over, the highest under all tracks in conflict, (N,), and when all are passed."""
    cdef Py_ssize_t n
    cdef Others others = tracks.others
    cdef const unsigned char[::1] matters = conflict.view(np.uint8)
    _expect(own_rel_velocity_mps.shape[0] == others.count and own_rel_velocity_mps.shape[1] == 3)
    _expect(to_closest_s.shape[0] == others.count and matters.shape[0] == others.count)
    cdef double over_m = -INFINITY, under_m = INFINITY, passed_s = 0.0
    cdef double crossing_s, closest_s, first_m, last_m, room_m
    for n in range(others.count):
        if not matters[n]:
            continue
        crossing_s = min(others.horizontal_m[n] / max(
            hypot(own_rel_velocity_mps[n, 0], own_rel_velocity_mps[n, 1]), 1.0
        ), longest_s)
        closest_s = _between(to_closest_s[n], 0.0, horizon_s)
        first_m = -others.position_m[n, 2] - others.velocity_mps[n, 2] * max(closest_s - crossing_s, 0.0)
        last_m = -others.position_m[n, 2] - others.velocity_mps[n, 2] * (closest_s + crossing_s)
        room_m = room * others.vertical_m[n]
        over_m = max(over_m, max(first_m, last_m) + room_m)
        under_m = min(under_m, min(first_m, last_m) - room_m)
        passed_s = max(passed_s, closest_s + crossing_s)
    return over_m, under_m, passed_s


def outcomes(
    paths, tracks, Py_ssize_t then, const double[::1] mission_m, double aside, double unresolved,
    double ours_north_mps, double ours_east_mps, double altitude_m, Times times not None,
):
    """What ground paths cost by where they are at moment `then`, (H,).

    That is `aside` times the distance from the mission's place at that time (2,), and `unresolved` times how
    deep flying straight on from there leads into any volume at worst.
    """
    cdef Py_ssize_t n, h
    _expect(1 <= then < times.count)
    cdef _Ways ways = _Ways(paths, times.count)
    cdef Others others = tracks.others
    _expect(mission_m.shape[0] == 2)
    result, of_depths = np.empty(ways.grounds), np.zeros(ways.grounds)
    cdef double[::1] price = result, deepest = of_depths
    cdef double[:, ::1] other_m = np.empty((times.count, 2))
    cdef double step_s, north_mps, east_mps, north_m, east_m, speed2, to_go_s, above_m, vertical, across_m
    for n in range(others.count):
        _fly_ahead(&other_m[0, 0], others, n, others.turn_radps[n], times)
        step_s = times.times_s[then] - times.times_s[then - 1]
        north_mps = (other_m[then, 0] - other_m[then - 1, 0]) / step_s - ours_north_mps
        east_mps = (other_m[then, 1] - other_m[then - 1, 1]) / step_s - ours_east_mps
        speed2 = max(north_mps * north_mps + east_mps * east_mps, 1.0)
        above_m = altitude_m + others.position_m[n, 2] + others.velocity_mps[n, 2] * times.times_s[then]
        vertical = (max(above_m, 0.0) if others.grounded[n] else fabs(above_m)) / others.vertical_m[n]
        for h in range(ways.grounds):
            north_m = other_m[then, 0] - ways.ground_m[h, then, 0]
            east_m = other_m[then, 1] - ways.ground_m[h, then, 1]
            to_go_s = max(-(north_m * north_mps + east_m * east_mps) / speed2, 0.0)
            across_m = hypot(north_m + north_mps * to_go_s, east_m + east_mps * to_go_s)
            deepest[h] = max(deepest[h], 1.0 - max(across_m / others.horizontal_m[n], vertical))
    for h in range(ways.grounds):
        north_m = ways.ground_m[h, then, 0] - mission_m[0]
        east_m = ways.ground_m[h, then, 1] - mission_m[1]
        price[h] = aside * hypot(north_m, east_m) + unresolved * deepest[h]
    return result


def add_efforts(
    double[::1] cost, commands, weights, const double[::1] of_outcome,
    double course_rad, double airspeed_mps, double altitude_m, double flown_rad,
    bint right_preferred, bint spares_heights, held, double same_course_rad, double same_height_m,
    double switched,
):
    """Add what rows cost of themselves, (K,), and by the outcome of their ground paths, (H,).

    The mission's course, speed and height; the course flown; `held` is the guidance of row 0, if there is
    one, and `switched` what anything else costs.
    """
    cdef Py_ssize_t h, z, k
    cdef const double[::1] target_rad = commands.course_rad, target_mps = commands.airspeed_mps
    cdef const double[::1] target_m = commands.altitude_m
    cdef const Py_ssize_t[::1] ground_of = commands.ground_of, height_of = commands.height_of
    cdef Py_ssize_t grounds = target_rad.shape[0], heights = target_m.shape[0], rows = ground_of.shape[0]
    _expect(target_mps.shape[0] == grounds and of_outcome.shape[0] == grounds)
    _expect(cost.shape[0] == rows and height_of.shape[0] == rows)
    cdef double turn = weights.turn / PI, deviation = weights.deviation / PI, speed = weights.speed / 10.0
    cdef double wrong_side = weights.wrong_side if right_preferred else 0.0
    cdef double height = weights.height / 100.0, descent = weights.descent
    cdef double spared_height = weights.spared_height if spares_heights else 0.0
    cdef double eased = weights.ease
    cdef bint holds = held is not None
    cdef double held_rad = _wrap_pi(held.course_rad - course_rad) if holds else 0.0
    cdef double held_m = held.altitude_m - altitude_m if holds else 0.0
    cdef double[::1] price = np.empty(grounds + heights)
    cdef unsigned char[::1] eases = np.empty(grounds + heights, dtype=np.uint8)
    cdef double off_rad, off_m
    for h in range(grounds):
        off_rad = _wrap_pi(target_rad[h] - course_rad)
        price[h] = (
            turn * fabs(_wrap_pi(target_rad[h] - flown_rad)) + deviation * fabs(off_rad)
            + speed * fabs(target_mps[h] - airspeed_mps)
        )
        if off_rad < TO_THE_LEFT_RAD:
            price[h] += wrong_side
        price[h] += of_outcome[h]
        eases[h] = _lies_between(off_rad, held_rad, same_course_rad)
    for z in range(heights):
        off_m = target_m[z] - altitude_m
        price[grounds + z] = height * fabs(off_m)
        if off_m < -1.0:
            price[grounds + z] += descent
        if fabs(off_m) > same_height_m:
            price[grounds + z] += spared_height
        eases[grounds + z] = _lies_between(off_m, held_m, same_height_m)
    for k in range(rows):
        h, z = ground_of[k], grounds + height_of[k]
        _expect(0 <= h < grounds and grounds <= z < grounds + heights)
        cost[k] += price[h] + price[z]
        if holds and k > 0:
            cost[k] += eased if eases[h] and eases[z] else switched


cdef inline bint _lies_between(double value, double end, double slack) noexcept nogil:
    """Whether it lies between 0 and an end, or as near to that as makes no difference."""
    return min(end, 0.0) - slack <= value <= max(end, 0.0) + slack


cdef int _expect_tracks(
    const double[:, ::1] position_m, const double[:, ::1] velocity_mps, const double[::1] turn_radps
) except -1:
    """Places and velocities (N, 3), rates of turn (N,)."""
    _expect(position_m.shape[1] == 3 and velocity_mps.shape[1] == 3)
    _expect(velocity_mps.shape[0] == position_m.shape[0] and turn_radps.shape[0] == position_m.shape[0])
    return 0


cdef int _expect(bint fits) except -1:
    if not fits:
        raise ValueError("arrays of lengths that do not match")
    return 0
