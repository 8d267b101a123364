"""What the operator sees of a decision: its threats, and the reason in words."""

import math
from collections.abc import Sequence

from companion.avoidance.assess import TrafficAssessment
from companion.avoidance.own_flight import OwnState
from companion.model import Guidance, Layer, Threat, Track, Vec3
from companion.units import wrap_pi


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
    above_m = down_m - down_mps * to_go_s  # ours above it at the closest approach
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
    )


def reason(threat: Threat, guidance: Guidance, state: OwnState) -> str:
    """The decision in words: the nearest threat and the guidance against it."""
    course = math.degrees(guidance.course_rad) % 360.0
    turn = math.degrees(wrap_pi(guidance.course_rad - state.course_rad))
    turning = f"{'right' if turn > 0 else 'left'} to " if abs(turn) > 5.0 else ""
    return (
        f"{threat.track_id} {threat.distance_m:.0f} m, {threat.relative_altitude_m:+.0f} m, "
        f"{threat.time_to_closest_s:.0f} s: course {turning}{course:03.0f}, "
        f"height {guidance.altitude_m:.0f} m"
    )
