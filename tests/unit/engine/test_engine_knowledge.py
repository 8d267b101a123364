"""The engine uses the limits, mission, wind and terrain that the autopilot reports."""

import math
from dataclasses import replace

import pytest

from companion.airspace.fences import FenceZone
from companion.engine import Engine, EngineConfig, EngineParams
from companion.mavlink.dialect import Message
from companion.mavlink.facts import (
    AirData,
    AirspeedSensor,
    Fact,
    HeightAbove,
    MissionCount,
    MissionItem,
    MissionProgress,
    NavigationTarget,
    Parameter,
    Sender,
    TerrainReport,
    Wind,
)
from tests.unit.engine.test_engine import (
    AUTOPILOT,
    T0,
    fly,
    heartbeat,
    new_engine,
    of,
    position,
    run,
    traffic,
)

US = Sender(1, 196)


def test_the_envelope_follows_the_parameters_even_while_flying() -> None:
    """No value that the aircraft would refuse is commanded, even after a change in flight."""
    engine = new_engine()
    fly(engine, 3.0)
    now_s = T0 + 3.1
    facts: list[Fact] = [
        heartbeat(mode=15),
        position(now_s),
        AirspeedSensor(AUTOPILOT, True),
        AirData(AUTOPILOT, 22.0),
        Parameter(AUTOPILOT, "AIRSPEED_MAX", 20.0),
    ]
    sent = run(engine, facts, now_s)
    speeds = [m.param2 for m in of(sent, "COMMAND_INT") if m.command == 43000]
    assert engine.supervisor.flying
    assert speeds
    assert max(speeds) <= 20.0
    guidance = engine.decision.guidance
    assert guidance is not None
    assert guidance.airspeed_mps <= 20.0


def test_turns_are_commanded_with_the_bank_limit_of_the_prediction() -> None:
    banks = []
    for limit_deg in (25.0, 40.0):
        engine = new_engine()
        run(engine, [heartbeat(), Parameter(AUTOPILOT, "ROLL_LIMIT_DEG", limit_deg)], T0)
        fly(engine, 3.0)
        sent = run(engine, [heartbeat(mode=15), position(T0 + 3.1)], T0 + 3.1)
        (heading,) = [m for m in of(sent, "COMMAND_INT") if m.command == 43002]
        banks.append(math.degrees(math.atan(heading.param3 / 9.80665)))
    assert banks == [pytest.approx(25.0), pytest.approx(40.0)]


def test_the_floor_is_above_known_terrain() -> None:
    """A hill 250 m high under the aircraft, which flies 300 m above home."""
    floors = []
    for hill_m in (0.0, 250.0):
        engine = new_engine()
        here = position(T0)
        report = TerrainReport(AUTOPILOT, here.lat_deg, here.lon_deg, 584.0 + hill_m, 300.0 - hill_m)
        run(engine, [heartbeat(), here, report, traffic(T0)], T0)
        floors.append(engine.avoider.envelope.min_altitude_m)
    assert floors == [614.0, 864.0]


def test_limits_and_fence_are_made_again_only_when_what_they_are_made_from_changes() -> None:
    """Home's altitude varies by centimetres all the time."""
    zone = FenceZone(False, centre_deg=(-34.5, 149.0), radius_m=100.0, max_height_m=500.0)
    engine = Engine(EngineConfig(engine=EngineParams(autopilot_system_id=1), fences=(zone,)))
    home_m = (584.0, 584.3, 583.8, 587.0)
    made = []
    for tick, altitude_m in enumerate(home_m):
        now_s = T0 + tick / 10
        here = replace(position(now_s), altitude_m=altitude_m + 300.0)
        run(engine, [heartbeat(), here, traffic(now_s)], now_s)
        made.append((engine.avoider.fence, engine.avoider.envelope))
    (fence, envelope), *unchanged, (moved, raised) = made
    assert all(one is fence and other is envelope for one, other in unchanged)
    assert fence is not None
    assert moved is not None
    assert [one.zones[0].max_altitude_m for one in (fence, moved)] == [1084.0, 1087.0]
    assert [one.min_altitude_m for one in (envelope, raised)] == [614.0, 617.0]


