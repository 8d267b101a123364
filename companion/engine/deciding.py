"""The decision of a tick: own state, tracks and goal in the local frame, within the limits of this place."""

import math
from dataclasses import replace
from typing import NamedTuple

from companion.airspace.fences import AutopilotFence, limit_heights
from companion.airspace.obstacles import ObstacleMap
from companion.avoidance import Avoider, Control, Envelope
from companion.control.handover import Handover
from companion.control.readiness import Readiness
from companion.control.state_machine import WATCHING, State
from companion.engine_config import EngineConfig
from companion.geodesy import LocalFrame
from companion.mavlink.facts import MemberIntent, Sender
from companion.model import Decision, Goal, Layer, Ownship, Role, Track
from companion.ownship.aircraft import Aircraft
from companion.ownship.autopilot_queries import AutopilotQueries
from companion.ownship.legs import Leg
from companion.traffic import Tracker
from companion.traffic.members import fact_of

# The error of a flat frame grows with the distance from its origin; within this it is negligible.
_FRAME_REACH_M = 5_000.0
# After an avoidance the aircraft is back at its mission's speed within this time.
_SPEED_RETURNS_S = 20.0
# Announcements are numbered by time, so that those after a restart are newer.
_COUNTS_PER_S = 10.0


class _LimitSources(NamedTuple):
    """Everything that the limits of a place are made from, besides the configured zones.

    Home and the ground are in whole metres, as they vary by centimetres all the time.
    """

    frame: LocalFrame
    home_m: float
    ground_m: float | None
    min_height_m: float
    max_height_m: float | None
    envelope: Envelope
    fence: AutopilotFence


