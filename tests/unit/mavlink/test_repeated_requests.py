"""A second path delivers the requests of a ground station again, seconds later: they are obeyed once."""

import time

import pytest

from companion.mavlink.dialect import Encoder, Message, mavlink
from companion.mavlink.facts import CommandRequest, ParameterRequest, ParameterSet
from companion.mavlink.framing import Frame, FrameSplitter
from companion.mavlink.intake import Intake
from companion.mavlink.recent_frames import RecentFrames

SET_MODE, CONTINUE = mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_CMD_DO_PAUSE_CONTINUE


def command(number: int, first: float, second: float = 0.0, confirmation: int = 0) -> Message:
    return mavlink.MAVLink_command_long_message(1, 196, number, confirmation, first, second, 0, 0, 0, 0, 0)


def in_integers(number: int, first: float, second: float = 0.0) -> Message:
    return mavlink.MAVLink_command_int_message(1, 196, 0, number, 0, 0, first, second, 0, 0, 0, 0, 0)


def setting(value: float) -> Message:
    return mavlink.MAVLink_param_set_message(1, 196, b"CA_WC_HORIZ", value, 9)


def role(number: int) -> Message:
    return command(SET_MODE, 1, number)


class Station:
    """A ground station; it counts its frames on, or has always the same number."""

    def __init__(self, system_id: int = 255, *, counts: bool = True) -> None:
        self._system_id = system_id
        self._counts = counts
        self._encoder = Encoder()

    def frame(self, message: Message) -> Frame:
        if not self._counts:
            self._encoder = Encoder()
        (frame,) = FrameSplitter().feed_datagram(self._encoder.encode(message, self._system_id, 190))
        return frame


def is_copy(fact: object) -> bool:
    assert isinstance(fact, CommandRequest)
    return fact.is_copy


@pytest.mark.parametrize("late_s", [0.0, 0.02, 1.0, 5.0, 14.0])
@pytest.mark.parametrize("message", [role(0), in_integers(SET_MODE, 1, 0), command(CONTINUE, 1)])
def test_a_late_copy_of_a_command_is_marked(message: Message, late_s: float) -> None:
    intake, station = Intake(196), Station()
    first, second = station.frame(message), station.frame(role(2))
    facts = [intake.judge(frame, at_s) for frame, at_s in ((first, 100.0), (second, 100.0))]
    assert [one is not None and is_copy(one.fact) for one in facts] == [False, False]
    copies = [
        intake.judge(first, 100.0 + late_s),
        intake.judge(second, 100.5 + late_s),
        intake.judge(first, 100.7 + late_s),  # by a third path
    ]
    assert [one is not None and is_copy(one.fact) for one in copies] == [True, True, True]
    assert intake.repeated == 3
    assert intake.past == intake.unusable == 0


def test_a_late_copy_of_a_setting_only_reads_it() -> None:
    """The answer then is the present value, so that it never misleads."""
    intake, station = Intake(196), Station()
    first, second = station.frame(setting(500.0)), station.frame(setting(600.0))
    for frame in (first, second):
        received = intake.judge(frame, 100.0)
        assert received is not None
        assert isinstance(received.fact, ParameterSet)
    for frame in (first, second):
        received = intake.judge(frame, 105.0)
        assert received is not None
        assert isinstance(received.fact, ParameterRequest)
        assert received.fact.name == "CA_WC_HORIZ"
        assert received.fact.target.component_id == 196
    assert intake.repeated == 2


def test_a_station_that_sends_a_request_again_is_obeyed() -> None:
    """With a new number, whether the request is marked as a repetition or not."""
    intake, station = Intake(196), Station()
    sent = [command(CONTINUE, 1, confirmation=each) for each in range(5)]
    sent += [setting(500.0)] * 5 + [role(0), role(2)] * 200
    for tick, message in enumerate(sent):
        assert intake.judge(station.frame(message), 100.0 + tick * 0.1) is not None
    assert intake.repeated == 0


def test_a_station_whose_frames_all_have_the_same_number_may_change_its_mind() -> None:
    intake, station = Intake(196), Station(counts=False)
    for tick, message in enumerate([setting(500.0), setting(600.0), role(0), role(2)] * 3):
        received = intake.judge(station.frame(message), 100.0 + tick)
        assert received is not None
        assert isinstance(received.fact, ParameterSet | CommandRequest)
    assert intake.repeated == 0


def test_what_it_repeats_at_once_is_obeyed_once_and_again_after_a_while() -> None:
    """As often as it repeats it, the time counts from the one that was obeyed."""
    intake, station = Intake(196), Station(counts=False)
    received = [intake.judge(station.frame(role(0)), 100.0 + tick) for tick in range(40)]
    obeyed = [tick for tick, one in enumerate(received) if one is not None and not is_copy(one.fact)]
    assert obeyed == [0, 16, 32]


def test_stations_are_told_apart() -> None:
    intake = Intake(196)
    for number in range(1, 200):
        assert intake.judge(Station(number).frame(role(0)), 100.0) is not None


def test_a_flood_of_requests_needs_little_memory_and_time() -> None:
    recent: RecentFrames[int] = RecentFrames()
    began_s = time.process_time()
    for number in range(100_000):
        recent.put(number, b"%d" % number, number / 5000)
    assert time.process_time() - began_s < 5.0
    assert len(recent) <= 4096
    assert recent.holds(99_999, b"99999", 20.0)
    assert not recent.holds(0, b"0", 20.0)
    recent.put(-1, b"", 40.0)
    assert len(recent) == 1
