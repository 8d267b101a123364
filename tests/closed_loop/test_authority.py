"""Who has the aircraft: the pilot whenever he wants it, the mission when nothing is wrong."""

from collections.abc import Callable

import pytest

from companion.control.state_machine import State
from companion.engine import Transmit
from sim.vehicle import Mode
from tests.support.watched import COMMANDS, SET_INTERVAL, Watched, asks_for_a_mode


def flying(loop: Watched) -> None:
    loop.until(State.OUTER, State.INNER)
    loop.run(5.0)


@pytest.mark.parametrize("mode", [Mode.MANUAL, Mode.LOITER, Mode.RTL, Mode.FBWA, Mode.AVOID_ADSB, Mode.AUTO])
def test_a_mode_that_the_pilot_chooses_ends_ours_at_once(mode: Mode) -> None:
    loop = Watched()
    flying(loop)
    loop.world.vehicle.set_mode(mode)
    loop.run(1.1)  # his choice is known by the next heartbeat
    sent_back = mode is Mode.AUTO
    assert loop.engine.supervisor.state is (State.SUPPRESSED if sent_back else State.HANDS_OFF)
    known_us = loop.now_us
    loop.run(4.0)
    assert loop.mode() is mode
    assert [sent for at_us, sent in loop.sent if at_us > known_us] == []


def test_taken_up_again_only_after_the_aircraft_settled_in_an_allowed_mode() -> None:
    loop = Watched()
    flying(loop)
    loop.world.vehicle.set_mode(Mode.LOITER)
    loop.run(8.0)
    assert loop.mode() is Mode.LOITER
    assert loop.engine.supervisor.state is State.HANDS_OFF
    loop.world.vehicle.set_mode(Mode.AUTO)
    loop.run(4.0)
    assert loop.engine.supervisor.state is State.HANDS_OFF
    loop.run(4.0)
    assert loop.engine.supervisor.state is not State.HANDS_OFF


def test_the_pilot_changes_the_mode_while_we_ask_for_ours() -> None:
    loop = Watched(deaf=asks_for_a_mode)
    loop.until(State.ENGAGING)
    loop.world.vehicle.set_mode(Mode.FBWA)
    loop.run(1.2)
    assert loop.engine.supervisor.state is State.HANDS_OFF
    loop.run(3.0)
    assert loop.mode() is Mode.FBWA


def test_disarmed_means_hands_off() -> None:
    loop = Watched()
    flying(loop)
    loop.world.vehicle.flight.armed = False
    loop.run(1.1)
    assert loop.engine.supervisor.state is State.HANDS_OFF


@pytest.mark.parametrize("mode", [Mode.LOITER, Mode.GUIDED, Mode.FBWA, Mode.MANUAL])
def test_never_taken_from_another_mode(mode: Mode) -> None:
    loop = Watched()
    loop.world.vehicle.set_mode(mode)
    loop.run(60.0)
    assert loop.engine.supervisor.state is State.STANDBY
    assert loop.sent == []
    assert loop.mode() is mode


def test_nothing_happens_on_the_ground_or_below_the_minimum_height() -> None:
    loop = Watched("two-intruders")
    lowest_m = None
    for _ in range(1200):
        loop.run(0.1)
        if loop.sent and lowest_m is None:
            lowest_m = loop.world.vehicle.truth.place.altitude_m - loop.scenario.home.altitude_m
    assert lowest_m is not None
    assert lowest_m > 30.0


def test_a_stop_gives_the_aircraft_back_first() -> None:
    loop = Watched()
    flying(loop)
    loop.stop()
    assert loop.engine.supervisor.state is State.STOPPING
    loop.run(1.0)
    assert loop.engine.finished
    assert loop.mode() is Mode.AUTO
    sent = len(loop.sent)
    loop.run(5.0)
    assert len(loop.sent) == sent, "nothing is commanded after the end"


def test_a_stop_without_anything_to_give_back_ends_at_once() -> None:
    loop = Watched()
    loop.run(5.0)
    assert loop.stop() == []
    assert loop.engine.finished


def test_commands_that_get_lost_are_sent_again() -> None:
    heard: dict[str, int] = {}

    def deaf(effect: Transmit) -> bool:
        message = effect.message
        if message.get_type() not in COMMANDS:
            return False
        kind = f"{message.get_type()} {getattr(message, 'command', '')}"
        heard[kind] = heard.get(kind, 0) + 1
        return heard[kind] <= 2

    loop = Watched(deaf=deaf)
    flight = loop.run()
    assert flight.mission_completed
    assert not any(e.nmac or e.lowc for e in flight.score.encounters.values())


def test_an_autopilot_that_never_answers_is_asked_with_patience_and_announced_once() -> None:
    loop = Watched(deaf=asks_for_a_mode)
    flight = loop.run(90.0)
    assert flight.engagements == 0
    assert 0 < len(loop.sent) < 60 * 2
    assert flight.texts.count("Avoidance: autopilot did not answer") <= 3
    assert len(flight.texts) < 12


