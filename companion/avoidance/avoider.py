"""The avoider: two layers, one decision, and all state between decisions (cones entered, guidance flown).

A number that cannot be real is left out, not the aircraft: one that is left out would be flown through. Only
without a position there is nothing to avoid.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from companion.avoidance.assess import (
    TrafficAssessment,
    assess_traffic,
    needs_no_assessment,
    protected_tracks,
    reason,
    threats_of,
)
from companion.avoidance.blocked_item import guidance_past, keeps_clear
from companion.avoidance.constraints import Constraints, Refusals
from companion.avoidance.cost import Conflict, conflict_context, return_context
from companion.avoidance.fence import Fence
from companion.avoidance.group.cooperation import Cooperation, describe_member
from companion.avoidance.inner import InnerLayer
from companion.avoidance.intruders import Tracks, TransitionDomain
from companion.avoidance.mission_path import HeightReference, OwnFlight, mission_path, with_path
from companion.avoidance.params import AvoidanceParams
from companion.avoidance.policies import policy_of
from companion.avoidance.senses import Senses
from companion.avoidance.trajectory import Control, any_of
from companion.avoidance.waiting import can_wait
from companion.model import Decision, Goal, Guidance, Layer, Member, Ownship, Track, TrafficKind, Vec3

# Seconds of overtime in which the weight `unresolved` doubles, and the release margin is given up.
_OVERTIME_S = 10.0
# After that, this share of the margin itself is given up too, so that we follow no track along its edge.
_GIVEN_UP = 0.05
# The mission is judged for this long after its next position; in overtime, and this long after it, for less.
_BEYOND_S, _HURRIED_BEYOND_S, _HURRIED_S = 45.0, 4.0, 20.0
# This soon after an avoidance that lasted too long, the next one has no patience of its own.
_IMPATIENT_S: Final = 60.0
# Nothing is further away, faster, or climbs faster than this.
_FURTHEST_M, _FASTEST_MPS = 4.1e7, 1500.0
# A state of another time is taken as one of now.
_OLDEST_S: Final = 3600.0
# Aircraft in forward flight turn no faster; a number beyond the second one is no rate of turn.
_FASTEST_TURN_RADPS, _NO_TURN_RADPS = math.radians(20.0), 4.0
_LARGEST_UNCERTAINTY_M: Final = 1e6
_LARGEST_VOLUME_M: Final = 20_000.0
# Of an aircraft that this avoidance can fly.
_FASTEST_OWN_MPS, _STRONGEST_WIND_MPS = 400.0, 120.0


class Avoider:
    """Decides for one aircraft during one flight.

    The same inputs in the same order give the same decisions, bit for bit: there is no clock and no
    randomness. `envelope` and `fence` may be replaced at any time, as limits become known; the fence is in
    the same frame as everything else. `prefers_turns` is for an aircraft that is at risk when a pilot takes
    over in a climb or descent: another height is then flown only where a turn does not suffice.
    """

    def __init__(self, params: AvoidanceParams) -> None:
        self.params = params
        self.envelope = params.envelope
        self.fence: Fence | None = None
        self.prefers_turns = False
        self.may_wait = True  # not while we fly the aircraft already
        self._refusals = Refusals()
        self._height = HeightReference()
        self._bounded = params.envelope  # the envelope within the bound on changes of height
        self._lost: frozenset[Control] = frozenset()
        self._policy = policy_of(params)
        self._domain = TransitionDomain(self._policy.outer.widening_rad)
        self._inner = InnerLayer(params.controls)
        self.senses = Senses()
        self._cooperation = self._made_cooperation()
        self._answered = False  # the last decision was our part of an agreed answer
        self._last_guidance: Guidance | None = None
        self._last_layer = Layer.CLEAR
        self._clear_since_s: float | None = None
        self._avoiding_since_s: float | None = None
        self._hurried_s = -math.inf  # the last time of an avoidance that lasted too long

    def retune(self, params: AvoidanceParams) -> None:
        """Use other parameters from now on. The conflict at hand goes on, and the envelope stays."""
        self.params = params
        controls = params.controls - self._lost
        self._policy = policy_of(replace(params, controls=controls), self._lost)
        self._domain.delta_beta_rad = self._policy.outer.widening_rad
        self._inner.retune(controls)
        if self._cooperation is None:
            self._cooperation = self._made_cooperation()
        else:
            self._cooperation.retune(params.formation, params.release_margin, enabled=self._may_cooperate)

    @property
    def _may_cooperate(self) -> bool:
        """Whether joint responses can be flown: they rely on every control of every member."""
        return self._policy.layers.cooperates and not self._lost

    def _made_cooperation(self) -> Cooperation | None:
        """Our part in the group; `None` without one."""
        if not self.params.formation.configured:
            return None
        margin = self.params.release_margin
        return Cooperation(self.params.formation, margin, enabled=self._may_cooperate)

    def withhold(self, lost: frozenset[Control]) -> None:
        """Use only rows without these controls, which cannot be flown at present."""
        if lost != self._lost:
            self._lost = lost
            self.retune(self.params)

    def refuse(self, control: Control, value: float, now_s: float) -> None:
        """Note that the autopilot refused a course [rad], an airspeed [m/s] or a height [m].

        For a while, no row with this value or nearly this value is flown if there is another row.
        """
        self._refusals = self._refusals.adding(control, value, now_s)

    def reset(self) -> None:
        """Forget the conflict at hand, because the aircraft is out of our hands. Refusals are remembered."""
        self._forget_conflict()
        if self._cooperation is not None:
            self._cooperation.reset()

    def member(self, own: Ownship, goal: Goal) -> Member:
        """Our goal and limits, for the other members of our group."""
        return describe_member(own, goal, self.envelope)

    def announced(self, own: Ownship, goal: Goal) -> Member:
        """The same with our intent, for members that agree before they answer."""
        member = self.member(own, goal)
        return member if self._cooperation is None else self._cooperation.announced(member)

    def join(self, own_id: str, *, answers: bool) -> None:
        """Our id in the group, and whether an answer of ours could be flown now."""
        if self._cooperation is not None:
            self._cooperation.own_id, self._cooperation.answers = own_id, answers

    def decide(self, now_s: float, own: Ownship, tracks: Sequence[Track], goal: Goal) -> Decision:
        """The decision at `now_s` for our aircraft among the tracks, in one north-east-down frame [m, m/s].

        The flow of §4.1, figure 6: the mission without a conflict, otherwise the outer or the inner layer.
        Tracks are extrapolated from their own time to `now_s`. Surface vehicles and tracks without a position
        are ignored, and of others the numbers that cannot be real. `ValueError` if ownship or goal is not
        finite: then no decision is safe.
        """
        require_finite(own, goal)
        if self._refusals.refused:
            self._refusals = self._refusals.at(now_s)
        own_id = "" if self._cooperation is None else self._cooperation.own_id
        own = credible_ownship(own, now_s)
        believed = [relevant_track(t, now_s) for t in tracks if not (own_id and t.track_id == own_id)]
        relevant = [track for track in believed if track is not None]
        flight = OwnFlight.at(now_s, own, goal)
        self._bound_heights(now_s, flight)
        beyond_s = self._beyond_s(now_s)
        if relevant and (flight.bends or (beyond_s < _BEYOND_S and flight.goal.position_m is not None)):
            flight = with_path(flight, self.envelope, beyond_s)
        if not relevant or (
            self._policy.has_fast_path
            and not flight.bends
            and needs_no_assessment(flight, now_s, relevant, self.params, self._domain)
        ):
            self._domain.reset()
            if self._cooperation is not None:
                self._cooperation.reset()
            return self._without_conflict(now_s, flight)
        assessment = self._assess(now_s, flight, relevant)
        if self._cooperation is not None and self._cooperation.enabled:
            joint = self._cooperation.joint_guidance(
                now_s, own, flight, relevant, assessment.tracks, assessment.conflict, self._constraints
            )
            if joint is not None and joint.guidance is not None:
                members = assessment._replace(conflict=joint.members)
                return self._fly_jointly(joint.guidance, flight, members, relevant)
            if joint is not None:
                assessment = assessment.without(joint.members)
                if not any_of(assessment.conflict) and self._answered:
                    self._forget_conflict()
        self._answered = False
        if not any_of(assessment.conflict):
            return self._noted(self._without_conflict(now_s, flight))
        return self._noted(self._avoid(now_s, flight, assessment, relevant))

    def _noted(self, decision: Decision) -> Decision:
        """The decision, known to the group as what we fly without having agreed on it."""
        if self._cooperation is not None:
            self._cooperation.note_flown(decision.guidance)
        return decision

    def _bound_heights(self, now_s: float, flight: OwnFlight) -> None:
        """Limit the heights to the permitted change, from the mission's heights."""
        own_m, change_m = -flight.state.position_m[2], self.params.largest_height_change_m
        mission_m = flight.mission_altitude_m
        self._height.update(now_s, own_m, mission_m, change_m, avoiding=self._last_guidance is not None)
        self._bounded = self._height.limit(self.envelope, mission_m, change_m)

    def _beyond_s(self, now_s: float) -> float:
        """How long the mission is judged after its next position.

        A waypoint is reached only in the autopilot's own mode. If traffic behind it kept us from giving the
        aircraft back, it would never be reached, and that traffic never passed.
        """
        if self._overtime(now_s) > 0.0:
            self._hurried_s = now_s
        return _HURRIED_BEYOND_S if 0.0 <= now_s - self._hurried_s <= _HURRIED_S else _BEYOND_S

    @property
    def _constraints(self) -> Constraints:
        return Constraints(self._bounded, self.fence, self._refusals, self.params.fence_look_ahead_turns)

    def _assess(self, now_s: float, flight: OwnFlight, relevant: Sequence[Track]) -> TrafficAssessment:
        """Measure the traffic; the release margin shrinks in overtime."""
        margin = max(self.params.release_margin * (1.0 - self._overtime(now_s)), -_GIVEN_UP)
        return assess_traffic(
            flight,
            protected_tracks(now_s, relevant, self.params),
            self.params,
            self._bounded,
            self._policy,
            self._domain,
            release_margin=None if self._last_guidance is None else margin,
        )

    def _overtime(self, now_s: float) -> float:
        """0 until an avoidance has lasted `patience_s`; then it grows by 1 every `_OVERTIME_S`."""
        if self._avoiding_since_s is None:
            return 0.0
        return max(now_s - self._avoiding_since_s - self.params.patience_s, 0.0) / _OVERTIME_S

    def _avoid(
        self, now_s: float, flight: OwnFlight, assessment: TrafficAssessment, relevant: Sequence[Track]
    ) -> Decision:
        """The best row of the layer that decides."""
        self._clear_since_s = None
        if self._avoiding_since_s is None or now_s < self._avoiding_since_s:
            spent = 0.0 <= now_s - self._hurried_s <= _IMPATIENT_S
            self._avoiding_since_s = now_s - self.params.patience_s if spent else now_s
        constraints, last = self._constraints, self._last_that_can_be_flown(flight)
        past = self._guidance_past(now_s, flight, assessment)
        if past is not None and keeps_clear(past, flight, assessment, constraints):
            # To the mission's item above or below the tracks that block it.
            self._inner.reset()
            return self._decided(self._policy.layers.holding_layer, past, flight, assessment, relevant)
        if past is not None:
            flight = flight._replace(mission=replace(flight.mission, altitude_m=past.altitude_m))
        context = conflict_context(
            flight,
            assessment,
            self.params,
            constraints,
            wrong=self.senses.wrong_ways(now_s, flight.state, relevant, assessment),
            prefers_turns=self.prefers_turns,
            overtime=self._overtime(now_s),
        )
        conflict = Conflict(
            context,
            assessment,
            assessment.most_urgent(self.params.priced_tracks),
            None if last is None else constraints.envelope.within_limits(last),
        )
        if (
            last is None
            and self.may_wait
            and self._policy.layers.waits
            and can_wait(conflict, relevant, self._policy.outer, self.params.reserve_s)
        ):
            self._forget_conflict()
            found = threats_of(assessment, relevant, self.params.priced_tracks)
            words = f"no need to avoid {found[0].name} yet"
            return Decision(Layer.CLEAR, because=words, awaited=found)
        layer, rows = self._policy.layers.choose(conflict, self._policy.outer, self._inner, self._last_layer)
        if self._last_layer is Layer.INNER and layer is not Layer.INNER:
            self._inner.reset()
        return self._decided(layer, rows.best_guidance, flight, assessment, relevant)

    def _guidance_past(
        self, now_s: float, flight: OwnFlight, assessment: TrafficAssessment
    ) -> Guidance | None:
        """In overtime, the guidance above or below a track that blocks the mission's item; `None` if none."""
        if self._overtime(now_s) <= 0.0 or Control.HEIGHT not in self.params.controls - self._lost:
            return None
        return guidance_past(flight, assessment, self._bounded)

    def _last_that_can_be_flown(self, flight: OwnFlight) -> Guidance | None:
        """The last guidance, with the mission's value in place of each one whose control is lost since."""
        last, mission = self._last_guidance, flight.mission
        if last is None or not self._lost:
            return last
        return Guidance(
            mission.course_rad if Control.HEADING in self._lost else last.course_rad,
            mission.airspeed_mps if Control.SPEED in self._lost else last.airspeed_mps,
            mission.altitude_m if Control.HEIGHT in self._lost else last.altitude_m,
        )

    def _decided(
        self,
        layer: Layer,
        guidance: Guidance,
        flight: OwnFlight,
        assessment: TrafficAssessment,
        relevant: Sequence[Track],
    ) -> Decision:
        """The decision for a guidance, which is remembered."""
        self._last_layer, self._last_guidance = layer, guidance
        found = threats_of(assessment, relevant, self.params.priced_tracks)
        return Decision(layer, guidance, found, reason(found[0], guidance, flight.state))

    def _fly_jointly(
        self,
        guidance: Guidance,
        flight: OwnFlight,
        assessment: TrafficAssessment,
        relevant: Sequence[Track],
    ) -> Decision:
        """Our part of the joint response, held like any other guidance when the conflict is over."""
        self._forget_conflict()
        self._answered = True
        found = threats_of(assessment, relevant, self.params.priced_tracks)
        nearest_m = min((threat.distance_m for threat in found), default=math.inf)
        near = nearest_m < self.params.formation.separation_m
        self._last_layer, self._last_guidance = Layer.INNER if near else Layer.OUTER, guidance
        # None is left where the others have become unable to answer since it was agreed.
        words = "group: " + (reason(found[0], guidance, flight.state) if found else "as agreed")
        return Decision(self._last_layer, guidance, found, words)

    def _without_conflict(self, now_s: float, flight: OwnFlight) -> Decision:
        """Hold the last guidance for a while, return along the fence if needed, then fly the mission."""
        if self._last_guidance is None:
            self._forget_conflict()
            return Decision(Layer.CLEAR, because="no conflict")
        if self._clear_since_s is None or now_s < self._clear_since_s:
            self._clear_since_s = now_s
        params, constraints = self.params, self._constraints
        waited_s, last = now_s - self._clear_since_s, constraints.envelope.within_limits(self._last_guidance)
        if waited_s < params.release_after_s and constraints.allow(last, flight.state):
            return self._hold(last, "clear of conflict, waiting before the return")
        if waited_s < params.return_within_s and not self._mission_keeps_fence(flight):
            context = return_context(flight, params, constraints, prefers_turns=self.prefers_turns)
            rows = self._inner.evaluate_table(context, Tracks.none(), last)
            return self._hold(rows.best_guidance, "clear of conflict, returning along the fence")
        self._forget_conflict()
        return Decision(Layer.CLEAR, because="clear of conflict")

    def _mission_keeps_fence(self, flight: OwnFlight) -> bool:
        """Whether the mission keeps the fence until its next position, or without one, for the look-ahead."""
        constraints, until_s = self._constraints, flight.time_to_goal_s
        if flight.goal.position_m is None:
            until_s = constraints.fence_look_ahead_s(flight.state)
        if constraints.fence is not None and (flight.bends or flight.beside is not None):
            paths = mission_path(flight, constraints.envelope)
            return not constraints.fence.breach(paths, until_s, until_s).deepest_m.any()
        mission = constraints.envelope.within_limits(flight.mission)
        return constraints.keeps_fence(mission, flight.state, until_s)

    def _hold(self, guidance: Guidance, words: str) -> Decision:
        """A guidance without a conflict, before the return to the mission."""
        self._last_layer, self._last_guidance = self._policy.layers.holding_layer, guidance
        self._inner.reset()
        return Decision(self._last_layer, guidance, (), words)

    def _forget_conflict(self) -> None:
        self._domain.reset()
        self._inner.reset()
        self._last_guidance = None
        self._last_layer = Layer.CLEAR
        self._clear_since_s = None
        self._avoiding_since_s = None


