"""One aircraft from several sources is one track, two aircraft stay two, and our own echo is no track."""

import math
import random
from dataclasses import replace

import pytest

from companion.geodesy import LocalFrame
from companion.model import (
    AltitudeReference,
    Track,
    TrafficKind,
    TrafficReport,
    TrafficSource,
    Vec3,
    adsb_key,
)
from companion.traffic import ConcernKind, DropReason, Tracker, TrafficParams
from companion.traffic.altitudes import AS_REPORTED, DatumOffset
from companion.traffic.own_aircraft import OwnshipFix

FRAME = LocalFrame(47.4, 8.5)
FAST: Vec3 = (45.0, 20.0, 0.0)
KEYS = {TrafficSource.ADSB: "4B1234", TrafficSource.UTM: "UTM-A1", TrafficSource.SYSTEM: "SYS-7"}
REFERENCES = {
    TrafficSource.ADSB: AltitudeReference.BAROMETRIC,
    TrafficSource.UTM: AltitudeReference.GEOMETRIC,
    TrafficSource.SYSTEM: AltitudeReference.SEA_LEVEL,
}
SOURCES = ADSB, UTM, SYSTEM = TrafficSource.ADSB, TrafficSource.UTM, TrafficSource.SYSTEM


def report(
    source: TrafficSource,
    time_s: float,
    off_m: Vec3 = (0.0, 0.0, 0.0),
    *,
    velocity_mps: Vec3 = FAST,
    key: str | None = None,
) -> TrafficReport:
    """One source's report of an aircraft in straight flight, displaced from its path by `off_m`."""
    north_m, east_m, down_m = (v * time_s + o for v, o in zip(velocity_mps, off_m, strict=True))
    place = FRAME.to_geo(north_m, east_m, down_m - 500.0)
    key = key or KEYS[source]
    return TrafficReport(
        source, key, time_s, place.lat_deg, place.lon_deg, place.altitude_m, REFERENCES[source],
        course_rad=math.atan2(velocity_mps[1], velocity_mps[0]) % (2.0 * math.pi),
        ground_speed_mps=math.hypot(*velocity_mps[:2]), climb_mps=-velocity_mps[2],
        icao=int(key, 16) if source is ADSB else None,
    )  # fmt: skip


def ids(tracker: Tracker, now_s: float) -> list[str]:
    return [track.track_id for track in tracker.tracks(now_s, FRAME)]


def only(tracker: Tracker, now_s: float) -> Track:
    (track,) = tracker.tracks(now_s, FRAME)
    return track


@pytest.mark.parametrize("pair", [(ADSB, UTM), (ADSB, SYSTEM), (UTM, SYSTEM)], ids=str)
def test_one_aircraft_from_two_sources_becomes_one_track_after_some_reports(
    pair: tuple[TrafficSource, TrafficSource],
) -> None:
    tracker, counts = Tracker(), []
    for second in range(12):
        for source in pair:
            off_m = (10.0, 15.0, 12.0) if source is UTM else (0.0, 0.0, 0.0)
            assert tracker.receive(report(source, float(second), off_m), second)
        counts.append(len(ids(tracker, second)))
    assert counts == [2] * 4 + [1] * 8
    track = only(tracker, 12.0)
    assert track.track_id == ("SYS-7" if ADSB not in pair else "4B1234")
    assert track.icao == (0x4B1234 if pair[0] is ADSB else None)


def test_three_sources_become_one_track_and_each_report_updates_it() -> None:
    tracker = Tracker()
    for second in range(12):
        updated = [tracker.receive(report(source, float(second)), second) for source in SOURCES]
    assert updated == ["4B1234"] * 3
    assert ids(tracker, 12.0) == ["4B1234"]


