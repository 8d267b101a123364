"""The avoider: two layers, one decision, and all the memory there is (cones entered, guidance flown)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from companion.avoidance.assess import (
    Survey,
    flown_mps,
    horizon_s,
    matters,
    mission_mps,
    mission_of,
    moved,
    own_state,
    plainly_clear,
    refuse_nonsense,
    take,
    threats,
    tracks_at,
)
from companion.avoidance.cone import TransitionDomain
from companion.avoidance.control import Control
from companion.avoidance.cost import Priced, Situation, price
from companion.avoidance.cost_context import because, conflict, way_back
from companion.avoidance.envelope import Pace
from companion.avoidance.fence import Fence
from companion.avoidance.geometry import any_of
from companion.avoidance.group.formation import Answer, MemberState, group_of, is_sound, joint_response
from companion.avoidance.inner import emergency
from companion.avoidance.outer import OuterMethod, Threats, field_commands, resultant_command
from companion.avoidance.params import AvoidanceParams, Layers
from companion.avoidance.reactive_rules import heading_rule_rad, speed_rule
from companion.avoidance.refusals import Refusals
from companion.avoidance.strategies import StrategyTable
from companion.avoidance.trajectory import (
    HORIZON_S,
    Commands,
    OwnState,
    Tracks,
    fly_ahead,
    separation,
    turn_around_s,
)
from companion.model import Decision, Goal, Guidance, Layer, Member, Ownship, Track

# In so long, impatience makes what is left to pass count for as much again.
_IMPATIENT_IN_S = 10.0
# And then so much of the margin itself is given up for the return, lest we follow somebody along its edge.
_GIVEN_UP = 0.05


class Avoider:
    """Decides for one aircraft during one flight.

    The same inputs in the same order give the same decisions, bit for bit: there is no clock and no chance in
    here. `envelope` and `fence` may be replaced at any time, as limits become known; the fence is in the same
    frame as everything else, and moves with it. `spares_heights` where the aircraft is at risk when somebody
    else takes it in a climb or descent: then another height is flown only where a turn does not do.
    """

    def __init__(self, params: AvoidanceParams) -> None:
        self.params = params
        self.envelope = params.envelope
        self.fence: Fence | None = None
        self.spares_heights = False
        self._refusals = Refusals()
        self._domain = TransitionDomain(_domain_rad(params))
        self._table = StrategyTable.within(params.controls)
        self._held: Guidance | None = None
        self._layer = Layer.CLEAR
        self._rule: _Rule | None = None
        self._answering = False  # our group's conflict
        self._clear_since_s: float | None = None
        self._avoiding_since_s: float | None = None

    def retune(self, params: AvoidanceParams) -> None:
        """Other parameters from now on. The conflict at hand, and the envelope, stay what they are."""
        self.params = params
        self._domain.delta_beta_rad = _domain_rad(params)
        self._table = StrategyTable.within(params.controls)

    def refuse(self, control: Control, value: float, now_s: float) -> None:
        """The autopilot refused a course [rad], an airspeed [m/s] or a height [m] that was asked of it.

        For a while no row asks for it, or for nearly the same, while any other row is left.
        """
        self._refusals = self._refusals.noting(control, value, now_s)

    def reset(self) -> None:
        """Forget the conflict at hand: somebody else flies now. What the autopilot refused is remembered."""
        self._domain.reset()
        self._held = None
        self._layer = Layer.CLEAR
        self._rule = None
        self._answering = False
        self._clear_since_s = None
        self._avoiding_since_s = None

    def decide(self, now_s: float, own: Ownship, tracks: Sequence[Track], goal: Goal) -> Decision:
        """The decision at `now_s` for our aircraft among the tracks, in one north-east-down frame [m, m/s].

        The flow of §4.1, figure 6: the mission while nothing conflicts, else the outer layer or the inner
        one. Tracks are extrapolated from their own time to `now_s`. Surface vehicles never matter; a track
        that is not finite is passed over. An ownship or goal that is not finite is a `ValueError`: there is
        no safe answer to it.
        """
        refuse_nonsense(own, goal)
        self._refusals = self._refusals.at(now_s)
        own_id = self.params.formation.own_id
        relevant = [t for t in tracks if matters(t) and not (own_id and t.track_id == own_id)]
        state = own_state(now_s, own)
        mission = mission_of(state, own, goal)
        onward_mps = mission_mps(state, mission)
        if not relevant or (
            not own_id and plainly_clear(state, onward_mps, now_s, relevant, self.params, self._domain)
        ):
            self._domain.reset()
            return self._without_conflict(now_s, state, mission, goal)
        survey = take(
            state,
            mission,
            onward_mps,
            tracks_at(now_s, relevant, self.params, goal),
            self.params,
            self.envelope,
            self._domain,
            horizon_s=horizon_s(state, mission, goal),
            spare=max(self.params.release_margin * (1.0 - self._impatience(now_s)), -_GIVEN_UP),
            avoiding=self._held is not None,
        )
        answer = self._group_answer(now_s, own, relevant, goal)
        if answer is not None:
            grouped = np.array([track.track_id in answer.guidance for track in relevant])
            if not (survey.conflict & ~grouped).any() and self._keeps_clear(answer, state, survey, ~grouped):
                return self._answered(answer, state, survey._replace(conflict=grouped), relevant)
        self._answering = False
        if not any_of(survey.conflict):
            return self._without_conflict(now_s, state, mission, goal)
        self._clear_since_s = None
        return self._avoid(now_s, state, mission, survey, relevant, goal)

    def member(self, own: Ownship, goal: Goal) -> Member:
        """What the other members of our group are to know of us: what we want within what we can."""
        envelope = self.envelope
        airspeed_mps = own.airspeed_mps if goal.airspeed_mps is None else goal.airspeed_mps
        altitude_m = goal.altitude_m
        if altitude_m is None:
            altitude_m = -(own.position_m if goal.position_m is None else goal.position_m)[2]
        wanted = replace(
            goal,
            airspeed_mps=envelope.clamp_airspeed_mps(airspeed_mps),
            altitude_m=envelope.clamp_altitude_m(altitude_m),
        )
        rate_radps = envelope.turn_rate_radps(envelope.clamp_airspeed_mps(airspeed_mps))
        return Member(wanted, envelope.min_airspeed_mps, envelope.max_airspeed_mps, rate_radps)

    def _group_answer(
        self, now_s: float, own: Ownship, relevant: Sequence[Track], goal: Goal
    ) -> Answer | None:
        """The joint response of our group, if it is in conflict and the response keeps its members apart."""
        params = self.params.formation
        if not (params.own_id and params.cooperate and self.params.layers is Layers.BOTH):
            return None
        states = [
            MemberState(track.track_id, moved(track, now_s), track.velocity_mps, track.member)
            for track in relevant
            if track.member is not None
        ]
        states = [state for state in states if is_sound(state)]
        if not states:
            return None
        ours = MemberState(params.own_id, moved(own, now_s), own.velocity_mps, self.member(own, goal))
        answer = joint_response(group_of([ours, *states], params.reach_m), params)
        if answer is None or answer.closest_m < params.smallest_m:
            return None
        margin = 1.0 + self.params.release_margin if self._answering else 1.0
        return answer if answer.unanswered_m < margin * params.influence_m else None

    def _keeps_clear(
        self, answer: Answer, state: OwnState, survey: Survey, others: NDArray[np.bool_]
    ) -> bool:
        """Whether our part of the joint response may be flown, and keeps clear of those not of the group."""
        part = self._within_limits(answer.guidance[self.params.formation.own_id])
        strangers = survey.tracks.subset(np.flatnonzero(others))
        if len(strangers) > 0:
            kept = separation(fly_ahead(state, Commands.of([part]), self.envelope), strangers)
            if not (kept.closest >= 1.0).all():
                return False
        return self._may_fly(part, state)

    def _may_fly(self, guidance: Guidance, state: OwnState) -> bool:
        """Whether a guidance keeps to the fence, and the autopilot did not refuse it."""
        ahead_s = self._fence_look_ahead_s(state)
        return self._refusals.allow(guidance) and self._keeps_fence(guidance, state, ahead_s)

    def _keeps_fence(self, guidance: Guidance, state: OwnState, until_s: float) -> bool:
        if self.fence is None:
            return True
        paths = fly_ahead(state, Commands.of([guidance]), self.envelope)
        return not self.fence.breach(paths, until_s, until_s).deepest_m.any()

    def _bounded(self, situation: Situation) -> Situation:
        """The same within the fence, without what was refused, heights spared where that is safer."""
        if situation.spares_heights is not self.spares_heights:
            situation = situation._replace(spares_heights=self.spares_heights)
        if self.fence is None and not self._refusals.refused:
            return situation
        ahead_s = self._fence_look_ahead_s(situation.own)
        return situation._replace(fence=self.fence, fence_look_ahead_s=ahead_s, refusals=self._refusals)

    def _fence_look_ahead_s(self, state: OwnState) -> float:
        return min(self.params.fence_look_ahead_turns * turn_around_s(state, self.envelope), HORIZON_S)

    def _answered(
        self, answer: Answer, state: OwnState, survey: Survey, relevant: Sequence[Track]
    ) -> Decision:
        """Our part of the joint response; held like any other guidance when the conflict is over."""
        params = self.params.formation
        self.reset()
        guidance = self._within_limits(answer.guidance[params.own_id])
        found = threats(survey, relevant, self.params.priced_tracks)
        near = min(threat.distance_m for threat in found) < params.separation_m
        self._answering, self._held = True, guidance
        self._layer = Layer.INNER if near else Layer.OUTER
        return Decision(self._layer, guidance, found, "group: " + because(found[0], guidance, state))

    def _within_limits(self, guidance: Guidance) -> Guidance:
        """The same guidance within limits that may have become known since, or that others do not know."""
        return Guidance(
            guidance.course_rad,
            self.envelope.clamp_airspeed_mps(guidance.airspeed_mps),
            self.envelope.clamp_altitude_m(guidance.altitude_m),
        )

    def _without_conflict(self, now_s: float, state: OwnState, mission: Guidance, goal: Goal) -> Decision:
        """The mission again: after a while, and where the fence leaves a straight way back to it."""
        if self._held is None:
            self.reset()
            return Decision(Layer.CLEAR, because="no conflict")
        if self._clear_since_s is None or now_s < self._clear_since_s:
            self._clear_since_s = now_s
        waited_s, held = now_s - self._clear_since_s, self._within_limits(self._held)
        if waited_s < self.params.release_after_s and self._may_fly(held, state):
            return self._holding(held, "clear of conflict, holding before the return")
        if waited_s < self.params.return_within_s and not self._leads_back(state, mission, goal):
            situation = self._bounded(way_back(state, mission, self.params, self.envelope))
            priced = price(situation, self._table.commands(situation), Tracks.none(), held)
            return self._holding(
                priced.commands.row(priced.best()), "clear of conflict, back along the fence"
            )
        self.reset()
        return Decision(Layer.CLEAR, because="clear of conflict")

    def _holding(self, guidance: Guidance, words: str) -> Decision:
        self._layer = Layer.INNER if self.params.layers is Layers.INNER else Layer.OUTER
        self._held, self._rule = guidance, None
        return Decision(self._layer, guidance, (), words)

    def _leads_back(self, state: OwnState, mission: Guidance, goal: Goal) -> bool:
        """Whether the mission keeps to the fence, straight on to its next position if it has one."""
        ahead_s = self._fence_look_ahead_s(state)
        if goal.position_m is not None:
            ahead_s = horizon_s(state, mission, replace(goal, is_end=True))
        return self._keeps_fence(self._within_limits(mission), state, ahead_s)

    def _avoid(
        self,
        now_s: float,
        state: OwnState,
        mission: Guidance,
        survey: Survey,
        relevant: list[Track],
        goal: Goal,
    ) -> Decision:
        if self._avoiding_since_s is None or now_s < self._avoiding_since_s:
            self._avoiding_since_s = now_s
        if self._held is not None:
            self._held = self._within_limits(self._held)
        situation = self._bounded(conflict(state, mission, survey, goal, self.params, self.envelope))
        impatience = self._impatience(now_s)
        if impatience > 0.0:
            situation = situation._replace(impatience=impatience)
        pressing = survey.pressing(self.params.priced_tracks)
        layer, priced = self._priced(situation, survey, pressing)
        best = priced.best()
        self._layer, self._held = layer, priced.commands.row(best)
        if layer is not Layer.INNER:
            self._rule = None
        found = threats(survey, relevant, self.params.priced_tracks)
        return Decision(layer, self._held, found, because(found[0], self._held, state))

    def _impatience(self, now_s: float) -> float:
        """0 while an avoidance has not lasted too long; from then on it grows by 1 in `_IMPATIENT_IN_S`."""
        if self._avoiding_since_s is None:
            return 0.0
        return max(now_s - self._avoiding_since_s - self.params.patience_s, 0.0) / _IMPATIENT_IN_S

    def _priced(self, situation: Situation, survey: Survey, pressing: Tracks) -> tuple[Layer, Priced]:
        """The layer that decides, and its rows.

        The paper's inner layer takes over by distance (§2.3). What flies by default leaves a near threat to
        the outer layer as long as that keeps clear, and lets the inner layer go on until the margin is there
        again, so that the layers do not flicker; the inner layer also takes over when the field has no way,
        or none within the fence.
        """
        params, near = self.params, any_of(survey.emergency)
        if params.layers is Layers.INNER:
            return Layer.INNER, self._inner(situation, survey, pressing)
        if params.outer_method is not OuterMethod.PRICED:
            if near and params.layers is Layers.BOTH:
                return Layer.INNER, self._inner(situation, survey, pressing)
            priced = self._resultant(situation, survey, pressing)
            if params.layers is Layers.OUTER or self._is_open(priced, situation):
                return Layer.OUTER, priced
            return Layer.INNER, self._inner(situation, survey, pressing)
        if params.layers is Layers.OUTER:
            return Layer.OUTER, self._field(situation, survey, pressing)
        if near and params.clears_inner_layer:
            return Layer.INNER, self._inner(situation, survey, pressing)
        if near and self._layer is Layer.INNER:
            priced = self._inner(situation, survey, pressing)
            kept = priced.closest[priced.best()] >= 1.0
            return Layer.OUTER if kept else Layer.INNER, priced
        if self._layer is not Layer.CLEAR or not near:
            priced = self._field(situation, survey, pressing)
            if priced.closest[priced.best()] >= situation.lost and self._is_open(priced, situation):
                return Layer.OUTER, priced
        return Layer.INNER, self._inner(situation, survey, pressing)

    @staticmethod
    def _is_open(priced: Priced, situation: Situation) -> bool:
        """Whether the best row keeps to the fence, and asks for nothing that was refused."""
        best = priced.best()
        return bool(priced.contained[best]) and situation.refusals.allow(priced.commands.row(best))

    def _inner(self, situation: Situation, survey: Survey, pressing: Tracks) -> Priced:
        self._rule = self._ruled(situation.own, survey)
        ruled = situation._replace(rule_course_rad=self._rule.course_rad, rule_pace=self._rule.pace)
        return emergency(ruled, self._table, pressing, self._held)

    def _field(self, situation: Situation, survey: Survey, pressing: Tracks) -> Priced:
        rows = field_commands(
            situation,
            _repelling(survey),
            self.params.field_gains,
            heights=Control.HEIGHT in self.params.controls,
            speeds=situation.impatience > 0.0 and Control.SPEED in self.params.controls,
        )
        return price(situation, rows, pressing, self._held)

    def _resultant(self, situation: Situation, survey: Survey, pressing: Tracks) -> Priced:
        row = resultant_command(situation, _repelling(survey), self.params.field_gains)
        return price(situation, row, pressing, held=None)

    def _ruled(self, state: OwnState, survey: Survey) -> "_Rule":
        """The rules of eq. 11 and 13 against the nearest threat.

        Applied anew to the course that it has itself brought about, eq. 11 leads round the threat for ever;
        so its course stays as it was when that threat became the nearest, for as long as it is.
        """
        nearest = survey.nearest
        track_id = survey.tracks.ids[nearest]
        rel, other = survey.motion.position_m[nearest], survey.tracks.velocity_mps[nearest]
        own_mps = flown_mps(state)
        pace = speed_rule(rel, other, own_mps)
        if self._rule is not None and self._rule.track_id == track_id:
            return _Rule(track_id, self._rule.course_rad, pace)
        course_rad = heading_rule_rad(state.course_rad, rel, other, own_mps)
        return _Rule(track_id, course_rad, pace)


def _domain_rad(params: AvoidanceParams) -> float:
    """How much wider the cone is for whoever is in it, where the method knows of that."""
    has_domain = params.outer_method in (OuterMethod.TRANSITION, OuterMethod.PRICED)
    return params.delta_beta_rad if has_domain else 0.0


@dataclass(frozen=True, slots=True)
class _Rule:
    """What the rules ask for against one track."""

    track_id: str
    course_rad: float
    pace: Pace


def _repelling(survey: Survey) -> Threats:
    motion, conflict = survey.motion, survey.conflict
    every = Threats(motion.position_m, motion.own_velocity_mps, survey.surface_m, survey.outer_reach_m)
    if np.count_nonzero(conflict) == len(conflict):
        return every  # as mostly: there is one
    return Threats(*(column[conflict] for column in every))
