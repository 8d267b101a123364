"""The group: UAVs that know each other answer each other by one joint table (paper abstract and §4.3, P12).

Each member has the same few responses, set in advance: courses beside the way to its goal, and speeds. Every
combination of everybody's responses is flown ahead; among those that keep the separation and the goals, the
one with the best safety value (eq. 3) is chosen. There is nothing to agree upon: who has the same states
before him comes to the same combination, bit for bit, whoever he is, and flies his own part of it.
"""

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt
from numpy.typing import NDArray

from companion.avoidance.envelope import Envelope, Pace
from companion.avoidance.geometry import Array
from companion.avoidance.trajectory import TIME_SHARES, Commands, OwnState, fly_ahead, to_goal
from companion.model import Guidance, Member, Vec3
from companion.units import wrap_pi, wrap_two_pi

# In larger groups everybody avoids the others as he avoids strangers.
_LARGEST_GROUP = 8
# Up to so many members every combination is tried; more of them improve one after the other, in order of id.
_ALL_COMBINATIONS = 3
_ROUNDS = 10


@dataclass(frozen=True, slots=True)
class Response:
    """One row: a course beside the one to the goal (right is positive), and a speed."""

    beside_rad: float
    pace: Pace

    @property
    def path_ratio(self) -> float:
        """How much longer the way to the goal gets if this is flown all the way."""
        return 1.0 / math.cos(self.beside_rad)


RESPONSES: tuple[Response, ...] = tuple(
    Response(math.radians(beside_deg), pace)
    for beside_deg in (0, 15, -15, 30, -30, 45, -45, 60, -60)
    for pace in Pace
)
_PATH_RATIO = np.array([response.path_ratio for response in RESPONSES])


@dataclass(frozen=True)
class FormationParams:
    """How a group keeps apart. `own_id` is the id by which the other members know us."""

    own_id: str = ""  # without one there is no group
    cooperate: bool = True
    # Flying straight to their goals, members that would come nearer than this are in conflict, and answer.
    influence_m: Annotated[float, Gt(0)] = 100.0
    separation_m: Annotated[float, Gt(0)] = 100.0  # kept between members wherever any response does
    # Members further apart than this leave each other alone: distance is of no more worth.
    reach_m: Annotated[float, Gt(0)] = 400.0
    # A joint response that leads nearer than this is none: then each avoids the others like anybody else.
    smallest_m: Annotated[float, Gt(0)] = 50.0
    # Goals are kept: no longer ways than this, unless separation asks for them.
    largest_path_ratio: Annotated[float, Ge(1)] = 1.1
    # What a half circle of turn, or a change by the whole speed, must be worth, in shares of the reach.
    calm: Annotated[float, Ge(0)] = 0.05


@dataclass(frozen=True, slots=True)
class MemberState:
    """One member as all of them know it: north-east-down, over ground [m, m/s]."""

    member_id: str
    position_m: Vec3
    velocity_mps: Vec3
    member: Member


@dataclass(frozen=True, slots=True)
class Answer:
    """What each member flies, and the smallest distance between any two that this leads to [m].

    `unanswered_m` is that distance if everybody flies straight to his goal.
    """

    guidance: Mapping[str, Guidance]
    closest_m: float
    unanswered_m: float


def group_of(states: Sequence[MemberState], reach_m: float) -> list[MemberState]:
    """The first state and who is within reach of it, or of somebody who is: they all find the same group."""
    group, waiting = [states[0]], list(states[1:])
    for one in group:
        near = [state for state in waiting if math.dist(state.position_m, one.position_m) < reach_m]
        waiting = [state for state in waiting if state not in near]
        group += near
    return group


def joint_response(states: Sequence[MemberState], params: FormationParams) -> Answer | None:
    """The best combination for these members, given in whatever order.

    `None` for nobody else, for too many, for two of one id, and where the states are beyond all sense. The
    wind is not considered: all are taken to go on over the ground as fast as they do now.
    """
    states = sorted(states, key=lambda state: state.member_id)
    ids = {state.member_id for state in states}
    if not 1 < len(ids) == len(states) <= _LARGEST_GROUP:
        return None
    places = np.array([state.position_m for state in states])
    pairs = list(itertools.combinations(range(len(states)), 2))
    centre = places.mean(axis=0)
    flights = [_flown(state, centre) for state in states]
    mean, least = {}, {}
    for i, j in pairs:
        mean[i, j], least[i, j] = _between(flights[i].path_m, flights[j].path_m, params.reach_m)
    table = _Table([flight.calm for flight in flights], mean, least, params)
    chosen = table.best() if len(states) <= _ALL_COMBINATIONS else table.improved()
    closest = np.array([(least[i, j][chosen[i], chosen[j]], least[i, j][0, 0]) for i, j in pairs]).min(axis=0)
    if not np.isfinite(closest).all():
        return None
    parts = zip(states, flights, chosen, strict=True)
    guidance = {state.member_id: flown.guidance(row) for state, flown, row in parts}
    return Answer(guidance, float(closest[0]), float(closest[1]))


