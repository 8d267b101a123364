"""What the simulated receivers that speak MAVLink send is read within the resolution of their messages."""

import math

from hypothesis import given, settings

from companion.mavlink.facts import Sender, Traffic
from companion.mavlink.framing import FrameSplitter
from companion.mavlink.translate import frame_to_fact
from companion.model import AltitudeReference, TrafficReport, TrafficSource
from sim.receivers import Reception, Transmission
from sim.receivers.mavlink import ADSB_RECEIVER, REMOTE_ID_RECEIVER, MavlinkEncoder, RemoteIdEncoder
from tests.support.receivers import RECEIVED_S, transmissions

FIXED = settings(derandomize=True, deadline=None)


def reports(datagrams: list[bytes], address: tuple[int, int]) -> list[TrafficReport]:
    facts = [frame_to_fact(frame, RECEIVED_S) for data in datagrams for frame in FrameSplitter().feed(data)]
    assert all(isinstance(fact, Traffic) and fact.sender == Sender(*address) for fact in facts)
    return [fact.report for fact in facts if isinstance(fact, Traffic)]


def assert_moves_as(report: TrafficReport, one: Transmission) -> None:
    north_mps, east_mps, down_mps = one.velocity_mps
    assert report.lat_deg is None or abs(report.lat_deg - one.place.lat_deg) <= 1e-7
    assert report.lon_deg is None or abs(report.lon_deg - one.place.lon_deg) <= 1e-7
    assert report.course_rad is not None
    turned_rad = math.remainder(report.course_rad - math.atan2(east_mps, north_mps), math.tau)
    assert abs(turned_rad) <= math.radians(0.0051)
    assert report.climb_mps is not None
    assert abs(report.climb_mps + max(min(down_mps, 62.0), -62.0)) <= max(0.0051, abs(down_mps) - 62.0 + 0.01)


@given(transmissions())
@settings(FIXED)
def test_an_adsb_report_is_read_within_the_resolution(one: Transmission) -> None:
    (report,) = reports(MavlinkEncoder().encode(Reception(RECEIVED_S, [one])), ADSB_RECEIVER)
    assert_moves_as(report, one)
    assert (report.icao, report.callsign or "") == (one.icao, one.callsign)
    assert report.altitude_reference is AltitudeReference.BAROMETRIC
    assert report.altitude_m is not None
    assert abs(report.altitude_m - one.pressure_altitude_m) <= 0.00051
    assert report.ground_speed_mps is not None
    assert abs(report.ground_speed_mps - math.hypot(*one.velocity_mps[:2])) <= 0.0051


@given(transmissions(speed_mps=150.0))
@settings(FIXED)
def test_a_remote_id_is_read_within_the_resolution(one: Transmission) -> None:
    datagrams = RemoteIdEncoder().encode(Reception(RECEIVED_S, [one]))
    name, report = reports(datagrams, REMOTE_ID_RECEIVER)
    assert_moves_as(report, one)
    assert (name.key, name.callsign or "") == (report.key, one.callsign)
    assert report.source is TrafficSource.REMOTE_ID
    assert report.altitude_m is not None
    assert abs(report.altitude_m - one.pressure_altitude_m) <= 0.001
    assert report.geometric_altitude_m is not None
    assert abs(report.geometric_altitude_m - one.place.altitude_m) <= 0.001
    assert report.airborne == (not one.on_ground)
