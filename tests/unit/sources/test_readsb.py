"""aircraft.json: what readsb, dump1090 and services like them write, and what they may write wrong."""

import json
import math
from typing import Any

import pytest

from companion.model import AltitudeReference, TrafficKind, TrafficReport, TrafficSource
from companion.sources.readsb import MAX_AIRCRAFT, MAX_DOCUMENT_BYTES, ReadsbDecoder
from sim.receivers.encoder import Reception
from sim.receivers.readsb import ReadsbEncoder
from tests.support.adsb_receivers import PLACE, aircraft, distance_m, reports

# As in the published example of an aircraft, all fields that are read and some that are not.
ENTRY: dict[str, Any] = {
    "hex": "a2fcf2",
    "type": "adsb_icao",
    "flight": "ASA541  ",
    "r": "N292AK",
    "alt_baro": 5400,
    "alt_geom": 5650,
    "gs": 250,
    "track": 0.69,
    "baro_rate": -960,
    "geom_rate": -900,
    "squawk": "3766",
    "category": "A3",
    "lat": 47.143753,
    "lon": -122.320953,
    "nic": 8,
    "rc": 186,
    "seen_pos": 0.5,
    "version": 2,
    "nac_p": 10,
    "nac_v": 2,
    "sil": 3,
    "sil_type": "perhour",
    "mlat": [],
    "tisb": [],
    "messages": 52561265,
    "seen": 0,
    "rssi": -5,
}


def document(*entries: object, now: object = 1_700_000_000.0, **more: object) -> bytes:
    return json.dumps({"now": now, "messages": 1, "aircraft": entries, **more}).encode()


def one(**changes: object) -> TrafficReport:
    """The report of the example with other fields; `None` takes one away."""
    entry = {name: value for name, value in {**ENTRY, **changes}.items() if value is not None}
    (report,) = reports(ReadsbDecoder(), [document(entry)])
    return report


def none(**changes: object) -> bool:
    entry = {name: value for name, value in {**ENTRY, **changes}.items() if value is not None}
    return reports(ReadsbDecoder(), [document(entry)]) == []


def test_an_entry_is_a_report() -> None:
    report = one()
    assert (report.key, report.icao, report.source) == ("A2FCF2", 0xA2FCF2, TrafficSource.ADSB)
    assert (report.lat_deg, report.lon_deg, report.time_s) == (47.143753, -122.320953, 99.5)
    assert report.altitude_m == pytest.approx(1645.92)
    assert report.altitude_reference is AltitudeReference.BAROMETRIC
    assert report.geometric_altitude_m == pytest.approx(1722.12)
    assert report.ground_speed_mps == pytest.approx(128.6111, abs=1e-3)
    assert report.course_rad == pytest.approx(math.radians(0.69))
    assert report.climb_mps == pytest.approx(-4.8768)
    assert (report.callsign, report.squawk, report.kind) == ("ASA541", 3766, TrafficKind.AIRCRAFT)
    assert report.position_sigma_m == pytest.approx(10.0 / 2.448)
    assert report.velocity_sigma_mps == pytest.approx(3.0 / 2.448)
    assert (report.containment_m, report.sil, report.airborne) == (186.0, 3, True)
    assert report.altitude_sigma_m is None  # what NACp says is about the geometric one


def test_a_geometric_altitude_alone() -> None:
    report = one(alt_baro=None)
    assert report.altitude_reference is AltitudeReference.GEOMETRIC
    assert report.altitude_m == pytest.approx(1722.12)
    assert report.geometric_altitude_m is None
    assert report.climb_mps == pytest.approx(-4.572)
    assert report.altitude_sigma_m == pytest.approx(15.0 / 1.960)


def test_on_the_ground() -> None:
    report = one(alt_baro="ground")
    assert (report.airborne, report.altitude_reference) == (False, AltitudeReference.GEOMETRIC)


def test_containment_follows_from_the_category_where_it_is_not_stated() -> None:
    assert one(rc=None).containment_m == pytest.approx(185.2)
    assert one(rc=0).containment_m == pytest.approx(185.2)
    assert one(rc=None, nic=0).containment_m is None


