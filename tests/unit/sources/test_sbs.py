"""SBS-1 lines: what BaseStation, dump1090, readsb and mlat-client send, and what they may send wrong."""

import math
from collections.abc import Iterator

import pytest

from companion.mavlink.facts import RECEIVER
from companion.model import AltitudeReference, TrafficReport, TrafficSource
from companion.sources.sbs import MAX_LINE_BYTES, SbsDecoder
from sim.receivers.encoder import Reception
from sim.receivers.sbs import SbsEncoder
from tests.support.adsb_receivers import PLACE, aircraft, distance_m, reports

MOMENT = "2008/11/28,14:58:51.153"
MOMENTS = f"{MOMENT},{MOMENT}"
# From the description of the format (Barebones article 42), received without delay.
VELOCITY = f"MSG,4,5,276,4010E9,10088,{MOMENTS},,,459.4,20.2,,,64,,,,,\r\n".encode()
POSITION = f"MSG,3,5,276,4010E9,10088,{MOMENTS},,28000,,,53.02551,-2.91389,,,0,0,0,0\r\n".encode()
ALTITUDE = f"MSG,5,5,276,4010E9,10088,{MOMENTS},,28000,,,,,,,0,,0,0\r\n".encode()
CALLSIGN = f"MSG,1,5,276,4010E9,10088,{MOMENTS},BAW4J   ,,,,,,,,,,,\r\n".encode()


def heard(stream: bytes, received_s: float = 100.0) -> list[TrafficReport]:
    return reports(SbsDecoder(), [stream], received_s)


def bad(stream: bytes) -> dict[str, int]:
    decoder = SbsDecoder()
    assert decoder.feed(stream, 100.0) == []
    return dict(decoder.counters.bad)


def with_field(number: int, value: str, line: bytes = POSITION) -> bytes:
    """A line with another value in a field, counted from 1."""
    fields = line.decode("latin-1").rstrip("\r\n").split(",")
    fields[number - 1] = value
    return (",".join(fields) + "\r\n").encode("utf-8")


def test_a_position_has_what_the_lines_before_said() -> None:
    decoder = SbsDecoder()
    squawk = f"MSG,6,5,276,4010E9,10088,{MOMENTS},,,,,,,,4244,0,0,0,0\r\n".encode()
    assert decoder.feed(CALLSIGN + squawk + VELOCITY, 100.0) == []
    (fact,) = decoder.feed(POSITION, 100.5)
    report = fact.report
    assert fact.sender == RECEIVER
    assert (report.key, report.icao, report.source) == ("4010E9", 0x4010E9, TrafficSource.ADSB)
    assert (report.lat_deg, report.lon_deg, report.time_s) == (53.02551, -2.91389, 100.5)
    assert report.altitude_m == pytest.approx(8534.4)  # 28,000 ft
    assert report.altitude_reference is AltitudeReference.BAROMETRIC
    assert report.ground_speed_mps == pytest.approx(236.3358, abs=1e-3)  # 459.4 kt
    assert report.course_rad == pytest.approx(math.radians(20.2))
    assert report.climb_mps == pytest.approx(0.32512)  # 64 ft/min
    assert (report.callsign, report.squawk, report.airborne) == ("BAW4J", 4244, True)
    assert (decoder.counters.messages, decoder.counters.reports) == (4, 1)


def test_a_velocity_is_joined_only_while_it_is_fresh() -> None:
    decoder = SbsDecoder()
    decoder.feed(VELOCITY, 100.0)
    (late,) = decoder.feed(POSITION, 104.0)
    assert (late.report.ground_speed_mps, late.report.course_rad, late.report.climb_mps) == (None, None, None)


def test_a_surface_position_is_on_the_ground_without_an_altitude() -> None:
    (report,) = heard(f"MSG,2,1,1,4840D6,1,{MOMENTS},,0,12,90,52.1,4.7,,,,,,-1\r\n".encode())
    assert (report.airborne, report.altitude_m) == (False, None)
    assert report.ground_speed_mps == pytest.approx(6.1733, abs=1e-3)
    assert report.course_rad == pytest.approx(math.pi / 2)


@pytest.mark.parametrize(("flag", "airborne"), [("-1", False), ("1", False), ("0", True), ("", True)])
def test_the_last_field_says_who_is_on_the_ground(flag: str, airborne: bool) -> None:
    (report,) = heard(with_field(22, flag))
    assert report.airborne is airborne


def test_an_altitude_with_an_h_is_geometric() -> None:
    (report,) = heard(with_field(12, "28350H"))
    assert report.altitude_reference is AltitudeReference.GEOMETRIC
    assert report.altitude_m == pytest.approx(8641.08)


