"""Prices: rows flown ahead, and what each of them costs.

The price puts separation first, from what is predicted and from what may surprise, then effort, deviation
from the mission and where it leaves us, changing one's mind and passing on the wrong side. The cheapest row
is flown.
"""

import math
from dataclasses import dataclass, replace
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Ge
from numpy.typing import NDArray

from companion.avoidance.envelope import Envelope, Pace
from companion.avoidance.fence import Breach, Fence
from companion.avoidance.geometry import Array
from companion.avoidance.maneuvers import NO_SURPRISES, SurpriseParams, foreseen
from companion.avoidance.refusals import Refusals
from companion.avoidance.trajectory import (
    HORIZON_S,
    Commands,
    OwnState,
    Paths,
    Tracks,
    fly_ahead,
    ground_velocity_mps,
    losses,
    moment_at,
    outcomes,
    separation,
)
from companion.compiled import kernels
from companion.model import Guidance

# Commands that differ by no more than this are flown alike.
_SAME_COURSE_RAD, _SAME_HEIGHT_M = math.radians(2.0), 5.0

# A near mid-air collision (500 ft by 100 ft) in shares of well clear (2000 ft by 250 ft).
_NEAR_MISS_HORIZONTAL, _NEAR_MISS_VERTICAL = 0.25, 0.4


@dataclass(frozen=True)
class CostWeights:
    """Prices. Losing the protected volume outweighs all else together."""

    margin: Annotated[float, Ge(0)] = 30.0  # times the penetration of the margin, 0 at its edge
    loss: Annotated[float, Ge(0)] = 40.0  # flat, for entering the protected volume itself
    depth: Annotated[float, Ge(0)] = 300.0  # times the deepest penetration, 0 at the edge, 1 at contact
    exposure: Annotated[float, Ge(0)] = 100.0  # times the mean penetration, so that leaving soon is better
    # Times the mean depth in the worst inner layer, 0 at its edge and 1 at the volume. The paper's clears its
    # whole sphere; for traffic that would be miles, and a volume missed by its margin is missed.
    nearness: Annotated[float, Ge(0)] = 0.0
    turn: Annotated[float, Ge(0)] = 0.6  # times the turn from the present course, per half circle
    deviation: Annotated[float, Ge(0)] = 6.0  # times the angle off the mission's course, per half circle
    # Times the distance from where the mission would be when all is passed, per 100 m.
    aside: Annotated[float, Ge(0)] = 0.6
    # Times how deep the mission would lead into a volume from there, 0 at its edge, 1 through its middle.
    unresolved: Annotated[float, Ge(0)] = 8.0
    height: Annotated[float, Ge(0)] = 0.8  # times the height off the mission's, per 100 m
    descent: Annotated[float, Ge(0)] = 0.2  # flat, for going below the mission: ground is there
    # Flat, for leaving the mission's height where that is a risk of its own (`Avoider.spares_heights`): more
    # than any turn costs, less than the loss of the protected volume.
    spared_height: Annotated[float, Ge(0)] = 12.0
    speed: Annotated[float, Ge(0)] = 0.5  # times the speed off the mission's, per 10 m/s
    # Flat, for anything but what is flown already; twice that while the closest approach is far off, as what
    # looks cheaper now may not a moment later, and there is time.
    switch: Annotated[float, Ge(0)] = 2.0
    ease: Annotated[float, Ge(0)] = 0.6  # the same, for the same with less of it: nearer to the mission
    wrong_side: Annotated[float, Ge(0)] = 0.3  # flat, for turning left where the rules of the air say right
    # Where there is a fence. Leaving it outweighs the loss of many volumes, as the autopilot then takes the
    # aircraft away from us or ends its flight, and whoever is out there has not been asked; only a near
    # mid-air collision outweighs the fence.
    fence: Annotated[float, Ge(0)] = 10_000.0  # times the use of its margin, 1 from the fence itself on
    near_miss: Annotated[float, Ge(0)] = 30_000.0  # flat, and once more times the depth, 1 at contact
    outside: Annotated[float, Ge(0)] = 100.0  # times the mean depth outside, per 100 m: back soon is better
    # For a way that would leave the fence later, before the threat is passed: all of it if it left at once.
    not_to_the_end: Annotated[float, Ge(0)] = 3.0


class Situation(NamedTuple):
    """What rows are made from and priced against."""

    own: OwnState
    mission: Guidance
    over_m: float  # the height that passes above every threat
    under_m: float  # the height that passes below every threat
    right_preferred: bool
    horizon_s: float  # how far ahead rows are judged
    goal_distance: float  # in lengths of the outer layer's radius; 1 where the goal is a direction only
    lost: float  # the separation, in protected volumes with margin, from which the bare volume counts as lost
    envelope: Envelope
    weights: CostWeights
    rule_course_rad: float = 0.0  # what eq. 11 asks for, in an emergency
    rule_pace: Pace = Pace.KEEP  # what eq. 13 asks for
    fence: Fence | None = None
    fence_look_ahead_s: float = 0.0  # within it the fence must be kept
    passed_s: float = HORIZON_S  # when all threats are passed
    # Where the mission flown on is at that time, north and east, (2,); `None`: nobody is to be passed.
    mission_then_m: Array | None = None
    refusals: Refusals = Refusals()
    surprises: SurpriseParams = NO_SURPRISES
    spares_heights: bool = False  # the mission's is left only where a turn does not do
    early: float = 0.0  # 1 while the closest approach is far off, 0 when it is near (`Survey.early`)
    impatience: float = 0.0  # grows when it has lasted too long: how much more what is left to pass counts


