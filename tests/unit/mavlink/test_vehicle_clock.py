"""Frames of the past, of the present and of another vehicle."""

from collections import Counter
from collections.abc import Iterable, Iterator

import pytest

from companion.mavlink.dialect import Encoder, Message, mavlink
from companion.mavlink.framing import Frame, FrameSplitter
from companion.mavlink.intake import Intake, time_sync_request
from companion.mavlink.vehicle_clock import (
    LATEST_S,
    Origin,
    Timing,
    VehicleClocks,
)

HEARTBEAT = mavlink.MAVLink_heartbeat_message(1, 3, 0, 0, 4, 3)
OTHER = mavlink.MAVLink_fence_status_message(0, 0, 0, 0)
POSITION, HEARTBEAT_ID = mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, mavlink.MAVLINK_MSG_ID_HEARTBEAT

Arrival = tuple[float, Frame]  # time [s] on our clock


def frames(messages: list[Message], system_id: int = 1) -> list[Frame]:
    encoder, splitter = Encoder(), FrameSplitter()
    return [splitter.feed_datagram(encoder.encode(message, system_id, 1))[0] for message in messages]


def position(boot_s: float, lat_deg: float) -> Message:
    return mavlink.MAVLink_global_position_int_message(
        round(boot_s * 1000), round(lat_deg * 1e7), 0, 0, 0, 0, 0, 0, 0
    )


def flight(
    seconds: float,
    *,
    from_s: float = 1000.0,
    boot_s: float = 300.0,
    lat_deg: float = 47.0,
    rate: float = 1.0,
    between: int = 3,
) -> list[Arrival]:
    """Ten positions and one heartbeat a second, with others between; `rate` of its clock against ours."""
    sent: list[tuple[float, Message]] = []
    for tick in range(round(seconds * 10)):
        at_s = tick / 10
        sent.append((from_s + at_s, position(boot_s + at_s * rate, lat_deg + at_s * 2e-4)))
        sent += [(from_s + at_s + 0.01, OTHER)] * between
        if tick % 10 == 5:
            sent.append((from_s + at_s + 0.02, HEARTBEAT))
    return [(at_s, frame) for (at_s, _), frame in zip(sent, frames([m for _, m in sent]), strict=True)]


def delayed(arrivals: Iterable[Arrival], by_s: float) -> list[Arrival]:
    return [(at_s + by_s, frame) for at_s, frame in arrivals]


def judged(*streams: list[Arrival]) -> Iterator[tuple[float, Frame, Timing]]:
    clocks = VehicleClocks()
    for at_s, frame in sorted((one for stream in streams for one in stream), key=lambda one: one[0]):
        yield at_s, frame, clocks.judge(frame, at_s)


def origins(*streams: list[Arrival], after_s: float = 0.0) -> Counter[Origin]:
    return Counter(timing.origin for at_s, _, timing in judged(*streams) if at_s >= after_s)


@pytest.mark.parametrize("between", [0, 3, 7, 20, 25])
def test_frames_in_order_are_of_the_present(between: int) -> None:
    assert set(origins(flight(20.0, between=between))) == {Origin.PRESENT}


@pytest.mark.parametrize("late_s", [0.7, 1.3, 2.6, 5.0, 9.0, 30.0])
@pytest.mark.parametrize("between", [0, 3, 11])
def test_late_copies_are_of_the_past_whatever_their_sequence_numbers(late_s: float, between: int) -> None:
    sent = flight(60.0, between=between)
    clocks, verdicts = VehicleClocks(), {True: Counter[Origin](), False: Counter[Origin]()}
    mixed = [(at_s, False, frame) for at_s, frame in sent]
    mixed += [(at_s, True, frame) for at_s, frame in delayed(sent, late_s) if at_s < sent[-1][0]]
    for at_s, is_copy, frame in sorted(mixed, key=lambda one: one[0]):
        verdicts[is_copy][clocks.judge(frame, at_s).origin] += 1
    assert set(verdicts[False]) == {Origin.PRESENT}
    assert verdicts[True][Origin.PRESENT] == 0
    assert verdicts[True][Origin.OTHER] == 0


