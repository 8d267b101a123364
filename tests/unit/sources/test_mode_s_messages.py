"""Simulated Mode S messages, read by another implementation: pyModeS."""

import math

import pyModeS
import pytest

from sim.receivers import mode_s
from tests.support.adsb_receivers import PLACE, aircraft

ADDRESS = 0x4840D6


def read(content: int) -> pyModeS.Decoded:
    message = pyModeS.Message(mode_s.squitter(ADDRESS, content))
    assert (message.df, message.icao, message.crc_valid) == (17, "4840D6", True)
    return message.decode(
        reference=(PLACE.lat_deg + 0.3, PLACE.lon_deg - 0.3), surface_ref=(PLACE.lat_deg, PLACE.lon_deg + 0.1)
    )


# From "The 1090 Megahertz Riddle": identification, position, velocity.
@pytest.mark.parametrize(
    "recorded",
    ["8D4840D6202CC371C32CE0576098", "8D40621D58C382D690C8AC2863A7", "8D485020994409940838175B284F"],
)
def test_the_parity_is_that_of_recorded_messages(recorded: str) -> None:
    message = bytes.fromhex(recorded)
    assert mode_s.with_parity(message[:-3]) == message


@pytest.mark.parametrize("is_odd", [False, True])
def test_a_position(is_odd: bool) -> None:
    fields = read(mode_s.position(aircraft(nic=9), is_odd=is_odd))
    assert (fields.typecode, fields.nic_b, fields.cpr_format) == (11, 1, is_odd)
    assert fields.latitude == pytest.approx(PLACE.lat_deg, abs=5e-5)
    assert fields.longitude == pytest.approx(PLACE.lon_deg, abs=5e-5)
    assert fields.altitude == 3600  # 1100 m are 3608.9 ft


@pytest.mark.parametrize("altitude_ft", [-1000, -975, 0, 25, 3600, 11_450, 38_000, 50_175])
def test_altitudes(altitude_ft: int) -> None:
    assert read(
        mode_s.position(aircraft(pressure_altitude_m=altitude_ft * 0.3048), is_odd=False)
    ).altitude == (altitude_ft)


def test_an_altitude_that_has_no_code_is_unknown() -> None:
    assert read(mode_s.position(aircraft(pressure_altitude_m=16_000.0), is_odd=False)).altitude is None


def test_a_position_on_the_ground() -> None:
    taxiing = aircraft(on_ground=True, velocity_mps=(0.0, -8.0, 0.0))
    fields = read(mode_s.position(taxiing, is_odd=True))
    assert fields.latitude == pytest.approx(PLACE.lat_deg, abs=1.2e-5)
    assert fields.longitude == pytest.approx(PLACE.lon_deg, abs=1.7e-5)
    assert fields.groundspeed == pytest.approx(15.55, abs=1.0)
    assert fields.track == 270.0


@pytest.mark.parametrize(
    "speed_kt", [0.0, 0.1, 0.2, 1.0, 1.9, 2.4, 14.0, 15.0, 69.0, 71.0, 99.0, 101.0, 180.0]
)
def test_speeds_on_the_ground(speed_kt: float) -> None:
    moving = aircraft(on_ground=True, velocity_mps=(speed_kt * 1852 / 3600 + 1e-9, 0.0, 0.0))
    read_kt = read(mode_s.position(moving, is_odd=False)).groundspeed
    assert min(speed_kt, 175.0) - 5.0 < read_kt <= min(speed_kt + 1e-6, 175.0)
    assert read_kt == pytest.approx(min(speed_kt, 175.0), rel=0.05, abs=0.5)


def test_a_velocity() -> None:
    fields = read(mode_s.velocity(aircraft()))
    assert (fields.subtype, fields.nac_v, fields.groundspeed) == (1, 2, 97)  # 50 m/s are 97.2 kt
    assert fields.track == pytest.approx(math.degrees(math.atan2(-40.0, 30.0)) % 360.0, abs=0.6)
    assert (fields.vertical_rate, fields.vr_source) == (384, "BARO")  # 394 ft/min
    assert fields.geo_minus_baro == 450  # 134.5 m are 441 ft


def test_a_difference_of_altitudes_that_has_no_code_is_unknown() -> None:
    assert read(mode_s.velocity(aircraft(pressure_altitude_m=150.0))).geo_minus_baro is None


def test_a_velocity_above_the_speed_of_sound() -> None:
    fields = read(mode_s.velocity(aircraft(velocity_mps=(600.0, -300.0, 100.0))))
    assert (fields.subtype, fields.vertical_rate) == (2, -19712)
    assert fields.groundspeed == pytest.approx(1304.0, abs=4.0)


@pytest.mark.parametrize(
    ("category", "code", "digit"), [(1, 4, 1), (9, 3, 1), (14, 3, 6), (18, 2, 2), (0, 4, 0)]
)
def test_an_identification(category: int, code: int, digit: int) -> None:
    fields = read(mode_s.identification(aircraft(category=category)))
    assert (fields.typecode, fields.category, fields.callsign) == (code, digit, "KLM1023")


@pytest.mark.parametrize("on_ground", [False, True])
def test_an_operational_status(on_ground: bool) -> None:
    fields = read(mode_s.operational_status(aircraft(on_ground=on_ground, nic=7, nacp=10, sil=2)))
    assert (fields.subtype, fields.version, fields.nac_p, fields.sil) == (on_ground, 2, 10, 2)
    assert fields.nic_supplement_a == on_ground
    assert fields.capability_class == (0x10 if on_ground else 0)


def test_replies_to_a_radar() -> None:
    reply = pyModeS.decode(mode_s.altitude_reply(ADDRESS, 11_450.0, status=1).hex())
    assert (reply.df, reply.icao, reply.altitude, reply.flight_status) == (4, "4840D6", 11_450, 1)
    call = pyModeS.Message(mode_s.all_call(ADDRESS))
    assert (call.df, call.icao, call.crc) == (11, "4840D6", 0)


def test_the_zones_of_longitude() -> None:
    for tenth in range(-900, 901):
        lat_deg = tenth / 10.0
        assert mode_s.longitude_zones(lat_deg) == pyModeS.position.cprNL(lat_deg)
