"""Units, sentinels, flags and traps of messages; each message is packed, split and decoded in both ways."""

import importlib
import math
import pkgutil
import struct
from typing import Any

import pytest

from companion.mavlink import translate
from companion.mavlink.dialect import mavlink
from companion.mavlink.facts import (
    AirData,
    AirspeedSensor,
    CommandResult,
    Fact,
    GeoidSeparation,
    Heartbeat,
    LandedState,
    MissionProgress,
    NavigationTarget,
    OwnPosition,
    OwnTransponder,
    Parameter,
    ParameterSet,
    PressureAltitude,
    Sender,
    Wind,
)
from companion.mavlink.framing import FrameSplitter, decode
from companion.mavlink.translate import WANTED, frame_to_fact, to_fact
from tests.unit.mavlink.translated import RECEIVED_S, SENDER, fact_of

NAN, INF = math.nan, math.inf


def gps(**changes: Any) -> Fact | None:
    fields: dict[str, Any] = {
        "time_usec": 0,
        "fix_type": 3,
        "lat": 471234567,
        "lon": 81234567,
        "alt": 500_000,
        "eph": 100,
        "epv": 150,
        "vel": 2_200,
        "cog": 0,
        "satellites_visible": 12,
        "alt_ellipsoid": 547_600,
    }
    return fact_of(mavlink.MAVLink_gps_raw_int_message(**{**fields, **changes}))


def test_geoid_separation_is_the_difference_of_two_altitudes() -> None:
    assert gps() == GeoidSeparation(SENDER, 47.6)
    assert gps(alt_ellipsoid=394_000) == GeoidSeparation(SENDER, -106.0)


@pytest.mark.parametrize(
    "changes", [{"alt_ellipsoid": 0}, {"fix_type": 2}, {"alt_ellipsoid": 700_000}, {"alt": -(2**31)}], ids=str
)
def test_an_unknown_geoid_separation_gives_no_fact(changes: dict[str, Any]) -> None:
    assert gps(**changes) is None


def test_pressure_altitude_is_that_of_the_standard_atmosphere() -> None:
    for press_hpa, altitude_m in ((1013.25, 0.0), (898.75, 1000.0), (1005.25, 66.8), (540.2, 5000.0)):
        fact = fact_of(mavlink.MAVLink_scaled_pressure_message(0, press_hpa, 0.0, 0))
        assert isinstance(fact, PressureAltitude)
        assert fact.altitude_m == pytest.approx(altitude_m, abs=0.5)


def own_position(**changes: Any) -> Fact | None:
    fields = {
        "time_boot_ms": 12_345,
        "lat": -353632610,
        "lon": 1491652300,
        "alt": 684_250,
        "relative_alt": 100_500,
        "vx": 1500,
        "vy": -200,
        "vz": -150,
        "hdg": 27_000,
    }
    return fact_of(mavlink.MAVLink_global_position_int_message(**{**fields, **changes}))


def test_own_position_keeps_down_positive_down() -> None:
    assert own_position() == OwnPosition(
        sender=SENDER,
        boot_time_s=12.345,
        lat_deg=-35.363261,
        lon_deg=149.16523,
        altitude_m=684.25,
        height_above_home_m=100.5,
        velocity_mps=(15.0, -2.0, -1.5),
        heading_rad=math.radians(270.0),
    )


def test_own_position_without_heading_or_without_fix() -> None:
    without_heading = own_position(hdg=65_535)
    assert isinstance(without_heading, OwnPosition)
    assert without_heading.heading_rad is None
    assert own_position(lat=0, lon=0) is None
    assert own_position(lat=2**31 - 1) is None


@pytest.mark.parametrize(("base_mode", "armed"), [(0, False), (127, False), (128, True), (209, True)])
def test_heartbeat(base_mode: int, armed: bool) -> None:
    message = mavlink.MAVLink_heartbeat_message(1, 12, base_mode, 0x04_04_00_00, 4, 3)
    assert fact_of(message) == Heartbeat(SENDER, 1, 12, armed, 0x04_04_00_00, 4)


@pytest.mark.parametrize(
    ("airspeed", "expected"), [(22.5, 22.5), (0.0, 0.0), (NAN, None), (INF, None), (-1.0, None)]
)
def test_air_data(airspeed: float, expected: float | None) -> None:
    assert fact_of(mavlink.MAVLink_vfr_hud_message(airspeed, 20.0, 90, 50, 100.0, NAN)) == AirData(
        SENDER, expected, 100.0
    )


@pytest.mark.parametrize(("altitude_m", "expected"), [(-40.0, -40.0), (NAN, None), (INF, None), (1e6, None)])
def test_air_data_with_altitude(altitude_m: float, expected: float | None) -> None:
    message = mavlink.MAVLink_vfr_hud_message(22.0, 20.0, 90, 50, altitude_m, 0.0)
    assert fact_of(message) == AirData(SENDER, 22.0, expected)


