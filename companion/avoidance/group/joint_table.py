"""The joint table: members of a group respond together (paper abstract and §4.3, P12).

Every member has the same few responses, defined in advance: courses beside the one to its goal, and speeds.
Combinations of all members' responses are flown ahead. Among those that keep the separation and the goals,
the one with the best safety value (eq. 3) is chosen. From the same states every member computes the same
combination, bit for bit.
"""

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from companion.avoidance.group.formation import LARGEST_GROUP, FormationParams, MemberState
from companion.avoidance.mission_path import course_and_altitude_to
from companion.avoidance.trajectory import (
    TIMES_S,
    Array,
    Commands,
    Envelope,
    OwnState,
    Pace,
    count_until,
    fly_ahead,
)
from companion.compiled import pairs
from companion.geodesy import wrap_pi, wrap_two_pi
from companion.model import Guidance, Member

# Up to this many members, the best of all combinations is found. In larger groups each member in turn takes
# its best row, in the order of the ids, from several combinations in which all members have the same row.
_ALL_COMBINATIONS: Final = 4
_ROUNDS: Final = 10
# Values that differ by less are equal: those of a part are added in another order than those of the whole.
_SAME_VALUE: Final = 1e-9

Rows = NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class Response:
    """One row: an angle from the course to the goal (positive to the right), and a speed."""

    beside_rad: float
    pace: Pace

    @property
    def path_ratio(self) -> float:
        """Length of the way to the goal with this response throughout, over that of the straight way."""
        return 1.0 / math.cos(self.beside_rad)


RESPONSES: tuple[Response, ...] = tuple(
    Response(math.radians(beside_deg), pace)
    for beside_deg in (0, 15, -15, 30, -30, 45, -45, 60, -60)
    for pace in Pace
)
_PATH_RATIO = np.array([response.path_ratio for response in RESPONSES])


@dataclass(frozen=True, slots=True)
class JointResponse:
    """The guidance of each member, and the smallest distance between any two that it leads to [m].

    `straight_closest_m` is the distance if all fly straight to their goals.
    """

    guidance: Mapping[str, Guidance]
    closest_m: float
    straight_closest_m: float


def joint_response(states: Sequence[MemberState], params: FormationParams) -> JointResponse | None:
    """The best combination for these members, which may come in any order.

    `None` for a single member, for too many, for two with the same id, and if a distance is not finite. The
    wind is neglected: ground speed is taken as airspeed.
    """
    states = sorted(states, key=lambda state: state.member_id)
    ids = {state.member_id for state in states}
    if not 1 < len(ids) == len(states) <= LARGEST_GROUP:
        return None
    centre_m = np.array([state.position_m for state in states]).mean(axis=0)
    members = [MemberPaths.of(state, centre_m, params) for state in states]
    if not all(np.isfinite(member.path_m).all() for member in members):
        return None
    # The short responses alone are tried first: with them, the best that keeps the separation is the best.
    for rows in (np.flatnonzero(params.largest_path_ratio >= _PATH_RATIO), np.arange(len(RESPONSES))):
        table = JointTable.of(members, rows, params)
        chosen = table.best()
        if table.closest_m(chosen) >= params.separation_m:
            break
    guidance = {
        state.member_id: member.commands.row(int(rows[row]))
        for state, member, row in zip(states, members, chosen, strict=True)
    }
    straight = (0,) * len(states)
    return JointResponse(guidance, table.closest_m(chosen), table.closest_m(straight))


@dataclass(frozen=True, slots=True)
class MemberPaths:
    """The R responses of one member: `path_m` (R, T, 3); `steadiness` (R,), 0 if unchanged, else negative."""

    path_m: Array
    steadiness: Array
    commands: Commands

    @classmethod
    def of(cls, state: MemberState, centre_m: Array, params: FormationParams) -> "MemberPaths":
        """The responses of a member, with positions relative to `centre_m`."""
        bearing_rad, altitude_m = _to_goal(state)
        envelope = envelope_of(state.member)
        wanted_mps = _wanted_mps(state)
        speeds_mps = {pace: envelope.airspeed_mps(pace, wanted_mps) for pace in Pace}
        commands = Commands.of(
            [
                Guidance(wrap_two_pi(bearing_rad + row.beside_rad), speeds_mps[row.pace], altitude_m)
                for row in RESPONSES
            ]
        )
        present = _present(state)
        turn = np.array([abs(wrap_pi(float(c) - present.course_rad)) / math.pi for c in commands.course_rad])
        change = np.abs(commands.airspeed_mps - present.airspeed_mps) / max(speeds_mps[Pace.KEEP], 1.0)
        path_m = paths_of(state, commands, centre_m, params.horizon_s)
        path_m[0] = _onward(state, path_m[0], centre_m, speeds_mps[Pace.KEEP])
        return cls(path_m, -(turn + change), commands)


