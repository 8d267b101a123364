"""Units, sentinels, flags and traps of messages; each message is packed, split and decoded in both ways."""

import importlib
import math
import pkgutil
import struct
from typing import Any

import pytest

from companion.mavlink import translate
from companion.mavlink.dialect import Encoder, mavlink
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
    Traffic,
    Wind,
)
from companion.mavlink.framing import FrameSplitter, decode
from companion.mavlink.translate import WANTED, frame_to_fact, to_fact
from companion.model import AltitudeReference, TrafficKind, TrafficReport, TrafficSource, uas_key

NAN, INF = math.nan, math.inf
RECEIVED_S = 1000.0
SENDER = Sender(7, 3)
ALL_FLAGS = 1 | 2 | 4 | 8 | 16 | 32 | 128


def fact_of(message: Any) -> Fact | None:
    (frame,) = FrameSplitter().feed(Encoder().encode(message, SENDER.system_id, SENDER.component_id))
    fact = frame_to_fact(frame, RECEIVED_S)
    assert fact == to_fact(decode(frame), RECEIVED_S)
    return fact


def adsb(**changes: Any) -> TrafficReport:
    fields: dict[str, Any] = {
        "ICAO_address": 0xABCDEF,
        "lat": 471234567,
        "lon": -81234567,
        "altitude_type": mavlink.ADSB_ALTITUDE_TYPE_GEOMETRIC,
        "altitude": 1_234_567,
        "heading": 9_000,
        "hor_velocity": 6_150,
        "ver_velocity": -250,
        "callsign": b"SWR123",
        "emitter_type": mavlink.ADSB_EMITTER_TYPE_LIGHT,
        "tslc": 2,
        "flags": ALL_FLAGS,
        "squawk": 7000,
    }
    fact = fact_of(mavlink.MAVLink_adsb_vehicle_message(**{**fields, **changes}))
    assert isinstance(fact, Traffic)
    assert fact.sender == SENDER
    return fact.report


def test_a_full_traffic_report() -> None:
    assert adsb() == TrafficReport(
        source=TrafficSource.ADSB,
        key="ABCDEF",
        icao=0xABCDEF,
        time_s=RECEIVED_S - 2,
        lat_deg=47.1234567,
        lon_deg=-8.1234567,
        altitude_m=1234.567,
        altitude_reference=AltitudeReference.GEOMETRIC,
        course_rad=math.pi / 2,
        ground_speed_mps=61.5,
        climb_mps=-2.5,
        callsign="SWR123",
        squawk=7000,
        kind=TrafficKind.AIRCRAFT,
        simulated=False,
        age_step_s=1.0,
    )


@pytest.mark.parametrize(
    ("flag", "gone"),
    [
        (mavlink.ADSB_FLAGS_VALID_COORDS, {"lat_deg", "lon_deg"}),
        (mavlink.ADSB_FLAGS_VALID_ALTITUDE, {"altitude_m"}),
        (mavlink.ADSB_FLAGS_VALID_HEADING, {"course_rad"}),
        (mavlink.ADSB_FLAGS_VALID_VELOCITY, {"ground_speed_mps"}),
        (mavlink.ADSB_FLAGS_VALID_CALLSIGN, {"callsign"}),
        (mavlink.ADSB_FLAGS_VALID_SQUAWK, {"squawk"}),
        (mavlink.ADSB_FLAGS_VERTICAL_VELOCITY_VALID, {"climb_mps"}),
    ],
)
def test_only_the_field_without_its_flag_is_unknown(flag: int, gone: set[str]) -> None:
    report = adsb(flags=ALL_FLAGS & ~flag)
    full = adsb()
    for name in TrafficReport.__slots__:
        assert getattr(report, name) == (None if name in gone else getattr(full, name)), name


