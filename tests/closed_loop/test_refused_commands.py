"""Commands that the autopilot refuses: moderated retry, another maneuver, and a text to the operator."""

from dataclasses import replace
from itertools import pairwise

import pytest

from companion.avoidance import AvoidanceParams, Control
from companion.control.state_machine import State
from companion.engine import EngineConfig, Transmit
from companion.mavlink.dialect import mavlink
from sim.closed_loop import Flight
from sim.scenario import Autopilot, Scenario
from tests.support.autopilots import MISSION_MODE, both
from tests.support.monitored_loop import DO_SET_MODE, SOON, MonitoredLoop

SPEED, HEIGHT, HEADING = 43000, 43001, 43002
DENIED, FAILED = 2, 4
NAMES = {SPEED: "GUIDED_CHANGE_SPEED", HEIGHT: "GUIDED_CHANGE_ALTITUDE", HEADING: "GUIDED_CHANGE_HEADING"}

# A slow aircraft ahead is passed with changes of speed too, where the height stays.
SLOW = replace(
    SOON, intruders=tuple(replace(c, from_deg=160.0, speed_mps=21.0, meet_at_s=90.0) for c in SOON.intruders)
)
LEVEL = EngineConfig(avoidance=AvoidanceParams(controls=frozenset({Control.HEADING, Control.SPEED})))


class Refusing(MonitoredLoop):
    """Also records the commanded values, by command."""

    def __init__(self, *commands: int, scenario: Scenario = SOON, config: EngineConfig | None = None) -> None:
        self.commanded: dict[int, list[float]] = {command: [] for command in NAMES}
        super().__init__(scenario, config=config)
        for command in commands:
            self.world.vehicle.refuse(command, DENIED)

    def _transmit(self, time_us: int, effect: Transmit) -> None:
        message = effect.message
        if getattr(message, "command", None) in NAMES:
            value = message.z if message.command == HEIGHT else message.param2
            self.commanded[message.command].append(value)
        super()._transmit(time_us, effect)


def clear(flight: Flight) -> bool:
    return not any(e.nmac or e.lowc for e in flight.score.encounters.values())


@pytest.mark.parametrize(
    ("command", "scenario", "config"), [(SPEED, SLOW, LEVEL), (HEIGHT, SOON, None), (HEADING, SOON, None)]
)
def test_a_refused_command_is_reported_and_the_others_keep_clear(
    command: int, scenario: Scenario, config: EngineConfig | None
) -> None:
    loop = Refusing(command, scenario=scenario, config=config)
    loop.until_true(lambda: loop.flight.resumed, limit_s=220.0)
    flight = loop.run(5.0)
    assert clear(flight)
    assert flight.engagements == 1
    assert loop.commanded[command], "refused at least once"
    texts = [text for text in flight.texts if NAMES[command] in text]
    assert 1 <= len(texts) <= 5


def test_a_refused_value_is_tried_once_more_moderated() -> None:
    loop = Refusing(HEIGHT)
    loop.until(State.OUTER)
    loop.run(3.0)
    first, second, *others = loop.commanded[HEIGHT]
    assert 0.0 < abs(first - second) <= 2.0
    assert first not in others, "not commanded again"


def test_a_refused_climb_becomes_a_turn() -> None:
    level_m = 584.1 + 300.0
    allowed, refused = Refusing(), Refusing(HEIGHT)
    for loop in (allowed, refused):
        loop.until(State.OUTER)
        loop.run(10.0)
    assert allowed.world.vehicle.truth.place.altitude_m > level_m + 10.0
    assert abs(allowed.world.vehicle.truth.position_m[1]) < 10.0
    assert abs(refused.world.vehicle.truth.place.altitude_m - level_m) < 5.0
    assert abs(refused.world.vehicle.truth.position_m[1]) > 50.0


@both
def test_a_refused_guided_mode_is_reported_and_requested_again_in_moderation(autopilot: Autopilot) -> None:
    at_once = EngineConfig(avoidance=AvoidanceParams(reserve_s=60.0))  # in time, although refused at first
    loop = MonitoredLoop(SOON, autopilot=autopilot, config=at_once)
    loop.world.vehicle.refuse(DO_SET_MODE, FAILED)
    loop.until(State.ENGAGING)
    began_us = loop.now_us
    loop.run(15.0)
    requests_us = [at_us for at_us, sent in loop.sent if sent == f"COMMAND_LONG {DO_SET_MODE}"]
    assert 3 <= len(requests_us) <= 6
    waits_s = [(later - earlier) / 1e6 for earlier, later in pairwise(requests_us)]
    assert all(later >= earlier for earlier, later in pairwise(waits_s))
    assert waits_s[0] >= 2.0
    assert loop.mode_name == MISSION_MODE[autopilot]
    assert loop.flight.texts.count("Avoidance: autopilot refused") == 1
    loop.world.vehicle.refuse(DO_SET_MODE, None)
    loop.until(State.OUTER, limit_s=12.0)
    assert loop.now_us - began_us < 30e6
    assert clear(loop.run(45.0))


@both
def test_a_refused_release_is_reported_and_repeated(autopilot: Autopilot) -> None:
    loop = MonitoredLoop(SOON, autopilot=autopilot)
    loop.until(State.OUTER)
    loop.run(2.0)
    loop.world.vehicle.refuse(DO_SET_MODE, mavlink.MAV_RESULT_TEMPORARILY_REJECTED)
    loop.stop()
    loop.run(12.0)
    assert not loop.engine.finished
    assert any("refused" in text for text in loop.flight.texts)
    loop.world.vehicle.refuse(DO_SET_MODE, None)
    loop.run(8.0)
    assert loop.engine.finished
    assert not loop.world.vehicle.truth.uncontrolled