def _present(state: MemberState) -> Guidance:
    """What a member flies now: its answer if it has announced one, otherwise its motion."""
    intent, velocity = state.member.intent, state.velocity_mps
    if intent is not None and intent.flown is not None:
        return intent.flown
    speed_mps = math.hypot(velocity[0], velocity[1])
    course_rad = math.atan2(velocity[1], velocity[0]) if speed_mps > 1.0 else _to_goal(state)[0]
    return Guidance(course_rad, speed_mps, -state.position_m[2])


def _to_goal(state: MemberState) -> tuple[float, float]:
    """Course and height to the goal [rad, m]."""
    present_rad = math.atan2(state.velocity_mps[1], state.velocity_mps[0])
    return course_and_altitude_to(state.member.goal, state.position_m, present_rad)


def _wanted_mps(state: MemberState) -> float:
    goal_mps = state.member.goal.airspeed_mps
    return math.hypot(*state.velocity_mps[:2]) if goal_mps is None else goal_mps


def mission_of(state: MemberState) -> Guidance:
    """The guidance straight to the goal of a member."""
    course_rad, altitude_m = _to_goal(state)
    airspeed_mps = envelope_of(state.member).clamp_airspeed_mps(_wanted_mps(state))
    return Guidance(wrap_two_pi(course_rad), airspeed_mps, altitude_m)


def envelope_of(member: Member) -> Envelope:
    """What a member can fly, as it announces it."""
    return Envelope(
        min_airspeed_mps=member.min_airspeed_mps,
        max_airspeed_mps=member.max_airspeed_mps,
        max_turn_rate_radps=member.max_turn_rate_radps,
        max_bank_rad=math.radians(79.0),  # so that the turn rate is the limit
    )


def paths_of(state: MemberState, commands: Commands, centre_m: Array, horizon_s: float) -> Array:
    """Where commands lead a member, (R, T, 3) relative to `centre_m`, at the times until the horizon."""
    velocity = state.velocity_mps
    speed_mps = math.hypot(velocity[0], velocity[1])
    own = OwnState(
        # Relative to the centre of the group, so that rounding does not depend on the origin of the frame.
        (
            state.position_m[0] - float(centre_m[0]),
            state.position_m[1] - float(centre_m[1]),
            state.position_m[2],
        ),
        math.atan2(velocity[1], velocity[0]) if speed_mps > 1.0 else _to_goal(state)[0],
        max(speed_mps, 1.0),
        -velocity[2],
        (0.0, 0.0),
    )
    paths = fly_ahead(own, commands, envelope_of(state.member))
    path_m = np.concatenate([paths.ground_m, -paths.altitude_m[:, :, None]], axis=2)
    return np.ascontiguousarray(path_m[:, : count_until(horizon_s)])


def mission_path_of(state: MemberState, centre_m: Array, horizon_s: float) -> Array:
    """Where the mission leads a member, (1, T, 3): to its goal, and from there to the place after it."""
    mission = mission_of(state)
    path_m = paths_of(state, Commands.of([mission]), centre_m, horizon_s)
    path_m[0] = _onward(state, path_m[0], centre_m, mission.airspeed_mps)
    return path_m


def _onward(state: MemberState, path_m: Array, centre_m: Array, speed_mps: float) -> Array:
    """The path (T, 3) to the goal, continued to the place after it as soon as the goal is reached."""
    goal = state.member.goal
    if goal.position_m is None or goal.then_m is None:
        return path_m
    goal_m, then_m = np.array(goal.position_m[:2]), np.array(goal.then_m[:2])
    leg_m = float(np.hypot(*(then_m - goal_m)))
    to_goal_s = math.dist(goal.position_m[:2], state.position_m[:2]) / max(speed_mps, 1.0)
    times_s = TIMES_S[: len(path_m)]
    if leg_m < 1.0 or to_goal_s >= times_s[-1]:
        return path_m
    beyond_m = np.maximum(times_s - to_goal_s, 0.0)[:, None] * speed_mps
    continued_m = path_m.copy()
    after = times_s > to_goal_s
    continued_m[after, :2] = (goal_m - centre_m[:2] + beyond_m * (then_m - goal_m) / leg_m)[after]
    return continued_m


def pair_distances(one_m: Array, other_m: Array, reach_m: float) -> tuple[Array, Array]:
    """For all pairs of rows, (R, S): the mean distance over time, capped at the reach, and the smallest."""
    return pairs.pair_distances(one_m, other_m, TIMES_S[: one_m.shape[1]], reach_m)


