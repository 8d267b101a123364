"""Traffic assessment: the tracks that matter, measured against flying the mission on, and the threats."""

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple, Protocol

import numpy as np

from companion.avoidance.intruders import (
    RelativeMotion,
    Separation,
    Tracks,
    TransitionDomain,
    relative_motion,
    separation,
)
from companion.avoidance.mission_path import OwnFlight, mission_path
from companion.avoidance.params import AvoidanceParams
from companion.avoidance.trajectory import Array, Envelope, Mask, OwnState, any_of, position_at
from companion.compiled import kernels
from companion.geodesy import course_deg, wrap_pi
from companion.model import (
    LEVEL_M,
    STEADY_CLIMB_M,
    STEADY_SPEED_MPS,
    STEADY_TURN_RAD,
    Goal,
    Guidance,
    Layer,
    Threat,
    Track,
    TrafficKind,
    Vec2,
    Vec3,
)

# Speed at which we could approach a track that is near but not coming nearer.
_OWN_APPROACH_MPS = 20.0
_NO_PATH = np.zeros((0, 2))


def protected_tracks(now_s: float, tracks: Sequence[Track], params: AvoidanceParams) -> Tracks:
    """The tracks extrapolated to `now_s`, with their protected volumes, margins included.

    The uncertainty of a height is added to the volume before the margin: even if the whole error is against
    us, the bare volume is kept.
    """
    rows = []
    for track in tracks:
        grounded = track.kind is TrafficKind.OBSTACLE
        vertical_m = params.obstacle_vertical_m if grounded else params.well_clear_vertical_m
        if track.protected_vertical_m is not None:
            vertical_m = track.protected_vertical_m
        uncertain_m = max(track.vertical_uncertainty_m, 0.0)
        values = (
            protected_horizontal_m(track, params),
            (max(vertical_m, 1.0) + uncertain_m) * (1.0 + params.vertical_margin),
            track.turn_radps,
            grounded,
        )
        rows.append((position_at(track, now_s), track.velocity_mps, values))
    position, velocity, (horizontal, vertical, turns, on_ground) = kernels.columns(rows)
    ids = tuple(track.track_id for track in tracks)
    return Tracks(ids, position, velocity, horizontal, vertical, on_ground > 0.0, np.zeros(len(ids)), turns)


def protected_horizontal_m(track: Track, params: AvoidanceParams) -> float:
    """Radius of the protected volume, margin included."""
    horizontal_m = track.protected_horizontal_m
    if horizontal_m is None:
        grounded = track.kind is TrafficKind.OBSTACLE
        horizontal_m = params.obstacle_horizontal_m if grounded else params.well_clear_horizontal_m
    return max(horizontal_m, 1.0) * (1.0 + params.horizontal_margin)


class OuterDetection(Protocol):
    """Finds the conflicts within reach of the outer layer."""

    def in_cone(
        self,
        state: OwnState,
        tracks: Tracks,
        motion: RelativeMotion,
        velocity_mps: Array,
        domain: TransitionDomain,
    ) -> Mask:
        """The tracks whose collision cone we are in, (N,); `velocity_mps` is that of the tracks, (N, 3)."""

    def confirmed(self, within: Mask, too_near: Mask) -> Mask:
        """The conflicts, from the tracks within reach and cone and those the mission is too near to, (N,)."""

    def remember(self, domain: TransitionDomain, ids: Sequence[str], conflict: Mask) -> None:
        """Enter the cones of these conflicts, and leave all others."""


class EmergencyDetection(Protocol):
    """Finds the tracks that call for the inner layer."""

    def buffered(self, tracks: Tracks, goal: Goal) -> Tracks:
        """The tracks with the buffers that the inner layer adds around their volumes."""

    def reach_m(self, tracks: Tracks, inner_reach_m: Array) -> Array:
        """How far the inner layer reaches from the surface of each volume, (N,)."""

    def confirmed(self, within: Mask, too_near: Mask) -> Mask:
        """The emergencies, from the tracks within reach and those the mission is too near to, (N,)."""


