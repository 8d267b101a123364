"""For any reports at any times, tracks are finite, bounded, ordered and reproducible."""

import math
from dataclasses import replace
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from companion.geodesy import LocalFrame
from companion.model import AltitudeReference, Track, TrafficKind, TrafficReport, TrafficSource
from companion.traffic import Tracker, TrafficParams

PARAMS = TrafficParams(max_tracks=4, own_icao=frozenset({3}))
FRAME = LocalFrame(47.4, 8.5)

numbers = st.floats(allow_nan=True, allow_infinity=True)
times_s = st.floats(-1e3, 1e3) | st.sampled_from([0.0, 1.0, 1e12, math.nan])


def maybe(plausible: st.SearchStrategy[float]) -> st.SearchStrategy[float | None]:
    return st.none() | plausible | numbers


def adsb(icao: int, **fields: Any) -> TrafficReport:
    return TrafficReport(TrafficSource.ADSB, f"{icao:06X}", icao=icao, **fields)


reports = st.builds(
    adsb,
    icao=st.integers(-1, 8),
    time_s=times_s,
    lat_deg=maybe(st.floats(-90, 90)),
    lon_deg=maybe(st.floats(-180, 180)),
    altitude_m=maybe(st.floats(-500, 20_000)),
    altitude_reference=st.sampled_from(AltitudeReference),
    course_rad=maybe(st.floats(0, 7)),
    ground_speed_mps=maybe(st.floats(0, 655.35)),
    climb_mps=maybe(st.floats(-327, 327)),
    callsign=st.sampled_from([None, "ONE"]),
    kind=st.sampled_from(TrafficKind),
)
# A report, or only a query, at any time; the clock may jump.
events = st.lists(st.tuples(st.floats(-1e3, 1e3), st.none() | reports), max_size=40)


def play(history: list[tuple[float, TrafficReport | None]]) -> list[tuple[Track, ...]]:
    tracker = Tracker(PARAMS)
    answers = []
    for now_s, report in history:
        if report is not None:
            tracker.receive(report, now_s)
        answers.append(tracker.tracks(now_s, FRAME))
    assert tracker.dropped.total() <= 2 * len(history)
    return answers


@given(events)
def test_any_history_gives_finite_bounded_ordered_tracks_reproducibly(
    history: list[tuple[float, TrafficReport | None]],
) -> None:
    answers = play(history)
    for (now_s, _), tracks in zip(history, answers, strict=True):
        assert len(tracks) <= PARAMS.max_tracks
        ids = [track.track_id for track in tracks]
        assert ids == sorted(set(ids))
        for track in tracks:
            assert track.time_s == now_s
            assert track.icao is not None or track.track_id.startswith("ANON-")
            assert track.icao is None or track.icao > 0
            assert track.icao != 3
            longest_s = PARAMS.obstacle_stale_s if track.kind is TrafficKind.OBSTACLE else PARAMS.stale_s
            assert 0.0 <= track.age_s <= longest_s
            assert all(math.isfinite(x) for x in (*track.position_m, *track.velocity_mps))
            assert math.hypot(*track.velocity_mps) < 3 * PARAMS.estimate.max_speed_mps
    assert repr(play(history)) == repr(answers)


@settings(max_examples=60)
@given(
    lat_deg=st.floats(-70, 70),
    lon_deg=st.floats(-180, 180),
    course_rad=st.floats(0, 2 * math.pi),
    speed_mps=st.floats(0, 150),
    climb_mps=st.floats(-10, 10),
    period_s=st.sampled_from([0.2, 0.5, 1.0, 2.0]),
    velocity_known=st.booleans(),
)
def test_straight_flight_is_tracked_anywhere_at_any_report_rate(
    lat_deg: float,
    lon_deg: float,
    course_rad: float,
    speed_mps: float,
    climb_mps: float,
    period_s: float,
    velocity_known: bool,
) -> None:
    frame = LocalFrame(lat_deg, lon_deg)
    velocity_mps = speed_mps * math.cos(course_rad), speed_mps * math.sin(course_rad), -climb_mps
    tracker = Tracker()
    flown_s = 30.0
    for step in range(round(flown_s / period_s) + 1):
        now_s = step * period_s
        # Towards the origin, where the flat frame is exact.
        to_go_s = now_s - flown_s
        place = frame.to_geo(
            velocity_mps[0] * to_go_s, velocity_mps[1] * to_go_s, -1000.0 - climb_mps * now_s
        )
        report = adsb(
            7,
            time_s=now_s,
            lat_deg=place.lat_deg,
            lon_deg=place.lon_deg,
            altitude_m=place.altitude_m,
            course_rad=course_rad if velocity_known else None,
            ground_speed_mps=speed_mps if velocity_known else None,
            climb_mps=climb_mps if velocity_known else None,
        )
        tracker.receive(report, now_s)
    (track,) = tracker.tracks(flown_s + 0.5, frame)
    truth_m = 0.5 * velocity_mps[0], 0.5 * velocity_mps[1], -1000.0 - climb_mps * (flown_s + 0.5)
    # Most of the error is the curvature of a straight line of 4.5 km in the flat frame at 70 degrees north.
    assert math.dist(track.position_m, truth_m) < (3.0 if velocity_known else 6.0)


@given(
    dlat_deg=st.floats(-0.05, 0.05),
    dlon_deg=st.floats(-0.05, 0.05),
    received=st.lists(reports, max_size=8),
)
def test_the_velocity_and_age_of_a_track_do_not_depend_on_the_frame(
    dlat_deg: float, dlon_deg: float, received: list[TrafficReport]
) -> None:
    tracker = Tracker()
    for second, report in enumerate(received):
        tracker.receive(replace(report, time_s=float(second)), float(second))
    now_s = float(len(received))
    other = LocalFrame(FRAME.lat_deg + dlat_deg, FRAME.lon_deg + dlon_deg)
    before = tracker.tracks(now_s, FRAME)
    there = tracker.tracks(now_s, other)
    assert [(t.track_id, t.velocity_mps, t.age_s) for t in there] == [
        (t.track_id, t.velocity_mps, t.age_s) for t in before
    ]
    assert tracker.tracks(now_s, FRAME) == before