@pytest.mark.parametrize(
    ("changes", "gone"),
    [
        ({"lat": 2**31 - 1}, ["lat_deg", "lon_deg"]),
        ({"lon": 2**31 - 1}, ["lat_deg", "lon_deg"]),
        ({"lat": 900_000_001}, ["lat_deg", "lon_deg"]),
        ({"lat": -900_000_001}, ["lat_deg", "lon_deg"]),
        ({"lon": 1_800_000_001}, ["lat_deg", "lon_deg"]),
        ({"lon": -1_800_000_001}, ["lat_deg", "lon_deg"]),
        ({"lat": 0, "lon": 0}, ["lat_deg", "lon_deg"]),
        ({"altitude": 2**31 - 1}, ["altitude_m"]),
        ({"altitude": 40_000_001}, ["altitude_m"]),
        ({"altitude": -1_000_001}, ["altitude_m"]),
        ({"heading": 65_535}, ["course_rad"]),
        ({"heading": 36_000}, ["course_rad"]),
        ({"hor_velocity": 65_535}, ["ground_speed_mps"]),
        ({"ver_velocity": 32_767}, ["climb_mps"]),
        ({"callsign": b""}, ["callsign"]),
        ({"callsign": b"   "}, ["callsign"]),
        ({"callsign": b"\xff\xfe\x01"}, ["callsign"]),
        ({"squawk": 7008}, ["squawk"]),
        ({"squawk": 1280}, ["squawk"]),
        ({"squawk": 10000}, ["squawk"]),
        ({"squawk": 65535}, ["squawk"]),
    ],
    ids=str,
)
def test_sentinels_and_implausible_values_are_unknown_even_with_their_flag(
    changes: dict[str, Any], gone: list[str]
) -> None:
    report = adsb(**changes)
    assert [getattr(report, name) for name in gone] == [None] * len(gone)


@pytest.mark.parametrize(
    ("changes", "name", "value"),
    [
        ({"lat": 0}, "lat_deg", 0.0),
        ({"lon": 0}, "lon_deg", 0.0),
        ({"lat": 900_000_000}, "lat_deg", 90.0),
        ({"lon": -1_800_000_000}, "lon_deg", -180.0),
        ({"altitude": -430_000}, "altitude_m", -430.0),
        ({"altitude": 0}, "altitude_m", 0.0),
        ({"heading": 0}, "course_rad", 0.0),
        ({"heading": 35_999}, "course_rad", math.radians(359.99)),
        ({"hor_velocity": 65_534}, "ground_speed_mps", 655.34),
        ({"hor_velocity": 0}, "ground_speed_mps", 0.0),
        ({"ver_velocity": 32_766}, "climb_mps", 327.66),
        ({"ver_velocity": -32_768}, "climb_mps", -327.68),
        ({"squawk": 0}, "squawk", 0),
        ({"squawk": 7777}, "squawk", 7777),
        ({"callsign": b" AB 12  "}, "callsign", "AB 12"),
        ({"callsign": b"AB\x00CD"}, "callsign", "AB"),
        ({"callsign": b"ABCDEFGHI"}, "callsign", "ABCDEFGHI"),
        ({"tslc": 254}, "time_s", RECEIVED_S - 254),
        ({"tslc": 255}, "time_s", RECEIVED_S),  # unknown
        ({"tslc": 0}, "time_s", RECEIVED_S),
        ({"altitude_type": 0}, "altitude_reference", AltitudeReference.BAROMETRIC),
        ({"altitude_type": 9}, "altitude_reference", AltitudeReference.BAROMETRIC),
        ({"flags": ALL_FLAGS | mavlink.ADSB_FLAGS_SIMULATED}, "simulated", True),
        ({"flags": ALL_FLAGS | mavlink.ADSB_FLAGS_SOURCE_UAT}, "climb_mps", -2.5),
    ],
    ids=str,
)
def test_values_at_the_limits_are_used(changes: dict[str, Any], name: str, value: object) -> None:
    assert getattr(adsb(**changes), name) == value


@pytest.mark.parametrize("emitter", sorted({*mavlink.enums["ADSB_EMITTER_TYPE"], 21, 22, 255}))
def test_the_kind_follows_from_the_emitter_type(emitter: int) -> None:
    expected = {
        mavlink.ADSB_EMITTER_TYPE_UAV: TrafficKind.UAV,
        mavlink.ADSB_EMITTER_TYPE_EMERGENCY_SURFACE: TrafficKind.SURFACE_VEHICLE,
        mavlink.ADSB_EMITTER_TYPE_SERVICE_SURFACE: TrafficKind.SURFACE_VEHICLE,
        mavlink.ADSB_EMITTER_TYPE_POINT_OBSTACLE: TrafficKind.OBSTACLE,
        20: TrafficKind.OBSTACLE,
        21: TrafficKind.OBSTACLE,
    }
    assert adsb(emitter_type=emitter).kind == expected.get(emitter, TrafficKind.AIRCRAFT)


def test_without_flags_only_the_address_is_known() -> None:
    report = adsb(flags=0)
    assert (report.icao, report.lat_deg, report.altitude_m, report.course_rad) == (0xABCDEF, None, None, None)


