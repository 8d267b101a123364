"""GDL 90: the worked examples of the specification, unknown values, and damage of every kind."""

import math

import pytest

from companion.mavlink.facts import RECEIVER, ReceiverOwnship, Traffic
from companion.model import AltitudeReference, TrafficKind, TrafficReport, TrafficSource
from companion.sources.gdl90 import Gdl90Decoder
from sim.receivers import Reception
from sim.receivers.gdl90 import Gdl90Encoder, framed
from tests.support.receivers import RECEIVED_S, flipped, heard, transmission

# Specification 2.2.4: GPS valid, 14:51:07 UTC. 3.5.2: N825V over Salem, Oregon, and its checksum.
HEARTBEAT = bytes.fromhex("7E 00 81 41 DB D0 08 02 B3 8B 7E")
TRAFFIC = bytes.fromhex(
    "7E 14 00 AB 45 49 1F EF 15 A8 89 78 0F 09 A9 07 B0 01 20 01 4E 38 32 35 56 20 20 20 00 57 D6 7E"
)
OWNSHIP = framed(b"\x0a" + TRAFFIC[2:29])
ALTITUDE_1000_FT = framed(bytes.fromhex("0B 00 C8 00 0A"))  # 3.8: 1,000 ft, figure of merit 10 m


def device(capabilities: int) -> bytes:
    return framed(b"\x65\x00\x01" + bytes(8) + b"Stratux ".ljust(24) + bytes((0, 0, 0, capabilities)))


def changed(**changes: int) -> bytes:
    """The example with other bytes: `b12=0x0A` is byte 12 of the message."""
    message = bytearray(TRAFFIC[1:29])
    for name, value in changes.items():
        message[int(name[1:])] = value
    return framed(bytes(message))


def report(frame: bytes) -> TrafficReport:
    (fact,) = Gdl90Decoder().feed(frame, RECEIVED_S)
    assert isinstance(fact, Traffic)
    assert fact.sender == RECEIVER
    return fact.report


def test_the_worked_example_of_a_traffic_report() -> None:
    example = report(TRAFFIC)
    assert (example.lat_deg, example.lon_deg) == pytest.approx((44.90708, -122.99488), abs=2e-5)
    assert (example.key, example.icao, example.callsign) == ("AB4549", 0o52642511, "N825V")
    assert (example.source, example.kind) == (TrafficSource.ADSB, TrafficKind.AIRCRAFT)
    assert example.altitude_m == pytest.approx(5000 * 0.3048)
    assert example.altitude_reference is AltitudeReference.BAROMETRIC
    assert example.ground_speed_mps == pytest.approx(123 * 1852 / 3600)
    assert example.course_rad == pytest.approx(math.radians(45.0))
    assert example.climb_mps == pytest.approx(64 * 0.3048 / 60)
    assert (example.airborne, example.alarm, example.time_s) == (True, 0, RECEIVED_S)
    assert example.position_sigma_m == pytest.approx(30.0 / 2.448)
    assert example.containment_m == 25.0
    assert (example.sil, example.velocity_sigma_mps, example.altitude_sigma_m) == (None, None, None)


