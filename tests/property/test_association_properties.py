"""With any motion and realistic noise, one aircraft is one track, and two are two."""

import math
import random
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from companion.geodesy import LocalFrame
from companion.model import AltitudeReference, TrafficKind, TrafficReport, TrafficSource, Vec3, adsb_key
from companion.traffic import Tracker, TrafficParams
from companion.traffic.own_aircraft import OwnshipFix

PARAMS = TrafficParams(max_tracks=6, own_uas_id="07")
SOURCES = ADSB, UTM, SYSTEM = TrafficSource.ADSB, TrafficSource.UTM, TrafficSource.SYSTEM
PREFIX = {ADSB: "0000", UTM: "UTM-", SYSTEM: "SYS-"}

numbers = st.floats(allow_nan=True, allow_infinity=True)


def maybe(low: float, high: float) -> st.SearchStrategy[float | None]:
    return st.none() | st.floats(low, high) | numbers


def named(source: TrafficSource, number: int, **fields: Any) -> TrafficReport:
    icao = number if source is ADSB else None
    return TrafficReport(source, f"{PREFIX[source]}{number:02X}", icao=icao, **fields)


# All within a few hundred metres, so that pairs merge and split.
reports = st.builds(
    named,
    st.sampled_from(SOURCES),
    st.integers(1, 8),
    time_s=st.floats(-10.0, 100.0) | numbers,
    lat_deg=maybe(47.0, 47.005),
    lon_deg=maybe(8.0, 8.005),
    altitude_m=maybe(400.0, 600.0),
    altitude_reference=st.sampled_from(AltitudeReference),
    course_rad=maybe(0.0, 6.0),
    ground_speed_mps=maybe(0.0, 60.0),
    climb_mps=maybe(-5.0, 5.0),
    kind=st.sampled_from(TrafficKind),
    airborne=st.booleans() | st.just(True),
    position_sigma_m=maybe(0.0, 50.0),
    altitude_sigma_m=maybe(0.0, 50.0),
)
ownship_fixes = st.builds(
    OwnshipFix, st.just(0.0), st.floats(47.0, 47.005), st.floats(8.0, 8.005), st.floats(400.0, 600.0),
    st.floats(-30.0, 30.0), st.floats(-30.0, 30.0), st.floats(-5.0, 5.0),
)  # fmt: skip


@settings(max_examples=150, deadline=None)
@given(st.lists(st.tuples(st.floats(-0.5, 3.0), st.none() | ownship_fixes | reports), max_size=60))
def test_any_history_gives_finite_tracks_with_distinct_ids_reproducibly(
    history: list[tuple[float, TrafficReport | OwnshipFix | None]],
) -> None:
    def play() -> list[Any]:
        tracker, now_s, answers = Tracker(PARAMS), 0.0, []
        for step_s, event in history:
            now_s += step_s
            updated = None
            if isinstance(event, OwnshipFix):
                tracker.observe_ownship(event._replace(time_s=now_s))
            elif event is not None:
                updated = tracker.receive(event, now_s)
            tracks = tracker.tracks(now_s, LocalFrame(47.0, 8.0))
            ids = [track.track_id for track in tracks]
            assert ids == sorted(set(ids))
            assert "UTM-07" not in ids
            assert len(ids) <= PARAMS.max_tracks
            for track in tracks:
                numbers = (*track.position_m, *track.velocity_mps, track.vertical_uncertainty_m, track.age_s)
                assert all(map(math.isfinite, numbers))
            answers.append((updated, tracks))
        return answers

    assert repr(play()) == repr(play())


