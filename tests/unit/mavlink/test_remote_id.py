"""Remote ID: unknown values, whose aircraft a message is about, and messages within a pack."""

import math
import struct
from typing import Any

import pytest

from companion.mavlink.dialect import Encoder, mavlink
from companion.mavlink.facts import Fact, ReceiverOwnship, Sender, Traffic
from companion.mavlink.framing import FrameSplitter, decode
from companion.mavlink.translate import frame_to_fact, to_fact
from companion.model import AltitudeReference, TrafficKind, TrafficReport, TrafficSource

RECEIVED_S = 1000.0
AUTOPILOT, RECEIVER = Sender(1, 1), Sender(1, 236)
ADDRESS = b"3065EC6FC458"  # as the developer guide writes an address: ASCII without separators
SERIAL = b"1581F5BKD229K00A"


def padded(name: bytes, length: int = 20) -> list[int]:
    return list(name.ljust(length, b"\0"))


def fact_of(message: Any, sender: Sender = RECEIVER) -> Fact | None:
    (frame,) = FrameSplitter().feed(Encoder().encode(message, *sender))
    fact = frame_to_fact(frame, RECEIVED_S)
    assert fact == to_fact(decode(frame), RECEIVED_S)
    return fact


def location(**changes: Any) -> Any:
    fields: dict[str, Any] = {
        "target_system": 0,
        "target_component": 0,
        "id_or_mac": padded(ADDRESS),
        "status": mavlink.MAV_ODID_STATUS_AIRBORNE,
        "direction": 9_000,
        "speed_horizontal": 1_550,
        "speed_vertical": -250,
        "latitude": 471234567,
        "longitude": -81234567,
        "altitude_barometric": 600.0,
        "altitude_geodetic": 650.0,
        "height_reference": 0,
        "height": 50.0,
        "horizontal_accuracy": mavlink.MAV_ODID_HOR_ACC_10_METER,
        "vertical_accuracy": mavlink.MAV_ODID_VER_ACC_25_METER,
        "barometer_accuracy": mavlink.MAV_ODID_VER_ACC_3_METER,
        "speed_accuracy": mavlink.MAV_ODID_SPEED_ACC_1_METERS_PER_SECOND,
        "timestamp": 1234.5,
        "timestamp_accuracy": 1,
    }
    return mavlink.MAVLink_open_drone_id_location_message(**{**fields, **changes})


def basic_id(**changes: Any) -> Any:
    fields: dict[str, Any] = {
        "target_system": 0,
        "target_component": 0,
        "id_or_mac": padded(ADDRESS),
        "id_type": mavlink.MAV_ODID_ID_TYPE_SERIAL_NUMBER,
        "ua_type": mavlink.MAV_ODID_UA_TYPE_AEROPLANE,
        "uas_id": padded(SERIAL),
    }
    return mavlink.MAVLink_open_drone_id_basic_id_message(**{**fields, **changes})


def pack(*messages: bytes, name: bytes = ADDRESS, count: int | None = None, size: int = 25) -> Any:
    return mavlink.MAVLink_open_drone_id_message_pack_message(
        0, 0, padded(name), size, len(messages) if count is None else count, padded(b"".join(messages), 225)
    )


def packed_location(**changes: int) -> bytes:
    """A location message of ASTM F3411, by its table: each field in its own steps."""
    fields = {
        "status": 2,
        "west": 1,
        "fast": 0,
        "direction": 90,
        "speed": 62,
        "climb": -5,
        "lat": 471234567,
        "lon": -81234567,
        "pressure": 3200,
        "geodetic": 3300,
        "height": 2100,
        "accuracies": 3 << 4 | 10,
        "speeds": 5 << 4 | 3,
    }
    values = {**fields, **changes}
    flags = values["status"] << 4 | values["west"] << 1 | values["fast"]
    names = ("direction", "speed", "climb", "lat", "lon", "pressure", "geodetic", "height")
    names += ("accuracies", "speeds")
    content = struct.pack("<BBBbiiHHHBB", flags, *(values[name] for name in names))
    return b"\x12" + content + struct.pack("<HBB", 12345, 1, 0)


