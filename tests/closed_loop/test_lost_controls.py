"""What cannot be flown: no airspeed sensor, controls that the autopilot refuses, a guided mode it lacks."""

from collections import Counter
from dataclasses import replace

import pytest

from companion.control.state_machine import State
from companion.engine import Transmit
from companion.mavlink.dialect import Message
from sim.closed_loop import Flight
from sim.scenario import Autopilot, Scenario, Wind
from sim.vehicle import FakeArduPlane
from sim.vehicle.telemetry import AirspeedSensor
from tests.support.autopilots import ARDUPILOT, BOTH, PX4, both, in_turn, ways
from tests.support.monitored_loop import DO_SET_MODE, SOON, MonitoredLoop
from tests.support.thorough import pairs, sample

SPEED, HEIGHT, HEADING, REPOSITION = 43000, 43001, 43002, 192
GUIDED_COMMANDS = (SPEED, HEIGHT, HEADING)
UNSUPPORTED = 3
PASSED_S, GIVEN_BACK_S = 80.0, 110.0  # when the intruder has passed, and when the aircraft was given back
VFR_HUD, SYS_STATUS, WIND, WIND_COV = 74, 1, 168, 231


class Counting(MonitoredLoop):
    """Also counts the commands and the parameters that are set."""

    def __init__(self, scenario: Scenario, autopilot: Autopilot = "ardupilot") -> None:
        self.commanded: Counter[int | str] = Counter()
        super().__init__(scenario, autopilot=autopilot)

    def _transmit(self, time_us: int, effect: Transmit) -> None:
        message = effect.message
        if message.get_type() == "PARAM_SET":
            self.commanded[message.param_id] += 1
        elif (command := getattr(message, "command", None)) is not None:
            self.commanded[command] += 1
        super()._transmit(time_us, effect)


def clear(flight: Flight) -> bool:
    return not any(e.nmac or e.lowc for e in flight.score.encounters.values())


def is_near_miss(flight: Flight) -> bool:
    return any(e.nmac for e in flight.score.encounters.values())


# --- no airspeed sensor


SHOWN: tuple[AirspeedSensor, ...] = ("zero", "nan", "ground speed", "estimate")
WINDS_MPS = ((15.0, 0.0), (-15.0, 0.0), (0.0, 15.0))


SHOWN_IN_WIND = pairs(SHOWN, WINDS_MPS)


# "zero" and "ground speed" are flown below too.
@in_turn("shown_in_wind", sample([SHOWN_IN_WIND[3], SHOWN_IN_WIND[1]], SHOWN_IN_WIND), BOTH)
def test_without_an_airspeed_sensor_no_speed_is_commanded_and_it_keeps_clear(
    autopilot: Autopilot, shown_in_wind: tuple[AirspeedSensor, tuple[float, float]]
) -> None:
    shown, wind_mps = shown_in_wind
    loop = Counting(replace(SOON, wind=Wind(*wind_mps)), autopilot)
    loop.world.vehicle.remove_airspeed_sensor(shown)
    flight = loop.run(PASSED_S)
    assert flight.engagements >= 1
    assert not is_near_miss(flight)
    assert loop.commanded[SPEED] == loop.commanded["FW_AIRSPD_TRIM"] == 0
    assert flight.texts.count("Avoidance: no airspeed sensor, speed not commanded") == 1


@ways(PX4, among=BOTH)
def test_without_air_data_and_sensor_state_no_speed_is_commanded(autopilot: Autopilot) -> None:
    loop = Counting(replace(SOON, wind=Wind(9.0, -12.0)), autopilot)
    for message_id in (VFR_HUD, SYS_STATUS):
        loop.world.vehicle.withhold(message_id, True)
    assert clear(loop.run(GIVEN_BACK_S))
    assert loop.commanded[SPEED] == loop.commanded["FW_AIRSPD_TRIM"] == 0


def test_ground_speed_shown_as_airspeed_is_recognised_by_the_wind() -> None:
    loop = Counting(replace(SOON, wind=Wind(-12.0, 0.0)))
    loop.world.vehicle.remove_airspeed_sensor("ground speed")
    loop.world.vehicle.withhold(SYS_STATUS, True)
    assert clear(loop.run(GIVEN_BACK_S))
    assert loop.commanded[SPEED] == 0


@ways(ARDUPILOT, among=BOTH)
def test_without_a_sensor_and_without_a_wind_report_it_keeps_clear(autopilot: Autopilot) -> None:
    loop = Counting(replace(SOON, wind=Wind(-10.0, 5.0)), autopilot)
    loop.world.vehicle.remove_airspeed_sensor("zero")
    for message_id in (WIND, WIND_COV):
        loop.world.vehicle.withhold(message_id, True)
    assert clear(loop.run(GIVEN_BACK_S))


# --- controls that are refused


def lacking(*commands: int) -> Counting:
    loop = Counting(SOON)
    for command in commands:
        loop.world.vehicle.refuse(command, UNSUPPORTED)
    return loop


