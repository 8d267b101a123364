"""Reports of one aircraft: missing values, repetitions, order and outliers."""

import math
from dataclasses import replace

import pytest

from companion.model import (
    AltitudeReference,
    Vec3,
)
from companion.traffic import DropReason, Tracker, TrafficParams
from companion.traffic.altitudes import AS_REPORTED, DatumOffset
from companion.traffic.measurement import RepeatFilter
from tests.unit.traffic.straight_flight import (
    FRAME,
    START_M,
    VELOCITY_MPS,
    follow,
    only,
    report_at,
    straight,
)

# --- missing values -------------------------------------------------------------------------------


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


def test_a_speed_without_a_course_is_ignored_unless_it_is_zero() -> None:
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
def test_an_impossible_speed_or_climb_counts_as_unknown(speed_mps: float, climb_mps: float) -> None:
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


def test_an_altitude_is_extrapolated_for_a_limited_time() -> None:
    tracker = Tracker(TrafficParams(altitude_hold_s=10.0))
    tracker.receive(report_at(START_M, 0.0, VELOCITY_MPS), 0.0)
    for second in range(1, 13):
        report = report_at(straight(START_M, VELOCITY_MPS, second), second, VELOCITY_MPS)
        assert tracker.receive(replace(report, altitude_m=None), second)
        shown = tracker.tracks(second, FRAME)
        assert len(shown) == (second <= 10)
        if shown:
            assert math.dist(shown[0].position_m, straight(START_M, VELOCITY_MPS, second)) < 0.01
    assert tracker.dropped[DropReason.NO_ALTITUDE] == 2
    tracker.receive(report_at(straight(START_M, VELOCITY_MPS, 13), 13.0, VELOCITY_MPS), 13.0)
    assert math.dist(only(tracker.tracks(13.0, FRAME)).position_m, straight(START_M, VELOCITY_MPS, 13)) < 0.01


def test_a_report_without_position_is_counted_and_does_not_refresh_a_track() -> None:
    tracker = Tracker()
    tracker.receive(report_at(START_M, 0.0, VELOCITY_MPS), 0.0)
    unplaced = replace(report_at(START_M, 15.0, VELOCITY_MPS), lat_deg=None, lon_deg=None)
    assert not tracker.receive(unplaced, 15.0)
    assert only(tracker.tracks(15.0, FRAME)).age_s == 15.0
    assert not tracker.receive(replace(unplaced, icao=0x777, key="000777"), 15.0)
    assert tracker.dropped[DropReason.NO_POSITION] == 2


def test_altitudes_of_two_references_are_kept_apart_and_the_more_certain_one_is_used() -> None:
    tracker = Tracker(TrafficParams(altitude_hold_s=10.0))
    for second in range(10):
        report = report_at((48.0 * second, 0.0, -300.0), second)
        other = replace(
            report, time_s=second + 0.5, altitude_m=150.0, altitude_reference=AltitudeReference.BAROMETRIC
        )
        tracker.receive(report, second)
        tracker.receive(other, second + 0.5)
    uncertain = {**AS_REPORTED, AltitudeReference.BAROMETRIC: DatumOffset(0.0, 60.0)}
    tracker.offsets_at = lambda _: uncertain
    track = only(tracker.tracks(9.5, FRAME))
    assert (track.position_m[2], track.velocity_mps[2], track.vertical_uncertainty_m) == (-300.0, 0.0, 0.0)
    uncertain_satellites = {**AS_REPORTED, AltitudeReference.GEOMETRIC: DatumOffset(0.0, 50.0)}
    tracker.offsets_at = lambda _: uncertain_satellites
    track = only(tracker.tracks(9.5, FRAME))
    assert (track.position_m[2], track.velocity_mps[2], track.vertical_uncertainty_m) == (-150.0, 0.0, 0.0)
    assert not tracker.dropped


# --- repeats and order ----------------------------------------------------------------------------


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


def test_a_report_that_arrives_late_by_a_second_link_is_a_repeat() -> None:
    tracker = Tracker()
    reports = [report_at(straight(START_M, VELOCITY_MPS, s), s, VELOCITY_MPS) for s in range(4)]
    for second, report in enumerate(reports):
        assert tracker.receive(report, second)
        if second >= 2:
            assert not tracker.receive(replace(reports[second - 2], time_s=second + 0.3), second + 0.3)
    assert tracker.dropped == {DropReason.REPEATED: 2}
    assert math.dist(only(tracker.tracks(4.0, FRAME)).position_m, straight(START_M, VELOCITY_MPS, 4)) < 0.01