@pytest.mark.parametrize(
    ("off_m", "velocity_mps"),
    [
        ((0.0, 150.0, 0.0), FAST),  # abreast
        ((0.0, 0.0, -120.0), FAST),  # above
        ((0.0, 0.0, 0.0), (-45.0, 20.0, 0.0)),  # crossing, at the same place once
        ((-150.0, -66.0, 0.0), FAST),  # behind
        ((0.0, 30.0, 0.0), (45.0, 20.0, -5.0)),  # climbing through
    ],
)
def test_two_aircraft_of_different_sources_stay_two(off_m: Vec3, velocity_mps: Vec3) -> None:
    tracker = Tracker()
    for second in range(-20, 20):
        tracker.receive(report(ADSB, float(second)), second)
        tracker.receive(report(UTM, float(second), off_m, velocity_mps=velocity_mps), second)
        assert len(ids(tracker, second)) == 2


def test_two_targets_of_one_source_are_never_merged() -> None:
    tracker = Tracker()
    for second in range(30):
        for source, keys in (
            (ADSB, ("4B1234", "4B1235")),
            (UTM, ("UTM-A1", "UTM-A2")),
            (SYSTEM, ("SYS-7", "SYS-8")),
        ):
            for key in keys:
                tracker.receive(report(source, float(second), key=key), second)
    # Each source reports two aircraft, so there are two.
    assert ids(tracker, 30.0) == ["4B1234", "4B1235"]


def test_reports_of_a_formation_are_merged_by_aircraft() -> None:
    tracker = Tracker()
    for second in range(20):
        for off_m, address, name in (
            ((0.0, 0.0, 0.0), "4B0001", "UTM-A1"),
            ((0.0, 150.0, 0.0), "4B0002", "UTM-A2"),
        ):
            tracker.receive(report(ADSB, float(second), off_m, key=address), second)
            tracker.receive(report(UTM, float(second), (off_m[0] + 25.0, off_m[1], 0.0), key=name), second)
    assert ids(tracker, 20.0) == ["4B0001", "4B0002"]
    assert tracker.receive(report(UTM, 21.0, (25.0, 150.0, 0.0), key="UTM-A2"), 21.0) == "4B0002"


def test_a_merged_track_splits_only_after_some_reports_clearly_apart() -> None:
    tracker = Tracker()
    for second in range(10):
        tracker.receive(report(ADSB, float(second)), second)
        tracker.receive(report(UTM, float(second)), second)
    assert len(ids(tracker, 9.0)) == 1
    # 100 m to the side is too far to merge, and not far enough to split.
    for second in range(10, 30):
        tracker.receive(report(ADSB, float(second)), second)
        tracker.receive(report(UTM, float(second), (0.0, 5.0 * min(second - 9, 20), 0.0)), second)
        assert len(ids(tracker, second)) == 1
    counts = []
    for second in range(30, 60):
        tracker.receive(report(ADSB, float(second)), second)
        tracker.receive(report(UTM, float(second), (0.0, 100.0 + 5.0 * (second - 29), 0.0)), second)
        counts.append(len(ids(tracker, second)))
    assert counts[0] == 1
    assert counts[-1] == 2
    assert counts == sorted(counts), "never merged again"


def test_a_single_wrong_report_neither_merges_nor_splits() -> None:
    tracker = Tracker()
    for second in range(30):
        tracker.receive(report(ADSB, float(second)), second)
        off_m = (0.0, 400.0, 0.0) if second == 15 else (0.0, 0.0, 0.0)
        tracker.receive(report(UTM, float(second), off_m), second)
        if second >= 5:
            assert len(ids(tracker, second)) == 1


def test_the_fresher_target_leads_and_then_the_more_accurate_one() -> None:
    tracker = Tracker()
    for second in range(10):
        tracker.receive(report(ADSB, float(second)), second)
        tracker.receive(replace(report(UTM, float(second), (20.0, 0.0, 0.0)), position_sigma_m=2.0), second)
    truth_north_m = FAST[0] * 9.0
    assert only(tracker, 9.0).position_m[0] == pytest.approx(truth_north_m + 20.0, abs=0.5), "more accurate"
    for second in range(10, 20):
        tracker.receive(report(ADSB, float(second)), second)
    track = only(tracker, 19.0)
    assert track.position_m[0] == pytest.approx(FAST[0] * 19.0, abs=0.5), "fresher"
    assert (track.track_id, track.age_s) == ("4B1234", 0.0)