@dataclass(frozen=True)
class JointTable:
    """R rows of each of N members: `value` of a row of one (N, R), of two rows of two (N, N, R, R).

    `least` (N, N, R, R) is the smallest distance of two rows; that of a member from itself is infinite.
    """

    alone: Array
    value: Array
    least: Array
    separation_m: float

    @classmethod
    def of(cls, members: Sequence[MemberPaths], rows: Rows, params: FormationParams) -> "JointTable":
        """The table of these rows. The value of a combination is a distance [m]."""
        count = len(members)
        value = np.zeros((count, count, len(rows), len(rows)))
        least = np.full_like(value, np.inf)
        both = list(itertools.combinations(range(count), 2))
        for i, j in both:
            mean, nearest = pair_distances(members[i].path_m[rows], members[j].path_m[rows], params.reach_m)
            value[i, j], value[j, i] = mean / len(both), mean.T / len(both)
            least[i, j], least[j, i] = nearest, nearest.T
        calm = params.calm * params.reach_m / count
        alone = np.array([member.steadiness[rows] for member in members]) * calm
        return cls(alone, value, least, params.separation_m)

    def best(self) -> tuple[int, ...]:
        """The combination with the best value among those that keep the separation.

        If none does, that with the largest distance. Of equals the first, in the order of ids and rows.
        """
        improved = self._improved()
        if len(self.alone) > _ALL_COMBINATIONS:
            return improved
        if self.closest_m(improved) >= self.separation_m:
            return self._best_kept(self._value(improved))
        kept = self._best_kept(-math.inf)
        return kept or self._furthest_apart(self.closest_m(improved)) or improved

    def closest_m(self, chosen: Sequence[int]) -> float:
        """The smallest distance between any two members [m]."""
        return min(
            float(self.least[i, j, chosen[i], chosen[j]])
            for i, j in itertools.combinations(range(len(chosen)), 2)
        )

    def _value(self, chosen: Sequence[int]) -> float:
        both = itertools.combinations(range(len(chosen)), 2)
        alone = math.fsum(float(self.alone[i, row]) for i, row in enumerate(chosen))
        return alone + math.fsum(float(self.value[i, j, chosen[i], chosen[j]]) for i, j in both)

    def _best_kept(self, at_least: float) -> tuple[int, ...]:
        """The best combination that keeps the separation, () if there is none.

        Members are added one by one. A part is given up when it cannot become as good as `at_least`, even
        with the best rows of the members that are missing.
        """
        count = len(self.alone)
        tops = [
            float(self.alone[k].max()) + math.fsum(float(self.value[j, k].max()) for j in range(k))
            for k in range(count)
        ]
        parts, values = np.arange(self.alone.shape[1])[:, None], self.alone[0]
        for k in range(1, count):
            added = values[:, None] + self.alone[k]
            kept = np.ones(added.shape, dtype=bool)
            for j in range(k):
                added = added + self.value[j, k][parts[:, j]]
                kept &= self.least[j, k][parts[:, j]] >= self.separation_m
            kept &= added + math.fsum(tops[k + 1 :]) >= at_least - _SAME_VALUE
            part, row = np.nonzero(kept)
            parts, values = np.column_stack([parts[part], row]), added[part, row]
        return tuple(map(int, parts[int(np.argmax(values))])) if len(parts) else ()

    def _furthest_apart(self, at_least_m: float) -> tuple[int, ...]:
        """The combination with the largest distance between the two nearest members."""
        if at_least_m >= self.least.max(axis=(2, 3)).min() - _SAME_VALUE:
            return ()  # no two members could be further apart than that
        parts, closest = np.arange(self.alone.shape[1])[:, None], np.full(self.alone.shape[1], np.inf)
        for k in range(1, len(self.alone)):
            nearest = np.broadcast_to(closest[:, None], (len(parts), self.alone.shape[1]))
            for j in range(k):
                nearest = np.minimum(nearest, self.least[j, k][parts[:, j]])
            part, row = np.nonzero(nearest >= at_least_m)
            parts, closest = np.column_stack([parts[part], row]), nearest[part, row]
        return tuple(map(int, parts[int(np.argmax(closest))]))

    def _improved(self) -> tuple[int, ...]:
        """From each combination of equal rows, members in turn take their best row until none changes."""
        found = [self._improve([row] * len(self.alone)) for row in range(0, self.alone.shape[1], len(Pace))]
        return max(found, key=self._rank)  # the first of equals

    def _rank(self, chosen: tuple[int, ...]) -> tuple[float, float]:
        closest_m = self.closest_m(chosen)
        return min(closest_m, self.separation_m), self._value(chosen)

    def _improve(self, chosen: list[int]) -> tuple[int, ...]:
        return tuple(pairs.improve(self.alone, self.value, self.least, self.separation_m, chosen, _ROUNDS))
