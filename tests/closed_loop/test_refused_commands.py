"""What the autopilot will not do: tried again moderated, then in another way, and told; never silence."""

from dataclasses import replace
from itertools import pairwise

import pytest

from companion.control.state_machine import State
from companion.engine import Transmit
from companion.mavlink.dialect import mavlink
from sim.closed_loop import Flight
from sim.scenario import Autopilot, load_scenario
from tests.support.takings import BOTH, MISSION_MODE
from tests.support.watched import DO_SET_MODE, Watched

SPEED, HEIGHT, HEADING = 43000, 43001, 43002
DENIED, FAILED = 2, 4
NAMES = {SPEED: "GUIDED_CHANGE_SPEED", HEIGHT: "GUIDED_CHANGE_ALTITUDE", HEADING: "GUIDED_CHANGE_HEADING"}


_HEAD_ON = load_scenario("head-on")
SOON = replace(
    _HEAD_ON, duration_s=110.0, intruders=tuple(replace(c, meet_at_s=72.0) for c in _HEAD_ON.intruders)
)


class Refusing(Watched):
    """Also notes the values that were asked for, by command."""

    def __init__(self, *commands: int) -> None:
        self.asked: dict[int, list[float]] = {command: [] for command in NAMES}
        super().__init__(SOON)
        for command in commands:
            self.world.vehicle.refuse(command, DENIED)

    def _transmit(self, time_us: int, effect: Transmit) -> None:
        message = effect.message
        if getattr(message, "command", None) in NAMES:
            value = message.z if message.command == HEIGHT else message.param2
            self.asked[message.command].append(value)
        super()._transmit(time_us, effect)


def clear(flight: Flight) -> bool:
    return not any(e.nmac or e.lowc for e in flight.score.encounters.values())


@pytest.mark.parametrize("command", NAMES)
def test_one_kind_of_command_refused_is_told_and_the_others_keep_clear(command: int) -> None:
    loop = Refusing(command)
    flight = loop.run(95.0)
    assert clear(flight)
    assert flight.engagements == 1
    # One that can only circle in its guided mode takes longer until the traffic is past.
    assert flight.resumed or command == HEADING
    told = [text for text in flight.texts if NAMES[command] in text]
    assert told, "never silence"
    assert len(told) <= 5, "nor spam"


def test_what_was_refused_is_tried_once_more_moderated() -> None:
    loop = Refusing(HEIGHT)
    loop.until(State.OUTER)
    loop.run(3.0)
    first, second, *others = loop.asked[HEIGHT]
    assert 0.0 < abs(first - second) <= 2.0
    assert first not in others, "not asked for again"


def test_a_climb_that_is_refused_becomes_a_turn() -> None:
    level_m = 584.1 + 300.0
    allowed, refused = Refusing(), Refusing(HEIGHT)
    for loop in (allowed, refused):
        loop.until(State.OUTER)
        loop.run(10.0)
    assert allowed.world.vehicle.truth.place.altitude_m > level_m + 10.0
    assert abs(allowed.world.vehicle.truth.position_m[1]) < 10.0
    assert abs(refused.world.vehicle.truth.place.altitude_m - level_m) < 5.0
    assert abs(refused.world.vehicle.truth.position_m[1]) > 50.0


@pytest.mark.parametrize("autopilot", BOTH)
def test_the_guided_mode_refused_is_told_and_asked_for_again_with_patience(autopilot: Autopilot) -> None:
    loop = Watched(SOON, autopilot=autopilot)
    loop.world.vehicle.refuse(DO_SET_MODE, FAILED)
    loop.until(State.ENGAGING)
    began_us = loop.now_us
    loop.run(15.0)
    asked_us = [at_us for at_us, sent in loop.sent if sent == f"COMMAND_LONG {DO_SET_MODE}"]
    assert 3 <= len(asked_us) <= 6
    waits_s = [(later - earlier) / 1e6 for earlier, later in pairwise(asked_us)]
    assert all(later >= earlier for earlier, later in pairwise(waits_s))
    assert waits_s[0] >= 2.0
    assert loop.mode_name == MISSION_MODE[autopilot]
    told = [text for text in loop.flight.texts if text == "Avoidance: autopilot refused"]
    assert len(told) == 1
    loop.world.vehicle.refuse(DO_SET_MODE, None)
    loop.until(State.OUTER, limit_s=12.0)
    assert loop.now_us - began_us < 30e6
    assert clear(loop.run(60.0))


@pytest.mark.parametrize("autopilot", BOTH)
def test_the_way_back_refused_the_aircraft_is_flown_or_told_about(autopilot: Autopilot) -> None:
    loop = Watched(SOON, autopilot=autopilot)
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
