"""The context in which rows are made and priced: own flight, heights to pass at, sides, times, limits."""

import math
from dataclasses import replace
from typing import NamedTuple

from companion.avoidance.assess import TrafficAssessment
from companion.avoidance.constraints import Constraints
from companion.avoidance.cost_weights import CostWeights
from companion.avoidance.envelope import Envelope, Pace
from companion.avoidance.fence import Fence
from companion.avoidance.geometry import Array, any_of
from companion.avoidance.maneuvers import NO_MANEUVERS, ManeuverParams
from companion.avoidance.own_flight import OwnFlight, OwnState
from companion.avoidance.params import AvoidanceParams
from companion.avoidance.prediction_times import HORIZON_S, index_at
from companion.avoidance.refusals import Refusals
from companion.avoidance.separation import heights_to_pass
from companion.avoidance.tracks import Tracks
from companion.model import Guidance
from companion.units import wrap_pi


class CostContext(NamedTuple):
    """What rows are made from and priced against."""

    own: OwnState
    mission: Guidance
    over_m: float  # the height that passes above every threat
    under_m: float  # the height that passes below every threat
    right_preferred: bool
    horizon_s: float  # how far ahead rows are judged
    goal_distance: float  # in radii of the outer layer; 1 where the goal is only a direction
    breach_ratio: float  # separation, in volumes with margin, below which the bare volume counts as entered
    envelope: Envelope
    weights: CostWeights
    rule_course_rad: float = 0.0  # the course of eq. 11, in an emergency
    rule_pace: Pace = Pace.KEEP  # the speed of eq. 13
    fence: Fence | None = None
    fence_look_ahead_s: float = 0.0  # the fence must be kept until then
    passed_s: float = HORIZON_S  # when all threats are passed
    # Where the mission flown on is at that time, north and east, (2,); `None` if there is no threat.
    mission_at_passed_m: Array | None = None
    refusals: Refusals = Refusals()
    maneuvers: ManeuverParams = NO_MANEUVERS
    prefers_turns: bool = False  # the mission's height is left only where a turn does not suffice
    earliness: float = 0.0  # 1 while the closest approach is far off, 0 when it is near
    overtime: float = 0.0  # grows while an avoidance lasts too long; the price `unresolved` grows with it


class Conflict(NamedTuple):
    """A conflict to be resolved: its context, the traffic, and the guidance flown until now."""

    context: CostContext
    assessment: TrafficAssessment
    urgent: Tracks  # the tracks to price rows against
    last_guidance: Guidance | None

    @property
    def is_emergency(self) -> bool:
        """Whether any track calls for the inner layer."""
        return any_of(self.assessment.emergency)


def conflict_context(
    flight: OwnFlight,
    assessment: TrafficAssessment,
    params: AvoidanceParams,
    constraints: Constraints,
    *,
    prefers_turns: bool,
    overtime: float,
) -> CostContext:
    """The context of at least one conflict."""
    state, mission, goal = flight.state, flight.mission, flight.goal
    over_m, under_m, passed_s = heights_to_pass(assessment.tracks, assessment.motion, assessment.conflict)
    usual_m = (-state.position_m[2], mission.altitude_m)
    highest_m = max(usual_m) + params.largest_height_change_m
    lowest_m = min(usual_m) - params.largest_height_change_m
    to_goal_m = params.outer_radius_m if goal.position_m is None else state.distance_m(goal.position_m)
    margin = 1.0 + min(params.horizontal_margin, params.vertical_margin)
    return CostContext(
        own=state,
        mission=mission,
        over_m=min(over_m, highest_m),
        under_m=max(under_m, lowest_m),
        horizon_s=assessment.horizon_s,
        goal_distance=to_goal_m / params.outer_radius_m,
        breach_ratio=min(1.0 + params.lost_margin, margin) / margin,
        right_preferred=_right_preferred(mission, assessment.motion.position_m[assessment.nearest]),
        envelope=constraints.envelope,
        weights=params.weights,
        fence=constraints.fence,
        fence_look_ahead_s=constraints.fence_look_ahead_s(state),
        refusals=constraints.refusals,
        maneuvers=params.surprises,
        prefers_turns=prefers_turns,
        earliness=assessment.earliness(params),
        overtime=overtime,
        passed_s=passed_s,
        mission_at_passed_m=assessment.mission_path_m[index_at(passed_s)],
    )


def return_context(
    flight: OwnFlight, params: AvoidanceParams, constraints: Constraints, *, prefers_turns: bool
) -> CostContext:
    """The context of a return to the mission, without any conflict."""
    mission = flight.mission
    return CostContext(
        own=flight.state,
        mission=mission,
        over_m=mission.altitude_m,
        under_m=mission.altitude_m,
        horizon_s=HORIZON_S,
        goal_distance=1.0,
        breach_ratio=1.0,
        right_preferred=False,
        envelope=constraints.envelope,
        weights=replace(params.weights, switch=params.weights.ease),
        rule_course_rad=mission.course_rad,
        fence=constraints.fence,
        fence_look_ahead_s=constraints.fence_look_ahead_s(flight.state),
        refusals=constraints.refusals,
        prefers_turns=prefers_turns,
    )


def _right_preferred(mission: Guidance, rel_m: Array) -> bool:
    """Whether the rules of the air turn us to the right: head-on, or crossing from the right."""
    north_m, east_m, _ = rel_m.tolist()
    bearing_rad = wrap_pi(math.atan2(east_m, north_m) - mission.course_rad)
    return math.radians(-20.0) <= bearing_rad <= math.radians(110.0)