def mission_item(sequence: int, command: int, lat_deg: float) -> MissionItem:
    nothing = (0.0, 0.0, 0.0, 0.0)
    home = HeightAbove.HOME
    return MissionItem(AUTOPILOT, US, 0, sequence, command, nothing, lat_deg, 149.0, 300.0, home)


def with_mission(engine: Engine, commands: list[int], current: int) -> None:
    """Let the engine read a mission of these commands, one hundredth of a degree apart."""
    items = [mission_item(at, command, -34.9 + at / 100) for at, command in enumerate(commands)]

    def answer(message: Message) -> list[Fact]:
        if message.get_type() == "MISSION_REQUEST_INT":
            return [items[message.seq]]
        mission_list = message.get_type() == "MISSION_REQUEST_LIST" and message.mission_type == 0
        return [MissionCount(AUTOPILOT, US, 0, len(items))] if mission_list else []

    facts: list[Fact] = []
    for tick in range(-400, 0):
        now_s = T0 + tick / 10
        facts += [heartbeat(), position(now_s), MissionProgress(AUTOPILOT, current)]
        sent, facts = run(engine, facts, now_s), []
        for message in sent:
            facts += answer(message)
    assert engine.queries.mission is not None


def test_the_goal_is_the_item_being_flown() -> None:
    engine = new_engine()
    with_mission(engine, [16, 22, 16, 16], 3)
    goal = engine.snapshot(T0).goal
    assert goal is not None
    assert goal.altitude_m == 884.0
    assert goal.position_m is not None
    assert goal.position_m[0] > 10_000.0


def test_a_target_off_the_mission_counts_and_the_mission_is_read_again() -> None:
    engine = new_engine()
    with_mission(engine, [16, 22, 16, 16], 3)
    sent = []
    for tick in range(70):
        now_s = T0 + tick / 10
        target = NavigationTarget(AUTOPILOT, -35.0, 149.1, 900.0)
        facts: list[Fact] = [heartbeat(), position(now_s), MissionProgress(AUTOPILOT, 3), target]
        sent += run(engine, facts, now_s)
    goal = engine.snapshot(T0).goal
    assert goal is not None
    assert goal.position_m is not None
    assert goal.position_m[1] > 8_000.0
    lists = [m for m in of(sent, "MISSION_REQUEST_LIST") if m.mission_type == 0]
    assert 1 <= len(lists) <= 2, "requested again, as there is no answer here"


@pytest.mark.parametrize(("current", "engages"), [(1, False), (2, True), (3, False), (4, False), (5, False)])
def test_no_take_over_while_taking_off_or_on_the_approach(current: int, engages: bool) -> None:
    engine = new_engine()
    with_mission(engine, [16, 22, 16, 189, 31, 21], current)
    sent = fly(engine, 4.0)
    assert bool([m for m in of(sent, "COMMAND_LONG") if m.command == 176]) == engages


def test_after_a_reboot_everything_is_requested_again() -> None:
    engine = new_engine()
    with_mission(engine, [16, 22, 16], 2)
    sent = []
    for tick in range(100):
        now_s = T0 + tick / 10
        sent += run(engine, [heartbeat(), replace(position(now_s), boot_time_s=tick / 10)], now_s)
    assert len([m for m in of(sent, "MISSION_REQUEST_LIST") if m.mission_type == 0]) >= 1
    assert "ROLL_LIMIT_DEG" in {m.param_id for m in of(sent, "PARAM_REQUEST_READ")}


def test_reported_wind_is_part_of_ownship() -> None:
    engine = new_engine()
    run(engine, [heartbeat(), AirData(AUTOPILOT, 22.0), position(T0), Wind(AUTOPILOT, 3.0, -4.0)], T0)
    own = engine.snapshot(T0).ownship
    assert own is not None
    assert own.wind_mps == (3.0, -4.0)
