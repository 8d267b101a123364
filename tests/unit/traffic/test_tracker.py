"""Reports to tracks: what is believed, kept, smoothed and forgotten."""

import math
import random
from dataclasses import replace

import numpy as np
import pytest

from companion.geodesy import GeoPoint, LocalFrame
from companion.mavlink.facts import Traffic
from companion.mavlink.framing import decode
from companion.mavlink.tlog import read_tlog
from companion.mavlink.translate import to_fact
from companion.model import (
    AltitudeReference,
    Track,
    TrafficKind,
    TrafficReport,
    TrafficSource,
    Vec3,
    adsb_key,
)
from companion.traffic import DropReason, Tracker, TrafficParams
from companion.traffic.altitude_datums import AS_REPORTED, DatumOffset
from companion.traffic.target import RepeatFilter
from companion.traffic.track_filter import Covariance
from tests.support.paths import TLOGS

FRAME = LocalFrame(47.4, 8.5)
ICAO = 0x4B1234
STANDARD_RATE_RADPS = math.radians(3.0)


def adsb(icao: int, time_s: float, lat_deg: float, lon_deg: float, altitude_m: float) -> TrafficReport:
    """A report of a transponder, so far without motion."""
    return TrafficReport(TrafficSource.ADSB, adsb_key(icao), time_s, lat_deg, lon_deg, altitude_m, icao=icao)


def report_at(
    position_m: Vec3, time_s: float, velocity_mps: Vec3 | None = None, icao: int = ICAO
) -> TrafficReport:
    """A perfect report of a place in FRAME; without velocity nothing about motion is known."""
    place = FRAME.to_geo(*position_m)
    report = adsb(icao, time_s, place.lat_deg, place.lon_deg, place.altitude_m)
    if velocity_mps is None:
        return report
    north_mps, east_mps, down_mps = velocity_mps
    return replace(
        report,
        course_rad=math.atan2(east_mps, north_mps) % (2.0 * math.pi),
        ground_speed_mps=math.hypot(north_mps, east_mps),
        climb_mps=-down_mps,
    )


def straight(start_m: Vec3, velocity_mps: Vec3, time_s: float) -> Vec3:
    north_m, east_m, down_m = (p + v * time_s for p, v in zip(start_m, velocity_mps, strict=True))
    return north_m, east_m, down_m


def only(tracks: tuple[Track, ...]) -> Track:
    assert len(tracks) == 1
    return tracks[0]


START_M, VELOCITY_MPS = (-600.0, 900.0, -350.0), (48.0, -36.0, -2.5)


def follow(tracker: Tracker, until_s: int, velocity_known: bool = True) -> None:
    """Perfect reports of straight flight, once a second, `until_s` included."""
    for second in range(until_s + 1):
        position_m = straight(START_M, VELOCITY_MPS, second)
        report = report_at(position_m, second, VELOCITY_MPS if velocity_known else None)
        assert tracker.receive(report, second)


# --- straight flight -------------------------------------------------------------------------------


def test_a_perfect_straight_flight_is_tracked_within_centimetres_between_reports_too() -> None:
    tracker = Tracker()
    for step in range(600):
        now_s = step / 10.0
        if step % 10 == 0:
            tracker.receive(report_at(straight(START_M, VELOCITY_MPS, now_s), now_s, VELOCITY_MPS), now_s)
        track = only(tracker.tracks(now_s, FRAME))
        # The frame is flat: to the smoother, a straight line in it bends, by 0.09 m at the end, 2.5 km away.
        assert math.dist(track.position_m, straight(START_M, VELOCITY_MPS, now_s)) < 0.1
        assert math.dist(track.velocity_mps, VELOCITY_MPS) < 0.01
        assert track.time_s == now_s
        assert track.age_s == pytest.approx(now_s - math.floor(now_s))


def test_a_track_carries_address_callsign_and_kind() -> None:
    tracker = Tracker()
    first = report_at(START_M, 0.0, icao=0xABC)
    tracker.receive(replace(first, callsign="HB-ZRH", kind=TrafficKind.UAV), 0.0)
    later = report_at(START_M, 1.0, VELOCITY_MPS, icao=0xABC)
    tracker.receive(replace(later, kind=TrafficKind.UAV), 1.0)
    track = only(tracker.tracks(1.0, FRAME))
    assert (track.track_id, track.icao, track.callsign, track.kind) == (
        "000ABC",
        0xABC,
        "HB-ZRH",
        TrafficKind.UAV,
    )