class Deciding:
    """Holds the standing decision and its inputs."""

    def __init__(
        self,
        aircraft: Aircraft,
        queries: AutopilotQueries,
        tracker: Tracker,
        obstacles: ObstacleMap | None,
        config: EngineConfig,
        handover: Handover,
        readiness: Readiness,
        avoider: Avoider,
    ) -> None:
        self.avoider = avoider
        self.config = config
        self.frame: LocalFrame | None = None
        self.goal: Goal | None = None
        self.decision = Decision(Layer.CLEAR, because="no position")
        self.own: Ownship | None = None
        self.tracks: tuple[Track, ...] = ()
        self._aircraft = aircraft
        self._queries = queries
        self._tracker = tracker
        self._threats: list[str] | None = None  # of the decision of this tick, until the tracker knows them
        self._obstacles = obstacles
        self._handover = handover
        self._readiness = readiness
        self._conflict_over = False
        self._held_s = -math.inf  # when the aircraft was ours last
        self._limits_from: _LimitSources | None = None  # those of the limits in effect
        self._leg_from: tuple[Leg, LocalFrame] | None = None  # of the goal, while a leg is flown back to

    def forget_conflict(self) -> None:
        """Begin the next decision without the memory of this conflict."""
        self._conflict_over = True

    def update(self, role: Role, now_s: float) -> None:
        """Decide; while the newest position is a little old, the last decision stands."""
        aircraft = self._aircraft
        if self._conflict_over:
            self._conflict_over = False
            self.avoider.reset()
        if aircraft.kinematics.position_lost(now_s):
            self.own, self.tracks = None, ()
            self._do_without("no position")
            return
        if now_s - aircraft.kinematics.position_s > self.config.engine.position_stale_s:
            return
        self.frame = self._frame_here()
        if self.frame is None:
            return
        self.own = aircraft.kinematics.ownship(self.frame)
        self.tracks = self._tracker.tracks(now_s, self.frame)
        if self._obstacles is not None:
            self.tracks += self._obstacles.tracks(now_s, self.frame, aircraft.kinematics.home_altitude_m())
        self.goal = self._goal_now(self.frame, now_s)
        if self.own is None or role is Role.OFF or not self._may_decide():
            self._do_without("off" if role is Role.OFF else "not flying")
            self._threats = []
            return
        self._apply_limits(self.frame, now_s)
        if self.config.avoidance.formation.members and aircraft.sender is not None:
            self.avoider.join(str(aircraft.sender.system_id), answers=self._may_answer(role, now_s))
        self.avoider.senses.own_icao = self._tracker.own_icao
        self.avoider.may_wait = self._leg_from is None
        self.decision = _checked(self.avoider.decide(now_s, self.own, self.tracks, self.goal))
        conflicts = (*self.decision.threats, *self.decision.awaited)
        self._threats = [threat.track_id for threat in conflicts]

    def note_threats(self, now_s: float) -> None:
        """Let the tracker keep the threats of this tick's decision, if there was one."""
        if self._threats is not None:
            self._tracker.note_threats(self._threats, now_s)
            self._threats = None

    def unheard(self, now_s: float) -> str | None:
        """In words, that the last threat is not heard any more; `None` while it is."""
        self.note_threats(now_s)
        unheard = self._tracker.unheard(now_s)
        return None if unheard is None else f"{unheard[0]} not heard for {unheard[1]:.0f} s"

    def _may_answer(self, role: Role, now_s: float) -> bool:
        """Whether an answer of ours would be flown: the aircraft is ours, or would be taken over."""
        handover = self._handover
        if handover.supervisor.holds:
            return handover.supervisor.state is not State.STOPPING
        return not self._readiness.hindrances(now_s, role)

    def announcement(self, sender: Sender, now_s: float) -> MemberIntent | None:
        """What the other members of our formation should know; `None` on the ground or without members."""
        if not self.config.avoidance.formation.members or self.own is None or self.frame is None:
            return None
        if self.goal is None or not self._may_decide():
            return None
        member = self.avoider.announced(self.own, self.goal)
        return fact_of(member, self.frame, sender, int(now_s * _COUNTS_PER_S))

    def _do_without(self, because: str) -> None:
        self.avoider.reset()
        self.decision = Decision(Layer.CLEAR, because=because)

    def _may_decide(self) -> bool:
        """Whether we fly the aircraft, or it is in the air: below the lowest height for advice only."""
        min_height_m = self.config.supervisor.min_height_m
        return self._handover.supervisor.flying or self._aircraft.in_the_air(min_height_m)

    def _goal_now(self, frame: LocalFrame, now_s: float) -> Goal:
        """The goal of the mission; while the aircraft is ours, the goal at the take-over."""
        watching = self._handover.supervisor.state in WATCHING
        if not watching:
            self._held_s = now_s
        if self.goal is None or watching:
            self._leg_from = None
            goal = self._aircraft.goal(frame, now_s)
            if self.goal is not None and now_s - self._held_s <= _SPEED_RETURNS_S:
                # The present speed is still that of the avoidance.
                goal = replace(goal, airspeed_mps=self.goal.airspeed_mps)
            if self._aircraft.navigation.mission_outdated(now_s):
                self._queries.reread_mission(now_s)
            return goal
        leg = self._handover.leg()
        if leg is not None:
            if self._leg_from == (leg, frame):
                return self.goal
            self._leg_from = leg, frame
            return leg.goal(frame, self.goal)
        self._leg_from = None
        if self.goal.position_m is not None:
            return self.goal
        # Taken over before the mission was read, as after a restart: the goal was the course flown then.
        place = self._handover.goes_on_to()
        if place is None:
            return self.goal
        position_m = frame.to_ned_m(place)
        return replace(self.goal, position_m=position_m, altitude_m=place.altitude_m, height_is_known=True)

    def _frame_here(self) -> LocalFrame | None:
        """The local frame, which follows the aircraft; the goal is converted to a new frame."""
        place = self._aircraft.kinematics.place()
        frame = self.frame
        if place is None:
            return frame
        if frame is not None and math.hypot(*frame.to_ned_m(place)[:2]) <= _FRAME_REACH_M:
            return frame
        here = LocalFrame(place.lat_deg, place.lon_deg)
        if frame is not None and self.goal is not None and self.goal.position_m is not None:
            moved = here.to_ned_m(frame.to_geo(*self.goal.position_m))
            self.goal = replace(self.goal, position_m=moved)
        return here

    def _apply_limits(self, frame: LocalFrame, now_s: float) -> None:
        """Give the avoider the aircraft's envelope, with floor, ceiling and fence of this place."""
        aircraft, adapter = self._aircraft, self._aircraft.adapter
        self.avoider.prefers_turns = adapter is not None and adapter.invalid_after_climbs
        self.avoider.withhold(_lost_controls(aircraft))
        home_m = aircraft.kinematics.home_altitude_m()
        if home_m is None:
            return
        queries, ground_m = self._queries, aircraft.terrain.altitude_m(now_s)
        if now_s > queries.fence_until_s:
            queries.refresh_fence(now_s)
        sources = _LimitSources(
            frame,
            float(round(home_m)),
            None if ground_m is None else float(math.ceil(ground_m)),
            self.config.supervisor.min_height_m,
            self.config.engine.max_height_m,
            queries.limits.envelope,
            queries.fence,
        )
        before, self._limits_from = self._limits_from, sources
        if sources != before:  # on most ticks they are the same
            heights = queries.heights(sources.min_height_m, sources.max_height_m)
            self.avoider.envelope = limit_heights(sources.envelope, heights, sources.home_m, sources.ground_m)
            self.avoider.fence = queries.local_fence(frame, sources.home_m)


def _lost_controls(aircraft: Aircraft) -> frozenset[Control]:
    """The controls that cannot be flown: those that the autopilot refuses, and speed without airspeed."""
    lost = frozenset() if aircraft.adapter is None else aircraft.adapter.lost_controls
    return lost if aircraft.kinematics.airspeed_measured else lost | {Control.SPEED}


def _checked(decision: Decision) -> Decision:
    """The same decision; ValueError when its guidance is not finite: a bug, which ends the service."""
    guidance = decision.guidance
    if guidance is not None and not all(
        map(math.isfinite, (guidance.course_rad, guidance.airspeed_mps, guidance.altitude_m))
    ):
        raise ValueError("guidance is not finite")
    return decision
