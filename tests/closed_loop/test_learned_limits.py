"""Limits and mission that the engine reads from the autopilot, and their effect."""

import json
import math

import pytest

from companion.control.state_machine import State
from companion.engine import Effect, Engine, Transmit
from companion.mavlink.dialect import Message, mavlink
from sim.closed_loop import ClosedLoop
from sim.scenario import load_scenario
from tests.support.monitored_loop import MonitoredLoop


def flown_with(**parameters: float) -> ClosedLoop:
    """The head-on scenario with changed vehicle parameters, ten seconds after the start."""
    loop = ClosedLoop(load_scenario("head-on"), Engine())
    for name, value in parameters.items():
        loop.world.vehicle.parameters.set(name, value)
    loop.world.vehicle.flight.apply_parameters()
    loop.run(10.0)
    return loop


def test_limits_and_mission_are_read_from_the_vehicle() -> None:
    loop = flown_with(ROLL_LIMIT_DEG=40.0, TECS_CLMB_MAX=3.0, AIRSPEED_MAX=26.0)
    assert loop.engine is not None
    envelope = loop.engine.queries.limits.envelope
    assert math.degrees(envelope.max_bank_rad) == pytest.approx(40.0)
    assert envelope.max_climb_mps == pytest.approx(2.7)
    assert envelope.max_sink_mps == pytest.approx(4.5)
    assert envelope.max_airspeed_mps == 26.0
    assert envelope.min_airspeed_mps == pytest.approx(10.0 / math.sqrt(math.cos(math.radians(40.0))))
    mission = loop.engine.queries.mission
    assert mission is not None
    assert len(mission.items) == len(loop.world.vehicle.flight.mission.items)


def test_the_predicted_climb_is_the_flown_one() -> None:
    """With a tenth of its climb rate the aircraft turns instead of climbing."""
    loop = flown_with(TECS_CLMB_MAX=0.5, TECS_SINK_MAX=0.5)
    flight = loop.run(100.0)
    (encounter,) = flight.score.encounters.values()
    assert flight.engagements == 1
    assert not encounter.lowc
    assert encounter.min_horizontal_m > 600.0, "horizontally, not above"


@pytest.mark.parametrize(("minor", "climbs"), [(16, False), (17, True)])
def test_px4_versions_with_invalid_setpoints_in_climbs_turn(minor: int, climbs: bool) -> None:
    """An override or a crash of the companion must not happen in a climb if a turn suffices."""
    loop = MonitoredLoop(autopilot="px4")

    def of_that_version(message: Message) -> Message:
        if message.get_type() == "AUTOPILOT_VERSION":
            message.flight_sw_version = 1 << 24 | minor << 16 | 255
        return message

    loop.alter = of_that_version
    level_m, furthest_m = loop.world.vehicle.truth.position_m[2], 0.0
    loop.until(State.OUTER)
    while loop.state is not State.MONITOR:
        loop.step()
        furthest_m = max(furthest_m, abs(loop.world.vehicle.truth.position_m[2] - level_m))
    assert (furthest_m > 50.0) is climbs
    (encounter,) = loop.flight.score.encounters.values()
    assert not encounter.lowc


class Speeds(ClosedLoop):
    """Records the commanded airspeeds, with the limit at that time."""

    commanded: list[tuple[float, float]]

    def _perform(self, time_us: int, effects: object) -> None:
        for effect in effects:  # type: ignore[attr-defined]
            self._note(effect)
        super()._perform(time_us, effects)  # type: ignore[arg-type]

    def _note(self, effect: Effect) -> None:
        if isinstance(effect, Transmit) and getattr(effect.message, "command", None) == 43000:
            fastest = self.world.vehicle.parameters["AIRSPEED_MAX"]
            self.commanded.append((effect.message.param2, fastest))


def test_no_speed_beyond_the_limits_even_if_they_change_in_flight() -> None:
    loop = Speeds(load_scenario("overtaken"), Engine())
    loop.commanded = []
    for second in range(62):
        if second == 50:
            lower = mavlink.MAVLink_param_set_message(1, 1, b"AIRSPEED_MAX", 18.0, 9)
            lower.get_header().srcSystem = 255
            loop.world.vehicle.receive(lower, loop.world.vehicle.time_s, 1)
        loop.run(1.0)
    after = [speed for speed, fastest in loop.commanded if fastest == 18.0]
    assert after
    assert max(after) <= 18.0
    guided = [json.loads(line)["guidance"] for line in loop.flight.decisions]
    assert any(guidance is not None for guidance in guided)
