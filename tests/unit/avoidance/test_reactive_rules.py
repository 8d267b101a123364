"""The two reactive rules against eq. 11 computed by hand and eq. 13 by brute force."""

import math

import numpy as np
import pytest

from companion.avoidance.inner import heading_rule_rad, speed_rule
from companion.avoidance.trajectory import Array, Pace

OWN_MPS = 20.0
STATIONARY = np.zeros(2)


def flying(course_deg: float, speed_mps: float = OWN_MPS) -> Array:
    course_rad = math.radians(course_deg)
    return speed_mps * np.array([math.cos(course_rad), math.sin(course_rad)])


def ruled_deg(course_deg: float, bearing_deg: float, other_mps: Array) -> float:
    """Eq. 11's course for a threat 500 m away on a true bearing."""
    own_mps = flying(course_deg)
    course_rad = heading_rule_rad(math.radians(course_deg), 25.0 * flying(bearing_deg), other_mps, own_mps)
    return math.degrees(course_rad)


def same_course(one_deg: float, other_deg: float) -> bool:
    return abs((one_deg - other_deg + 180.0) % 360.0 - 180.0) < 1e-3


# By hand, angles positive to the left, flying north: alpha = -track, b = -bearing, new course = -phi.
@pytest.mark.parametrize(
    ("bearing_deg", "track_deg", "phi_deg"),
    [
        (40.0, -60.0, 60.0 - 90.0),  # on the right, b < 0; its track to the left, alpha = 60
        (40.0, -150.0, 150.0 - 90.0),  # coming from ahead on the right, alpha = 150
        (40.0, 60.0, -60.0 + 90.0),  # on the right, its track to the right, alpha = -60
        (40.0, 150.0, -150.0 + 90.0),
        (-40.0, -60.0, 60.0 + 45.0),  # on the left, b > 0; its track to the left, alpha = 60
        (-40.0, -150.0, 150.0 + 45.0),
        (-40.0, 60.0, -60.0 - 45.0),  # on the left, its track to the right, alpha = -60
        (-40.0, 150.0, -150.0 - 45.0),
        (140.0, 60.0, -60.0 + 90.0),  # the same sides behind us
        (-140.0, 60.0, -60.0 - 45.0),
    ],
)
@pytest.mark.parametrize("course_deg", [0.0, 77.0, 200.0, 359.0])
def test_the_turn_is_that_of_equation_11(
    course_deg: float, bearing_deg: float, track_deg: float, phi_deg: float
) -> None:
    wanted_deg = course_deg - phi_deg
    assert same_course(
        ruled_deg(course_deg, course_deg + bearing_deg, flying(course_deg + track_deg)), wanted_deg
    )


def test_head_on_turns_the_same_way_on_every_course() -> None:
    """alpha = pi and b = 0: phi = pi + pi/4 to the left, which is 135 degrees to the right."""
    for course_deg in range(0, 360, 7):
        ruled = ruled_deg(course_deg, course_deg, flying(course_deg + 180.0))
        assert same_course(ruled, course_deg + 135.0), course_deg


def test_overtaking_turns_the_same_way_on_every_course() -> None:
    """alpha = 0 counts as positive, b = 0: phi = pi/4."""
    for course_deg in range(0, 360, 7):
        ruled = ruled_deg(course_deg, course_deg, flying(course_deg, 10.0))
        assert same_course(ruled, course_deg - 45.0), course_deg


def test_being_overtaken_turns_the_same_way_on_every_course() -> None:
    """Exactly astern is neither left nor right. Either is acceptable, but rounding must not decide."""
    usual_deg = ruled_deg(0.0, 180.0, flying(0.0, 40.0))
    for course_deg in range(0, 360, 7):
        ruled = ruled_deg(course_deg, course_deg + 180.0, flying(course_deg, 40.0))
        assert same_course(ruled - course_deg, usual_deg), course_deg


@pytest.mark.parametrize(("bearing_deg", "phi_deg"), [(30.0, 180.0 - 90.0), (-30.0, 180.0 + 45.0)])
@pytest.mark.parametrize("course_deg", [0.0, 133.0, 271.0])
def test_a_stationary_threat_has_the_reciprocal_of_our_track(
    course_deg: float, bearing_deg: float, phi_deg: float
) -> None:
    """Relative to us it moves against our velocity, so that alpha = pi."""
    assert same_course(ruled_deg(course_deg, course_deg + bearing_deg, STATIONARY), course_deg - phi_deg)