def test_position_lost_while_flying_gives_the_aircraft_back() -> None:
    loop = Watched()
    flying(loop)
    hear = loop._hear
    loop._hear = lambda message: None if message.get_type() == "GLOBAL_POSITION_INT" else hear(message)  # type: ignore[method-assign]
    loop.run(8.0)
    assert loop.mode() is Mode.AUTO
    assert "Avoidance: own position lost" in loop.flight.texts
    loop.run(20.0)
    assert loop.mode() is Mode.AUTO, "blind, it takes nothing over"


def test_rates_are_asked_for_again_after_the_autopilot_forgot_them() -> None:
    loop = Watched("clear")
    loop.run(10.0)
    loop.world.vehicle.add_channel(0)  # as after a reboot: default rates
    loop.run(12.0)
    before = len(loop.flight.decisions)
    positions = 0
    hear = loop._hear

    def counting(message: object) -> None:
        nonlocal positions
        positions += message.get_type() == "GLOBAL_POSITION_INT"  # type: ignore[attr-defined]
        hear(message)

    loop._hear = counting  # type: ignore[method-assign]
    loop.run(5.0)
    assert positions >= 45
    assert len(loop.flight.decisions) > before


def test_a_lost_request_for_traffic_is_made_again() -> None:
    requests = 0

    def deaf(effect: Transmit) -> bool:
        nonlocal requests
        message = effect.message
        if getattr(message, "command", None) != SET_INTERVAL or message.param1 != 246:
            return False
        requests += 1
        return requests == 1

    loop = Watched(deaf=deaf)
    loop.until(State.OUTER, State.INNER)
    assert requests == 2


def silent_downlink(loop: Watched) -> Callable[[], None]:
    """Nothing of the vehicle is heard until the returned function is called."""
    hear = loop._hear
    loop._hear = lambda _message: None  # type: ignore[method-assign]

    def back() -> None:
        loop._hear = hear  # type: ignore[method-assign]

    return back


@pytest.mark.parametrize("after_s", [0.05, 0.3, 0.6, 1.1, 1.7, 2.6])
def test_lost_answers_do_not_take_the_aircraft_from_the_pilot(after_s: float) -> None:
    loop = Watched()
    hear = loop._hear
    loop._hear = lambda message: None if message.get_type() == "COMMAND_ACK" else hear(message)  # type: ignore[method-assign]
    loop.until(State.ENGAGING)
    loop.until(State.OUTER, State.INNER)
    loop.run(after_s)
    loop.world.vehicle.set_mode(Mode.FBWA)
    loop.run(10.0)
    assert loop.mode() is Mode.FBWA
    assert loop.flight.modes[-1][1] == "FBWA"


def test_giving_back_blindly_does_not_take_the_aircraft_from_the_pilot() -> None:
    loop = Watched()
    flying(loop)
    silent_downlink(loop)
    loop.run(7.0)  # own position is lost, and the aircraft given back
    assert loop.mode() is Mode.AUTO
    loop.world.vehicle.set_mode(Mode.FBWA)
    before = len(loop.sent)
    loop.run(60.0)
    assert loop.mode() is Mode.FBWA
    assert len(loop.sent) - before <= 3


def test_silent_after_the_request_and_back_later_the_aircraft_is_not_left_behind() -> None:
    loop = Watched()
    loop.until(State.ENGAGING)
    back = silent_downlink(loop)
    loop.run(8.0)
    back()
    loop.run(5.0)
    assert loop.mode() is not Mode.GUIDED or loop.engine.supervisor.flying
    loop.run(100.0)
    assert loop.mode() is Mode.AUTO


def test_stopped_while_asking_for_the_mode_and_the_first_answer_lost() -> None:
    lost = 0

    def deaf(effect: Transmit) -> bool:
        nonlocal lost
        auto = asks_for_a_mode(effect) and effect.message.param2 == Mode.AUTO
        lost += auto
        return auto and lost == 1

    loop = Watched(deaf=deaf)
    loop.until(State.ENGAGING)
    loop.stop()
    loop.run(4.0)
    assert loop.engine.finished
    assert loop.mode() is Mode.AUTO


def test_an_autopilot_that_refuses_the_mission_is_left_loitering() -> None:
    loop = Watched()
    flying(loop)
    receive = loop.world.vehicle.receive
    refused = 0

    def refusing(message: object, now_s: float, channel: int = 0) -> None:
        nonlocal refused
        if getattr(message, "command", None) == 176 and message.param2 == Mode.AUTO:  # type: ignore[attr-defined]
            refused += 1
            loop.world.vehicle._acknowledge(176, 4, (1, 196), channel)
            return
        receive(message, now_s, channel)

    loop.world.vehicle.receive = refusing  # type: ignore[method-assign]
    loop.stop()
    loop.run(12.0)
    assert loop.engine.finished
    assert loop.mode() is Mode.LOITER
    assert refused == 3, "then something else is asked for"
    assert "Avoidance: AUTO refused, LOITER instead" in "".join(loop.flight.texts)


