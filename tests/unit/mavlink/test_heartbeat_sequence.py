"""Heartbeats that are outdated when they arrive, and those that are not."""

import pytest

from companion.mavlink.dialect import Encoder, Message, mavlink
from companion.mavlink.framing import Frame, FrameSplitter
from companion.mavlink.heartbeat_sequence import HeartbeatSequence

HEARTBEAT = mavlink.MAVLink_heartbeat_message(1, 3, 0, 0, 4, 3)
OTHER = mavlink.MAVLink_system_time_message(0, 0)


def frames(messages: list[Message], system_id: int = 1) -> list[Frame]:
    encoder, splitter = Encoder(), FrameSplitter()
    return [splitter.feed_datagram(encoder.encode(message, system_id, 1))[0] for message in messages]


def stream(heartbeats: int, between: int) -> list[Frame]:
    return frames(([HEARTBEAT] + [OTHER] * between) * heartbeats)


def heartbeats_in(sent: list[Frame]) -> list[Frame]:
    return [frame for frame in sent if frame.message_id == 0]


@pytest.mark.parametrize("between", [0, 7, 45, 100, 127, 128, 200, 255, 400])
def test_no_heartbeat_that_arrives_in_order_is_outdated(between: int) -> None:
    sequence = HeartbeatSequence()
    assert not any(sequence.is_outdated(frame, 0.0) for frame in stream(20, between))


@pytest.mark.parametrize("between", [3, 45])
def test_a_heartbeat_that_arrives_after_a_newer_one_is_outdated(between: int) -> None:
    sequence, sent = HeartbeatSequence(), stream(8, between)
    late = heartbeats_in(sent)[4]
    later = heartbeats_in(sent)[5]
    for frame in sent[: sent.index(later) + 2]:
        if frame is not late:
            assert not sequence.is_outdated(frame, 0.0)
    assert sequence.is_outdated(late, 0.0)
    for frame in sent[sent.index(later) + 2 :]:
        assert not sequence.is_outdated(frame, 0.0)


def test_a_heartbeat_that_arrives_after_other_newer_messages_is_not_outdated() -> None:
    sequence, sent = HeartbeatSequence(), stream(6, 40)
    for number in range(0, len(sent), 41):
        assert not any(sequence.is_outdated(frame, 0.0) for frame in sent[number + 1 : number + 20])
        assert not sequence.is_outdated(sent[number], 0.0)
        assert not any(sequence.is_outdated(frame, 0.0) for frame in sent[number + 20 : number + 41])


def test_a_repeated_heartbeat_is_outdated() -> None:
    sequence, (frame,) = HeartbeatSequence(), frames([HEARTBEAT])
    assert not sequence.is_outdated(frame, 0.0)
    assert sequence.is_outdated(frame, 0.0)


def test_no_heartbeat_is_outdated_because_of_lost_frames() -> None:
    sequence, sent = HeartbeatSequence(), stream(40, 9)
    assert not any(sequence.is_outdated(frame, 0.0) for frame in sent[::30])


@pytest.mark.parametrize("before", [30, 60, 200, 250])
def test_the_heartbeats_of_a_restarted_sender_are_accepted_soon(before: int) -> None:
    sequence = HeartbeatSequence()
    for frame in frames([OTHER] * before + [HEARTBEAT]):
        sequence.is_outdated(frame, 0.0)
    outdated = [sequence.is_outdated(frame, 0.0) for frame in heartbeats_in(stream(12, 20))]
    assert sum(outdated) <= 3
    assert not any(outdated[4:])


def test_each_sender_has_its_own_sequence() -> None:
    sequence = HeartbeatSequence()
    for frame in frames([HEARTBEAT] * 50):
        sequence.is_outdated(frame, 0.0)
    assert not sequence.is_outdated(frames([HEARTBEAT], system_id=2)[0], 0.0)


@pytest.mark.parametrize("lost", [100, 128, 150, 200, 255, 300, 400])
def test_after_a_silence_the_first_heartbeat_is_accepted(lost: int) -> None:
    """The number has wrapped in the meantime, or nearly, and would look older than it is."""
    sequence, sent = (
        HeartbeatSequence(),
        frames([HEARTBEAT] + [OTHER] * (lost - 1) + [OTHER] * 10 + [HEARTBEAT]),
    )
    assert not sequence.is_outdated(sent[0], 0.0)
    for frame in sent[lost:-1]:
        assert not sequence.is_outdated(frame, 3.0)
    assert not sequence.is_outdated(sent[-1], 3.2)