def test_a_report_is_flown_on_from_the_time_it_was_valid() -> None:
    tracker = Tracker()
    tracker.receive(report_at(START_M, 100.0, VELOCITY_MPS), 103.0)
    track = only(tracker.tracks(104.0, FRAME))
    assert math.dist(track.position_m, straight(START_M, VELOCITY_MPS, 4.0)) < 0.01
    assert track.age_s == pytest.approx(4.0)


def test_the_estimate_does_not_depend_on_the_frame_it_is_asked_in() -> None:
    still, moved = Tracker(), Tracker()
    elsewhere = LocalFrame(47.41, 8.52)
    for second in range(20):
        report = report_at(straight(START_M, VELOCITY_MPS, second), second, VELOCITY_MPS)
        still.receive(report, second)
        moved.receive(report, second)
        moved.tracks(second + 0.5, elsewhere)
    assert moved.tracks(20.0, FRAME) == still.tracks(20.0, FRAME)
    here = FRAME.to_geo(*only(still.tracks(20.0, FRAME)).position_m)
    there = elsewhere.to_geo(*only(still.tracks(20.0, elsewhere)).position_m)
    assert there.lat_deg == pytest.approx(here.lat_deg, abs=1e-6)
    assert there.lon_deg == pytest.approx(here.lon_deg, abs=1e-6)


def test_a_track_crosses_the_date_line() -> None:
    frame = LocalFrame(10.0, 179.9999)
    tracker = Tracker()
    for second in range(5):
        place = frame.to_geo(0.0, -100.0 + 60.0 * second, -300.0)
        report = adsb(ICAO, second, place.lat_deg, place.lon_deg, 300.0)
        tracker.receive(replace(report, course_rad=math.pi / 2, ground_speed_mps=60.0), second)
    assert only(tracker.tracks(5.0, frame)).position_m[1] == pytest.approx(200.0, abs=0.05)


# --- what the report does not say ------------------------------------------------------------------


def test_climb_is_estimated_from_altitudes_when_the_report_has_none() -> None:
    tracker = Tracker()
    for second in range(40):
        report = report_at(straight(START_M, VELOCITY_MPS, second), second, VELOCITY_MPS)
        tracker.receive(replace(report, climb_mps=None), second)
    track = only(tracker.tracks(39.5, FRAME))
    assert track.velocity_mps[2] == pytest.approx(VELOCITY_MPS[2], abs=0.02)
    assert track.position_m[2] == pytest.approx(straight(START_M, VELOCITY_MPS, 39.5)[2], abs=0.1)


def test_velocity_is_estimated_from_positions_when_the_report_has_none() -> None:
    tracker = Tracker()
    follow(tracker, 3, velocity_known=False)
    assert math.dist(only(tracker.tracks(3.0, FRAME)).velocity_mps, VELOCITY_MPS) < 2.0
    tracker = Tracker()
    follow(tracker, 40, velocity_known=False)
    track = only(tracker.tracks(40.0, FRAME))
    assert math.dist(track.velocity_mps, VELOCITY_MPS) < 0.02
    assert math.dist(track.position_m, straight(START_M, VELOCITY_MPS, 40.0)) < 0.05


def test_a_speed_without_a_course_says_nothing_unless_it_is_zero() -> None:
    tracker = Tracker()
    follow(tracker, 5)
    fast = replace(report_at(straight(START_M, VELOCITY_MPS, 6), 6.0), ground_speed_mps=60.0)
    assert tracker.receive(fast, 6.0)
    assert math.dist(only(tracker.tracks(6.0, FRAME)).velocity_mps, VELOCITY_MPS) < 0.05
    standing = Tracker()
    for second in range(3):
        report = replace(report_at((second * 0.5, 0.0, -300.0), second), ground_speed_mps=0.0)
        standing.receive(report, second)
    assert math.hypot(*only(standing.tracks(3.0, FRAME)).velocity_mps) < 0.2


