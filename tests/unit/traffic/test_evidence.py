"""What a track is, by place and motion first: kinds, states, accuracy, receivers, concerns, eviction."""

import math
import random
from dataclasses import replace

import pytest

from companion.model import (
    AltitudeReference,
    Track,
    TrackState,
    TrafficKind,
    TrafficReport,
    TrafficSource,
)
from companion.traffic import ConcernKind, DropReason, Tracker, TrafficParams
from companion.traffic.altitudes import AS_REPORTED, DatumOffset
from companion.traffic.evidence import Surroundings
from tests.unit.traffic.straight_flight import (
    FRAME,
    HOME_M,
    START_M,
    VELOCITY_MPS,
    concerns,
    follow,
    only,
    own_at,
    report_at,
    straight,
)

# --- states and coasting


def test_a_track_is_tentative_then_confirmed_then_coasted() -> None:
    tracker = Tracker()
    follow(tracker, 0)
    assert only(tracker.tracks(0.0, FRAME)).state is TrackState.TENTATIVE
    tracker.receive(report_at(straight(START_M, VELOCITY_MPS, 1), 1.0, VELOCITY_MPS), 1.0)
    assert only(tracker.tracks(1.0, FRAME)).state is TrackState.CONFIRMED
    assert only(tracker.tracks(9.0, FRAME)).state is TrackState.COASTED


def test_a_threat_is_kept_beyond_the_usual_time_and_its_uncertainty_grows() -> None:
    tracker = Tracker()
    own_at(tracker, 0.0)
    follow(tracker, 5)
    tracker.note_threats(["4B1234"], 5.0)
    sigmas_m = []
    for second in (5, 30, 60, 120):
        track = only(tracker.tracks(second, FRAME))
        tracker.note_threats(["4B1234"], second)
        assert math.dist(track.position_m[:2], straight(START_M, VELOCITY_MPS, second)[:2]) < 1.0
        assert track.position_sigma_m is not None
        sigmas_m.append(track.position_sigma_m)
    assert sigmas_m == sorted(sigmas_m)
    assert sigmas_m[-1] > 10.0 * sigmas_m[0]
    assert tracker.unheard(120.0) == ("4B1234", 115.0)
    assert concerns(tracker, 120.0) == [ConcernKind.NOT_HEARD]
    assert tracker.tracks(126.0, FRAME) == ()
    assert concerns(tracker, 126.0) == [ConcernKind.LOST]


def test_reports_that_resume_join_the_coasted_track() -> None:
    tracker = Tracker()
    own_at(tracker, 0.0)
    follow(tracker, 5)
    tracker.note_threats(["4B1234"], 5.0)
    for second in range(45, 50):
        tracker.tracks(second, FRAME)
        position_m = straight(START_M, VELOCITY_MPS, second)
        assert tracker.receive(report_at(position_m, second, VELOCITY_MPS), second) == "4B1234"
    assert only(tracker.tracks(49.0, FRAME)).state is TrackState.CONFIRMED


def test_an_aircraft_that_will_meet_us_is_coasted_though_it_is_no_threat_yet() -> None:
    kept = []
    for offset_m in (0.0, 6000.0):
        tracker = Tracker()
        for second in range(6):
            own_at(tracker, second, 22.0 * second)
            head_on_m = 8000.0 - 60.0 * second, offset_m, -HOME_M - 100.0
            tracker.receive(report_at(head_on_m, second, (-60.0, 0.0, 0.0)), second)
        for second in range(6, 60):
            own_at(tracker, second, 22.0 * second)
            tracks = tracker.tracks(second, FRAME)
        kept.append(len(tracks))
    assert kept == [1, 0]


def test_a_threat_keeps_its_altitude_while_only_positions_are_heard() -> None:
    tracker = Tracker()
    own_at(tracker, 0.0)
    follow(tracker, 5)
    tracker.note_threats(["4B1234"], 5.0)
    for second in range(6, 60):
        report = report_at(straight(START_M, VELOCITY_MPS, second), second, VELOCITY_MPS)
        tracker.receive(replace(report, altitude_m=None), second)
        assert only(tracker.tracks(second, FRAME)).age_s == 0.0


# --- kinds


