"""The strategy table (paper §3.2.3, P7-P10): rows of course, height and speed, flown ahead and priced.

A row is a choice in each of the three controls. Its flight under the aircraft's own limits is predicted, and
its price puts separation first, then effort, deviation from the mission, changing one's mind and passing on
the wrong side. The cheapest row is flown.
"""

import math
from dataclasses import dataclass
from enum import StrEnum
from itertools import product
from typing import Annotated

import numpy as np
from annotated_types import Ge

from companion.avoidance.envelope import Envelope
from companion.avoidance.geometry import Array, wrap_pi
from companion.avoidance.prediction import Commands, OwnState, Tracks, fly_ahead, separation
from companion.model import Guidance


class Height(StrEnum):
    """What a row does with height."""

    MISSION = "mission height"
    LEVEL = "level off"
    OVER = "over"
    UNDER = "under"


class Speed(StrEnum):
    """What a row does with airspeed (eq. 13)."""

    MISSION = "mission speed"
    SLOWEST = "slowest"
    FASTEST = "fastest"


@dataclass(frozen=True, slots=True)
class Strategy:
    """One row: a turn from the present course (right is positive), a height and a speed."""

    turn_rad: float
    height: Height
    speed: Speed


_TURNS_DEG = (0, 15, -15, 30, -30, 45, -45, 60, -60, 90, -90, 120, -120, 150, -150, 180)
# A few metres per second decide who passes first, ahead or behind; on a large turn they decide nothing.
_LARGEST_TURN_WITH_SPEED_DEG = 30

TABLE: tuple[Strategy, ...] = tuple(
    Strategy(math.radians(turn_deg), height, speed)
    for turn_deg, height, speed in product(_TURNS_DEG, Height, Speed)
    if speed is Speed.MISSION or abs(turn_deg) <= _LARGEST_TURN_WITH_SPEED_DEG
)
_GROUNDS = tuple(dict.fromkeys((row.turn_rad, row.speed) for row in TABLE))
_HEIGHTS = tuple(Height)
_GROUND_TURN_RAD = np.array([turn_rad for turn_rad, _ in _GROUNDS])
_GROUND_OF = np.array([_GROUNDS.index((row.turn_rad, row.speed)) for row in TABLE])
_HEIGHT_OF = np.array([_HEIGHTS.index(row.height) for row in TABLE])


@dataclass(frozen=True)
class CostWeights:
    """Prices. Losing the protected volume outweighs all else together."""

    margin: Annotated[float, Ge(0)] = 30.0  # times the penetration of the margin, 0 at its edge
    loss: Annotated[float, Ge(0)] = 40.0  # flat, for entering the protected volume itself
    depth: Annotated[float, Ge(0)] = 300.0  # times the deepest penetration, 0 at the edge, 1 at contact
    exposure: Annotated[float, Ge(0)] = 100.0  # times the mean penetration, so that leaving soon is better
    turn: Annotated[float, Ge(0)] = 0.6  # times the turn from the present course, per half circle
    deviation: Annotated[float, Ge(0)] = 6.0  # times the angle off the mission's course, per half circle
    height: Annotated[float, Ge(0)] = 0.8  # times the height off the mission's, per 100 m
    descent: Annotated[float, Ge(0)] = 0.2  # flat, for going below the mission: ground is there
    speed: Annotated[float, Ge(0)] = 0.5  # times the speed off the mission's, per 10 m/s
    switch: Annotated[float, Ge(0)] = 0.6  # flat, for anything but what is flown already
    wrong_side: Annotated[float, Ge(0)] = 0.3  # flat, for turning left where the rules of the air say right


@dataclass(frozen=True, slots=True)
class Situation:
    """What rows are made from and priced against."""

    own: OwnState
    mission: Guidance
    over_m: float  # the height that passes above every threat
    under_m: float  # the height that passes below every threat
    right_preferred: bool
    lost: float  # the separation, in protected volumes with margin, at which the bare volume is entered
    envelope: Envelope
    weights: CostWeights


@dataclass(frozen=True, slots=True)
class Priced:
    """Rows with their price, shape (K,), and how they keep clear of the nearest track, shape (K,)."""

    commands: Commands
    cost: Array
    closest: Array

    def best(self) -> int:
        """The cheapest row; the first of equals, so that the same inputs give the same row."""
        return int(np.argmin(self.cost))


def height_m(choice: Height, situation: Situation) -> float:
    """The altitude a choice of height asks for, within floor and ceiling."""
    wanted_m = {
        Height.MISSION: situation.mission.altitude_m,
        Height.LEVEL: -float(situation.own.position_m[2]),
        Height.OVER: situation.over_m,
        Height.UNDER: situation.under_m,
    }[choice]
    return situation.envelope.clamp_altitude_m(wanted_m)


def speed_mps(choice: Speed, situation: Situation) -> float:
    """The airspeed a choice of speed asks for, within the limits."""
    wanted_mps = {
        Speed.MISSION: situation.mission.airspeed_mps,
        Speed.SLOWEST: situation.envelope.min_airspeed_mps,
        Speed.FASTEST: situation.envelope.max_airspeed_mps,
    }[choice]
    return situation.envelope.clamp_airspeed_mps(wanted_mps)


def table_commands(situation: Situation) -> Commands:
    """The whole table as commands for this situation."""
    speeds_mps = {choice: speed_mps(choice, situation) for choice in Speed}
    return Commands(
        situation.own.course_rad + _GROUND_TURN_RAD,
        np.array([speeds_mps[speed] for _, speed in _GROUNDS]),
        np.array([height_m(choice, situation) for choice in _HEIGHTS]),
        _GROUND_OF,
        _HEIGHT_OF,
    )


def price(situation: Situation, commands: Commands, tracks: Tracks, held: Guidance | None) -> Priced:
    """Fly all rows ahead and price them; the guidance being flown, if there is one, as row 0."""
    if held is not None:
        commands = commands.after(held)
    kept = separation(fly_ahead(situation.own, commands, situation.envelope), tracks)
    weights = situation.weights
    # The margin is priced by how much of it is used, without a step: a flight planned along its edge is
    # flown a little differently, and must not be thrown over for that.
    depth = np.maximum(situation.lost - kept.closest, 0.0)
    cost = (
        weights.margin * np.maximum(1.0 - kept.closest, 0.0)
        + weights.loss * (depth > 0.0)
        + weights.depth * depth
        + weights.exposure * kept.exposure
    ).sum(axis=1)
    cost += effort(situation, commands)
    if held is not None:
        cost[1:] += weights.switch
    return Priced(commands, cost, kept.closest.min(axis=1))


def effort(situation: Situation, commands: Commands) -> Array:
    """What rows cost apart from separation, shape (K,)."""
    weights, mission = situation.weights, situation.mission
    off_course_rad = wrap_pi(commands.course_rad - mission.course_rad)
    ground = (
        weights.turn / math.pi * np.abs(wrap_pi(commands.course_rad - situation.own.course_rad))
        + weights.deviation / math.pi * np.abs(off_course_rad)
        + weights.speed / 10.0 * np.abs(commands.airspeed_mps - mission.airspeed_mps)
    )
    if situation.right_preferred:
        ground += weights.wrong_side * (off_course_rad < math.radians(-1.0))
    off_height_m = commands.altitude_m - mission.altitude_m
    height = weights.height / 100.0 * np.abs(off_height_m) + weights.descent * (off_height_m < -1.0)
    cost: Array = ground[commands.ground_of] + height[commands.height_of]
    return cost
