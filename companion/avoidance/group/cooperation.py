"""Cooperation: whether our group answers a conflict jointly, and with which guidance."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from companion.avoidance.constraints import Constraints
from companion.avoidance.group.agreement import Agreement, CountedPlans, Plan, is_same
from companion.avoidance.group.formation import (
    FormationParams,
    MemberState,
    group_around,
    is_valid,
    table_of,
)
from companion.avoidance.group.joint_table import (
    RESPONSES,
    JointResponse,
    envelope_of,
    joint_response,
    mission_of,
    mission_path_of,
    pair_distances,
    paths_of,
)
from companion.avoidance.intruders import Tracks, separation
from companion.avoidance.mission_path import OwnFlight
from companion.avoidance.trajectory import Array, Commands, Envelope, Mask, OwnState, fly_ahead, position_at
from companion.geodesy import wrap_pi, wrap_two_pi
from companion.model import Goal, Guidance, Member, Ownship, Track

# A conflict this near is left to the two layers: there is no time for agreement.
_URGENT_S = 8.0
# Another own answer is proposed only if it keeps this much more distance.
_BETTER_M = 10.0
# An answer that leads more directly to the goal is proposed if it does so by this much, and not sooner.
# An answer is flown for at least this long.
_LEAST_ANSWER_S = 6.0
_SHORTER_RAD, _CALM_S = math.radians(12.0), 3.0


def describe_member(own: Ownship, goal: Goal, envelope: Envelope) -> Member:
    """Describe us to the other members: our goal, within what we can fly, and our limits."""
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


class Situation(NamedTuple):
    """What a joint answer depends on, besides the members: our flight, strangers (N of them), and limits."""

    now_s: float
    flight: OwnFlight
    strangers: Tracks
    constraints: Constraints


class JointGuidance(NamedTuple):
    """Our part of the answer, `None` for the mission, and which tracks are kept clear of by it, (N,)."""

    guidance: Guidance | None
    members: Mask


class Cooperation:
    """Our part in the group. `own_id` is "" without one; `answers`: whether an answer would be flown."""

    def __init__(self, params: FormationParams, release_margin: float, *, enabled: bool) -> None:
        self.own_id = params.own_id
        self.answers = True
        self._answering = False
        self._agreement = Agreement()
        self.retune(params, release_margin, enabled=enabled)

    def retune(self, params: FormationParams, release_margin: float, *, enabled: bool) -> None:
        """Use these parameters from now on; a conflict at hand continues."""
        self._params, self._release_margin = params, release_margin
        self._allowed = enabled and params.configured

    @property
    def enabled(self) -> bool:
        """Whether there is a group to answer with."""
        return self._allowed and bool(self.own_id)

    def reset(self) -> None:
        """Forget the conflict at hand."""
        self._answering = False
        self._agreement.reset()

    def note_flown(self, guidance: Guidance | None) -> None:
        """Note what is flown where it was not agreed."""
        self._agreement.override(guidance)

    def announced(self, member: Member) -> Member:
        """Our description with our intent, for the other members."""
        answers = self.enabled and self.answers
        return replace(member, intent=self._agreement.intent(answers=answers), member_id=self.own_id)

    def joint_guidance(
        self,
        now_s: float,
        own: Ownship,
        flight: OwnFlight,
        tracks: Sequence[Track],
        predicted: Tracks,
        conflict: Mask,
        constraints: Constraints,
    ) -> JointGuidance | None:
        """Our part of the joint answer; `None` if there is none.

        `predicted` holds the tracks as assessed, and `conflict` (N,) whether each is in conflict, both in the
        order of `tracks`. A conflict with a stranger comes first: then there is no joint answer.
        """
        others = _members_among(tracks, now_s)
        if not others:
            self._agreement.reset()
            return None
        ours = MemberState(
            self.own_id,
            flight.state.position_m,
            own.velocity_mps,
            describe_member(own, flight.goal, constraints.envelope),
        )
        group = group_around([ours, *others], self._params.reach_m, self._params.group_within_s)
        announcing = [state for state in others if state.member.intent is not None]
        if not announcing:
            return self._at_once(group, tracks, predicted, conflict, flight, constraints)
        self._agreement.hear(announcing)
        if not self.answers:
            self._agreement.reset()
            return None
        ids = {state.member_id for state in group}
        near = [state for state in announcing if state.member_id in ids]
        return self._agreed(Situation(now_s, flight, predicted, constraints), ours, near, tracks, conflict)

    # --- members that know each other exactly

    def _at_once(
        self,
        group: Sequence[MemberState],
        tracks: Sequence[Track],
        predicted: Tracks,
        conflict: Mask,
        flight: OwnFlight,
        constraints: Constraints,
    ) -> JointGuidance | None:
        """Our part of the joint response, if it resolves the conflicts and may be flown."""
        self._answering, answering = False, self._answering
        response = joint_response(table_of(group), self._params)
        if response is None or response.closest_m < self._params.smallest_m:
            return None
        if not self._is_needed(response, answering=answering):
            return None
        members = np.array([_id_of(track) in response.guidance for track in tracks])
        part = constraints.envelope.within_limits(response.guidance[self.own_id])
        strangers = predicted.subset(np.flatnonzero(~members))
        self._answering = (
            not (conflict & ~members).any()
            and _keeps_clear(part, flight.state, strangers, constraints.envelope)
            and constraints.allow(part, flight.state)
        )
        return JointGuidance(part, members) if self._answering else None

    def _is_needed(self, response: JointResponse, *, answering: bool) -> bool:
        """Whether straight ways are too near; an answer that is flown ends only with some margin."""
        margin = 1.0 + self._release_margin if answering else 1.0
        return response.straight_closest_m < margin * self._params.influence_m

    # --- members that announce what they fly

    def _agreed(
        self,
        situation: Situation,
        ours: MemberState,
        others: Sequence[MemberState],
        tracks: Sequence[Track],
        conflict: Mask,
    ) -> JointGuidance | None:
        """What is agreed to be flown; in between, a better answer is looked for, proposed and settled."""
        agreement, params = self._agreement, self._params
        paths = _PlannedPaths(ours, others, params)
        urgent = paths.urgent(agreement.flown, agreement.counted(self.own_id, others), params.smallest_m)
        members = np.array([_answers(track) and _id_of(track) not in urgent for track in tracks], dtype=bool)
        if urgent or (conflict & ~members).any():
            return JointGuidance(None, members)
        strangers = situation.strangers.subset(np.flatnonzero(~members))
        situation = situation._replace(strangers=strangers)
        agreement.settle(
            situation.now_s, self.own_id, others, paths.is_acceptable_to(agreement), params.propose_for_s
        )
        if not agreement.pending:
            self._look_for_better(situation, ours, others, paths)
        flown = agreement.flown if agreement.agreed else None
        if flown is not None and not _may_be_flown(flown, situation):
            flown = None
        return JointGuidance(flown, members)

    def _look_for_better(
        self, situation: Situation, ours: MemberState, others: Sequence[MemberState], paths: "_PlannedPaths"
    ) -> None:
        """Propose another answer than the one flown, if one is needed or none is needed any more."""
        agreement, params = self._agreement, self._params
        counted = agreement.counted(self.own_id, others)
        flown_m = paths.nearest_m(agreement.flown, counted)
        if agreement.flown is None and flown_m >= params.influence_m:
            return
        if agreement.flown is not None:
            margin_m = (1.0 + self._release_margin) * params.influence_m
            lasted_s = situation.now_s - agreement.answering_since_s
            if lasted_s >= _LEAST_ANSWER_S and paths.nearest_m(None, counted) >= margin_m:
                agreement.propose(None, situation.now_s)
                return
            if flown_m >= params.separation_m:
                shorter = self._shorter(situation, ours, paths, counted)
                if shorter is not None:
                    agreement.propose(shorter, situation.now_s)
                return
        wanted = self._part_of_joint(situation, ours, others)
        if is_same(wanted, mission_of(ours)):
            wanted = None
        acceptable = paths.is_acceptable_to(agreement)
        if wanted is not None and not is_same(wanted, agreement.flown) and acceptable(wanted, counted):
            agreement.propose(wanted, situation.now_s)
            return
        alone = self._best_alone(situation, ours, paths, counted)
        if alone is not None and paths.nearest_m(alone, counted) > flown_m + _BETTER_M:
            agreement.propose(alone, situation.now_s)

    def _part_of_joint(
        self, situation: Situation, ours: MemberState, others: Sequence[MemberState]
    ) -> Guidance | None:
        """Our part of the joint response of all that answer; `None` if there is none that may be flown."""
        answering = [state for state in others if state.member.intent is None or state.member.intent.answers]
        described = replace(ours, member=self.announced(ours.member))
        response = joint_response(table_of([described, *answering]), self._params)
        if response is None:
            return None
        part = situation.constraints.envelope.within_limits(response.guidance[self.own_id])
        return part if _may_be_flown(part, situation) else None

    def _shorter(
        self, situation: Situation, ours: MemberState, paths: "_PlannedPaths", counted: CountedPlans
    ) -> Guidance | None:
        """Our response that leads more directly to the goal than what is flown and keeps the separation."""
        flown, mission_rad = self._agreement.flown, mission_of(ours).course_rad
        if flown is None or situation.now_s - self._agreement.flown_since_s < _CALM_S:
            return None
        aside_rad = abs(wrap_pi(flown.course_rad - mission_rad))
        wanted_m = self._params.separation_m + _BETTER_M
        rows = [
            guidance
            for guidance in _responses_of(ours, situation.constraints)
            if abs(wrap_pi(guidance.course_rad - mission_rad)) <= aside_rad - _SHORTER_RAD
        ]
        for guidance, distance_m in zip(rows, paths.nearest_of_m(rows, counted), strict=True):
            if distance_m >= wanted_m and _may_be_flown(guidance, situation):
                return guidance
        return None

    def _best_alone(
        self, situation: Situation, ours: MemberState, paths: "_PlannedPaths", counted: CountedPlans
    ) -> Guidance | None:
        """Our response that keeps the most distance, up to the separation, from all plans that count."""
        rows = _responses_of(ours, situation.constraints)
        distances_m = np.minimum(paths.nearest_of_m(rows, counted), self._params.separation_m)
        for _, guidance in sorted(zip(-distances_m, rows, strict=True), key=lambda one: float(one[0])):
            if _may_be_flown(guidance, situation):
                return guidance
        return None


def _responses_of(ours: MemberState, constraints: Constraints) -> list[Guidance]:
    """Our rows of the joint table, the mission's course first."""
    mission, envelope = mission_of(ours), envelope_of(ours.member)
    return [
        constraints.envelope.within_limits(
            Guidance(
                wrap_two_pi(mission.course_rad + row.beside_rad),
                envelope.airspeed_mps(row.pace, mission.airspeed_mps),
                mission.altitude_m,
            )
        )
        for row in RESPONSES
    ]


