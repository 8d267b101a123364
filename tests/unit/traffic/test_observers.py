"""Several receivers of one aircraft: late and prompt ones, their accuracy, and where they are themselves."""

import math
from dataclasses import replace

import pytest

from companion.geodesy import LocalFrame
from companion.mavlink.facts import RECEIVER, OwnPosition, PressureAltitude, ReceiverOwnship, Sender
from companion.model import (
    AltitudeReference,
    TrackState,
    TrafficKind,
    TrafficReport,
    TrafficSource,
    Vec3,
)
from companion.traffic import ConcernKind, DropReason, Tracker, TrafficParams, TrafficPicture
from companion.traffic.altitudes import AS_REPORTED, DatumOffset
from tests.unit.traffic.straight_flight import (
    FRAME,
    HOME_M,
    START_M,
    VELOCITY_MPS,
    concerns,
    only,
    own_at,
    report_at,
    straight,
)

AUTOPILOT = Sender(1, 1)


# --- several receivers, accuracy, relative positions


def test_a_late_receiver_does_not_disturb_the_track_of_a_prompt_one() -> None:
    tracker, errors_m = Tracker(), []
    velocity_mps = (60.0, 0.0, 0.0)
    for second in range(40):
        prompt = report_at(straight(START_M, velocity_mps, second), second, velocity_mps)
        tracker.receive(replace(prompt, heard_by="prompt"), second)
        if second >= 10:
            late_m = straight(START_M, velocity_mps, second + 0.5 - 4.0)
            late = report_at(late_m, second + 0.5, velocity_mps)
            tracker.receive(replace(late, heard_by="late"), second + 0.5)
        if second >= 15:
            truth_m = straight(START_M, velocity_mps, second + 0.6)
            errors_m.append(math.dist(only(tracker.tracks(second + 0.6, FRAME)).position_m, truth_m))
    assert max(errors_m) < 10.0
    assert only(tracker.tracks(40.0, FRAME)).sources == ("late", "prompt")


def test_a_prompt_receiver_replaces_a_late_one() -> None:
    tracker = Tracker()
    velocity_mps = (60.0, 0.0, 0.0)
    for second in range(40):
        late = report_at(straight(START_M, velocity_mps, second - 1.5), second, velocity_mps)
        tracker.receive(replace(late, heard_by="late"), second)
        if second >= 15:
            prompt = report_at(straight(START_M, velocity_mps, second + 0.5), second + 0.5, velocity_mps)
            tracker.receive(replace(prompt, heard_by="prompt"), second + 0.5)
    truth_m = straight(START_M, velocity_mps, 40.0)
    assert math.dist(only(tracker.tracks(40.0, FRAME)).position_m, truth_m) < 25.0


def test_the_track_is_on_time_seconds_after_a_prompt_receiver_joins() -> None:
    tracker = Tracker()
    velocity_mps = (60.0, 0.0, 0.0)
    for second in range(25):
        # Not the same messages: those would be repetitions.
        late = report_at(straight(START_M, velocity_mps, second - 1.3), second, velocity_mps)
        tracker.receive(replace(late, heard_by="late"), second)
        if second >= 15:
            prompt = report_at(straight(START_M, velocity_mps, second + 0.5), second + 0.5, velocity_mps)
            tracker.receive(replace(prompt, heard_by="prompt"), second + 0.5)
        if second >= 20:
            truth_m = straight(START_M, velocity_mps, second + 0.6)
            assert math.dist(only(tracker.tracks(second + 0.6, FRAME)).position_m, truth_m) < 15.0


def test_an_old_report_of_another_receiver_is_of_use() -> None:
    """The newest reports state no velocity; those of 1.5 s before do."""
    tracker, velocity_mps = Tracker(), (60.0, 0.0, 0.0)
    for second in range(20):
        newest = report_at(straight(START_M, velocity_mps, second), second)
        tracker.receive(replace(newest, heard_by="newest"), second)
        old = report_at(straight(START_M, velocity_mps, second - 1.5), second - 1.5, velocity_mps)
        tracker.receive(replace(old, heard_by="old"), second + 0.1)
    assert tracker.dropped[DropReason.REORDERED] <= 1
    assert only(tracker.tracks(20.0, FRAME)).velocity_mps[0] == pytest.approx(60.0, abs=0.5)


