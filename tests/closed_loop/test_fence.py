"""Fences in a closed loop: the aircraft stays inside, and well clear if the fence leaves room."""

import itertools
import math

import numpy as np
import pytest

from companion.avoidance import AvoidanceParams, Avoider, Envelope, Fence, Zone
from companion.avoidance.params import CostWeights, Layers
from companion.model import Goal, Guidance, Layer, Ownship, Track, Vec2
from sim.dynamics import FixedWing
from tests.support.encounter import ALTITUDE_M, Aircraft, fly, straight
from tests.support.thorough import pairs

FLAT = Envelope(min_altitude_m=ALTITUDE_M - 5.0, max_altitude_m=ALTITUDE_M + 5.0)


def box(north_m: Vec2, east_m: Vec2, *, inclusion: bool = True) -> Zone:
    (south, north), (west, east) = north_m, east_m
    return Zone(inclusion, ((south, west), (north, west), (north, east), (south, east)))


def corridor(width_m: float) -> Fence:
    return Fence((box((-500.0, 5500.0), (-0.5 * width_m, 0.5 * width_m)),))


@pytest.mark.parametrize(("width_m", "from_deg"), pairs([1500.0, 2400.0], [0, 60, 90, 180]))
def test_a_wide_corridor_is_kept_and_well_clear_too(width_m: float, from_deg: float) -> None:
    params = AvoidanceParams(envelope=FLAT)
    outcome = fly([straight(from_deg, 50.0)], params=params, fence=corridor(width_m))
    assert outcome.outside_m == 0.0
    assert outcome.well_clear >= 1.0
    assert outcome.arrived
    assert outcome.engagements == 1


@pytest.mark.parametrize("from_deg", [0, 180])
def test_in_a_narrow_corridor_it_climbs(from_deg: float) -> None:
    outcome = fly([straight(from_deg, 50.0)], fence=corridor(600.0))
    assert outcome.outside_m == 0.0
    assert outcome.well_clear >= 1.0
    assert outcome.arrived


@pytest.mark.parametrize(("width_m", "speed_mps"), pairs([500.0, 550.0], [40.0, 50.0]))
def test_a_turn_back_in_a_corridor_follows_the_predicted_side(width_m: float, speed_mps: float) -> None:
    """The reciprocal course is never commanded: one of its two turns would cross the fence."""
    params = AvoidanceParams(envelope=FLAT)
    outcome = fly([straight(0, speed_mps)], params=params, fence=corridor(width_m))
    assert outcome.outside_m == 0.0
    assert outcome.near_miss >= 0.98


@pytest.mark.parametrize(("width_m", "from_deg"), pairs([400.0, 600.0], [0, 180]))
def test_without_room_for_well_clear_a_near_miss_is_still_avoided(width_m: float, from_deg: float) -> None:
    """Head-on or overtaken in the middle of the corridor, at one height: half its width is available."""
    params = AvoidanceParams(envelope=FLAT)
    outcome = fly([straight(from_deg, 50.0)], params=params, fence=corridor(width_m))
    assert outcome.outside_m == 0.0
    assert outcome.near_miss >= 0.98, "the near-miss volume, less a few metres of tracking error"
    assert outcome.well_clear < 1.0


@pytest.mark.parametrize("from_deg", [0, 90])
def test_a_near_miss_is_worse_than_leaving_the_fence(from_deg: float) -> None:
    """In a corridor of 200 m two aircraft cannot pass at 152 m at one height."""
    params = AvoidanceParams(envelope=FLAT)
    outcome = fly([straight(from_deg, 50.0)], params=params, fence=corridor(200.0))
    assert outcome.near_miss >= 1.0
    if from_deg == 0:
        assert outcome.outside_m > 20.0


@pytest.mark.parametrize("from_deg", [0, 300])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_an_exclusion_on_one_side_leads_to_the_other(side: float, from_deg: float) -> None:
    edges = sorted((side * 100.0, side * 3000.0))
    fence = Fence((box((500.0, 4500.0), (edges[0], edges[1]), inclusion=False),))
    outcome = fly([straight(from_deg, 50.0)], params=AvoidanceParams(envelope=FLAT), fence=fence)
    assert outcome.outside_m == 0.0
    assert outcome.well_clear >= 1.0
    assert outcome.arrived


def test_a_box_with_head_on_traffic() -> None:
    outcome = fly(
        [straight(0.0, 60.0), straight(30.0, 45.0, meet_s=100.0)],
        fence=Fence((box((-400.0, 5400.0), (-900.0, 900.0)),)),
    )
    assert outcome.outside_m == 0.0
    assert outcome.well_clear >= 1.0
    assert outcome.arrived


