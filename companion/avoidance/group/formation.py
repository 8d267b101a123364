"""The group: which members respond together, and how far they keep apart (paper abstract and §4.3, P12)."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Final, Literal

from annotated_types import Ge, Gt, Le

from companion.model import Member, Vec3

# As many are in one joint table; a larger group is split by nearness.
LARGEST_GROUP: Final = 10

SystemId = Annotated[int, Ge(1), Le(255)]


@dataclass(frozen=True)
class FormationParams:
    """How a group keeps its members apart."""

    # MAVLink system ids of the other members, or all vehicles of our network. Without any, there is no group.
    members: Literal["all"] | tuple[SystemId, ...] = ()
    # By which the other members know us, where members are not MAVLink systems.
    own_id: str = ""
    cooperate: bool = True
    # Members are in conflict, and respond, if straight ways to their goals would bring them nearer than this.
    influence_m: Annotated[float, Gt(0)] = 100.0
    separation_m: Annotated[float, Gt(0)] = 100.0  # between members, wherever some response keeps it
    # Members further apart than this ignore each other: more distance is worth nothing.
    reach_m: Annotated[float, Gt(0)] = 400.0
    # Members also form a group if they come within reach of each other in this time.
    group_within_s: Annotated[float, Ge(0), Le(90)] = 30.0
    # Responses are judged this far ahead.
    horizon_s: Annotated[float, Ge(10), Le(90)] = 45.0
    # No two members may come nearer than this. A joint response that leads nearer is not flown: each member
    # then avoids the others like strangers with this volume.
    smallest_m: Annotated[float, Gt(0)] = 50.0
    smallest_vertical_m: Annotated[float, Gt(0)] = 30.0
    # A response makes the way to the goal at most this much longer, unless the separation requires more.
    largest_path_ratio: Annotated[float, Ge(1)] = 1.1
    # Cost of a turn by half a circle, or of a change by the whole speed, as a share of the reach.
    calm: Annotated[float, Ge(0)] = 0.05
    # An answer that the others have not acknowledged after this time is dropped, and another is proposed.
    propose_for_s: Annotated[float, Gt(0), Le(60)] = 6.0
    # A member whose intent was not heard for this time is avoided by itself, with the members' volume; one
    # that was not heard at all for this time is a stranger.
    silent_s: Annotated[float, Gt(0), Le(60)] = 5.0

    def __post_init__(self) -> None:
        if self.smallest_m > self.separation_m:
            raise ValueError("smallest_m must not exceed separation_m")

    @property
    def configured(self) -> bool:
        """Whether there is a group at all."""
        return self.cooperate and bool(self.own_id or self.members)


@dataclass(frozen=True, slots=True)
class MemberState:
    """One member as all members know it: position and velocity over ground, north-east-down [m, m/s]."""

    member_id: str
    position_m: Vec3
    velocity_mps: Vec3
    member: Member


def group_around(states: Sequence[MemberState], reach_m: float, within_s: float = 0.0) -> list[MemberState]:
    """The first member, and all within reach of it now or `within_s`, directly or through others.

    The group is the same whichever of its members comes first.
    """
    group, waiting = [states[0]], list(states[1:])
    for one in group:
        near = [state for state in waiting if _nearest_m(one, state, within_s) < reach_m]
        waiting = [state for state in waiting if state not in near]
        group += near
    return group


def _nearest_m(one: MemberState, other: MemberState, within_s: float) -> float:
    """The smallest distance within this time if both fly straight on."""
    rel = [b - a for a, b in zip(one.position_m, other.position_m, strict=True)]
    motion = [b - a for a, b in zip(one.velocity_mps, other.velocity_mps, strict=True)]
    squared = math.fsum(v * v for v in motion)
    closing = -math.fsum(x * v for x, v in zip(rel, motion, strict=True))
    at_s = min(max(closing / squared, 0.0), within_s) if squared > 0.0 else 0.0
    return math.hypot(*(x + at_s * v for x, v in zip(rel, motion, strict=True)))


def table_of(group: Sequence[MemberState]) -> list[MemberState]:
    """The members that respond together with the first one: all, or of a large group the nearest.

    A large group is split in the same way by each of its members: the lowest id takes the nearest others into
    its table, then the lowest id of the rest, and so on.
    """
    remaining = sorted(group, key=lambda state: state.member_id)
    while len(remaining) > LARGEST_GROUP:
        lead = remaining[0]
        table = sorted(
            remaining, key=lambda state: (math.dist(state.position_m, lead.position_m), state.member_id)
        )[:LARGEST_GROUP]
        if any(state is group[0] for state in table):
            return table
        remaining = [state for state in remaining if state not in table]
    return remaining


def is_valid(state: MemberState) -> bool:
    """Whether all numbers that a member reports are finite, and its limits are those of an aircraft."""
    member, goal = state.member, state.member.goal
    numbers = [*state.position_m, *state.velocity_mps, member.min_airspeed_mps, member.max_airspeed_mps]
    numbers += [member.max_turn_rate_radps, *(goal.position_m or ())]
    numbers += [x for x in (goal.course_rad, goal.airspeed_mps, goal.altitude_m) if x is not None]
    intent = member.intent
    if intent is not None:
        answers = [intent.flown, None if intent.proposal is None else intent.proposal.guidance]
        numbers += [x for g in answers if g is not None for x in (g.course_rad, g.airspeed_mps, g.altitude_m)]
    return (
        all(map(math.isfinite, numbers))
        and 0.0 < member.min_airspeed_mps <= member.max_airspeed_mps <= 200.0
        and 0.0 < member.max_turn_rate_radps <= math.radians(90.0)
    )
