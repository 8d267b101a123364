"""The bound on changes of height, for any series of tracks and any height of the aircraft within it."""

from dataclasses import replace

from hypothesis import given, settings
from hypothesis import strategies as st

from companion.avoidance import AvoidanceParams, Avoider, Envelope
from companion.avoidance.mission_path import HeightReference
from companion.model import Goal, Ownship, Track

MISSION_M, BOUND_M = 300.0, 100.0
PARAMS = replace(AvoidanceParams(), largest_height_change_m=BOUND_M)
GOAL = Goal(course_rad=0.0, airspeed_mps=22.0, altitude_m=MISSION_M)


@settings(max_examples=60, deadline=None)
@given(
    st.lists(
        st.tuples(
            st.floats(-400.0, 400.0),  # aside
            st.floats(-60.0, 60.0),  # above us
            st.floats(-5.0, 5.0),  # climbing
            st.booleans(),  # whether there is a track
        ),
        min_size=1,
        max_size=40,
    )
)
def test_heights_that_follow_the_guidance_stay_within_the_bound(
    series: list[tuple[float, float, float, bool]],
) -> None:
    """The aircraft goes straight to every commanded height, and stays there when it is given back."""
    avoider, altitude_m = Avoider(PARAMS), MISSION_M
    for step, (aside_m, above_m, climb_mps, is_there) in enumerate(series):
        now_s = 5.0 * step
        own = Ownship(now_s, (0.0, 0.0, -altitude_m), (22.0, 0.0, 0.0), 22.0, 0.0, (0.0, 0.0))
        place = (1000.0, aside_m, -altitude_m - above_m)
        tracks = [Track("A", now_s, place, (-40.0, 0.0, -climb_mps))] if is_there else []
        guidance = avoider.decide(now_s, own, tracks, GOAL).guidance
        if guidance is not None:
            assert MISSION_M - BOUND_M <= guidance.altitude_m <= MISSION_M + BOUND_M
            altitude_m = guidance.altitude_m


@settings(deadline=None)
@given(st.lists(st.floats(-1.0, 1.0), min_size=1, max_size=60), st.floats(10.0, 500.0))
def test_a_mission_without_a_height_of_its_own_does_not_take_the_bound_along(
    moves: list[float], change_m: float
) -> None:
    """Whatever heights within the limits are flown, avoiding or not, the limits stay."""
    reference, envelope, own_m = HeightReference(), Envelope(), 1000.0
    for step, move in enumerate(moves):
        reference.update(20.0 * step, own_m, None, change_m, avoiding=step % 2 == 0)
        limited = reference.limit(envelope, None, change_m)
        assert limited.min_altitude_m == 1000.0 - change_m
        assert limited.max_altitude_m == 1000.0 + change_m
        own_m = 1000.0 + move * change_m


@settings(deadline=None)
@given(st.floats(-500.0, 3000.0), st.floats(-500.0, 3000.0), st.floats(1.0, 500.0), st.floats(-200.0, 3000.0))
def test_the_ground_outranks_the_bound_and_a_ceiling_holds(
    own_m: float, mission_m: float, change_m: float, floor_m: float
) -> None:
    reference = HeightReference()
    reference.update(0.0, own_m, mission_m, change_m, avoiding=False)
    envelope = Envelope(min_altitude_m=floor_m, max_altitude_m=floor_m + 500.0)
    limited = reference.limit(envelope, mission_m, change_m)
    assert limited.min_altitude_m is not None
    assert limited.max_altitude_m is not None
    assert floor_m <= limited.min_altitude_m <= limited.max_altitude_m <= floor_m + 500.0


def test_the_reference_follows_a_climbing_mission_and_an_aircraft_flown_elsewhere() -> None:
    reference, envelope = HeightReference(), Envelope()
    for own_m in range(300, 801, 50):
        reference.update(0.0, float(own_m), 800.0, 100.0, avoiding=False)
    reference.update(0.0, 750.0, 300.0, 100.0, avoiding=False)
    limited = reference.limit(envelope, 300.0, 100.0)
    assert (limited.min_altitude_m, limited.max_altitude_m) == (200.0, 850.0), "on its way down"
    reference.update(0.0, 300.0, 300.0, 100.0, avoiding=False)
    reference.update(0.0, 1500.0, 300.0, 100.0, avoiding=False)
    assert reference.limit(envelope, 300.0, 100.0).max_altitude_m == 1600.0, "a pilot flew it there"


def test_without_a_height_of_the_mission_the_bound_follows_only_a_while_after_an_avoidance() -> None:
    reference, envelope = HeightReference(), Envelope()
    reference.update(0.0, 300.0, None, 100.0, avoiding=False)
    reference.update(10.0, 380.0, None, 100.0, avoiding=False)
    assert reference.limit(envelope, None, 100.0).max_altitude_m == 480.0, "before any avoidance"
    reference.update(20.0, 400.0, None, 100.0, avoiding=True)
    for now_s in (21.0, 50.0, 80.0):
        reference.update(now_s, 470.0, None, 100.0, avoiding=False)
        assert reference.limit(envelope, None, 100.0).max_altitude_m == 480.0, "another may follow"
    reference.update(81.0, 470.0, None, 100.0, avoiding=False)
    assert reference.limit(envelope, None, 100.0).max_altitude_m == 570.0, "that height is flown now"
