"""No take-over on the ground, below the minimum height, during take-off and landing, on both autopilots."""

from dataclasses import replace

import pytest

from companion.control.state_machine import State, SupervisorParams
from companion.engine import EngineConfig
from sim.scenario import Autopilot, Scenario, Start, load_scenario
from sim.vehicle import MissionItem, waypoint_item
from sim.vehicle.mission import NAV_LAND
from tests.support.autopilots import every
from tests.support.monitored_loop import MonitoredLoop, without_traffic


def on_the_runway(takeoff_height_m: float) -> Scenario:
    scenario = without_traffic("two-intruders", duration_s=200.0)
    mission = replace(scenario.mission, takeoff_height_m=takeoff_height_m)
    return replace(scenario, mission=mission, start=Start("ground"))


@every
def test_no_commands_while_disarmed_on_the_ground(autopilot: Autopilot) -> None:
    loop = MonitoredLoop(on_the_runway(60.0), autopilot=autopilot)
    loop.world.vehicle.flight.disarm(force=True)
    loop.run(2.5)
    loop.intrude(600.0, speed_mps=20.0)
    loop.run(10.0)
    assert loop.sent == []


@every
def test_no_commands_during_the_missions_take_off(autopilot: Autopilot) -> None:
    """The take-off ends far above the minimum height; a take-over is allowed after it."""
    loop = MonitoredLoop(on_the_runway(90.0), autopilot=autopilot)
    vehicle = loop.world.vehicle
    loop.run(4.0)
    loop.intrude(2500.0, speed_mps=30.0, above_m=200.0)
    first = vehicle.first_item
    loop.until_true(lambda: vehicle.truth.place.altitude_m > 584.1 + 60.0, limit_s=30.0)
    loop.until_true(lambda: vehicle.truth.mission_sequence > first, limit_s=30.0)
    assert loop.sent == []
    loop.until(State.ENGAGING, limit_s=15.0)


@every
def test_no_commands_below_the_minimum_height(autopilot: Autopilot) -> None:
    config = EngineConfig(supervisor=SupervisorParams(min_height_m=310.0))
    loop = MonitoredLoop(without_traffic(), autopilot=autopilot, config=config)
    loop.run(2.5)
    loop.intrude(3000.0)
    loop.run(10.0)
    assert loop.state is State.STANDBY
    assert loop.sent == []


@every
def test_no_commands_during_the_missions_landing(autopilot: Autopilot) -> None:
    scenario = without_traffic(duration_s=100.0)
    loop = MonitoredLoop(scenario, autopilot=autopilot)
    vehicle = loop.world.vehicle
    runway = scenario.place(5000.0, 0.0, 0.0)
    place = round(runway.lat_deg * 1e7), round(runway.lon_deg * 1e7)
    landing = MissionItem(NAV_LAND, lat_e7=place[0], lon_e7=place[1])
    ahead = waypoint_item(scenario.place(300.0, 0.0, 300.0))
    home = [ahead] * vehicle.first_item  # ArduPlane's item 0
    vehicle.flight.load_mission([*home, ahead, landing])
    loop.until_true(lambda: vehicle.flight.landing, limit_s=30.0)
    loop.run(2.0)
    loop.intrude(3000.0, above_m=-40.0)
    loop.run(12.0)
    assert vehicle.truth.place.altitude_m > 584.1 + 100.0, "above the minimum height"
    assert loop.sent == []


@every
@pytest.mark.parametrize(
    "vtol_state", [1, 2, 3], ids=["transition to wing", "transition to rotors", "rotors"]
)
def test_a_vtol_on_its_rotors_is_advised_only(autopilot: Autopilot, vtol_state: int) -> None:
    loop = MonitoredLoop(without_traffic(), autopilot=autopilot)
    loop.world.vehicle.show_vtol_state(vtol_state)
    loop.run(2.5)
    loop.intrude(3000.0)
    loop.run(8.0)
    assert loop.sent == []
    assert any(text.startswith("Advise ") for text in loop.flight.texts)


@every
def test_a_vtol_in_wing_flight_is_flown_until_it_leaves_that(autopilot: Autopilot) -> None:
    loop = MonitoredLoop(without_traffic(), autopilot=autopilot)
    loop.world.vehicle.show_vtol_state(4)
    loop.run(2.5)
    loop.intrude(3000.0)
    loop.until(State.OUTER, limit_s=10.0)
    loop.world.vehicle.show_vtol_state(2)
    loop.until(State.HANDS_OFF, limit_s=2.0)
    loop.run(4.0)
    assert loop.sent_since(State.HANDS_OFF) == []


@pytest.mark.parametrize(
    ("autopilot", "mode"),
    [("ardupilot", "TAKEOFF"), ("ardupilot", "RTL"), ("px4", "TAKEOFF"), ("px4", "LAND"), ("px4", "RETURN")],
)
def test_no_commands_in_take_off_landing_and_return_modes(autopilot: Autopilot, mode: str) -> None:
    high = {"ardupilot": {"TKOFF_ALT": 500.0}, "px4": {"MIS_TAKEOFF_ALT": 500.0}}
    loop = MonitoredLoop(without_traffic(), autopilot=autopilot, parameters=high[autopilot])
    loop.world.vehicle.set_mode(mode)
    loop.run(2.5)
    loop.intrude(3000.0)
    loop.run(8.0)
    assert loop.mode_name == mode
    assert loop.sent == []


def test_no_commands_during_a_take_off_even_if_its_mode_is_allowed() -> None:
    """TAKEOFF is configured as a mode to take over from."""
    scenario = replace(load_scenario("two-intruders"), intruders=())
    config = EngineConfig(supervisor=SupervisorParams(take_over_from=("TAKEOFF",)))
    loop = MonitoredLoop(scenario, config=config)
    loop.world.vehicle.parameters.record("TKOFF_ALT", 120.0)
    loop.world.vehicle.flight.apply_parameters()
    loop.world.vehicle.set_mode("TAKEOFF")
    loop.run(4.0)
    loop.intrude(2500.0, speed_mps=30.0, above_m=120.0)
    vehicle = loop.world.vehicle
    loop.until_true(lambda: vehicle.truth.place.altitude_m > 584.1 + 100.0, limit_s=40.0)
    assert vehicle.flight.taking_off
    assert loop.sent == []
