"""From what was surveyed to what rows are made from and priced against; and the outcome in words."""

import math
from dataclasses import replace

from companion.avoidance.assess import Survey, distance_m
from companion.avoidance.cost import Situation
from companion.avoidance.envelope import Envelope
from companion.avoidance.geometry import Array
from companion.avoidance.params import AvoidanceParams
from companion.avoidance.trajectory import HORIZON_S, OwnState, heights_to_pass, moment_at
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
    over_m, under_m, passed_s = heights_to_pass(survey.tracks, survey.motion, survey.conflict)
    usual_m = (-state.position_m[2], mission.altitude_m)
    highest_m = max(usual_m) + params.largest_height_change_m
    lowest_m = min(usual_m) - params.largest_height_change_m
    to_goal_m = params.outer_radius_m if goal.position_m is None else distance_m(state, goal.position_m)
    spared = 1.0 + min(params.horizontal_margin, params.vertical_margin)
    return Situation(
        own=state,
        mission=mission,
        over_m=min(over_m, highest_m),
        under_m=max(under_m, lowest_m),
        horizon_s=survey.horizon_s,
        goal_distance=to_goal_m / params.outer_radius_m,
        lost=min(1.0 + params.lost_margin, spared) / spared,
        right_preferred=_right_preferred(mission, survey.motion.position_m[survey.nearest]),
        envelope=envelope,
        weights=params.weights,
        surprises=params.surprises,
        early=survey.early(params),
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