@pytest.mark.parametrize(
    ("kind", "height_m", "speed_mps", "expected"),
    [
        (TrafficKind.SURFACE_VEHICLE, 300.0, 60.0, TrafficKind.AIRCRAFT),
        (TrafficKind.SURFACE_VEHICLE, 5.0, 60.0, TrafficKind.AIRCRAFT),
        (TrafficKind.SURFACE_VEHICLE, 60.0, 20.0, TrafficKind.AIRCRAFT),
        (TrafficKind.SURFACE_VEHICLE, 150.0, 0.0, TrafficKind.AIRCRAFT),
        (TrafficKind.SURFACE_VEHICLE, 5.0, 20.0, TrafficKind.SURFACE_VEHICLE),
        (TrafficKind.SURFACE_VEHICLE, 28.0, 8.0, TrafficKind.SURFACE_VEHICLE),
        (TrafficKind.OBSTACLE, 100.0, 20.0, TrafficKind.AIRCRAFT),
        (TrafficKind.OBSTACLE, 100.0, 0.0, TrafficKind.OBSTACLE),
    ],
)
def test_what_moves_or_is_far_above_ground_flies_whatever_it_says(
    kind: TrafficKind, height_m: float, speed_mps: float, expected: TrafficKind
) -> None:
    tracker = Tracker()
    for second in range(10):
        own_at(tracker, second)
        position_m = 3000.0 - speed_mps * second, 0.0, -HOME_M - height_m
        report = report_at(position_m, second, (-speed_mps, 0.0, 0.0))
        tracker.receive(replace(report, kind=kind), second)
    assert only(tracker.tracks(10.0, FRAME)).kind is expected


@pytest.mark.parametrize(
    ("height_m", "uncertainty_m", "speed_mps", "expected"),
    [
        (0.0, 0.0, 0.0, TrafficKind.SURFACE_VEHICLE),
        (10.0, 0.0, 0.0, TrafficKind.SURFACE_VEHICLE),
        (30.0, 0.0, 0.0, TrafficKind.AIRCRAFT),  # a helicopter
        (0.0, 60.0, 0.0, TrafficKind.AIRCRAFT),  # its height is not known well enough
        (0.0, 0.0, 8.0, TrafficKind.AIRCRAFT),
    ],
)
def test_an_aircraft_that_stands_at_the_height_of_home_is_on_the_surface(
    height_m: float, uncertainty_m: float, speed_mps: float, expected: TrafficKind
) -> None:
    offsets = {**AS_REPORTED, AltitudeReference.GEOMETRIC: DatumOffset(0.0, uncertainty_m)}
    tracker = Tracker(offsets_at=lambda _: offsets)
    for second in range(20):
        own_at(tracker, second)
        position_m = 1500.0 + speed_mps * second, 0.0, -HOME_M - height_m
        tracker.receive(report_at(position_m, second, (speed_mps, 0.0, 0.0)), second)
    assert only(tracker.tracks(20.0, FRAME)).kind is expected


def test_a_parked_aircraft_that_takes_off_is_traffic_at_once() -> None:
    tracker = Tracker()
    for second in range(30):
        own_at(tracker, second)
        rolled_m = 3.0 * max(second - 20, 0) ** 2 / 2.0
        speed_mps = 3.0 * max(second - 20, 0)
        tracker.receive(report_at((1500.0 + rolled_m, 0.0, -HOME_M), second, (speed_mps, 0.0, 0.0)), second)
        kind = only(tracker.tracks(second, FRAME)).kind
        assert kind is (TrafficKind.AIRCRAFT if second >= 22 else TrafficKind.SURFACE_VEHICLE) or second == 21


# --- stated velocities and climbs


@pytest.mark.parametrize("period_s", [0.5, 1.0, 2.0, 5.0])
@pytest.mark.parametrize("share", [0.0, 0.5, 2.0, -1.0])
def test_positions_that_contradict_a_stated_velocity_win_within_seconds(
    period_s: float, share: float
) -> None:
    tracker = Tracker()
    velocity_mps = (42.0, 42.0, 0.0)
    said_mps = (42.0 * share, 42.0 * share, 0.0)
    for number in range(max(8, round(6.0 / period_s))):
        now_s = number * period_s
        tracker.receive(report_at(straight((0.0, 0.0, -500.0), velocity_mps, now_s), now_s, said_mps), now_s)
    track = only(tracker.tracks(now_s, FRAME))
    assert math.dist(track.velocity_mps, velocity_mps) < 8.0
    assert tracker.dropped[DropReason.VELOCITY_WRONG] > 0


