"""The situation measured: all tracks against flying the mission on, at aircraft scale."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from companion.avoidance.cone import TransitionDomain, approach_angle_rad, half_angle_rad
from companion.avoidance.envelope import Envelope
from companion.avoidance.geometry import Array, RelativeMotion, any_of, relative_motion
from companion.avoidance.outer import OuterMethod
from companion.avoidance.params import AvoidanceParams, Layers
from companion.avoidance.trajectory import (
    HORIZON_S,
    Commands,
    OwnState,
    Separation,
    Tracks,
    fly_ahead,
    ground_velocity_mps,
    separation,
    to_goal,
)
from companion.compiled import kernels
from companion.model import Goal, Guidance, Layer, Ownship, Threat, Track, TrafficKind, Vec2, Vec3

# How fast we could fly towards somebody who is near but not on his way to us.
_OWN_REACH_MPS = 20.0
# Nothing on earth is further away, nothing that matters is faster; not a number is neither.
_FURTHEST_M, _FASTEST_MPS = 4.1e7, 1e4
_NOWHERE = np.zeros((0, 2))


class Survey(NamedTuple):
    """All tracks measured against flying the mission on; arrays of shape (N,) unless said otherwise."""

    tracks: Tracks
    motion: RelativeMotion  # against our own on the mission
    surface_m: Array  # horizontal distance to the protected volume
    outer_reach_m: Array
    inner_reach_m: Array
    emergency: NDArray[np.bool_]  # what calls for the inner layer
    conflict: NDArray[np.bool_]
    horizon_s: float  # how far ahead flights are judged
    mission_ahead_m: Array  # where the mission flown on leads, north and east, (T, 2); (0, 2): nobody minds

    def pressing(self, most: int) -> Tracks:
        """The tracks to price against: conflicts first, then those soonest reached."""
        if len(self.tracks) == 1:
            return self.tracks
        reach_s = self.surface_m / (np.hypot(*self.motion.own_velocity_mps[:, :2].T) + _OWN_REACH_MPS)
        return self.tracks.subset(np.lexsort((reach_s, ~self.conflict))[:most])

    def early(self, params: AvoidanceParams) -> float:
        """How far off the first closest approach is of those in conflict: from 0, near, to 1, far off."""
        to_closest_s = float(self.motion.time_to_closest_s[self.conflict].min())
        return kernels.early(to_closest_s, params.inner_time_s, params.outer_time_s)

    @property
    def nearest(self) -> int:
        """Place of the nearest conflict."""
        places = self.conflict.nonzero()[0]
        return int(places[self.surface_m[places].argmin()])


def take(
    state: OwnState,
    mission: Guidance,
    onward_mps: Vec2,
    tracks: Tracks,
    params: AvoidanceParams,
    envelope: Envelope,
    domain: TransitionDomain,
    *,
    horizon_s: float,
    spare: float,
    avoiding: bool,
) -> Survey:
    """Measure all tracks against the mission, which leads on with `onward_mps` over ground, north and east.

    `domain` remembers the cones entered, `avoiding` asks for a share to `spare`.

    A conflict is what lies within a layer (def. 3, from surface to surface) and, but for the plain field, in
    whose collision cone we are. The paper looks along the velocity flown. What is flown by default looks
    along the mission's, so that a conflict lasts until the mission itself is clear, and asks besides whether
    the mission flown ahead, with its turns and heights, comes too near.
    """
    # Most of the time nobody turns, nor is in the way as it is: then the mission need not be flown ahead.
    ahead = fly_ahead(state, Commands.of([mission]), envelope) if any_of(tracks.turn_radps) else None
    # So cones, closing speeds and times mean for who turns towards us what they mean for who flies at us.
    velocity = tracks.velocity_mps if ahead is None else tracks.velocity_until_closest_mps(ahead.ground_m[0])
    motion = relative_motion(tracks.position_m, velocity, state.position_m, (*onward_mps, 0.0))
    surface, outer_reach, inner_reach = kernels.reaches(
        motion.distance_m,
        motion.closing_mps,
        tracks.protected_horizontal_m,
        params.outer_radius_m,
        params.outer_time_s,
        params.inner_radius_m,
        params.inner_time_s,
    )
    by_flight = params.outer_method is OuterMethod.PRICED
    has_cone = params.outer_method is not OuterMethod.FIELD
    outer = surface < outer_reach
    if has_cone and any_of(outer):
        alpha, radius = motion.approach_rad, tracks.protected_horizontal_m + tracks.shell_m
        if not by_flight:
            alpha = approach_angle_rad(motion.position_m, flown_mps(state) - velocity)
            radius = tracks.protected_horizontal_m
        outer &= domain.covers(tracks.ids, alpha, half_angle_rad(motion.distance_m, radius))
    # Near by, a turn back to the mission may lead through the volume although its far end does not.
    inner = surface < (tracks.shell_m if params.clears_inner_layer else inner_reach)
    if any_of(outer) or any_of(inner):
        ahead = ahead or fly_ahead(state, Commands.of([mission]), envelope)
        lost = _too_near(
            separation(ahead, tracks, horizon_s=horizon_s),
            tracks,
            motion,
            params,
            spare if avoiding else None,
        )
        if by_flight:
            outer &= lost
        if not params.clears_inner_layer:
            inner &= lost
    if has_cone:
        domain.keep(tracks.ids, outer)
    conflict = outer | inner
    if params.layers is not Layers.BOTH:
        conflict = outer if params.layers is Layers.OUTER else inner
    return Survey(
        tracks=tracks,
        motion=motion,
        surface_m=surface,
        outer_reach_m=outer_reach,
        inner_reach_m=inner_reach,
        emergency=inner,
        conflict=conflict,
        horizon_s=horizon_s,
        mission_ahead_m=_NOWHERE if ahead is None else ahead.ground_m[0],
    )


def _too_near(
    kept: Separation, tracks: Tracks, motion: RelativeMotion, params: AvoidanceParams, spare: float | None
) -> NDArray[np.bool_]:
    """Whom the mission flown ahead comes too near, (N,): within a share of the volume, margin included.

    While we avoid, that is a share to `spare`. To begin with it is less the longer there is to go, the more
    often what looks near passes clear by itself: others turn and climb, and errors of velocity grow. Early on
    only what goes deep counts: there is time to wait and see. There is none where the volume is entered soon,
    however long the closest approach is off: who flies nearly as we do is beside us for minutes.
    """
    near, far = (params.begin_near, params.begin_far) if spare is None else (1.0 + spare, 1.0 + spare)
    lost: NDArray[np.bool_] = kernels.too_near(
        kept.closest[0],
        kept.entered_s[0],
        motion.time_to_closest_s,
        tracks.shell_m,
        tracks.protected_horizontal_m,
        near,
        far,
        params.inner_time_s,
        params.outer_time_s,
    )
    return lost


def flown_mps(state: OwnState) -> Array:
    """Own velocity as flown now, north-east-down, (3,)."""
    return np.array([*state.ground_mps, -state.climb_mps])


def tracks_at(now_s: float, relevant: Sequence[Track], params: AvoidanceParams, goal: Goal) -> Tracks:
    """The tracks extrapolated to `now_s`, with the volumes to keep out of, margins included.

    What is not known of a height is added to the volume's before the margin: with all of it against us the
    bare volume is still kept.
    """
    rows = []
    for track in relevant:
        grounded = track.kind is TrafficKind.OBSTACLE
        aloft_m = params.obstacle_vertical_m if grounded else params.well_clear_vertical_m
        if track.protected_vertical_m is not None:
            aloft_m = track.protected_vertical_m
        uncertain_m = max(track.vertical_uncertainty_m, 0.0)
        rest = (
            _protected_horizontal_m(track, params),
            (max(aloft_m, 1.0) + uncertain_m) * (1.0 + params.vertical_margin),
            track.turn_radps,
            grounded,
        )
        rows.append((moved(track, now_s), track.velocity_mps, rest))
    position, velocity, (across, aloft, turns, on_ground) = kernels.columns(rows)
    return Tracks(
        tuple(track.track_id for track in relevant),
        position,
        velocity,
        across,
        aloft,
        on_ground > 0.0,
        _shells_m(position, across, params, goal),
        turns,
    )


def _protected_horizontal_m(track: Track, params: AvoidanceParams) -> float:
    """How far around it to keep clear, margin included."""
    across_m = track.protected_horizontal_m
    if across_m is None:
        grounded = track.kind is TrafficKind.OBSTACLE
        across_m = params.obstacle_horizontal_m if grounded else params.well_clear_horizontal_m
    return max(across_m, 1.0) * (1.0 + params.horizontal_margin)


def plainly_clear(
    state: OwnState,
    onward_mps: Vec2,
    now_s: float,
    relevant: Sequence[Track],
    params: AvoidanceParams,
    domain: TransitionDomain,
) -> bool:
    """Whether nobody is within reach of either layer, or on his way to us, so that nothing is to be measured.

    It is what `take` would find, in plain numbers: most of the time everybody is far away, or flies past.
    """
    if params.clears_inner_layer:
        return False
    own_m = state.position_m
    return all(_is_plainly_clear(own_m, onward_mps, now_s, track, params, domain) for track in relevant)


def _is_plainly_clear(
    own_m: Vec3, own_mps: Vec2, now_s: float, track: Track, params: AvoidanceParams, domain: TransitionDomain
) -> bool:
    if track.turn_radps != 0.0:
        return False  # he may turn towards us
    north_m, east_m, _ = moved(track, now_s)
    north_m, east_m = north_m - own_m[0], east_m - own_m[1]
    north_mps, east_mps = own_mps[0] - track.velocity_mps[0], own_mps[1] - track.velocity_mps[1]
    distance_m, radius_m = math.hypot(north_m, east_m), _protected_horizontal_m(track, params)
    surface_m, along = distance_m - radius_m, north_m * north_mps + east_m * east_mps
    closing_mps = max(along / max(distance_m, 1e-9), 0.0)
    if surface_m < max(params.inner_radius_m, params.inner_time_s * closing_mps):
        return False
    if surface_m >= max(params.outer_radius_m, params.outer_time_s * closing_mps):
        return True
    if params.outer_method is not OuterMethod.PRICED or distance_m <= radius_m:
        return False
    approach_rad = math.atan2(abs(north_m * east_mps - east_m * north_mps), along)
    return approach_rad > math.asin(radius_m / distance_m) + domain.wider_rad(track.track_id)


def _shells_m(position_m: Array, protected_m: Array, params: AvoidanceParams, goal: Goal) -> Array:
    """How far around each volume to keep clear, (N,): the inner layer, but not as far as the goal lies."""
    if not params.clears_inner_layer:
        return np.zeros(len(position_m))
    if goal.position_m is None:
        return np.full(len(position_m), params.inner_radius_m)
    to_goal = position_m[:, :2] - np.array(goal.position_m[:2])
    to_goal_m: Array = np.hypot(to_goal[:, 0], to_goal[:, 1])
    return np.clip(to_goal_m - protected_m, 0.0, params.inner_radius_m)


def threats(survey: Survey, relevant: Sequence[Track], most: int) -> tuple[Threat, ...]:
    """The conflicts, nearest first."""
    places = survey.conflict.nonzero()[0]
    places = places[survey.surface_m[places].argsort(kind="stable")][:most]
    motion = survey.motion
    columns = (
        places,
        motion.position_m[places],
        motion.own_velocity_mps[places],
        motion.closing_mps[places],
        motion.time_to_closest_s[places],
        survey.surface_m[places] < survey.inner_reach_m[places],
        survey.tracks.grounded[places],
    )
    rows = zip(*(column.tolist() for column in columns), strict=True)
    return tuple(_threat(relevant[place], *motion) for place, *motion in rows)


def _threat(
    track: Track,
    rel_m: Vec3,
    own_rel_mps: Vec3,
    closing_mps: float,
    time_s: float,
    is_inner: bool,
    grounded: bool,
) -> Threat:
    (north_m, east_m, down_m), (north_mps, east_mps, down_mps) = rel_m, own_rel_mps
    to_go_s = max(time_s, 0.0) if math.isfinite(time_s) else 0.0
    above_m = down_m - down_mps * to_go_s  # how far we are above it
    return Threat(
        track_id=track.track_id,
        icao=track.icao,
        distance_m=math.hypot(north_m, east_m),
        relative_altitude_m=-down_m,
        bearing_rad=math.atan2(east_m, north_m),
        closing_mps=closing_mps,
        time_to_closest_s=time_s,
        miss_horizontal_m=math.hypot(north_m - north_mps * to_go_s, east_m - east_mps * to_go_s),
        # What stands on the ground reaches down to it.
        miss_vertical_m=max(above_m, 0.0) if grounded else abs(above_m),
        layer=Layer.INNER if is_inner else Layer.OUTER,
    )


def matters(track: Track) -> bool:
    """Whether a track is finite, within all reason, and of something that flies or stands in the way."""
    north_m, east_m, down_m = track.position_m
    north_mps, east_mps, down_mps = track.velocity_mps
    across_m, aloft_m = track.protected_horizontal_m, track.protected_vertical_m
    # What is not a number is within no bounds.
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


def moved(what: Ownship | Track, now_s: float) -> Vec3:
    """Where it is at `now_s`, flying straight since its own time."""
    since_s = now_s - what.time_s
    (north_m, east_m, down_m), (north_mps, east_mps, down_mps) = what.position_m, what.velocity_mps
    return north_m + north_mps * since_s, east_m + east_mps * since_s, down_m + down_mps * since_s


def refuse_nonsense(own: Ownship, goal: Goal) -> None:
    """`ValueError` when there is no safe answer."""
    numbers = [own.time_s, *own.position_m, *own.velocity_mps, own.airspeed_mps, own.heading_rad]
    numbers += [*(own.wind_mps or ()), *(goal.position_m if goal.position_m is not None else ())]
    numbers += [x for x in (goal.course_rad, goal.airspeed_mps, goal.altitude_m) if x is not None]
    if not all(map(math.isfinite, numbers)):
        raise ValueError("ownship or goal is not finite")


def own_state(now_s: float, own: Ownship) -> OwnState:
    """Ownship at `now_s`, with the wind that it measured or implies."""
    north_mps, east_mps, down_mps = own.velocity_mps
    ground_speed = math.hypot(north_mps, east_mps)
    airspeed = own.airspeed_mps if own.airspeed_mps > 1.0 else max(ground_speed, 1.0)
    if own.wind_mps is not None:
        wind = own.wind_mps
    else:
        # What moves over the ground but not through the air is the wind; a bad heading must not make a storm.
        wind = (
            north_mps - airspeed * math.cos(own.heading_rad),
            east_mps - airspeed * math.sin(own.heading_rad),
        )
        if math.hypot(*wind) > 0.6 * airspeed:
            wind = (0.0, 0.0)
    course = math.atan2(east_mps, north_mps) if ground_speed > 1.0 else own.heading_rad
    # Against a stronger wind one course is flown with the nose either way; else it follows from the course.
    heading = own.heading_rad if math.hypot(*wind) >= airspeed else None
    return OwnState(moved(own, now_s), course, airspeed, -down_mps, wind, heading)


def distance_m(state: OwnState, place_m: Vec3) -> float:
    """Horizontal distance to a place [m]."""
    return math.hypot(place_m[0] - state.position_m[0], place_m[1] - state.position_m[1])


def mission_mps(state: OwnState, mission: Guidance) -> Vec2:
    """Velocity over ground, north and east, on the mission's course."""
    return ground_velocity_mps(mission.course_rad, mission.airspeed_mps, state.wind_mps)


def horizon_s(state: OwnState, mission: Guidance, goal: Goal) -> float:
    """How far ahead flights are judged: to the end of the flight, where that is near."""
    if goal.position_m is None or not goal.is_end:
        return HORIZON_S
    north_mps, east_mps = mission_mps(state, mission)
    made_good_mps = north_mps * math.cos(mission.course_rad) + east_mps * math.sin(mission.course_rad)
    # Blown back as fast as it flies, or faster, it never arrives.
    return min(HORIZON_S, distance_m(state, goal.position_m) / max(float(made_good_mps), 1e-3))


def mission_of(state: OwnState, own: Ownship, goal: Goal) -> Guidance:
    """What the goal means from here: course, airspeed and height."""
    airspeed = own.airspeed_mps if goal.airspeed_mps is None else goal.airspeed_mps
    course_rad, altitude_m = to_goal(state.position_m, state.course_rad, goal)
    return Guidance(course_rad, airspeed, altitude_m)