def require_finite(own: Ownship, goal: Goal) -> None:
    """Raise `ValueError` if ownship or goal is not finite: then no decision is safe."""
    numbers = [own.time_s, *own.position_m, *own.velocity_mps, own.airspeed_mps, own.heading_rad]
    numbers += [*(own.wind_mps or ()), *(goal.position_m if goal.position_m is not None else ())]
    numbers += [*(goal.leg_from_m or ()), *(goal.then_m or ())]
    values = goal.course_rad, goal.airspeed_mps, goal.altitude_m, goal.loiter_radius_m
    numbers += [x for x in values if x is not None]
    if not all(map(math.isfinite, numbers)):
        raise ValueError("ownship or goal is not finite")


def relevant_track(track: Track, now_s: float) -> Track | None:
    """The track without numbers that cannot be real; `None` for a surface vehicle or without a position."""
    if track.kind is TrafficKind.SURFACE_VEHICLE:
        return None
    north_m, east_m, down_m = track.position_m
    # Comparisons with NaN are false.
    if not (
        -_FURTHEST_M < north_m < _FURTHEST_M
        and -_FURTHEST_M < east_m < _FURTHEST_M
        and -_FURTHEST_M < down_m < _FURTHEST_M
    ):
        return None
    north_mps, east_mps, down_mps = track.velocity_mps
    if (
        -_FASTEST_MPS < north_mps < _FASTEST_MPS
        and -_FASTEST_MPS < east_mps < _FASTEST_MPS
        and -_FASTEST_MPS < down_mps < _FASTEST_MPS
        and -_FASTEST_TURN_RADPS <= track.turn_radps <= _FASTEST_TURN_RADPS
        and -_OLDEST_S <= now_s - track.time_s <= _OLDEST_S
        and 0.0 <= track.vertical_uncertainty_m <= _LARGEST_UNCERTAINTY_M
        and track.protected_horizontal_m is None
        and track.protected_vertical_m is None
    ):
        return track
    return _repaired(track, now_s)