def test_a_climb_may_have_an_h_too() -> None:
    decoder = SbsDecoder()
    decoder.feed(with_field(17, "-640H", VELOCITY), 100.0)
    (fact,) = decoder.feed(POSITION, 100.0)
    assert fact.report.climb_mps == pytest.approx(-3.2512)


def test_all_in_one_line() -> None:
    said = "BAW4J,17750,381,097,51.4854,-1.9028,-2496,4244,0,0,0,0"
    (report,) = heard(f"MSG,3, 0,  0,4006B3,      0,{MOMENTS},{said}\n".encode())
    assert (report.callsign, report.squawk, report.lat_deg) == ("BAW4J", 4244, 51.4854)
    assert report.climb_mps == pytest.approx(-12.67968)


def test_a_position_by_multilateration_says_so() -> None:
    line = f"MLAT,3,1,1,4CA2D6,1,{MOMENTS},,37000,408,146,51.4,-1.0,64,,5,120,0,0,,,0.2,\r\n".encode()
    (report,) = heard(line)
    assert report.source is TrafficSource.MLAT


def test_the_delay_between_the_times_of_a_line_is_taken_off() -> None:
    generated, logged = "2008/11/28,23:59:58.500", "2008/11/29,00:00:00.750"
    (report,) = heard(POSITION.replace(MOMENTS.encode(), f"{generated},{logged}".encode()))
    assert report.time_s == pytest.approx(97.75)


@pytest.mark.parametrize(
    "times",
    [
        "2008/11/28,14:58:51.153,2008/11/28,15:58:51.153",  # another zone
        "2008/11/28,14:58:51.153,2008/11/28,14:58:50.153",  # backwards
        ",,,",
        "x,y,z,0",
        "2008/13/45,25:61:61.1,2008/11/28,14:58:51.153",
    ],
)
def test_times_that_say_nothing_are_not_used(times: str) -> None:
    (report,) = heard(POSITION.replace(MOMENTS.encode(), times.encode()))
    assert report.time_s == 100.0


def test_lines_that_are_delayed_by_minutes_are_no_traffic() -> None:
    decoder = SbsDecoder()
    old = POSITION.replace(MOMENTS.encode(), b"2008/11/28,14:53:50.594,2008/11/28,14:58:51.153")
    assert decoder.feed(old, 100.0) == []
    assert decoder.counters.bad == {"delayed by minutes": 1}
    assert decoder.status == "its lines are 301 s old when they arrive"
    assert decoder.feed(POSITION, 101.0) != []
    assert decoder.status is None


def test_an_altitude_without_a_position_is_reported_once_a_second() -> None:
    decoder = SbsDecoder()
    (fact,) = decoder.feed(ALTITUDE + ALTITUDE, 100.0)
    report = fact.report
    assert (report.source, report.lat_deg) == (TrafficSource.MODE_S, None)
    assert report.altitude_m == pytest.approx(8534.4)
    assert len(decoder.feed(ALTITUDE, 101.0)) == 1


def test_an_altitude_beside_positions_is_not_reported() -> None:
    decoder = SbsDecoder()
    decoder.feed(POSITION, 100.0)
    assert decoder.feed(ALTITUDE, 105.0) == []
    assert len(decoder.feed(ALTITUDE, 111.0)) == 1


def test_addresses_that_are_not_of_icao() -> None:
    (report,) = heard(with_field(5, "~2A0001"))
    assert (report.key, report.icao) == ("~2A0001", None)


def test_aircraft_without_an_address_are_not_combined() -> None:
    anonymous = [with_field(5, "000000", line) for line in (CALLSIGN, VELOCITY, POSITION)]
    (report,) = heard(b"".join(anonymous))
    assert (report.key, report.icao, report.callsign, report.ground_speed_mps) == ("", None, None, None)


def test_no_position_is_where_no_receiver_has_one() -> None:
    assert heard(with_field(15, "0.0000").replace(b"-2.91389", b"0.0000"))[0].lat_deg is None
    assert [report.lat_deg for report in heard(with_field(15, ""))] == [None]


@pytest.mark.parametrize(
    "line", ["SEL,,5,276,4010E9,1,1,1,1,1,BAW4J", "STA,,5,179,400AE7,1,1,1,1,1,RM", "CLK,,496"]
)
def test_other_lines_are_messages_without_traffic(line: str) -> None:
    decoder = SbsDecoder()
    assert decoder.feed(f"{line}\r\n".encode(), 0.0) == []
    assert (decoder.counters.messages, decoder.counters.bad) == (1, {})


