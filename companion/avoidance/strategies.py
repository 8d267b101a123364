"""The strategy table (paper §3.2.3, P7-P10): rows of course, speed and height.

A row is a choice in each of the three controls. Among the rows are the paper's heading rule (eq. 11), its
speed rule (eq. 13), height (P9) and their combinations. `cost` flies them ahead and finds the cheapest.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cache
from itertools import product

import numpy as np

from companion.avoidance.cost import CostContext
from companion.avoidance.envelope import Control, Pace
from companion.avoidance.trajectory import Commands


class Course(StrEnum):
    """A choice of course."""

    MISSION = "mission course"
    RULE = "heading rule"  # eq. 11
    TURN = "turn"  # by the row's own angle, from the present course


class Height(StrEnum):
    """A choice of height, the third control (§2.3, §3.2.3)."""

    MISSION = "mission height"
    LEVEL = "level off"
    OVER = "over"
    UNDER = "under"


class Speed(StrEnum):
    """A choice of airspeed."""

    MISSION = "mission speed"
    RULE = "speed rule"  # eq. 13
    SLOWEST = "slowest"
    FASTEST = "fastest"


@dataclass(frozen=True, slots=True)
class Ground:
    """The horizontal half of a row: course, turn from the present one (positive to the right), speed."""

    course: Course
    turn_rad: float
    speed: Speed


@dataclass(frozen=True, slots=True)
class Strategy:
    """One row: a ground path and a height."""

    ground: Ground
    height: Height

    @property
    def controls(self) -> frozenset[Control]:
        """The controls that the row uses."""
        used = (
            (Control.HEADING, self.ground.course is not Course.MISSION),
            (Control.SPEED, self.ground.speed is not Speed.MISSION),
            (Control.HEIGHT, self.height is not Height.MISSION),
        )
        return frozenset(control for control, is_used in used if is_used)


# The reciprocal course is never commanded: the turn could go either way, and not the way that was predicted.
_TURNS_DEG = (0, 15, -15, 30, -30, 45, -45, 60, -60, 90, -90, 120, -120, 150, -150, 165, -165)
# On small turns a few metres per second decide whether we pass ahead or behind; on large turns they do not.
_LARGEST_TURN_WITH_SPEED_DEG = 30

GROUNDS: tuple[Ground, ...] = (
    *(Ground(Course.MISSION, 0.0, speed) for speed in Speed),
    *(Ground(Course.RULE, 0.0, speed) for speed in (Speed.MISSION, Speed.RULE)),
    *(Ground(Course.TURN, math.radians(turn_deg), Speed.MISSION) for turn_deg in _TURNS_DEG),
    *(
        Ground(Course.TURN, math.radians(turn_deg), speed)
        for turn_deg in _TURNS_DEG
        for speed in (Speed.SLOWEST, Speed.FASTEST)
        if abs(turn_deg) <= _LARGEST_TURN_WITH_SPEED_DEG
    ),
)

TABLE: tuple[Strategy, ...] = tuple(Strategy(ground, height) for ground, height in product(GROUNDS, Height))


def height_m(choice: Height, context: CostContext) -> float:
    """The height of a choice above the zero of the local frame, within floor and ceiling [m]."""
    match choice:
        case Height.MISSION:
            wanted_m = context.mission.altitude_m
        case Height.LEVEL:
            wanted_m = -context.own.position_m[2]
        case Height.OVER:
            wanted_m = context.over_m
        case Height.UNDER:
            wanted_m = context.under_m
    return context.envelope.clamp_altitude_m(wanted_m)


def speed_mps(choice: Speed, context: CostContext) -> float:
    """The airspeed of a choice, within the limits [m/s]."""
    match choice:
        case Speed.MISSION:
            pace = Pace.KEEP
        case Speed.RULE:
            pace = context.rule_pace
        case Speed.SLOWEST:
            pace = Pace.SLOWEST
        case Speed.FASTEST:
            pace = Pace.FASTEST
    return context.envelope.airspeed_mps(pace, context.mission.airspeed_mps)


class StrategyTable:
    """Rows of the table, prepared to become commands."""

    def __init__(self, rows: Sequence[Strategy]) -> None:
        self.rows = tuple(rows)
        self._grounds = tuple(dict.fromkeys(row.ground for row in rows))
        self._heights = tuple(dict.fromkeys(row.height for row in rows))
        self._ground_of = np.array([self._grounds.index(row.ground) for row in rows])
        self._height_of = np.array([self._heights.index(row.height) for row in rows])
        self._turn_rad = np.array([ground.turn_rad for ground in self._grounds])
        self._on_mission = np.array([ground.course is Course.MISSION for ground in self._grounds])
        self._by_rule = np.array([ground.course is Course.RULE for ground in self._grounds])

    @classmethod
    @cache
    def within(cls, controls: frozenset[Control]) -> "StrategyTable":
        """The rows that use only these controls."""
        return cls([row for row in TABLE if row.controls <= controls])

    def commands(self, context: CostContext) -> Commands:
        """Every row as a command in this context."""
        course_rad = context.own.course_rad + self._turn_rad
        course_rad[self._on_mission] = context.mission.course_rad
        course_rad[self._by_rule] = context.rule_course_rad
        speeds_mps = {choice: speed_mps(choice, context) for choice in Speed}
        return Commands(
            course_rad,
            np.array([speeds_mps[ground.speed] for ground in self._grounds]),
            np.array([height_m(choice, context) for choice in self._heights]),
            self._ground_of,
            self._height_of,
        )