@pytest.mark.parametrize("speed_mps", [0.0, 1.5, None])
def test_a_hovering_helicopter_remains_a_track(speed_mps: float | None) -> None:
    tracker = Tracker()
    hovering = replace(report_at(START_M, 0.0), ground_speed_mps=speed_mps, course_rad=0.0, climb_mps=0.0)
    accepted = [second for second in range(60) if tracker.receive(replace(hovering, time_s=second), second)]
    assert accepted == [0, 8, 16, 24, 32, 40, 48, 56]
    track = only(tracker.tracks(59.0, FRAME))
    assert track.age_s == 3.0
    # Extrapolated for up to 7 s with the reported 1.5 m/s, corrected by each report.
    assert math.dist(track.position_m, START_M) < 20.0


def test_identical_reports_with_a_speed_do_not_renew_a_track() -> None:
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


# --- outliers -------------------------------------------------------------------------------------


@pytest.mark.parametrize("off_m", [(500.0, 0.0, 0.0), (0.0, -20_000.0, 0.0)])
def test_a_single_outlier_is_rejected(off_m: Vec3) -> None:
    tracker = Tracker()
    follow(tracker, 5)
    wrong = straight(straight(START_M, VELOCITY_MPS, 6), off_m, 1)
    assert not tracker.receive(report_at(wrong, 6.0, VELOCITY_MPS), 6.0)
    assert only(tracker.tracks(6.0, FRAME)).age_s == 1.0
    assert tracker.receive(report_at(straight(START_M, VELOCITY_MPS, 7), 7.0, VELOCITY_MPS), 7.0)
    track = only(tracker.tracks(7.0, FRAME))
    assert math.dist(track.position_m, straight(START_M, VELOCITY_MPS, 7)) < 0.01
    assert tracker.dropped == {DropReason.JUMPED: 1}


def test_a_jump_that_persists_is_a_second_track_which_replaces_the_first() -> None:
    tracker = Tracker()
    follow(tracker, 5)
    there_m = (9000.0, 0.0, -900.0)
    assert not tracker.receive(report_at(there_m, 6.0, VELOCITY_MPS), 6.0)
    for second in range(7, 12):
        report = report_at(straight(there_m, VELOCITY_MPS, second - 6), second, VELOCITY_MPS)
        assert tracker.receive(report, second) == "4B1234/2"
        ids = [track.track_id for track in tracker.tracks(second, FRAME)]
        assert ids == (["4B1234", "4B1234/2"] if second < 10 else ["4B1234/2"])
    track = only(tracker.tracks(11.0, FRAME))
    assert math.dist(track.position_m[:2], straight(there_m, VELOCITY_MPS, 5)[:2]) < 0.2
    assert math.dist(track.velocity_mps, VELOCITY_MPS) < 0.05


def test_after_a_burst_of_reports_that_waited_it_is_one_track_again() -> None:
    """As seen on a real link: sixteen reports of as many seconds arrive at once, each as of now.

    The autopilot sends each of them again, without the climb. The aircraft is a threat, and coasted as such.
    """
    tracker = Tracker()
    for without_climb in (False, True):
        for second in range(16):
            report = report_at(straight(START_M, VELOCITY_MPS, second), 16.0, VELOCITY_MPS)
            tracker.receive(replace(report, climb_mps=None) if without_climb else report, 16.0)
    for second in range(17, 32):
        tracker.note_threats([track.track_id for track in tracker.tracks(second, FRAME)], second)
        report = report_at(straight(START_M, VELOCITY_MPS, second), second, VELOCITY_MPS)
        tracker.receive(report, second)
        tracker.receive(replace(report, climb_mps=None), second)
    track = only(tracker.tracks(31.0, FRAME))
    assert math.dist(track.position_m, straight(START_M, VELOCITY_MPS, 31)) < 20.0
    assert math.dist(track.velocity_mps, VELOCITY_MPS) < 2.0


def test_two_outliers_at_different_places_do_not_confirm_each_other() -> None:
    tracker = Tracker()
    follow(tracker, 5)
    assert not tracker.receive(report_at((9000.0, 0.0, -300.0), 6.0, VELOCITY_MPS), 6.0)
    assert not tracker.receive(report_at((-9000.0, 0.0, -300.0), 7.0, VELOCITY_MPS), 7.0)
    assert math.dist(only(tracker.tracks(7.0, FRAME)).position_m, straight(START_M, VELOCITY_MPS, 7)) < 0.01


