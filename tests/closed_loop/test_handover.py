"""Take-over and release: the pilot always has precedence, and the aircraft is never left behind."""

from collections.abc import Callable
from itertools import pairwise

import pytest

from companion.control.state_machine import State
from companion.engine import Transmit
from sim.vehicle import Mode
from tests.support.monitored_loop import COMMANDS, SET_INTERVAL, MonitoredLoop, is_mode_request
from tests.support.short_scenario import shorter
from tests.support.thorough import sample


def flying(loop: MonitoredLoop) -> None:
    loop.until(State.OUTER, State.INNER)
    loop.run(5.0)


ENTERED = [Mode.AUTO, Mode.LOITER, Mode.MANUAL, Mode.RTL, Mode.FBWA, Mode.AVOID_ADSB]


@pytest.mark.parametrize("mode", sample(ENTERED[:3], ENTERED))
def test_a_mode_change_by_the_pilot_ends_the_avoidance(mode: Mode) -> None:
    loop = MonitoredLoop()
    flying(loop)
    loop.world.vehicle.set_mode(mode)
    loop.run(1.1)  # until the next heartbeat reports the mode
    sent_back = mode is Mode.AUTO
    assert loop.engine.supervisor.state is (State.SUPPRESSED if sent_back else State.HANDS_OFF)
    known_us = loop.now_us
    loop.run(4.0)
    assert loop.mode() is mode
    assert [sent for at_us, sent in loop.sent if at_us > known_us] == []


def test_avoidance_resumes_only_after_settling_in_an_allowed_mode() -> None:
    loop = MonitoredLoop()
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


def test_a_mode_change_during_our_request_is_respected() -> None:
    loop = MonitoredLoop(drops=is_mode_request)
    loop.until(State.ENGAGING)
    loop.world.vehicle.set_mode(Mode.FBWA)
    loop.run(1.2)
    assert loop.engine.supervisor.state is State.HANDS_OFF
    loop.run(3.0)
    assert loop.mode() is Mode.FBWA


def test_disarmed_means_hands_off() -> None:
    loop = MonitoredLoop()
    flying(loop)
    loop.world.vehicle.flight.armed = False
    loop.run(1.1)
    assert loop.engine.supervisor.state is State.HANDS_OFF


@pytest.mark.parametrize(
    "mode", sample([Mode.LOITER, Mode.GUIDED], [Mode.LOITER, Mode.GUIDED, Mode.FBWA, Mode.MANUAL])
)
def test_no_take_over_from_another_mode(mode: Mode) -> None:
    loop = MonitoredLoop()
    loop.world.vehicle.set_mode(mode)
    loop.run(30.0)
    assert loop.engine.supervisor.state is State.STANDBY
    assert loop.sent == []
    assert loop.mode() is mode


def test_nothing_happens_on_the_ground_or_below_the_minimum_height() -> None:
    loop = MonitoredLoop("two-intruders")
    loop.until_true(lambda: bool(loop.sent))
    assert loop.world.vehicle.truth.place.altitude_m - loop.scenario.home.altitude_m > 30.0


def test_a_stop_releases_the_aircraft_first() -> None:
    loop = MonitoredLoop()
    flying(loop)
    loop.stop()
    assert loop.engine.supervisor.state is State.STOPPING
    loop.run(1.0)
    assert loop.engine.finished
    assert loop.mode() is Mode.AUTO
    sent = len(loop.sent)
    loop.run(5.0)
    assert len(loop.sent) == sent, "no commands after the end"


def test_a_stop_without_engagement_ends_at_once() -> None:
    loop = MonitoredLoop("head-on")
    loop.run(5.0)
    assert loop.stop() == []
    assert loop.engine.finished


def test_lost_commands_are_sent_again() -> None:
    count: dict[str, int] = {}

    def first_two(effect: Transmit) -> bool:
        message = effect.message
        if message.get_type() not in COMMANDS:
            return False
        kind = f"{message.get_type()} {getattr(message, 'command', '')}"
        count[kind] = count.get(kind, 0) + 1
        return count[kind] <= 2

    loop = MonitoredLoop(shorter("head-on"), drops=first_two)
    flight = loop.run()
    assert flight.mission_completed
    assert not any(e.nmac or e.lowc for e in flight.score.encounters.values())