def test_late_copies_of_which_a_third_was_never_received_in_time_are_no_other_vehicle() -> None:
    sent = flight(60.0)
    received = [one for number, one in enumerate(sent) if number % 3]
    assert origins(received, delayed(sent, 5.0))[Origin.OTHER] == 0


def test_the_faster_path_is_the_present_although_the_slower_one_was_heard_first() -> None:
    sent = flight(40.0)
    slow = [one for one in delayed(sent, 5.0) if one[0] >= 1010.0]
    fast = [one for one in sent if one[0] >= 1010.5]
    late = {id(frame) for at_s, frame in slow if at_s >= 1020.0}
    for at_s, frame, timing in judged(slow, fast):
        if at_s >= 1020.0 and at_s < sent[-1][0] and id(frame) not in late:
            assert timing.origin is Origin.PRESENT


def test_when_only_the_late_path_is_left_everything_is_of_the_past() -> None:
    """The answers to TIMESYNC are late as well, and show it."""
    intake, encoder, splitter = Intake(196), Encoder(), FrameSplitter()
    sent = flight(60.0)
    fast = [one for one in sent if one[0] < 1020.0]
    used = Counter[bool]()
    for at_s, frame in sorted([*fast, *delayed(sent, 5.0)], key=lambda one: one[0]):
        received = intake.judge(frame, at_s)
        if at_s > 1021.0:
            used[received is not None] += 1
        if frame.message_id == HEARTBEAT_ID:
            delay_s = 0.05 if at_s < 1020.0 else 5.05
            answer = mavlink.MAVLink_timesync_message(1, time_sync_request(196, at_s - delay_s).ts1)
            (raw,) = splitter.feed_datagram(encoder.encode(answer, 1, 1))
            intake.judge(raw, at_s)
    assert used == Counter({False: used[False]})
    assert used[False] > 1000


@pytest.mark.parametrize("boot_s", [20.0, 299.0, 9000.0])
@pytest.mark.parametrize("lat_deg", [47.0, 47.08])
def test_another_vehicle_with_the_same_address_is_recognized_by_its_clock(
    boot_s: float, lat_deg: float
) -> None:
    ours = flight(30.0)
    other = flight(20.0, from_s=1010.03, boot_s=boot_s, lat_deg=lat_deg + 1e-5)
    verdicts = origins(ours, other, after_s=1012.0)
    assert verdicts[Origin.OTHER] > 0
    assert verdicts[Origin.PRESENT] <= len(ours)


@pytest.mark.parametrize("silent_s", [2.0, 4.0, 30.0])
def test_a_restart_is_no_other_vehicle(silent_s: float) -> None:
    before = flight(30.0)
    after = flight(20.0, from_s=1030.0 + silent_s, boot_s=min(silent_s - 1.0, 3.0))
    assert set(origins(before, after)) == {Origin.PRESENT}


@pytest.mark.parametrize("stall_s", [0.6, 1.2, 4.0, 20.0])
def test_a_queue_that_is_read_after_a_stall_was_true_when_it_was_sent(stall_s: float) -> None:
    wake_s = 1020.0 + stall_s
    sent = flight(50.0)
    arrivals = [(wake_s if 1020.0 <= at_s < wake_s else at_s, frame) for at_s, frame in sent]
    for (sent_s, frame), (_, _, timing) in zip(sent, judged(arrivals), strict=True):
        assert timing.true_s == pytest.approx(sent_s, abs=0.15)
        is_late = wake_s - sent_s > LATEST_S + 0.15 and 1020.0 <= sent_s < wake_s
        if is_late:
            assert timing.origin is Origin.PAST, frame.message_id
        if not 1020.0 <= sent_s < wake_s:
            assert timing.origin is Origin.PRESENT