PACKED_ID = b"\x02\x11" + SERIAL.ljust(20, b"\0") + bytes(3)


def traffic(message: Any, sender: Sender = RECEIVER) -> TrafficReport:
    fact = fact_of(message, sender)
    assert isinstance(fact, Traffic)
    assert fact.sender == sender
    return fact.report


def test_a_full_location() -> None:
    assert traffic(location()) == TrafficReport(
        source=TrafficSource.REMOTE_ID,
        key="RID-3065EC6FC458",
        time_s=RECEIVED_S,
        lat_deg=47.1234567,
        lon_deg=-8.1234567,
        altitude_m=600.0,
        altitude_reference=AltitudeReference.BAROMETRIC,
        geometric_altitude_m=650.0,
        course_rad=math.pi / 2,
        ground_speed_mps=15.5,
        climb_mps=-2.5,
        kind=TrafficKind.UAV,
        position_sigma_m=10.0 / 2.448,
        altitude_sigma_m=3.0 / 1.960,
        velocity_sigma_mps=1.0 / 2.448,
    )


@pytest.mark.parametrize(
    ("changes", "field", "value"),
    [
        ({"latitude": 0, "longitude": 0}, "lat_deg", None),
        ({"latitude": 0}, "lat_deg", 0.0),
        ({"latitude": 900_000_001}, "lon_deg", None),
        ({"direction": 36_100}, "course_rad", None),
        ({"direction": 36_000}, "course_rad", None),
        ({"direction": 0}, "course_rad", 0.0),
        ({"speed_horizontal": 25_500}, "ground_speed_mps", None),
        ({"speed_horizontal": 25_425}, "ground_speed_mps", 254.25),
        ({"speed_vertical": 6_300}, "climb_mps", None),
        ({"speed_vertical": -6_200}, "climb_mps", -62.0),
        ({"altitude_geodetic": -1000.0}, "geometric_altitude_m", None),
        ({"altitude_geodetic": math.nan}, "geometric_altitude_m", None),
        ({"altitude_barometric": -1000.0}, "altitude_m", 650.0),
        ({"altitude_barometric": -1000.0}, "altitude_reference", AltitudeReference.GEOMETRIC),
        ({"altitude_barometric": -1000.0}, "geometric_altitude_m", None),
        ({"altitude_barometric": -1000.0}, "altitude_sigma_m", 25.0 / 1.960),
        ({"altitude_barometric": math.inf, "altitude_geodetic": -1000.0}, "altitude_m", None),
        ({"horizontal_accuracy": 0}, "position_sigma_m", None),
        ({"horizontal_accuracy": 12}, "position_sigma_m", 1.0 / 2.448),
        ({"horizontal_accuracy": 13}, "position_sigma_m", None),
        ({"barometer_accuracy": 0}, "altitude_sigma_m", None),
        ({"speed_accuracy": 200}, "velocity_sigma_mps", None),
        ({"status": mavlink.MAV_ODID_STATUS_GROUND}, "airborne", False),
        ({"status": mavlink.MAV_ODID_STATUS_UNDECLARED}, "airborne", True),
        ({"status": mavlink.MAV_ODID_STATUS_EMERGENCY}, "airborne", True),
        ({"timestamp": 0xFFFF}, "time_s", RECEIVED_S),
        ({"timestamp": math.nan}, "time_s", RECEIVED_S),
        ({"id_or_mac": padded(SERIAL)}, "key", "RID-1581F5BKD229K00A"),
        ({"id_or_mac": padded(b"\x30\x65\xec\x6f\xc4\x58")}, "key", "RID-3065EC6FC458"),
        ({"id_or_mac": padded(b"")}, "key", "RID-1.236"),
    ],
    ids=str,
)
def test_each_field_and_its_unknown_value(changes: dict[str, Any], field: str, value: object) -> None:
    assert getattr(traffic(location(**changes)), field) == value


