"""Senses: which ways are against the passing of a stranger that may avoid too."""

import math
from dataclasses import dataclass

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from companion.avoidance import AvoidanceParams
from companion.avoidance.assess import assess_traffic, protected_tracks
from companion.avoidance.intruders import TransitionDomain
from companion.avoidance.mission_path import OwnFlight
from companion.avoidance.policies import policy_of
from companion.avoidance.senses import NO_WRONG_WAYS, Passing, Senses, WrongWays, passing_of, sense_above
from companion.avoidance.trajectory import OwnState
from companion.model import Goal, Ownship, Track, TrafficKind, Vec3

PARAMS = AvoidanceParams()
BAND_M, BAND_ASIDE_M = 0.4 * 76.2 * 1.25, 0.25 * 609.6 * 1.15


@dataclass(frozen=True)
class Aircraft:
    """One of two aircraft that hear each other."""

    position_m: Vec3
    velocity_mps: Vec3
    icao: int | None = None

    def state(self) -> OwnState:
        """As it knows itself."""
        north_mps, east_mps, down_mps = self.velocity_mps
        course_rad, speed_mps = math.atan2(east_mps, north_mps), math.hypot(north_mps, east_mps)
        return OwnState(self.position_m, course_rad, speed_mps, -down_mps, (0.0, 0.0))

    def track(self, **changes: object) -> Track:
        """As the other hears it."""
        values = {"icao": self.icao, **changes}
        return Track("other", 0.0, self.position_m, self.velocity_mps, **values)  # type: ignore[arg-type]

    def seen_from(self, off_m: Vec3, off_mps: Vec3) -> "Aircraft":
        """With errors of position and velocity."""
        position_m = tuple(a + b for a, b in zip(self.position_m, off_m, strict=True))
        velocity_mps = tuple(a + b for a, b in zip(self.velocity_mps, off_mps, strict=True))
        return Aircraft(position_m, velocity_mps, self.icao)  # type: ignore[arg-type]


def wrong_ways(own: Aircraft, *tracks: Track, senses: Senses | None = None, now_s: float = 0.0) -> WrongWays:
    """The wrong ways of one aircraft, all tracks taken as conflicts."""
    if senses is None:
        senses = Senses()
        senses.own_icao = own.icao
    north_mps, east_mps, _ = own.velocity_mps
    speed_mps, course_rad = math.hypot(north_mps, east_mps), math.atan2(east_mps, north_mps)
    ownship = Ownship(0.0, own.position_m, own.velocity_mps, speed_mps, course_rad)
    flight = OwnFlight.at(0.0, ownship, Goal(course_rad=course_rad, airspeed_mps=speed_mps))
    assessment = assess_traffic(
        flight,
        protected_tracks(0.0, tracks, PARAMS),
        PARAMS,
        PARAMS.envelope,
        policy_of(PARAMS),
        TransitionDomain(0.0),
    )
    every = assessment._replace(conflict=assessment.surface_m < math.inf)
    return senses.wrong_ways(now_s, flight.state, tracks, every)


def both(one: Aircraft, other: Aircraft) -> tuple[WrongWays, WrongWays]:
    """The wrong ways of each of two aircraft."""
    return wrong_ways(one, other.track()), wrong_ways(other, one.track())


HIGH, LOW = 0xA00002, 0xA00001
NORTHBOUND = Aircraft((0.0, 0.0, -300.0), (25.0, 0.0, 0.0), LOW)
HEAD_ON = Aircraft((2000.0, 0.0, -300.0), (-25.0, 0.0, 0.0), HIGH)
FROM_THE_RIGHT = Aircraft((1000.0, 1000.0, -300.0), (0.0, -25.0, 0.0), HIGH)
SLOW_AHEAD = Aircraft((1500.0, 0.0, -300.0), (14.0, 0.0, 0.0), HIGH)


def test_head_on_both_turn_right() -> None:
    one, other = both(NORTHBOUND, HEAD_ON)
    assert one.left
    assert other.left
    assert not one.right
    assert not other.right