def test_a_merged_track_continues_when_one_source_falls_silent() -> None:
    tracker = Tracker()
    for second in range(10):
        tracker.receive(report(ADSB, float(second)), second)
        tracker.receive(report(UTM, float(second)), second)
    for second in range(10, 40):
        tracker.receive(report(UTM, float(second)), second)
        (track,) = tracker.tracks(second, FRAME)
        assert track.track_id == ("4B1234" if second < 30 else "UTM-A1")
        assert track.age_s == 0.0
    landed = replace(report(UTM, 40.0), ground_speed_mps=0.0, course_rad=None, airborne=False)
    for second in range(40, 50):
        tracker.receive(replace(landed, time_s=float(second)), second)
    assert ids(tracker, 50.0) == []


def test_a_merged_track_has_the_most_certain_altitude() -> None:
    offsets = {**AS_REPORTED, AltitudeReference.BAROMETRIC: DatumOffset(0.0, 60.0)}
    tracker = Tracker(offsets_at=lambda _: offsets)
    for second in range(10):
        # Barometers are 66 m off; the gate allows for it, because their offset is uncertain.
        tracker.receive(report(ADSB, float(second), (0.0, 0.0, 66.0)), second)
        tracker.receive(replace(report(UTM, float(second)), altitude_sigma_m=4.0), second)
    (track,) = tracker.tracks(9.0, FRAME)
    assert track.position_m[2] == pytest.approx(-500.0)
    assert track.vertical_uncertainty_m == 4.0
    offsets = {**AS_REPORTED, AltitudeReference.GEOMETRIC: DatumOffset(0.0, 50.0)}
    (track,) = tracker.tracks(9.0, FRAME)
    assert track.position_m[2] == pytest.approx(-434.0)


def test_aircraft_on_the_ground_are_not_traffic() -> None:
    tracker, slow = Tracker(), (4.0, 2.0, 0.0)
    tracker.receive(report(UTM, 0.0, velocity_mps=slow), 0.0)
    assert ids(tracker, 0.0) == ["UTM-A1"]
    assert tracker.receive(replace(report(UTM, 1.0, velocity_mps=slow), airborne=False), 1.0) is None
    assert ids(tracker, 1.0) == []
    assert tracker.dropped == {DropReason.ON_GROUND: 1}


def test_what_is_fast_flies_though_it_says_that_it_is_on_the_ground() -> None:
    tracker = Tracker()
    assert tracker.receive(replace(report(UTM, 0.0), airborne=False), 0.0) == "UTM-A1"


# --- echoes of our own aircraft ------------------------------------------------------------------


def fly_own(tracker: Tracker, from_s: int, until_s: int) -> None:
    """Our own position at 10 Hz, along the path of `report`, at whole seconds `until_s` included."""
    for tick in range(from_s * 10, until_s * 10 + 1):
        observe_ownship(tracker, tick / 10.0)


def observe_ownship(tracker: Tracker, time_s: float) -> None:
    place = FRAME.to_geo(FAST[0] * time_s, FAST[1] * time_s, -500.0)
    tracker.observe_ownship(OwnshipFix(time_s, place.lat_deg, place.lon_deg, 500.0, FAST[0], FAST[1], 0.0))


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize("late_s", [0, 1, 2, 3])
def test_a_target_first_received_on_our_trail_is_an_echo_at_once(source: TrafficSource, late_s: int) -> None:
    tracker = Tracker()
    fly_own(tracker, 0, 9)
    for second in range(10, 40):
        fly_own(tracker, second - 1, second)
        late = replace(report(source, float(second - late_s), (4.0, -6.0, 5.0)), time_s=float(second))
        assert tracker.receive(late, second) is None
        assert ids(tracker, second) == []
    assert tracker.dropped == {DropReason.OWN: 30}


def test_an_aircraft_that_approaches_is_not_an_echo_even_within_the_gate() -> None:
    tracker = Tracker()
    for second in range(30):
        fly_own(tracker, second - 1, second)
        nearer = report(ADSB, float(second), (0.0, 20.0 * (15 - second), 0.0), velocity_mps=FAST)
        assert tracker.receive(replace(nearer, course_rad=0.0, ground_speed_mps=45.0), second)
        assert len(ids(tracker, second)) == 1