@pytest.mark.parametrize(
    ("kind", "source"),
    [
        ("adsb_icao", TrafficSource.ADSB),
        ("adsb_icao_nt", TrafficSource.ADSB),
        ("adsb_other", TrafficSource.ADSB),
        ("adsr_icao", TrafficSource.ADSR),
        ("adsr_other", TrafficSource.ADSR),
        ("tisb_icao", TrafficSource.TISB),
        ("tisb_other", TrafficSource.TISB),
        ("tisb_trackfile", TrafficSource.TISB),
        ("mlat", TrafficSource.MLAT),
        ("adsc", TrafficSource.ADSB),
        ("other", TrafficSource.ADSB),
        ("uat_adsb_icao", TrafficSource.ADSB),
        ("unknown", TrafficSource.ADSB),
        (None, TrafficSource.ADSB),
        (7, TrafficSource.ADSB),
    ],
)
def test_the_type_says_how_the_position_was_obtained(kind: object, source: TrafficSource) -> None:
    assert one(type=kind).source is source


def test_fields_from_multilateration_and_tisb_are_listed() -> None:
    assert one(mlat=["lat", "lon", "track"]).source is TrafficSource.MLAT
    assert one(tisb=["altitude", "lat", "lon"]).source is TrafficSource.TISB
    assert one(mlat=["callsign"], tisb=["squawk"]).source is TrafficSource.ADSB


def test_addresses() -> None:
    assert (one(hex="~a2fcf2").key, one(hex="~a2fcf2").icao) == ("~A2FCF2", None)
    assert (one(hex="000000").key, one(hex="000000").icao) == ("", None)


@pytest.mark.parametrize(
    "address", ["", "a2fcf", "a2fcf2a", "~~a2fcf", "a2fcg2", "+a2fcf", 7, None, [], "٠١٢٣٤٥"]
)
def test_a_bad_address_is_counted(address: object) -> None:
    decoder = ReadsbDecoder()
    assert decoder.feed(document({**ENTRY, "hex": address}), 0.0) == []
    assert decoder.counters.bad == {"bad address": 1}


@pytest.mark.parametrize(
    ("category", "kind"),
    [("B6", TrafficKind.UAV), ("C1", TrafficKind.SURFACE_VEHICLE), ("C3", TrafficKind.OBSTACLE), (6, None)],
)
def test_kinds(category: object, kind: TrafficKind | None) -> None:
    assert one(category=category).kind is (kind or TrafficKind.AIRCRAFT)


def test_the_names_of_older_versions() -> None:
    names = {"altitude": "alt_baro", "speed": "gs", "vert_rate": "baro_rate"}
    older = {old: ENTRY[new] for old, new in names.items()}
    report = one(**dict.fromkeys(names.values()), alt_geom=None, geom_rate=None, type=None, **older)
    assert report.altitude_m == pytest.approx(1645.92)
    assert report.ground_speed_mps == pytest.approx(128.6111, abs=1e-3)
    assert report.climb_mps == pytest.approx(-4.8768)


def test_a_document_of_a_service() -> None:
    raw = json.dumps({"ac": [ENTRY], "now": 1_700_000_000_500, "msg": "No error"}).encode()
    decoder = ReadsbDecoder()
    assert len(decoder.feed(raw, 100.0)) == 1
    assert decoder.feed(raw, 101.0) == []


def test_a_document_that_has_not_changed_gives_nothing() -> None:
    decoder = ReadsbDecoder()
    assert len(decoder.feed(document(ENTRY), 100.0)) == 1
    for second in range(1, 20):
        assert decoder.feed(document(ENTRY), 100.0 + second) == []
    assert decoder.counters.messages == 1
    assert decoder.counters.bad == {}
    assert decoder.status == "the document has not changed for 19 s"
    assert len(decoder.feed(document(ENTRY, now=1_700_000_020.0), 120.0)) == 1
    assert decoder.status is None