def test_in_a_crossing_the_one_with_the_other_on_its_right_passes_behind_it() -> None:
    one, other = both(NORTHBOUND, FROM_THE_RIGHT)
    assert one.left
    assert not one.right, "a turn to the right leads behind it"
    assert other.left, "a turn to the left would lead towards the first"
    assert not other.right


def test_the_overtaking_aircraft_passes_on_the_right_and_the_other_moves_left() -> None:
    overtaking, overtaken = both(NORTHBOUND, SLOW_AHEAD)
    assert overtaking.left
    assert not overtaking.right
    assert overtaken.right
    assert not overtaken.left


def test_with_room_on_the_other_side_both_turn_left() -> None:
    beside = Aircraft((2000.0, 400.0, -300.0), (-25.0, 0.0, 0.0), HIGH)
    for ways in both(NORTHBOUND, beside):
        assert ways.right
        assert not ways.left


@pytest.mark.parametrize(
    ("above_m", "up"), [(0.0, True), (30.0, True), (-30.0, True), (45.0, True), (-45.0, False)]
)
def test_the_smaller_address_passes_above_unless_it_is_clearly_lower(above_m: float, up: bool) -> None:
    one, other = both(NORTHBOUND.seen_from((0.0, 0.0, -above_m), (0.0, 0.0, 0.0)), HEAD_ON)
    assert (one.down, one.up) == (up, not up)
    assert (other.down, other.up) == (not up, up)


@pytest.mark.parametrize("icao", [None, LOW])
def test_without_two_addresses_equal_heights_have_no_sense(icao: int | None) -> None:
    nameless = Aircraft(HEAD_ON.position_m, HEAD_ON.velocity_mps, icao)
    ways = wrong_ways(NORTHBOUND, nameless.track())
    assert not ways.up
    assert not ways.down
    higher = nameless.seen_from((0.0, 0.0, -45.0), (0.0, 0.0, 0.0))
    assert wrong_ways(NORTHBOUND, higher.track()).up


def test_our_own_address_unknown_leaves_the_geometry() -> None:
    unknown = Aircraft(NORTHBOUND.position_m, NORTHBOUND.velocity_mps)
    assert wrong_ways(unknown, HEAD_ON.track()) == WrongWays(left=True)


def test_an_intruder_that_climbs_is_passed_below() -> None:
    climbing = Aircraft(HEAD_ON.position_m, (-25.0, 0.0, -2.5), HIGH)
    one, other = both(NORTHBOUND, climbing)
    assert one.up
    assert other.down


def test_an_uncertain_height_widens_the_band() -> None:
    lower = NORTHBOUND.seen_from((0.0, 0.0, 50.0), (0.0, 0.0, 0.0))
    assert wrong_ways(lower, HEAD_ON.track()).up
    assert wrong_ways(lower, HEAD_ON.track(vertical_uncertainty_m=60.0)).down


def test_obstacles_have_no_sense() -> None:
    assert wrong_ways(NORTHBOUND, HEAD_ON.track(kind=TrafficKind.OBSTACLE)) == NO_WRONG_WAYS


def test_between_two_intruders_of_opposite_senses_both_ways_are_wrong() -> None:
    above = Track("above", 0.0, (2000.0, 0.0, -360.0), (-25.0, 0.0, 0.0))
    below = Track("below", 0.0, (2100.0, 0.0, -240.0), (-25.0, 0.0, 0.0))
    ways = wrong_ways(NORTHBOUND, above, below)
    assert ways.up
    assert ways.down


def test_a_sense_is_kept_until_the_passing_clearly_develops_the_other_way() -> None:
    senses = Senses()
    higher = HEAD_ON.seen_from((0.0, 0.0, -45.0), (0.0, 0.0, 0.0))
    assert wrong_ways(NORTHBOUND, higher.track(), senses=senses).up
    level = HEAD_ON.seen_from((0.0, 0.0, 45.0), (0.0, 0.0, 0.0))
    assert wrong_ways(NORTHBOUND, level.track(), senses=senses).up
    lower = HEAD_ON.seen_from((0.0, 0.0, 70.0), (0.0, 0.0, 0.0))
    assert wrong_ways(NORTHBOUND, lower.track(), senses=senses).down


