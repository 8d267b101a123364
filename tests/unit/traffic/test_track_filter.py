"""Filters: the smoothing of noise, the error in a turn, and stated accuracies."""

import math
import random

import pytest

from companion.geodesy import LocalFrame
from companion.model import (
    Vec3,
)
from companion.traffic import Tracker
from companion.traffic.estimate_params import EstimateParams
from companion.traffic.track_filter import HorizontalFilter, HorizontalFix
from tests.unit.traffic.straight_flight import (
    FRAME,
    only,
    report_at,
    straight,
)

STANDARD_RATE_RADPS = math.radians(3.0)


def noisy_run(velocity_sigma_mps: float, climb_sigma_mps: float) -> dict[str, float]:
    """RMS errors of the estimate and of the reports, in straight flight."""
    rng = random.Random(7)
    tracker = Tracker()
    squares = dict.fromkeys(("position", "height", "velocity", "climb", "raw velocity", "raw climb"), 0.0)
    count = 0
    for second in range(400):
        truth_m = straight((0.0, 0.0, -500.0), (30.0, -20.0, -1.0), second)
        noise_m = rng.gauss(0, 15), rng.gauss(0, 15), rng.gauss(0, 8)
        velocity_mps = (
            30.0 + rng.gauss(0, velocity_sigma_mps),
            -20.0 + rng.gauss(0, velocity_sigma_mps),
            -1.0 + rng.gauss(0, climb_sigma_mps),
        )
        tracker.receive(report_at(straight(truth_m, noise_m, 1), second, velocity_mps), second)
        if second < 20:
            continue
        track = only(tracker.tracks(second, FRAME))
        count += 1
        squares["position"] += math.dist(track.position_m[:2], truth_m[:2]) ** 2
        squares["height"] += (track.position_m[2] - truth_m[2]) ** 2
        squares["velocity"] += math.dist(track.velocity_mps[:2], (30.0, -20.0)) ** 2
        squares["climb"] += (track.velocity_mps[2] + 1.0) ** 2
        squares["raw velocity"] += math.dist(velocity_mps[:2], (30.0, -20.0)) ** 2
        squares["raw climb"] += (velocity_mps[2] + 1.0) ** 2
    assert not tracker.dropped
    return {name: math.sqrt(square / count) for name, square in squares.items()}


def test_noise_is_smoothed_and_velocities_are_better_than_reported() -> None:
    rms = noisy_run(velocity_sigma_mps=1.5, climb_sigma_mps=0.8)
    assert rms["velocity"] < 0.85 * rms["raw velocity"]
    assert rms["climb"] < 0.75 * rms["raw climb"]
    assert rms["position"] < 9.0  # 21 as reported
    assert rms["height"] < 4.0  # 8 as reported


def test_noisy_positions_hardly_change_a_velocity_that_is_reported_exactly() -> None:
    rms = noisy_run(velocity_sigma_mps=0.0, climb_sigma_mps=0.0)
    assert rms["velocity"] < 0.35
    assert rms["climb"] < 0.1


def turning(time_s: float, speed_mps: float) -> tuple[Vec3, Vec3]:
    """Position and velocity in a level standard-rate turn."""
    radius_m, course_rad = speed_mps / STANDARD_RATE_RADPS, STANDARD_RATE_RADPS * time_s
    north_m, east_m = radius_m * math.sin(course_rad), radius_m * (1.0 - math.cos(course_rad))
    return (north_m, east_m, -400.0), (
        speed_mps * math.cos(course_rad),
        speed_mps * math.sin(course_rad),
        0.0,
    )


@pytest.mark.parametrize(("velocity_known", "bound_m"), [(True, 2.5), (False, 25.0)])
def test_a_turning_intruder_stays_near_its_track(velocity_known: bool, bound_m: float) -> None:
    """60 m/s, 3 deg/s, one report a second; compared ten times a second."""
    tracker = Tracker()
    worst_m = 0.0
    for step in range(1200):
        now_s = step / 10.0
        position_m, velocity_mps = turning(now_s, 60.0)
        if step % 10 == 0:
            assert tracker.receive(
                report_at(position_m, now_s, velocity_mps if velocity_known else None), now_s
            )
        if step >= 50:
            worst_m = max(worst_m, math.dist(only(tracker.tracks(now_s, FRAME)).position_m, position_m))
    assert bound_m / 2 < worst_m < bound_m


@pytest.mark.parametrize("lat_deg", [-90.0, -89.995, 0.0, 47.0, 89.9, 90.0])
@pytest.mark.parametrize("lon_deg", [-180.0, 8.0, 179.9999])
def test_lengths_of_degrees_are_right_everywhere(lat_deg: float, lon_deg: float) -> None:
    """Away from the nearer pole for a minute, at 60 m/s."""
    north_mps = 60.0 if lat_deg < 0.0 else -60.0
    frame = LocalFrame(lat_deg, lon_deg)
    here = HorizontalFilter(HorizontalFix(0.0, lat_deg, lon_deg, (north_mps, 0.0)), EstimateParams())
    for second in range(1, 61):
        place = frame.to_geo(north_mps * second, 0.0, 0.0)
        fix = HorizontalFix(float(second), place.lat_deg, place.lon_deg, (north_mps, 0.0))
        assert not here.is_outlier(fix)
        here.update(fix)
    assert math.dist((here.north_mps, here.east_mps), (north_mps, 0.0)) < 0.01
    assert abs(frame.to_north_east_m(here.lat_deg, here.lon_deg)[0] - 60.0 * north_mps) < 5.0
