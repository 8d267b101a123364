"""Reports to tracks: extrapolation, which reports become tracks, expiry and clocks."""

import math
from dataclasses import replace

import pytest

from companion.geodesy import GeoPoint, LocalFrame
from companion.mavlink.facts import Traffic
from companion.mavlink.framing import decode
from companion.mavlink.tlog import read_tlog
from companion.mavlink.translate import to_fact
from companion.model import (
    TrackState,
    TrafficKind,
    TrafficReport,
)
from companion.traffic import DropReason, Tracker, TrafficParams, Urgency
from companion.traffic.own_aircraft import OwnshipFix
from tests.support.paths import TLOGS
from tests.unit.traffic.straight_flight import (
    FRAME,
    ICAO,
    START_M,
    VELOCITY_MPS,
    adsb,
    only,
    report_at,
    straight,
)

# --- straight flight ------------------------------------------------------------------------------


def test_a_perfect_straight_flight_is_tracked_within_centimetres_also_between_reports() -> None:
    tracker = Tracker()
    for step in range(600):
        now_s = step / 10.0
        if step % 10 == 0:
            tracker.receive(report_at(straight(START_M, VELOCITY_MPS, now_s), now_s, VELOCITY_MPS), now_s)
        track = only(tracker.tracks(now_s, FRAME))
        # A straight line in the flat frame is curved on the globe, by 0.1 m at the end, 2.5 km away.
        assert math.dist(track.position_m, straight(START_M, VELOCITY_MPS, now_s)) < 0.12
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


def test_a_report_is_extrapolated_from_the_time_when_it_was_valid() -> None:
    tracker = Tracker()
    tracker.receive(report_at(START_M, 100.0, VELOCITY_MPS), 103.0)
    track = only(tracker.tracks(104.0, FRAME))
    assert math.dist(track.position_m, straight(START_M, VELOCITY_MPS, 4.0)) < 0.01
    assert track.age_s == pytest.approx(4.0)


def test_the_estimate_does_not_depend_on_the_local_frame() -> None:
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


# --- which reports become tracks, and for how long ------------------------------------------------


def test_an_aircraft_without_an_address_is_a_track_from_its_second_report_on() -> None:
    tracker = Tracker()
    assert tracker.receive(report_at(START_M, 0.0, VELOCITY_MPS, icao=0), 0.0) is None
    assert tracker.tracks(0.0, FRAME) == ()
    second = report_at(straight(START_M, VELOCITY_MPS, 1), 1.0, VELOCITY_MPS, icao=0)
    assert tracker.receive(second, 1.0) == "ANON-1"
    track = only(tracker.tracks(1.0, FRAME))
    assert (track.track_id, track.icao, track.state) == ("ANON-1", None, TrackState.CONFIRMED)
    assert not tracker.dropped


def test_our_own_transponder_is_not_traffic() -> None:
    tracker = Tracker(TrafficParams(own_icao=frozenset({0xA})))
    assert not tracker.receive(report_at(START_M, 0.0, icao=0xA), 0.0)
    assert tracker.receive(report_at(START_M, 0.0, icao=0xB), 0.0)
    tracker.receive(replace(report_at(START_M, 0.0, icao=0xC), lat_deg=None), 0.0)
    assert tracker.dropped[DropReason.NO_POSITION] == 1
    tracker.add_own_address(0xB)
    tracker.add_own_address(0xC)
    tracker.add_own_address(0)
    assert tracker.tracks(0.0, FRAME) == ()
    tracker.receive(replace(report_at(START_M, 0.0, icao=0xC), lat_deg=None), 0.0)
    assert tracker.dropped[DropReason.NO_POSITION] == 1, "it is ours by now"
    assert not tracker.receive(report_at((0.0, 0.0, -300.0), 1.0, icao=0xB), 1.0)
    assert tracker.dropped[DropReason.OWN] == 3


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


def test_a_stale_track_is_dropped_and_starts_again() -> None:
    tracker = Tracker()
    tracker.receive(report_at(START_M, 0.0, VELOCITY_MPS), 0.0)
    assert only(tracker.tracks(20.0, FRAME)).age_s == 20.0
    there_m = (20_000.0, 0.0, -300.0)
    assert tracker.receive(report_at(there_m, 20.5, VELOCITY_MPS), 20.5)
    assert math.dist(only(tracker.tracks(20.5, FRAME)).position_m, there_m) < 1e-3
    assert tracker.tracks(41.0, FRAME) == ()