@pytest.mark.parametrize(("speed_mps", "climb_mps"), [(655.35, -327.68), (-60.0, 100.0)])
def test_an_impossible_speed_or_climb_is_an_unknown_one(speed_mps: float, climb_mps: float) -> None:
    tracker = Tracker()
    follow(tracker, 5)
    report = report_at(straight(START_M, VELOCITY_MPS, 6), 6.0, VELOCITY_MPS)
    assert tracker.receive(replace(report, ground_speed_mps=speed_mps, climb_mps=climb_mps), 6.0)
    track = only(tracker.tracks(6.0, FRAME))
    assert math.dist(track.velocity_mps, VELOCITY_MPS) < 0.01
    assert math.dist(track.position_m, straight(START_M, VELOCITY_MPS, 6)) < 0.01
    assert not tracker.dropped


def test_a_target_without_altitude_is_counted_and_not_a_track() -> None:
    tracker = Tracker()
    assert tracker.receive(replace(report_at(START_M, 0.0, VELOCITY_MPS), altitude_m=None), 0.0)
    assert tracker.tracks(0.0, FRAME) == ()
    assert tracker.dropped[DropReason.NO_ALTITUDE] == 1
    assert tracker.without_position(0.0) == 1
    assert tracker.without_position(30.0) == 0


def test_a_height_is_held_for_a_while_and_no_longer() -> None:
    tracker = Tracker(TrafficParams(altitude_hold_s=10.0))
    tracker.receive(report_at(START_M, 0.0, VELOCITY_MPS), 0.0)
    for second in range(1, 13):
        report = report_at(straight(START_M, VELOCITY_MPS, second), second, VELOCITY_MPS)
        assert tracker.receive(replace(report, altitude_m=None), second)
        shown = tracker.tracks(second, FRAME)
        assert len(shown) == (second <= 10)
        if shown:
            assert math.dist(shown[0].position_m, straight(START_M, VELOCITY_MPS, second)) < 0.01
    assert tracker.without_position(12.0) == 1
    assert tracker.dropped[DropReason.NO_ALTITUDE] == 2
    tracker.receive(report_at(straight(START_M, VELOCITY_MPS, 13), 13.0, VELOCITY_MPS), 13.0)
    assert math.dist(only(tracker.tracks(13.0, FRAME)).position_m, straight(START_M, VELOCITY_MPS, 13)) < 0.01


def test_a_report_without_position_is_counted_and_does_not_refresh_a_track() -> None:
    tracker = Tracker()
    tracker.receive(report_at(START_M, 0.0, VELOCITY_MPS), 0.0)
    blind = replace(report_at(START_M, 15.0, VELOCITY_MPS), lat_deg=None, lon_deg=None)
    assert not tracker.receive(blind, 15.0)
    assert only(tracker.tracks(15.0, FRAME)).age_s == 15.0
    assert tracker.without_position(15.0) == 0
    assert not tracker.receive(replace(blind, icao=0x777, key="000777"), 15.0)
    assert tracker.without_position(15.0) == 1
    assert tracker.dropped[DropReason.NO_POSITION] == 2
    assert tracker.without_position(36.0) == 0


def test_heights_of_two_references_are_kept_apart_and_the_one_that_compares_better_counts() -> None:
    tracker = Tracker(TrafficParams(altitude_hold_s=10.0))
    for second in range(10):
        report = report_at((48.0 * second, 0.0, -300.0), second)
        other = replace(
            report, time_s=second + 0.5, altitude_m=150.0, altitude_reference=AltitudeReference.BAROMETRIC
        )
        tracker.receive(report, second)
        tracker.receive(other, second + 0.5)
    offsets = {**AS_REPORTED, AltitudeReference.BAROMETRIC: DatumOffset(0.0, 60.0)}
    track = only(tracker.tracks(9.5, FRAME, offsets))
    assert (track.position_m[2], track.velocity_mps[2], track.vertical_uncertainty_m) == (-300.0, 0.0, 0.0)
    offsets = {**AS_REPORTED, AltitudeReference.GEOMETRIC: DatumOffset(0.0, 50.0)}
    track = only(tracker.tracks(9.5, FRAME, offsets))
    assert (track.position_m[2], track.velocity_mps[2], track.vertical_uncertainty_m) == (-150.0, 0.0, 0.0)
    assert not tracker.dropped


# --- repeats and order -----------------------------------------------------------------------------