class ConflictPolicy(Protocol):
    """How conflicts are found. `layers` has what flies by default, `policies` the paper's variants."""

    @property
    def outer(self) -> OuterDetection:
        """For the outer layer."""

    @property
    def emergency(self) -> EmergencyDetection:
        """For the inner layer."""

    def conflict(self, outer: Mask, emergency: Mask) -> Mask:
        """Which tracks are in conflict, from those of each layer, (N,) each."""


class TrafficAssessment(NamedTuple):
    """All tracks measured against flying the mission on; arrays of shape (N,) unless stated otherwise."""

    tracks: Tracks
    motion: RelativeMotion  # relative to ownship on its mission
    surface_m: Array  # horizontal distance to the protected volume
    outer_reach_m: Array
    inner_reach_m: Array
    emergency: Mask  # calls for the inner layer
    conflict: Mask
    horizon_s: float  # how far ahead flights are judged
    mission_path_m: Array  # the mission flown ahead, north and east, (T, 2); (0, 2) if not flown ahead

    def most_urgent(self, count: int) -> Tracks:
        """The tracks to price rows against: conflicts first, then those soonest reached."""
        if len(self.tracks) == 1:
            return self.tracks
        approach_mps = np.hypot(*self.motion.own_velocity_mps[:, :2].T) + _OWN_APPROACH_MPS
        return self.tracks.subset(np.lexsort((self.surface_m / approach_mps, ~self.conflict))[:count])

    def earliness(self, params: AvoidanceParams) -> float:
        """0 if the first closest approach of a conflict is near, rising to 1 if it is far off."""
        to_closest_s = float(self.motion.time_to_closest_s[self.conflict].min())
        return kernels.early(to_closest_s, params.inner_time_s, params.outer_time_s)

    def without(self, members: Mask) -> "TrafficAssessment":
        """The same without the conflicts with these tracks, (N,): they keep clear of us by agreement."""
        return self._replace(conflict=self.conflict & ~members, emergency=self.emergency & ~members)

    @property
    def nearest(self) -> int:
        """Index of the nearest conflict."""
        indices = self.conflict.nonzero()[0]
        return int(indices[self.surface_m[indices].argmin()])


def assess_traffic(
    flight: OwnFlight,
    tracks: Tracks,
    params: AvoidanceParams,
    envelope: Envelope,
    policy: ConflictPolicy,
    domain: TransitionDomain,
    *,
    release_margin: float | None = None,
) -> TrafficAssessment:
    """Measure all tracks against the mission, and find the conflicts.

    A conflict is a track within the reach of a layer (def. 3, from surface to surface), if we are in its
    collision cone and the mission, flown ahead with its turns and heights, comes too near to it. The paper
    looks along the velocity flown; by default we look along the mission's, so that a conflict lasts until the
    mission itself is clear. `domain` remembers the cones entered. `release_margin` is the share of room that
    is required in addition while an avoidance is flown, `None` otherwise.
    """
    state, horizon_s = flight.state, flight.horizon_s
    tracks = policy.emergency.buffered(tracks, flight.goal)
    # The mission is flown ahead only if needed: mostly no track turns and none is within a layer.
    ahead = mission_path(flight, envelope) if any_of(tracks.turn_radps) else None
    # With mean velocities, cones, closing speeds and times apply to turning tracks as well.
    velocity = tracks.velocity_mps if ahead is None else tracks.velocity_until_closest_mps(ahead.ground_m[0])
    motion = relative_motion(tracks.position_m, velocity, state.position_m, (*flight.onward_mps, 0.0))
    surface, outer_reach, inner_reach = _reaches(motion, tracks, params)
    outer = surface < outer_reach
    # A cone is around one direction; a way that bends is judged by the flight ahead alone.
    if any_of(outer) and not flight.bends:
        outer &= policy.outer.in_cone(state, tracks, motion, velocity, domain)
    # The inner layer has no cone: near a track, a turn back to the mission may lead through its volume.
    emergency = surface < policy.emergency.reach_m(tracks, inner_reach)
    if any_of(outer) or any_of(emergency):
        ahead = ahead or mission_path(flight, envelope)
        kept = separation(ahead, tracks, horizon_s=min(horizon_s, flight.judged_s))
        too_near = _too_near(kept, tracks, motion, params, release_margin)
        outer = policy.outer.confirmed(outer, too_near)
        emergency = policy.emergency.confirmed(emergency, too_near)
    policy.outer.remember(domain, tracks.ids, outer)
    return TrafficAssessment(
        tracks=tracks,
        motion=motion,
        surface_m=surface,
        outer_reach_m=outer_reach,
        inner_reach_m=inner_reach,
        emergency=emergency,
        conflict=policy.conflict(outer, emergency),
        horizon_s=horizon_s,
        mission_path_m=_NO_PATH if ahead is None else ahead.ground_m[0],
    )


