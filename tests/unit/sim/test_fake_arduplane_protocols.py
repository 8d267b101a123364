"""The fake ArduPlane's mission and parameter protocols."""

import math

import pytest

from companion.mavlink.dialect import Message, mavlink
from sim.vehicle import MissionItem, takeoff_item
from sim.vehicle.mission import DO_CHANGE_SPEED, NAV_LOITER_UNLIM
from tests.support.arduplane_bench import (
    HOME,
    airborne,
    on_ground,
    waypoint,
)
from tests.support.vehicle_bench import (
    ACCEPTED,
    CHANGE_SPEED,
    FAILED,
    GCS,
)


def item_message(item: MissionItem, sequence: int, *, as_int: bool = True) -> Message:
    if as_int:
        place: tuple[float, float] = (item.lat_e7, item.lon_e7)
        build = mavlink.MAVLink_mission_item_int_message
    else:
        place = (item.lat_e7 / 1e7, item.lon_e7 / 1e7)
        build = mavlink.MAVLink_mission_item_message
    return build(1, 1, sequence, item.frame, item.command, 0, 1, *item.params, *place, item.altitude_m)


@pytest.mark.parametrize("as_int", [True, False])
def test_upload_and_download(as_int: bool) -> None:
    bench = on_ground()
    items = [waypoint(0.0, 0.0), takeoff_item(50.0), waypoint(1000.0, 0.0), waypoint(1000.0, 1000.0)]
    bench.send(mavlink.MAVLink_mission_count_message(1, 1, len(items)))
    while requests := bench.messages("MISSION_REQUEST"):
        bench.received.clear()
        (request,) = requests
        assert (request.target_system, request.target_component) == GCS
        bench.send(item_message(items[request.seq], request.seq, as_int=as_int))
    (done,) = bench.messages("MISSION_ACK")
    assert done.type == mavlink.MAV_MISSION_ACCEPTED
    assert bench.texts() == ["Flight plan received"]
    assert [(m.param_id, m.param_value) for m in bench.messages("PARAM_VALUE")] == [("MIS_TOTAL", 4.0)]

    bench.send(mavlink.MAVLink_mission_request_list_message(1, 1))
    assert bench.messages("MISSION_COUNT")[-1].count == 4
    for sequence in range(4):
        bench.send(mavlink.MAVLink_mission_request_int_message(1, 1, sequence))
        bench.send(mavlink.MAVLink_mission_request_message(1, 1, sequence))
    received = bench.messages("MISSION_ITEM_INT")
    assert [m.seq for m in received] == [0, 1, 2, 3]
    assert (received[0].x, received[0].z) == (
        round(HOME.lat_deg * 1e7),
        pytest.approx(HOME.altitude_m),
    )  # home
    for message, item in zip(received[1:], items[1:], strict=True):
        assert message.command == item.command
        assert message.x == pytest.approx(item.lat_e7, abs=0 if as_int else 40)
        assert message.z == pytest.approx(item.altitude_m)
    assert [m.x for m in bench.messages("MISSION_ITEM")] == pytest.approx(
        [m.x / 1e7 for m in received], abs=1e-6
    )
    bench.send(mavlink.MAVLink_mission_request_int_message(1, 1, 4))
    assert bench.messages("MISSION_ACK")[-1].type == mavlink.MAV_MISSION_INVALID_SEQUENCE


def test_a_stalled_upload_is_requested_again_and_then_cancelled() -> None:
    bench = on_ground()
    bench.send(mavlink.MAVLink_mission_count_message(1, 1, 3))
    bench.fly(7.0)
    assert {m.seq for m in bench.messages("MISSION_REQUEST")} == {0}
    assert 5 <= len(bench.messages("MISSION_REQUEST")) <= 8
    bench.fly(3.0)
    assert bench.messages("MISSION_ACK")[-1].type == mavlink.MAV_MISSION_OPERATION_CANCELLED
    assert len(bench.vehicle.flight.mission.items) == 4  # the old one stays