def test_an_identical_repeat_does_not_refresh_the_age() -> None:
    tracker = Tracker()
    follow(tracker, 3)
    last = report_at(straight(START_M, VELOCITY_MPS, 3), 3.0, VELOCITY_MPS)
    for second in range(4, 24):
        assert not tracker.receive(replace(last, time_s=second), second)
        track = only(tracker.tracks(second, FRAME))
        assert track.age_s == second - 3.0
        assert math.dist(track.position_m, straight(START_M, VELOCITY_MPS, second)) < 0.01
    assert tracker.tracks(23.5, FRAME) == ()
    assert tracker.dropped[DropReason.REPEATED] == 20


def test_a_report_that_comes_late_by_a_second_link_is_known() -> None:
    tracker = Tracker()
    reports = [report_at(straight(START_M, VELOCITY_MPS, s), s, VELOCITY_MPS) for s in range(4)]
    for second, report in enumerate(reports):
        assert tracker.receive(report, second)
        if second >= 2:
            assert not tracker.receive(replace(reports[second - 2], time_s=second + 0.3), second + 0.3)
    assert tracker.dropped == {DropReason.REPEATED: 2}
    assert math.dist(only(tracker.tracks(4.0, FRAME)).position_m, straight(START_M, VELOCITY_MPS, 4)) < 0.01


@pytest.mark.parametrize("speed_mps", [0.0, 1.5, None])
def test_a_hovering_helicopter_stays(speed_mps: float | None) -> None:
    tracker = Tracker()
    hovering = replace(report_at(START_M, 0.0), ground_speed_mps=speed_mps, course_rad=0.0, climb_mps=0.0)
    accepted = [second for second in range(60) if tracker.receive(replace(hovering, time_s=second), second)]
    assert accepted == [0, 8, 16, 24, 32, 40, 48, 56]
    track = only(tracker.tracks(59.0, FRAME))
    assert track.age_s == 3.0
    # Up to 7 s of flying on with the reported 1.5 m/s, pulled back by each report.
    assert math.dist(track.position_m, START_M) < 20.0


def test_a_moving_aircraft_that_stands_still_is_a_frozen_receiver() -> None:
    tracker = Tracker()
    frozen = report_at(START_M, 0.0, VELOCITY_MPS)
    for second in range(21):
        tracker.receive(replace(frozen, time_s=second), second)
    assert only(tracker.tracks(20.0, FRAME)).age_s == 20.0
    assert tracker.tracks(20.1, FRAME) == ()


def test_a_reordered_report_is_ignored() -> None:
    tracker = Tracker()
    follow(tracker, 5)
    late = report_at(straight(START_M, VELOCITY_MPS, 4.5), 4.5, VELOCITY_MPS)
    before = tracker.tracks(5.2, FRAME)
    assert not tracker.receive(late, 5.2)
    assert tracker.tracks(5.2, FRAME) == before
    assert tracker.dropped == {DropReason.REORDERED: 1}


def test_a_report_that_is_already_stale_is_refused() -> None:
    tracker = Tracker()
    assert not tracker.receive(report_at(START_M, 0.0), 21.0)
    assert tracker.dropped == {DropReason.STALE: 1}


# --- outliers --------------------------------------------------------------------------------------


@pytest.mark.parametrize("off_m", [(500.0, 0.0, 0.0), (0.0, -20_000.0, 0.0)])
def test_a_single_outlier_is_not_believed(off_m: Vec3) -> None:
    tracker = Tracker()
    follow(tracker, 5)
    wrong = straight(straight(START_M, VELOCITY_MPS, 6), off_m, 1)
    assert not tracker.receive(report_at(wrong, 6.0, VELOCITY_MPS), 6.0)
    assert only(tracker.tracks(6.0, FRAME)).age_s == 1.0
    assert tracker.receive(report_at(straight(START_M, VELOCITY_MPS, 7), 7.0, VELOCITY_MPS), 7.0)
    track = only(tracker.tracks(7.0, FRAME))
    assert math.dist(track.position_m, straight(START_M, VELOCITY_MPS, 7)) < 0.01
    assert tracker.dropped == {DropReason.JUMPED: 1}


def test_a_jump_that_persists_restarts_the_track_there() -> None:
    tracker = Tracker()
    follow(tracker, 5)
    there_m = (9000.0, 0.0, -900.0)
    assert not tracker.receive(report_at(there_m, 6.0, VELOCITY_MPS), 6.0)
    assert tracker.receive(report_at(straight(there_m, VELOCITY_MPS, 1), 7.0, VELOCITY_MPS), 7.0)
    track = only(tracker.tracks(7.0, FRAME))
    assert math.dist(track.position_m[:2], straight(there_m, VELOCITY_MPS, 1)[:2]) < 0.05
    assert math.dist(track.velocity_mps, VELOCITY_MPS) < 0.05


