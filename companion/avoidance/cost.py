"""Cost: the context that rows are priced in, rows flown ahead, and the price of each. The cheapest is flown.

The price puts separation first, from predicted flights and from unpredicted maneuvers. Then come effort,
deviation from the mission, the situation that a row leads to, switching rows, and passing on the wrong side.
"""

import math
from dataclasses import replace
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from companion.avoidance.assess import TrafficAssessment
from companion.avoidance.constraints import Constraints, Refusals
from companion.avoidance.fence import Breach, Fence
from companion.avoidance.intruders import (
    NO_MANEUVERS,
    ManeuverParams,
    Tracks,
    enumerate_maneuvers,
    heights_to_pass,
    losses,
    outcomes,
    separation,
)
from companion.avoidance.mission_path import OwnFlight
from companion.avoidance.params import AvoidanceParams, CostWeights
from companion.avoidance.senses import NO_WRONG_WAYS, WrongWays
from companion.avoidance.trajectory import (
    HORIZON_S,
    Array,
    Commands,
    Envelope,
    Mask,
    OwnState,
    Pace,
    Paths,
    any_of,
    fly_ahead,
    ground_velocity_mps,
    index_at,
)
from companion.compiled import kernels
from companion.model import Guidance

# Commands that differ by no more than this count as the same.
_SAME_COURSE_RAD, _SAME_HEIGHT_M = math.radians(2.0), 5.0
# A near mid-air collision (500 ft by 100 ft) in shares of well clear (2000 ft by 250 ft).
_NEAR_MISS_HORIZONTAL, _NEAR_MISS_VERTICAL = 0.25, 0.4


class Height(StrEnum):
    """A choice of height, the third control (§2.3, §3.2.3)."""

    MISSION = "mission height"
    LEVEL = "level off"
    OVER = "over"
    UNDER = "under"


class Speed(StrEnum):
    """A choice of airspeed."""

    MISSION = "mission speed"
    RULE = "speed rule"  # eq. 13
    SLOWEST = "slowest"
    FASTEST = "fastest"


class CostContext(NamedTuple):
    """The inputs from which rows are made and priced."""

    own: OwnState
    mission: Guidance
    over_m: float  # the height that passes above every threat [m]
    under_m: float  # the height that passes below every threat [m]
    wrong: WrongWays  # the ways that a stranger which avoids too may take
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
    # The place, north and east (2,), that the mission reaches by then; `None` if there is no threat.
    mission_at_passed_m: Array | None = None
    refusals: Refusals = Refusals()
    maneuvers: ManeuverParams = NO_MANEUVERS
    prefers_turns: bool = False  # the mission's height is left only where a turn does not suffice
    earliness: float = 0.0  # 1 while the closest approach is far off, 0 when it is near
    overtime: float = 0.0  # grows while an avoidance lasts too long; the price `unresolved` grows with it

    def height_m(self, choice: Height) -> float:
        """The height of a choice above the zero of the local frame, within floor and ceiling [m]."""
        match choice:
            case Height.MISSION:
                wanted_m = self.mission.altitude_m
            case Height.LEVEL:
                wanted_m = -self.own.position_m[2]
            case Height.OVER:
                wanted_m = self.over_m
            case Height.UNDER:
                wanted_m = self.under_m
        return self.envelope.clamp_altitude_m(wanted_m)

    def speed_mps(self, choice: Speed) -> float:
        """The airspeed of a choice, within the limits [m/s]."""
        match choice:
            case Speed.MISSION:
                pace = Pace.KEEP
            case Speed.RULE:
                pace = self.rule_pace
            case Speed.SLOWEST:
                pace = Pace.SLOWEST
            case Speed.FASTEST:
                pace = Pace.FASTEST
        return self.envelope.airspeed_mps(pace, self.mission.airspeed_mps)


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
    wrong: WrongWays = NO_WRONG_WAYS,
    prefers_turns: bool,
    overtime: float,
) -> CostContext:
    """The context of at least one conflict."""
    state, mission, goal = flight.state, flight.mission, flight.goal
    over_m, under_m, passed_s = heights_to_pass(assessment.tracks, assessment.motion, assessment.conflict)
    to_goal_m = params.outer_radius_m if goal.position_m is None else state.distance_m(goal.position_m)
    margin = 1.0 + min(params.horizontal_margin, params.vertical_margin)
    return CostContext(
        own=state,
        mission=mission,
        over_m=over_m,
        under_m=under_m,
        horizon_s=assessment.horizon_s,
        goal_distance=to_goal_m / params.outer_radius_m,
        breach_ratio=min(1.0 + params.lost_margin, margin) / margin,
        wrong=wrong,
        envelope=constraints.envelope,
        weights=params.weights,
        fence=constraints.fence,
        fence_look_ahead_s=0.0 if constraints.fence is None else constraints.fence_look_ahead_s(state),
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
        wrong=NO_WRONG_WAYS,
        envelope=constraints.envelope,
        weights=replace(params.weights, switch=params.weights.ease),
        rule_course_rad=mission.course_rad,
        fence=constraints.fence,
        fence_look_ahead_s=constraints.fence_look_ahead_s(flight.state),
        refusals=constraints.refusals,
        prefers_turns=prefers_turns,
    )