@pytest.mark.parametrize("turn_radps", [0.0, 0.05, 0.1])
@pytest.mark.parametrize("whole_seconds", [True, False])
def test_a_right_velocity_is_believed_in_turns_with_noise_and_late_stamps(
    turn_radps: float, whole_seconds: bool
) -> None:
    wrong = 0
    for seed in range(10):
        chance, tracker = random.Random(seed), Tracker()
        for second in range(60):
            course_rad = turn_radps * second
            along_m = 60.0 * second, 0.0
            if turn_radps:
                along_m = (
                    60.0 / turn_radps * math.sin(course_rad),
                    60.0 / turn_radps * (1.0 - math.cos(course_rad)),
                )
            there_m = along_m[0] + chance.gauss(0.0, 30.0), along_m[1] + chance.gauss(0.0, 30.0), -500.0
            velocity_mps = 60.0 * math.cos(course_rad), 60.0 * math.sin(course_rad), 0.0
            age_s = chance.uniform(0.0, 1.5)
            stated_s = float(int(age_s)) if whole_seconds else age_s
            tracker.receive(report_at(there_m, second + age_s - stated_s, velocity_mps), second + age_s)
        wrong += tracker.dropped[DropReason.VELOCITY_WRONG]
    assert wrong < 12


def test_altitudes_that_contradict_a_stated_climb_win() -> None:
    tracker = Tracker()
    for second in range(12):
        position_m = straight(START_M, (48.0, -36.0, 10.0), second)
        tracker.receive(report_at(position_m, second, (48.0, -36.0, 0.0)), second)
    track = only(tracker.tracks(12.0, FRAME))
    assert track.velocity_mps[2] == pytest.approx(10.0, abs=1.5)
    assert tracker.dropped[DropReason.CLIMB_WRONG] > 0


# --- without an identifier


@pytest.mark.parametrize("with_velocity", [True, False])
def test_twenty_aircraft_without_an_identifier_are_twenty_tracks(with_velocity: bool) -> None:
    chance, tracker = random.Random(4), Tracker()
    starts = [
        (chance.uniform(-3000.0, 3000.0), chance.uniform(-3000.0, 3000.0), -chance.uniform(200.0, 900.0))
        for _ in range(20)
    ]
    flown = []
    for _ in range(20):
        course_rad, speed_mps = chance.uniform(0.0, math.tau), chance.uniform(20.0, 80.0)
        flown.append((speed_mps * math.cos(course_rad), speed_mps * math.sin(course_rad), 0.0))
    for step in range(40 * 20):
        now_s, number = step / 20.0, step % 20
        north_m, east_m, down_m = straight(starts[number], flown[number], now_s)
        reported_m = north_m + chance.gauss(0.0, 10.0), east_m + chance.gauss(0.0, 10.0), down_m
        velocity_mps = flown[number] if with_velocity else None
        tracker.receive(report_at(reported_m, now_s, velocity_mps, icao=0), now_s)
    tracks = tracker.tracks(now_s, FRAME)
    assert len(tracks) == 20
    for start_m, velocity_mps in zip(starts, flown, strict=True):
        truth_m = straight(start_m, velocity_mps, now_s)
        assert min(math.dist(track.position_m, truth_m) for track in tracks) < 50.0


def test_an_anonymous_aircraft_near_us_is_a_track_at_its_first_report() -> None:
    tracker = Tracker()
    own_at(tracker, 0.0)
    near_m = (400.0, 0.0, -HOME_M - 100.0)
    assert tracker.receive(report_at(near_m, 0.0, (-60.0, 0.0, 0.0), icao=0), 0.0) == "ANON-1"
    assert only(tracker.tracks(0.0, FRAME)).state is TrackState.TENTATIVE


