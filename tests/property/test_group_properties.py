"""Properties of groups: one joint response for all members, the best one, in every order and frame."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from companion.avoidance import Avoider, Envelope
from companion.avoidance.group.formation import FormationParams, MemberState, group_around
from companion.avoidance.group.joint_table import RESPONSES, joint_response
from companion.avoidance.trajectory import Commands, OwnState, fly_ahead
from companion.geodesy import wrap_pi
from companion.model import Decision, Goal, Guidance, Member, Ownship, Track, Vec3
from tests.support.avoidance_cases import (
    PARAMS,
    TIMES_S,
    degrees,
    frames,
    rotated,
    within_limits,
)
from tests.support.thorough import sample

FORMATION = FormationParams(
    influence_m=2000.0, separation_m=300.0, reach_m=2000.0, smallest_m=80.0, horizon_s=90.0
)


@st.composite
def groups(draw: st.DrawFn, least: int = 2, most: int = 3) -> list[MemberState]:
    """Members on their ways through one area, in general positions."""
    states = []
    for i in range(draw(st.integers(least, most))):
        to_rad, bearing_rad = draw(degrees(0.137 + 0.1 * i)), draw(degrees(0.471 + 0.1 * i))
        speed, from_m = draw(st.integers(15, 24)) + 0.3 + 0.07 * i, draw(st.integers(0, 60)) * 10.0 + 3.1 * i
        place = (from_m * math.cos(bearing_rad), from_m * math.sin(bearing_rad), -300.0)
        goal = (place[0] + 4000.0 * math.cos(to_rad), place[1] + 4000.0 * math.sin(to_rad), -300.0)
        course = to_rad + 0.3 * draw(degrees(0.211))
        velocity = (speed * math.cos(course), speed * math.sin(course), 0.0)
        member = Member(
            Goal(airspeed_mps=speed, position_m=goal), 0.8 * speed, 1.4 * speed, math.radians(18.0)
        )
        states.append(MemberState(f"U{i}", place, velocity, member))
    return states


def combination_values(
    states: Sequence[MemberState], params: FormationParams
) -> dict[tuple[int, int], tuple[float, float]]:
    """Value and smallest distance of every combination of two members' responses, by brute force."""
    paths, calm = [], []
    for state in states:
        course = math.atan2(state.velocity_mps[1], state.velocity_mps[0])
        speed = math.hypot(*state.velocity_mps[:2])
        goal = state.member.goal
        assert goal.position_m is not None
        assert goal.airspeed_mps is not None
        bearing = math.atan2(
            goal.position_m[1] - state.position_m[1], goal.position_m[0] - state.position_m[0]
        )
        speeds = {
            "keep": goal.airspeed_mps,
            "slowest": state.member.min_airspeed_mps,
            "fastest": state.member.max_airspeed_mps,
        }
        own = OwnState(state.position_m, course, speed, 0.0, (0.0, 0.0))
        envelope = Envelope(
            max_turn_rate_radps=state.member.max_turn_rate_radps, max_bank_rad=math.radians(79.0)
        )
        rows = [Guidance(bearing + row.beside_rad, speeds[row.pace], 300.0) for row in RESPONSES]
        flown = fly_ahead(own, Commands.of(rows), envelope)
        paths.append([flown.row_m(k) for k in range(len(rows))])
        calm.append(
            [
                -abs(wrap_pi(row.course_rad - course)) / math.pi
                - abs(row.airspeed_mps - speed) / goal.airspeed_mps
                for row in rows
            ]
        )
    found = {}
    shares = np.diff(TIMES_S) / 90.0
    for a, b in itertools.product(range(len(RESPONSES)), repeat=2):
        distance = np.linalg.norm(paths[0][a] - paths[1][b], axis=1)
        mean = float(np.minimum(distance[1:], params.reach_m) @ shares)
        value = mean + params.calm * params.reach_m * (calm[0][a] + calm[1][b]) / 2.0
        found[a, b] = value, nearest_m(paths[0][a], paths[1][b])
    return found


def nearest_m(one_m: NDArray[np.float64], other_m: NDArray[np.float64]) -> float:
    """The smallest distance of two paths (T, 3), from many points on each of their straight steps."""
    share = np.linspace(0.0, 1.0, 401)[:, None, None]
    off = one_m - other_m
    return float(np.linalg.norm(off[:-1] + share * np.diff(off, axis=0), axis=2).min())


def rows_of(guidance: Guidance, state: MemberState) -> list[int]:
    """The responses of a member that have this guidance."""
    goal = state.member.goal
    assert goal.position_m is not None
    bearing = math.atan2(goal.position_m[1] - state.position_m[1], goal.position_m[0] - state.position_m[0])
    speeds = {
        "keep": goal.airspeed_mps,
        "slowest": state.member.min_airspeed_mps,
        "fastest": state.member.max_airspeed_mps,
    }
    return [
        k
        for k, row in enumerate(RESPONSES)
        if abs(wrap_pi(bearing + row.beside_rad - guidance.course_rad)) < 1e-9
        and speeds[row.pace] == guidance.airspeed_mps
    ]


