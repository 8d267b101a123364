"""The avoider: two layers, one decision, and all the memory there is (cones entered, guidance flown)."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt, Le
from numpy.typing import NDArray

from companion.avoidance.cone import TransitionDomain, approach_angle_rad, half_angle_rad
from companion.avoidance.envelope import Envelope
from companion.avoidance.geometry import (
    Array,
    closing_speed_mps,
    position_at,
    time_to_closest_s,
    vertical_distance_m,
)
from companion.avoidance.inner import emergency
from companion.avoidance.outer import FieldParams, field_commands
from companion.avoidance.prediction import (
    Commands,
    OwnState,
    Tracks,
    fly_ahead,
    ground_speed_mps,
    separation,
)
from companion.avoidance.strategies import CostWeights, Priced, Situation, price
from companion.model import (
    Decision,
    Goal,
    Guidance,
    Layer,
    Ownship,
    Threat,
    Track,
    TrafficKind,
)
from companion.units import wrap_pi


@dataclass(frozen=True)
class AvoidanceParams:
    """Volumes, layers and prices. Radii are measured from the protected volume's surface (paper §2.3)."""

    # Well clear for small UAS against crewed aircraft (ASTM F3442).
    well_clear_horizontal_m: Annotated[float, Gt(0), Le(20_000)] = 609.6
    well_clear_vertical_m: Annotated[float, Gt(0), Le(2_000)] = 76.2
    # Masts and other things that stand on the ground need less room: there is nobody to be startled.
    obstacle_horizontal_m: Annotated[float, Gt(0), Le(20_000)] = 150.0
    obstacle_vertical_m: Annotated[float, Gt(0), Le(2_000)] = 50.0
    # The volume is kept larger than required by these shares, against what is not predicted.
    horizontal_margin: Annotated[float, Ge(0), Le(5)] = 0.15
    vertical_margin: Annotated[float, Ge(0), Le(5)] = 0.25
    # Each layer reaches as far as its length or its time at the closing speed, whichever is larger.
    outer_radius_m: Annotated[float, Gt(0)] = 1500.0
    outer_time_s: Annotated[float, Gt(0), Le(80)] = 60.0
    inner_radius_m: Annotated[float, Gt(0)] = 300.0
    inner_time_s: Annotated[float, Gt(0), Le(80)] = 20.0
    # Transition domain: the cone is this much wider for whoever is in it.
    delta_beta_rad: Annotated[float, Ge(0), Le(math.pi)] = math.radians(5.0)
    # Back to the mission only when its flight keeps clear by this share more, for this long.
    release_margin: Annotated[float, Ge(0), Le(5)] = 0.2
    release_after_s: Annotated[float, Ge(0), Le(60)] = 3.0
    # An avoidance goes no further up or down than this from where it would otherwise be.
    largest_height_change_m: Annotated[float, Gt(0), Le(3_000)] = 300.0
    # Rows are priced against the most pressing tracks; the others still count for the layers.
    priced_tracks: Annotated[int, Gt(0), Le(200)] = 16
    envelope: Envelope = field(default_factory=Envelope)
    field_gains: FieldParams = field(default_factory=FieldParams)
    weights: CostWeights = field(default_factory=CostWeights)

    def __post_init__(self) -> None:
        if self.inner_radius_m > self.outer_radius_m or self.inner_time_s > self.outer_time_s:
            raise ValueError("the inner layer must not reach further than the outer layer")


