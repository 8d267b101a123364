"""Trajectories: the limits that they keep, and separation against brute force."""

import math
from dataclasses import replace

import numpy as np
import pytest

from companion.avoidance.intruders import Tracks, separation
from companion.avoidance.trajectory import (
    HORIZON_S,
    TIMES_S,
    Commands,
    Envelope,
    OwnState,
    fly_ahead,
    ground_velocity_mps,
    own_state,
)
from companion.model import Guidance, Ownship
from sim.airframe import ARDUPLANE, Airframe
from sim.dynamics import FixedWing

ENVELOPE = Envelope()
CALM = (0.0, 0.0)


def own(**changes: object) -> OwnState:
    state = OwnState(
        position_m=(0.0, 0.0, -300.0),
        course_rad=0.0,
        airspeed_mps=22.0,
        climb_mps=0.0,
        wind_mps=CALM,
    )
    return state._replace(**changes)  # type: ignore[arg-type]


def command(course_deg: float = 0.0, airspeed_mps: float = 22.0, altitude_m: float = 300.0) -> Commands:
    return Commands.of([Guidance(math.radians(course_deg), airspeed_mps, altitude_m)])


def tracks(*states: tuple[tuple[float, float, float], tuple[float, float, float]]) -> Tracks:
    count = len(states)
    return Tracks(
        tuple(str(i) for i in range(count)),
        np.array([position for position, _ in states]),
        np.array([velocity for _, velocity in states]),
        np.full(count, 600.0),
        np.full(count, 75.0),
        np.zeros(count, dtype=bool),
        np.zeros(count),
        np.zeros(count),
    )


def test_straight_flight_is_straight() -> None:
    row = fly_ahead(own(), command(), ENVELOPE).row_m(0)
    assert row[-1] == pytest.approx((22.0 * HORIZON_S, 0.0, -300.0))


def test_a_turn_has_the_radius_of_its_bank() -> None:
    row = fly_ahead(own(), command(course_deg=179.0), replace(ENVELOPE, response_s=0.0)).row_m(0)
    radius_m = 22.0**2 / (9.80665 * math.tan(ENVELOPE.max_bank_rad))
    assert row[:14, 1].max() == pytest.approx(2.0 * radius_m, rel=0.05)


def test_a_turn_takes_the_short_way_after_the_response_time() -> None:
    left = fly_ahead(own(course_rad=math.radians(10.0)), command(course_deg=350.0), ENVELOPE).row_m(0)
    assert left[-1, 1] < 0.0
    assert left[1, 1] == pytest.approx(22.0 * math.sin(math.radians(10.0))), "no turn in the first second"


def test_a_climb_keeps_its_limit_and_stops_at_the_height() -> None:
    row = fly_ahead(own(), command(altitude_m=400.0), ENVELOPE).row_m(0)
    heights = -row[:, 2]
    assert heights[-1] == pytest.approx(400.0)
    assert np.diff(heights).max() <= ENVELOPE.max_climb_mps * 3.0 + 1e-6
    assert heights[11] == pytest.approx(300.0 + ENVELOPE.max_climb_mps * (11.0 - ENVELOPE.response_s))


def test_ground_velocity_is_that_of_the_wind_triangle() -> None:
    wind = np.array([0.0, 6.0])
    assert ground_velocity_mps(math.pi / 2, 20.0, wind) == pytest.approx([0.0, 26.0])
    assert ground_velocity_mps(-math.pi / 2, 20.0, wind) == pytest.approx([0.0, -14.0])
    assert ground_velocity_mps(0.0, 20.0, wind) == pytest.approx([math.sqrt(400.0 - 36.0), 0.0])


@pytest.mark.parametrize(
    ("course_deg", "wind", "drift_mps"),
    [(180.0, (40.0, 0.0), (20.0, 0.0)), (0.0, (0.0, 40.0), (0.0, 20.0)), (90.0, (-30.0, 0.0), (-10.0, 0.0))],
)
def test_an_aircraft_drifts_in_a_wind_too_strong_for_its_course(
    course_deg: float, wind: tuple[float, float], drift_mps: tuple[float, float]
) -> None:
    velocity_mps = ground_velocity_mps(math.radians(course_deg), 20.0, wind)
    assert velocity_mps == pytest.approx(drift_mps)
    steady = own(course_rad=math.radians(course_deg), airspeed_mps=20.0, wind_mps=wind)
    row = fly_ahead(steady, command(course_deg, 20.0), ENVELOPE).row_m(0)
    assert row[-1, :2] == pytest.approx(HORIZON_S * np.array(drift_mps), abs=1e-6)


def test_an_aircraft_that_drifts_backwards_keeps_its_heading() -> None:
    """The nose points north and the aircraft drifts south: its course does not show where it can go next."""
    state = own_state(0.0, Ownship(0.0, (0.0, 0.0, -300.0), (-10.0, 0.0, 0.0), 20.0, 0.0, (-30.0, 0.0)))
    assert state.ground_mps == pytest.approx([-10.0, 0.0])
    row = fly_ahead(state, command(course_deg=180.0, airspeed_mps=20.0), ENVELOPE).row_m(0)
    assert row[1, :2] == pytest.approx([-10.0, 0.0])


# The prediction is that of a coordinated turn; ArduPilot's simulated plane slips, and arrives later.
COORDINATED = replace(ARDUPLANE, turn_share=1.0)


