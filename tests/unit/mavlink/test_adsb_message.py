"""ADSB_VEHICLE from a report: what is read from it is what was said, and flags mark what is known."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.mavlink.dialect import Encoder, mavlink
from companion.mavlink.facts import Traffic
from companion.mavlink.framing import FrameSplitter
from companion.mavlink.translate import frame_to_fact
from companion.mavlink.translate.adsb import vehicle_message
from companion.model import AltitudeReference, TrafficKind, TrafficReport, TrafficSource, adsb_key

NOW_S = 1_750_000_000.0
BAROMETRIC, GEOMETRIC = AltitudeReference.BAROMETRIC, AltitudeReference.GEOMETRIC


def read(report: TrafficReport, age_s: float = 0.0) -> TrafficReport:
    raw = Encoder().encode(vehicle_message(report, age_s), 1, 156)
    (frame,) = FrameSplitter().feed_datagram(raw)
    fact = frame_to_fact(frame, NOW_S)
    assert isinstance(fact, Traffic)
    return fact.report


def near(value: float | None, step: float) -> object:
    return None if value is None else pytest.approx(value, abs=step)


@given(
    icao=st.integers(1, 0xFF_FFFF),
    lat_deg=st.floats(-89.9, 89.9),
    lon_deg=st.floats(1.0, 179.9),
    altitude_m=st.floats(-900.0, 39_000.0),
    reference=st.sampled_from([BAROMETRIC, GEOMETRIC]),
    course_rad=st.none() | st.floats(0.0, math.tau),
    ground_speed_mps=st.none() | st.floats(0.0, 1e4),
    climb_mps=st.none() | st.floats(-1e3, 1e3),
    callsign=st.none() | st.text("ABC129", min_size=1, max_size=8),
    squawk=st.none() | st.sampled_from([1200, 7700, 7]),
    kind=st.sampled_from(TrafficKind),
    simulated=st.booleans(),
    age_s=st.floats(0.0, 1e6),
)
def test_what_is_sent_is_what_is_read(reference: AltitudeReference, age_s: float, **values: object) -> None:
    icao = values["icao"]
    assert isinstance(icao, int)
    sent = TrafficReport(TrafficSource.ADSB, adsb_key(icao), NOW_S, altitude_reference=reference, **values)  # type: ignore[arg-type]
    got = read(sent, age_s)
    assert (got.key, got.icao, got.callsign, got.squawk) == (sent.key, icao, sent.callsign, sent.squawk)
    assert (got.kind, got.simulated, got.altitude_reference) == (sent.kind, sent.simulated, reference)
    assert got.lat_deg == near(sent.lat_deg, 1e-7)
    assert got.lon_deg == near(sent.lon_deg, 1e-7)
    assert got.altitude_m == near(sent.altitude_m, 1e-3)
    assert got.time_s == NOW_S - min(int(age_s), 254)
    if sent.course_rad is None:
        assert got.course_rad is None
    else:
        assert got.course_rad is not None
        assert abs(math.remainder(got.course_rad - sent.course_rad, math.tau)) < 2e-4
    speed_mps, climb_mps = sent.ground_speed_mps, sent.climb_mps
    assert got.ground_speed_mps == near(None if speed_mps is None else min(speed_mps, 655.34), 0.006)
    assert got.climb_mps == near(None if climb_mps is None else max(min(climb_mps, 327.66), -327.67), 0.006)


def test_unknown_values_have_no_flag_and_are_zero() -> None:
    report = TrafficReport(TrafficSource.FLARM, "", NOW_S, 48.0, 11.0, 500.0, icao=5, airborne=True)
    message = vehicle_message(report, 0.0)
    assert message.flags == mavlink.ADSB_FLAGS_VALID_COORDS | mavlink.ADSB_FLAGS_VALID_ALTITUDE
    assert (message.heading, message.hor_velocity, message.ver_velocity, message.squawk) == (0, 0, 0, 0)
    assert message.altitude_type == mavlink.ADSB_ALTITUDE_TYPE_GEOMETRIC


def test_a_report_without_a_place_cannot_be_sent() -> None:
    with pytest.raises(ValueError, match="cannot be sent"):
        vehicle_message(TrafficReport(TrafficSource.ADSB, "000005", NOW_S, icao=5), 0.0)
