"""FLARM: what the simulated receiver sends is read within the format's resolution, and any bytes are."""

import math

from hypothesis import given, settings
from hypothesis import strategies as st

from companion.geodesy import LocalFrame
from companion.mavlink.facts import ReceiverOwnship, Traffic
from companion.sources.flarm import FlarmDecoder
from sim.receivers import Reception, Transmission
from sim.receivers.flarm import FlarmEncoder, sentence
from tests.support.receivers import RECEIVED_S, heard, transmissions

FIXED = settings(derandomize=True, deadline=None)
BYTES = st.lists(st.sampled_from([b"$", b"*", b"\n", b",", b"PFLAA", b"$PFLAU,"]) | st.binary(max_size=40))
FIELD = st.text("0123456789ABCDEF.-+!eEn_ ", max_size=9) | st.text(
    st.characters(min_codepoint=0x20, max_codepoint=0x7E, exclude_characters="$*,"), max_size=9
)
NAMES = st.sampled_from(["PFLAA", "PFLAU", "PFLAE", "PGRMZ", "GPRMC", "GNGGA", "PFLAV"])


@given(transmissions(reach_deg=0.2), transmissions(reach_deg=0.05))
@settings(FIXED)
def test_a_transmission_is_read_within_the_resolution(one: Transmission, own: Transmission) -> None:
    facts = heard(FlarmDecoder(), FlarmEncoder().encode(Reception(RECEIVED_S, [one], own)))
    ownship = facts[0]
    assert isinstance(ownship, ReceiverOwnship)
    assert ownship.report.lat_deg is not None
    assert abs(ownship.report.lat_deg - own.place.lat_deg) <= 1e-6
    assert ownship.report.geometric_altitude_m is not None
    assert abs(ownship.report.geometric_altitude_m - own.place.altitude_m) <= 0.06
    frame = LocalFrame(own.place.lat_deg, own.place.lon_deg)
    north_m, east_m = frame.to_north_east_m(one.place.lat_deg, one.place.lon_deg)
    if max(abs(north_m), abs(east_m)) > 32_767:
        assert len(facts) == 1
        return
    traffic = facts[1]
    assert isinstance(traffic, Traffic)
    report = traffic.report
    assert report.icao == one.icao
    assert report.relative_m is not None
    up_m = one.pressure_altitude_m - own.pressure_altitude_m
    for found, sent in zip(report.relative_m, (north_m, east_m, up_m), strict=True):
        assert abs(found - sent) <= 0.51
    north_mps, east_mps, down_mps = one.velocity_mps
    speed_mps = 0.0 if one.on_ground else math.hypot(north_mps, east_mps)
    assert report.ground_speed_mps is not None
    assert abs(report.ground_speed_mps - speed_mps) <= 0.51
    assert report.climb_mps is not None
    assert abs(report.climb_mps - max(min(-down_mps, 32.7), -32.7)) <= 0.051
    assert report.course_rad is not None
    turned_rad = math.remainder(report.course_rad - math.atan2(east_mps, north_mps), math.tau)
    assert abs(turned_rad) <= math.radians(0.51)


@given(st.lists(BYTES.map(b"".join), max_size=8))
@settings(FIXED, max_examples=200)
def test_any_bytes_are_survived_and_leave_nothing_behind(pieces: list[bytes]) -> None:
    decoder = FlarmDecoder()
    heard(decoder, pieces)
    assert len(decoder._sentences._rest) <= 256


@given(NAMES, st.lists(FIELD, max_size=16))
@settings(FIXED, max_examples=500)
def test_any_fields_give_finite_numbers_or_a_reason(name: str, fields: list[str]) -> None:
    decoder = FlarmDecoder()
    facts = heard(decoder, [sentence(",".join((name, *fields)))])
    assert decoder.counters.messages == 1
    for fact in facts:
        report = fact.report
        numbers = (report.course_rad, report.ground_speed_mps, report.climb_mps, report.altitude_m)
        numbers += report.relative_m or ()
        assert all(value is None or math.isfinite(value) for value in numbers)
        assert report.alarm in range(4)


@given(st.lists(st.tuples(NAMES, st.lists(FIELD, max_size=12)), min_size=1, max_size=4), st.data())
@settings(FIXED, max_examples=100)
def test_any_sentences_are_read_the_same_in_pieces(
    sentences: list[tuple[str, list[str]]], data: st.DataObject
) -> None:
    stream = b"".join(sentence(",".join((name, *fields))) for name, fields in sentences)
    cut = data.draw(st.integers(0, len(stream)))
    whole, pieces = FlarmDecoder(), FlarmDecoder()
    assert heard(whole, [stream]) == heard(pieces, [stream[:cut], stream[cut:]])
    assert whole.counters == pieces.counters