def test_two_outliers_in_different_places_do_not_bear_each_other_out() -> None:
    tracker = Tracker()
    follow(tracker, 5)
    assert not tracker.receive(report_at((9000.0, 0.0, -300.0), 6.0, VELOCITY_MPS), 6.0)
    assert not tracker.receive(report_at((-9000.0, 0.0, -300.0), 7.0, VELOCITY_MPS), 7.0)
    assert math.dist(only(tracker.tracks(7.0, FRAME)).position_m, straight(START_M, VELOCITY_MPS, 7)) < 0.01


def test_a_wrong_place_that_comes_back_later_is_still_not_believed() -> None:
    tracker = Tracker()
    wrong_m = (9000.0, 0.0, -300.0)
    for second in range(12):
        reported_m = straight(wrong_m, VELOCITY_MPS, second) if second in (6, 8) else None
        reported_m = reported_m or straight(START_M, VELOCITY_MPS, second)
        tracker.receive(report_at(reported_m, second, VELOCITY_MPS), second)
        truth_m = straight(START_M, VELOCITY_MPS, second)
        assert math.dist(only(tracker.tracks(second, FRAME)).position_m, truth_m) < 0.05
    assert tracker.dropped == {DropReason.JUMPED: 2}


def test_a_report_dated_a_second_wrong_is_no_jump_even_for_a_jet() -> None:
    tracker = Tracker()
    jet_mps = (200.0, 0.0, 0.0)
    for second in range(6):
        tracker.receive(report_at(straight((-3000.0, 0.0, -900.0), jet_mps, second), second, jet_mps), second)
    late_m = straight((-3000.0, 0.0, -900.0), jet_mps, 5.05)
    assert tracker.receive(report_at(late_m, 6.0, jet_mps), 6.0)


def test_first_positions_further_apart_than_anything_flies_are_not_believed() -> None:
    tracker = Tracker()
    tracker.receive(report_at((0.0, 0.0, -300.0), 0.0), 0.0)
    assert not tracker.receive(report_at((900.0, 0.0, -300.0), 2.0 - 0.05), 1.95)
    assert tracker.receive(report_at((800.0, 0.0, -300.0), 2.0), 2.0)


def test_a_single_absurd_velocity_is_not_believed() -> None:
    tracker = Tracker()
    follow(tracker, 5)
    backwards = (-VELOCITY_MPS[0], -VELOCITY_MPS[1], VELOCITY_MPS[2])
    assert not tracker.receive(report_at(straight(START_M, VELOCITY_MPS, 6), 6.0, backwards), 6.0)
    assert math.dist(only(tracker.tracks(6.0, FRAME)).velocity_mps, VELOCITY_MPS) < 0.01


def test_a_single_absurd_height_or_climb_leaves_the_rest_of_the_report_usable() -> None:
    tracker = Tracker()
    follow(tracker, 5)
    report = report_at(straight(START_M, VELOCITY_MPS, 6), 6.0, VELOCITY_MPS)
    assert tracker.receive(replace(report, altitude_m=5000.0), 6.0)
    report = report_at(straight(START_M, VELOCITY_MPS, 7), 7.0, VELOCITY_MPS)
    assert tracker.receive(replace(report, climb_mps=-50.0), 7.0)
    assert math.dist(only(tracker.tracks(7.0, FRAME)).position_m, straight(START_M, VELOCITY_MPS, 7)) < 0.01
    assert tracker.dropped == {DropReason.ALTITUDE_JUMPED: 2}


def test_a_new_height_that_persists_is_believed() -> None:
    tracker = Tracker()
    follow(tracker, 5)
    for second in (6, 7):
        report = report_at(straight(START_M, VELOCITY_MPS, second), second, VELOCITY_MPS)
        tracker.receive(replace(report, altitude_m=1000.0 + 2.5 * second), second)
    assert only(tracker.tracks(7.0, FRAME)).position_m[2] == pytest.approx(-1017.5, abs=0.01)