def test_a_report_that_is_much_older_than_the_track_is_not_used() -> None:
    tracker, velocity_mps = Tracker(), (60.0, 0.0, 0.0)
    for second in range(10):
        newest = report_at(straight(START_M, velocity_mps, second), second, velocity_mps)
        tracker.receive(replace(newest, heard_by="newest"), second)
    old = report_at(straight(START_M, velocity_mps, 5.5), 5.5, velocity_mps)
    assert tracker.receive(replace(old, heard_by="old"), 9.1) is None
    assert tracker.dropped[DropReason.REORDERED] == 1


def test_receivers_with_different_references_of_altitude_contradict_no_climb() -> None:
    tracker = Tracker()
    velocity_mps = (60.0, 0.0, -3.0)
    for step in range(80):
        time_s = step / 2.0
        report = report_at(straight(START_M, velocity_mps, time_s), time_s, velocity_mps)
        if step % 2:
            barometric = AltitudeReference.BAROMETRIC
            report = replace(report, altitude_m=report.altitude_m - 60.0, altitude_reference=barometric)
        tracker.receive(replace(report, heard_by=f"receiver {step % 2}"), time_s)
    assert tracker.dropped[DropReason.CLIMB_WRONG] == 0


def test_two_mavlink_senders_of_the_same_traffic_are_two_observers() -> None:
    picture, errors_m = TrafficPicture(TrafficParams()), []
    velocity_mps = (60.0, 0.0, 0.0)
    for second in range(40):
        prompt = report_at(straight(START_M, velocity_mps, second), second, velocity_mps)
        picture.tracker.receive(prompt, second, Sender(1, 156))
        if second >= 10:
            late = report_at(straight(START_M, velocity_mps, second - 3.5), second + 0.5, velocity_mps)
            picture.tracker.receive(late, second + 0.5, Sender(7, 1))
        if second >= 15:
            truth_m = straight(START_M, velocity_mps, second + 0.6)
            errors_m.append(math.dist(only(picture.tracker.tracks(second + 0.6, FRAME)).position_m, truth_m))
    assert max(errors_m) < 10.0
    assert only(picture.tracker.tracks(40.0, FRAME)).sources == ("ADS-B 1/156", "ADS-B 7/1")


def test_two_mavlink_senders_without_addresses_report_one_aircraft() -> None:
    picture = TrafficPicture(TrafficParams())
    for second in range(10):
        anonymous = replace(report_at(straight(START_M, VELOCITY_MPS, second), second, VELOCITY_MPS), icao=0)
        picture.tracker.receive(anonymous, second, Sender(1, 156))
        picture.tracker.receive(replace(anonymous, climb_mps=0.1), second + 0.01, Sender(7, 1))
    only(picture.tracker.tracks(10.0, FRAME))


@pytest.mark.parametrize(
    ("other_m", "kind"),
    [
        ((3000.0, 0.0, -600.0), ConcernKind.TWO_PLACES),
        ((2150.0, 180.0, -600.0), ConcernKind.TWO_PLACES),
        ((2000.0, 0.0, -900.0), ConcernKind.TWO_HEIGHTS),
        ((3000.0, 0.0, -900.0), ConcernKind.TWO_PLACES),
    ],
)
def test_two_places_and_two_heights_are_told_apart(other_m: Vec3, kind: ConcernKind) -> None:
    tracker = Tracker()
    for step in range(40):
        now_s = step / 2.0
        own_at(tracker, now_s, 22.0 * now_s)
        here_m = other_m if step % 2 else (2000.0, 0.0, -600.0)
        there = report_at((here_m[0] + 20.0 * now_s, here_m[1], here_m[2]), now_s, (20.0, 0.0, 0.0))
        tracker.receive(there, now_s)
    assert concerns(tracker, 20.0) == [kind]


def test_three_aircraft_with_one_address_are_three_tracks() -> None:
    tracker = Tracker()
    starts_m = (START_M, (-9000.0, 2000.0, -884.0), (4000.0, -8000.0, -900.0))
    for second in range(10):
        for number, start_m in enumerate(starts_m):
            time_s = second + 0.3 * number
            tracker.receive(report_at(straight(start_m, VELOCITY_MPS, time_s), time_s, VELOCITY_MPS), time_s)
    tracks = tracker.tracks(10.0, FRAME)
    assert [track.track_id for track in tracks] == ["4B1234", "4B1234/2", "4B1234/3"]
    assert all(track.state is TrackState.CONFIRMED for track in tracks)