def test_a_surface_vehicle_is_a_track_of_that_kind() -> None:
    tracker = Tracker()
    tracker.receive(replace(report_at(START_M, 0.0), kind=TrafficKind.SURFACE_VEHICLE), 0.0)
    assert only(tracker.tracks(0.0, FRAME)).kind is TrafficKind.SURFACE_VEHICLE


def test_an_obstacle_never_moves_and_is_kept_longer() -> None:
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


def test_when_there_are_too_many_the_longest_silence_is_dropped() -> None:
    tracker = Tracker(TrafficParams(max_tracks=3))
    for second, icao in enumerate((1, 2, 3)):
        tracker.receive(report_at(START_M, second, VELOCITY_MPS, icao=icao), second)
    tracker.receive(report_at(straight(START_M, VELOCITY_MPS, 4), 4.0, VELOCITY_MPS, icao=1), 4.0)
    tracker.receive(report_at(START_M, 5.0, VELOCITY_MPS, icao=4), 5.0)
    assert [track.icao for track in tracker.tracks(5.0, FRAME)] == [1, 3, 4]
    assert tracker.evicted == 1


def test_tracks_are_ordered_by_their_id() -> None:
    tracker = Tracker()
    for icao in (0xFFFFFF, 0xA, 0x400000, 0x3FFFFF):
        tracker.receive(report_at(START_M, 0.0, icao=icao), 0.0)
    assert [t.track_id for t in tracker.tracks(0.0, FRAME)] == ["00000A", "3FFFFF", "400000", "FFFFFF"]
    tracker.receive(report_at(START_M, 0.0, icao=0x10), 0.0)
    assert [t.track_id for t in tracker.tracks(0.0, FRAME)][:2] == ["00000A", "000010"]


# --- clocks ---------------------------------------------------------------------------------------


def test_tracks_age_normally_after_the_clock_is_set_back() -> None:
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


def test_jitter_between_callers_does_not_count_as_setting_the_clock() -> None:
    tracker = Tracker()
    for step in range(100):
        now_s = step * 0.1 - (0.05 if step % 2 else 0.0)
        tracker.tracks(now_s - 0.2, FRAME)
    tracker.receive(report_at(START_M, 10.0, VELOCITY_MPS), 10.0)
    assert only(tracker.tracks(9.8, FRAME)).age_s == 0.0
    assert only(tracker.tracks(11.0, FRAME)).age_s == pytest.approx(1.0)


def test_a_report_from_the_future_counts_as_present() -> None:
    tracker = Tracker()
    assert tracker.receive(report_at(START_M, 9999.0, VELOCITY_MPS), 1.0)
    assert tracker.receive(report_at(straight(START_M, VELOCITY_MPS, 1), 2.0, VELOCITY_MPS), 2.0)
    assert only(tracker.tracks(2.0, FRAME)).age_s == 0.0
    assert tracker.tracks(23.0, FRAME) == ()


def test_tracks_at_the_pole_are_finite() -> None:
    tracker = Tracker()
    report = replace(adsb(ICAO, 0.0, 90.0, 0.0, 300.0), course_rad=1.0, ground_speed_mps=100.0)
    for second in range(3):
        tracker.receive(replace(report, time_s=second, lon_deg=float(second)), second)
    track = only(tracker.tracks(3.0, LocalFrame(89.9, 0.0)))
    assert all(math.isfinite(number) for number in (*track.position_m, *track.velocity_mps))


def test_a_repeat_window_beyond_the_stale_time_is_refused() -> None:
    with pytest.raises(ValueError, match="repeat_window_s must be less than stale_s"):
        TrafficParams(repeat_window_s=30.0)


# --- recorded reports -----------------------------------------------------------------------------

ADSB_VEHICLE = 246


# Repeated reports, and how far a report is from the prediction at most [m].
FOLLOWED = {
    "arduplane_fake_two_intruders": (2, 60.0),
    "px4_fake_two_intruders": (0, 15.0),
    # ArduPlane re-sends, and sends up to a second late without stating it: 60 m at 60 m/s.
    "arduplane_sitl_adsb_two_intruders": (49, 60.0),
    "px4_sih_fixed_wing_adsb_two_intruders": (0, 2.0),
}


@pytest.mark.parametrize("name", [name for name in FOLLOWED if name in TLOGS])
def test_intruders_of_a_recorded_flight_are_followed(name: str) -> None:
    repeats, furthest_m = FOLLOWED[name]
    tracker = Tracker()
    frame, followed = None, 0
    for time_us, raw in read_tlog(TLOGS[name]):
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