def test_the_memory_for_repeats_is_bounded() -> None:
    memory = RepeatFilter(window_s=7.0)
    contents = [(float(number),) for number in range(1000)]
    assert not any(memory.is_repeat(content, 1.0, may_stand_still=False) for content in contents)
    assert memory.is_repeat(contents[-1], 1.0, may_stand_still=False)
    assert memory.is_repeat(contents[-60], 1.0, may_stand_still=False)
    assert not memory.is_repeat(contents[0], 1.0, may_stand_still=False)


# --- noise and turns -------------------------------------------------------------------------------


def test_the_covariance_is_that_of_the_textbook() -> None:
    covariance = Covariance(30.0, 12.0)
    p = np.diag([30.0**2, 12.0**2])
    for dt_s, q, position_sigma_m, velocity_sigma_mps in [(1.0, 2.0, 15.0, 1.5), (0.4, 0.5, 8.0, 0.8)] * 3:
        covariance.predict(dt_s, q)
        f = np.array([[1.0, dt_s], [0.0, 1.0]])
        noise = q**2 * np.array([[dt_s**3 / 3, dt_s**2 / 2], [dt_s**2 / 2, dt_s]])
        p = f @ p @ f.T + noise
        for gains, h, sigma in (
            (covariance.update_position(position_sigma_m), np.array([1.0, 0.0]), position_sigma_m),
            (covariance.update_velocity(velocity_sigma_mps), np.array([0.0, 1.0]), velocity_sigma_mps),
        ):
            k = p @ h / (h @ p @ h + sigma**2)
            p = (np.eye(2) - np.outer(k, h)) @ p
            assert gains == pytest.approx(k, rel=1e-9)
        assert (covariance.pp, covariance.pv, covariance.vv) == pytest.approx(
            (p[0, 0], p[0, 1], p[1, 1]), rel=1e-9
        )


def noisy_run(velocity_sigma_mps: float, climb_sigma_mps: float) -> dict[str, float]:
    """RMS errors of the estimate and of the reports themselves, in straight flight."""
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


def test_noise_is_smoothed_and_velocities_become_better_than_reported() -> None:
    rms = noisy_run(velocity_sigma_mps=1.5, climb_sigma_mps=0.8)
    assert rms["velocity"] < 0.85 * rms["raw velocity"]
    assert rms["climb"] < 0.75 * rms["raw climb"]
    assert rms["position"] < 9.0  # of 21 reported
    assert rms["height"] < 4.0  # of 8 reported


def test_noisy_positions_hardly_touch_a_velocity_that_is_reported_exactly() -> None:
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


@pytest.mark.parametrize(("velocity_known", "bound_m"), [(True, 4.0), (False, 35.0)])
def test_a_turning_intruder_stays_near_its_track(velocity_known: bool, bound_m: float) -> None:
    """60 m/s, 3 deg/s, one report a second, at every tenth of a second."""
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


# --- who is tracked, and for how long --------------------------------------------------------------


def test_an_address_of_zero_is_refused_and_counted() -> None:
    tracker = Tracker()
    assert not tracker.receive(report_at(START_M, 0.0, icao=0), 0.0)
    assert tracker.dropped == {DropReason.NO_ADDRESS: 1}


def test_our_own_transponder_is_not_traffic() -> None:
    tracker = Tracker(TrafficParams(own_icao=frozenset({0xA})))
    assert not tracker.receive(report_at(START_M, 0.0, icao=0xA), 0.0)
    assert tracker.receive(report_at(START_M, 0.0, icao=0xB), 0.0)
    tracker.receive(replace(report_at(START_M, 0.0, icao=0xC), lat_deg=None), 0.0)
    assert tracker.without_position(0.0) == 1
    tracker.add_own_address(0xB)
    tracker.add_own_address(0xC)
    tracker.add_own_address(0)
    assert tracker.tracks(0.0, FRAME) == ()
    assert tracker.without_position(0.0) == 0
    assert not tracker.receive(report_at(START_M, 1.0, icao=0xB), 1.0)
    assert tracker.dropped[DropReason.OWN] == 2


@pytest.mark.parametrize(
    "bad",
    [
        {"lat_deg": 90.1},
        {"lon_deg": -180.5},
        {"lat_deg": math.nan},
        {"altitude_m": math.inf},
        {"ground_speed_mps": math.nan},
        {"time_s": math.nan},
    ],
)
def test_impossible_numbers_are_refused(bad: dict[str, float]) -> None:
    tracker = Tracker()
    report: TrafficReport = replace(report_at(START_M, 0.0, VELOCITY_MPS), **bad)  # type: ignore[arg-type]
    assert not tracker.receive(report, 0.0)
    assert tracker.dropped == {DropReason.BAD_NUMBER: 1}


