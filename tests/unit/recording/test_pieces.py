"""What receivers sent, as frames in the log: whole again, or dropped and counted."""

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.mavlink.facts import Sender
from companion.mavlink.framing import Frame, FrameSplitter, decode
from companion.recording.pieces import PieceReader, PieceWriter, is_piece
from companion.sources.receiver import Piece

US = Sender(1, 196)
ADDRESS = "gdl90:udpin:0.0.0.0:4000"
NOISE = random.Random(1).randbytes


def frames_of(*pieces: Piece) -> list[Frame]:
    writer, splitter = PieceWriter(), FrameSplitter()
    raws = [raw for piece in pieces for raw in writer.frames(piece, US)]
    frames = splitter.feed_datagram(b"".join(raws))
    assert [frame.raw for frame in frames] == raws
    assert splitter.counters.bad_bytes == splitter.counters.lost == 0
    return frames


def read(frames: list[Frame]) -> tuple[list[Piece], int]:
    reader = PieceReader()
    pieces = [piece for frame in frames if (piece := reader.add(frame)) is not None]
    return pieces, reader.lost


A_PIECE = st.builds(
    Piece, st.sampled_from([ADDRESS, "é", "x" * 200]), st.binary(max_size=2000), st.booleans()
)


@given(st.lists(A_PIECE))
def test_they_come_back_as_they_were(pieces: list[Piece]) -> None:
    assert read(frames_of(*pieces)) == (pieces, 0)


def test_trailing_zeros_and_nothing_come_back() -> None:
    pieces = [Piece(ADDRESS, bytes(300)), Piece(ADDRESS, b""), Piece(ADDRESS, b"a\0\0")]
    assert read(frames_of(*pieces)) == (pieces, 0)


def test_the_frames_are_tunnel_messages_of_ours_of_a_private_type() -> None:
    (frame,) = frames_of(Piece(ADDRESS, b"~\0\x81~", begins=True))
    assert is_piece(frame)
    assert (frame.system_id, frame.component_id) == US
    message = decode(frame)
    assert message is not None
    assert message.get_type() == "TUNNEL"
    assert message.payload_type >= 32768
    assert b"~\0\x81~" in bytes(message.payload)


def test_documents_are_deflated_and_noise_is_not() -> None:
    document = b'{"hex":"3c6589","lat":48.1,"lon":11.5},' * 1000
    assert len(frames_of(Piece(ADDRESS, document))) < len(document) / 120 / 10
    noise = NOISE(5000)
    assert read(frames_of(Piece(ADDRESS, noise))) == ([Piece(ADDRESS, noise)], 0)


PIECES = [Piece(ADDRESS, NOISE(500)), Piece(ADDRESS, NOISE(500)), Piece(ADDRESS, b"last")]


@pytest.mark.parametrize("missing", range(11))
def test_a_missing_frame_costs_its_piece_and_is_counted(missing: int) -> None:
    frames = frames_of(*PIECES)
    assert len(frames) == 11
    pieces, lost = read(frames[:missing] + frames[missing + 1 :])
    assert len(pieces) == 2
    assert lost == (0 if missing == 10 else 1), "after the last one nothing is missed"


def test_whole_pieces_that_are_missing_are_counted() -> None:
    pieces = [Piece(ADDRESS, bytes((number,))) for number in range(20)]
    frames = frames_of(*pieces)
    assert read(frames[:5] + frames[12:]) == (pieces[:5] + pieces[12:], 7)


def test_copies_are_dropped() -> None:
    frames = frames_of(*PIECES)
    twice = [frame for frame in frames for _ in range(2)]
    assert read(twice)[0] == PIECES


def test_a_second_recording_begins_again() -> None:
    frames = frames_of(*PIECES)
    assert read(frames + frames)[0] == PIECES + PIECES


@given(st.integers(0, 3), st.binary(min_size=1, max_size=140), st.data())
def test_damaged_payloads_are_survived(index: int, damage: bytes, data: st.DataObject) -> None:
    frames = frames_of(*PIECES)
    at = data.draw(st.integers(12, 145))
    raw = bytearray(frames[index].raw)
    raw[at : at + len(damage)] = damage[: max(len(raw) - at, 0)]
    frames[index] = frames[index]._replace(raw=bytes(raw))
    pieces, _ = read(frames)
    assert len(pieces) <= len(PIECES)


def test_what_inflates_without_end_is_bounded() -> None:
    bomb = frames_of(Piece(ADDRESS, bytes(40 << 20)))
    pieces, _ = read(bomb)
    assert sum(len(piece.data) for piece in pieces) < 10 << 20


def test_what_is_too_large_is_counted_when_it_is_read() -> None:
    writer = PieceWriter()
    raws = [raw for data in (b"a", NOISE(9 << 20), b"b") for raw in writer.frames(Piece(ADDRESS, data), US)]
    assert len(raws) == 2
    assert read(FrameSplitter().feed_datagram(b"".join(raws)))[1] == 1
