"""Inner layer: emergencies (paper §3.2.3). The whole strategy table is flown ahead; the cheapest row wins."""

from collections.abc import Set
from typing import NamedTuple

from companion.avoidance.cost import Conflict, CostContext, EvaluatedRows, evaluate_rows
from companion.avoidance.envelope import Control, Pace
from companion.avoidance.reactive_rules import heading_rule_rad, speed_rule
from companion.avoidance.strategies import StrategyTable
from companion.avoidance.tracks import Tracks
from companion.model import Guidance


class _Rule(NamedTuple):
    """The reactive rules against one track."""

    track_id: str
    course_rad: float
    pace: Pace


class InnerLayer:
    """The strategy table, and the memory of the reactive rules.

    Applied again to a course that it has caused, the heading rule (eq. 11) would lead round the threat for
    ever. So its course is fixed when a threat becomes the nearest, for as long as it is the nearest.
    """

    def __init__(self, controls: Set[Control]) -> None:
        self._rule: _Rule | None = None
        self.retune(controls)

    def retune(self, controls: Set[Control]) -> None:
        """Use only rows with these controls from now on."""
        self._table = StrategyTable.within(frozenset(controls))

    def reset(self) -> None:
        """Forget the threat that the rules were applied to."""
        self._rule = None

    def evaluate(self, conflict: Conflict) -> EvaluatedRows:
        """The table priced against the most urgent tracks."""
        self._rule = rule = self._rule_for(conflict)
        context = conflict.context._replace(rule_course_rad=rule.course_rad, rule_pace=rule.pace)
        return self.evaluate_table(context, conflict.urgent, conflict.last_guidance)

    def evaluate_table(
        self, context: CostContext, tracks: Tracks, last_guidance: Guidance | None
    ) -> EvaluatedRows:
        """The table priced in a context that has the rules; the last guidance, if any, is row 0."""
        return evaluate_rows(context, self._table.commands(context), tracks, last_guidance)

    def _rule_for(self, conflict: Conflict) -> _Rule:
        """Eq. 11 and 13 against the nearest threat."""
        state, (tracks, motion) = conflict.context.own, conflict.assessment[:2]
        nearest = conflict.assessment.nearest
        track_id = tracks.ids[nearest]
        rel_m, other_mps, own_mps = (
            motion.position_m[nearest],
            tracks.velocity_mps[nearest],
            state.velocity_mps,
        )
        pace = speed_rule(rel_m, other_mps, own_mps)
        if self._rule is not None and self._rule.track_id == track_id:
            return self._rule._replace(pace=pace)
        return _Rule(track_id, heading_rule_rad(state.course_rad, rel_m, other_mps, own_mps), pace)
