"""Fences: valid zones, how zones count together, and that no path misses one."""

import itertools
import math

import numpy as np
import pytest

from companion.avoidance import Envelope, Fence, Zone
from companion.avoidance.trajectory import (
    HORIZON_S,
    Commands,
    OwnState,
    Paths,
    fly_ahead,
    times_until,
    turn_around_s,
)
from companion.model import Guidance, Vec2

ENVELOPE = Envelope()


def box(north_m: Vec2, east_m: Vec2, **kind: object) -> Zone:
    corners = (
        (north_m[0], east_m[0]),
        (north_m[1], east_m[0]),
        (north_m[1], east_m[1]),
        (north_m[0], east_m[1]),
    )
    return Zone(**{"inclusion": True, "vertices_m": corners, **kind})  # type: ignore[arg-type]


def depth_m(fence: Fence, north_m: float, east_m: float, altitude_m: float = 300.0) -> float:
    return float(fence.depth_m(np.array([[north_m, east_m, -altitude_m]]))[0])


def own_state(course_rad: float = 0.0, airspeed_mps: float = 22.0, wind: Vec2 = (0.0, 0.0)) -> OwnState:
    return OwnState((0.0, 0.0, -300.0), course_rad, airspeed_mps, 0.0, wind)


def ahead(courses_deg: list[float], airspeed_mps: float = 22.0, altitudes_m: Vec2 = (300.0, 300.0)) -> Paths:
    rows = itertools.product(courses_deg, altitudes_m)
    commands = Commands.of([Guidance(math.radians(course), airspeed_mps, height) for course, height in rows])
    return fly_ahead(own_state(airspeed_mps=airspeed_mps), commands, ENVELOPE)


