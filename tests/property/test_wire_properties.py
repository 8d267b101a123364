"""Properties of frames, facts and logs, for any bytes and any messages."""

import math
import struct
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega

from companion.errors import LogError
from companion.mavlink.dialect import Encoder, mavlink
from companion.mavlink.facts import Fact, OwnPosition, Parameter, Traffic
from companion.mavlink.framing import (
    MAX_FRAME_BYTES,
    Frame,
    FrameSplitter,
    UnknownFrame,
    decode,
    frame_at,
)
from companion.mavlink.tlog import read_tlog
from companion.mavlink.translate import WANTED, frame_to_fact, to_fact

# The same examples every time, and no deadline, so that a busy machine fails no test.
settings.register_profile(
    "wire", derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
WIRE = settings.get_profile("wire")

ANY_BYTES = st.binary(max_size=400)
MAGIC_BYTES = st.lists(st.sampled_from([b"\xfd", b"\xfe", b"\x00", b"\x09", b"\xff"]), max_size=60).map(
    b"".join
)
JUNK = ANY_BYTES | MAGIC_BYTES


@st.composite
def raw_frames(draw: st.DrawFn, ids: st.SearchStrategy[int] | None = None) -> bytes:
    """A frame of any message with any content, packed by pymavlink: version 1 or 2, signed or not."""
    known = st.sampled_from(sorted(ardupilotmega.mavlink_map))
    kind = ardupilotmega.mavlink_map[draw(ids if ids is not None else known)]
    packer = ardupilotmega.MAVLink(None, draw(st.integers(0, 255)), draw(st.integers(0, 255)))
    packer.seq = draw(st.integers(0, 255))
    as_v1 = kind.id < 256 and draw(st.booleans())
    if not as_v1 and draw(st.booleans()):
        packer.signing.secret_key = b"s" * 32
        packer.signing.sign_outgoing = True
    payload = draw(st.binary(min_size=kind.unpacker.size, max_size=kind.unpacker.size))
    message = ardupilotmega.MAVLink_message(kind.id, kind.msgname)
    return bytes(message._pack(packer, kind.crc_extra, payload, force_mavlink1=as_v1))


WANTED_FRAMES = raw_frames(st.sampled_from(sorted(WANTED)))


def one(raw: bytes) -> Frame:
    (frame,) = FrameSplitter().feed(raw)
    return frame


@given(st.lists(JUNK, max_size=5))
@settings(WIRE)
def test_a_stream_accepts_any_bytes_and_accounts_for_each(pieces: list[bytes]) -> None:
    splitter = FrameSplitter()
    frames = [frame for piece in pieces for frame in splitter.feed(piece)]
    assert len(splitter._kept) <= MAX_FRAME_BYTES
    frames += splitter.flush()
    counters = splitter.counters
    assert counters.frames == len(frames)
    if not counters.unknown:
        assert counters.bad_bytes + sum(len(frame.raw) for frame in frames) == sum(map(len, pieces))


@given(raw_frames())
@settings(WIRE)
def test_every_frame_packed_by_pymavlink_is_read_and_decoded(raw: bytes) -> None:
    frame = one(raw)
    assert frame.raw == raw
    theirs = ardupilotmega.MAVLink(None).decode(bytearray(raw))
    header = theirs.get_header()
    assert (frame.message_id, frame.sequence) == (header.msgId, header.seq)
    assert (frame.system_id, frame.component_id) == (header.srcSystem, header.srcComponent)
    message = decode(frame)
    assert message is not None
    assert message.get_type() == theirs.get_type()


@given(st.lists(st.tuples(JUNK, raw_frames()), min_size=1, max_size=4), JUNK, st.data())
@settings(WIRE, max_examples=60)
def test_frames_are_read_with_any_bytes_between_them(
    parts: list[tuple[bytes, bytes]], tail: bytes, data: st.DataObject
) -> None:
    stream = b"".join(junk + raw for junk, raw in parts) + tail
    assume(not any(isinstance(frame_at(stream, at), UnknownFrame) for at in range(len(stream))))
    splitter = FrameSplitter()
    cut = data.draw(st.integers(0, len(stream)))
    found = [*splitter.feed(stream[:cut]), *splitter.feed(stream[cut:]), *splitter.flush()]
    raws = [frame.raw for frame in found]
    assert raws == [frame.raw for frame in FrameSplitter().feed_datagram(stream)]
    for _, raw in parts:
        assert raw in raws


@given(raw_frames(), st.integers(0, 10_000), st.integers(1, 255))
@settings(WIRE)
def test_a_damaged_frame_is_never_accepted(raw: bytes, at: int, change: int) -> None:
    frame = one(raw)
    at %= len(raw) - (13 if frame.signed else 0)
    damaged = raw[:at] + bytes((raw[at] ^ change,)) + raw[at + 1 :]
    assert all(found.raw != damaged for found in FrameSplitter().feed_datagram(damaged))


@given(WANTED_FRAMES, st.floats(0.0, 1e9))
@settings(WIRE, max_examples=400)
def test_any_content_gives_the_same_finite_fact_in_both_ways(raw: bytes, now_s: float) -> None:
    frame = one(raw)
    fact = frame_to_fact(frame, now_s)
    assert fact == to_fact(decode(frame), now_s)
    assert all(math.isfinite(number) for number in numbers_in(fact))


def numbers_in(value: object) -> list[float]:
    if isinstance(value, float):
        return [value]
    if isinstance(value, tuple):
        return [number for part in value for number in numbers_in(part)]
    names = getattr(type(value), "__slots__", ())
    return [number for name in names for number in numbers_in(getattr(value, name))]


def sent_and_received(message: Any) -> Fact | None:
    return frame_to_fact(one(Encoder().encode(message, 1, 1)), 1000.0)


@given(
    icao=st.integers(0, 2**32 - 1),
    lat=st.integers(-900_000_000, 900_000_000),
    lon=st.integers(-1_800_000_000, 1_800_000_000).filter(bool),
    altitude=st.integers(-1_000_000, 40_000_000),
    heading=st.integers(0, 35_999),
    speed=st.integers(0, 2**16 - 2),
    climb=st.integers(-(2**15), 2**15 - 2),
    tslc=st.integers(0, 255),
    squawk=st.lists(st.integers(0, 7), min_size=4, max_size=4),
)
@settings(WIRE)
def test_a_traffic_report_has_the_values_of_its_message(
    icao: int,
    lat: int,
    lon: int,
    altitude: int,
    heading: int,
    speed: int,
    climb: int,
    tslc: int,
    squawk: list[int],
) -> None:
    code = int("".join(map(str, squawk)))
    message = mavlink.MAVLink_adsb_vehicle_message(
        icao, lat, lon, 1, altitude, heading, speed, climb, b"A", 1, tslc, 0xBF, code
    )
    fact = sent_and_received(message)
    assert isinstance(fact, Traffic)
    report = fact.report
    assert None not in (report.lat_deg, report.lon_deg, report.altitude_m, report.course_rad)
    assert (report.icao, report.squawk) == (icao, code)
    assert round((report.lat_deg or 0.0) * 1e7) == lat
    assert round((report.lon_deg or 0.0) * 1e7) == lon
    assert round((report.altitude_m or 0.0) * 1e3) == altitude
    assert round(math.degrees(report.course_rad or 0.0) * 100) == heading
    assert report.ground_speed_mps == speed / 100
    assert report.climb_mps == climb / 100
    assert 1000.0 - report.time_s == (0 if tslc == 255 else tslc), "the largest age is an unknown one"


@given(st.tuples(*[st.integers(-(2**15), 2**15 - 1)] * 3), st.integers(-(2**31), 2**31 - 1))
@settings(WIRE)
def test_own_velocity_and_altitude_keep_their_signs(velocity_cmps: tuple[int, int, int], alt_mm: int) -> None:
    message = mavlink.MAVLink_global_position_int_message(0, 1, 1, alt_mm, alt_mm, *velocity_cmps, 0)
    fact = sent_and_received(message)
    assert isinstance(fact, OwnPosition)
    assert tuple(round(speed * 100) for speed in fact.velocity_mps) == velocity_cmps
    assert round(fact.altitude_m * 1000) == round(fact.height_above_home_m * 1000) == alt_mm


@given(st.integers(-(2**22), 1_065_353_215))
@settings(WIRE)
def test_an_integer_parameter_is_read_in_both_encodings(value: int) -> None:
    (as_bits,) = struct.unpack("<f", struct.pack("<i", value))
    for wire_value, expected in (
        (as_bits, value),
        (float(value), struct.unpack("<f", struct.pack("<f", value))[0]),
    ):
        message = mavlink.MAVLink_param_value_message(b"P", wire_value, mavlink.MAV_PARAM_TYPE_INT32, 1, 0)
        fact = sent_and_received(message)
        assert isinstance(fact, Parameter)
        assert fact.value == expected


@pytest.fixture(scope="module")
def log_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("logs") / "any.tlog"


@given(st.lists(JUNK | raw_frames(), max_size=8))
@settings(WIRE, max_examples=100)
def test_the_log_reader_accepts_any_bytes(log_path: Path, pieces: list[bytes]) -> None:
    log_path.write_bytes(b"".join(pieces))
    try:
        reader = read_tlog(log_path)
        found = sum(1 for _ in reader)
    except LogError:
        return
    assert found == reader.messages > 0


@given(st.lists(st.tuples(JUNK, st.integers(0, 2**55), raw_frames()), min_size=1, max_size=6))
@settings(WIRE, max_examples=60)
def test_every_record_of_a_damaged_log_is_found_with_its_stamp(
    log_path: Path, parts: list[tuple[bytes, int, bytes]]
) -> None:
    data = b"".join(junk + time_us.to_bytes(8, "big") + raw for junk, time_us, raw in parts)
    assume(not any(isinstance(frame_at(data, at), UnknownFrame) for at in range(len(data))))
    log_path.write_bytes(data)
    found = [(time_us, frame.raw) for time_us, frame in read_tlog(log_path)]
    for _, time_us, raw in parts:
        assert (time_us, raw) in found
