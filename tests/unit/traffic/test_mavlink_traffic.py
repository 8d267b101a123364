"""GLOBAL_POSITION_INT of other systems as traffic, through the engine."""

import math
from dataclasses import replace

import pytest

from companion.engine import Engine, EngineConfig, EngineParams
from companion.geodesy import LocalFrame
from companion.mavlink.facts import Heartbeat, OwnPosition, Sender
from companion.model import Track, TrafficKind

T0 = 1_700_000_000.0
OWN, OTHER = Sender(1, 1), Sender(7, 1)
COPTER, STATION, TRACKER, ROVER = 2, 6, 5, 10


def position(sender: Sender, time_s: float, *, north_m: float = 0.0, height_m: float = 300.0) -> OwnPosition:
    lat_deg = -35.0 + (north_m + 22.0 * (time_s - T0)) / 110_940.0
    return OwnPosition(
        sender, time_s - T0, lat_deg, 149.0, 584.0 + height_m, height_m, (22.0, 0.0, -1.5), 0.0
    )


def new_engine() -> Engine:
    engine = Engine(EngineConfig(engine=EngineParams(autopilot_system_id=1)))
    engine.receive(Heartbeat(OWN, 1, 3, True, 10, 4), T0)
    engine.receive(position(OWN, T0), T0)
    return engine


def tracks(engine: Engine) -> tuple[Track, ...]:
    engine.receive(position(OWN, T0 + 0.1), T0 + 0.1)
    engine.tick(T0 + 0.1)
    return engine.snapshot(T0 + 0.1).tracks


def test_another_system_is_traffic_with_its_velocity_in_north_east_down() -> None:
    engine = new_engine()
    engine.receive(Heartbeat(OTHER, COPTER, 3, True, 5, 4), T0)
    engine.receive(position(OTHER, T0, north_m=2000.0), T0)
    (track,) = tracks(engine)
    assert (track.track_id, track.icao, track.callsign) == ("SYS-7", None, "system 7")
    assert track.kind is TrafficKind.UAV
    assert track.position_m[0] == pytest.approx(2002.2, abs=5.0)
    assert track.position_m[2] == pytest.approx(-884.15)
    assert track.velocity_mps == pytest.approx((22.0, 0.0, -1.5))
    assert track.vertical_uncertainty_m == 0.0
    assert engine.foreign == 2


def test_another_system_needs_no_heartbeat() -> None:
    engine = new_engine()
    engine.receive(position(OTHER, T0, north_m=2000.0), T0)
    assert [track.kind for track in tracks(engine)] == [TrafficKind.UAV]


@pytest.mark.parametrize("component", [1, 2, 154, 196, 240])
def test_components_of_our_own_system_are_not_traffic(component: int) -> None:
    engine = new_engine()
    engine.receive(position(Sender(1, component), T0, north_m=2000.0), T0)
    assert tracks(engine) == ()


def test_other_systems_are_not_traffic_before_our_own_is_known() -> None:
    engine = Engine()
    engine.receive(position(OTHER, T0, north_m=2000.0), T0)
    assert engine.tracker.tracks(T0, LocalFrame(-35.0, 149.0)) == ()


@pytest.mark.parametrize(
    ("vehicle_type", "height_m", "speed_mps", "kinds"),
    [
        (COPTER, 0.5, 0.0, []),  # parked
        (COPTER, 1.0, 12.0, [TrafficKind.UAV]),  # taking off
        (COPTER, 40.0, 0.0, [TrafficKind.UAV]),  # hovering
        (STATION, 0.0, 0.0, []),
        (STATION, 0.0, 20.0, [TrafficKind.SURFACE_VEHICLE]),  # carried by car
        (STATION, 300.0, 30.0, [TrafficKind.UAV]),  # carried by aircraft
        (TRACKER, 0.0, 0.0, []),
        (ROVER, 0.0, 8.0, [TrafficKind.SURFACE_VEHICLE]),
        (ROVER, 30.0, 8.0, [TrafficKind.SURFACE_VEHICLE]),  # uphill
    ],
)
def test_systems_on_the_ground_are_surface_vehicles_or_not_traffic(
    vehicle_type: int, height_m: float, speed_mps: float, kinds: list[TrafficKind]
) -> None:
    engine = new_engine()
    autopilot = 8 if vehicle_type in (STATION, TRACKER) else 3
    engine.receive(Heartbeat(OTHER, vehicle_type, autopilot, False, 0, 4), T0)
    fact = replace(position(OTHER, T0, north_m=2000.0, height_m=height_m), velocity_mps=(speed_mps, 0.0, 0.0))
    engine.receive(fact, T0)
    assert [track.kind for track in tracks(engine)] == kinds


def test_a_gimbal_does_not_set_the_type_of_its_vehicle() -> None:
    engine = new_engine()
    engine.receive(Heartbeat(OTHER, ROVER, 3, True, 0, 4), T0)
    engine.receive(Heartbeat(Sender(7, 154), 26, 8, False, 0, 4), T0)
    engine.receive(position(OTHER, T0, north_m=2000.0, height_m=1.0), T0)
    assert [track.kind for track in tracks(engine)] == [TrafficKind.SURFACE_VEHICLE]


def test_another_system_on_a_collision_course_prompts_a_tick_and_is_avoided() -> None:
    engine, prompted = new_engine(), False
    for tick in range(40):
        now_s = T0 + tick / 10.0
        engine.receive(Heartbeat(OWN, 1, 3, True, 10, 4), now_s)
        engine.receive(position(OWN, now_s), now_s)
        ahead = position(OTHER, T0, north_m=1500.0 - 25.0 * (now_s - T0))
        prompted |= engine.receive(replace(ahead, velocity_mps=(-25.0, 0.0, 0.0)), now_s)
        engine.tick(now_s)
    assert prompted
    assert [threat.track_id for threat in engine.decision.threats] == ["SYS-7"]
    assert math.isfinite(engine.decision.threats[0].distance_m)