@pytest.mark.parametrize("from_deg", [0, 72, 216])
def test_zones_with_heights_are_respected(from_deg: float) -> None:
    """A ceiling blocks the climb, and a tower one side."""
    zones = (
        Zone(True, centre_m=(2500.0, 0.0), radius_m=3300.0, max_altitude_m=ALTITUDE_M + 20.0),
        Zone(False, centre_m=(2000.0, 500.0), radius_m=350.0, max_altitude_m=ALTITUDE_M + 300.0),
    )
    params = AvoidanceParams(envelope=Envelope(min_altitude_m=ALTITUDE_M - 10.0))
    outcome = fly([straight(from_deg, 50.0)], params=params, fence=Fence(zones))
    assert outcome.outside_m == 0.0
    assert outcome.well_clear >= 1.0


@pytest.mark.parametrize("seed", range(6))
def test_a_polygon_is_not_left_in_random_traffic(seed: int) -> None:
    """Random concave fences around the path to the goal, random traffic, at one height."""
    chance = np.random.default_rng(seed)
    bearings = np.linspace(0.0, 2.0 * math.pi, 11, endpoint=False)
    stretch = np.array([3300.0, 1100.0]) * chance.uniform(0.85, 1.2, (11, 1))
    outline = np.array([2500.0, 0.0]) + stretch * np.column_stack([np.cos(bearings), np.sin(bearings)])
    fence = Fence((Zone(True, tuple((n, e) for n, e in outline.tolist())),))
    traffic = [
        straight(
            float(chance.uniform(0.0, 360.0)),
            float(chance.uniform(30.0, 70.0)),
            climb_mps=float(chance.uniform(-2.0, 2.0)),
            miss_m=float(chance.uniform(-300.0, 300.0)),
            meet_s=float(chance.uniform(60.0, 130.0)),
        )
        for _ in range(2)
    ]
    outcome = fly(traffic, params=AvoidanceParams(envelope=FLAT), fence=fence)
    assert outcome.outside_m == 0.0
    assert outcome.well_clear >= 0.95, "two intruders and the fence do not always leave full room"
    assert outcome.arrived


@pytest.mark.parametrize("east_m", [-1500.0, 1100.0])
def test_from_outside_it_returns(east_m: float) -> None:
    """The goal is inside, and there is traffic to avoid all the time."""
    aircraft = Aircraft(position_m=[0.0, east_m, -ALTITUDE_M])
    fence = Fence((box((-2000.0, 7000.0), (-1000.0, 1000.0)),))
    goal_course_rad = math.atan2(-east_m, 5000.0)
    avoider = Avoider(AvoidanceParams(envelope=FLAT))
    avoider.fence = fence
    outside_m = []
    for second in range(100):
        track = Track("T", second, (6000.0 - 40.0 * second, east_m, -ALTITUDE_M), (-40.0, 0.0, 0.0))
        goal = Goal(course_rad=goal_course_rad, airspeed_mps=22.0, altitude_m=ALTITUDE_M)
        decision = avoider.decide(second, aircraft.ownship(second), [track], goal)
        flown = decision.guidance
        for _ in range(10):
            if flown is None:
                aircraft.fly(goal_course_rad, 22.0, ALTITUDE_M, 0.1)
            else:
                aircraft.fly(flown.course_rad, flown.airspeed_mps, flown.altitude_m, 0.1)
        outside_m.append(float(fence.depth_m(np.array([aircraft.position_m]))[0]))
    assert outside_m[-1] == 0.0
    assert max(outside_m) <= outside_m[0] + 40.0


def test_far_outside_the_fence_well_clear_still_counts() -> None:
    """The inclusion is 20 km away, so every maneuver breaches it."""
    far = Fence((Zone(True, centre_m=(20_000.0, 0.0), radius_m=2000.0),))
    outcome = fly([straight(0.0, 50.0)], fence=far, seconds=150.0)
    assert outcome.well_clear >= 1.0


@pytest.mark.parametrize("layers", Layers)
def test_every_layer_respects_the_fence(layers: Layers) -> None:
    params = AvoidanceParams(envelope=FLAT, layers=layers)
    outcome = fly([straight(0.0, 50.0)], params=params, fence=corridor(2400.0))
    assert outcome.outside_m == 0.0
    assert outcome.near_miss > 1.0