def test_a_wrong_position_that_returns_later_does_not_disturb_the_track() -> None:
    tracker = Tracker()
    wrong_m = (9000.0, 0.0, -300.0)
    for second in range(12):
        reported_m = straight(wrong_m, VELOCITY_MPS, second) if second in (6, 8) else None
        reported_m = reported_m or straight(START_M, VELOCITY_MPS, second)
        tracker.receive(report_at(reported_m, second, VELOCITY_MPS), second)
        truth_m = straight(START_M, VELOCITY_MPS, second)
        first, *others = tracker.tracks(second, FRAME)
        assert math.dist(first.position_m, truth_m) < 0.05
        assert len(others) == (second >= 8), "two reports that agree are an aircraft"
    assert tracker.dropped == {DropReason.JUMPED: 1}


def test_a_time_error_of_a_second_is_not_a_jump_even_for_a_jet() -> None:
    tracker = Tracker()
    jet_mps = (200.0, 0.0, 0.0)
    for second in range(6):
        tracker.receive(report_at(straight((-3000.0, 0.0, -900.0), jet_mps, second), second, jet_mps), second)
    late_m = straight((-3000.0, 0.0, -900.0), jet_mps, 5.05)
    assert tracker.receive(report_at(late_m, 6.0, jet_mps), 6.0)


def test_first_positions_further_apart_than_any_aircraft_flies_are_rejected() -> None:
    tracker = Tracker()
    tracker.receive(report_at((0.0, 0.0, -300.0), 0.0), 0.0)
    assert not tracker.receive(report_at((900.0, 0.0, -300.0), 2.0 - 0.05), 1.95)
    tracker = Tracker()
    tracker.receive(report_at((0.0, 0.0, -300.0), 0.0), 0.0)
    assert tracker.receive(report_at((800.0, 0.0, -300.0), 2.0), 2.0)


def test_a_single_impossible_velocity_is_not_used() -> None:
    tracker = Tracker()
    follow(tracker, 5)
    backwards = (-VELOCITY_MPS[0], -VELOCITY_MPS[1], VELOCITY_MPS[2])
    assert tracker.receive(report_at(straight(START_M, VELOCITY_MPS, 6), 6.0, backwards), 6.0)
    assert tracker.dropped == {DropReason.VELOCITY_WRONG: 1}
    assert math.dist(only(tracker.tracks(6.0, FRAME)).velocity_mps, VELOCITY_MPS) < 0.01


def test_an_altitude_that_is_an_outlier_is_not_used_and_the_rest_is_when_it_is_the_climb() -> None:
    tracker = Tracker()
    follow(tracker, 5)
    report = report_at(straight(START_M, VELOCITY_MPS, 6), 6.0, VELOCITY_MPS)
    assert not tracker.receive(replace(report, altitude_m=5000.0), 6.0)
    report = report_at(straight(START_M, VELOCITY_MPS, 7), 7.0, VELOCITY_MPS)
    assert tracker.receive(replace(report, climb_mps=-50.0), 7.0)
    assert math.dist(only(tracker.tracks(7.0, FRAME)).position_m, straight(START_M, VELOCITY_MPS, 7)) < 0.01
    assert tracker.dropped == {DropReason.ALTITUDE_JUMPED: 1, DropReason.CLIMB_WRONG: 1}


def test_a_new_altitude_that_persists_is_accepted_after_a_few_seconds() -> None:
    tracker = Tracker()
    follow(tracker, 5)
    for second in range(6, 12):
        report = report_at(straight(START_M, VELOCITY_MPS, second), second, VELOCITY_MPS)
        tracker.receive(replace(report, altitude_m=1000.0 + 2.5 * second), second)
        heights_m = [-track.position_m[2] for track in tracker.tracks(second, FRAME)]
        assert (1000.0 + 2.5 * second in heights_m) == (second >= 7)
    assert heights_m == [pytest.approx(1027.5, abs=0.01)]


def test_the_number_of_remembered_reports_is_limited() -> None:
    memory = RepeatFilter(window_s=7.0)
    contents = [(float(number),) for number in range(1000)]
    assert not any(memory.is_repeat(content, 1.0, may_stand_still=False) for content in contents)
    assert memory.is_repeat(contents[-1], 1.0, may_stand_still=False)
    assert memory.is_repeat(contents[-60], 1.0, may_stand_still=False)
    assert not memory.is_repeat(contents[0], 1.0, may_stand_still=False)