class EvaluatedRows(NamedTuple):
    """Rows with their cost, their separation from the nearest track, and which keep the fence, (K,) each.

    `best` is the index of the cheapest row; of equals the first, so that the same inputs give the same row.
    """

    commands: Commands
    cost: Array
    closest: Array
    within_fence: Mask
    best: int

    @property
    def best_guidance(self) -> Guidance:
        """The cheapest row."""
        return self.commands.row(self.best)

    def best_is_allowed(self, refusals: Refusals) -> bool:
        """Whether the cheapest row keeps the fence and has no refused value."""
        if not self.within_fence[self.best]:
            return False
        return not refusals.refused or refusals.allow(self.best_guidance)


def evaluate_rows(
    context: CostContext, commands: Commands, tracks: Tracks, last_guidance: Guidance | None
) -> EvaluatedRows:
    """Fly all rows ahead and price them, without those that the autopilot refused.

    `last_guidance`, if any, becomes row 0. Maneuvers of intruders add to the cost of separation, but
    `EvaluatedRows.closest` is against predicted flights alone.
    """
    weights = context.weights
    commands, last_guidance = _allowed_rows(context, commands, last_guidance)
    paths = fly_ahead(context.own, commands, context.envelope)
    cost, closest = losses(
        paths,
        tracks,
        enumerate_maneuvers(tracks, context.maneuvers),
        weights,
        context.breach_ratio,
        horizon_s=context.horizon_s,
        soon_s=min(context.maneuvers.within_s, context.horizon_s),
    )
    if weights.nearness > 0.0:
        cost += _buffer_cost(context, paths, tracks)
    _add_efforts(cost, context, commands, _outcome_cost(context, paths, tracks), last_guidance)
    within_fence = np.ones(len(commands), dtype=bool)
    if context.fence is not None:
        breach = context.fence.breach(paths, context.fence_look_ahead_s, context.passed_s)
        within_fence = breach.deepest_m <= 0.0
        cost += _fence_cost(context, context.fence, breach)
        if not within_fence.all():
            cost += _near_miss_cost(context, paths, tracks)
    return EvaluatedRows(commands, cost, closest, within_fence, int(cost.argmin()))


def _allowed_rows(
    context: CostContext, commands: Commands, last_guidance: Guidance | None
) -> tuple[Commands, Guidance | None]:
    """The rows without refused values, with the last guidance as row 0, and that guidance if it remains."""
    refusals = context.refusals
    if not refusals.refused:
        return commands if last_guidance is None else commands.preceded_by(last_guidance), last_guidance
    mission = context.envelope.within_limits(context.mission)
    if last_guidance is not None:
        last_guidance = refusals.substitute(last_guidance, mission, commands)
    if last_guidance is not None:
        commands = commands.preceded_by(last_guidance)
    return refusals.remove_from(commands, mission), last_guidance


