"""The bound on changes of height counts from the mission's height, over any number of avoidances."""

from dataclasses import replace

import pytest

from companion.avoidance import AvoidanceParams, Avoider, Control, Envelope
from companion.engine import Engine, EngineConfig
from companion.model import Goal, Ownship, Track
from sim.closed_loop import ClosedLoop
from sim.scenario import Autopilot, Waypoint, load_scenario
from tests.support.autopilots import BOTH, in_turn
from tests.support.thorough import sample

MISSION_M = 300.0
BOUND_M = 100.0
OVERSHOOT_M = 8.0
# Aircraft that cross one after the other, and how long that is flown.
CROSSING = sample(5, 8)
LONG_S = 70.0 + 20.0 * CROSSING


@pytest.mark.parametrize("gives_back", [False, True], ids=["one avoidance", "given back in between"])
def test_a_series_of_crossing_aircraft_does_not_take_the_bound_along(gives_back: bool) -> None:
    """Each crosses at the height to which the one before it made us climb, and others cross below us."""
    params = AvoidanceParams(
        largest_height_change_m=BOUND_M,
        controls=frozenset({Control.HEIGHT}),
        envelope=Envelope(min_altitude_m=MISSION_M - 10.0),
    )
    avoider, altitude_m, now_s = Avoider(params), MISSION_M, 0.0
    goal = Goal(course_rad=0.0, airspeed_mps=22.0, altitude_m=MISSION_M)
    heights_m = []
    for _ in range(12):
        for _ in range(40):
            own = Ownship(now_s, (0.0, 0.0, -altitude_m), (22.0, 0.0, 0.0), 22.0, 0.0, (0.0, 0.0))
            tracks = [
                Track(f"{height_m}", now_s, (660.0, 1200.0, -height_m), (0.0, -40.0, 0.0))
                for height_m in {altitude_m, MISSION_M, 0.5 * (altitude_m + MISSION_M)}
            ]
            guidance = avoider.decide(now_s, own, tracks, goal).guidance
            assert guidance is not None
            heights_m.append(guidance.altitude_m)
            now_s += 1.0
        altitude_m = heights_m[-1]
        for _ in range(5 if gives_back else 0):
            own = Ownship(now_s, (0.0, 0.0, -altitude_m), (22.0, 0.0, 0.0), 22.0, 0.0, (0.0, 0.0))
            avoider.decide(now_s, own, [], goal)
            now_s += 1.0
    assert max(heights_m) > MISSION_M + 0.8 * BOUND_M
    assert max(heights_m) <= MISSION_M + BOUND_M
    assert min(heights_m) >= MISSION_M - BOUND_M


@in_turn("step_m", sample([90.0], [90.0, -90.0]), BOTH, first=1)
def test_a_series_of_crossing_aircraft_each_higher_or_lower(autopilot: Autopilot, step_m: float) -> None:
    head_on = load_scenario("head-on")
    (usual,) = head_on.intruders
    # In steps that are about as high as an avoidance climbs, 20 s apart.
    intruders = tuple(
        replace(
            usual,
            icao=f"A0000{number + 1}",
            callsign=f"X{number}",
            meet_at_s=50.0 + 20.0 * number,
            from_deg=90.0 * (-1) ** number,
            miss_height_m=step_m * number,
        )
        for number in range(CROSSING)
    )
    config = EngineConfig()
    config = replace(config, avoidance=replace(config.avoidance, largest_height_change_m=BOUND_M))
    far = replace(head_on.mission, waypoints=(Waypoint(9000.0, 0.0, 300.0),))
    scenario = replace(head_on, duration_s=LONG_S, intruders=intruders, mission=far)
    loop = ClosedLoop(scenario, Engine(config), autopilot=autopilot)
    heights_m: list[float] = []
    loop.run(LONG_S, on_step=lambda loop, _: heights_m.append(loop.world.vehicle.truth.place.altitude_m))
    level_m = heights_m[0]
    assert max(heights_m) <= level_m + BOUND_M + OVERSHOOT_M
    assert min(heights_m) >= level_m - BOUND_M - OVERSHOOT_M


def test_at_the_height_of_the_mission_to_the_millimetre_the_bound_is_the_same() -> None:
    """The mission leads from 300 to 400 m; at 400 m only a climb avoids the crossing aircraft."""
    params = AvoidanceParams(
        largest_height_change_m=BOUND_M,
        controls=frozenset({Control.HEIGHT}),
        envelope=Envelope(min_altitude_m=MISSION_M + BOUND_M - 5.0),
    )
    avoider, goal = Avoider(params), Goal(course_rad=0.0, airspeed_mps=22.0, altitude_m=MISSION_M + BOUND_M)
    guidance = None
    for now_s, altitude_m in ((0.0, MISSION_M), (1.0, MISSION_M + BOUND_M)):
        own = Ownship(now_s, (0.0, 0.0, -altitude_m), (22.0, 0.0, 0.0), 22.0, 0.0, (0.0, 0.0))
        place = (660.0, 1200.0, -altitude_m)
        tracks = [Track("A", now_s, place, (0.0, -40.0, 0.0))] if now_s else []
        guidance = avoider.decide(now_s, own, tracks, goal).guidance
    assert guidance is not None
    assert guidance.altitude_m > MISSION_M + 1.8 * BOUND_M
