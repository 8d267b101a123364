"""Properties of decisions in any geometry: closest approach, invariance, limits, finite guidance."""

import math

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from companion.avoidance import AvoidanceParams, Avoider, Envelope
from companion.avoidance.intruders import relative_motion
from companion.geodesy import GeoPoint, LocalFrame
from companion.model import Decision, Goal, Layer, Ownship, Track, Vec3

lengths = st.floats(-20_000.0, 20_000.0)
speeds = st.floats(-130.0, 130.0)
angles = st.floats(-math.pi, math.pi)
PARAMS = AvoidanceParams(envelope=Envelope(min_altitude_m=50.0, max_altitude_m=1500.0))


@given(lengths, lengths, speeds, speeds)
def test_nothing_is_nearer_than_the_closest_approach(n: float, e: float, vn: float, ve: float) -> None:
    position, velocity = np.array([[n, e, 0.0]]), np.array([[vn, ve, 0.0]])
    time_s = relative_motion(position, velocity, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)).time_to_closest_s
    assume(np.isfinite(time_s[0]))
    nearest_m = np.hypot(*(position + velocity * time_s)[0, :2])
    for offset_s in (-100.0, -1.0, -0.01, 0.01, 1.0, 100.0):
        other = (position + velocity * (time_s + offset_s))[0]
        assert np.hypot(*other[:2]) >= nearest_m - 1e-6 * (1.0 + abs(n) + abs(e))


def decide(own: Ownship, tracks: list[Track], goal: Goal) -> Decision:
    return Avoider(PARAMS).decide(own.time_s, own, tracks, goal)


@st.composite
def cases(draw: st.DrawFn) -> tuple[Ownship, list[Track], Goal]:
    course, airspeed = draw(angles), draw(st.floats(15.0, 30.0))
    velocity = (airspeed * math.cos(course), airspeed * math.sin(course), draw(st.floats(-3.0, 3.0)))
    own = Ownship(0.0, (0.0, 0.0, -draw(st.floats(60.0, 1400.0))), velocity, airspeed, course)
    tracks = [
        Track(
            f"T{i}",
            draw(st.floats(-20.0, 0.0)),
            (draw(lengths), draw(lengths), own.position_m[2] + draw(st.floats(-300.0, 300.0))),
            (draw(speeds), draw(speeds), draw(st.floats(-10.0, 10.0))),
        )
        for i in range(draw(st.integers(0, 4)))
    ]
    return own, tracks, Goal(course_rad=course, airspeed_mps=airspeed, altitude_m=-own.position_m[2])


@settings(max_examples=150, deadline=None)
@given(cases())
def test_every_decision_is_finite_and_within_the_limits(
    case: tuple[Ownship, list[Track], Goal],
) -> None:
    decision = decide(*case)
    assert (decision.layer is Layer.CLEAR) == (decision.guidance is None)
    if decision.guidance is None:
        return
    guidance = decision.guidance
    assert 0.0 <= guidance.course_rad < 2.0 * math.pi
    assert PARAMS.envelope.min_airspeed_mps <= guidance.airspeed_mps <= PARAMS.envelope.max_airspeed_mps
    assert 50.0 <= guidance.altitude_m <= 1500.0
    assert decision.threats
    assert all(math.isfinite(threat.distance_m) for threat in decision.threats)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(cases(), st.floats(-30_000.0, 30_000.0), st.floats(-30_000.0, 30_000.0))
def test_the_origin_of_the_frame_does_not_matter(
    case: tuple[Ownship, list[Track], Goal], north_m: float, east_m: float
) -> None:
    own, tracks, goal = case

    def shifted(place: Vec3) -> Vec3:
        return (place[0] + north_m, place[1] + east_m, place[2])

    first = decide(own, tracks, goal)
    second = decide(
        Ownship(0.0, shifted(own.position_m), own.velocity_mps, own.airspeed_mps, own.heading_rad),
        [Track(t.track_id, t.time_s, shifted(t.position_m), t.velocity_mps) for t in tracks],
        goal,
    )
    assert first.layer is second.layer
    assert len(first.threats) == len(second.threats)


@given(st.floats(-89.0, 89.0), st.floats(-180.0, 179.999), lengths, lengths)
def test_the_local_frame_converts_there_and_back(
    lat: float, lon: float, north_m: float, east_m: float
) -> None:
    frame = LocalFrame(lat, lon)
    back = frame.to_ned_m(frame.to_geo(north_m, east_m, -100.0))
    assert np.allclose(back, (north_m, east_m, -100.0), atol=1e-4)


def test_north_and_east_have_the_lengths_of_the_ellipsoid() -> None:
    north_m, east_m, _ = LocalFrame(47.0, 8.0).to_ned_m(GeoPoint(47.01, 8.01, 0.0))
    assert math.isclose(north_m, 1111.8, rel_tol=2e-4)
    assert math.isclose(east_m, 760.6, rel_tol=2e-4)
