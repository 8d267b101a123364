"""Inner layer: emergencies (paper §3.2.3, P7-P10). The strategy table is flown ahead; its cheapest row wins.

A row is a choice of course, speed and height. Among the rows are the heading rule (eq. 11), the speed rule
(eq. 13), height (P9) and their combinations. `cost` flies them ahead and finds the cheapest.
"""

import math
from collections.abc import Sequence, Set
from dataclasses import dataclass
from enum import StrEnum
from functools import cache
from itertools import product
from typing import NamedTuple

import numpy as np

from companion.avoidance.cost import Conflict, CostContext, EvaluatedRows, Height, Speed, evaluate_rows
from companion.avoidance.intruders import Tracks
from companion.avoidance.trajectory import Array, Commands, Control, Pace
from companion.geodesy import wrap_pi, wrap_two_pi
from companion.model import Guidance

# Angles closer than this to the edge of a case count as on it, so that rounding does not decide the side.
_EDGE_RAD = 1e-6
_STILL_MPS = 0.1


def heading_rule_rad(
    course_rad: float, rel_position_m: Array, other_velocity_mps: Array, own_velocity_mps: Array
) -> float:
    """Eq. 11, figure 4: the course to turn to, in [0, 2 pi).

    alpha is the angle from our course to the threat's track, b the bearing of the threat from our course, phi
    the turn; all are positive to the left. With the threat on the right (b < 0) phi = alpha - pi/2
    sgn(alpha), across its track. On the left phi = alpha + pi/4 sgn(alpha). A stationary threat has a track
    only relative to us. `rel_position_m` is threat minus own, (2+,); velocities are over ground, (2+,).
    """
    still = math.hypot(other_velocity_mps[0], other_velocity_mps[1]) < _STILL_MPS
    track = -own_velocity_mps if still else other_velocity_mps
    alpha = _to_left_rad(course_rad, track)
    side = 1.0 if alpha > -_EDGE_RAD else -1.0
    b = _to_left_rad(course_rad, rel_position_m)
    phi = alpha - side * math.pi / 2.0 if b < -_EDGE_RAD else alpha + side * math.pi / 4.0
    return wrap_two_pi(course_rad - phi)


def _to_left_rad(course_rad: float, vector: Array) -> float:
    """The angle from a course to a vector, positive to the left; exactly behind counts as left."""
    angle_rad = wrap_pi(course_rad - math.atan2(vector[1], vector[0]))
    return math.pi if angle_rad < -math.pi + _EDGE_RAD else angle_rad


def speed_rule(rel_position_m: Array, other_velocity_mps: Array, own_velocity_mps: Array) -> Pace:
    """Eq. 13, figure 5: V_min if the threat is first where the two straight tracks cross, V_max if we are.

    The printed cases contradict the sentence before them; this follows the sentence. Without a crossing ahead
    of both aircraft the speed is kept. Arrays as in `heading_rule_rad`.
    """
    own, other = own_velocity_mps, other_velocity_mps
    cross = own[0] * other[1] - own[1] * other[0]
    if abs(cross) < 1e-6 * max(math.hypot(*own[:2]) * math.hypot(*other[:2]), _STILL_MPS**2):
        return Pace.KEEP
    own_s = (rel_position_m[0] * other[1] - rel_position_m[1] * other[0]) / cross
    other_s = (rel_position_m[0] * own[1] - rel_position_m[1] * own[0]) / cross
    if own_s < 0.0 or other_s < 0.0:
        return Pace.KEEP
    # On an exact collision course neither is first: the slower aircraft can still turn behind the other.
    return Pace.SLOWEST if other_s <= own_s + 1e-6 else Pace.FASTEST


class Course(StrEnum):
    """A choice of course."""

    MISSION = "mission course"
    RULE = "heading rule"  # eq. 11
    TURN = "turn"  # by the row's own angle, from the present course


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
        speeds_mps = {choice: context.speed_mps(choice) for choice in Speed}
        return Commands(
            course_rad,
            np.array([speeds_mps[ground.speed] for ground in self._grounds]),
            np.array([context.height_m(choice) for choice in self._heights]),
            self._ground_of,
            self._height_of,
        )


class _Rule(NamedTuple):
    """The reactive rules against one track."""

    track_id: str
    course_rad: float
    pace: Pace


class InnerLayer:
    """The strategy table, and the memory of the reactive rules.

    Applied again to a course that it has caused, the heading rule (eq. 11) would lead round the threat for
    ever. So its course is fixed when a threat becomes the nearest, for as long as it is the nearest.
    """

    def __init__(self, controls: Set[Control]) -> None:
        self._rule: _Rule | None = None
        self.retune(controls)

    def retune(self, controls: Set[Control]) -> None:
        """Use only rows with these controls from now on."""
        self._table = StrategyTable.within(frozenset(controls))

    def reset(self) -> None:
        """Forget the threat that the rules were applied to."""
        self._rule = None

    def evaluate(self, conflict: Conflict) -> EvaluatedRows:
        """The table priced against the most urgent tracks."""
        self._rule = rule = self._rule_for(conflict)
        context = conflict.context._replace(rule_course_rad=rule.course_rad, rule_pace=rule.pace)
        return self.evaluate_table(context, conflict.urgent, conflict.last_guidance)

    def evaluate_table(
        self, context: CostContext, tracks: Tracks, last_guidance: Guidance | None
    ) -> EvaluatedRows:
        """The table priced in a context that has the rules; the last guidance, if any, is row 0."""
        return evaluate_rows(context, self._table.commands(context), tracks, last_guidance)

    def _rule_for(self, conflict: Conflict) -> _Rule:
        """Eq. 11 and 13 against the nearest threat."""
        state, (tracks, motion) = conflict.context.own, conflict.assessment[:2]
        nearest = conflict.assessment.nearest
        track_id = tracks.ids[nearest]
        rel_m, other_mps, own_mps = (
            motion.position_m[nearest],
            tracks.velocity_mps[nearest],
            state.velocity_mps,
        )
        pace = speed_rule(rel_m, other_mps, own_mps)
        if self._rule is not None and self._rule.track_id == track_id:
            return self._rule._replace(pace=pace)
        return _Rule(track_id, heading_rule_rad(state.course_rad, rel_m, other_mps, own_mps), pace)