@pytest.mark.parametrize(
    "wrong",
    [
        {},
        {"vertices_m": ((0.0, 0.0), (1.0, 0.0))},
        {"vertices_m": ((0.0, 0.0), (1.0, 0.0), (math.nan, 1.0))},
        {"vertices_m": ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0)), "centre_m": (0.0, 0.0), "radius_m": 5.0},
        {"centre_m": (0.0, 0.0)},
        {"radius_m": 10.0},
        {"centre_m": (0.0, 0.0), "radius_m": 0.0},
        {"centre_m": (math.inf, 0.0), "radius_m": 1.0},
        {"vertices_m": ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0)), "radius_m": 5.0},
        {"centre_m": (0.0, 0.0), "radius_m": 9.0, "max_altitude_m": math.nan},
    ],
)
def test_an_invalid_zone_is_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(ValueError, match=r"zone|polygon|circle"):
        Zone(True, **wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize("margin_m", [-1.0, math.nan, math.inf])
def test_an_invalid_margin_is_refused(margin_m: float) -> None:
    with pytest.raises(ValueError, match="margin"):
        Fence((), margin_m=margin_m)


def test_without_zones_every_place_is_allowed() -> None:
    assert depth_m(Fence(()), 1e5, -1e5) == 0.0
    breach = Fence(()).breach(ahead([0.0]), 20.0, 90.0)
    assert not breach.deepest_m.any()
    assert np.isinf(breach.first_s).all()


@pytest.mark.parametrize(
    ("place", "wanted_m"),
    [
        ((0.0, 0.0), 0.0),
        ((475.0, 0.0), 5.0),
        ((500.0, 0.0), 30.0),
        ((600.0, 0.0), 130.0),
        ((0.0, -350.0), 80.0),
    ],
)
def test_an_inclusion_zone_is_kept_with_its_margin(place: Vec2, wanted_m: float) -> None:
    assert depth_m(Fence((box((-500.0, 500.0), (-300.0, 300.0)),)), *place) == pytest.approx(wanted_m)


@pytest.mark.parametrize(("distance_m", "wanted_m"), [(0.0, 130.0), (60.0, 70.0), (125.0, 5.0), (131.0, 0.0)])
def test_an_exclusion_circle_is_kept_with_its_margin(distance_m: float, wanted_m: float) -> None:
    fence = Fence((Zone(False, centre_m=(1000.0, 50.0), radius_m=100.0),))
    assert depth_m(fence, 1000.0, 50.0 + distance_m) == pytest.approx(wanted_m)


def test_the_notch_of_a_concave_polygon_is_outside() -> None:
    notched = (
        (0.0, 0.0),
        (400.0, 0.0),
        (400.0, 150.0),
        (100.0, 200.0),
        (400.0, 250.0),
        (400.0, 400.0),
        (0.0, 400.0),
    )
    fence = Fence((Zone(True, notched),), margin_m=0.0)
    assert depth_m(fence, 300.0, 200.0) > 10.0
    assert depth_m(fence, 50.0, 200.0) == 0.0
    assert depth_m(fence, 300.0, 50.0) == 0.0


def test_all_inclusion_zones_must_be_kept_or_only_one() -> None:
    zones = (box((-500.0, 100.0), (-100.0, 100.0)), box((-100.0, 900.0), (-100.0, 100.0)))
    every, one = Fence(zones), Fence(zones, any_inclusion=True)
    for north_m in (-400.0, 800.0):
        assert depth_m(one, north_m, 0.0) == 0.0
        assert depth_m(every, north_m, 0.0) > 300.0
    assert depth_m(every, 0.0, 0.0) == depth_m(one, 0.0, 0.0) == 0.0
    assert depth_m(one, 1000.0, 0.0) == pytest.approx(130.0)


def test_exclusion_zones_count_even_if_one_inclusion_zone_suffices() -> None:
    zones = (box((-500.0, 500.0), (-500.0, 500.0)), Zone(False, centre_m=(0.0, 0.0), radius_m=50.0))
    assert depth_m(Fence(zones, any_inclusion=True), 0.0, 0.0) == pytest.approx(80.0)


def test_zones_count_only_between_their_altitude_limits() -> None:
    tower = box((-50.0, 50.0), (-50.0, 50.0), inclusion=False, max_altitude_m=200.0)
    slab = box((-1e4, 1e4), (-1e4, 1e4), min_altitude_m=100.0, max_altitude_m=400.0)
    fence = Fence((tower, slab), margin_m=20.0, vertical_margin_m=5.0)
    assert depth_m(fence, 0.0, 0.0, 205.0) == 0.0
    assert depth_m(fence, 0.0, 0.0, 195.0) == pytest.approx(10.0), "up is the shortest way out"
    assert depth_m(fence, 0.0, 65.0, 150.0) == pytest.approx(5.0), "sideways is shorter"
    assert depth_m(fence, 900.0, 0.0, 398.0) == pytest.approx(3.0)
    assert depth_m(fence, 900.0, 0.0, 90.0) == pytest.approx(15.0)


@pytest.mark.parametrize("margin_m", [0.0, 12.0])
@pytest.mark.parametrize("begin_m", np.arange(200.0, 520.0, 17.0))
def test_a_thin_wall_is_not_missed(begin_m: float, margin_m: float) -> None:
    """The wall is six metres thick. At 60 m/s the times of the prediction are up to 120 m apart."""
    wall = box((begin_m, begin_m + 6.0), (-1000.0, 1000.0), inclusion=False)
    fast = fly_ahead(
        own_state(airspeed_mps=60.0),
        Commands.of([Guidance(0.0, 60.0, 300.0)]),
        Envelope(max_airspeed_mps=60.0),
    )
    breach = Fence((wall,), margin_m=margin_m).breach(fast, 20.0, 20.0)
    assert breach.deepest_m[0] > 0.0
    assert breach.first_s[0] == pytest.approx((begin_m - margin_m) / 60.0, abs=0.25)


def test_breaches_are_those_of_brute_force() -> None:
    zones = (
        box((-300.0, 500.0), (-250.0, 300.0)),
        Zone(False, ((150.0, 40.0), (260.0, 150.0), (120.0, 190.0))),
        Zone(False, centre_m=(200.0, -150.0), radius_m=60.0, max_altitude_m=310.0),
        Zone(False, centre_m=(9000.0, 0.0), radius_m=60.0),
    )
    fence = Fence(zones, margin_m=20.0)
    paths = ahead(list(range(-170, 180, 20)), altitudes_m=(300.0, 340.0))
    breach = fence.breach(paths, 15.0, 40.0)
    times_s = times_until(HORIZON_S)
    for row in range(len(paths.ground_of)):
        path_m = paths.row_m(row)
        fine_s = np.arange(0.0, 40.0, 0.05)
        fine = np.column_stack([np.interp(fine_s, times_s, path_m[:, axis]) for axis in range(3)])
        depth = fence.depth_m(fine)
        near = fine_s <= 15.3  # the time of the first sample after 15 s
        assert breach.deepest_m[row] == pytest.approx(depth[near].max(), abs=10.0)
        assert breach.mean_m[row] == pytest.approx(depth[near].mean(), abs=5.0)
        first_s = fine_s[np.argmax(depth > 0.0)] if depth.any() else math.inf
        assert breach.first_s[row] == pytest.approx(first_s, abs=1.1 if first_s < 15.0 else 4.1)


def test_a_breach_after_the_look_ahead_has_a_time_but_no_depth() -> None:
    breach = Fence((box((-500.0, 500.0), (-500.0, 500.0)),)).breach(ahead([0.0]), 12.0, 90.0)
    assert not breach.deepest_m.any()
    assert breach.first_s[0] == pytest.approx(470.0 / 22.0, abs=4.0)


@pytest.mark.parametrize("wind", [(0.0, 0.0), (8.0, 0.0), (0.0, -12.0), (-15.0, 5.0)])
@pytest.mark.parametrize("airspeed_mps", [16.0, 28.0])
def test_within_the_look_ahead_there_is_room_to_turn_around(airspeed_mps: float, wind: Vec2) -> None:
    """The look-ahead is so long that a turn gets no further ahead than straight flight in that time."""
    state = own_state(airspeed_mps=airspeed_mps, wind=wind)
    ahead_s = turn_around_s(state, ENVELOPE)
    turned = fly_ahead(state, Commands.of([Guidance(math.pi, airspeed_mps, 300.0)]), ENVELOPE).row_m(0)
    straight = fly_ahead(state, Commands.of([Guidance(0.0, airspeed_mps, 300.0)]), ENVELOPE).row_m(0)
    times_s = times_until(HORIZON_S)
    assert turned[:, 0].max() < np.interp(ahead_s, times_s, straight[:, 0])
    after = np.searchsorted(times_s, ahead_s)
    assert (np.diff(turned[after:, 0]) < 0.0).all(), "by then it flies back"


def test_the_look_ahead_is_finite_in_any_wind() -> None:
    assert math.isfinite(turn_around_s(own_state(wind=(0.0, 50.0)), ENVELOPE))