def _buffer_cost(context: CostContext, paths: Paths, tracks: Tracks) -> Array:
    """The cost of rows within the buffers around volumes, (K,).

    In a crowd no row is clear of all buffers. Only the worst counts, or the crowd would outweigh the goal.
    """
    kept = separation(paths, tracks, horizon_s=context.horizon_s, buffers=True)
    cost: Array = context.weights.nearness * kept.nearness.max(axis=1, initial=0.0)
    return cost


def _add_efforts(
    cost: Array,
    context: CostContext,
    commands: Commands,
    outcome_cost: Array,
    last_guidance: Guidance | None,
) -> None:
    """Add the cost of the commands themselves, and that of the outcomes of their ground paths, (H,).

    Commands cost by turn, by deviation from the mission's course, speed and height, and by the wrong side.
    Rows other than the last guidance also cost the switch, or less if they lie between it and the mission.
    """
    mission, weights = context.mission, context.weights
    kernels.add_efforts(
        cost,
        commands,
        weights,
        outcome_cost,
        mission.course_rad,
        mission.airspeed_mps,
        mission.altitude_m,
        context.own.course_rad,
        context.wrong,
        context.prefers_turns,
        last_guidance,
        _SAME_COURSE_RAD,
        _SAME_HEIGHT_M,
        weights.switch * (1.0 + context.earliness),
    )


def _outcome_cost(context: CostContext, paths: Paths, tracks: Tracks) -> Array:
    """The cost of the places that ground paths have reached when all threats are passed, (H,).

    It has two parts: the distance from where the mission would be, and the conflicts still unresolved there.
    A row beside a threat stays clear of it for any time, but never passes it.
    """
    if context.mission_at_passed_m is None:
        return np.zeros(len(paths.ground_m))
    weights, mission = context.weights, context.mission
    return outcomes(
        paths,
        tracks,
        index_at(context.passed_s),
        context.mission_at_passed_m,
        ground_velocity_mps(mission.course_rad, mission.airspeed_mps, context.own.wind_mps),
        mission.altitude_m,
        aside=weights.aside / 100.0,
        unresolved=(1.0 + context.overtime) * weights.unresolved,
    )


def _fence_cost(context: CostContext, fence: Fence, breach: Breach) -> Array:
    """The cost of breaking the fence, (K,).

    Avoiding a near mid-air collision comes first, then the fence, then everything else. The well-clear volume
    can absorb errors of the prediction. A fence cannot: beyond it are other people and other aircraft, and
    the autopilot reacts by itself. Once we are outside, every row breaks the fence, and well clear is weighed
    as usual against a quick return.
    """
    weights = context.weights
    use = breach.deepest_m / fence.margin_m if fence.margin_m > 0.0 else breach.deepest_m > 0.0
    early = np.maximum(1.0 - breach.first_s / max(context.passed_s, 1.0), 0.0)
    cost: Array = (
        weights.fence * np.minimum(use, 1.0)
        + weights.outside / 100.0 * breach.mean_m
        + weights.not_to_the_end * early
    )
    return cost


def _near_miss_cost(context: CostContext, paths: Paths, tracks: Tracks) -> Array:
    """The cost of near mid-air collisions, which even the fence does not justify, (K,)."""
    horizontal, vertical = (
        context.breach_ratio * _NEAR_MISS_HORIZONTAL,
        context.breach_ratio * _NEAR_MISS_VERTICAL,
    )
    cores = replace(
        tracks,
        protected_horizontal_m=horizontal * tracks.protected_horizontal_m,
        protected_vertical_m=vertical * tracks.protected_vertical_m,
    )
    closest = separation(paths, cores, horizon_s=context.horizon_s).closest.min(axis=1, initial=np.inf)
    cost: Array = context.weights.near_miss * ((closest < 1.0) + np.maximum(1.0 - closest, 0.0))
    return cost