def test_who_sends_the_aircraft_on_against_us_has_decided_about_this_conflict() -> None:
    loop = Watched()
    flying(loop)
    loop.world.vehicle.set_mode(Mode.AUTO)
    loop.run(40.0)
    assert loop.mode() is Mode.AUTO
    assert loop.engine.supervisor.state is State.SUPPRESSED
    loop.run(60.0)
    assert loop.engine.supervisor.state is State.MONITOR, "the traffic is past"


def test_refused_setpoints_are_told() -> None:
    loop = Watched()
    loop.until(State.ENGAGING)
    receive = loop.world.vehicle.receive

    def refusing(message: object, now_s: float, channel: int = 0) -> None:
        if getattr(message, "command", None) == 43002:
            loop.world.vehicle._acknowledge(43002, 3, (1, 196), channel)
            return
        receive(message, now_s, channel)

    loop.world.vehicle.receive = refusing  # type: ignore[method-assign]
    loop.run(20.0)
    assert loop.flight.texts.count("Avoidance: GUIDED_CHANGE_HEADING unsupported") == 1


def test_a_request_that_arrives_after_the_stop_does_not_strand_the_aircraft() -> None:
    held: list[Transmit] = []

    def deaf(effect: Transmit) -> bool:
        late = asks_for_a_mode(effect) and effect.message.param2 == Mode.GUIDED
        early = asks_for_a_mode(effect) and effect.message.param2 == Mode.AUTO and bool(held)
        if late:
            held.append(effect)
        return late or early

    loop = Watched(deaf=deaf)
    loop.until(State.ENGAGING)
    loop.stop()
    loop.run(0.4)
    (request, *_) = held
    held.clear()  # from here on the mode commands get through
    loop.world.vehicle.receive(request.message, loop.now_us / 1e6, 0)
    loop.run(5.0)
    assert loop.engine.finished
    assert loop.mode() is Mode.AUTO


def test_a_request_that_arrives_after_the_pilots_choice_is_undone() -> None:
    held: list[Transmit] = []

    def deaf(effect: Transmit) -> bool:
        if asks_for_a_mode(effect) and effect.message.param2 == Mode.GUIDED:
            held.append(effect)
            return True
        return False

    loop = Watched(deaf=deaf)
    loop.until(State.ENGAGING)
    loop.world.vehicle.set_mode(Mode.FBWA)
    loop.run(0.5)
    assert loop.engine.supervisor.state is State.HANDS_OFF
    loop.world.vehicle.receive(held[0].message, loop.now_us / 1e6, 0)
    assert loop.mode() is Mode.GUIDED
    loop.run(3.0)
    assert loop.mode() is Mode.FBWA
    assert not loop.engine.supervisor.flying


@pytest.mark.parametrize("after_s", [0.2, 0.7, 1.2])
def test_without_heartbeats_nothing_is_taken_from_the_pilot(after_s: float) -> None:
    loop = Watched()
    loop.until(State.ENGAGING)
    back = silent_downlink(loop)
    loop.run(after_s)
    loop.world.vehicle.set_mode(Mode.FBWA)
    loop.run(1.5)
    back()
    loop.run(10.0)
    assert loop.mode() is Mode.FBWA


def test_silent_for_long_after_the_request_it_is_still_given_back() -> None:
    loop = Watched()
    loop.until(State.ENGAGING)
    back = silent_downlink(loop)
    loop.run(20.0)
    back()
    loop.run(100.0)
    assert loop.mode() is Mode.AUTO


def test_an_autopilot_that_refuses_everything_is_told_to_the_operator() -> None:
    loop = Watched()
    flying(loop)
    receive = loop.world.vehicle.receive

    def refusing(message: object, now_s: float, channel: int = 0) -> None:
        if getattr(message, "command", None) == 176:
            loop.world.vehicle._acknowledge(176, 4, (1, 196), channel)
            return
        receive(message, now_s, channel)

    loop.world.vehicle.receive = refusing  # type: ignore[method-assign]
    loop.stop()
    loop.run(30.0)
    assert not loop.engine.finished
    assert "Avoidance: cannot leave GUIDED, take over" in loop.flight.texts


def test_an_autopilot_that_says_not_yet_is_asked_again_while_the_stream_goes_on() -> None:
    """PX4 wants half a second of setpoints before OFFBOARD; the first may be lost, or come in a heap."""
    lost = 0

    def first_setpoints(effect: Transmit) -> bool:
        nonlocal lost
        if effect.message.get_type() != "SET_POSITION_TARGET_GLOBAL_INT" or lost >= 6:
            return False
        lost += 1
        return True

    loop = Watched(autopilot="px4", deaf=first_setpoints)
    loop.until(State.ENGAGING)
    began_us = loop.now_us
    loop.until(State.OUTER, State.INNER)
    assert lost == 6
    assert loop.now_us - began_us < 3_000_000
    assert [words for _, words in loop.sent].count("COMMAND_LONG 176") == 2
    assert "refused" not in "".join(loop.flight.texts)
