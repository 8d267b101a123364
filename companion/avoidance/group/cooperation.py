"""Cooperation: whether our group answers a conflict jointly, and with which guidance."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from companion.avoidance.constraints import Constraints
from companion.avoidance.group.formation import (
    FormationParams,
    JointResponse,
    MemberState,
    group_around,
    is_valid,
    joint_response,
)
from companion.avoidance.intruders import Tracks, separation
from companion.avoidance.mission_path import OwnFlight
from companion.avoidance.trajectory import Commands, Envelope, Mask, OwnState, fly_ahead, position_at
from companion.model import Goal, Guidance, Member, Ownship, Track


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


class JointGuidance(NamedTuple):
    """Our part of a joint response, and which of the tracks take part in it, (N,)."""

    guidance: Guidance
    members: Mask


class Cooperation:
    """Our part in the group. A joint response that is being flown ends only with some margin."""

    def __init__(self, params: FormationParams, release_margin: float, *, enabled: bool) -> None:
        self._answering = False
        self.retune(params, release_margin, enabled=enabled)

    def retune(self, params: FormationParams, release_margin: float, *, enabled: bool) -> None:
        """Use these parameters from now on; a conflict at hand continues."""
        self._params, self._release_margin = params, release_margin
        self.enabled = enabled and params.cooperate and bool(params.own_id)

    def reset(self) -> None:
        """Forget the conflict at hand."""
        self._answering = False

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
        """Our part of the joint response, if it resolves the conflicts and may be flown.

        `predicted` holds the tracks as assessed, and `conflict` (N,) whether each is in conflict, both in the
        order of `tracks`. A conflict with a stranger comes first: then there is no joint response.
        """
        self._answering, answering = False, self._answering
        member = describe_member(own, flight.goal, constraints.envelope)
        ours = MemberState(self._params.own_id, flight.state.position_m, own.velocity_mps, member)
        response = self._response(now_s, ours, tracks, answering=answering)
        if response is None:
            return None
        members = np.array([track.track_id in response.guidance for track in tracks])
        part = constraints.within_limits(response.guidance[self._params.own_id])
        strangers = predicted.subset(np.flatnonzero(~members))
        self._answering = (
            not (conflict & ~members).any()
            and _keeps_clear(part, flight.state, strangers, constraints.envelope)
            and constraints.allow(part, flight.state)
        )
        return JointGuidance(part, members) if self._answering else None

    def _response(
        self, now_s: float, ours: MemberState, tracks: Sequence[Track], *, answering: bool
    ) -> JointResponse | None:
        """The joint response of our group, if the group is in conflict and the response keeps it apart."""
        others = [
            MemberState(track.track_id, position_at(track, now_s), track.velocity_mps, track.member)
            for track in tracks
            if track.member is not None
        ]
        others = [state for state in others if is_valid(state)]
        if not others:
            return None
        response = joint_response(group_around([ours, *others], self._params.reach_m), self._params)
        if response is None or response.closest_m < self._params.smallest_m:
            return None
        margin = 1.0 + self._release_margin if answering else 1.0
        return response if response.straight_closest_m < margin * self._params.influence_m else None


def _keeps_clear(guidance: Guidance, state: OwnState, strangers: Tracks, envelope: Envelope) -> bool:
    """Whether the guidance keeps clear of all `strangers`, the tracks outside the group."""
    if len(strangers) == 0:
        return True
    kept = separation(fly_ahead(state, Commands.of([guidance]), envelope), strangers)
    return bool((kept.closest >= 1.0).all())
