"""The situation measured: all tracks against flying the mission on, at aircraft scale."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from companion.avoidance.cone import TransitionDomain, approach_angle_rad, half_angle_rad
from companion.avoidance.envelope import Envelope
from companion.avoidance.geometry import (
    Array,
    closing_speed_mps,
    position_at,
    time_to_closest_s,
    vertical_distance_m,
)
from companion.avoidance.outer import OuterMethod
from companion.avoidance.params import AvoidanceParams, Layers
from companion.avoidance.prediction import (
    HORIZON_S,
    TIMES_S,
    Commands,
    OwnState,
    Paths,
    Tracks,
    fly_ahead,
    ground_velocity_mps,
    separation,
    to_goal,
)
from companion.model import Goal, Guidance, Layer, Ownship, Threat, Track, TrafficKind, Vec3

# How fast we could fly towards somebody who is near but not on his way to us.
_OWN_REACH_MPS = 20.0
# Nothing on earth is further away, nothing that matters is faster; not a number is neither.
_FURTHEST_M, _FASTEST_MPS = 4.1e7, 1e4


@dataclass(frozen=True, slots=True)
class Survey:
    """All tracks measured against flying the mission on; arrays of shape (N,) unless said otherwise."""

    tracks: Tracks
    rel_position_m: Array  # other minus own, (N, 3)
    own_rel_velocity_mps: Array  # own on the mission minus other, (N, 3)
    surface_m: Array  # horizontal distance to the protected volume
    closing_mps: Array
    time_to_closest_s: Array
    outer_reach_m: Array
    inner_reach_m: Array
    emergency: NDArray[np.bool_]  # what calls for the inner layer
    conflict: NDArray[np.bool_]
    horizon_s: float  # how far ahead flights are judged
    mission_ahead_m: Array  # where the mission flown on leads, north and east, (T, 2); (0, 2): nobody minds

    def pressing(self, most: int) -> NDArray[np.intp]:
        """Places of the tracks to price against: conflicts first, then those soonest reached."""
        reach_s = self.surface_m / (np.hypot(*self.own_rel_velocity_mps[:, :2].T) + _OWN_REACH_MPS)
        return np.lexsort((reach_s, ~self.conflict))[:most]

    @property
    def nearest(self) -> int:
        """Place of the nearest conflict."""
        return int(np.argmin(np.where(self.conflict, self.surface_m, np.inf)))


def take(
    state: OwnState,
    mission: Guidance,
    tracks: Tracks,
    params: AvoidanceParams,
    envelope: Envelope,
    domain: TransitionDomain,
    *,
    horizon_s: float,
    avoiding: bool,
) -> Survey:
    """Measure all tracks; `domain` remembers the cones entered, `avoiding` asks for the release margin.

    A conflict is what lies within a layer (def. 3, from surface to surface) and, but for the plain field, in
    whose collision cone we are. The paper looks along the velocity flown. What is flown by default looks
    along the mission's, so that a conflict lasts until the mission itself is clear, and asks besides whether
    the mission flown ahead, with its turns and heights, comes too near.
    """
    rel_position = tracks.position_m - state.position_m
    own_velocity = np.zeros(3)
    own_velocity[:2] = ground_velocity_mps(mission.course_rad, mission.airspeed_mps, state.wind_mps)
    # Most of the time nobody turns, nor is in the way as it is: then the mission need not be flown ahead.
    ahead = fly_ahead(state, Commands.of([mission]), envelope) if tracks.turn_radps.any() else None
    velocity = tracks.velocity_mps if ahead is None else _until_closest_mps(tracks, ahead)
    rel_velocity = velocity - own_velocity
    closing = closing_speed_mps(rel_position[:, :2], rel_velocity[:, :2])
    distance = np.hypot(rel_position[:, 0], rel_position[:, 1])
    surface = distance - tracks.protected_horizontal_m
    outer_reach = np.maximum(params.outer_radius_m, params.outer_time_s * closing)
    inner_reach = np.maximum(params.inner_radius_m, params.inner_time_s * closing)
    to_closest_s = time_to_closest_s(rel_position, rel_velocity)
    by_flight = params.outer_method is OuterMethod.PRICED
    has_cone = params.outer_method is not OuterMethod.FIELD
    outer = surface < outer_reach
    if has_cone:
        approach = -rel_velocity if by_flight else flown_mps(state) - velocity
        radius = tracks.protected_horizontal_m + (tracks.shell_m if by_flight else 0.0)
        alpha = approach_angle_rad(rel_position, approach)
        outer &= domain.covers(tracks.ids, alpha, half_angle_rad(distance, radius))
    # Near by, a turn back to the mission may lead through the volume although its far end does not.
    inner = surface < (tracks.shell_m if params.clears_inner_layer else inner_reach)
    if outer.any() or inner.any():
        ahead = ahead or fly_ahead(state, Commands.of([mission]), envelope)
        needed = 1.0 + tracks.shell_m / tracks.protected_horizontal_m
        needed *= 1.0 + params.release_margin if avoiding else _begins(to_closest_s, params)
        lost = separation(ahead, tracks, horizon_s=horizon_s).closest[0] < needed
        if by_flight:
            outer &= lost
        if not params.clears_inner_layer:
            inner &= lost
    if has_cone:
        domain.keep(tracks.ids, outer)
    conflict = {Layers.BOTH: outer | inner, Layers.OUTER: outer, Layers.INNER: inner}[params.layers]
    return Survey(
        tracks=tracks,
        rel_position_m=rel_position,
        own_rel_velocity_mps=-rel_velocity,
        surface_m=surface,
        closing_mps=closing,
        time_to_closest_s=to_closest_s,
        outer_reach_m=outer_reach,
        inner_reach_m=inner_reach,
        emergency=inner,
        conflict=conflict,
        horizon_s=horizon_s,
        mission_ahead_m=np.zeros((0, 2)) if ahead is None else ahead.ground_m[0],
    )


def _until_closest_mps(tracks: Tracks, ahead: Paths) -> Array:
    """Velocities until the closest approach to the mission flown ahead, (N, 3): the mean, where one turns.

    So cones, closing speeds and times mean for who turns towards us what they mean for who flies at us.
    """
    turning = np.flatnonzero(tracks.turn_radps)
    if not len(turning):
        return tracks.velocity_mps
    velocity = tracks.velocity_mps.copy()
    others_m = tracks.subset(turning).ground_m()
    off_m = others_m - ahead.ground_m[0]
    closest = np.maximum(np.hypot(off_m[..., 0], off_m[..., 1]).argmin(axis=1), 1)
    flown_m = others_m[np.arange(len(turning)), closest] - others_m[:, 0]
    velocity[turning, :2] = flown_m / TIMES_S[closest][:, None]
    return velocity


def _begins(to_closest_s: Array, params: AvoidanceParams) -> Array:
    """How near a track must come, as a share of the volume with its margin, for an avoidance to begin, (N,).

    The longer there is to go, the more often what looks near passes clear by itself: others turn and climb,
    and errors of velocity grow. Early on only what goes deep counts: there is time to wait and see.
    """
    span_s = max(params.outer_time_s - params.inner_time_s, 1e-3)
    early = np.clip((to_closest_s - params.inner_time_s) / span_s, 0.0, 1.0)
    begins: Array = params.begin_near + (params.begin_far - params.begin_near) * early
    return begins


def flown_mps(state: OwnState) -> Array:
    """Own velocity as flown now, north-east-down, (3,)."""
    return np.array([*state.ground_mps, -state.climb_mps])


def tracks_at(now_s: float, relevant: Sequence[Track], params: AvoidanceParams, goal: Goal) -> Tracks:
    """The tracks extrapolated to `now_s`, with the volumes to keep out of, margins included.

    What is not known of a height is added to the volume's before the margin: with all of it against us the
    bare volume is still kept.
    """
    position = np.array([track.position_m for track in relevant], dtype=np.float64)
    velocity = np.array([track.velocity_mps for track in relevant], dtype=np.float64)
    grounded = np.array([track.kind is TrafficKind.OBSTACLE for track in relevant])
    age_s = now_s - np.array([track.time_s for track in relevant])
    horizontal = np.where(grounded, params.obstacle_horizontal_m, params.well_clear_horizontal_m)
    vertical = np.where(grounded, params.obstacle_vertical_m, params.well_clear_vertical_m)
    for i, track in enumerate(relevant):
        if track.protected_horizontal_m is not None:
            horizontal[i] = track.protected_horizontal_m
        if track.protected_vertical_m is not None:
            vertical[i] = track.protected_vertical_m
    position += velocity * age_s[:, None]
    uncertain = np.array([max(track.vertical_uncertainty_m, 0.0) for track in relevant])
    horizontal = np.maximum(horizontal, 1.0) * (1.0 + params.horizontal_margin)
    return Tracks(
        tuple(track.track_id for track in relevant),
        position,
        velocity,
        horizontal,
        (np.maximum(vertical, 1.0) + uncertain) * (1.0 + params.vertical_margin),
        grounded,
        _shells_m(position, horizontal, params, goal),
        np.array([track.turn_radps for track in relevant]),
    )


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
    at_closest = position_at(
        survey.rel_position_m, -survey.own_rel_velocity_mps, np.maximum(survey.time_to_closest_s, 0.0)
    )
    vertical = vertical_distance_m(at_closest[:, 2], survey.tracks.grounded)
    places = np.flatnonzero(survey.conflict)
    order = places[np.argsort(survey.surface_m[places], kind="stable")][:most]
    return tuple(
        Threat(
            track_id=relevant[i].track_id,
            icao=relevant[i].icao,
            distance_m=float(np.hypot(*survey.rel_position_m[i, :2])),
            relative_altitude_m=-float(survey.rel_position_m[i, 2]),
            bearing_rad=math.atan2(survey.rel_position_m[i, 1], survey.rel_position_m[i, 0]),
            closing_mps=float(survey.closing_mps[i]),
            time_to_closest_s=float(survey.time_to_closest_s[i]),
            miss_horizontal_m=float(np.hypot(*at_closest[i, :2])),
            miss_vertical_m=float(vertical[i]),
            layer=Layer.INNER if survey.surface_m[i] < survey.inner_reach_m[i] else Layer.OUTER,
        )
        for i in order.tolist()
    )


def matters(track: Track) -> bool:
    """Whether a track is finite, within all reason, and of something that flies or stands in the way."""
    volumes = (track.protected_horizontal_m, track.protected_vertical_m)
    places_and_sizes = (*track.position_m, *(size for size in volumes if size is not None))
    sound = (
        math.isfinite(track.time_s)
        and all(abs(x) < _FURTHEST_M for x in places_and_sizes)
        and all(abs(v) < _FASTEST_MPS for v in track.velocity_mps)
        and not math.isnan(track.vertical_uncertainty_m)
    )
    return sound and track.kind is not TrafficKind.SURFACE_VEHICLE


def moved(what: Ownship | Track, now_s: float) -> Vec3:
    """Where it is at `now_s`, flying straight since its own time."""
    since_s = now_s - what.time_s
    north, east, down = (p + v * since_s for p, v in zip(what.position_m, what.velocity_mps, strict=True))
    return north, east, down


def refuse_nonsense(own: Ownship, goal: Goal) -> None:
    """`ValueError` when there is no safe answer."""
    numbers = [own.time_s, *own.position_m, *own.velocity_mps, own.airspeed_mps, own.heading_rad]
    numbers += [*(own.wind_mps or ()), *(goal.position_m if goal.position_m is not None else ())]
    numbers += [x for x in (goal.course_rad, goal.airspeed_mps, goal.altitude_m) if x is not None]
    if not all(map(math.isfinite, numbers)):
        raise ValueError("ownship or goal is not finite")


def own_state(now_s: float, own: Ownship) -> OwnState:
    """Ownship at `now_s`, with the wind that it measured or implies."""
    velocity = np.array(own.velocity_mps, dtype=np.float64)
    position = np.array(own.position_m, dtype=np.float64) + velocity * (now_s - own.time_s)
    ground_speed = math.hypot(velocity[0], velocity[1])
    airspeed = own.airspeed_mps if own.airspeed_mps > 1.0 else max(ground_speed, 1.0)
    if own.wind_mps is not None:
        wind = np.array(own.wind_mps, dtype=np.float64)
    else:
        # What moves over the ground but not through the air is the wind; a bad heading must not make a storm.
        wind = velocity[:2] - airspeed * np.array([math.cos(own.heading_rad), math.sin(own.heading_rad)])
        strength = math.hypot(wind[0], wind[1])
        if strength > 0.6 * airspeed:
            wind = np.zeros(2)
    course = math.atan2(velocity[1], velocity[0]) if ground_speed > 1.0 else own.heading_rad
    # Against a stronger wind one course is flown with the nose either way; else it follows from the course.
    heading = own.heading_rad if math.hypot(wind[0], wind[1]) >= airspeed else None
    return OwnState(position, course, airspeed, -float(velocity[2]), wind, heading)


def distance_m(state: OwnState, place_m: Vec3) -> float:
    """Horizontal distance to a place [m]."""
    return math.hypot(place_m[0] - state.position_m[0], place_m[1] - state.position_m[1])


def horizon_s(state: OwnState, mission: Guidance, goal: Goal) -> float:
    """How far ahead flights are judged: to the end of the flight, where that is near."""
    if goal.position_m is None or not goal.is_end:
        return HORIZON_S
    north_mps, east_mps = ground_velocity_mps(mission.course_rad, mission.airspeed_mps, state.wind_mps)
    made_good_mps = north_mps * math.cos(mission.course_rad) + east_mps * math.sin(mission.course_rad)
    # Blown back as fast as it flies, or faster, it never arrives.
    return min(HORIZON_S, distance_m(state, goal.position_m) / max(float(made_good_mps), 1e-3))


def mission_of(state: OwnState, own: Ownship, goal: Goal) -> Guidance:
    """What the goal means from here: course, airspeed and height."""
    airspeed = own.airspeed_mps if goal.airspeed_mps is None else goal.airspeed_mps
    course_rad, altitude_m = to_goal(state.position_m.tolist(), state.course_rad, goal)
    return Guidance(course_rad, airspeed, altitude_m)
