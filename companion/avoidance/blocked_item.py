"""A mission item within the volume of a track that stays there: it is passed above or below."""

import math
from dataclasses import replace

import numpy as np

from companion.avoidance.assess import TrafficAssessment
from companion.avoidance.constraints import Constraints
from companion.avoidance.intruders import heights_to_pass, separation
from companion.avoidance.mission_path import OwnFlight
from companion.avoidance.trajectory import Commands, Envelope, Mask, any_of, fly_ahead, index_at
from companion.geodesy import wrap_pi
from companion.model import Guidance, Vec3

# A track stays at the item if the item is within its volume for this long.
_STAYS_S = 60.0
# The autopilot flies to the mission's height again this long: from some seconds before the item, until the
# next one is selected and the aircraft is taken over once more.
_TOWARDS_MISSION_S = 10.0
# Radius of a usual turn, in time at the speed flown; with some room for its begin and its end.
_TURN_S = 6.0


def guidance_past(flight: OwnFlight, assessment: TrafficAssessment, envelope: Envelope) -> Guidance | None:
    """Guidance above or below the tracks that block the mission's item, towards it.

    `None` if no track does, another one is in conflict too, or neither height can be flown. A waypoint is
    passed only in the autopilot's own mode, in which the aircraft climbs or descends to the mission's height.
    """
    goal, own_m = flight.goal, -flight.state.position_m[2]
    if goal.position_m is None or goal.is_end or goal.loiter_radius_m is not None:
        return None
    if any_of(assessment.conflict & ~_blocking(assessment, goal.position_m, flight.mission.altitude_m)):
        return None
    over_m, under_m, _ = heights_to_pass(assessment.tracks, assessment.motion, assessment.conflict)
    heights_m = (
        over_m + envelope.max_sink_mps * _TOWARDS_MISSION_S,
        under_m - envelope.max_climb_mps * _TOWARDS_MISSION_S,
    )
    can_be_flown = [height_m for height_m in heights_m if envelope.clamp_altitude_m(height_m) == height_m]
    if not can_be_flown:
        return None
    altitude_m = min(can_be_flown, key=lambda height_m: abs(height_m - own_m))
    return replace(flight.mission, course_rad=_course_rad(flight, goal.position_m), altitude_m=altitude_m)


def keeps_clear(
    guidance: Guidance, flight: OwnFlight, assessment: TrafficAssessment, constraints: Constraints
) -> bool:
    """Whether a guidance may be flown and keeps clear of all volumes."""
    if not constraints.allow(guidance, flight.state):
        return False
    paths = fly_ahead(flight.state, Commands.of([guidance]), constraints.envelope)
    return bool((separation(paths, assessment.tracks).closest >= 1.0).all())


def _blocking(assessment: TrafficAssessment, item_m: Vec3, altitude_m: float) -> Mask:
    """The tracks that stay where the item, at a height, is within their volume, (N,)."""
    tracks = assessment.tracks
    off_m = tracks.ground_m()[:, : index_at(_STAYS_S) + 1] - np.array(item_m[:2])
    radius_m = tracks.protected_horizontal_m[:, None]
    stays: Mask = (np.hypot(off_m[..., 0], off_m[..., 1]) < radius_m).all(axis=1)
    above_m = altitude_m + tracks.position_m[:, 2]
    near: Mask = np.where(tracks.grounded, above_m, np.abs(above_m)) < tracks.protected_vertical_m
    return stays & near


def _course_rad(flight: OwnFlight, item_m: Vec3) -> float:
    """The course to the item; while the item is within our turning circle, the present one."""
    state, speed_mps = flight.state, flight.mission.airspeed_mps
    north_m, east_m = item_m[0] - state.position_m[0], item_m[1] - state.position_m[1]
    course_rad = math.atan2(east_m, north_m)
    off_rad = min(abs(wrap_pi(course_rad - state.course_rad)), math.pi / 2.0)
    within_m = 2.0 * _TURN_S * speed_mps * math.sin(off_rad)
    return course_rad if math.hypot(north_m, east_m) >= within_m else state.course_rad