@pytest.mark.parametrize(
    ("from_deg", "north_mps", "east_mps"),
    [(0.0, -5.0, 0.0), (90.0, 0.0, -5.0), (-90.0, 0.0, 5.0), (180.0, 5.0, 0.0), (270.0, 0.0, 5.0)],
)
def test_wind_comes_from_its_direction(from_deg: float, north_mps: float, east_mps: float) -> None:
    fact = fact_of(mavlink.MAVLink_wind_message(from_deg, 5.0, NAN))
    assert isinstance(fact, Wind)
    assert (fact.north_mps, fact.east_mps) == pytest.approx((north_mps, east_mps), abs=1e-9)


@pytest.mark.parametrize(("direction", "speed"), [(NAN, 1.0), (1.0, NAN), (INF, 1.0), (1.0, -INF)])
def test_unknown_wind_gives_no_fact(direction: float, speed: float) -> None:
    assert fact_of(mavlink.MAVLink_wind_message(direction, speed, 0.0)) is None


def test_wind_cov_is_the_velocity_of_the_air() -> None:
    assert fact_of(mavlink.MAVLink_wind_cov_message(1, 3.0, -4.0, NAN, 0, 0, 0, 0, 0)) == Wind(
        SENDER, 3.0, -4.0
    )
    assert fact_of(mavlink.MAVLink_wind_cov_message(1, NAN, 1.0, 0, 0, 0, 0, 0, 0)) is None
    assert fact_of(mavlink.MAVLink_wind_cov_message(1, 1.0, INF, 0, 0, 0, 0, 0, 0)) is None


@pytest.mark.parametrize(
    ("wire", "expected"), [(0, None), (1, 1), (2, 2), (3, 3), (4, 4), (5, None), (255, None)]
)
def test_landed_state(wire: int, expected: int | None) -> None:
    assert max(mavlink.enums["MAV_LANDED_STATE"]) == 5  # the end marker
    assert fact_of(mavlink.MAVLink_extended_sys_state_message(0, wire)) == LandedState(SENDER, expected)


@pytest.mark.parametrize(
    ("wire", "expected"), [(0, None), (1, 1), (2, 2), (3, 3), (4, 4), (5, None), (255, None)]
)
def test_vtol_state(wire: int, expected: int | None) -> None:
    assert max(mavlink.enums["MAV_VTOL_STATE"]) == 5  # the end marker
    assert fact_of(mavlink.MAVLink_extended_sys_state_message(wire, 2)) == LandedState(SENDER, 2, expected)


@pytest.mark.parametrize(
    ("present", "enabled", "healthy", "usable"),
    [(16, 16, 16, True), (0, 0, 0, False), (16, 0, 16, False), (16, 16, 0, False), (47, 63, 63, False)],
)
def test_the_airspeed_sensor_is_usable_when_present_enabled_and_healthy(
    present: int, enabled: int, healthy: int, usable: bool
) -> None:
    message = mavlink.MAVLink_sys_status_message(present, enabled, healthy, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0)
    assert fact_of(message) == AirspeedSensor(SENDER, usable)


def target(frame: int = 5, mask: int = 0, lat: int = 10_000_000, alt: float = 250.0) -> Fact | None:
    return fact_of(
        mavlink.MAVLink_position_target_global_int_message(
            0, frame, mask, lat, 20_000_000, alt, 0, 0, 0, 0, 0, 0, NAN, NAN
        )
    )


@pytest.mark.parametrize("frame", sorted(mavlink.enums["MAV_FRAME"]))
def test_a_target_has_an_altitude_in_absolute_frames_only(frame: int) -> None:
    assert target(frame) == NavigationTarget(SENDER, 1.0, 2.0, 250.0 if frame in (0, 5) else None)


def test_ignored_parts_of_a_target() -> None:
    assert target(mask=1) is None
    assert target(mask=2) is None
    assert target(mask=4) == NavigationTarget(SENDER, 1.0, 2.0, None)
    assert target(mask=0xFFF8) == NavigationTarget(SENDER, 1.0, 2.0, 250.0)
    assert target(alt=NAN) == NavigationTarget(SENDER, 1.0, 2.0, None)
    assert target(lat=2**31 - 1) is None


def test_mission_progress() -> None:
    assert fact_of(mavlink.MAVLink_mission_current_message(42)) == MissionProgress(SENDER, 42)


@pytest.mark.parametrize(
    ("system", "component", "target"), [(0, 0, None), (0, 5, None), (1, 196, Sender(1, 196))]
)
def test_command_result(system: int, component: int, target: Sender | None) -> None:
    message = mavlink.MAVLink_command_ack_message(43002, 4, 0, 0, system, component)
    assert fact_of(message) == CommandResult(SENDER, 43002, 4, target)