@pytest.mark.parametrize(
    ("changes", "field", "value"),
    [
        ({"b1": 0x10}, "alarm", 1),
        ({"b1": 0x01}, "key", "ANON-AB4549"),
        ({"b1": 0x01}, "icao", None),
        ({"b1": 0x02}, "key", "AB4549"),
        ({"b1": 0x02}, "source", TrafficSource.TISB),
        ({"b1": 0x03}, "key", "TISB-AB4549"),
        ({"b1": 0x03}, "source", TrafficSource.TISB),
        ({"b1": 0x04}, "kind", TrafficKind.SURFACE_VEHICLE),
        ({"b1": 0x05}, "kind", TrafficKind.SURFACE_VEHICLE),
        ({"b1": 0x06}, "source", TrafficSource.ADSR),
        ({"b1": 0x0F}, "key", "GDL90-AB4549"),
        ({"b2": 0, "b3": 0, "b4": 0}, "key", ""),
        ({"b2": 0, "b3": 0, "b4": 0}, "icao", None),
        ({"b5": 0x7F}, "lat_deg", None),
        ({"b11": 0xFF, "b12": 0xF9}, "altitude_m", None),
        ({"b11": 0x00, "b12": 0x09}, "altitude_m", -1000 * 0.3048),
        ({"b11": 0xFF, "b12": 0xE9}, "altitude_m", 101_350 * 0.3048),
        ({"b12": 0x01}, "airborne", False),
        ({"b12": 0x08}, "course_rad", None),
        ({"b12": 0x0A}, "course_rad", None),
        ({"b12": 0x0B}, "course_rad", None),
        ({"b13": 0x00}, "position_sigma_m", None),
        ({"b13": 0x00}, "containment_m", None),
        ({"b13": 0xFF}, "containment_m", None),
        ({"b14": 0xFF, "b15": 0xF0}, "ground_speed_mps", None),
        ({"b14": 0x00, "b15": 0x00}, "ground_speed_mps", 0.0),
        ({"b15": 0xB8, "b16": 0x00}, "climb_mps", None),
        ({"b15": 0xB1, "b16": 0xFF}, "climb_mps", None),
        ({"b15": 0xB1, "b16": 0xFE}, "climb_mps", 510 * 64 * 0.3048 / 60),
        ({"b15": 0xBF, "b16": 0xFF}, "climb_mps", -64 * 0.3048 / 60),
        ({"b17": 0xFF}, "course_rad", math.tau * 255 / 256),
        ({"b18": 14}, "kind", TrafficKind.UAV),
        ({"b18": 18}, "kind", TrafficKind.SURFACE_VEHICLE),
        ({"b18": 19}, "kind", TrafficKind.OBSTACLE),
        ({"b18": 40}, "kind", TrafficKind.AIRCRAFT),
        ({f"b{byte}": 0x20 for byte in range(19, 27)}, "callsign", None),
    ],
    ids=str,
)
def test_each_field_and_its_unknown_value(changes: dict[str, int], field: str, value: object) -> None:
    found = getattr(report(changed(**changes)), field)
    assert found == (pytest.approx(value) if isinstance(value, float) else value)


def test_zero_latitude_longitude_and_integrity_are_no_position() -> None:
    nothing = report(changed(**{f"b{byte}": 0 for byte in (*range(5, 11), 13)}))
    assert (nothing.lat_deg, nothing.lon_deg) == (None, None)
    assert nothing.altitude_m is not None


def test_a_latitude_beyond_the_pole_is_counted() -> None:
    decoder = Gdl90Decoder()
    decoder.feed(changed(b5=0x7F), RECEIVED_S)
    assert decoder.counters.bad == {"position outside the globe": 1}


@pytest.mark.parametrize(
    ("status", "words"),
    [
        (0x81, None),
        (0x01, "no GPS fix"),
        (0xC9, "maintenance required, GPS battery low"),
        (0x41, "no GPS fix, maintenance required"),
    ],
)
def test_the_status_is_that_of_the_last_heartbeat(status: int, words: str | None) -> None:
    decoder = Gdl90Decoder()
    assert decoder.status is None
    decoder.feed(framed(bytes((0, status, 0x41, 0xDB, 0xD0, 8, 2))), RECEIVED_S)
    assert decoder.status == words
    decoder.feed(HEARTBEAT, RECEIVED_S)
    assert decoder.status is None


def ownship(decoder: Gdl90Decoder, *frames: bytes) -> list[TrafficReport]:
    facts = heard(decoder, frames)
    assert all(isinstance(fact, ReceiverOwnship) for fact in facts)
    return [fact.report for fact in facts]