@dataclass(frozen=True, slots=True)
class _Survey:
    """All tracks measured against flying the mission on; arrays of shape (N,) unless said otherwise."""

    tracks: Tracks
    rel_position_m: Array  # other minus own, (N, 3)
    own_rel_velocity_mps: Array  # own on the mission minus other, (N, 3)
    surface_m: Array  # horizontal distance to the protected volume
    closing_mps: Array
    time_to_closest_s: Array
    outer_reach_m: Array
    inner_reach_m: Array
    mission_closest: Array
    conflict: NDArray[np.bool_]


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
        _refuse_nonsense(own, goal)
        relevant = [track for track in tracks if _matters(track)]
        if not relevant:
            return self._without_conflict(now_s)
        state = _own_state(now_s, own)
        mission = _mission(state, own, goal, self.envelope)
        survey = self._survey(now_s, state, mission, relevant)
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

    def _survey(self, now_s: float, state: OwnState, mission: Guidance, relevant: list[Track]) -> _Survey:
        params = self.params
        tracks = self._traffic(now_s, relevant)
        rel_position = tracks.position_m - state.position_m
        speed_mps = ground_speed_mps(mission.course_rad, mission.airspeed_mps, state.wind_mps)
        own_velocity = np.array(
            [speed_mps * math.cos(mission.course_rad), speed_mps * math.sin(mission.course_rad), 0.0]
        )
        rel_velocity = tracks.velocity_mps - own_velocity
        closing = closing_speed_mps(rel_position[:, :2], rel_velocity[:, :2])
        distance = np.hypot(rel_position[:, 0], rel_position[:, 1])
        surface = distance - tracks.protected_horizontal_m
        outer_reach = np.maximum(params.outer_radius_m, params.outer_time_s * closing)
        inner_reach = np.maximum(params.inner_radius_m, params.inner_time_s * closing)
        paths = fly_ahead(state, Commands.of([mission]), self.envelope)
        closest = separation(paths, tracks).closest[0]
        held = self._held is not None
        lost = closest < (1.0 + params.release_margin if held else 1.0)
        in_cone = self._domain.update(
            tracks.ids,
            approach_angle_rad(rel_position, -rel_velocity),
            half_angle_rad(distance, tracks.protected_horizontal_m),
            lost & (surface < outer_reach),
        )
        return _Survey(
            tracks=tracks,
            rel_position_m=rel_position,
            own_rel_velocity_mps=-rel_velocity,
            surface_m=surface,
            closing_mps=closing,
            time_to_closest_s=time_to_closest_s(rel_position, rel_velocity),
            outer_reach_m=outer_reach,
            inner_reach_m=inner_reach,
            mission_closest=closest,
            # Near by, a turn back to the mission may lead through the volume although its far end does not.
            conflict=in_cone | (lost & (surface < inner_reach)),
        )

    def _traffic(self, now_s: float, relevant: list[Track]) -> Tracks:
        params = self.params
        position = np.array([track.position_m for track in relevant], dtype=np.float64)
        velocity = np.array([track.velocity_mps for track in relevant], dtype=np.float64)
        grounded = np.array([track.kind is TrafficKind.OBSTACLE for track in relevant])
        age_s = now_s - np.array([track.time_s for track in relevant])
        horizontal = np.where(grounded, params.obstacle_horizontal_m, params.well_clear_horizontal_m)
        vertical = np.where(grounded, params.obstacle_vertical_m, params.well_clear_vertical_m)
        for i, track in enumerate(relevant):
            if track.protected_horizontal_m is not None:
                horizontal[i] = track.protected_horizontal_m
            if track.protected_vertical_m is not None:
                vertical[i] = track.protected_vertical_m
        return Tracks(
            tuple(track.track_id for track in relevant),
            position + velocity * age_s[:, None],
            velocity,
            np.maximum(horizontal, 1.0) * (1.0 + params.horizontal_margin),
            np.maximum(vertical, 1.0) * (1.0 + params.vertical_margin),
            grounded,
        )

    def _avoid(self, state: OwnState, mission: Guidance, survey: _Survey, relevant: list[Track]) -> Decision:
        situation = self._situation(state, mission, survey)
        pressing = survey.tracks.subset(self._pressing(survey))
        near = bool((survey.conflict & (survey.surface_m < survey.inner_reach_m)).any())
        layer, priced = self._priced(situation, survey, pressing, near=near)
        best = priced.best()
        self._layer, self._held = layer, priced.commands.row(best)
        threats = self._threats(survey, relevant)
        return Decision(layer, self._held, threats, _because(threats[0], self._held, state))

    def _priced(
        self, situation: Situation, survey: _Survey, pressing: Tracks, *, near: bool
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

    def _outer(self, situation: Situation, survey: _Survey, pressing: Tracks) -> Priced:
        threat = survey.conflict
        rows = field_commands(
            situation,
            survey.own_rel_velocity_mps[threat],
            survey.surface_m[threat],
            survey.outer_reach_m[threat],
            self.params.field_gains,
        )
        return price(situation, rows, pressing, self._held)

    def _situation(self, state: OwnState, mission: Guidance, survey: _Survey) -> Situation:
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
    def _right_preferred(mission: Guidance, survey: _Survey) -> bool:
        """Head-on and crossing from the right: the rules of the air turn us to the right."""
        nearest = int(np.argmin(np.where(survey.conflict, survey.surface_m, np.inf)))
        rel = survey.rel_position_m[nearest]
        bearing_rad = wrap_pi(math.atan2(rel[1], rel[0]) - mission.course_rad)
        return math.radians(-20.0) <= bearing_rad <= math.radians(110.0)

    def _pressing(self, survey: _Survey) -> NDArray[np.intp]:
        """Places of the tracks to price against: those soonest reached, conflicts first."""
        reach_s = survey.surface_m / (np.hypot(*survey.own_rel_velocity_mps[:, :2].T) + 20.0)
        order = np.lexsort((reach_s, ~survey.conflict))
        return order[: self.params.priced_tracks]

    def _threats(self, survey: _Survey, relevant: list[Track]) -> tuple[Threat, ...]:
        """The conflicts, soonest first; as many as are priced."""
        at_closest = position_at(
            survey.rel_position_m, -survey.own_rel_velocity_mps, np.maximum(survey.time_to_closest_s, 0.0)
        )
        vertical = vertical_distance_m(at_closest[:, 2], survey.tracks.grounded)
        places = np.flatnonzero(survey.conflict)
        order = places[np.argsort(survey.surface_m[places], kind="stable")][: self.params.priced_tracks]
        return tuple(
            Threat(
                track_id=relevant[i].track_id,
                icao=relevant[i].icao,
                distance_m=float(np.hypot(*survey.rel_position_m[i, :2])),
                relative_altitude_m=-float(survey.rel_position_m[i, 2]),
                bearing_rad=math.atan2(survey.rel_position_m[i, 1], survey.rel_position_m[i, 0]),
                closing_mps=float(survey.closing_mps[i]),
                time_to_closest_s=float(survey.time_to_closest_s[i]),
                miss_horizontal_m=float(np.hypot(*at_closest[i, :2])),
                miss_vertical_m=float(vertical[i]),
                layer=Layer.INNER if survey.surface_m[i] < survey.inner_reach_m[i] else Layer.OUTER,
            )
            for i in order.tolist()
        )


def _matters(track: Track) -> bool:
    finite = all(map(math.isfinite, (*track.position_m, *track.velocity_mps, track.time_s)))
    return finite and track.kind is not TrafficKind.SURFACE_VEHICLE


def _refuse_nonsense(own: Ownship, goal: Goal) -> None:
    numbers = [own.time_s, *own.position_m, *own.velocity_mps, own.airspeed_mps, own.heading_rad]
    numbers += [*(own.wind_mps or ()), *(goal.position_m if goal.position_m is not None else ())]
    numbers += [x for x in (goal.course_rad, goal.airspeed_mps, goal.altitude_m) if x is not None]
    if not all(map(math.isfinite, numbers)):
        raise ValueError("ownship or goal is not finite")


def _own_state(now_s: float, own: Ownship) -> OwnState:
    velocity = np.array(own.velocity_mps, dtype=np.float64)
    position = np.array(own.position_m, dtype=np.float64) + velocity * (now_s - own.time_s)
    ground_speed = math.hypot(velocity[0], velocity[1])
    airspeed = own.airspeed_mps if own.airspeed_mps > 1.0 else max(ground_speed, 1.0)
    if own.wind_mps is not None:
        wind = np.array(own.wind_mps, dtype=np.float64)
    else:
        # What moves over the ground but not through the air is the wind; a bad heading must not make a storm.
        wind = velocity[:2] - airspeed * np.array([math.cos(own.heading_rad), math.sin(own.heading_rad)])
        strength = math.hypot(wind[0], wind[1])
        if strength > 0.6 * airspeed:
            wind = np.zeros(2)
    course = math.atan2(velocity[1], velocity[0]) if ground_speed > 1.0 else own.heading_rad
    return OwnState(position, course, airspeed, -float(velocity[2]), wind)


def _mission(state: OwnState, own: Ownship, goal: Goal, envelope: Envelope) -> Guidance:
    """What the goal means from here: course, airspeed and height."""
    airspeed = own.airspeed_mps if goal.airspeed_mps is None else goal.airspeed_mps
    altitude, course = goal.altitude_m, goal.course_rad
    if goal.position_m is not None:
        north, east = (goal.position_m[i] - float(state.position_m[i]) for i in (0, 1))
        # On top of the goal its bearing means nothing.
        course = math.atan2(east, north) if math.hypot(north, east) > 1.0 else state.course_rad
        altitude = -goal.position_m[2] if altitude is None else altitude
    return Guidance(
        state.course_rad if course is None else course,
        envelope.clamp_airspeed_mps(airspeed),
        -float(state.position_m[2]) if altitude is None else altitude,
    )


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


def with_limits(envelope: Envelope, *, floor_m: float | None, ceiling_m: float | None) -> Envelope:
    """The envelope between a floor and a ceiling, heights above the zero of the local frame."""
    return replace(envelope, min_altitude_m=floor_m, max_altitude_m=ceiling_m)