@pytest.mark.parametrize("kind", [TrafficKind.AIRCRAFT, TrafficKind.SURFACE_VEHICLE, TrafficKind.OBSTACLE])
def test_reports_of_the_same_place_that_state_no_speed_hide_no_flying_aircraft(kind: TrafficKind) -> None:
    tracker = Tracker()
    for step in range(100):
        now_s = step / 5.0
        own_at(tracker, now_s, 22.0 * now_s)
        there = report_at((8000.0 - 60.0 * now_s, 0.0, -600.0), now_s, (-60.0, 0.0, 0.0))
        still = replace(there, ground_speed_mps=0.0, course_rad=None, kind=kind)
        tracker.receive(there if step % 5 == 0 else still, now_s)
    tracks = tracker.tracks(20.0, FRAME)
    assert any(abs(track.velocity_mps[0] + 60.0) < 6.0 for track in tracks)
    assert all(track.kind is TrafficKind.AIRCRAFT for track in tracks)


def test_a_report_of_ours_that_is_judged_again_does_not_count_twice() -> None:
    tracker = Tracker(TrafficParams(own_uas_id="07"))
    own_at(tracker, 0.0)
    wrong = replace(report_at((0.0, 0.0, 0.0), 0.0), source=TrafficSource.UTM, key="UTM-07", icao=None)
    tracker.receive(wrong, 0.0)
    own_at(tracker, 3.0)
    assert tracker.tracks(3.0, FRAME) == ()


def test_an_aircraft_that_was_reported_once_is_not_coasted_for_minutes() -> None:
    tracker = Tracker()
    own_at(tracker, 0.0)
    tracker.receive(report_at((5000.0, 0.0, -600.0), 0.0, (-40.0, 0.0, 0.0)), 0.0)
    tracker.note_threats(["4B1234"], 0.0)
    assert len(tracker.tracks(19.0, FRAME)) == 1
    assert tracker.tracks(21.0, FRAME) == ()
    assert concerns(tracker, 21.0) == [ConcernKind.LOST]


@pytest.mark.parametrize("sources", [1, 2])
def test_a_coasted_track_keeps_its_last_sources(sources: int) -> None:
    tracker = Tracker()
    own_at(tracker, 0.0)
    for second in range(20):
        own_at(tracker, second, 22.0 * second)
        for number in range(sources):
            time_s = second + 0.3 * number
            there = report_at((6000.0 - 60.0 * time_s, 0.0, -600.0), time_s, (-60.0, 0.0, 0.0))
            tracker.receive(replace(there, heard_by=f"{number}"), time_s)
    names = tuple(str(number) for number in range(sources))
    for now_s in (20.0, 35.0, 45.0):
        own_at(tracker, now_s, 22.0 * now_s)
        assert only(tracker.tracks(now_s, FRAME)).sources == names


@pytest.mark.parametrize(
    ("fields", "sigma_m"),
    [
        ({}, 30.0),
        ({"position_sigma_m": 12.0}, 12.0),
        ({"containment_m": 371.7, "sil": 1}, 100.0),
        ({"containment_m": 567.8, "sil": 3}, 100.0),
        ({"containment_m": 100.0}, 30.0),
        ({"source": TrafficSource.MLAT}, 100.0),
        ({"source": TrafficSource.SYSTEM}, 5.0),
    ],
)
def test_the_accuracy_of_a_position_follows_from_what_was_reported(
    fields: dict[str, object], sigma_m: float
) -> None:
    tracker = Tracker()
    report: TrafficReport = replace(report_at(START_M, 0.0, VELOCITY_MPS), **fields)  # type: ignore[arg-type]
    tracker.receive(report, 0.0)
    assert only(tracker.tracks(0.0, FRAME)).position_sigma_m == pytest.approx(sigma_m)


def test_a_second_altitude_of_a_report_is_used_in_its_own_reference() -> None:
    tracker = Tracker()
    barometric = replace(
        report_at(START_M, 0.0, VELOCITY_MPS),
        altitude_m=300.0,
        altitude_reference=AltitudeReference.BAROMETRIC,
        geometric_altitude_m=420.0,
    )
    tracker.receive(barometric, 0.0)
    for uncertain, altitude_m in (
        (AltitudeReference.BAROMETRIC, 420.0),
        (AltitudeReference.GEOMETRIC, 300.0),
    ):
        offsets = {**AS_REPORTED, uncertain: DatumOffset(0.0, 60.0)}
        tracker.offsets_at = lambda _, offsets=offsets: offsets  # type: ignore[misc]
        assert only(tracker.tracks(0.0, FRAME)).position_m[2] == -altitude_m