def test_a_position_is_reported_once() -> None:
    decoder = ReadsbDecoder()
    assert len(decoder.feed(document(ENTRY, now=1000.0), 100.0)) == 1
    older = {**ENTRY, "seen_pos": 1.5, "seen": 0.1}
    assert decoder.feed(document(older, now=1001.0), 101.0) == []
    (fact,) = decoder.feed(document(ENTRY, now=1002.0), 102.0)
    assert fact.report.time_s == 101.5


def test_a_late_copy_of_a_document_gives_nothing() -> None:
    decoder = ReadsbDecoder()
    decoder.feed(document(ENTRY, now=1000.0), 100.0)
    assert decoder.feed(document(ENTRY, now=995.0), 101.0) == []
    assert decoder.counters.bad == {"late copy of a document": 1}


@pytest.mark.parametrize("back_s", [10.0, 3600.0])
def test_a_clock_that_is_set_back_silences_nobody_for_long(back_s: float) -> None:
    decoder = ReadsbDecoder()
    decoder.feed(document(ENTRY, now=10_000.0), 100.0)
    found = [
        bool(decoder.feed(document(ENTRY, now=10_000.0 - back_s + second), 101.0 + second))
        for second in range(6)
    ]
    assert found[4:] == [True, True]


def test_a_clock_from_the_future_silences_nobody_for_long() -> None:
    decoder = ReadsbDecoder()
    decoder.feed(document(ENTRY, now=1e10), 100.0)
    assert decoder.feed(document(ENTRY, now=1_700_000_000.0), 101.0) != []


def test_a_document_without_its_time_is_of_its_reception() -> None:
    decoder = ReadsbDecoder()
    raw = json.dumps({"aircraft": [ENTRY]}).encode()
    assert [len(decoder.feed(raw, second)) for second in (1.0, 2.0)] == [1, 1]


def test_rough_and_last_positions_are_none() -> None:
    last = {"lat": 47.0, "lon": 8.0, "nic": 8, "rc": 186, "seen_pos": 99.0}
    report = one(lat=None, lon=None, seen_pos=None, rr_lat=47.0, rr_lon=8.0, lastPosition=last)
    assert (report.lat_deg, report.lon_deg, report.source) == (None, None, TrafficSource.MODE_S)
    assert report.altitude_m == pytest.approx(1645.92)


def test_an_altitude_alone_is_reported_as_long_as_the_aircraft_is_heard() -> None:
    decoder = ReadsbDecoder()
    entry = {"hex": "750312", "type": "mode_s", "alt_baro": 7025, "seen": 0.2}
    assert len(decoder.feed(document(entry, now=1000.0), 100.0)) == 1
    silent = {**entry, "seen": 1.2}
    assert decoder.feed(document(silent, now=1001.0), 101.0) == []
    (fact,) = decoder.feed(document(entry, now=1002.0), 102.0)
    assert (fact.report.time_s, fact.report.source) == (101.8, TrafficSource.MODE_S)


def test_positions_that_are_too_old_give_an_altitude() -> None:
    assert one(seen_pos=31.0).lat_deg is None


@pytest.mark.parametrize("lat", [True, "47.1", math.nan, math.inf, 90.5, 10**400, [], {}, -1e300])
def test_a_latitude_of_the_wrong_kind_is_no_position(lat: object) -> None:
    assert one(lat=lat).lat_deg is None


def test_no_position_at_the_origin() -> None:
    assert one(lat=0, lon=0.0).lat_deg is None


@pytest.mark.parametrize(
    "value", [True, "5400", math.nan, math.inf, -math.inf, 10**400, [], {}, -1e300, "x" * 9]
)
def test_numbers_of_the_wrong_kind_are_unknown(value: object) -> None:
    names = "alt_baro alt_geom gs track baro_rate geom_rate nic rc nac_p nac_v sil category mlat tisb"
    report = one(**dict.fromkeys(names.split(), value))
    assert (report.altitude_m, report.geometric_altitude_m, report.ground_speed_mps) == (None, None, None)
    assert (report.course_rad, report.climb_mps, report.sil) == (None, None, None)
    assert (report.position_sigma_m, report.velocity_sigma_mps, report.containment_m) == (None, None, None)