def test_a_command_result_in_mavlink_1_has_no_target() -> None:
    header = bytes((0xFE, 3, 0, 7, 3, 77))
    payload = struct.pack("<HB", 192, 0)
    checksum = mavlink.x25crc(header[1:] + payload + bytes((mavlink.mavlink_map[77].crc_extra,)))
    (frame,) = FrameSplitter().feed(header + payload + checksum.crc.to_bytes(2, "little"))
    assert to_fact(decode(frame), RECEIVED_S) == CommandResult(SENDER, 192, 0, None)
    assert frame_to_fact(frame, RECEIVED_S) == CommandResult(SENDER, 192, 0, None)


def parameter(value: float, kind: int, name: bytes = b"AIRSPEED_MIN") -> Fact | None:
    return fact_of(mavlink.MAVLink_param_value_message(name, value, kind, 900, 1))


def packed_as_bits(layout: str, value: int) -> float:
    (as_float,) = struct.unpack("<f", struct.pack(layout, value).ljust(4, b"\0"))
    return float(as_float)


INT32, REAL32 = mavlink.MAV_PARAM_TYPE_INT32, mavlink.MAV_PARAM_TYPE_REAL32


@pytest.mark.parametrize("value", [0.0, 1.0, -1.0, 100.0, -8_388_608.0, 16_777_216.0])
def test_ardupilot_sends_an_integer_as_the_number(value: float) -> None:
    assert parameter(value, INT32) == Parameter(SENDER, "AIRSPEED_MIN", value)


@pytest.mark.parametrize("value", [0, 1, 5, 22, -1, -5, 1000, 2**20, -(2**20), 2**23, 2**24, 2**29 + 3])
def test_px4_sends_an_integer_as_its_bits(value: int) -> None:
    assert parameter(packed_as_bits("<i", value), INT32) == Parameter(SENDER, "AIRSPEED_MIN", value)


@pytest.mark.parametrize(
    ("kind", "layout", "value"),
    [
        (mavlink.MAV_PARAM_TYPE_UINT8, "<B", 200),
        (mavlink.MAV_PARAM_TYPE_INT8, "<b", -3),
        (mavlink.MAV_PARAM_TYPE_UINT16, "<H", 60_000),
        (mavlink.MAV_PARAM_TYPE_INT16, "<h", -300),
        (mavlink.MAV_PARAM_TYPE_UINT32, "<I", 70_000),
    ],
)
def test_bits_of_the_other_integer_types(kind: int, layout: str, value: int) -> None:
    assert parameter(packed_as_bits(layout, value), kind) == Parameter(SENDER, "AIRSPEED_MIN", value)


def test_a_real_parameter_is_the_number_itself_if_finite() -> None:
    assert parameter(12.5, REAL32) == Parameter(SENDER, "AIRSPEED_MIN", 12.5)
    assert parameter(1e-45, REAL32) == Parameter(SENDER, "AIRSPEED_MIN", packed_as_bits("<i", 1))
    assert parameter(NAN, REAL32) is None
    assert parameter(INF, REAL32) is None
    assert parameter(NAN, 99) is None


def test_a_parameter_name_may_be_as_long_as_its_field_but_not_empty() -> None:
    assert parameter(1.0, REAL32, b"SIXTEEN_LETTERS_") == Parameter(SENDER, "SIXTEEN_LETTERS_", 1.0)
    assert parameter(1.0, REAL32, b"") is None


@pytest.mark.parametrize(("icao", "known"), [(0, False), (1, True), (0xFFFFFF, True), (0x1000000, False)])
def test_own_transponder(icao: int, known: bool) -> None:
    message = mavlink.MAVLink_uavionix_adsb_out_cfg_message(icao, b"N123", 1, 1, 0, 0, 0, 0)
    assert fact_of(message) == (OwnTransponder(SENDER, icao) if known else None)


def test_a_message_that_is_not_wanted_gives_no_fact() -> None:
    message = mavlink.MAVLink_statustext_message(6, b"hello")
    assert message.get_msgId() not in WANTED
    assert fact_of(message) is None


def test_a_message_that_was_not_received_is_translated_too() -> None:
    assert to_fact(mavlink.MAVLink_mission_current_message(3), 0.0) == MissionProgress(Sender(0, 0), 3)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_parameter_set_to_a_number_that_is_not_finite_is_still_a_request(value: float) -> None:
    fact = fact_of(mavlink.MAVLink_param_set_message(1, 196, b"CA_OUTER_TIME", value, 9))
    assert fact == ParameterSet(SENDER, Sender(1, 196), "CA_OUTER_TIME", None)


def test_every_file_of_translations_is_registered_and_no_message_has_two() -> None:
    modules = [
        importlib.import_module(f"{translate.__name__}.{found.name}")
        for found in pkgutil.iter_modules(translate.__path__)
    ]
    ids = [message_id for module in modules for message_id in getattr(module, "TRANSLATIONS", ())]
    assert sorted(ids) == sorted(WANTED), (
        "a file is missing in _TRANSLATIONS, or a message has two translations"
    )