def test_a_position_relative_to_us_is_placed_where_we_were_then() -> None:
    tracker = Tracker()
    relative = TrafficReport(
        TrafficSource.FLARM, "FLARM-1", 5.0, relative_m=(1000.0, -200.0, 50.0), course_rad=0.0,
        ground_speed_mps=0.0,
    )  # fmt: skip
    assert tracker.receive(relative, 5.0) is None
    assert tracker.dropped == {DropReason.NO_POSITION: 1}
    for tick in range(100):
        own_at(tracker, tick / 10.0, 22.0 * tick / 10.0)
    assert tracker.receive(relative, 9.9) == "FLARM-1"
    expected_m: Vec3 = (22.0 * 5.0 + 1000.0, -200.0, -HOME_M - 150.0)
    assert math.dist(only(tracker.tracks(9.9, FRAME)).position_m, expected_m) < 1.0


def test_an_alarm_of_a_receiver_makes_a_track_at_once() -> None:
    tracker = Tracker()
    anonymous = replace(report_at(START_M, 0.0, VELOCITY_MPS), key="", icao=None, alarm=2)
    assert tracker.receive(anonymous, 0.0) == "ANON-1"
    assert only(tracker.tracks(0.0, FRAME)).alarm == 2


# --- a receiver's own position


def fly_own(picture: TrafficPicture, until_s: int) -> None:
    for second in range(until_s):
        lat_deg = 47.0 + 22.0 * second / 111_170.0
        fact = OwnPosition(AUTOPILOT, second, lat_deg, 8.0, 600.0, 100.0, (22.0, 0.0, 0.0), 0.0)
        picture.observe_ownship(fact, second)


@pytest.mark.parametrize(("off_m", "is_ours"), [(30.0, True), (2000.0, False)])
def test_a_receivers_own_position_is_evidence_only_where_we_are(off_m: float, is_ours: bool) -> None:
    picture = TrafficPicture(TrafficParams())
    fly_own(picture, 10)
    place = LocalFrame(47.0 + 22.0 * 9.0 / 111_170.0, 8.0).to_geo(0.0, off_m, 0.0)
    report = TrafficReport(
        TrafficSource.ADSB, "ABCDEF", 9.0, place.lat_deg, place.lon_deg, 540.0,
        AltitudeReference.BAROMETRIC, icao=0xABCDEF,
    )  # fmt: skip
    picture.observe_receiver(ReceiverOwnship(RECEIVER, report), 9.0)
    traffic = replace(report, time_s=9.0, lat_deg=47.02, altitude_m=640.0)
    shown = picture.tracker.receive(traffic, 9.0, RECEIVER)
    assert (shown is None) is is_ours
    # Its pressure altitude is ours, while our autopilot sends none: 600 m are 540 m there.
    other = replace(traffic, key="4B1234", icao=0x4B1234)
    picture.tracker.receive(other, 9.0, RECEIVER)
    track = next(one for one in picture.tracker.tracks(9.0, FRAME) if one.icao == 0x4B1234)
    assert (-track.position_m[2], track.vertical_uncertainty_m) == (
        (700.0, 0.0) if is_ours else (640.0, 60.0)
    )


def test_the_autopilots_pressure_takes_precedence_over_a_receivers() -> None:
    picture = TrafficPicture(TrafficParams())
    fly_own(picture, 10)
    picture.observe_ownship(PressureAltitude(AUTOPILOT, 590.0), 9.0)
    report = TrafficReport(
        TrafficSource.ADSB, "", 9.0, 47.0 + 22.0 * 9.0 / 111_170.0, 8.0, 540.0, AltitudeReference.BAROMETRIC
    )
    picture.observe_receiver(ReceiverOwnship(RECEIVER, report), 9.0)
    other = replace(report, key="4B1234", icao=0x4B1234, lat_deg=47.02, altitude_m=640.0)
    picture.tracker.receive(other, 9.0, RECEIVER)
    assert only(picture.tracker.tracks(9.0, FRAME)).position_m[2] == -650.0
