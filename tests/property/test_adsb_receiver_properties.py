"""Properties of receivers of ADS-B: any aircraft is understood, any bytes are survived."""

import json
import math
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from companion.geodesy import GeoPoint
from companion.model import TrafficReport
from companion.sources.beast import BeastDecoder
from companion.sources.decoder import Decoder
from companion.sources.readsb import ReadsbDecoder
from companion.sources.sbs import SbsDecoder
from sim.receivers import mode_s
from sim.receivers.beast import BeastEncoder, frame
from sim.receivers.encoder import ReceiverEncoder, Reception, Transmission
from sim.receivers.readsb import ReadsbEncoder
from sim.receivers.sbs import SbsEncoder
from tests.support.adsb_receivers import distance_m, reports

# The same examples every time, and no deadline, so that a busy machine fails no test.
settings.register_profile(
    "adsb", derandomize=True, deadline=None, max_examples=60, suppress_health_check=[HealthCheck.too_slow]
)
ADSB = settings.get_profile("adsb")

DECODERS: list[type[Decoder]] = [SbsDecoder, ReadsbDecoder, BeastDecoder]
# Encoder, decoder, and the largest error of a position [m], of an altitude [m] and of a velocity [m/s].
FORMATS: list[tuple[Callable[[], ReceiverEncoder], Callable[[], Decoder], float, float, float]] = [
    (SbsEncoder, SbsDecoder, 0.2, 3.9, 0.3),
    (ReadsbEncoder, ReadsbDecoder, 0.2, 3.9, 0.03),
    (BeastEncoder, BeastDecoder, 5.2, 3.9, 0.4),
]
TRANSMISSIONS = st.builds(
    Transmission,
    icao=st.integers(1, 0xFFFFFF),
    callsign=st.from_regex(r"[A-Z0-9]{1,8}", fullmatch=True),
    # Anywhere but at 0, 0, which means that the position is unknown.
    place=st.builds(GeoPoint, st.floats(0.001, 86.0), st.floats(-180.0, 180.0), st.floats(-300.0, 15_000.0))
    | st.builds(GeoPoint, st.floats(-86.0, -0.001), st.floats(-180.0, 180.0), st.floats(-300.0, 15_000.0)),
    pressure_altitude_m=st.floats(-300.0, 15_000.0),
    velocity_mps=st.tuples(st.floats(-300.0, 300.0), st.floats(-300.0, 300.0), st.floats(-100.0, 100.0)),
    category=st.integers(0, 21),
    nacp=st.integers(0, 11),
    nacv=st.integers(0, 4),
    nic=st.integers(0, 11),
    sil=st.integers(0, 3),
)
ANY_BYTES = st.binary(max_size=300)
JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=9),
    lambda inner: st.lists(inner, max_size=5) | st.dictionaries(st.text(max_size=9), inner, max_size=5),
    max_leaves=20,
)
KEYS = (
    *("hex", "type", "flight", "squawk", "category", "lat", "lon", "seen_pos", "seen", "lastPosition"),
    *("alt_baro", "alt_geom", "altitude", "gs", "speed", "track", "baro_rate", "geom_rate", "vert_rate"),
    *("nic", "rc", "nac_p", "nac_v", "sil", "mlat", "tisb"),
)


def received(encoder: ReceiverEncoder, decoder: Decoder, sent: Transmission) -> list[TrafficReport]:
    """What is reported in two seconds of an aircraft that is at one place."""
    return [
        report
        for step in range(4)
        for report in reports(decoder, encoder.encode(Reception(1.7e9 + 0.5 * step, [sent])), 0.5 * step)
    ]


@pytest.mark.parametrize(("encoder", "decoder", "position_m", "altitude_m", "speed_mps"), FORMATS)
@given(sent=TRANSMISSIONS)
@settings(ADSB)
def test_every_aircraft_is_understood(
    encoder: Callable[[], ReceiverEncoder],
    decoder: Callable[[], Decoder],
    position_m: float,
    altitude_m: float,
    speed_mps: float,
    sent: Transmission,
) -> None:
    report = received(encoder(), decoder(), sent)[-1]
    assert report.icao == sent.icao
    assert distance_m(report, sent.place) < position_m
    assert report.altitude_m == pytest.approx(sent.pressure_altitude_m, abs=altitude_m)
    north_mps, east_mps, down_mps = sent.velocity_mps
    assert report.climb_mps == pytest.approx(-down_mps, abs=0.17)
    assert report.ground_speed_mps == pytest.approx(math.hypot(north_mps, east_mps), abs=speed_mps)
    assert report.callsign == sent.callsign


