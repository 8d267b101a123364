"""Beast binary and AVR lines: framing, escapes, damage, and memory."""

from collections import Counter

import pytest

from companion.model import TrafficSource
from companion.sources.beast import BeastDecoder, BeastFrame, BeastFramer
from sim.receivers import mode_s
from sim.receivers.beast import BeastEncoder, frame
from sim.receivers.encoder import Reception
from tests.support.adsb_receivers import PLACE, aircraft, distance_m, reports

LONG = bytes.fromhex("8D4840D6202CC371C32CE0576098")
SHORT = mode_s.all_call(0x4840D6)
# By hand: the escape byte, type 3, the time 0x1A, the signal level 0x1A (both doubled), the message.
GOLDEN = bytes.fromhex("1A33 0000000000 1A1A 1A1A") + LONG
FRAME = BeastFrame(LONG, 0x1A, 0x1A)


def framed(stream: bytes) -> tuple[list[BeastFrame], Counter[str]]:
    bad: Counter[str] = Counter()
    return BeastFramer(bad).feed(stream), bad


def flight(seconds: float = 3.0) -> list[bytes]:
    """The stream of one aircraft, one piece for each moment."""
    encoder = BeastEncoder()
    return [
        b"".join(encoder.encode(Reception(1.7e9 + 0.5 * step, [aircraft()])))
        for step in range(round(2 * seconds))
    ]


def test_a_frame_has_time_signal_and_message() -> None:
    assert framed(GOLDEN) == ([FRAME], Counter())


def test_frames_of_all_lengths() -> None:
    stream = frame(bytes(2), 0.0) + frame(SHORT, 0.0) + frame(LONG, 0.0)
    frames, bad = framed(stream)
    assert [each.message for each in frames] == [bytes(2), SHORT, LONG]
    assert bad == {}


def test_the_simulated_frame_escapes_as_the_golden_one() -> None:
    assert frame(LONG, 0x1A / 12e6)[:8] == GOLDEN[:8]
    assert framed(frame(b"\x1a" * 14, 0.0))[0][0].message == b"\x1a" * 14


def test_lines_of_digits() -> None:
    digits = LONG.hex()
    stream = f"*{digits};\n@00004D4C4154{digits.upper()};\r\n*0000;\n".encode()
    frames, bad = framed(stream)
    assert frames == [BeastFrame(LONG), BeastFrame(LONG, 0x4D4C4154), BeastFrame(bytes(2))]
    assert bad == {}


def test_both_on_one_stream() -> None:
    assert framed(GOLDEN + b"*" + LONG.hex().encode() + b";\n" + GOLDEN)[0] == [
        FRAME,
        BeastFrame(LONG),
        FRAME,
    ]


@pytest.mark.parametrize("cut", range(1, 3 * len(GOLDEN)))
def test_pieces_cut_anywhere(cut: int) -> None:
    stream = 3 * GOLDEN
    bad: Counter[str] = Counter()
    framer = BeastFramer(bad)
    assert framer.feed(stream[:cut]) + framer.feed(stream[cut:]) == 3 * [FRAME]
    assert bad == {}


def test_pieces_of_one_byte() -> None:
    bad: Counter[str] = Counter()
    framer = BeastFramer(bad)
    stream = GOLDEN + f"*{LONG.hex()};\n".encode() + GOLDEN
    assert [each.message for byte in stream for each in framer.feed(bytes((byte,)))] == 3 * [LONG]
    assert bad == {}


def test_a_truncated_frame_costs_one_frame() -> None:
    for cut in range(2, len(GOLDEN)):
        frames, bad = framed(GOLDEN + GOLDEN[:cut] + 2 * GOLDEN)
        assert frames.count(FRAME) >= 2
        assert sum(bad.values()) <= 2


@pytest.mark.parametrize("kind", [b"4", b"5", b"\xe3", b"\xe4", b"\xe8"])
def test_other_frames_are_skipped(kind: bytes) -> None:
    other = b"\x1a" + kind + b"ab*@\x1a\x1acd\x1a\x1a\n1"
    assert framed(GOLDEN + other + GOLDEN) == ([FRAME, FRAME], Counter())


def test_what_is_no_frame_is_counted() -> None:
    assert framed(b"junk" + GOLDEN + b"\x1aX" + GOLDEN) == (
        [FRAME, FRAME],
        Counter({"not a frame": 1, "unknown type of frame": 1}),
    )


@pytest.mark.parametrize(
    "line", [b"*8D4840;", b"*;", b"*8D4X;", b"*" + b"8" * 60 + b";", b"@00;", b"*8D48\n"]
)
def test_a_bad_line_is_counted(line: bytes) -> None:
    frames, bad = framed(line + b"\n" + GOLDEN)
    assert frames == [FRAME]
    assert sum(bad.values()) >= 1


def test_any_stream_takes_no_memory() -> None:
    framer = BeastFramer(Counter())
    for piece in (
        b"x" * 9_999,
        b"*" * 9_999,
        b"*" + b"8" * 9_999,
        b"\x1a" * 9_999,
        b"\x1a3" + b"\x1a\x1a" * 9_999,
    ):
        for _ in range(3):
            framer.feed(piece)
            assert len(framer._rest) < 60


def test_a_new_connection_forgets_half_a_frame() -> None:
    decoder = BeastDecoder()
    decoder.feed(GOLDEN[:-3], 0.0)
    decoder.restart()
    decoder.feed(GOLDEN, 0.0)
    assert (decoder.counters.messages, decoder.counters.bad) == (1, {})


def test_the_simulated_receiver_is_understood() -> None:
    decoder = BeastDecoder()
    found = reports(decoder, flight(4.0))
    assert len(found) == 5
    for report in found:
        assert distance_m(report, PLACE) < 5.1
        assert (report.callsign, report.sil, report.source) == ("KLM1023", 3, TrafficSource.ADSB)
    assert (decoder.counters.reports, decoder.counters.bad) == (5, {})


def test_an_aircraft_on_the_ground_is_found_near_one_in_the_air() -> None:
    encoder, decoder = BeastEncoder(), BeastDecoder()
    parked = aircraft(icao=0x111111, on_ground=True, velocity_mps=(0.0, 0.0, 0.0))
    for step in range(20):
        found = reports(decoder, encoder.encode(Reception(1.7e9 + step, [aircraft(), parked])), step)
    (report,) = [report for report in found if report.icao == 0x111111]
    assert (report.airborne, report.ground_speed_mps) == (False, 0.0)
    assert distance_m(report, PLACE) < 1.5


def test_positions_by_multilateration_have_a_time_of_their_own() -> None:
    decoder, found = BeastDecoder(), []
    for step in range(4):
        message = mode_s.other_squitter(0x4840D6, mode_s.position(aircraft(), is_odd=step % 2 == 1), 2)
        found += reports(decoder, [b"\x1a3\xff\x00MLAT\x00" + message.replace(b"\x1a", b"\x1a\x1a")])
    (report,) = found
    assert report.source is TrafficSource.MLAT


def test_every_flipped_bit_of_a_frame_is_survived_and_not_believed() -> None:
    good = flight(4.0)
    last = good[-1]
    truth = reports(BeastDecoder(), good)[-1]
    for bit in range(8 * len(last)):
        decoder = BeastDecoder()
        reports(decoder, good[:-1])
        damaged = bytearray(last)
        damaged[bit // 8] ^= 1 << bit % 8
        for report in reports(decoder, [bytes(damaged)]):
            assert (report.lat_deg, report.lon_deg, report.altitude_m) == (
                truth.lat_deg,
                truth.lon_deg,
                truth.altitude_m,
            )