def test_an_anonymous_report_merges_with_the_aircraft_that_another_source_identifies() -> None:
    tracker = Tracker()
    for second in range(12):
        position_m = straight(START_M, VELOCITY_MPS, second)
        tracker.receive(report_at(position_m, second, VELOCITY_MPS), second)
        flarm = replace(
            report_at(position_m, second, VELOCITY_MPS), source=TrafficSource.FLARM, key="", icao=None
        )
        tracker.receive(flarm, second)
    track = only(tracker.tracks(12.0, FRAME))
    assert (track.track_id, track.sources) == ("4B1234", ("ADS-B", "FLARM"))


# --- concerns


def test_an_aircraft_without_a_height_is_a_concern_when_it_is_near() -> None:
    for away_m, kinds in ((3000.0, [ConcernKind.HEIGHT_UNKNOWN]), (12_000.0, [])):
        tracker = Tracker()
        own_at(tracker, 0.0)
        report = report_at((away_m, 0.0, -500.0), 0.0, (0.0, 20.0, 0.0))
        tracker.receive(replace(report, altitude_m=None), 0.0)
        assert concerns(tracker, 0.0) == kinds


def test_an_altitude_without_a_position_is_counted() -> None:
    tracker = Tracker()
    mode_s = TrafficReport(
        TrafficSource.MODE_S, "4B1234", 0.0, altitude_m=500.0,
        altitude_reference=AltitudeReference.BAROMETRIC, icao=0x4B1234,
    )  # fmt: skip
    assert tracker.receive(mode_s, 0.0) is None
    assert tracker.dropped[DropReason.NO_POSITION] == 1


# --- many


def flood(tracker: Tracker, now_s: float, chance: random.Random, count: int) -> None:
    for number in range(count):
        icao = chance.randrange(0x100000, 0xF00000)
        there_m = chance.uniform(-9000.0, 9000.0), chance.uniform(-9000.0, 9000.0), -600.0
        flown_mps = chance.uniform(-60.0, 60.0), chance.uniform(-60.0, 60.0), 0.0
        time_s = now_s + number / count
        tracker.receive(report_at(there_m, time_s, flown_mps, icao=icao), time_s)


def test_a_flood_does_not_push_out_who_is_near_and_closing() -> None:
    chance, tracker = random.Random(7), Tracker(TrafficParams(max_tracks=100))
    shown = 0
    for second in range(20):
        own_at(tracker, second, 22.0 * second)
        head_on_m = 5000.0 - 60.0 * second, 0.0, -HOME_M - 100.0
        tracker.receive(report_at(head_on_m, second, (-60.0, 0.0, 0.0), icao=0xF00001), second)
        flood(tracker, second, chance, 1000)
        ids = [track.icao for track in tracker.tracks(second + 1.0, FRAME)]
        shown += 0xF00001 in ids
        assert len(ids) <= 100
    assert shown >= 18
    assert tracker.evicted > 15_000
    assert ConcernKind.LEFT_OUT in concerns(tracker, 20.0)


def test_a_threat_is_never_pushed_out() -> None:
    chance, tracker = random.Random(7), Tracker(TrafficParams(max_tracks=50))
    own_at(tracker, 0.0)
    tracker.receive(report_at((8000.0, 0.0, -600.0), 0.0, (-20.0, 0.0, 0.0), icao=0xF00001), 0.0)
    tracker.note_threats(["F00001"], 0.0)
    for second in range(1, 15):
        own_at(tracker, second)
        flood(tracker, second, chance, 500)
    tracks: tuple[Track, ...] = tracker.tracks(15.0, FRAME)
    assert any(track.icao == 0xF00001 for track in tracks)


def test_the_surroundings_are_unknown_at_first() -> None:
    assert Tracker().surroundings == Surroundings()


def test_a_conflict_that_ends_while_its_aircraft_is_heard_is_clear_whatever_happens_then() -> None:
    tracker = Tracker()
    own_at(tracker, 0.0)
    follow(tracker, 5)
    tracker.note_threats(["4B1234"], 5.0)
    tracker.note_threats([], 6.0)
    assert tracker.unheard(15.0) is None
    for second in (10, 20, 26):
        tracker.tracks(second, FRAME)
        assert concerns(tracker, second) == []
    assert tracker.tracks(26.0, FRAME) == ()
