"""The joint table: UAVs that know each other respond jointly (paper abstract and §4.3, P12).

Every member has the same few responses, defined in advance: courses beside the one to its goal, and speeds.
All combinations of all members' responses are flown ahead. Among those that keep the separation and the
goals, the one with the best safety value (eq. 3) is chosen. No negotiation is needed: from the same states
every member computes the same combination, bit for bit, and flies its own part.
"""

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt
from numpy.typing import NDArray

from companion.avoidance.mission_path import course_and_altitude_to
from companion.avoidance.trajectory import TIME_SHARES, Array, Commands, Envelope, OwnState, Pace, fly_ahead
from companion.geodesy import wrap_pi, wrap_two_pi
from companion.model import Guidance, Member, Vec3

# In a larger group each member avoids the others like strangers.
_LARGEST_GROUP = 8
# Up to this many members, every combination is tried. In larger groups each member in turn improves its row,
# in the order of the ids.
_ALL_COMBINATIONS = 3
_ROUNDS = 10


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


@dataclass(frozen=True)
class FormationParams:
    """How a group keeps its members apart."""

    own_id: str = ""  # by which the other members know us; without one there is no group
    cooperate: bool = True
    # Members are in conflict, and respond, if straight ways to their goals would bring them nearer than this.
    influence_m: Annotated[float, Gt(0)] = 100.0
    separation_m: Annotated[float, Gt(0)] = 100.0  # between members, wherever some response keeps it
    # Members further apart than this ignore each other: more distance is worth nothing.
    reach_m: Annotated[float, Gt(0)] = 400.0
    # A joint response that leads nearer than this is not flown: each member then avoids the others like
    # strangers.
    smallest_m: Annotated[float, Gt(0)] = 50.0
    # A response makes the way to the goal at most this much longer, unless the separation requires more.
    largest_path_ratio: Annotated[float, Ge(1)] = 1.1
    # Cost of a turn by half a circle, or of a change by the whole speed, as a share of the reach.
    calm: Annotated[float, Ge(0)] = 0.05


@dataclass(frozen=True, slots=True)
class MemberState:
    """One member as all members know it: position and velocity over ground, north-east-down [m, m/s]."""

    member_id: str
    position_m: Vec3
    velocity_mps: Vec3
    member: Member


@dataclass(frozen=True, slots=True)
class JointResponse:
    """The guidance of each member, and the smallest distance between any two that it leads to [m].

    `straight_closest_m` is the distance if all fly straight to their goals.
    """

    guidance: Mapping[str, Guidance]
    closest_m: float
    straight_closest_m: float


def group_around(states: Sequence[MemberState], reach_m: float) -> list[MemberState]:
    """The first member and all within reach of it, directly or through others.

    The group is the same whichever of its members comes first.
    """
    group, waiting = [states[0]], list(states[1:])
    for one in group:
        near = [state for state in waiting if math.dist(state.position_m, one.position_m) < reach_m]
        waiting = [state for state in waiting if state not in near]
        group += near
    return group


def is_valid(state: MemberState) -> bool:
    """Whether all numbers that a member reports are finite, and its limits are those of an aircraft."""
    member, goal = state.member, state.member.goal
    numbers = [*state.position_m, *state.velocity_mps, member.min_airspeed_mps, member.max_airspeed_mps]
    numbers += [member.max_turn_rate_radps, *(goal.position_m or ())]
    numbers += [x for x in (goal.course_rad, goal.airspeed_mps, goal.altitude_m) if x is not None]
    return (
        all(map(math.isfinite, numbers))
        and 0.0 < member.min_airspeed_mps <= member.max_airspeed_mps <= 200.0
        and 0.0 < member.max_turn_rate_radps <= math.radians(90.0)
    )


def joint_response(states: Sequence[MemberState], params: FormationParams) -> JointResponse | None:
    """The best combination for these members, which may come in any order.

    `None` for a single member, for too many, for two with the same id, and if a distance is not finite. The
    wind is neglected: ground speed is taken as airspeed.
    """
    states = sorted(states, key=lambda state: state.member_id)
    ids = {state.member_id for state in states}
    if not 1 < len(ids) == len(states) <= _LARGEST_GROUP:
        return None
    positions = np.array([state.position_m for state in states])
    pairs = list(itertools.combinations(range(len(states)), 2))
    centre = positions.mean(axis=0)
    members = [_fly_responses(state, centre) for state in states]
    mean, least = {}, {}
    for i, j in pairs:
        mean[i, j], least[i, j] = _pair_distances(members[i].path_m, members[j].path_m, params.reach_m)
    table = _JointTable([member.steadiness for member in members], mean, least, params)
    chosen = table.best() if len(states) <= _ALL_COMBINATIONS else table.improved()
    closest = np.array([(least[i, j][chosen[i], chosen[j]], least[i, j][0, 0]) for i, j in pairs]).min(axis=0)
    if not np.isfinite(closest).all():
        return None
    parts = zip(states, members, chosen, strict=True)
    guidance = {state.member_id: member.commands.row(row) for state, member, row in parts}
    return JointResponse(guidance, float(closest[0]), float(closest[1]))


