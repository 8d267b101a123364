"""GDL 90: what the simulated receiver sends is read within the format's resolution, and any bytes are."""

import math
from itertools import pairwise

from hypothesis import given, settings
from hypothesis import strategies as st

from companion.mavlink.facts import ReceiverOwnship, Traffic
from companion.sources.accuracy import containment_m, position_sigma_m
from companion.sources.gdl90 import Gdl90Decoder
from sim.receivers import Reception, Transmission
from sim.receivers.gdl90 import Gdl90Encoder, framed
from tests.support.receivers import RECEIVED_S, heard, transmissions

FIXED = settings(derandomize=True, deadline=None)
BYTES = st.lists(st.sampled_from([b"\x7e", b"\x7d", b"\x14", b"\x0a", b"\x00"]) | st.binary(max_size=40))


@given(transmissions(), transmissions())
@settings(FIXED)
def test_a_transmission_is_read_within_the_resolution(one: Transmission, own: Transmission) -> None:
    facts = heard(Gdl90Decoder(), Gdl90Encoder().encode(Reception(RECEIVED_S, [one], own)))
    _, ownship, traffic = facts
    assert isinstance(traffic, Traffic)
    assert isinstance(ownship, ReceiverOwnship)
    assert ownship.report.icao == own.icao
    assert ownship.report.geometric_altitude_m is not None
    assert abs(ownship.report.geometric_altitude_m - own.place.altitude_m) <= 0.77
    report = traffic.report
    assert (report.icao, report.callsign or "") == (one.icao, one.callsign)
    assert report.lat_deg is not None or abs(one.place.lat_deg) + abs(one.place.lon_deg) < 1e-4
    assert report.lat_deg is None or abs(report.lat_deg - one.place.lat_deg) <= 1.1e-5
    assert report.lon_deg is None or abs(math.remainder(report.lon_deg - one.place.lon_deg, 360)) <= 1.1e-5
    assert report.altitude_m is not None
    assert abs(report.altitude_m - one.pressure_altitude_m) <= 3.82
    north_mps, east_mps, down_mps = one.velocity_mps
    assert report.ground_speed_mps is not None
    assert abs(report.ground_speed_mps - math.hypot(north_mps, east_mps)) <= 0.26
    assert report.climb_mps is not None
    assert abs(report.climb_mps + down_mps) <= 0.17
    assert report.course_rad is not None
    turned_rad = math.remainder(report.course_rad - math.atan2(east_mps, north_mps), math.tau)
    assert abs(turned_rad) <= math.radians(0.71)
    assert report.airborne == (not one.on_ground)
    assert report.position_sigma_m == position_sigma_m(one.nacp)
    assert report.containment_m == containment_m(one.nic)


@given(st.lists(BYTES.map(b"".join), max_size=8))
@settings(FIXED, max_examples=200)
def test_any_bytes_are_survived_and_leave_nothing_behind(pieces: list[bytes]) -> None:
    decoder = Gdl90Decoder()
    heard(decoder, pieces)
    assert len(decoder._rest) <= 1000


@given(st.binary(max_size=60), st.lists(st.integers(0, 130), max_size=4))
@settings(FIXED, max_examples=200)
def test_any_message_is_read_the_same_in_pieces(message: bytes, cuts: list[int]) -> None:
    stream = framed(message) + framed(b"\x14" + message[:27].ljust(27, b"\0"))
    edges = [0, *sorted(cuts), len(stream)]
    pieces = [stream[start:end] for start, end in pairwise(edges)]
    whole, cut = Gdl90Decoder(), Gdl90Decoder()
    assert heard(whole, [stream]) == heard(cut, pieces)
    assert whole.counters == cut.counters
