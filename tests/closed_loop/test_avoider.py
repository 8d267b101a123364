"""The avoider in a closed loop: one intruder from any side, level or climbing, is kept well clear."""

import itertools
import math
from dataclasses import replace

import pytest

from companion.avoidance import AvoidanceParams, Avoider, Envelope
from companion.model import Goal, Layer, Ownship, Track, TrafficKind
from tests.support.encounter import ALTITUDE_M, Traffic, fly, straight

SIDES_DEG = range(0, 360, 45)
SPEEDS_MPS = (30.0, 60.0, 90.0)


@pytest.mark.parametrize(("from_deg", "speed_mps"), [*itertools.product(SIDES_DEG, SPEEDS_MPS)])
def test_one_intruder_is_kept_well_clear(from_deg: float, speed_mps: float) -> None:
    intruder = straight(from_deg, speed_mps)
    assert fly([intruder], avoid=False, seconds=120.0).well_clear < 0.2, "without avoidance it is a conflict"
    outcome = fly([intruder])
    assert outcome.well_clear >= 1.0
    assert outcome.arrived
    assert outcome.engagements == 1
    assert outcome.changes <= 9, "an overtaken aircraft eases back to its course in small steps"


@pytest.mark.parametrize(
    ("from_deg", "climb_mps", "miss_m"),
    [(0, 4.0, 0.0), (60, -3.0, 150.0), (135, 3.0, 0.0), (300, -4.0, -200.0), (200, 2.0, 300.0)],
)
def test_one_climbing_or_sinking_intruder_is_kept_well_clear(
    from_deg: float, climb_mps: float, miss_m: float
) -> None:
    outcome = fly([straight(from_deg, 55.0, climb_mps=climb_mps, miss_m=miss_m)])
    assert outcome.well_clear >= 1.0


@pytest.mark.parametrize("from_deg", [0, 45, 90, 135, 225, 315])
def test_with_height_locked_the_intruder_is_passed_sideways(from_deg: float) -> None:
    envelope = Envelope(min_altitude_m=ALTITUDE_M - 5.0, max_altitude_m=ALTITUDE_M + 5.0)
    outcome = fly([straight(from_deg, 50.0)], params=AvoidanceParams(envelope=envelope))
    assert outcome.well_clear >= 1.0
    assert outcome.deviation_m > 300.0
    assert outcome.lowest_m >= ALTITUDE_M - 6.0
    assert outcome.highest_m <= ALTITUDE_M + 6.0


def test_the_mission_is_resumed_after_the_conflict() -> None:
    outcome = fly([straight(0.0, 60.0)])
    assert outcome.arrived
    assert outcome.decisions[-1].layer is Layer.CLEAR
    assert outcome.decisions[-1].guidance is None


def test_a_hovering_aircraft_in_the_way_is_passed() -> None:
    outcome = fly([straight(0.0, 0.0)])
    assert outcome.well_clear >= 1.0
    assert outcome.arrived


def test_two_intruders_from_both_sides_are_kept_well_clear() -> None:
    outcome = fly([straight(60.0, 55.0), straight(300.0, 55.0, meet_s=95.0)])
    assert outcome.well_clear >= 1.0


@pytest.mark.parametrize(
    "traffic",
    [
        straight(0.0, 60.0, miss_m=1500.0),
        straight(90.0, 60.0, miss_m=-1500.0),
        straight(180.0, 40.0, miss_m=1200.0),
    ],
)
def test_traffic_that_stays_clear_causes_no_avoidance(traffic: object) -> None:
    outcome = fly([traffic])  # type: ignore[list-item]
    assert outcome.engagements == 0
    assert outcome.deviation_m == 0.0


def test_fast_closure_begins_an_avoidance_earlier() -> None:
    fast, slow = fly([straight(0.0, 68.0)]), fly([straight(180.0, 42.0)])
    assert fast.first_s is not None
    assert slow.first_s is not None
    assert 90.0 - fast.first_s >= 50.0, "at 90 m/s of closure the outer layer reaches a minute ahead"
    assert fast.decisions[int(fast.first_s)].layer is Layer.OUTER


def test_a_threat_that_appears_near_is_resolved_by_the_inner_layer() -> None:
    decision = Avoider(AvoidanceParams()).decide(
        0.0,
        Ownship(0.0, (0.0, 0.0, -300.0), (22.0, 0.0, 0.0), 22.0, 0.0),
        [Track("A", 0.0, (1200.0, 0.0, -300.0), (-60.0, 0.0, 0.0))],
        Goal(course_rad=0.0, airspeed_mps=22.0, altitude_m=300.0),
    )
    assert decision.layer is Layer.INNER
    assert decision.guidance is not None
    assert decision.threats[0].track_id == "A"
    assert decision.threats[0].time_to_closest_s == pytest.approx(1200.0 / 82.0)


