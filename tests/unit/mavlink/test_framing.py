"""Splitting bytes into frames: both versions, signatures, junk, truncation, unknown messages, losses."""

import pytest
from pymavlink.dialects.v20 import ardupilotmega

from companion.mavlink.dialect import Encoder, mavlink
from companion.mavlink.framing import MAX_FRAME_BYTES, Frame, FrameSplitter, LossMeter, StreamCounters, decode

UNKNOWN_ID = 54_321


def heartbeat(sequence: int = 0, system_id: int = 1, component_id: int = 1, **options: bool) -> bytes:
    packer = ardupilotmega.MAVLink(None, system_id, component_id)
    packer.seq = sequence
    return bytes(ardupilotmega.MAVLink_heartbeat_message(1, 3, 81, 10, 4, 3).pack(packer, **options))


def signed_heartbeat() -> bytes:
    packer = ardupilotmega.MAVLink(None, 1, 1)
    packer.signing.secret_key = b"k" * 32
    packer.signing.sign_outgoing = True
    return bytes(ardupilotmega.MAVLink_heartbeat_message(1, 3, 81, 10, 4, 3).pack(packer))


def unknown_frame(payload: bytes = b"\x01\x02\x03", crc_extra: int = 77, sequence: int = 0) -> bytes:
    header = bytes((0xFD, len(payload), 0, 0, sequence, 1, 1)) + UNKNOWN_ID.to_bytes(3, "little")
    checksum = ardupilotmega.x25crc(header[1:] + payload + bytes((crc_extra,)))
    return header + payload + checksum.crc.to_bytes(2, "little")


def raws(frames: list[Frame]) -> list[bytes]:
    return [frame.raw for frame in frames]


@pytest.mark.parametrize(
    ("raw", "signed"),
    [(heartbeat(), False), (heartbeat(force_mavlink1=True), False), (signed_heartbeat(), True)],
    ids=["v2", "v1", "signed"],
)
def test_a_frame_has_all_that_was_received(raw: bytes, signed: bool) -> None:
    (frame,) = FrameSplitter().feed(raw)
    assert frame.raw == raw
    assert (frame.message_id, frame.system_id, frame.component_id, frame.sequence) == (0, 1, 1, 0)
    assert frame.signed == signed
    assert frame.payload == b"\x0a\x00\x00\x00\x01\x03\x51\x04\x03"


@pytest.mark.parametrize("raw", [heartbeat(), heartbeat(force_mavlink1=True), signed_heartbeat()])
def test_a_frame_with_one_wrong_bit_is_refused(raw: bytes) -> None:
    unprotected = 13 if raw == signed_heartbeat() else 0  # the checksum does not cover the signature
    for at in range(len(raw) - unprotected):
        wrong = bytearray(raw)
        wrong[at] ^= 0x10
        splitter = FrameSplitter()
        assert splitter.feed_datagram(bytes(wrong)) == []
        assert splitter.counters.bad_bytes == len(raw)


def test_a_wrong_checksum_is_counted_and_the_next_frame_is_read() -> None:
    wrong = bytearray(heartbeat())
    wrong[-1] ^= 1
    splitter = FrameSplitter()
    assert raws(splitter.feed(bytes(wrong) + heartbeat(1))) == [heartbeat(1)]
    assert splitter.counters == StreamCounters(frames=1, bad_bytes=len(wrong), bad_crc=1)


def test_a_frame_with_an_unknown_flag_is_refused() -> None:
    header = bytes((0xFD, 1, 0x02, 0, 0, 1, 1, 0, 0, 0))
    checksum = ardupilotmega.x25crc(header[1:] + b"\x01" + bytes((ardupilotmega.mavlink_map[0].crc_extra,)))
    splitter = FrameSplitter()
    assert splitter.feed_datagram(header + b"\x01" + checksum.crc.to_bytes(2, "little")) == []


def test_a_stream_may_arrive_in_any_pieces() -> None:
    stream = heartbeat(0) + b"junk" + heartbeat(1, force_mavlink1=True) + signed_heartbeat()
    splitter = FrameSplitter()
    found = [frame for at in range(len(stream)) for frame in splitter.feed(stream[at : at + 1])]
    assert len(found) == 3
    assert splitter.counters.bad_bytes == 4


def test_the_bytes_kept_between_two_pieces_are_bounded() -> None:
    splitter = FrameSplitter()
    for _ in range(100):
        splitter.feed(b"\xfd\xff\x00\x00" * 1000)
        assert len(splitter._kept) <= MAX_FRAME_BYTES


def test_flush_finds_the_frame_behind_a_false_header() -> None:
    splitter = FrameSplitter()
    false_header = b"\xfd\xff\x00\x00\x00\x01\x01\x21\x00\x00"
    assert splitter.feed(false_header + heartbeat()) == []
    assert raws(splitter.flush()) == [heartbeat()]
    assert splitter.counters.bad_bytes == len(false_header)
    assert raws(splitter.feed(heartbeat(1))) == [heartbeat(1)]


def test_a_truncated_datagram_does_not_affect_the_next() -> None:
    splitter = FrameSplitter()
    assert raws(splitter.feed_datagram(heartbeat(0) + heartbeat(1)[:15])) == [heartbeat(0)]
    assert raws(splitter.feed_datagram(heartbeat(2))) == [heartbeat(2)]
    assert splitter.counters.bad_bytes == 15