def test_the_ownship_report_comes_again_with_its_geometric_altitude() -> None:
    alone, both = ownship(Gdl90Decoder(), OWNSHIP, ALTITUDE_1000_FT)
    assert (alone.icao, alone.geometric_altitude_m) == (0xAB4549, None)
    assert both.altitude_m == alone.altitude_m
    assert both.geometric_altitude_m == pytest.approx(304.8)


def test_an_altitude_above_the_sea_is_not_taken_for_one_above_the_ellipsoid() -> None:
    assert len(ownship(Gdl90Decoder(), device(0x01), OWNSHIP, ALTITUDE_1000_FT)) == 1
    without_pressure = framed(b"\x0a" + TRAFFIC[2:12] + b"\xff\xf9" + TRAFFIC[14:29])
    _, both = ownship(Gdl90Decoder(), device(0x01), without_pressure, ALTITUDE_1000_FT)
    assert both.altitude_m == pytest.approx(304.8)
    assert (both.altitude_reference, both.geometric_altitude_m) == (AltitudeReference.SEA_LEVEL, None)
    _, above_ellipsoid = ownship(Gdl90Decoder(), device(1), device(0), OWNSHIP, ALTITUDE_1000_FT)
    assert above_ellipsoid.geometric_altitude_m == pytest.approx(304.8)


def test_a_geometric_altitude_of_another_moment_is_not_used() -> None:
    decoder = Gdl90Decoder()
    assert decoder.feed(ALTITUDE_1000_FT, RECEIVED_S) == []
    decoder.feed(OWNSHIP, RECEIVED_S)
    assert decoder.feed(ALTITUDE_1000_FT, RECEIVED_S + 0.9) == []


def test_an_extrapolated_report_is_dropped_only_if_the_target_was_measured() -> None:
    decoder = Gdl90Decoder()
    extrapolated = changed(b12=0x0D)
    assert len(decoder.feed(extrapolated, 0.0)) == 1
    assert len(decoder.feed(TRAFFIC, 1.0)) == 1
    assert decoder.feed(extrapolated, 2.0) == []
    assert len(decoder.feed(extrapolated, 90.0)) == 1
    assert decoder.counters.bad == {"extrapolated": 1}


def test_eight_invented_targets_around_us_are_one_without_a_position() -> None:
    decoder = Gdl90Decoder()
    name = {f"b{19 + at}": letter for at, letter in enumerate(b"MODE\x14S\x00\x00")}
    circle = [changed(b2=0, b3=0, b4=address, **name) for address in range(8)]
    (fact,) = heard(decoder, circle)
    assert isinstance(fact, Traffic)
    assert (fact.report.source, fact.report.key, fact.report.lat_deg) == (TrafficSource.MODE_S, "", None)
    assert fact.report.altitude_m == pytest.approx(5000 * 0.3048)
    assert decoder.counters.bad == {"invented position": 7}


def test_other_messages_are_counted_only() -> None:
    decoder = Gdl90Decoder()
    uplink = framed(b"\x07" + bytes(435))
    attitude = framed(bytes.fromhex("65 01 7F FF 7F FF FF FF FF FF FF FF"))
    assert heard(decoder, [uplink, attitude, framed(b"\xcc\x01"), HEARTBEAT]) == []
    assert (decoder.counters.messages, decoder.counters.reports, +decoder.counters.bad) == (4, 0, {})


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"\x7e\x00\x81\x41\xdb\xd0\x08\x02\xb3\x8c\x7e", "wrong checksum"),
        (b"\x7e\x00\x00\x7e", "truncated"),
        (b"\x7e\x14\x7d\x7e", "wrong escape"),
        (b"\x7e\x14\x7d\x7d\x20\x7e", "wrong escape"),
        (framed(b"\x14\x00\xab"), "wrong length"),
        (framed(b"\x14" + bytes(40)), "wrong length"),
        (b"\x7e" + bytes(2000) + b"\x7e", "too long"),
        (b"\x7e" + bytes(2000), "too long"),
        (b"no frame" + HEARTBEAT, "truncated"),
    ],
    ids=str,
)
def test_bad_frames_are_counted_by_reason_and_the_next_one_is_read(data: bytes, reason: str) -> None:
    decoder = Gdl90Decoder()
    assert decoder.feed(data, RECEIVED_S) == []
    assert decoder.counters.bad == {reason: 1}
    assert len(decoder.feed(TRAFFIC, RECEIVED_S)) == 1


