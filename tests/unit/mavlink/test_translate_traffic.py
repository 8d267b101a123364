"""Units, sentinels, flags and traps of ADSB_VEHICLE and UTM_GLOBAL_POSITION."""

import math
from typing import Any

import pytest

from companion.mavlink.dialect import mavlink
from companion.mavlink.facts import (
    Traffic,
)
from companion.model import AltitudeReference, TrafficKind, TrafficReport, TrafficSource, uas_key
from tests.unit.mavlink.translated import RECEIVED_S, SENDER, fact_of

NAN, INF = math.nan, math.inf
ALL_FLAGS = 1 | 2 | 4 | 8 | 16 | 32 | 128


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