def noisy_report(
    source: TrafficSource, key: str, time_s: float, position_m: Vec3, velocity_mps: Vec3, rng: random.Random
) -> TrafficReport:
    """A report with noise of 10 m and 1 m/s on each axis."""
    north_m, east_m, down_m = (p + rng.gauss(0.0, 10.0) for p in position_m)
    north_mps, east_mps = (v + rng.gauss(0.0, 1.0) for v in velocity_mps[:2])
    place = LocalFrame(47.0, 8.0).to_geo(north_m, east_m, down_m)
    return TrafficReport(
        source, key, time_s, place.lat_deg, place.lon_deg, place.altitude_m,
        course_rad=math.atan2(east_mps, north_mps) % (2.0 * math.pi),
        ground_speed_mps=math.hypot(north_mps, east_mps),
        climb_mps=-velocity_mps[2] + rng.gauss(0.0, 0.3),
        icao=int(key, 16) if source is ADSB else None,
    )  # fmt: skip


flights = st.tuples(st.floats(0.0, 2.0 * math.pi), st.floats(5.0, 90.0), st.floats(-4.0, 4.0))


def velocity_of(flight: tuple[float, float, float]) -> Vec3:
    course_rad, speed_mps, climb_mps = flight
    return speed_mps * math.cos(course_rad), speed_mps * math.sin(course_rad), -climb_mps


@settings(max_examples=40, deadline=None)
@given(flights, st.floats(0.0, 0.9), st.integers(0, 1_000))
def test_one_aircraft_from_two_sources_with_noise_and_delay_is_soon_one_track(
    flight: tuple[float, float, float], delay_s: float, seed: int
) -> None:
    rng, tracker, velocity_mps = random.Random(seed), Tracker(), velocity_of(flight)
    for second in range(40):
        here = tuple(v * second for v in velocity_mps)
        then = tuple(v * (second - delay_s) for v in velocity_mps)
        tracker.receive(
            noisy_report(ADSB, "4B1234", second, (here[0], here[1], here[2] - 800), velocity_mps, rng), second
        )
        tracker.receive(
            noisy_report(UTM, "UTM-A1", second, (then[0], then[1], then[2] - 800), velocity_mps, rng), second
        )
        ids = [track.track_id for track in tracker.tracks(second, LocalFrame(47.0, 8.0))]
        assert ids == ["4B1234"] if second >= 25 else "4B1234" in ids


@settings(max_examples=40, deadline=None)
@given(flights, st.floats(150.0, 600.0), st.floats(0.0, 2.0 * math.pi), st.integers(0, 1_000))
def test_two_aircraft_in_formation_stay_two_with_reports_of_other_sources(
    flight: tuple[float, float, float], apart_m: float, bearing_rad: float, seed: int
) -> None:
    rng, tracker, velocity_mps = random.Random(seed), Tracker(), velocity_of(flight)
    aside_m = apart_m * math.cos(bearing_rad), apart_m * math.sin(bearing_rad)
    for second in range(30):
        for number, (off_north_m, off_east_m) in enumerate(((0.0, 0.0), aside_m)):
            north_m, east_m, down_m = (v * second for v in velocity_mps)
            position_m = north_m + off_north_m, east_m + off_east_m, down_m - 800.0
            tracker.receive(
                noisy_report(ADSB, adsb_key(0x4B0000 + number), second, position_m, velocity_mps, rng), second
            )
            if number:
                tracker.receive(noisy_report(UTM, "UTM-A1", second, position_m, velocity_mps, rng), second)
                tracker.receive(noisy_report(SYSTEM, "SYS-7", second, position_m, velocity_mps, rng), second)
        tracks = tracker.tracks(second, LocalFrame(47.0, 8.0))
        assert {"4B0000", "4B0001"} <= {track.track_id for track in tracks}
    assert [track.track_id for track in tracks] == ["4B0000", "4B0001"]
    north_m, east_m, _ = (v * 29.0 for v in velocity_mps)
    for track, (off_north_m, off_east_m) in zip(tracks, ((0.0, 0.0), aside_m), strict=True):
        there = north_m + off_north_m, east_m + off_east_m
        assert math.dist(track.position_m[:2], there) < 45.0, "each at its own position"