def test_requests_to_a_silent_autopilot_are_moderated_and_reported_once() -> None:
    loop = MonitoredLoop(drops=is_mode_request)
    flight = loop.run(65.0)
    assert flight.engagements == 0
    assert 0 < len(loop.sent) < 60 * 2
    assert flight.texts.count("Avoidance: autopilot did not answer") <= 3
    # Changes of the advice are announced besides, each once.
    advice = [text for text in flight.texts if text.startswith("Advise ")]
    assert len(flight.texts) - len(advice) < 12
    assert len(advice) < 15
    assert all(one != other for one, other in pairwise(flight.texts))


def test_a_lost_position_releases_the_aircraft() -> None:
    loop = MonitoredLoop()
    flying(loop)
    hear = loop._hear
    loop._hear = lambda message: None if message.get_type() == "GLOBAL_POSITION_INT" else hear(message)  # type: ignore[method-assign]
    loop.run(8.0)
    assert loop.mode() is Mode.AUTO
    assert "Avoidance: own position lost" in loop.flight.texts
    loop.run(20.0)
    assert loop.mode() is Mode.AUTO, "no take-over without position"


def test_message_rates_are_requested_again_after_a_reset() -> None:
    loop = MonitoredLoop("clear")
    loop.run(10.0)
    loop.world.vehicle.add_channel(0)  # as after a reboot: default rates
    loop.run(12.0)
    before = len(loop.flight.records)
    positions = 0
    hear = loop._hear

    def counting(message: object) -> None:
        nonlocal positions
        positions += message.get_type() == "GLOBAL_POSITION_INT"  # type: ignore[attr-defined]
        hear(message)

    loop._hear = counting  # type: ignore[method-assign]
    loop.run(5.0)
    assert positions >= 45
    assert len(loop.flight.records) > before


def test_a_lost_request_for_traffic_is_repeated() -> None:
    requests = 0

    def first_request(effect: Transmit) -> bool:
        nonlocal requests
        message = effect.message
        if getattr(message, "command", None) != SET_INTERVAL or message.param1 != 246:
            return False
        requests += 1
        return requests == 1

    loop = MonitoredLoop(drops=first_request)
    loop.until(State.OUTER, State.INNER)
    assert requests == 2


def silent_downlink(loop: MonitoredLoop) -> Callable[[], None]:
    """Drop everything from the vehicle until the returned function is called."""
    hear = loop._hear
    loop._hear = lambda _message: None  # type: ignore[method-assign]

    def back() -> None:
        loop._hear = hear  # type: ignore[method-assign]

    return back


@pytest.mark.parametrize("after_s", sample([0.05, 0.6, 1.7], [0.05, 0.3, 0.6, 1.1, 1.7, 2.6]))
def test_lost_acknowledgements_do_not_override_the_pilot(after_s: float) -> None:
    loop = MonitoredLoop()
    hear = loop._hear
    loop._hear = lambda message: None if message.get_type() == "COMMAND_ACK" else hear(message)  # type: ignore[method-assign]
    loop.until(State.ENGAGING)
    loop.until(State.OUTER, State.INNER)
    loop.run(after_s)
    loop.world.vehicle.set_mode(Mode.FBWA)
    loop.run(10.0)
    assert loop.mode() is Mode.FBWA
    assert loop.flight.modes[-1][1] == "FBWA"


def test_a_release_without_reception_does_not_override_the_pilot() -> None:
    loop = MonitoredLoop()
    flying(loop)
    silent_downlink(loop)
    loop.run(7.0)  # own position lost: released as soon as the autopilot is heard
    assert loop.mode() is Mode.GUIDED
    loop.world.vehicle.set_mode(Mode.FBWA)
    before = len(loop.sent)
    loop.run(60.0)
    assert loop.mode() is Mode.FBWA
    assert len(loop.sent) == before


def test_an_outage_after_the_request_does_not_strand_the_aircraft() -> None:
    loop = MonitoredLoop()
    loop.until(State.ENGAGING)
    back = silent_downlink(loop)
    loop.run(8.0)
    back()
    loop.run(5.0)
    assert loop.mode() is not Mode.GUIDED or loop.engine.supervisor.flying
    loop.run(60.0)
    loop.until(State.MONITOR, limit_s=40.0)
    assert loop.mode() is Mode.AUTO