@pytest.mark.parametrize(
    ("item", "result"),
    [
        (MissionItem(82), mavlink.MAV_MISSION_UNSUPPORTED),
        (MissionItem(16, altitude_m=math.nan), mavlink.MAV_MISSION_INVALID),
        (MissionItem(16, lat_e7=2_000_000_000), mavlink.MAV_MISSION_INVALID),
        (MissionItem(16, frame=1), mavlink.MAV_MISSION_UNSUPPORTED_FRAME),
    ],
)
def test_unsupported_items_end_the_upload(item: MissionItem, result: int) -> None:
    bench = on_ground()
    bench.send(mavlink.MAVLink_mission_count_message(1, 1, 2))
    bench.send(item_message(item, 0))
    assert [m.type for m in bench.messages("MISSION_ACK")] == [result]
    assert len(bench.vehicle.flight.mission.items) == 4


@pytest.mark.parametrize("command", [DO_CHANGE_SPEED, NAV_LOITER_UNLIM, 16])
def test_unset_item_parameters_are_harmless(command: int) -> None:
    bench = airborne()
    place = waypoint(500.0, 100.0)
    odd = MissionItem(command, (0.0, *(math.nan,) * 3), place.lat_e7, place.lon_e7, 300.0)
    bench.send(mavlink.MAVLink_mission_count_message(1, 1, 3))
    for sequence, item in enumerate((place, odd, place)):
        bench.send(item_message(item, sequence))
    bench.fly(60.0)
    assert bench.vehicle.truth.airspeed_mps == pytest.approx(22.0, abs=0.5)
    assert math.dist(bench.vehicle.truth.position_m[:2], (0.0, 0.0)) < 2000.0


def test_rally_points_are_an_empty_list() -> None:
    bench, mission_type = on_ground(), mavlink.MAV_MISSION_TYPE_RALLY
    bench.send(mavlink.MAVLink_mission_request_list_message(1, 1, mission_type))
    (count,) = bench.messages("MISSION_COUNT")
    assert (count.count, count.mission_type) == (0, mission_type)
    bench.send(mavlink.MAVLink_mission_count_message(1, 1, 2, mission_type))
    assert bench.messages("MISSION_ACK")[-1].type == mavlink.MAV_MISSION_UNSUPPORTED
    assert bench.messages("MISSION_REQUEST") == []


def test_a_mission_uploaded_in_flight_is_flown_at_once() -> None:
    bench = airborne()
    items = [waypoint(0.0, 0.0), waypoint(500.0, -2000.0)]
    bench.send(mavlink.MAVLink_mission_count_message(1, 1, 2))
    for sequence, item in enumerate(items):
        bench.send(item_message(item, sequence))
    bench.fly(60.0)
    assert bench.vehicle.truth.position_m[1] < -800.0


def test_parameters_by_name_by_index_and_as_a_list() -> None:
    bench = on_ground()
    bench.send(mavlink.MAVLink_param_request_list_message(1, 1))
    received = bench.messages("PARAM_VALUE")
    assert [m.param_index for m in received] == list(range(len(received)))
    assert {m.param_count for m in received} == {len(received)}
    assert {"AIRSPEED_MIN", "AIRSPEED_MAX", "AIRSPEED_CRUISE", "ROLL_LIMIT_DEG", "TECS_CLMB_MAX"} <= {
        m.param_id for m in received
    }
    bench.received.clear()
    bench.send(mavlink.MAVLink_param_request_read_message(1, 1, b"WP_LOITER_RAD", -1))
    bench.send(mavlink.MAVLink_param_request_read_message(1, 1, b"", 3))
    bench.send(mavlink.MAVLink_param_request_read_message(1, 1, b"NO_SUCH_THING", -1))
    assert [m.param_value for m in bench.messages("PARAM_VALUE")] == [60.0, 1.0]


def test_a_set_parameter_is_answered_and_used() -> None:
    bench = airborne(channels=(0, 1))
    bench.send(mavlink.MAVLink_param_set_message(1, 1, b"AIRSPEED_MAX", 27.4, 4))
    for channel in (0, 1):
        assert [m.param_value for m in bench.messages("PARAM_VALUE", channel)] == [27.0]  # it is an integer
    bench.guided()
    assert bench.by_int(CHANGE_SPEED, 0, 28.0) == FAILED
    assert bench.by_int(CHANGE_SPEED, 0, 27.0) == ACCEPTED
    for name, value in ((b"AIRSPEED_MAX", math.nan), (b"MIS_TOTAL", 99.0)):
        bench.received.clear()
        bench.send(mavlink.MAVLink_param_set_message(1, 1, name, value, 4))
        assert [m.param_value for m in bench.messages("PARAM_VALUE")] == [
            27.0 if name == b"AIRSPEED_MAX" else 4.0
        ]