def test_a_build_without_guided_commands_is_flown_by_places_and_heights() -> None:
    loop = lacking(*GUIDED_COMMANDS)
    flight = loop.run(GIVEN_BACK_S)
    assert clear(flight)
    assert flight.resumed
    assert loop.engine.rejections <= len(GUIDED_COMMANDS)
    assert loop.commanded[HEADING] == loop.commanded[HEIGHT] == 1
    assert loop.commanded[REPOSITION] >= 1
    texts = [text for text in flight.texts if "unsupported" in text]
    assert len(texts) == len(set(texts)) == loop.engine.rejections


def test_the_fake_of_such_a_build_is_flown_too() -> None:
    loop = Counting(SOON)
    vehicle = loop.world.vehicle
    assert isinstance(vehicle, FakeArduPlane)
    vehicle._commands.leave_out_guided_commands()
    flight = loop.run(GIVEN_BACK_S)
    assert clear(flight)
    assert flight.resumed
    assert loop.commanded[HEADING] == loop.commanded[HEIGHT] == 1
    assert loop.commanded[REPOSITION] >= 1


def test_px4_without_course_commands_is_flown_in_offboard_the_next_time() -> None:
    loop = Counting(SOON, "px4-1.18")
    loop.world.vehicle.refuse(HEADING, UNSUPPORTED)
    loop.until(State.OUTER)
    loop.run(5.0)
    assert loop.commanded[HEADING] == 1
    assert "Avoidance: courses refused, height only" in loop.flight.texts
    flight = loop.run(160.0)
    assert not is_near_miss(flight)
    assert flight.resumed
    loop.intrude(4000.0)
    loop.until_true(lambda: loop.mode_name == "OFFBOARD", limit_s=20.0)


def test_heights_that_guided_course_acknowledges_and_does_not_fly_are_avoided_by_turning() -> None:
    """As outside its fence, where only the reported target shows it."""
    loop = Counting(SOON, "px4-1.18")
    flight = loop.world.vehicle.flight
    flight.change_altitude = lambda _altitude_m: True  # type: ignore[attr-defined]
    flown = loop.run(GIVEN_BACK_S)
    assert not is_near_miss(flown)
    assert "Avoidance: height not taken, outside PX4's fence?" in "".join(flown.texts)
    assert flown.engagements == 1


# After one of the refusals the flight goes on to its end (`make thorough`).
GOES_ON_S = sample(10.0, 170.0)


@pytest.mark.parametrize(("result", "seconds"), [(1, 10.0), (2, 10.0), (UNSUPPORTED, GOES_ON_S), (4, 10.0)])
def test_guided_course_that_is_refused_gives_way_to_offboard_at_once(result: int, seconds: float) -> None:
    loop = Counting(SOON, "px4-1.18")
    vehicle = loop.world.vehicle

    def refuses_course(message: Message, now_s: float, channel: int = 0) -> None:
        course = getattr(message, "command", None) == DO_SET_MODE and message.param3 == 19.0
        vehicle.refuse(DO_SET_MODE, result if course else None)
        receive(message, now_s, channel)

    receive = vehicle.receive
    vehicle.receive = refuses_course  # type: ignore[method-assign]
    loop.until(State.ENGAGING)
    loop.until_true(lambda: loop.mode_name == "OFFBOARD", limit_s=3.5)
    flight = loop.run(seconds)
    assert clear(flight)
    assert flight.resumed is (seconds > 100.0)
    assert flight.texts.count("Avoidance: GUIDED_COURSE refused, flying OFFBOARD") == 1
    assert not any("did not answer" in text or "autopilot refused" in text for text in flight.texts)


def test_without_any_course_command_the_height_alone_is_flown() -> None:
    loop = lacking(*GUIDED_COMMANDS, REPOSITION)
    flight = loop.run(160.0)  # it circles in GUIDED, so that the intruder arrives later
    assert not is_near_miss(flight)
    assert flight.resumed
    assert loop.engine.rejections <= 4
    assert "Avoidance: courses refused, height only" in flight.texts


def test_what_is_refused_is_tried_again_after_a_restart_of_the_autopilot() -> None:
    loop = lacking(HEADING)
    loop.until(State.OUTER)
    loop.run(5.0)
    assert loop.commanded[HEADING] == 1
    loop.world.vehicle.refuse(HEADING, None)
    loop.world.vehicle.reboot(loop.now_us / 1e6)
    loop.run(30.0)
    assert loop.commanded[HEADING] > 1


@both
def test_an_unsupported_guided_mode_is_requested_once_and_then_only_advised(autopilot: Autopilot) -> None:
    loop = Counting(SOON, autopilot)
    loop.world.vehicle.refuse(DO_SET_MODE, UNSUPPORTED)
    loop.run(60.0)
    assert loop.commanded[DO_SET_MODE] == 1
    name = {"ardupilot": "GUIDED", "px4": "OFFBOARD"}[autopilot]
    assert f"it does not support {name}" in loop.engine.hindrances(loop.now_us / 1e6)