@pytest.mark.parametrize("value", [True, 7700, 10**400, [], {}, "7800", "x" * 1_000, "\ud800"])
def test_texts_of_the_wrong_kind_are_unknown(value: object) -> None:
    report = one(squawk=value, flight=[value], category=value)
    assert (report.squawk, report.callsign, report.kind) == (None, None, TrafficKind.AIRCRAFT)


@pytest.mark.parametrize(
    ("raw", "reason"),
    [
        (b"", "not JSON"),
        (b"\xff\xfe\x00", "not JSON"),
        (b"[" * 100_000, "not JSON"),
        (b'{"a":' * 100_000, "not JSON"),
        (b"9" * 5_000, "not JSON"),
        (b"null", "no list of aircraft"),
        (b"[]", "no list of aircraft"),
        (b'"aircraft"', "no list of aircraft"),
        (b"{}", "no list of aircraft"),
        (b'{"aircraft": {}}', "no list of aircraft"),
        (b'{"aircraft": null, "now": 1}', "no list of aircraft"),
        (b" " * (MAX_DOCUMENT_BYTES + 1), "document too large"),
    ],
)
def test_a_bad_document_is_counted(raw: bytes, reason: str) -> None:
    decoder = ReadsbDecoder()
    assert decoder.feed(raw, 0.0) == []
    assert decoder.counters.bad == {reason: 1}


def test_entries_that_are_none_are_counted() -> None:
    decoder = ReadsbDecoder()
    assert len(decoder.feed(document(None, 1, "x", [], ENTRY), 0.0)) == 1
    assert decoder.counters.bad == {"not an aircraft": 4}


def test_aircraft_beyond_the_limit_are_counted() -> None:
    decoder = ReadsbDecoder()
    decoder.feed(document(*[{}] * (MAX_AIRCRAFT + 3)), 0.0)
    assert decoder.counters.bad["too many aircraft"] == 3


def test_every_truncated_document_is_counted() -> None:
    raw = document(ENTRY)
    for cut in range(len(raw)):
        decoder = ReadsbDecoder()
        assert decoder.feed(raw[:cut], 0.0) == []
        assert sum(decoder.counters.bad.values()) == 1


def test_invented_aircraft_take_no_memory() -> None:
    decoder = ReadsbDecoder()
    entries = [{**ENTRY, "hex": f"{address:06x}"} for address in range(MAX_AIRCRAFT)]
    decoder.feed(document(*entries), 0.0)
    assert len(decoder._aircraft) <= 4_096


def test_the_simulated_receiver_is_understood() -> None:
    raw = ReadsbEncoder().encode(Reception(1.7e9, [aircraft(category=14, nic=9, nacp=10)]))
    (report,) = reports(ReadsbDecoder(), raw)
    assert distance_m(report, PLACE) < 0.2
    assert report.altitude_m == pytest.approx(1100.0, abs=4.0)
    assert report.geometric_altitude_m == pytest.approx(1234.5, abs=4.0)
    assert report.ground_speed_mps == pytest.approx(50.0, abs=0.03)
    assert report.course_rad == pytest.approx(math.atan2(-40.0, 30.0) % math.tau, abs=1e-4)
    assert report.climb_mps == pytest.approx(2.0, abs=0.17)
    assert (report.callsign, report.kind, report.containment_m) == ("KLM1023", TrafficKind.UAV, 75.0)


def test_the_simulated_receiver_lists_aircraft_for_a_minute() -> None:
    encoder, decoder = ReadsbEncoder(), ReadsbDecoder()
    reports(decoder, encoder.encode(Reception(1.7e9, [aircraft()])))
    listed = [json.loads(encoder.encode(Reception(1.7e9 + age_s, []))[0])["aircraft"] for age_s in (30, 61)]
    assert [len(entries) for entries in listed] == [1, 0]
    assert listed[0][0]["seen_pos"] == 30.0


def test_the_simulated_receiver_says_who_is_on_the_ground() -> None:
    raw = ReadsbEncoder().encode(Reception(1.7e9, [aircraft(on_ground=True)]))
    (report,) = reports(ReadsbDecoder(), raw)
    assert not report.airborne