@pytest.mark.parametrize(("course_deg", "side"), [*itertools.product((0.0, 90.0, 200.0), (-1.0, 1.0))])
def test_the_mirrored_exclusion_leads_to_the_other_side(course_deg: float, side: float) -> None:
    """An exclusion beside the path decides the side in a head-on encounter, on any course."""
    course_rad = math.radians(course_deg)
    ahead = np.array([math.cos(course_rad), math.sin(course_rad)])
    right = np.array([-ahead[1], ahead[0]])
    corners = [(100.0, 80.0), (100.0, 2500.0), (4000.0, 2500.0), (4000.0, 80.0)]
    outline = [tuple((a * ahead + side * r * right).tolist()) for a, r in corners]
    avoider = Avoider(AvoidanceParams(envelope=FLAT, weights=CostWeights(wrong_side=0.0)))
    avoider.fence = Fence((Zone(False, tuple(outline)),))
    place, velocity = 2000.0 * ahead, -50.0 * ahead
    own = Ownship(0.0, (0.0, 0.0, -300.0), (*(22.0 * ahead).tolist(), 0.0), 22.0, course_rad)
    track = Track("T", 0.0, (*place.tolist(), -300.0), (*velocity.tolist(), 0.0))
    decision = avoider.decide(0.0, own, [track], Goal(course_rad=course_rad, altitude_m=300.0))
    assert decision.layer is not Layer.CLEAR
    assert decision.guidance is not None
    turn_rad = math.remainder(decision.guidance.course_rad - course_rad, math.tau)
    assert math.copysign(1.0, turn_rad) == -side
    assert abs(turn_rad) > math.radians(5.0)


@pytest.mark.parametrize("from_deg", [0, 60])
def test_the_return_to_the_mission_respects_the_fence(from_deg: float) -> None:
    """Two walls with a gap on the path: after the avoidance the straight way back crosses a wall."""
    walls = (
        box((1200.0, 1500.0), (100.0, 3000.0), inclusion=False),
        box((1200.0, 1500.0), (-3000.0, -500.0), inclusion=False),
    )
    outcome = fly([straight(from_deg, 50.0)], params=AvoidanceParams(envelope=FLAT), fence=Fence(walls))
    assert outcome.outside_m == 0.0
    assert outcome.well_clear >= 1.0
    assert outcome.arrived
    assert outcome.engagements == 1


def test_a_mission_beyond_the_fence_is_released_after_a_while() -> None:
    """The goal lies outside the fence; the release must not wait without end."""
    fence = Fence((box((-500.0, 4000.0), (-2500.0, 2500.0)),))
    outcome = fly([straight(0.0, 50.0)], params=AvoidanceParams(envelope=FLAT), fence=fence, seconds=600.0)
    assert outcome.arrived
    assert outcome.engagements == 1


@pytest.mark.parametrize(
    ("wind", "from_deg"), pairs([(0.0, 13.0), (-13.0, 0.0), (13.0, 0.0), (9.0, -9.0)], [0, 180])
)
def test_wind_does_not_drift_it_out_of_the_fence(wind: Vec2, from_deg: float) -> None:
    """A fixed wing with its lags at one height, in known wind."""
    fence = corridor(1800.0)
    edge = Fence(fence.zones, margin_m=0.0)
    aircraft = FixedWing((0.0, 0.0, -ALTITUDE_M), wind_mps=wind)
    ground_mps = aircraft.ground_speed_mps
    intruder = straight(from_deg, 50.0, own_mps=ground_mps)
    avoider = Avoider(AvoidanceParams(envelope=FLAT))
    goal = Goal(course_rad=0.0, airspeed_mps=22.0, altitude_m=ALTITUDE_M)
    avoider.fence = fence
    closest, flown_s = math.inf, 0
    for second in range(round(min(5200.0 / ground_mps, 180.0))):
        at, velocity, heading_rad = aircraft.position_m, aircraft.velocity_mps, aircraft.heading_rad
        own = Ownship(second, at, velocity, aircraft.airspeed_mps, heading_rad, wind)
        guidance = avoider.decide(second, own, [Track("T", second, *intruder(second))], goal).guidance
        # Without guidance it returns to its line, as in a mission.
        wanted = guidance or Guidance(math.atan2(-at[1], 1500.0), 22.0, ALTITUDE_M)
        flown_s += guidance is not None
        aircraft.hold_course(wanted.course_rad, math.radians(30.0))
        aircraft.hold_airspeed(wanted.airspeed_mps)
        aircraft.hold_altitude(wanted.altitude_m)
        for _ in range(10):
            aircraft.step(0.1)
        closest = min(closest, math.dist(aircraft.position_m[:2], intruder(second + 1.0)[0][:2]))
        assert edge.depth_m(np.array([aircraft.position_m]))[0] == 0.0
    assert flown_s > 10
    assert closest > 609.6