@pytest.mark.parametrize(
    ("airframe", "wind_mps", "worst_m"),
    [
        (COORDINATED, 0.0, 34.0),
        (COORDINATED, 8.0, 36.0),
        (COORDINATED, 15.0, 36.0),
        (ARDUPLANE, 0.0, 45.0),
        (ARDUPLANE, 8.0, 46.0),
        (ARDUPLANE, 15.0, 48.0),
    ],
    ids=lambda value: {COORDINATED: "coordinated", ARDUPLANE: "ArduPlane"}.get(value, str(value)),
)
@pytest.mark.parametrize("turn_deg", [-150.0, -60.0, -15.0, 30.0, 90.0])
def test_turns_in_wind_match_a_simulated_aircraft(
    turn_deg: float, airframe: Airframe, wind_mps: float, worst_m: float
) -> None:
    """For eleven seconds, in wind from any direction; most is missing at the end of the widest turn."""
    for from_deg in range(0, 360, 45):
        wind = (wind_mps * math.cos(math.radians(from_deg)), wind_mps * math.sin(math.radians(from_deg)))
        flown = FixedWing((0.0, 0.0, -300.0), wind_mps=wind, airframe=airframe)
        flown.hold_course(math.radians(turn_deg), ENVELOPE.max_bank_rad)
        row = fly_ahead(own(wind_mps=wind), command(turn_deg), ENVELOPE).row_m(0)
        for second in range(1, 12):
            for _ in range(20):
                flown.step(0.05)
            assert math.dist(flown.position_m, row[second]) < worst_m


def test_separation_is_that_of_brute_force() -> None:
    commands = Commands.of(
        [Guidance(0.0, 22.0, 300.0), Guidance(math.pi / 2, 22.0, 300.0), Guidance(0.0, 22.0, 400.0)]
    )
    traffic = tracks(((3000.0, 0.0, -300.0), (-50.0, 0.0, 0.0)), ((0.0, 5000.0, -380.0), (0.0, 0.0, 1.0)))
    paths = fly_ahead(own(), commands, ENVELOPE)
    kept = separation(paths, traffic)
    times_s = np.concatenate([np.arange(0.0, 12.0), np.arange(12.0, 60.0, 2.0), np.arange(60.0, 91.0, 3.0)])
    for k in range(3):
        for n in range(2):
            other = traffic.position_m[n] + traffic.velocity_mps[n] * times_s[:, None]
            offset = paths.row_m(k) - other
            ratio = np.maximum(np.hypot(offset[:, 0], offset[:, 1]) / 600.0, np.abs(offset[:, 2]) / 75.0)
            assert kept.closest[k, n] == pytest.approx(ratio.min(), abs=1e-4)
    assert kept.exposure[0, 0] > 0.0
    assert kept.closest[1, 0] > kept.closest[0, 0]


def test_separation_is_as_exact_far_from_the_origin() -> None:
    far = np.array([4.0e6, -3.0e6, -300.0])
    near = separation(
        fly_ahead(own(), command(), ENVELOPE), tracks(((3000.0, 10.0, -300.0), (-50.0, 0.0, 0.0)))
    )
    shifted = separation(
        fly_ahead(own(position_m=far), command(), ENVELOPE),
        tracks(((far[0] + 3000.0, far[1] + 10.0, -300.0), (-50.0, 0.0, 0.0))),
    )
    assert shifted.closest == pytest.approx(near.closest, abs=1e-4)


@pytest.mark.parametrize(("low", "high"), [(30.0, 20.0)])
def test_an_inconsistent_envelope_is_refused(low: float, high: float) -> None:
    with pytest.raises(ValueError, match="min_airspeed_mps"):
        Envelope(min_airspeed_mps=low, max_airspeed_mps=high)
    with pytest.raises(ValueError, match="min_altitude_m"):
        Envelope(min_altitude_m=low, max_altitude_m=high)


def test_a_turning_track_follows_a_circle_and_then_straightens_out() -> None:
    rate_radps, speed_mps = math.radians(3.0), 60.0
    turning = replace(tracks(((0.0, 0.0, -300.0), (speed_mps, 0.0, 0.0))), turn_radps=np.array([rate_radps]))
    north_m, east_m = turning.ground_m()[0].T
    radius_m = speed_mps / rate_radps
    ten_s = int(np.searchsorted(TIMES_S, 10.0))
    off_m = math.hypot(north_m[ten_s], east_m[ten_s] - radius_m) - radius_m
    assert abs(off_m) < 25.0
    assert east_m[ten_s] > 0.0, "to the right"
    courses_rad = np.unwrap(np.arctan2(np.diff(east_m), np.diff(north_m)))
    assert (np.diff(courses_rad) > 0.0).all()
    # With a time constant of 35 s the turn reaches 97 of 105 degrees.
    assert math.degrees(courses_rad[-1]) == pytest.approx(97.0, abs=2.0)
    lengths_m = np.hypot(np.diff(north_m), np.diff(east_m))
    assert lengths_m == pytest.approx(speed_mps * np.diff(TIMES_S))


def test_a_straight_track_is_predicted_straight_beside_a_turning_one() -> None:
    both = tracks(((0.0, 0.0, -300.0), (60.0, 0.0, 0.0)), ((100.0, 50.0, -300.0), (10.0, -20.0, 0.0)))
    ahead_m = replace(both, turn_radps=np.array([0.05, 0.0])).ground_m()
    assert ahead_m[1] == pytest.approx(np.array([100.0, 50.0]) + TIMES_S[:, None] * np.array([10.0, -20.0]))