def test_a_stop_during_the_request_survives_a_lost_release() -> None:
    lost = 0

    def first_release(effect: Transmit) -> bool:
        nonlocal lost
        auto = is_mode_request(effect) and effect.message.param2 == Mode.AUTO
        lost += auto
        return auto and lost == 1

    loop = MonitoredLoop(drops=first_release)
    loop.until(State.ENGAGING)
    loop.stop()
    loop.run(6.0)
    assert loop.engine.finished
    assert loop.mode() is Mode.AUTO


def test_a_refused_mission_mode_ends_in_loiter() -> None:
    loop = MonitoredLoop()
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
    assert refused == 3, "then another mode is requested"
    assert "Avoidance: AUTO refused, LOITER instead" in "".join(loop.flight.texts)


def test_a_return_to_the_mission_by_the_pilot_suppresses_the_conflict() -> None:
    loop = MonitoredLoop()
    flying(loop)
    loop.world.vehicle.set_mode(Mode.AUTO)
    loop.run(40.0)
    assert loop.mode() is Mode.AUTO
    assert loop.engine.supervisor.state is State.SUPPRESSED
    loop.until(State.MONITOR, limit_s=60.0)  # the traffic is past


def test_refused_setpoints_are_reported() -> None:
    loop = MonitoredLoop()
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
    delayed: list[Transmit] = []

    def delays(effect: Transmit) -> bool:
        late = is_mode_request(effect) and effect.message.param2 == Mode.GUIDED
        early = is_mode_request(effect) and effect.message.param2 == Mode.AUTO and bool(delayed)
        if late:
            delayed.append(effect)
        return late or early

    loop = MonitoredLoop(drops=delays)
    loop.until(State.ENGAGING)
    loop.stop()
    loop.run(0.4)
    (request, *_) = delayed
    delayed.clear()  # from here on mode commands are delivered
    loop.world.vehicle.receive(request.message, loop.now_us / 1e6, 0)
    loop.run(5.0)
    assert loop.engine.finished
    assert loop.mode() is Mode.AUTO


def test_a_request_that_arrives_after_the_pilots_mode_change_is_undone() -> None:
    delayed: list[Transmit] = []

    def delays(effect: Transmit) -> bool:
        if is_mode_request(effect) and effect.message.param2 == Mode.GUIDED:
            delayed.append(effect)
            return True
        return False

    loop = MonitoredLoop(drops=delays)
    loop.until(State.ENGAGING)
    loop.world.vehicle.set_mode(Mode.FBWA)
    loop.run(0.5)
    assert loop.engine.supervisor.state is State.HANDS_OFF
    loop.world.vehicle.receive(delayed[0].message, loop.now_us / 1e6, 0)
    assert loop.mode() is Mode.GUIDED
    loop.run(3.0)
    assert loop.mode() is Mode.FBWA
    assert not loop.engine.supervisor.flying


@pytest.mark.parametrize("after_s", [0.2, 0.7, 1.2])
def test_an_outage_does_not_override_the_pilot(after_s: float) -> None:
    loop = MonitoredLoop()
    loop.until(State.ENGAGING)
    back = silent_downlink(loop)
    loop.run(after_s)
    loop.world.vehicle.set_mode(Mode.FBWA)
    loop.run(1.5)
    back()
    loop.run(10.0)
    assert loop.mode() is Mode.FBWA


def test_after_a_long_outage_the_aircraft_is_released() -> None:
    loop = MonitoredLoop()
    loop.until(State.ENGAGING)
    back = silent_downlink(loop)
    loop.run(20.0)
    back()
    loop.run(60.0)
    loop.until(State.MONITOR, limit_s=40.0)
    assert loop.mode() is Mode.AUTO


def test_an_autopilot_that_refuses_all_modes_is_reported() -> None:
    loop = MonitoredLoop()
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


def test_a_temporary_rejection_is_followed_by_another_request() -> None:
    """PX4 needs half a second of setpoints before OFFBOARD; the first may be lost or delayed."""
    lost = 0

    def first_setpoints(effect: Transmit) -> bool:
        nonlocal lost
        if effect.message.get_type() != "SET_POSITION_TARGET_GLOBAL_INT" or lost >= 6:
            return False
        lost += 1
        return True

    loop = MonitoredLoop(autopilot="px4", drops=first_setpoints)
    loop.until(State.ENGAGING)
    began_us = loop.now_us
    loop.until(State.OUTER, State.INNER)
    assert lost == 6
    assert loop.now_us - began_us < 3_000_000
    assert [words for _, words in loop.sent].count("COMMAND_LONG 176") == 2
    assert "refused" not in "".join(loop.flight.texts)
