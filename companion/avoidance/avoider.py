"""The avoider: two layers, one decision, and all the memory there is (cones entered, guidance flown)."""

import math
from collections.abc import Sequence

import numpy as np

from companion.avoidance.cone import TransitionDomain
from companion.avoidance.inner import emergency
from companion.avoidance.outer import field_commands
from companion.avoidance.params import AvoidanceParams
from companion.avoidance.prediction import OwnState, Tracks
from companion.avoidance.strategies import Priced, Situation, price
from companion.avoidance.survey import (
    Survey,
    matters,
    mission_of,
    own_state,
    refuse_nonsense,
    take,
    threats,
    tracks_at,
)
from companion.model import Decision, Goal, Guidance, Layer, Ownship, Threat, Track
from companion.units import wrap_pi


class Avoider:
    """Decides for one aircraft during one flight.

    The same inputs in the same order give the same decisions, bit for bit: there is no clock and no chance in
    here. `envelope` may be replaced at any time, as limits become known.
    """

    def __init__(self, params: AvoidanceParams) -> None:
        self.params = params
        self.envelope = params.envelope
        self._domain = TransitionDomain(params.delta_beta_rad)
        self._held: Guidance | None = None
        self._layer = Layer.CLEAR
        self._clear_since_s: float | None = None

    def reset(self) -> None:
        """Forget the conflict at hand: somebody else flies now."""
        self._domain.reset()
        self._held = None
        self._layer = Layer.CLEAR
        self._clear_since_s = None

    def decide(self, now_s: float, own: Ownship, tracks: Sequence[Track], goal: Goal) -> Decision:
        """The decision at `now_s` for our aircraft among the tracks, in one north-east-down frame [m, m/s].

        Tracks are extrapolated from their own time to `now_s`. Surface vehicles never matter; a track that is
        not finite is passed over. An ownship or goal that is not finite is a `ValueError`: there is no safe
        answer to it.
        """
        refuse_nonsense(own, goal)
        relevant = [track for track in tracks if matters(track)]
        if not relevant:
            return self._without_conflict(now_s)
        state = own_state(now_s, own)
        mission = mission_of(state, own, goal)
        survey = take(
            state,
            mission,
            tracks_at(now_s, relevant, self.params),
            self.params,
            self.envelope,
            self._domain,
            avoiding=self._held is not None,
        )
        if not survey.conflict.any():
            return self._without_conflict(now_s)
        self._clear_since_s = None
        return self._avoid(state, mission, survey, relevant)

    def _without_conflict(self, now_s: float) -> Decision:
        if self._held is None:
            self.reset()
            return Decision(Layer.CLEAR, because="no conflict")
        if self._clear_since_s is None or now_s < self._clear_since_s:
            self._clear_since_s = now_s
        if now_s - self._clear_since_s < self.params.release_after_s:
            self._layer = Layer.OUTER
            return Decision(Layer.OUTER, self._held, (), "clear of conflict, holding before the return")
        self.reset()
        return Decision(Layer.CLEAR, because="clear of conflict")

    def _avoid(self, state: OwnState, mission: Guidance, survey: Survey, relevant: list[Track]) -> Decision:
        situation = self._situation(state, mission, survey)
        pressing = survey.tracks.subset(survey.pressing(self.params.priced_tracks))
        layer, priced = self._priced(situation, survey, pressing, near=survey.near)
        best = priced.best()
        self._layer, self._held = layer, priced.commands.row(best)
        found = threats(survey, relevant, self.params.priced_tracks)
        return Decision(layer, self._held, found, _because(found[0], self._held, state))

    def _priced(
        self, situation: Situation, survey: Survey, pressing: Tracks, *, near: bool
    ) -> tuple[Layer, Priced]:
        """The layer that decides, and its rows.

        The inner layer takes over when a threat is near and what is flown does not keep clear, or when the
        field has no way. It stays until the margin is there again, so that the layers do not flicker.
        """
        if near and self._layer is Layer.INNER:
            priced = emergency(situation, pressing, self._held)
            kept = priced.closest[priced.best()] >= 1.0
            return Layer.OUTER if kept else Layer.INNER, priced
        if self._layer is not Layer.CLEAR or not near:
            priced = self._outer(situation, survey, pressing)
            if priced.closest[priced.best()] >= situation.lost:
                return Layer.OUTER, priced
        return Layer.INNER, emergency(situation, pressing, self._held)

    def _outer(self, situation: Situation, survey: Survey, pressing: Tracks) -> Priced:
        threat = survey.conflict
        rows = field_commands(
            situation,
            survey.own_rel_velocity_mps[threat],
            survey.surface_m[threat],
            survey.outer_reach_m[threat],
            self.params.field_gains,
        )
        return price(situation, rows, pressing, self._held)

    def _situation(self, state: OwnState, mission: Guidance, survey: Survey) -> Situation:
        threat = survey.conflict
        # A threat's height matters while it is within the horizontal volume, around the closest approach.
        rel_speed = np.hypot(survey.own_rel_velocity_mps[threat, 0], survey.own_rel_velocity_mps[threat, 1])
        crossing_s = np.minimum(
            survey.tracks.protected_horizontal_m[threat] / np.maximum(rel_speed, 1.0), 30.0
        )
        closest_s = np.clip(survey.time_to_closest_s[threat], 0.0, 90.0)
        height = -survey.tracks.position_m[threat, 2]
        climb = -survey.tracks.velocity_mps[threat, 2]
        first = height + climb * np.maximum(closest_s - crossing_s, 0.0)
        last = height + climb * (closest_s + crossing_s)
        # Slightly more than priced as clear, so that arriving at the height is enough.
        room = 1.02 * survey.tracks.protected_vertical_m[threat]
        usual_m = (-float(state.position_m[2]), mission.altitude_m)
        highest_m = max(usual_m) + self.params.largest_height_change_m
        lowest_m = min(usual_m) - self.params.largest_height_change_m
        return Situation(
            own=state,
            mission=mission,
            over_m=min(float((np.maximum(first, last) + room).max()), highest_m),
            under_m=max(float((np.minimum(first, last) - room).min()), lowest_m),
            lost=1.0 / (1.0 + min(self.params.horizontal_margin, self.params.vertical_margin)),
            right_preferred=self._right_preferred(mission, survey),
            envelope=self.envelope,
            weights=self.params.weights,
        )

    @staticmethod
    def _right_preferred(mission: Guidance, survey: Survey) -> bool:
        """Head-on and crossing from the right: the rules of the air turn us to the right."""
        rel = survey.rel_position_m[survey.nearest]
        bearing_rad = wrap_pi(math.atan2(rel[1], rel[0]) - mission.course_rad)
        return math.radians(-20.0) <= bearing_rad <= math.radians(110.0)


def _because(threat: Threat, guidance: Guidance, state: OwnState) -> str:
    """The decision in words, for the operator and the log."""
    course = math.degrees(guidance.course_rad) % 360.0
    turn = math.degrees(wrap_pi(guidance.course_rad - state.course_rad))
    turning = f"{'right' if turn > 0 else 'left'} to " if abs(turn) > 5.0 else ""
    return (
        f"{threat.track_id} {threat.distance_m:.0f} m, {threat.relative_altitude_m:+.0f} m, "
        f"{threat.time_to_closest_s:.0f} s: course {turning}{course:03.0f}, "
        f"height {guidance.altitude_m:.0f} m"
    )