@given(sent=TRANSMISSIONS)
@settings(ADSB)
def test_beast_and_readsb_say_the_same_of_accuracy(sent: Transmission) -> None:
    first = received(BeastEncoder(), BeastDecoder(), sent)[-1]
    second = received(ReadsbEncoder(), ReadsbDecoder(), sent)[-1]
    assert (first.position_sigma_m, first.velocity_sigma_mps) == (
        second.position_sigma_m,
        second.velocity_sigma_mps,
    )
    assert (first.containment_m, first.sil, first.kind) == (second.containment_m, second.sil, second.kind)


@pytest.mark.parametrize("decoder", DECODERS)
@given(pieces=st.lists(ANY_BYTES, max_size=6))
@settings(ADSB)
def test_any_bytes_are_survived(decoder: type[Decoder], pieces: list[bytes]) -> None:
    receiver = decoder()
    for number, piece in enumerate(pieces):
        receiver.feed(piece, float(number))
        assert receiver.status is None
    assert receiver.counters.reports == 0


@given(lines=st.lists(st.text("MSGLAT,0123456789.-~ABCDEF\r\nH:/ ", max_size=200), max_size=6))
@settings(ADSB)
def test_any_lines_are_survived(lines: list[str]) -> None:
    receiver = SbsDecoder()
    for line in lines:
        receiver.feed(line.encode(), 0.0)


@given(fields=st.lists(st.text("0123456789.-~ABCDEFH ", max_size=9), min_size=22, max_size=22))
@settings(ADSB)
def test_any_fields_are_survived(fields: list[str]) -> None:
    for kind in range(1, 9):
        line = ",".join(["MSG", str(kind), *fields[2:4], "4840D6", *fields[5:]]) + "\n"
        for report in reports(SbsDecoder(), [line.encode()]):
            assert_sane(report)


@given(document=JSON)
@settings(ADSB)
def test_any_document_is_survived(document: Any) -> None:
    ReadsbDecoder().feed(json.dumps(document).encode(), 0.0)


@given(entry=st.dictionaries(st.sampled_from(KEYS), JSON | st.floats(-400.0, 400.0)), now=JSON)
@settings(ADSB)
def test_any_entry_is_survived(entry: dict[str, Any], now: Any) -> None:
    document = {"now": now, "aircraft": [{"hex": "4840d6", "lat": 47.0, "lon": 8.0, **entry}]}
    for report in reports(ReadsbDecoder(), [json.dumps(document).encode()]):
        assert_sane(report)


@given(contents=st.lists(st.tuples(st.integers(0, 2**56 - 1), st.integers(-1, 7)), max_size=60))
@settings(ADSB)
def test_any_squitters_are_survived(contents: list[tuple[int, int]]) -> None:
    """All of one aircraft, with the right parity."""
    receiver = BeastDecoder()
    for number, (content, control) in enumerate(contents):
        if control < 0:
            raw = mode_s.squitter(0x4840D6, content)
        else:
            raw = mode_s.other_squitter(0x4840D6, content, control)
        for report in reports(receiver, [frame(raw, 0.0)], 0.5 * number):
            assert_sane(report)


@given(
    messages=st.lists(st.binary(min_size=7, max_size=7) | st.binary(min_size=14, max_size=14), max_size=40)
)
@settings(ADSB)
def test_any_messages_are_survived(messages: list[bytes]) -> None:
    receiver = BeastDecoder()
    assert reports(receiver, [frame(message, 0.0) for message in messages]) == []


@given(sent=TRANSMISSIONS, data=st.data())
@settings(ADSB)
def test_pieces_cut_anywhere_say_the_same(sent: Transmission, data: st.DataObject) -> None:
    encoder = BeastEncoder()
    stream = b"".join(
        piece for step in range(4) for piece in encoder.encode(Reception(1.7e9 + 0.5 * step, [sent]))
    )
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=9)))
    pieces = [stream[begin:end] for begin, end in zip([0, *cuts], [*cuts, len(stream)], strict=True)]
    assert reports(BeastDecoder(), pieces) == reports(BeastDecoder(), [stream])


def assert_sane(report: TrafficReport) -> None:
    """Every number is finite and in its range."""
    numbers = [report.altitude_m, report.course_rad, report.ground_speed_mps, report.climb_mps, report.time_s]
    assert all(number is None or math.isfinite(number) for number in numbers)
    if report.lat_deg is not None and report.lon_deg is not None:
        assert abs(report.lat_deg) <= 90.0
        assert abs(report.lon_deg) <= 180.0
    assert report.course_rad is None or 0.0 <= report.course_rad < math.tau