def test_frames_may_share_a_flag() -> None:
    assert len(heard(Gdl90Decoder(), [TRAFFIC + TRAFFIC[1:] + OWNSHIP[1:]])) == 3


def test_the_flag_and_the_escape_within_a_message_are_escaped() -> None:
    frame = changed(b3=0x7E, b4=0x7D)
    assert b"\x7d\x5e\x7d\x5d" in frame
    assert report(frame).icao == 0xAB7E7D


def test_a_stream_cut_anywhere_gives_the_same() -> None:
    stream = HEARTBEAT + TRAFFIC + changed(b3=0x7E, b4=0x7D) + OWNSHIP + ALTITUDE_1000_FT
    whole = heard(Gdl90Decoder(), [stream])
    assert len(whole) == 4
    for cut in range(len(stream) + 1):
        assert heard(Gdl90Decoder(), [stream[:cut], stream[cut:]]) == whole
    assert heard(Gdl90Decoder(), [bytes((byte,)) for byte in stream]) == whole


@pytest.mark.parametrize("frame", [HEARTBEAT, TRAFFIC, OWNSHIP, ALTITUDE_1000_FT])
def test_no_truncated_frame_is_believed(frame: bytes) -> None:
    for length in range(len(frame) - 1):
        decoder = Gdl90Decoder()
        assert heard(decoder, [frame[:length]]) == []
        assert decoder.status is None
        assert len(heard(decoder, [TRAFFIC])) == 1, "the next frame is read"


@pytest.mark.parametrize("frame", [HEARTBEAT, TRAFFIC, OWNSHIP, changed(b3=0x7E, b4=0x7D)])
def test_no_frame_with_a_flipped_bit_is_believed(frame: bytes) -> None:
    for damaged in flipped(frame):
        decoder = Gdl90Decoder()
        assert heard(decoder, [damaged]) == []
        assert decoder.status is None


def test_the_rest_of_a_former_connection_is_forgotten() -> None:
    decoder = Gdl90Decoder()
    decoder.feed(TRAFFIC[:20], RECEIVED_S)
    decoder.restart()
    assert len(decoder.feed(TRAFFIC[20:] + TRAFFIC, RECEIVED_S)) == 1


def test_memory_is_bounded() -> None:
    decoder = Gdl90Decoder()
    for number in range(3000):
        decoder.feed(bytes(400), RECEIVED_S)
        decoder.feed(changed(b3=number >> 8, b4=number & 0xFF), RECEIVED_S)
    assert len(decoder._rest) < 1000
    assert len(decoder._measured_s) <= 1000


def test_the_simulated_receiver_names_itself_once_a_second() -> None:
    encoder, decoder = Gdl90Encoder(), Gdl90Decoder()
    own = transmission(icao=0xABCDEF)
    first = encoder.encode(Reception(RECEIVED_S, [transmission()], own))
    second = encoder.encode(Reception(RECEIVED_S + 0.3, [transmission()], own))
    assert (len(first), len(second)) == (5, 3)
    kinds = [type(fact) for fact in heard(decoder, first)]
    assert kinds == [ReceiverOwnship, ReceiverOwnship, Traffic]
    assert decoder.status is None
    blind = Gdl90Decoder()
    heard(blind, Gdl90Encoder().encode(Reception(RECEIVED_S, [transmission()])))
    assert blind.status == "no GPS fix"
