"""Where the mission may lead a member: to its goal and on, to either side where it has to turn around."""

import math
from dataclasses import replace

import numpy as np
import pytest

from companion.avoidance.group.formation import MemberState
from companion.avoidance.group.joint_table import mission_paths_of
from companion.model import Goal, Member, Vec3

AHEAD = Goal(position_m=(2000.0, 0.0, -300.0), airspeed_mps=20.0)
CENTRE = np.zeros(3)
HORIZON_S = 60.0
RATE_RADPS = 0.25


def state_of(goal: Goal, velocity_mps: Vec3 = (20.0, 0.0, 0.0)) -> MemberState:
    return MemberState("1", (0.0, 0.0, -300.0), velocity_mps, Member(goal, 15.0, 28.0, RATE_RADPS))


def ends_of(goal: Goal) -> list[tuple[float, float]]:
    return [tuple(path[-1, :2].tolist()) for path in mission_paths_of(state_of(goal), CENTRE, HORIZON_S)]


def test_one_way_to_a_goal_ahead() -> None:
    (path,) = mission_paths_of(state_of(AHEAD), CENTRE, HORIZON_S)
    assert path[0].tolist() == [0.0, 0.0, -300.0]
    assert path[-1] == pytest.approx([1200.0, 0.0, -300.0], abs=1.0)


def test_to_a_goal_behind_it_may_turn_to_either_side() -> None:
    paths = mission_paths_of(state_of(replace(AHEAD, position_m=(-2000.0, 100.0, -300.0))), CENTRE, HORIZON_S)
    assert len(paths) == 2
    beside = sorted(float(path[:20, 1][np.abs(path[:20, 1]).argmax()]) for path in paths)
    radius_m = 20.0 / RATE_RADPS
    assert beside[0] == pytest.approx(-2.0 * radius_m, rel=0.3)
    assert beside[1] == pytest.approx(2.0 * radius_m, rel=0.3)
    for path in paths:
        assert path[0, :2].tolist() == [0.0, 0.0]
        steps_m = np.hypot(*np.diff(path[:, :2], axis=0).T)
        assert (steps_m[:10] <= 20.0 + 0.1).all()  # in each second
        assert path[-1, 0] < -600.0


def test_after_the_goal_to_the_next_place() -> None:
    near = replace(AHEAD, position_m=(400.0, 0.0, -300.0), then_m=(400.0, 2000.0, -300.0))
    ((north_m, east_m),) = ends_of(near)
    assert east_m == pytest.approx(800.0, abs=60.0)
    assert north_m == pytest.approx(400.0, abs=90.0)


def test_a_corner_that_turns_around_is_flown_to_either_side() -> None:
    back = replace(AHEAD, position_m=(400.0, 0.0, -300.0), then_m=(-2000.0, 0.0, -300.0))
    ends = sorted(east_m for _, east_m in ends_of(back))
    assert len(ends) == 2
    assert ends == pytest.approx([-160.0, 160.0], abs=20.0)


def test_before_the_goal_the_ways_are_the_same() -> None:
    back = replace(AHEAD, position_m=(400.0, 0.0, -300.0), then_m=(-2000.0, 0.0, -300.0))
    one, other = mission_paths_of(state_of(back), CENTRE, HORIZON_S)
    assert np.array_equal(one[:16], other[:16])
    assert math.dist(one[-1], other[-1]) > 200.0