def is_sound(state: MemberState) -> bool:
    """Whether a member's words can be reckoned with: finite, and limits that some aircraft may have."""
    member, goal = state.member, state.member.goal
    numbers = [*state.position_m, *state.velocity_mps, member.min_airspeed_mps, member.max_airspeed_mps]
    numbers += [member.max_turn_rate_radps, *(goal.position_m or ())]
    numbers += [x for x in (goal.course_rad, goal.airspeed_mps, goal.altitude_m) if x is not None]
    return (
        all(map(math.isfinite, numbers))
        and 0.0 < member.min_airspeed_mps <= member.max_airspeed_mps <= 200.0
        and 0.0 < member.max_turn_rate_radps <= math.radians(90.0)
    )


@dataclass(frozen=True, slots=True)
class _Flown:
    """All responses of one member: `path_m` (R, T, 3), how much each leaves as it is (R,), its commands."""

    path_m: Array
    calm: Array
    commands: Commands

    def guidance(self, row: int) -> Guidance:
        return self.commands.row(row)


def _flown(state: MemberState, centre_m: Array) -> _Flown:
    member, velocity = state.member, state.velocity_mps
    speed_mps = math.hypot(velocity[0], velocity[1])
    present_rad = math.atan2(velocity[1], velocity[0])
    bearing_rad, altitude_m = to_goal(state.position_m, present_rad, member.goal)
    wanted_mps = speed_mps if member.goal.airspeed_mps is None else member.goal.airspeed_mps
    course_rad = present_rad if speed_mps > 1.0 else bearing_rad
    envelope = Envelope(
        min_airspeed_mps=member.min_airspeed_mps,
        max_airspeed_mps=member.max_airspeed_mps,
        max_turn_rate_radps=member.max_turn_rate_radps,
        max_bank_rad=math.radians(79.0),  # the turn rate says it all
    )
    speeds_mps = {pace: envelope.airspeed_mps(pace, wanted_mps) for pace in Pace}
    commands = Commands.of(
        [
            Guidance(wrap_two_pi(bearing_rad + row.beside_rad), speeds_mps[row.pace], altitude_m)
            for row in RESPONSES
        ]
    )
    own = OwnState(
        # Around the group's own middle, so that where the frame lies makes no difference to the rounding.
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
    return _Flown(path_m, -(turn + change), commands)


def _between(one_m: Array, other_m: Array, reach_m: float) -> tuple[Array, Array]:
    """Mean over time of the distance, up to the reach, and the smallest one, for all pairs of rows."""
    offset = one_m[:, None] - other_m[None, :]
    distance = np.sqrt(np.einsum("abti,abti->abt", offset, offset))
    return np.minimum(distance, reach_m)[..., 1:] @ TIME_SHARES, distance.min(axis=2)


@dataclass(frozen=True)
class _Table:
    """The joint table: `calm` (R,) for each member; mean and least distance (R, R) for each pair of them."""

    calm: Sequence[Array]
    mean: Mapping[tuple[int, int], Array]
    least: Mapping[tuple[int, int], Array]
    params: FormationParams

    def best(self) -> tuple[int, ...]:
        """The best of all combinations; of equals the first, in order of id and row."""
        count = len(self.calm)
        return self._chosen([np.arange(len(RESPONSES))] * count)

    def improved(self) -> tuple[int, ...]:
        """From straight to the goal, each in turn takes his best row until nobody finds a better one."""
        chosen = [0] * len(self.calm)
        for _ in range(_ROUNDS):
            before = list(chosen)
            for member in range(len(chosen)):
                open_rows = [np.array([row]) for row in chosen]
                open_rows[member] = np.arange(len(RESPONSES))
                chosen = list(self._chosen(open_rows))
            if chosen == before:
                break
        return tuple(chosen)

    def _chosen(self, rows: Sequence[NDArray[np.intp]]) -> tuple[int, ...]:
        """The best combination of these rows of each member."""
        params, count = self.params, len(rows)
        shape = tuple(len(r) for r in rows)
        value, closest = np.zeros(shape), np.full(shape, np.inf)
        for (i, j), mean in self.mean.items():
            picked = np.ix_(rows[i], rows[j])
            value += _spread(mean[picked], (i, j), count) / len(self.mean)
            closest = np.minimum(closest, _spread(self.least[i, j][picked], (i, j), count))
        straight = np.ones(shape, dtype=bool)
        too_long = (params.largest_path_ratio < _PATH_RATIO).astype(np.float64)
        for i, calm in enumerate(self.calm):
            value += _spread(calm[rows[i]], (i,), count) * params.calm * params.reach_m / count
            straight &= _spread(too_long[rows[i]], (i,), count) == 0.0
        kept = closest >= params.separation_m
        # Where nothing keeps the separation the widest is best; no way is too long for that.
        wanted = straight & kept if (straight & kept).any() else kept
        score = np.where(wanted, value, -np.inf) if wanted.any() else closest
        place = np.unravel_index(int(np.argmax(score)), shape)
        return tuple(int(r[p]) for r, p in zip(rows, place, strict=True))


def _spread(values: Array, axes: tuple[int, ...], count: int) -> Array:
    """The values along these axes of the joint table of so many members."""
    shape = [1] * count
    for axis, length in zip(axes, values.shape, strict=True):
        shape[axis] = length
    return values.reshape(shape)