def _id_of(track: Track) -> str:
    """The id by which the members know this track."""
    return track.track_id if track.member is None else track.member.member_id or track.track_id


def _answers(track: Track) -> bool:
    """Whether the track is a member that announces what it flies, and could fly an answer."""
    intent = None if track.member is None else track.member.intent
    return intent is not None and intent.answers


def _members_among(tracks: Sequence[Track], now_s: float) -> list[MemberState]:
    states = [
        MemberState(_id_of(track), position_at(track, now_s), track.velocity_mps, track.member)
        for track in tracks
        if track.member is not None
    ]
    return [state for state in states if is_valid(state)]


def _may_be_flown(guidance: Guidance, situation: Situation) -> bool:
    """Whether limits, fence and strangers allow this guidance."""
    state, constraints = situation.flight.state, situation.constraints
    return constraints.allow(guidance, state) and _keeps_clear(
        guidance, state, situation.strangers, constraints.envelope
    )


def _keeps_clear(guidance: Guidance, state: OwnState, strangers: Tracks, envelope: Envelope) -> bool:
    """Whether the guidance keeps clear of all `strangers`, the tracks outside the group."""
    if len(strangers) == 0:
        return True
    kept = separation(fly_ahead(state, Commands.of([guidance]), envelope), strangers)
    return bool((kept.closest >= 1.0).all())