def test_a_track_is_dropped_when_stale_and_starts_afresh() -> None:
    tracker = Tracker()
    tracker.receive(report_at(START_M, 0.0, VELOCITY_MPS), 0.0)
    assert only(tracker.tracks(20.0, FRAME)).age_s == 20.0
    there_m = (20_000.0, 0.0, -300.0)
    assert tracker.receive(report_at(there_m, 20.5, VELOCITY_MPS), 20.5)
    assert math.dist(only(tracker.tracks(20.5, FRAME)).position_m, there_m) < 1e-3
    assert tracker.tracks(41.0, FRAME) == ()


def test_a_surface_vehicle_is_a_track_of_its_own_kind() -> None:
    tracker = Tracker()
    tracker.receive(replace(report_at(START_M, 0.0), kind=TrafficKind.SURFACE_VEHICLE), 0.0)
    assert only(tracker.tracks(0.0, FRAME)).kind is TrafficKind.SURFACE_VEHICLE


def test_an_obstacle_never_moves_and_lasts_longer() -> None:
    tracker = Tracker()
    obstacle = replace(report_at(START_M, 0.0, VELOCITY_MPS), kind=TrafficKind.OBSTACLE)
    tracker.receive(obstacle, 0.0)
    track = only(tracker.tracks(299.0, FRAME))
    assert track.velocity_mps == (0.0, 0.0, 0.0)
    assert math.dist(track.position_m, START_M) < 1e-3
    assert tracker.receive(replace(obstacle, time_s=299.0), 299.0)
    assert len(tracker.tracks(590.0, FRAME)) == 1
    assert tracker.tracks(600.0, FRAME) == ()


def test_an_obstacle_that_takes_off_becomes_an_aircraft() -> None:
    tracker = Tracker()
    tracker.receive(replace(report_at(START_M, 0.0), kind=TrafficKind.OBSTACLE), 0.0)
    tracker.receive(report_at(START_M, 1.0, VELOCITY_MPS), 1.0)
    track = only(tracker.tracks(2.0, FRAME))
    assert track.kind is TrafficKind.AIRCRAFT
    assert math.dist(track.position_m, straight(START_M, VELOCITY_MPS, 1)) < 0.01


def test_when_full_the_longest_silence_gives_way() -> None:
    tracker = Tracker(TrafficParams(max_tracks=3))
    for second, icao in enumerate((1, 2, 3)):
        tracker.receive(report_at(START_M, second, VELOCITY_MPS, icao=icao), second)
    tracker.receive(report_at(straight(START_M, VELOCITY_MPS, 4), 4.0, VELOCITY_MPS, icao=1), 4.0)
    tracker.receive(report_at(START_M, 5.0, VELOCITY_MPS, icao=4), 5.0)
    assert [track.icao for track in tracker.tracks(5.0, FRAME)] == [1, 3, 4]
    assert tracker.evicted == 1
    for icao in range(10, 20):
        tracker.receive(replace(report_at(START_M, 5.0, icao=icao), lat_deg=None), 5.0)
    assert tracker.without_position(5.0) == 3


def test_tracks_come_in_order_of_their_id() -> None:
    tracker = Tracker()
    for icao in (0xFFFFFF, 0xA, 0x400000, 0x3FFFFF):
        tracker.receive(report_at(START_M, 0.0, icao=icao), 0.0)
    assert [t.track_id for t in tracker.tracks(0.0, FRAME)] == ["00000A", "3FFFFF", "400000", "FFFFFF"]
    tracker.receive(report_at(START_M, 0.0, icao=0x10), 0.0)
    assert [t.track_id for t in tracker.tracks(0.0, FRAME)][:2] == ["00000A", "000010"]


# --- clocks ----------------------------------------------------------------------------------------