@pytest.mark.parametrize("size", range(1, 25))
def test_a_piece_of_a_frame_gives_no_frame(size: int) -> None:
    for whole in (heartbeat(), heartbeat(force_mavlink1=True), signed_heartbeat()):
        piece = whole[: min(size, len(whole) - 1)]
        splitter = FrameSplitter()
        assert splitter.feed_datagram(piece) == []
        assert splitter.counters.bad_bytes == len(piece)


def test_the_shortest_message_of_version_one_is_read_at_the_very_end() -> None:
    packer = ardupilotmega.MAVLink(None, 1, 1)
    raw = bytes(ardupilotmega.MAVLink_mission_current_message(7).pack(packer, force_mavlink1=True))
    raw_v1 = raw[:1] + bytes((2,)) + raw[2:8]
    checksum = ardupilotmega.x25crc(raw_v1[1:] + bytes((ardupilotmega.mavlink_map[42].crc_extra,)))
    shortest = raw_v1 + checksum.crc.to_bytes(2, "little")
    assert len(shortest) == 10
    assert raws(FrameSplitter().feed(shortest)) == [shortest]


def test_unknown_messages_are_counted_and_skipped() -> None:
    inner = heartbeat()  # inside the unknown message: not a frame of its own
    splitter = FrameSplitter()
    assert raws(splitter.feed_datagram(unknown_frame(inner) + heartbeat(1))) == [heartbeat(1)]
    assert splitter.counters == StreamCounters(frames=1, unknown=1)


def test_an_unknown_message_at_the_end_of_a_stream_waits_for_the_next_bytes() -> None:
    splitter = FrameSplitter()
    assert splitter.feed(unknown_frame()) == []
    assert splitter.counters.unknown == 0
    assert raws(splitter.feed(heartbeat(1))) == [heartbeat(1)]
    assert splitter.counters == StreamCounters(frames=1, unknown=1)


def test_bytes_that_look_like_an_unknown_message_hide_no_good_frame() -> None:
    false_unknown = unknown_frame(heartbeat(), crc_extra=77)[:-2] + b"\x00\x00" + heartbeat(1)
    found = FrameSplitter().feed_datagram(false_unknown)
    assert raws(found) == [heartbeat(), heartbeat(1)]
    no_frame_behind = unknown_frame(heartbeat()) + b"?" + heartbeat(1)
    assert raws(FrameSplitter().feed_datagram(no_frame_behind)) == [heartbeat(), heartbeat(1)]


@pytest.mark.parametrize(
    ("sequences", "lost"),
    [
        ([7], 0),
        ([7, 8, 9], 0),
        ([254, 255, 0, 1], 0),
        ([7, 9], 1),
        ([250, 2], 7),
        ([7, 7, 8], 0),
        ([5, 7, 6, 8], 1),
        ([0, 127], 126),
        ([200, 1, 2], 56),
        ([100, 0, 1, 3], 1),
        ([10, 200, 201, 203], 1),
    ],
    ids=str,
)
def test_losses_by_sequence_numbers(sequences: list[int], lost: int) -> None:
    meter = LossMeter()
    assert sum(meter.lost_before(1, 1, sequence) for sequence in sequences) == lost


def test_each_sender_has_its_own_sequence() -> None:
    splitter = FrameSplitter()
    splitter.feed(heartbeat(3) + heartbeat(200, component_id=2) + heartbeat(90, system_id=2) + heartbeat(4))
    assert splitter.counters.lost == 0


def test_unknown_messages_are_part_of_the_sequence() -> None:
    splitter = FrameSplitter()
    splitter.feed(heartbeat(0) + unknown_frame(sequence=1) + heartbeat(2))
    assert splitter.counters.lost == 0


def test_decode_returns_the_message_and_counts_refused_ones() -> None:
    (frame,) = FrameSplitter().feed(heartbeat())
    message = decode(frame)
    assert message is not None
    assert (message.get_type(), message.custom_mode) == ("HEARTBEAT", 10)
    counters = StreamCounters()
    broken = frame._replace(raw=frame.raw[:-1] + b"\x00\x00")
    assert decode(broken, counters) is None
    assert decode(frame._replace(raw=b"\xfd"), counters) is None
    assert counters.undecodable == 2


def test_a_text_field_of_any_bytes_decodes() -> None:
    packer = ardupilotmega.MAVLink(None, 1, 1)
    raw = ardupilotmega.MAVLink_statustext_message(6, bytes(range(128, 178))).pack(packer)
    (frame,) = FrameSplitter().feed(bytes(raw))
    assert decode(frame) is not None


def test_the_encoder_numbers_the_frames_of_each_sender() -> None:
    encoder = Encoder()
    message = mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3)
    stream = b"".join(encoder.encode(message, 1, component) for component in (196, 196, 1, 196) * 100)
    splitter = FrameSplitter()
    frames = splitter.feed(stream)
    assert [frame.sequence for frame in frames[:4]] == [0, 1, 0, 2]
    assert len(frames) == 400
    assert splitter.counters == StreamCounters(frames=400)
    assert {frame.raw[0] for frame in frames} == {0xFD}