def _reaches(motion: RelativeMotion, tracks: Tracks, params: AvoidanceParams) -> Array:
    """Distances to the protected volumes, and the reach of the outer and of the inner layer, (3, N)."""
    reaches: Array = kernels.reaches(
        motion.distance_m,
        motion.closing_mps,
        tracks.protected_horizontal_m,
        params.outer_radius_m,
        params.outer_time_s,
        params.inner_radius_m,
        params.inner_time_s,
    )
    return reaches


def _too_near(
    kept: Separation,
    tracks: Tracks,
    motion: RelativeMotion,
    params: AvoidanceParams,
    release_margin: float | None,
) -> Mask:
    """The tracks that the mission comes too near to, (N,): within a share of the volume, margin included.

    During an avoidance that share is 1 plus the release margin. Before it, the share is smaller while there
    is time: tracks turn and climb, errors of velocity grow, and many tracks that look near pass clear without
    an avoidance, so that only a deep penetration counts. There is no time if the volume is entered soon, even
    if the closest approach is far off: an aircraft with nearly our velocity stays beside us for minutes.
    """
    near, far = params.begin_near, params.begin_far
    if release_margin is not None:
        near = far = 1.0 + release_margin
    too_near: Mask = kernels.too_near(
        kept.closest[0],
        kept.entered_s[0],
        motion.time_to_closest_s,
        tracks.buffer_m,
        tracks.protected_horizontal_m,
        near,
        far,
        params.inner_time_s,
        params.outer_time_s,
    )
    return too_near


def needs_no_assessment(
    flight: OwnFlight,
    now_s: float,
    tracks: Sequence[Track],
    params: AvoidanceParams,
    domain: TransitionDomain,
) -> bool:
    """Fast path: whether no track turns and each is out of reach of the layers, or we are not in its cone.

    `assess_traffic` then finds no conflict by default. Most traffic is far away or flies past.
    """
    own_m, onward_mps = flight.state.position_m, flight.onward_mps
    return all(_is_clear(own_m, onward_mps, now_s, track, params, domain) for track in tracks)


def _is_clear(
    own_m: Vec3,
    onward_mps: Vec2,
    now_s: float,
    track: Track,
    params: AvoidanceParams,
    domain: TransitionDomain,
) -> bool:
    if track.turn_radps != 0.0:
        return False
    north_m, east_m, _ = position_at(track, now_s)
    north_m, east_m = north_m - own_m[0], east_m - own_m[1]
    north_mps, east_mps = onward_mps[0] - track.velocity_mps[0], onward_mps[1] - track.velocity_mps[1]
    distance_m, radius_m = math.hypot(north_m, east_m), protected_horizontal_m(track, params)
    surface_m, along = distance_m - radius_m, north_m * north_mps + east_m * east_mps
    closing_mps = max(along / max(distance_m, 1e-9), 0.0)
    if surface_m < max(params.inner_radius_m, params.inner_time_s * closing_mps):
        return False
    if surface_m >= max(params.outer_radius_m, params.outer_time_s * closing_mps):
        return True
    if distance_m <= radius_m:
        return False
    approach_rad = math.atan2(abs(north_m * east_mps - east_m * north_mps), along)
    return approach_rad > math.asin(radius_m / distance_m) + domain.wider_rad(track.track_id)


