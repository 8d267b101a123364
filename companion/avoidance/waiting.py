"""Whether an avoidance can begin later."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from companion.avoidance.cost import Conflict
from companion.avoidance.layers import OuterPolicy
from companion.avoidance.trajectory import TIMES_S, Array, OwnState, index_at
from companion.model import Track, TrafficKind

# A mission that leads less than this aside goes straight on.
_STRAIGHT_M: Final = 100.0


def can_wait(conflict: Conflict, relevant: Sequence[Track], outer: OuterPolicy, reserve_s: float) -> bool:
    """Whether the best row of the outer layer can as well be begun `reserve_s` later.

    It then still keeps every volume and margin, and costs hardly more than now: a climb begins before it no
    longer suffices without a turn. Until then we fly on as now. What comes in the meantime (another report, a
    turn of the intruder) often shows that no avoidance is needed. `relevant` are the tracks assessed.

    Members are avoided at once, because their volumes are small, and so are obstacles: they will not turn
    away. So is all traffic where the mission bends soon: a row begun later is flown straight first.
    """
    context, assessment = conflict.context, conflict.assessment
    if not _is_straight(context.own, assessment.mission_path_m, reserve_s):
        return False
    for track, in_conflict in zip(relevant, assessment.conflict.tolist(), strict=True):
        if in_conflict and (track.is_member or track.kind is TrafficKind.OBSTACLE):
            return False
    envelope = replace(context.envelope, response_s=context.envelope.response_s + reserve_s)
    later = outer.evaluate(conflict._replace(context=context._replace(envelope=envelope)))
    if later.closest[later.best] < 1.0 or not later.best_is_allowed(context.refusals):
        return False
    now = outer.evaluate(conflict)
    return bool(later.cost[later.best] <= now.cost[now.best] + context.weights.later)


def _is_straight(state: OwnState, mission_path_m: Array, until_s: float) -> bool:
    """Whether the mission, flown ahead north and east (T, 2), goes straight on from here until then."""
    if not len(mission_path_m):
        return True
    index = index_at(until_s)
    ahead_s, (north_mps, east_mps) = float(TIMES_S[index]), state.ground_mps
    straight_m = state.position_m[0] + north_mps * ahead_s, state.position_m[1] + east_mps * ahead_s
    return math.dist(straight_m, mission_path_m[index].tolist()) <= _STRAIGHT_M