@dataclass(frozen=True, slots=True)
class _MemberPaths:
    """The R responses of one member: `path_m` (R, T, 3); `steadiness` (R,), 0 if unchanged, else negative."""

    path_m: Array
    steadiness: Array
    commands: Commands


def _fly_responses(state: MemberState, centre_m: Array) -> _MemberPaths:
    member, velocity = state.member, state.velocity_mps
    speed_mps = math.hypot(velocity[0], velocity[1])
    present_rad = math.atan2(velocity[1], velocity[0])
    bearing_rad, altitude_m = course_and_altitude_to(member.goal, state.position_m, present_rad)
    wanted_mps = speed_mps if member.goal.airspeed_mps is None else member.goal.airspeed_mps
    course_rad = present_rad if speed_mps > 1.0 else bearing_rad
    envelope = Envelope(
        min_airspeed_mps=member.min_airspeed_mps,
        max_airspeed_mps=member.max_airspeed_mps,
        max_turn_rate_radps=member.max_turn_rate_radps,
        max_bank_rad=math.radians(79.0),  # so that the turn rate is the limit
    )
    speeds_mps = {pace: envelope.airspeed_mps(pace, wanted_mps) for pace in Pace}
    commands = Commands.of(
        [
            Guidance(wrap_two_pi(bearing_rad + row.beside_rad), speeds_mps[row.pace], altitude_m)
            for row in RESPONSES
        ]
    )
    own = OwnState(
        # Relative to the centre of the group, so that rounding does not depend on the origin of the frame.
        (
            state.position_m[0] - float(centre_m[0]),
            state.position_m[1] - float(centre_m[1]),
            state.position_m[2],
        ),
        course_rad,
        max(speed_mps, 1.0),
        -velocity[2],
        (0.0, 0.0),
    )
    paths = fly_ahead(own, commands, envelope)
    path_m = np.concatenate([paths.ground_m, -paths.altitude_m[:, :, None]], axis=2)
    turn = np.array([abs(wrap_pi(float(c) - course_rad)) / math.pi for c in commands.course_rad])
    change = np.abs(commands.airspeed_mps - speed_mps) / max(speeds_mps[Pace.KEEP], 1.0)
    return _MemberPaths(path_m, -(turn + change), commands)


def _pair_distances(one_m: Array, other_m: Array, reach_m: float) -> tuple[Array, Array]:
    """For all pairs of rows, (R, R): the mean distance over time, capped at the reach, and the smallest."""
    offset = one_m[:, None] - other_m[None, :]
    distance = np.sqrt(np.einsum("abti,abti->abt", offset, offset))
    return np.minimum(distance, reach_m)[..., 1:] @ TIME_SHARES, distance.min(axis=2)


@dataclass(frozen=True)
class _JointTable:
    """The joint table: `steadiness` (R,) of each member; mean and least distance (R, R) of each pair."""

    steadiness: Sequence[Array]
    mean: Mapping[tuple[int, int], Array]
    least: Mapping[tuple[int, int], Array]
    params: FormationParams

    def best(self) -> tuple[int, ...]:
        """The best of all combinations; among equals the first, in the order of ids and rows."""
        count = len(self.steadiness)
        return self._best_of([np.arange(len(RESPONSES))] * count)

    def improved(self) -> tuple[int, ...]:
        """Starting straight to the goals, members in turn take their best row, until none changes."""
        chosen = [0] * len(self.steadiness)
        for _ in range(_ROUNDS):
            before = list(chosen)
            for member in range(len(chosen)):
                open_rows = [np.array([row]) for row in chosen]
                open_rows[member] = np.arange(len(RESPONSES))
                chosen = list(self._best_of(open_rows))
            if chosen == before:
                break
        return tuple(chosen)

    def _best_of(self, rows: Sequence[NDArray[np.intp]]) -> tuple[int, ...]:
        """The best combination of the given rows, `rows[i]` of member i."""
        params, count = self.params, len(rows)
        shape = tuple(len(r) for r in rows)
        value, closest = np.zeros(shape), np.full(shape, np.inf)
        for (i, j), mean in self.mean.items():
            picked = np.ix_(rows[i], rows[j])
            value += _along(mean[picked], (i, j), count) / len(self.mean)
            closest = np.minimum(closest, _along(self.least[i, j][picked], (i, j), count))
        straight = np.ones(shape, dtype=bool)
        too_long = (params.largest_path_ratio < _PATH_RATIO).astype(np.float64)
        for i, steadiness in enumerate(self.steadiness):
            value += _along(steadiness[rows[i]], (i,), count) * params.calm * params.reach_m / count
            straight &= _along(too_long[rows[i]], (i,), count) == 0.0
        kept = closest >= params.separation_m
        # If no combination keeps the separation, the one with the largest distance is best, however long.
        wanted = straight & kept if (straight & kept).any() else kept
        score = np.where(wanted, value, -np.inf) if wanted.any() else closest
        place = np.unravel_index(int(np.argmax(score)), shape)
        return tuple(int(r[p]) for r, p in zip(rows, place, strict=True))


def _along(values: Array, axes: tuple[int, ...], count: int) -> Array:
    """The values on these axes of a joint table with `count` axes, for broadcasting along the others."""
    shape = [1] * count
    for axis, length in zip(axes, values.shape, strict=True):
        shape[axis] = length
    return values.reshape(shape)