def test_a_target_first_received_elsewhere_is_an_echo_only_after_several_reports() -> None:
    tracker, is_traffic = Tracker(), []
    for second in range(20):
        fly_own(tracker, second - 1, second)
        off_m = (0.0, max(60.0 - 10.0 * second, 0.0), 0.0)
        is_traffic.append(tracker.receive(report(UTM, float(second), off_m), second) is not None)
    # Beside us with our velocity it could be a shadow with noisy positions; not when it comes nearer by
    # more than that.
    assert all(is_traffic[4:8])
    assert not any(is_traffic[14:])


@pytest.mark.parametrize("noise_m", [8.0, 15.0])
@pytest.mark.parametrize(("late_s", "period_s"), [(1, 1), (4, 1), (8, 1), (8, 5)])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_noisy_shadow_is_never_traffic(noise_m: float, late_s: int, period_s: int, seed: int) -> None:
    """Ourselves under another address, late, 120 m aside, with our velocity of then and noise."""
    tracker, chance = Tracker(), random.Random(seed)
    fly_own(tracker, 0, 14)
    for second in range(15, 75, period_s):
        fly_own(tracker, second - period_s, second)
        off_m = chance.gauss(0.0, noise_m) + 120.0, chance.gauss(0.0, noise_m), 0.0
        late = replace(report(ADSB, float(second - late_s), off_m, velocity_mps=FAST), time_s=float(second))
        assert tracker.receive(late, second) is None
    assert [concern.kind for concern in tracker.concerns(75.0)] == [ConcernKind.OWN_SHADOW]


def test_an_echo_that_leaves_our_trail_is_traffic() -> None:
    tracker, counts = Tracker(), []
    for second in range(10, 40):
        fly_own(tracker, second - 1, second)
        off_m = (0.0, 12.0 * max(second - 20, 0), 0.0)
        tracker.receive(report(UTM, float(second), off_m), second)
        counts.append(len(ids(tracker, second)))
    assert counts[:10] == [0] * 10
    assert counts[-6:] == [1] * 6


@pytest.mark.parametrize("off_m", [(24.0, 0.0, 0.0), (0.0, 24.0, 0.0), (0.0, -24.0, 0.0)])
def test_an_echo_may_be_displaced_by_the_error_of_positions(off_m: Vec3) -> None:
    tracker = Tracker()
    for second in range(10, 20):
        fly_own(tracker, second - 1, second)
        assert tracker.receive(report(ADSB, float(second), off_m), second) is None


@pytest.mark.parametrize("gap_s", [2, 12, 40])
def test_an_echo_stays_an_echo_while_our_own_position_is_missing(gap_s: int) -> None:
    tracker = Tracker()
    for second in range(10, 90):
        if not 20 <= second < 20 + gap_s:
            fly_own(tracker, second - 1, second)
        assert tracker.receive(report(ADSB, float(second)), second) is None
        assert ids(tracker, second) == []


def test_our_own_id_is_never_traffic_wherever_it_is_reported() -> None:
    tracker = Tracker(TrafficParams(own_uas_id="a100"))
    assert tracker.receive(report(UTM, 0.0, (5000.0, 0.0, 0.0)), 0.0) is None
    assert tracker.dropped == {DropReason.OWN: 1}
    with pytest.raises(ValueError, match="own_uas_id must be up to 18 bytes in hexadecimal"):
        TrafficParams(own_uas_id="A1Z")


def test_obstacles_are_never_merged() -> None:
    tracker = Tracker()
    still = (0.0, 0.0, 0.0)
    for second in range(0, 60, 8):
        for source in (ADSB, SYSTEM):
            kind = TrafficKind.OBSTACLE if source is ADSB else TrafficKind.UAV
            tracker.receive(replace(report(source, float(second), velocity_mps=still), kind=kind), second)
    assert ids(tracker, 56.0) == [adsb_key(0x4B1234), "SYS-7"]