def threats_of(assessment: TrafficAssessment, tracks: Sequence[Track], most: int) -> tuple[Threat, ...]:
    """The conflicts among the assessed tracks, nearest first, at most `most`."""
    indices = assessment.conflict.nonzero()[0]
    indices = indices[assessment.surface_m[indices].argsort(kind="stable")][:most]
    motion = assessment.motion
    columns = (
        indices,
        motion.position_m[indices],
        motion.own_velocity_mps[indices],
        motion.closing_mps[indices],
        motion.time_to_closest_s[indices],
        assessment.surface_m[indices] < assessment.inner_reach_m[indices],
        assessment.tracks.grounded[indices],
    )
    rows = zip(*(column.tolist() for column in columns), strict=True)
    return tuple(_threat(tracks[index], *values) for index, *values in rows)


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
    above_m = down_m - down_mps * to_go_s  # our height above the track at the closest approach
    return Threat(
        track_id=track.track_id,
        icao=track.icao,
        distance_m=math.hypot(north_m, east_m),
        relative_altitude_m=-down_m,
        bearing_rad=math.atan2(east_m, north_m),
        closing_mps=closing_mps,
        time_to_closest_s=time_s,
        miss_horizontal_m=math.hypot(north_m - north_mps * to_go_s, east_m - east_mps * to_go_s),
        # An obstacle reaches down to the ground.
        miss_vertical_m=max(above_m, 0.0) if grounded else abs(above_m),
        layer=Layer.INNER if is_inner else Layer.OUTER,
        name=track.name,
    )


def reason(threat: Threat, guidance: Guidance, state: OwnState) -> str:
    """The decision in words: the manoeuvre, and the nearest threat that it avoids."""
    return f"{', '.join(_maneuver(guidance, state))}: {threat.name or threat.track_id} {_where(threat)}"


def _maneuver(guidance: Guidance, state: OwnState) -> Iterator[str]:
    """Changes of height, course and speed from the present flight; the height relative to the present one."""
    climb_m = guidance.altitude_m + state.position_m[2]
    if abs(climb_m) > STEADY_CLIMB_M:
        yield f"{'climb' if climb_m > 0 else 'descend'} {abs(climb_m):.0f} m"
    turn_rad = wrap_pi(guidance.course_rad - state.course_rad)
    turning = "course" if abs(turn_rad) <= STEADY_TURN_RAD else "right to" if turn_rad > 0 else "left to"
    yield f"{turning} {round(course_deg(guidance.course_rad)) % 360:03d}"
    if abs(guidance.airspeed_mps - state.airspeed_mps) > STEADY_SPEED_MPS:
        yield f"{guidance.airspeed_mps:.0f} m/s"


def _where(threat: Threat) -> str:
    """Distance, height relative to us, and time to the closest approach."""
    above_m, to_closest_s = threat.relative_altitude_m, threat.time_to_closest_s
    level = (
        "level"
        if round(abs(above_m)) < LEVEL_M
        else f"{abs(above_m):.0f} m {'above' if above_m > 0 else 'below'}"
    )
    closest = f"closest in {to_closest_s:.0f} s" if math.isfinite(to_closest_s) else "keeps its distance"
    return f"{threat.distance_m:.0f} m, {level}, {closest if to_closest_s >= 0.0 else 'passed'}"