class _PlannedPaths:
    """Where the plans of all members lead, relative to us, each flown ahead once."""

    def __init__(self, ours: MemberState, others: Sequence[MemberState], params: FormationParams) -> None:
        self._ours, self._params = ours, params
        self._others = {state.member_id: state for state in others}
        self._centre_m = np.array(ours.position_m)
        self._known: dict[tuple[str, Plan], Array] = {}

    def _path(self, state: MemberState, plan: Plan) -> Array:
        """The path of a plan, (1, T, 3)."""
        key = state.member_id, plan
        if key not in self._known:
            horizon_s = self._params.horizon_s
            self._known[key] = (
                mission_path_of(state, self._centre_m, horizon_s)
                if plan is None
                else paths_of(state, Commands.of([plan]), self._centre_m, horizon_s)
            )
        return self._known[key]

    def _between_m(self, plan: Plan, member_id: str, theirs: Plan, until_s: float | None = None) -> float:
        """The smallest distance from another member, with these plans [m]."""
        one, other = self._path(self._ours, plan), self._path(self._others[member_id], theirs)
        if until_s is not None:
            count = int(until_s) + 1
            one, other = one[:, :count], other[:, :count]
        return float(pair_distances(one, other, self._params.reach_m)[1][0, 0])

    def by_member_m(self, plan: Plan, counted: CountedPlans) -> Mapping[str, float]:
        """The smallest distance from each other member, whichever of its plans it flies [m]."""
        return {
            member_id: min(self._between_m(plan, member_id, theirs) for theirs in plans)
            for member_id, plans in counted.items()
        }

    def nearest_m(self, plan: Plan, counted: CountedPlans) -> float:
        """The smallest distance from any other member [m]; inf without one."""
        return min(self.by_member_m(plan, counted).values(), default=math.inf)

    def nearest_of_m(self, rows: Sequence[Guidance], counted: CountedPlans) -> Array:
        """The smallest distance of each row from any other member, (R,) [m]."""
        nearest = np.full(len(rows), np.inf)
        if not rows:
            return nearest
        path_m = paths_of(self._ours, Commands.of(rows), self._centre_m, self._params.horizon_s)
        for member_id, plans in counted.items():
            theirs = np.concatenate([self._path(self._others[member_id], plan) for plan in plans])
            least = pair_distances(path_m, theirs, self._params.reach_m)[1]
            nearest = np.minimum(nearest, least.min(axis=1))
        return nearest

    def urgent(self, plan: Plan, counted: CountedPlans, smallest_m: float) -> set[str]:
        """The members that come too near before another answer could be agreed on."""
        return {
            member_id
            for member_id, plans in counted.items()
            if self._between_m(plan, member_id, plans[0], _URGENT_S) < smallest_m
        }

    def is_acceptable_to(self, agreement: Agreement) -> "_Check":
        """The check of proposals that would replace what is flown."""
        return _Check(self, agreement.flown, self._params.separation_m)


class _Check:
    """The check of a proposal: from no member less distance than the separation, or than now."""

    def __init__(self, paths: _PlannedPaths, flown: Plan, separation_m: float) -> None:
        self._paths, self._flown, self._separation_m = paths, flown, separation_m

    def __call__(self, plan: Plan, counted: CountedPlans) -> bool:
        """Whether this plan may replace what is flown."""
        now_m = self._paths.by_member_m(self._flown, counted)
        return all(
            distance_m >= min(self._separation_m, now_m[member_id])
            for member_id, distance_m in self._paths.by_member_m(plan, counted).items()
        )