def _repaired(track: Track, now_s: float) -> Track:
    is_now = not -_OLDEST_S <= now_s - track.time_s <= _OLDEST_S
    uncertain_m = track.vertical_uncertainty_m
    return replace(
        track,
        time_s=now_s if is_now else track.time_s,
        velocity_mps=track.velocity_mps if _is_velocity(track.velocity_mps) else (0.0, 0.0, 0.0),
        turn_radps=_turn_radps(track.turn_radps),
        vertical_uncertainty_m=min(max(uncertain_m, 0.0), _LARGEST_UNCERTAINTY_M)
        if uncertain_m > 0.0
        else 0.0,
        protected_horizontal_m=_volume_m(track.protected_horizontal_m),
        protected_vertical_m=_volume_m(track.protected_vertical_m),
    )


def _is_velocity(velocity_mps: Vec3) -> bool:
    return all(-_FASTEST_MPS < one < _FASTEST_MPS for one in velocity_mps)


def _turn_radps(turn_radps: float) -> float:
    """A rate of turn, limited; 0 if it is none."""
    if not abs(turn_radps) <= _NO_TURN_RADPS:
        return 0.0
    return min(max(turn_radps, -_FASTEST_TURN_RADPS), _FASTEST_TURN_RADPS)


def _volume_m(size_m: float | None) -> float | None:
    """The size of a protected volume; `None`, the usual one, if it cannot be meant."""
    return size_m if size_m is not None and 0.0 <= size_m <= _LARGEST_VOLUME_M else None


def credible_ownship(own: Ownship, now_s: float) -> Ownship:
    """Ownship without numbers that cannot be real: instead, speed over ground, no wind, the time now."""
    airspeed_mps, wind_mps, time_s = own.airspeed_mps, own.wind_mps, own.time_s
    if (
        0.0 <= airspeed_mps <= _FASTEST_OWN_MPS
        and -_OLDEST_S <= now_s - time_s <= _OLDEST_S
        and (wind_mps is None or math.hypot(*wind_mps) <= _STRONGEST_WIND_MPS)
        and _is_velocity(own.velocity_mps)
    ):
        return own
    velocity_mps = own.velocity_mps if _is_velocity(own.velocity_mps) else (0.0, 0.0, 0.0)
    return replace(
        own,
        time_s=time_s if -_OLDEST_S <= now_s - time_s <= _OLDEST_S else now_s,
        velocity_mps=velocity_mps,
        # Without an airspeed, that over ground is used.
        airspeed_mps=airspeed_mps if 0.0 <= airspeed_mps <= _FASTEST_OWN_MPS else 0.0,
        wind_mps=None if wind_mps is None or math.hypot(*wind_mps) > _STRONGEST_WIND_MPS else wind_mps,
    )