def test_a_mast_is_passed_beside_or_above_but_not_below() -> None:
    own = Ownship(0.0, (0.0, 0.0, -100.0), (22.0, 0.0, 0.0), 22.0, 0.0)
    mast = Track("M", 0.0, (900.0, 0.0, -180.0), (0.0, 0.0, 0.0), kind=TrafficKind.OBSTACLE)
    decision = Avoider(AvoidanceParams()).decide(
        0.0, own, [mast], Goal(course_rad=0.0, airspeed_mps=22.0, altitude_m=100.0)
    )
    assert decision.guidance is not None
    assert decision.guidance.altitude_m >= 180.0 or abs(decision.guidance.course_rad % math.tau) > 0.05


def test_a_vehicle_on_the_ground_is_ignored() -> None:
    own = Ownship(0.0, (0.0, 0.0, -30.0), (22.0, 0.0, 0.0), 22.0, 0.0)
    car = Track("C", 0.0, (200.0, 0.0, 0.0), (0.0, 0.0, 0.0), kind=TrafficKind.SURFACE_VEHICLE)
    goal = Goal(course_rad=0.0, airspeed_mps=22.0, altitude_m=30.0)
    assert Avoider(AvoidanceParams()).decide(0.0, own, [car], goal).layer is Layer.CLEAR


def test_the_floor_is_kept() -> None:
    envelope = Envelope(min_altitude_m=ALTITUDE_M - 20.0)
    intruder = straight(0.0, 60.0, climb_mps=2.0)
    outcome = fly([intruder], params=AvoidanceParams(envelope=envelope))
    assert outcome.lowest_m >= ALTITUDE_M - 21.0
    assert outcome.well_clear >= 1.0


def test_the_same_inputs_give_the_same_bits() -> None:
    first, second = (fly([straight(40.0, 70.0), straight(200.0, 50.0)]) for _ in range(2))
    assert first.decisions == second.decisions


def test_old_tracks_are_extrapolated() -> None:
    own = Ownship(10.0, (220.0, 0.0, -300.0), (22.0, 0.0, 0.0), 22.0, 0.0)
    goal = Goal(course_rad=0.0, airspeed_mps=22.0, altitude_m=300.0)
    now = Track("A", 10.0, (2400.0, 0.0, -300.0), (-60.0, 0.0, 0.0))
    old = replace(now, time_s=5.0, position_m=(2700.0, 0.0, -300.0))
    decisions = [Avoider(AvoidanceParams()).decide(10.0, own, [track], goal) for track in (now, old)]
    assert decisions[0].guidance == decisions[1].guidance


def test_an_inner_layer_beyond_the_outer_is_refused() -> None:
    with pytest.raises(ValueError, match="inner_time_s"):
        AvoidanceParams(inner_time_s=70.0, outer_time_s=60.0)


def turning(
    from_deg: float, speed_mps: float, turn_deg: float, *, begins_s: float, meet_s: float = 90.0
) -> Traffic:
    """An aircraft that would meet us, but turns at 3 degrees per second on its way."""
    course_rad, step_s, turned_rad = math.radians(from_deg) + math.pi, 0.5, 0.0
    north_m = 22.0 * meet_s - speed_mps * meet_s * math.cos(course_rad)
    east_m = -speed_mps * meet_s * math.sin(course_rad)
    flown = []
    for step in range(1200):
        velocity = (speed_mps * math.cos(course_rad), speed_mps * math.sin(course_rad), 0.0)
        flown.append(((north_m, east_m, -ALTITUDE_M), velocity))
        north_m, east_m = north_m + velocity[0] * step_s, east_m + velocity[1] * step_s
        if step * step_s >= begins_s and turned_rad < abs(math.radians(turn_deg)):
            turned_rad += math.radians(3.0) * step_s
            course_rad += math.copysign(math.radians(3.0) * step_s, turn_deg)

    def at(time_s: float) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        (north, east, down), (north_mps, east_mps, _) = flown[int(time_s / step_s)]
        since_s = time_s % step_s
        return (north + north_mps * since_s, east + east_mps * since_s, down), (north_mps, east_mps, 0.0)

    return at


@pytest.mark.parametrize("turn_deg", [30.0, -30.0])
@pytest.mark.parametrize("speed_mps", [20.0, 24.0])
def test_an_aircraft_that_turns_to_fly_beside_us_is_not_followed(speed_mps: float, turn_deg: float) -> None:
    """Staying clear beside an aircraft does not resolve a conflict if the mission lies behind it."""
    envelope = Envelope(min_altitude_m=ALTITUDE_M - 5.0, max_altitude_m=ALTITUDE_M + 5.0)
    outcome = fly(
        [turning(270.0, speed_mps, turn_deg, begins_s=40.0)],
        params=AvoidanceParams(envelope=envelope),
        seconds=500.0,
    )
    assert outcome.well_clear >= 1.0
    assert outcome.arrived
    assert sum(decision.layer is not Layer.CLEAR for decision in outcome.decisions) < 150
    assert outcome.deviation_m < 1500.0
