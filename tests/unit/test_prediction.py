"""Flying ahead: the limits it keeps, and separation against brute force."""

import math
from dataclasses import replace

import numpy as np
import pytest

from companion.avoidance.envelope import Envelope
from companion.avoidance.prediction import (
    HORIZON_S,
    Commands,
    OwnState,
    Tracks,
    fly_ahead,
    ground_speed_mps,
    separation,
)
from companion.model import Guidance

ENVELOPE = Envelope()
CALM = np.zeros(2)


def own(**changes: object) -> OwnState:
    state = OwnState(
        position_m=np.array([0.0, 0.0, -300.0]),
        course_rad=0.0,
        airspeed_mps=22.0,
        climb_mps=0.0,
        wind_mps=CALM,
    )
    return replace(state, **changes)  # type: ignore[arg-type]


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
    )


def test_straight_flight_goes_straight() -> None:
    row = fly_ahead(own(), command(), ENVELOPE).row_m(0)
    assert row[-1] == pytest.approx((22.0 * HORIZON_S, 0.0, -300.0))


def test_a_turn_has_the_radius_of_its_bank() -> None:
    row = fly_ahead(own(), command(course_deg=179.0), replace(ENVELOPE, response_s=0.0)).row_m(0)
    radius_m = 22.0**2 / (9.80665 * math.tan(ENVELOPE.max_bank_rad))
    assert row[:14, 1].max() == pytest.approx(2.0 * radius_m, rel=0.05)


def test_the_short_way_round_and_the_response_time() -> None:
    left = fly_ahead(own(course_rad=math.radians(10.0)), command(course_deg=350.0), ENVELOPE).row_m(0)
    assert left[-1, 1] < 0.0
    assert left[1, 1] == pytest.approx(22.0 * math.sin(math.radians(10.0))), "no turn in the first second"


def test_climb_keeps_its_limit_and_stops_at_the_height() -> None:
    row = fly_ahead(own(), command(altitude_m=400.0), ENVELOPE).row_m(0)
    heights = -row[:, 2]
    assert heights[-1] == pytest.approx(400.0)
    assert np.diff(heights).max() <= ENVELOPE.max_climb_mps * 3.0 + 1e-6
    assert heights[11] == pytest.approx(300.0 + ENVELOPE.max_climb_mps * (11.0 - ENVELOPE.response_s))


def test_wind_triangle() -> None:
    wind = np.array([0.0, 6.0])
    assert ground_speed_mps(math.pi / 2, 20.0, wind) == pytest.approx(26.0)
    assert ground_speed_mps(-math.pi / 2, 20.0, wind) == pytest.approx(14.0)
    assert ground_speed_mps(0.0, 20.0, wind) == pytest.approx(math.sqrt(400.0 - 36.0))
    assert ground_speed_mps(math.pi, 20.0, np.array([40.0, 0.0])) == 1.0, "blown backwards, but no NaN"


def test_separation_is_that_of_every_row_and_track() -> None:
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


def test_far_from_the_origin_nothing_is_lost() -> None:
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
def test_an_envelope_that_contradicts_itself_is_refused(low: float, high: float) -> None:
    with pytest.raises(ValueError, match="min_airspeed_mps"):
        Envelope(min_airspeed_mps=low, max_airspeed_mps=high)
    with pytest.raises(ValueError, match="min_altitude_m"):
        Envelope(min_altitude_m=low, max_altitude_m=high)
