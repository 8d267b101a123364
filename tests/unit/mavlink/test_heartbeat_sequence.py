"""Which heartbeats were overtaken on their way."""

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


def are_heartbeats(sent: list[Frame]) -> list[Frame]:
    return [frame for frame in sent if frame.message_id == 0]


@pytest.mark.parametrize("between", [0, 7, 45, 100, 127, 128, 200, 255, 400])
def test_in_order_none_is_overtaken_however_many_messages_there_are(between: int) -> None:
    order = HeartbeatSequence()
    assert not any(order.is_overtaken(frame, 0.0) for frame in stream(20, between))


@pytest.mark.parametrize("between", [3, 45])
def test_a_heartbeat_after_a_later_one_is_overtaken(between: int) -> None:
    order, sent = HeartbeatSequence(), stream(8, between)
    late = are_heartbeats(sent)[4]
    later = are_heartbeats(sent)[5]
    for frame in sent[: sent.index(later) + 2]:
        if frame is not late:
            assert not order.is_overtaken(frame, 0.0)
    assert order.is_overtaken(late, 0.0)
    for frame in sent[sent.index(later) + 2 :]:
        assert not order.is_overtaken(frame, 0.0)


def test_other_messages_may_overtake_it() -> None:
    order, sent = HeartbeatSequence(), stream(6, 40)
    for number in range(0, len(sent), 41):
        assert not any(order.is_overtaken(frame, 0.0) for frame in sent[number + 1 : number + 20])
        assert not order.is_overtaken(sent[number], 0.0)
        assert not any(order.is_overtaken(frame, 0.0) for frame in sent[number + 20 : number + 41])


def test_a_heartbeat_twice_is_overtaken_by_itself() -> None:
    order, (frame,) = HeartbeatSequence(), frames([HEARTBEAT])
    assert not order.is_overtaken(frame, 0.0)
    assert order.is_overtaken(frame, 0.0)


def test_lost_frames_are_no_overtaking() -> None:
    order, sent = HeartbeatSequence(), stream(40, 9)
    assert not any(order.is_overtaken(frame, 0.0) for frame in sent[::30])


@pytest.mark.parametrize("before", [30, 60, 200, 250])
def test_a_sender_that_starts_anew_is_believed_soon(before: int) -> None:
    order = HeartbeatSequence()
    for frame in frames([OTHER] * before + [HEARTBEAT]):
        order.is_overtaken(frame, 0.0)
    overtaken = [order.is_overtaken(frame, 0.0) for frame in are_heartbeats(stream(12, 20))]
    assert sum(overtaken) <= 3
    assert not any(overtaken[4:])


def test_each_sender_counts_for_itself() -> None:
    order = HeartbeatSequence()
    for frame in frames([HEARTBEAT] * 50):
        order.is_overtaken(frame, 0.0)
    assert not order.is_overtaken(frames([HEARTBEAT], system_id=2)[0], 0.0)


@pytest.mark.parametrize("lost", [100, 128, 150, 200, 255, 300, 400])
def test_after_a_silence_the_first_heartbeat_is_believed(lost: int) -> None:
    """The number went around meanwhile, or nearly: by it alone the heartbeat would look old."""
    order, sent = HeartbeatSequence(), frames([HEARTBEAT] + [OTHER] * (lost - 1) + [OTHER] * 10 + [HEARTBEAT])
    assert not order.is_overtaken(sent[0], 0.0)
    for frame in sent[lost:-1]:
        assert not order.is_overtaken(frame, 3.0)
    assert not order.is_overtaken(sent[-1], 3.2)