@pytest.mark.parametrize("end", [b"\n", b"\r\n", b"\r", b"\n\n", b"\r\n\r\n"])
def test_lines_end_in_any_way(end: bytes) -> None:
    decoder = SbsDecoder()
    assert len(reports(decoder, [(POSITION.rstrip() + end) * 3])) == 3
    assert decoder.counters.bad == {}


@pytest.mark.parametrize(
    ("field", "value", "reason"),
    [
        (1, "MSX", "unknown kind of line"),
        (2, "9", "unknown kind of line"),
        (2, "", "unknown kind of line"),
        (2, "33", "unknown kind of line"),
        (5, "4010E", "bad address"),
        (5, "4010EG", "bad address"),
        (5, "", "bad address"),
        (12, "28_000", "not a number"),
        (12, "nan", "not a number"),
        (12, "1e5", "not a number"),
        (12, "999999", "out of range"),
        (12, "9" * 300, "not a number"),
        (13, "-1", "out of range"),
        (14, "361", "out of range"),
        (15, "90.1", "out of range"),
        (16, "-180.5", "out of range"),
        (16, "inf", "not a number"),
        (17, "--64", "not a number"),
        (22, "x", "bad flag"),
        (22, "-", "bad flag"),
        (22, "0,1", "too many fields"),
        (22, "0MSG", "bad flag"),
        (11, "KLM\u00c4", "not printable ASCII"),
        (11, "KL\x00M", "not printable ASCII"),
        (12, "\u0662\u0668", "not printable ASCII"),
    ],
)
def test_a_bad_line_is_counted_and_dropped(field: int, value: str, reason: str) -> None:
    assert bad(with_field(field, value)) == {reason: 1}


def test_two_lines_in_one_are_refused() -> None:
    for cut in range(1, len(POSITION) - 3):
        decoder = SbsDecoder()
        decoder.feed(POSITION[:cut] + POSITION, 0.0)
        assert decoder.counters.reports == 0


def test_every_truncated_line_is_counted() -> None:
    whole = POSITION.rstrip()
    for cut in range(1, len(whole)):
        if whole[:cut].count(b",") < 21:
            assert sum(bad(whole[:cut] + b"\n").values()) == 1


def test_a_line_without_an_end_is_not_kept() -> None:
    decoder = SbsDecoder()
    for _ in range(1_000):
        assert decoder.feed(b"MSG,3," * 1_000, 0.0) == []
        assert len(decoder._rest) <= MAX_LINE_BYTES
    assert decoder.counters.bad == {"line too long": 1}
    assert decoder.feed(b"the end\r\n", 0.0) == []
    assert len(decoder.feed(POSITION, 0.0)) == 1


def test_a_new_connection_forgets_half_a_line() -> None:
    decoder = SbsDecoder()
    decoder.feed(POSITION[:40], 0.0)
    decoder.restart()
    assert len(decoder.feed(POSITION, 0.0)) == 1


def test_invented_aircraft_take_no_memory() -> None:
    decoder = SbsDecoder()
    for address in range(0, 0xFFFFFF, 3_000):
        decoder.feed(with_field(5, f"{address:06X}"), 0.0)
    assert len(decoder._aircraft) <= 4_096


def test_pieces_cut_anywhere_say_the_same() -> None:
    stream = CALLSIGN + VELOCITY + POSITION
    whole = heard(stream)
    for cut in range(len(stream)):
        assert reports(SbsDecoder(), [stream[:cut], stream[cut:]]) == whole


def flown() -> Iterator[TrafficReport]:
    encoder, decoder = SbsEncoder(), SbsDecoder()
    for step in range(4):
        time_s = 1.7e9 + 0.5 * step
        yield from reports(decoder, encoder.encode(Reception(time_s, [aircraft()])), time_s)


def test_the_simulated_receiver_is_understood() -> None:
    *_, report = flown()
    assert distance_m(report, PLACE) < 0.2
    assert report.altitude_m == pytest.approx(1100.0, abs=4.0)
    assert report.ground_speed_mps == pytest.approx(50.0, abs=0.3)
    assert report.course_rad == pytest.approx(math.atan2(-40.0, 30.0) % math.tau, abs=0.01)
    assert report.climb_mps == pytest.approx(2.0, abs=0.17)
    assert report.callsign == "KLM1023"


def test_the_simulated_receiver_says_who_is_on_the_ground() -> None:
    parked = aircraft(on_ground=True, velocity_mps=(0.0, 0.0, 0.0))
    (report,) = reports(SbsDecoder(), SbsEncoder().encode(Reception(1.7e9, [parked])))
    assert (report.airborne, report.ground_speed_mps, report.callsign) == (False, 0.0, "KLM1023")