def test_a_very_slow_threat_counts_as_stationary() -> None:
    assert ruled_deg(20.0, 60.0, flying(110.0, 0.05)) == ruled_deg(20.0, 60.0, STATIONARY)
    assert ruled_deg(20.0, 60.0, flying(110.0, 0.5)) != ruled_deg(20.0, 60.0, STATIONARY)


def test_the_course_is_in_one_circle() -> None:
    for course_deg in range(0, 360, 15):
        for bearing_deg in range(0, 360, 15):
            for track_deg in range(0, 360, 15):
                assert 0.0 <= ruled_deg(course_deg, bearing_deg, flying(track_deg)) < 360.0


def first_crossing_s(place_m: Array, velocity_mps: Array, on_m: Array, along_mps: Array) -> float | None:
    """Time at which a straight flight reaches the line of another, in small steps [s]; `None` if never."""
    times_s = np.arange(0.0, 400.0, 0.02)
    offset = place_m + velocity_mps * times_s[:, None] - on_m
    side = np.sign(along_mps[0] * offset[:, 1] - along_mps[1] * offset[:, 0])
    changes = np.flatnonzero(side[1:] != side[:-1])
    return float(times_s[changes[0]]) if len(changes) else None


def stepped_pace(rel_m: Array, other_mps: Array, own_mps: Array) -> Pace | None:
    """The pace by the sentence of eq. 13; `None` where the steps are too coarse."""
    own_s = first_crossing_s(np.zeros(2), own_mps, rel_m, other_mps)
    other_s = first_crossing_s(rel_m, other_mps, np.zeros(2), own_mps)
    if own_s is None or other_s is None:
        return Pace.KEEP
    if abs(own_s - other_s) < 0.1 or max(own_s, other_s) > 390.0:
        return None
    return Pace.SLOWEST if other_s < own_s else Pace.FASTEST


def test_the_speed_is_that_of_equation_13() -> None:
    chance, seen = np.random.default_rng(13), dict.fromkeys(Pace, 0)
    for _ in range(300):
        # At these angles a crossing, if any, is well within the steps.
        crossing_deg = chance.choice([-1.0, 1.0]) * chance.uniform(20.0, 160.0)
        own_mps, other_mps = flying(50.0), flying(50.0 + crossing_deg, chance.uniform(10.0, 40.0))
        rel_m = chance.uniform(-1000.0, 1000.0, 2)
        stepped = stepped_pace(rel_m, other_mps, own_mps)
        if stepped is not None:
            assert speed_rule(rel_m, other_mps, own_mps) is stepped
            seen[stepped] += 1
    assert min(seen.values()) >= 30, "every case occurs"


@pytest.mark.parametrize(
    ("rel_m", "other_mps", "pace"),
    [
        ((1000.0, 500.0), (0.0, -30.0), Pace.SLOWEST),  # it crosses after 17 s, we after 50 s
        ((1000.0, 500.0), (0.0, -5.0), Pace.FASTEST),  # it crosses after 100 s
        (
            (1000.0, 1000.0),
            (0.0, -20.0),
            Pace.SLOWEST,
        ),  # both cross after 50 s: the slower one can turn behind
        ((1000.0, 500.0), (0.0, 30.0), Pace.KEEP),  # it has crossed already
        ((-1000.0, 500.0), (0.0, -30.0), Pace.KEEP),  # it crosses behind us
        ((1000.0, 50.0), (20.0, 0.0), Pace.KEEP),  # parallel
        ((1000.0, 0.0), (-20.0, 0.0), Pace.KEEP),  # head-on
        ((1000.0, 0.0), (0.0, 0.0), Pace.KEEP),  # stationary
    ],
)
def test_the_order_at_the_crossing_decides_the_pace(
    rel_m: tuple[float, float], other_mps: tuple[float, float], pace: Pace
) -> None:
    assert speed_rule(np.array(rel_m), np.array(other_mps), np.array([20.0, 0.0])) is pace


def test_without_own_speed_the_pace_is_kept() -> None:
    assert speed_rule(np.array([100.0, 50.0]), np.array([10.0, 0.0]), np.zeros(2)) is Pace.KEEP