# --- many -----------------------------------------------------------------------------------------


def crowd_at(tracker: Tracker, now_s: float) -> None:
    """300 aircraft on a line to the east, 500 m apart, that fly north with 50 m/s, once a second."""
    for number in range(300):
        there_m = 50.0 * now_s, 500.0 * number, -600.0
        tracker.receive(report_at(there_m, now_s, (50.0, 0.0, 0.0), icao=0x100000 + number), now_s)


def test_of_many_tracks_the_far_ones_are_made_again_once_a_second() -> None:
    tracker = Tracker()
    for step in range(31):
        now_s = step / 10.0
        place = FRAME.to_geo(0.0, 0.0, -600.0)
        tracker.observe_ownship(OwnshipFix(now_s, place.lat_deg, place.lon_deg, 600.0, 22.0, 0.0, 0.0))
        if step % 10 == 0:
            crowd_at(tracker, now_s)
        tracks = tracker.tracks(now_s, FRAME)
    assert len(tracks) == 300
    tracker.note_threats(["10012B"], 3.0)
    for now_s in (3.1, 3.9, 4.0, 4.1):
        tracks = tracker.tracks(now_s, FRAME)
        times_s = {track.track_id: track.time_s for track in tracks}
        assert times_s["100000"] == times_s["10012B"] == now_s, "near, and a threat"
        assert times_s["100100"] == pytest.approx(max(now_s - 1.0, 3.0) if now_s < 4.0 else 4.0)
        for track in tracks:
            assert track.position_m[0] == pytest.approx(50.0 * track.time_s, abs=1.0)
            assert track.time_s - track.age_s == pytest.approx(3.0)


def test_tracks_made_before_are_not_used_in_another_frame() -> None:
    tracker = Tracker()
    place = FRAME.to_geo(0.0, 0.0, -600.0)
    tracker.observe_ownship(OwnshipFix(0.0, place.lat_deg, place.lon_deg, 600.0, 22.0, 0.0, 0.0))
    crowd_at(tracker, 0.0)
    tracker.tracks(0.1, FRAME)
    moved = LocalFrame(FRAME.lat_deg + 0.05, FRAME.lon_deg)
    assert {track.time_s for track in tracker.tracks(0.2, moved)} == {0.2}


def test_threats_then_the_near_ones_are_urgent_and_who_is_heard_again_before_who_is_not() -> None:
    tracker = Tracker()
    place = FRAME.to_geo(0.0, 0.0, -600.0)
    tracker.observe_ownship(OwnshipFix(0.0, place.lat_deg, place.lon_deg, 600.0, 22.0, 0.0, 0.0))
    near, far = report_at((3000.0, 0.0, -600.0), 0.0), report_at((80_000.0, 0.0, -600.0), 0.0, icao=5)
    assert [tracker.urgency(one, 0.0) for one in (near, far)] == [Urgency.NEAR, Urgency.NEW]
    assert [tracker.urgency(one, 1.0) for one in (near, far)] == [Urgency.NEAR_AGAIN, Urgency.AGAIN]
    assert [tracker.urgency(one, 9.0) for one in (near, far)] == [Urgency.NEAR, Urgency.NEW]
    assert tracker.urgency(replace(far, altitude_m=math.nan), 9.1) is Urgency.NEW
    tracker.receive(far, 9.2)
    tracker.note_threats([far.key], 9.2)
    assert tracker.urgency(far, 9.3) is Urgency.THREAT
    high = report_at((500.0, 0.0, -9000.0), 20.0, icao=6)
    assert tracker.urgency(high, 20.0) is Urgency.NEW


@pytest.mark.parametrize(
    ("configured", "claimed", "icao"),
    [
        ((), (), None),
        ((0xA,), (), 0xA),
        ((0xA, 0xB), (), None),
        ((), (0xC,), 0xC),
        ((0xA,), (0xC,), 0xC),
        ((), (0,), None),
    ],
)
def test_the_own_address_is_that_of_the_transponder_or_the_only_configured_one(
    configured: tuple[int, ...], claimed: tuple[int, ...], icao: int | None
) -> None:
    tracker = Tracker(TrafficParams(own_icao=frozenset(configured)))
    for one in claimed:
        tracker.add_own_address(one)
    assert tracker.own_icao == icao
