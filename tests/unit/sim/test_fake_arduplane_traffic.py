"""The fake ArduPlane's traffic list, with the quirks of the real one."""

from typing import Any

from companion.mavlink.dialect import Message, mavlink
from tests.support.arduplane_bench import FRAME, PlaneBench, airborne
from tests.support.vehicle_bench import SET_INTERVAL


def adsb(icao: int = 0xA00001, *, flags: int = 415, north_m: float = 3000.0, **fields: int) -> Message:
    place = FRAME.to_geo(north_m, 0.0, 0.0)
    values: dict[str, Any] = {
        "ICAO_address": icao,
        "lat": round(place.lat_deg * 1e7),
        "lon": round(place.lon_deg * 1e7),
        "altitude_type": 1,
        "altitude": 884_100,
        "heading": 18_000,
        "hor_velocity": 6000,
        "ver_velocity": 0,
        "callsign": b"T000",
        "emitter_type": 1,
        "tslc": 0,
        "flags": flags,
        "squawk": 1200,
    }
    return mavlink.MAVLink_adsb_vehicle_message(**{**values, **fields})


RECEIVER = 7


def traffic_bench(interval_us: float = 200_000) -> PlaneBench:
    bench = airborne(channels=(0, 1))
    bench.by_long(SET_INTERVAL, mavlink.MAVLINK_MSG_ID_ADSB_VEHICLE, interval_us)
    return bench


def test_traffic_is_resent_on_request_from_the_autopilots_address() -> None:
    bench = traffic_bench()
    bench.send(adsb(), (1, 156), RECEIVER)
    bench.fly(0.5)
    received = bench.messages("ADSB_VEHICLE")
    assert {(m.get_srcSystem(), m.get_srcComponent()) for m in received} == {(1, 1)}
    assert received[0].to_dict() == adsb().to_dict()
    assert bench.messages("ADSB_VEHICLE", 1) == []
    assert bench.messages("ADSB_VEHICLE", RECEIVER) == []


def test_a_report_is_repeated_unchanged_for_five_seconds() -> None:
    bench = traffic_bench()
    bench.send(adsb(tslc=1), (1, 156), RECEIVER)
    bench.fly(20.0)
    received = bench.messages("ADSB_VEHICLE")
    assert 5 <= len(received) <= 7  # at most once a second, twice at the very first as recorded
    assert {m.tslc for m in received} == {1}


def test_the_list_is_sent_one_by_one() -> None:
    bench = traffic_bench()
    for _ in range(10):
        for icao in (1, 2, 3):
            bench.send(adsb(icao), (1, 156), RECEIVER)
        bench.fly(1.0)
    received = [m.ICAO_address for m in bench.messages("ADSB_VEHICLE")]
    assert received[:6] == [1, 2, 3, 1, 2, 3]
    assert 27 <= len(received) <= 33


def test_one_of_two_flags_is_enough() -> None:
    bench = traffic_bench()
    bench.send(adsb(1, flags=1, altitude=2**31 - 1, heading=65_535, hor_velocity=65_535), (1, 156), RECEIVER)
    bench.send(adsb(2, flags=12), (1, 156), RECEIVER)
    bench.send(adsb(3, north_m=11_000.0), (1, 156), RECEIVER)
    bench.send(adsb(0x1000000), (1, 156), RECEIVER)
    bench.fly(3.0)
    assert {m.ICAO_address for m in bench.messages("ADSB_VEHICLE")} == {1}
    assert bench.messages("ADSB_VEHICLE")[0].hor_velocity == 65_535


def test_the_own_transponder_is_forwarded_unless_its_address_is_set() -> None:
    bench = traffic_bench()
    bench.send(adsb(0xBEEF), (1, 156), RECEIVER)
    bench.fly(1.0)
    assert bench.messages("ADSB_VEHICLE")
    bench.send(mavlink.MAVLink_param_set_message(1, 1, b"ADSB_ICAO_ID", float(0xBEEF), 6))
    bench.send(adsb(0xBEEF), (1, 156), RECEIVER)
    bench.received.clear()
    bench.fly(5.0)
    assert bench.messages("ADSB_VEHICLE") == []


def test_without_receiver_type_nothing_is_forwarded() -> None:
    bench = traffic_bench()
    bench.send(mavlink.MAVLink_param_set_message(1, 1, b"ADSB_TYPE", 0.0, 2))
    bench.send(adsb(), (1, 156), RECEIVER)
    bench.fly(3.0)
    assert bench.messages("ADSB_VEHICLE") == []


def test_a_report_comes_back_on_the_channel_that_it_came_from() -> None:
    bench = traffic_bench()
    bench.send(adsb(), (1, 156), 0)
    bench.fly(1.0)
    assert bench.messages("ADSB_VEHICLE", 0)
