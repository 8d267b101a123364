"""Random crossings of members, and the measures of flights of which they are known."""

import math
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.campaign.plane import Limits
from sim.campaign.route import Route
from sim.encounters import Path
from sim.formation.crossing import Crossing, Mission, crossing
from sim.formation.engines import Separation
from sim.formation.flight import FormationFlight
from sim.formation.judgement import judge

SEPARATION = Separation()


@given(st.integers(2, 10), st.integers(0, 50))
def test_members_meet_begin_and_end_as_promised(members: int, number: int) -> None:
    one = crossing(members, 7, number, 50.0)
    assert len(one.missions) == members
    assert 40.0 <= one.meets_s <= 60.0
    assert one.common_s > one.meets_s
    for mission in one.missions:
        assert 20.0 <= mission.airspeed_mps <= 30.0
        assert abs(-mission.start_m[2] - 300.0) <= 20.0
    for place in ("start_m", "end_m"):
        places = [getattr(mission, place) for mission in one.missions]
        assert all(math.dist(a[:2], b[:2]) >= 200.0 for a, b in combinations(places, 2))


def test_a_crossing_depends_on_its_numbers_only() -> None:
    assert crossing(3, 1, 4, 50.0).missions == crossing(3, 1, 4, 50.0).missions
    assert crossing(3, 1, 4, 50.0).missions != crossing(3, 1, 6, 50.0).missions
    strangers = [crossing(2, 1, number, 50.0).stranger is not None for number in range(60)]
    assert 5 < sum(strangers) < 30
    frames = {mission.limits.dynamics for n in range(9) for mission in crossing(3, 1, n, 50.0).missions}
    assert len(frames) == 2


def member(start: tuple[float, float], end: tuple[float, float], height_m: float = 300.0) -> Mission:
    places = tuple(
        (start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1]), -height_m)
        for share in (-1.0, 0.5, 1.0, 20.0)
    )
    return Mission((*start, -height_m), 25.0, Route(places), Limits())


def flight(
    *missions: Mission, offsets_m: tuple[float, ...] = (0.0, 0.0), stranger: Path | None = None
) -> FormationFlight:
    """Both fly straight from start to end at 25 m/s, displaced to the east."""
    count = round(missions[0].nominal_s / 0.1) + 1
    share = np.linspace(0.0, 1.0, count)[:, None]
    places = [
        np.array(one.start_m) + share * (np.array(one.end_m) - one.start_m) + (0.0, off_m, 0.0)
        for one, off_m in zip(missions, offsets_m, strict=True)
    ]
    arrived: list[float | None] = [(count - 1) * 0.1] * len(missions)
    met = Crossing(missions, 0.5 * missions[0].nominal_s, stranger)
    return FormationFlight(met, np.stack(places, axis=1), arrived, [0] * len(missions), [], 0.0, [])


HEAD_ON = member((-1250.0, 0.0), (1250.0, 0.0)), member((1250.0, 0.0), (-1250.0, 0.0))


@pytest.mark.parametrize(
    ("aside_m", "above_m", "lost", "near"),
    [(0.0, 0.0, 1, 1), (45.0, 25.0, 1, 0), (45.0, 35.0, 0, 0), (60.0, 0.0, 0, 0), (10.0, 40.0, 0, 1)],
)
def test_separation_is_judged_as_a_volume_and_in_space(
    aside_m: float, above_m: float, lost: int, near: int
) -> None:
    higher = member((1250.0, 0.0), (-1250.0, 0.0), 300.0 + above_m)
    judged = judge(flight(HEAD_ON[0], higher, offsets_m=(0.0, aside_m)), SEPARATION)
    assert judged.smallest_m == pytest.approx(math.hypot(aside_m, above_m), abs=2.6)
    assert (judged.pairs_lost, judged.pairs_near, judged.pairs) == (lost, near, 1)


def test_safety_value_and_way_of_a_straight_flight() -> None:
    """Two that approach and depart at 50 m/s over 2500 m are 1250 m apart in the mean."""
    judged = judge(flight(*HEAD_ON), SEPARATION)
    assert judged.safety_value_m == pytest.approx(1250.0, rel=0.01)
    assert judged.safety_value_near_m == pytest.approx(500.0, rel=0.01)
    assert judged.path_ratio == pytest.approx(1.0, abs=1e-6)
    assert judged.arrived == 2
    assert judged.nmac is judged.lowc is None


def test_pairs_are_judged_until_one_has_arrived() -> None:
    flown = flight(*HEAD_ON)
    flown.arrived_s[0] = 40.0
    assert judge(flown, SEPARATION).pairs_lost == 0
    assert judge(flown, SEPARATION).smallest_m == pytest.approx(500.0, abs=1.0)


def test_each_member_is_judged_against_the_stranger() -> None:
    times_s = np.arange(101.0)
    velocity = np.tile((0.0, 50.0, 0.0), (101, 1))
    place = np.array((0.0, 0.0, -300.0)) + (times_s - 50.0)[:, None] * velocity
    stranger = Path(times_s, place, velocity)
    higher = member((1250.0, 0.0), (-1250.0, 0.0), 360.0)
    judged = judge(flight(HEAD_ON[0], higher, stranger=stranger), SEPARATION)
    assert (judged.nmac, judged.lowc) == (1, 2)