def test_a_clock_set_back_neither_freezes_tracks_nor_lets_them_live_for_ever() -> None:
    tracker = Tracker()
    for second in range(4):
        now_s = 5000.0 + second
        tracker.receive(report_at(straight(START_M, VELOCITY_MPS, second), now_s, VELOCITY_MPS), now_s)
    assert only(tracker.tracks(1000.0, FRAME)).age_s == 0.0
    track = only(tracker.tracks(1001.0, FRAME))
    assert (track.age_s, track.time_s) == (1.0, 1001.0)
    assert math.dist(track.position_m, straight(START_M, VELOCITY_MPS, 4)) < 0.01
    assert tracker.receive(report_at(straight(START_M, VELOCITY_MPS, 5), 1002.0, VELOCITY_MPS), 1002.0)
    assert (
        math.dist(only(tracker.tracks(1003.0, FRAME)).position_m, straight(START_M, VELOCITY_MPS, 6)) < 0.01
    )
    assert tracker.tracks(1022.5, FRAME) == ()


def test_jitter_between_callers_is_not_a_clock_that_was_set() -> None:
    tracker = Tracker()
    for step in range(100):
        now_s = step * 0.1 - (0.05 if step % 2 else 0.0)
        tracker.tracks(now_s - 0.2, FRAME)
    tracker.receive(report_at(START_M, 10.0, VELOCITY_MPS), 10.0)
    assert only(tracker.tracks(9.8, FRAME)).age_s == 0.0
    assert only(tracker.tracks(11.0, FRAME)).age_s == pytest.approx(1.0)


def test_a_report_from_the_future_counts_as_from_now() -> None:
    tracker = Tracker()
    assert tracker.receive(report_at(START_M, 9999.0, VELOCITY_MPS), 1.0)
    assert tracker.receive(report_at(straight(START_M, VELOCITY_MPS, 1), 2.0, VELOCITY_MPS), 2.0)
    assert only(tracker.tracks(2.0, FRAME)).age_s == 0.0
    assert tracker.tracks(23.0, FRAME) == ()


def test_the_pole_is_survived() -> None:
    tracker = Tracker()
    report = replace(adsb(ICAO, 0.0, 90.0, 0.0, 300.0), course_rad=1.0, ground_speed_mps=100.0)
    for second in range(3):
        tracker.receive(replace(report, time_s=second, lon_deg=float(second)), second)
    track = only(tracker.tracks(3.0, LocalFrame(89.9, 0.0)))
    assert all(math.isfinite(number) for number in (*track.position_m, *track.velocity_mps))


def test_parameters_that_would_lose_hovering_traffic_are_refused() -> None:
    with pytest.raises(ValueError, match="repeat_window_s must be less than stale_s"):
        TrafficParams(repeat_window_s=30.0)


# --- real reports ------------------------------------------------------------------------------------

ADSB_VEHICLE = 246


@pytest.mark.parametrize(
    ("log", "repeats", "furthest_m"),
    [
        # ArduPlane re-sends, and sends up to a second late without saying so: 60 m at 60 m/s.
        ("arduplane_sitl_adsb_two_intruders.tlog", 49, 60.0),
        ("px4_sih_fixed_wing_adsb_two_intruders.tlog", 0, 2.0),
    ],
)
def test_intruders_of_a_recorded_flight_are_followed(log: str, repeats: int, furthest_m: float) -> None:
    if not (TLOGS / log).exists():
        pytest.skip(f"{log} is not beside this checkout")
    tracker = Tracker()
    frame, followed = None, 0
    for time_us, raw in read_tlog(TLOGS / log):
        message = decode(raw) if raw.message_id == ADSB_VEHICLE else None
        fact = None if message is None else to_fact(message, time_us / 1e6)
        if not isinstance(fact, Traffic):
            continue
        report, now_s = fact.report, time_us / 1e6
        assert report.lat_deg is not None
        assert report.lon_deg is not None
        assert report.altitude_m is not None
        assert report.ground_speed_mps is not None
        frame = frame or LocalFrame(report.lat_deg, report.lon_deg)
        before = {track.icao: track for track in tracker.tracks(now_s, frame)}.get(report.icao)
        if tracker.receive(report, now_s) and before is not None:
            followed += 1
            there_m = frame.to_ned_m(GeoPoint(report.lat_deg, report.lon_deg, report.altitude_m))
            assert math.dist(before.position_m, there_m) < furthest_m
            assert math.hypot(*before.velocity_mps[:2]) == pytest.approx(report.ground_speed_mps, abs=0.5)
    assert followed > 100
    assert tracker.dropped == ({DropReason.REPEATED: repeats} if repeats else {})