def test_a_sense_is_remembered_for_a_minute_after_the_conflict() -> None:
    senses = Senses()
    higher = HEAD_ON.seen_from((0.0, 0.0, -45.0), (0.0, 0.0, 0.0))
    assert wrong_ways(NORTHBOUND, higher.track(), senses=senses).up
    assert wrong_ways(NORTHBOUND, HEAD_ON.track(), senses=senses, now_s=59.0).up
    assert wrong_ways(NORTHBOUND, HEAD_ON.track(), senses=senses, now_s=120.0) == WrongWays(left=True)
    assert wrong_ways(NORTHBOUND, higher.track(), senses=senses, now_s=121.0).up
    assert wrong_ways(NORTHBOUND, HEAD_ON.track(), senses=senses, now_s=3.0) == WrongWays(left=True)


def test_of_two_that_climb_together_the_larger_address_reverses_once() -> None:
    together = Passing(5.0, 0.0, -1.0, (2.5, 2.5))
    assert sense_above(together, 1, BAND_M, 1) == 1
    assert sense_above(together, -1, BAND_M, 1) == -1
    assert sense_above(together, -1, BAND_M, -1) == -1
    sinking = Passing(5.0, 0.0, -1.0, (-2.5, -2.5))
    assert sense_above(sinking, -1, BAND_M, -1) == 1
    assert sense_above(sinking, -1, BAND_M, 1) == 1


places = st.tuples(st.floats(-3000, 3000), st.floats(-3000, 3000), st.floats(-500, -100))
motions = st.tuples(st.floats(-50, 50), st.floats(-50, 50), st.floats(-3, 3))
noises_m = st.tuples(st.floats(-20, 20), st.floats(-20, 20), st.floats(-5, 5))
noises_mps = st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.floats(-0.2, 0.2))
addresses = st.one_of(st.none(), st.integers(1, 0xFFFFFF))


@given(places, motions, motions, addresses, addresses, noises_m, noises_mps)
def test_the_senses_of_two_are_complementary(
    place_m: Vec3,
    one_mps: Vec3,
    other_mps: Vec3,
    one_icao: int | None,
    other_icao: int | None,
    off_m: Vec3,
    off_mps: Vec3,
) -> None:
    """Whatever the geometry, each side being in error about the other, away from the edges of the rule."""
    assume(min(math.hypot(*one_mps[:2]), math.hypot(*other_mps[:2])) > 10.0)
    assume(math.hypot(one_mps[0] - other_mps[0], one_mps[1] - other_mps[1]) > 10.0)
    assume(one_icao is None or one_icao != other_icao)
    one = Aircraft((0.0, 0.0, -300.0), one_mps, one_icao)
    other = Aircraft(place_m, other_mps, other_icao)
    heard, heard_of_us = other.seen_from(off_m, off_mps), one.seen_from(off_m, off_mps)
    ours = passing_of(one.state(), heard.position_m, heard.velocity_mps)
    theirs = passing_of(other.state(), heard_of_us.position_m, heard_of_us.velocity_mps)
    wrong, their_wrong = wrong_ways(one, heard.track()), wrong_ways(other, heard_of_us.track())

    noise_m = abs(ours.above_m + theirs.above_m) + 1e-3
    if min(abs(abs(ours.above_m) - BAND_M), abs(abs(theirs.above_m) - BAND_M)) > noise_m:
        assert wrong.up == their_wrong.down
        assert wrong.down == their_wrong.up
    aside_noise_m = abs(ours.aside_m - theirs.aside_m) + 1e-3
    if abs(ours.aside_m - BAND_ASIDE_M) > aside_noise_m:
        way, their_way = wrong.left - wrong.right, their_wrong.left - their_wrong.right
        # A turn away from the wrong side moves the passing to the same side as the other's turn.
        assert way * ours.turn_effect * their_way * theirs.turn_effect >= 0.0