class Priced(NamedTuple):
    """Rows with their price, shape (K,), and how they keep clear of the nearest track, shape (K,).

    `contained`, (K,): which of them keep to the fence.
    """

    commands: Commands
    cost: Array
    closest: Array
    contained: NDArray[np.bool_]

    def best(self) -> int:
        """The cheapest row; the first of equals, so that the same inputs give the same row."""
        return int(np.argmin(self.cost))


def _mission_within_limits(situation: Situation) -> Guidance:
    """What the mission asks for, as far as it can be flown."""
    mission, envelope = situation.mission, situation.envelope
    return Guidance(
        mission.course_rad,
        envelope.clamp_airspeed_mps(mission.airspeed_mps),
        envelope.clamp_altitude_m(mission.altitude_m),
    )


def price(situation: Situation, commands: Commands, tracks: Tracks, held: Guidance | None) -> Priced:
    """Fly all rows ahead and price them; the guidance being flown, if there is one, as row 0.

    Separation has its price in what is predicted, and by its share in every surprise. How rows keep clear
    (`Priced.closest`) is told of what is predicted alone.
    Rows that ask for what the autopilot refused are left out.
    """
    refusals = situation.refusals
    if held is not None and refusals.refused:
        held = refusals.instead(held, _mission_within_limits(situation), commands)
    if held is not None:
        commands = commands.after(held)
    if refusals.refused:
        commands = refusals.without(commands, _mission_within_limits(situation))
    weights = situation.weights
    paths = fly_ahead(situation.own, commands, situation.envelope)
    cost, closest = losses(
        paths,
        tracks,
        foreseen(tracks, situation.surprises),
        weights,
        situation.lost,
        horizon_s=situation.horizon_s,
        soon_s=min(situation.surprises.within_s, situation.horizon_s),
    )
    # In a crowd no way is clear of all shells: what counts is the worst, or the crowd would outweigh the
    # goal.
    if weights.nearness > 0.0:
        kept = separation(paths, tracks, horizon_s=situation.horizon_s, shells=True)
        cost += weights.nearness * kept.nearness.max(axis=1, initial=0.0)
    _add_efforts(cost, situation, commands, _outcome_price(situation, paths, tracks), held)
    contained = np.ones(len(commands), dtype=bool)
    if situation.fence is not None:
        breach = situation.fence.breach(paths, situation.fence_look_ahead_s, situation.passed_s)
        contained = breach.deepest_m <= 0.0
        cost += _fence_price(situation, situation.fence, breach)
        if not contained.all():
            cost += _near_miss_price(situation, paths, tracks)
    return Priced(commands, cost, closest, contained)


def _add_efforts(
    cost: Array, situation: Situation, commands: Commands, of_outcome: Array, held: Guidance | None
) -> None:
    """Add what rows cost of themselves, and by the outcome of their ground paths, (H,).

    Turns and deviations, speeds and heights off the mission's, the wrong side; and for rows but the one held
    what it costs to switch, or less where they lie between what is held and the mission.
    """
    mission, weights = situation.mission, situation.weights
    kernels.add_efforts(
        cost,
        commands,
        weights,
        of_outcome,
        mission.course_rad,
        mission.airspeed_mps,
        mission.altitude_m,
        situation.own.course_rad,
        situation.right_preferred,
        situation.spares_heights,
        held,
        _SAME_COURSE_RAD,
        _SAME_HEIGHT_M,
        weights.switch * (1.0 + situation.early),
    )


def _outcome_price(situation: Situation, paths: Paths, tracks: Tracks) -> Array:
    """What ground paths cost by where they are when the mission would have passed all threats, (H,).

    That is the distance from where the mission would be, and what is left to do: who flies on beside a threat
    keeps clear of it for as long as he likes, but is no nearer to passing it.
    """
    if situation.mission_then_m is None:
        return np.zeros(len(paths.ground_m))
    weights, mission = situation.weights, situation.mission
    return outcomes(
        paths,
        tracks,
        moment_at(situation.passed_s),
        situation.mission_then_m,
        ground_velocity_mps(mission.course_rad, mission.airspeed_mps, situation.own.wind_mps),
        mission.altitude_m,
        aside=weights.aside / 100.0,
        unresolved=(1.0 + situation.impatience) * weights.unresolved,
    )


def _fence_price(situation: Situation, fence: Fence, breach: Breach) -> Array:
    """What the fence costs rows, shape (K,).

    First comes no near mid-air collision, then the fence, then everything else: well clear is there to keep
    surprises from becoming collisions and has room for that; a fence has none, as beyond it other people,
    other aircraft and the autopilot's own reaction begin. Once outside, the fence is broken whatever is
    flown: then well clear counts as ever, against coming back soon.
    """
    weights = situation.weights
    use = breach.deepest_m / fence.margin_m if fence.margin_m > 0.0 else breach.deepest_m > 0.0
    early = np.maximum(1.0 - breach.first_s / max(situation.passed_s, 1.0), 0.0)
    cost: Array = (
        weights.fence * np.minimum(use, 1.0)
        + weights.outside / 100.0 * breach.mean_m
        + weights.not_to_the_end * early
    )
    return cost


def _near_miss_price(situation: Situation, paths: Paths, tracks: Tracks) -> Array:
    """What the fence must not make rows do, shape (K,)."""
    horizontal, vertical = situation.lost * _NEAR_MISS_HORIZONTAL, situation.lost * _NEAR_MISS_VERTICAL
    cores = replace(
        tracks,
        protected_horizontal_m=horizontal * tracks.protected_horizontal_m,
        protected_vertical_m=vertical * tracks.protected_vertical_m,
    )
    closest = separation(paths, cores, horizon_s=situation.horizon_s).closest.min(axis=1, initial=np.inf)
    cost: Array = situation.weights.near_miss * ((closest < 1.0) + np.maximum(1.0 - closest, 0.0))
    return cost