@pytest.mark.parametrize(("component_id", "is_late"), [(196, False), (191, True)])
def test_an_answer_to_our_timesync_shows_that_a_slow_clock_is_not_late(
    component_id: int, is_late: bool
) -> None:
    intake, encoder, splitter = Intake(196), Encoder(), FrameSplitter()
    for at_s, frame in flight(60.0, rate=0.4):
        intake.judge(frame, at_s)
        if frame.message_id == HEARTBEAT_ID:
            request = time_sync_request(component_id, at_s)
            for answer_ns in (0, 123_000_000):  # a request comes back, and is answered
                answer = mavlink.MAVLink_timesync_message(answer_ns, request.ts1)
                (raw,) = splitter.feed_datagram(encoder.encode(answer, 1, 1))
                received = intake.judge(raw, at_s + 0.05)
                assert (received is not None) == (answer_ns != 0 and component_id == 196)
    assert (intake.past > 0) is is_late


@pytest.mark.parametrize("between", [3, 45])
def test_a_heartbeat_that_arrives_after_a_newer_one_is_of_the_past(between: int) -> None:
    sent = frames(([HEARTBEAT] + [OTHER] * between) * 8)
    heartbeats = [frame for frame in sent if frame.message_id == HEARTBEAT_ID]
    late, later = heartbeats[4], heartbeats[5]
    clocks = VehicleClocks()
    order = [frame for frame in sent if frame is not late]
    order.insert(order.index(later) + 2, late)
    verdicts = {id(frame): clocks.judge(frame, 0.0).origin for frame in order}
    is_known = between <= 31  # further behind, the numbers could be those of another path
    assert verdicts[id(late)] is (Origin.PAST if is_known else Origin.PRESENT)
    assert all(verdicts[id(frame)] is Origin.PRESENT for frame in order if frame is not late)


def test_a_repeated_heartbeat_is_of_the_past() -> None:
    clocks, (frame,) = VehicleClocks(), frames([HEARTBEAT])
    assert clocks.judge(frame, 0.0).origin is Origin.PRESENT
    assert clocks.judge(frame, 0.0).origin is Origin.PAST


@pytest.mark.parametrize("after_s", [0.0, 0.02, 0.2])
def test_a_heartbeat_at_once_after_another_one_is_of_the_present(after_s: float) -> None:
    """ArduPlane sends one at each mode change, besides those that are due."""
    messages = [position(300.0, 47.0), HEARTBEAT, HEARTBEAT]
    clocks, (place, due, at_once) = VehicleClocks(), frames(messages)
    assert clocks.judge(place, 1000.0).origin is Origin.PRESENT
    assert clocks.judge(due, 1000.01).origin is Origin.PRESENT
    assert clocks.judge(at_once, 1000.01 + after_s).origin is Origin.PRESENT


def test_no_heartbeat_is_of_the_past_because_of_lost_frames() -> None:
    sent = frames(([HEARTBEAT] + [OTHER] * 9) * 40)
    clocks = VehicleClocks()
    kept = [frame for number, frame in enumerate(sent) if number % 7 in (0, 3)]
    assert {clocks.judge(frame, number / 50).origin for number, frame in enumerate(kept)} == {Origin.PRESENT}


def test_after_a_restart_without_silence_heartbeats_count_again() -> None:
    clocks = VehicleClocks()
    for frame in frames([HEARTBEAT] * 20):
        clocks.judge(frame, 0.0)
    verdicts = [clocks.judge(frame, 0.1).origin for frame in frames([HEARTBEAT] * 20)]
    assert verdicts[-1] is Origin.PRESENT


def test_every_sender_has_its_own_numbers() -> None:
    clocks = VehicleClocks()
    mixed = zip(frames([HEARTBEAT] * 5, 1), frames([OTHER] * 3 + [HEARTBEAT] * 5, 2)[3:], strict=True)
    for ours, theirs in mixed:
        assert clocks.judge(ours, 0.0).origin is Origin.PRESENT
        assert clocks.judge(theirs, 0.0).origin is Origin.PRESENT


def test_a_restart_without_silence_is_no_other_vehicle() -> None:
    before, after = flight(30.0), flight(20.0, from_s=1030.0, boot_s=0.1)
    verdicts = origins(before, after)
    assert verdicts[Origin.OTHER] == 0
    assert Origin.PAST not in origins(before, after, after_s=1031.6)