@settings(max_examples=sample(4, 25), deadline=None, derandomize=True)
@given(groups(least=2, most=2))
def test_two_members_choose_the_best_combination_that_keeps_separation_and_goals(
    states: list[MemberState],
) -> None:
    response = joint_response(states, FORMATION)
    assert response is not None
    values = combination_values(states, FORMATION)
    first, second = (rows_of(response.guidance[state.member_id], state)[0] for state in states)
    chosen = (first, second)
    value, closest = values[chosen]
    assert response.closest_m == pytest.approx(closest, abs=0.2)
    short = {
        rows
        for rows in values
        if all(RESPONSES[row].path_ratio <= FORMATION.largest_path_ratio for row in rows)
    }
    kept = {rows for rows, (_, least) in values.items() if least >= FORMATION.separation_m}
    # Exactly at the separation, rounding may decide.
    assume(all(abs(least - FORMATION.separation_m) > 0.2 for _, least in values.values()))
    if kept & short:
        assert chosen in kept & short
        assert value == pytest.approx(max(values[rows][0] for rows in kept & short))
    elif kept:
        assert chosen in kept
        assert value == pytest.approx(max(values[rows][0] for rows in kept))
    else:
        assert closest == pytest.approx(max(least for _, least in values.values()), abs=0.2)


@settings(max_examples=25, deadline=None, derandomize=True)
@given(groups(least=2, most=5), st.randoms(use_true_random=False))
def test_the_joint_response_is_the_same_in_every_order(states: list[MemberState], chance: object) -> None:
    first = joint_response(states, FORMATION)
    shuffled = list(states)
    chance.shuffle(shuffled)  # type: ignore[attr-defined]
    assert joint_response(shuffled, FORMATION) == first


@settings(max_examples=25, deadline=None, derandomize=True)
@given(groups(least=2, most=4))
def test_every_member_flies_within_its_reported_limits(states: list[MemberState]) -> None:
    response = joint_response(states, FORMATION)
    assert response is not None
    assert set(response.guidance) == {state.member_id for state in states}
    for state in states:
        guidance = response.guidance[state.member_id]
        assert state.member.min_airspeed_mps <= guidance.airspeed_mps <= state.member.max_airspeed_mps
        assert guidance.altitude_m == 300.0
        assert 0.0 <= guidance.course_rad < 2.0 * math.pi
        assert rows_of(guidance, state), "one of the defined responses"


@pytest.mark.parametrize("airspeed_mps", [5.0, 45.0])
def test_no_member_gets_the_airspeed_of_its_goal_if_it_cannot_fly_it(airspeed_mps: float) -> None:
    states = [
        MemberState(
            name,
            (0.0, east_m, -300.0),
            (20.0, 0.0, 0.0),
            Member(Goal(0.0, airspeed_mps, 300.0), 16.0, 28.0, 0.3),
        )
        for name, east_m in (("A", 0.0), ("B", 400.0))
    ]
    response = joint_response(states, FORMATION)
    assert response is not None
    assert all(16.0 <= guidance.airspeed_mps <= 28.0 for guidance in response.guidance.values())


@pytest.mark.parametrize("altitude_m", [50.0, 700.0])
def test_a_member_keeps_its_floor_and_ceiling(altitude_m: float) -> None:
    decision = members_view([(0.0, 0.0), (0.0, 400.0)], 0, altitude_m)
    assert decision.because.startswith("group: ")
    assert decision.guidance is not None
    assert within_limits(decision.guidance)


def members_view(places: Sequence[tuple[float, float]], viewer: int, altitude_m: float = 300.0) -> Decision:
    """The decision of one member that sees the others. All fly north, at slightly different speeds."""
    goal = Goal(0.0, 21.0, altitude_m)
    owns = [
        Ownship(0.0, (north, east, -300.0), (20.0 + i, 0.0, 0.0), 20.0 + i, 0.0, (0.0, 0.0))
        for i, (north, east) in enumerate(places)
    ]
    avoiders = [
        Avoider(replace(PARAMS, formation=replace(FORMATION, own_id=f"U{i}"), well_clear_horizontal_m=80.0))
        for i in range(len(places))
    ]
    tracks = [
        Track(
            f"U{i}", 0.0, own.position_m, own.velocity_mps, protected_horizontal_m=80.0,
            protected_vertical_m=40.0, member=avoiders[i].member(own, goal),
        )
        for i, own in enumerate(owns)
        if i != viewer
    ]  # fmt: skip
    return avoiders[viewer].decide(0.0, owns[viewer], tracks, goal)