def test_the_position_that_a_system_sends_of_itself_is_no_traffic() -> None:
    fact = fact_of(location(id_or_mac=padded(b"")), AUTOPILOT)
    assert isinstance(fact, ReceiverOwnship)
    assert (fact.sender, fact.report.geometric_altitude_m) == (AUTOPILOT, 650.0)
    assert fact_of(basic_id(id_or_mac=padded(b"")), AUTOPILOT) is None
    assert fact_of(basic_id(id_or_mac=padded(b"")), RECEIVER) is None
    own_pack = fact_of(pack(PACKED_ID, packed_location(), name=b""), AUTOPILOT)
    assert isinstance(own_pack, ReceiverOwnship)


def test_what_an_autopilot_forwards_of_another_aircraft_is_traffic() -> None:
    assert traffic(location(), AUTOPILOT).key == "RID-3065EC6FC458"


def test_the_name_is_joined_to_the_position_by_its_key() -> None:
    report = traffic(basic_id())
    assert (report.key, report.callsign) == (traffic(location()).key, "1581F5BKD229K00A")
    assert (report.kind, report.lat_deg, report.altitude_m) == (TrafficKind.UAV, None, None)


@pytest.mark.parametrize(
    ("changes", "field", "value"),
    [
        ({"id_type": mavlink.MAV_ODID_ID_TYPE_UTM_ASSIGNED_UUID}, "callsign", None),
        ({"id_type": mavlink.MAV_ODID_ID_TYPE_CAA_REGISTRATION_ID}, "callsign", "1581F5BKD229K00A"),
        ({"uas_id": padded(b"")}, "callsign", None),
        ({"ua_type": mavlink.MAV_ODID_UA_TYPE_GROUND_OBSTACLE}, "kind", TrafficKind.OBSTACLE),
        ({"ua_type": 255}, "kind", TrafficKind.UAV),
    ],
    ids=str,
)
def test_kind_and_name(changes: dict[str, Any], field: str, value: object) -> None:
    assert getattr(traffic(basic_id(**changes)), field) == value


def test_a_pack_has_position_and_name() -> None:
    assert traffic(pack(PACKED_ID, packed_location())) == TrafficReport(
        source=TrafficSource.REMOTE_ID,
        key="RID-3065EC6FC458",
        time_s=RECEIVED_S,
        lat_deg=47.1234567,
        lon_deg=-8.1234567,
        altitude_m=600.0,
        altitude_reference=AltitudeReference.BAROMETRIC,
        geometric_altitude_m=650.0,
        course_rad=math.radians(270.0),
        ground_speed_mps=15.5,
        climb_mps=-2.5,
        callsign="1581F5BKD229K00A",
        kind=TrafficKind.UAV,
        position_sigma_m=10.0 / 2.448,
        altitude_sigma_m=3.0 / 1.960,
        velocity_sigma_mps=1.0 / 2.448,
    )


@pytest.mark.parametrize(
    ("changes", "field", "value"),
    [
        ({"direction": 181, "west": 1}, "course_rad", None),
        ({"direction": 90, "west": 0}, "course_rad", math.pi / 2),
        ({"speed": 255, "fast": 1}, "ground_speed_mps", None),
        ({"speed": 10, "fast": 1}, "ground_speed_mps", 255 * 0.25 + 10 * 0.75),
        ({"climb": 126}, "climb_mps", None),
        ({"pressure": 0}, "altitude_m", 650.0),
        ({"geodetic": 0}, "geometric_altitude_m", None),
        ({"lat": 0, "lon": 0}, "lat_deg", None),
        ({"status": 1}, "airborne", False),
    ],
    ids=str,
)
def test_unknown_values_within_a_pack(changes: dict[str, int], field: str, value: object) -> None:
    assert getattr(traffic(pack(packed_location(**changes))), field) == value


def test_a_pack_without_an_address_is_named_by_its_content() -> None:
    assert traffic(pack(packed_location(), PACKED_ID, name=b"")).key == "RID-1581F5BKD229K00A"


def test_a_pack_without_a_position_or_of_another_form_gives_nothing() -> None:
    assert fact_of(pack(PACKED_ID)) is None
    assert fact_of(pack(PACKED_ID, packed_location(), count=1)) is None
    assert fact_of(pack(packed_location(), size=24)) is None
    assert traffic(pack(*[PACKED_ID] * 8, packed_location(), count=255)).lat_deg is not None
