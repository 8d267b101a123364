"""From what was surveyed to what rows are made from and priced against; and the outcome in words."""

import math
from dataclasses import replace

import numpy as np

from companion.avoidance.envelope import Envelope
from companion.avoidance.geometry import Array
from companion.avoidance.params import AvoidanceParams
from companion.avoidance.prediction import HORIZON_S, OwnState, moment_at
from companion.avoidance.pricing import Situation
from companion.avoidance.survey import Survey, distance_m
from companion.model import Goal, Guidance, Threat
from companion.units import wrap_pi


def conflict(
    state: OwnState,
    mission: Guidance,
    survey: Survey,
    goal: Goal,
    params: AvoidanceParams,
    envelope: Envelope,
) -> Situation:
    """The conflicts of a survey, of which there is one at least: heights over and under, sides, times."""
    threat = survey.conflict.nonzero()[0]
    # A threat's height matters while it is within the horizontal volume, around the closest approach.
    approach_mps, tracks = survey.own_rel_velocity_mps[threat], survey.tracks
    rel_speed = np.hypot(approach_mps[:, 0], approach_mps[:, 1])
    crossing_s = np.minimum(tracks.protected_horizontal_m[threat] / np.maximum(rel_speed, 1.0), 30.0)
    closest_s = np.minimum(np.maximum(survey.time_to_closest_s[threat], 0.0), HORIZON_S)
    until_s = closest_s + crossing_s
    height, climb = -tracks.position_m[threat, 2], -tracks.velocity_mps[threat, 2]
    first, last = height + climb * np.maximum(closest_s - crossing_s, 0.0), height + climb * until_s
    # Slightly more than priced as clear, so that arriving at the height is enough.
    room = 1.02 * tracks.protected_vertical_m[threat]
    usual_m = (-float(state.position_m[2]), mission.altitude_m)
    highest_m = max(usual_m) + params.largest_height_change_m
    lowest_m = min(usual_m) - params.largest_height_change_m
    to_goal_m = params.outer_radius_m if goal.position_m is None else distance_m(state, goal.position_m)
    passed_s = min(float(until_s.max()), HORIZON_S)
    spared = 1.0 + min(params.horizontal_margin, params.vertical_margin)
    return Situation(
        own=state,
        mission=mission,
        over_m=min(float((np.maximum(first, last) + room).max()), highest_m),
        under_m=max(float((np.minimum(first, last) - room).min()), lowest_m),
        horizon_s=survey.horizon_s,
        goal_distance=to_goal_m / params.outer_radius_m,
        lost=min(1.0 + params.lost_margin, spared) / spared,
        right_preferred=_right_preferred(mission, survey.rel_position_m[survey.nearest]),
        envelope=envelope,
        weights=params.weights,
        surprises=params.surprises,
        passed_s=passed_s,
        mission_then_m=survey.mission_ahead_m[moment_at(passed_s)],
    )


def way_back(state: OwnState, mission: Guidance, params: AvoidanceParams, envelope: Envelope) -> Situation:
    """No conflict any more, only the way back to the mission to be found."""
    return Situation(
        own=state,
        mission=mission,
        over_m=mission.altitude_m,
        under_m=mission.altitude_m,
        horizon_s=HORIZON_S,
        goal_distance=1.0,
        lost=1.0,
        right_preferred=False,
        envelope=envelope,
        weights=replace(params.weights, switch=params.weights.ease),
        rule_course_rad=mission.course_rad,
    )


def because(threat: Threat, guidance: Guidance, state: OwnState) -> str:
    """The decision in words, for the operator and the log."""
    course = math.degrees(guidance.course_rad) % 360.0
    turn = math.degrees(wrap_pi(guidance.course_rad - state.course_rad))
    turning = f"{'right' if turn > 0 else 'left'} to " if abs(turn) > 5.0 else ""
    return (
        f"{threat.track_id} {threat.distance_m:.0f} m, {threat.relative_altitude_m:+.0f} m, "
        f"{threat.time_to_closest_s:.0f} s: course {turning}{course:03.0f}, "
        f"height {guidance.altitude_m:.0f} m"
    )


def _right_preferred(mission: Guidance, rel_m: Array) -> bool:
    """Head-on and crossing from the right: the rules of the air turn us to the right."""
    north_m, east_m, _ = rel_m.tolist()
    bearing_rad = wrap_pi(math.atan2(east_m, north_m) - mission.course_rad)
    return math.radians(-20.0) <= bearing_rad <= math.radians(110.0)