@settings(max_examples=25, deadline=None, derandomize=True)
@given(
    st.lists(st.tuples(st.integers(-40, 40), st.integers(-40, 40)), min_size=2, max_size=4, unique=True).map(
        lambda some: [(20.0 * n + 0.3 * i, 20.0 * e) for i, (n, e) in enumerate(some)]
    )
)
def test_every_member_computes_the_same_joint_response(group: list[tuple[float, float]]) -> None:
    """Bit for bit: the decision of each member is the one that all others compute for it."""
    assume(min(math.dist(a, b) for a, b in itertools.combinations(group, 2)) > 100.0)
    params = replace(FORMATION, own_id="U0")
    goal = Goal(0.0, 21.0, 300.0)
    member = Avoider(PARAMS).member(Ownship(0.0, (0.0, 0.0, -300.0), (21.0, 0.0, 0.0), 21.0, 0.0), goal)
    states = [
        MemberState(f"U{i}", (north, east, -300.0), (20.0 + i, 0.0, 0.0), member)
        for i, (north, east) in enumerate(group)
    ]
    response = joint_response(states, params)
    for viewer in range(len(group)):
        decision = members_view(group, viewer)
        if (
            response is None
            or response.closest_m < params.smallest_m
            or response.straight_closest_m >= 2000.0
        ):
            assert not decision.because.startswith("group: ")
        else:
            assert decision.guidance == response.guidance[f"U{viewer}"]


@settings(max_examples=60, deadline=None, derandomize=True)
@given(groups(least=2, most=5), st.integers(50, 900))
def test_all_members_of_a_group_find_the_same_group(states: list[MemberState], reach_m: int) -> None:
    """Compared with brute force, which spreads from member to member within reach."""
    found = {
        state.member_id: {
            one.member_id for one in group_around([state, *(s for s in states if s is not state)], reach_m)
        }
        for state in states
    }
    for state in states:
        group = {state.member_id}
        for _ in states:
            group |= {
                other.member_id
                for one, other in itertools.permutations(states, 2)
                if one.member_id in group and math.dist(one.position_m, other.position_m) < reach_m
            }
        assert found[state.member_id] == group
        assert all(found[other] == group for other in group)


def abreast(first: str, second: str, north_m: float = 0.0) -> dict[str, Guidance]:
    """The guidance of two members on mirrored paths, for which left and right cost the same."""
    member = Member(Goal(0.0, 20.0, 300.0), 16.0, 28.0, 0.3)
    states = [
        MemberState(first, (north_m, -500.0, -300.0), (20.0, 0.0, 0.0), member),
        MemberState(second, (north_m, 500.0, -300.0), (20.0, 0.0, 0.0), member),
    ]
    response = joint_response(states, FORMATION)
    assert response is not None
    return dict(response.guidance)


def test_the_ids_and_not_the_positions_decide_between_equal_combinations() -> None:
    once, swapped = abreast("A", "B"), abreast("B", "A")
    assert once["A"].course_rad == pytest.approx(-swapped["A"].course_rad % (2.0 * math.pi))
    assert once["A"].airspeed_mps == swapped["A"].airspeed_mps
    assert once["B"].airspeed_mps == swapped["B"].airspeed_mps


def test_the_origin_of_the_frame_does_not_decide_between_equal_combinations() -> None:
    """Bit for bit: the rounding of large coordinates must not decide."""
    assert all(abreast("A", "B", 1e4 * shift + 7.0) == abreast("A", "B") for shift in range(1, 30))


@settings(max_examples=25, deadline=None, derandomize=True)
@given(groups(least=2, most=2), frames())
def test_a_rotated_and_shifted_frame_rotates_the_joint_response(
    states: list[MemberState], frame: tuple[float, Vec3]
) -> None:
    moved = []
    for state in states:
        goal = state.member.goal
        assert goal.position_m is not None
        report = replace(state.member, goal=replace(goal, position_m=rotated(goal.position_m, *frame)))
        moved.append(
            MemberState(
                state.member_id,
                rotated(state.position_m, *frame),
                rotated(state.velocity_mps, frame[0]),
                report,
            )
        )
    first, second = joint_response(states, FORMATION), joint_response(moved, FORMATION)
    assert first is not None
    assert second is not None
    assert first.closest_m == pytest.approx(second.closest_m, abs=1e-3)
    for state in states:
        one, other = first.guidance[state.member_id], second.guidance[state.member_id]
        assert abs(wrap_pi(other.course_rad - one.course_rad - frame[0])) < 1e-6
        assert other.airspeed_mps == pytest.approx(one.airspeed_mps)
        assert other.altitude_m == pytest.approx(one.altitude_m)