def utm(**changes: Any) -> TrafficReport:
    fields: dict[str, Any] = {
        "time": 1_700_000_000_000_000,
        "uas_id": [0x4B, 0, 0xA1, *[0] * 15],
        "lat": 471234567,
        "lon": -81234567,
        "alt": 712_500,
        "relative_alt": 100_000,
        "next_lat": 0,
        "next_lon": 0,
        "next_alt": 0,
        "vx": -300,
        "vy": 400,
        "vz": 150,
        "h_acc": 2_500,
        "v_acc": 4_000,
        "vel_acc": 100,
        "update_rate": 0,
        "flight_state": mavlink.UTM_FLIGHT_STATE_AIRBORNE,
        "flags": 255,
    }
    fact = fact_of(mavlink.MAVLink_utm_global_position_message(**{**fields, **changes}))
    assert isinstance(fact, Traffic)
    return fact.report


def test_a_full_report_of_traffic_management() -> None:
    report = utm()
    assert report == TrafficReport(
        source=TrafficSource.UTM,
        key="UTM-4B00A1",
        time_s=RECEIVED_S,
        lat_deg=47.1234567,
        lon_deg=-8.1234567,
        altitude_m=712.5,
        altitude_reference=AltitudeReference.GEOMETRIC,
        course_rad=math.atan2(4.0, -3.0),
        ground_speed_mps=5.0,
        climb_mps=-1.5,
        callsign="UTM 4B00A1",
        kind=TrafficKind.UAV,
        position_sigma_m=2.5,
        altitude_sigma_m=4.0,
    )
    assert report.key == uas_key("4b00A1") == uas_key("4B00A1" + 15 * "00")


@pytest.mark.parametrize(
    ("flag", "gone"),
    [
        (mavlink.UTM_DATA_AVAIL_FLAGS_POSITION_AVAILABLE, {"lat_deg", "lon_deg"}),
        (mavlink.UTM_DATA_AVAIL_FLAGS_ALTITUDE_AVAILABLE, {"altitude_m"}),
        (mavlink.UTM_DATA_AVAIL_FLAGS_HORIZONTAL_VELO_AVAILABLE, {"course_rad", "ground_speed_mps"}),
        (mavlink.UTM_DATA_AVAIL_FLAGS_VERTICAL_VELO_AVAILABLE, {"climb_mps"}),
        (mavlink.UTM_DATA_AVAIL_FLAGS_RELATIVE_ALTITUDE_AVAILABLE, set()),
        (mavlink.UTM_DATA_AVAIL_FLAGS_TIME_VALID, set()),
        (mavlink.UTM_DATA_AVAIL_FLAGS_NEXT_WAYPOINT_AVAILABLE, set()),
    ],
)
def test_only_the_unavailable_part_of_a_report_is_unknown(flag: int, gone: set[str]) -> None:
    report, full = utm(flags=255 & ~flag), utm()
    for name in TrafficReport.__slots__:
        assert getattr(report, name) == (None if name in gone else getattr(full, name)), name


@pytest.mark.parametrize("changes", [{"flags": 255 & ~2}, {"uas_id": [0] * 18}], ids=str)
def test_an_aircraft_without_id_is_named_after_its_sender(changes: dict[str, Any]) -> None:
    assert utm(**changes).key == "UTM-7.3"


def test_an_id_may_be_as_long_as_its_field() -> None:
    assert utm(uas_id=list(range(238, 256))).key == "UTM-" + bytes(range(238, 256)).hex().upper()


@pytest.mark.parametrize(
    ("changes", "name", "value"),
    [
        ({"h_acc": 0}, "position_sigma_m", None),
        ({"h_acc": 65_535}, "position_sigma_m", None),
        ({"v_acc": 0}, "altitude_sigma_m", None),
        ({"v_acc": 65_534}, "altitude_sigma_m", 65.534),
        ({"alt": 2**31 - 1}, "altitude_m", None),
        ({"lat": 0, "lon": 0}, "lat_deg", None),
        ({"vx": 0, "vy": 0}, "ground_speed_mps", 0.0),
        ({"vx": -100, "vy": -1}, "course_rad", math.atan2(-1.0, -100.0) + 2.0 * math.pi),
        ({"flight_state": mavlink.UTM_FLIGHT_STATE_GROUND}, "airborne", False),
        ({"flight_state": mavlink.UTM_FLIGHT_STATE_UNKNOWN}, "airborne", True),
        ({"flight_state": mavlink.UTM_FLIGHT_STATE_EMERGENCY}, "airborne", True),
        ({"flight_state": mavlink.UTM_FLIGHT_STATE_NOCTRL}, "airborne", True),
    ],
    ids=str,
)
def test_fields_of_a_report_of_traffic_management(changes: dict[str, Any], name: str, value: object) -> None:
    assert getattr(utm(**changes), name) == value


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
