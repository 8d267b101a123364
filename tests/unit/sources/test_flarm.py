"""FLARM: the examples of the interface document, empty fields, and damage of every kind."""

import math

import pytest

from companion.mavlink.facts import RECEIVER, ReceiverOwnship, Traffic
from companion.model import AltitudeReference, TrafficKind, TrafficReport, TrafficSource
from companion.sources.flarm import FlarmDecoder
from sim.receivers import Reception
from sim.receivers.flarm import FlarmEncoder, sentence
from tests.support.receivers import RECEIVED_S, flipped, heard, transmission

# The examples of FTD-012 for both sentences, with the checksums that it leaves out.
AIRCRAFT = sentence("PFLAA,0,-1234,1234,220,2,DD8F12,180,,30,-1.4,1")
ALARM = sentence("PFLAU,3,1,2,1,2,-30,2,-32,755")
WITH_CALLSIGN = sentence("PFLAA,0,1,,2,1,4A4B4C!JULIET,,,,,8,0,6,-9")
POSITION = sentence("GPRMC,120000.00,A,4730.6000,N,00815.0000,W,97.19,270.0,180226,,,A")


def report(text: str, decoder: FlarmDecoder | None = None) -> TrafficReport:
    (fact,) = (decoder or FlarmDecoder()).feed(sentence(text), RECEIVED_S)
    assert isinstance(fact, Traffic)
    assert fact.sender == RECEIVER
    return fact.report


def pflaa(**changes: str) -> str:
    fields = {
        "alarm": "0",
        "north": "-1234",
        "east": "1234",
        "up": "220",
        "id_type": "2",
        "id": "DD8F12",
        "track": "180",
        "turn": "",
        "speed": "30",
        "climb": "-1.4",
        "type": "1",
        "no_track": "0",
        "source": "0",
        "rssi": "-72",
    }
    return ",".join(("PFLAA", *{**fields, **changes}.values()))


def test_the_example_of_an_aircraft() -> None:
    (fact,) = FlarmDecoder().feed(AIRCRAFT, RECEIVED_S)
    assert fact.report == TrafficReport(
        source=TrafficSource.FLARM,
        key="FLARM-DD8F12",
        time_s=RECEIVED_S,
        altitude_reference=AltitudeReference.BAROMETRIC,
        course_rad=math.pi,
        ground_speed_mps=30.0,
        climb_mps=-1.4,
        relative_m=(-1234.0, 1234.0, 220.0),
    )


@pytest.mark.parametrize(
    ("changes", "field", "value"),
    [
        ({"alarm": "3"}, "alarm", 3),
        ({"alarm": ""}, "alarm", 0),
        ({"id_type": "1"}, "icao", 0xDD8F12),
        ({"id_type": "1"}, "key", "DD8F12"),
        ({"id_type": "1", "id": "000000"}, "icao", None),
        ({"id_type": "0"}, "key", "FLARM-DD8F12"),
        ({"id_type": "3"}, "icao", None),
        ({"id_type": "", "id": ""}, "key", ""),
        ({"id_type": "1", "id": "4d22bc!RYR71VG"}, "callsign", "RYR71VG"),
        ({"id_type": "1", "id": "4d22bc!RYR71VG"}, "key", "4D22BC"),
        ({"track": ""}, "course_rad", None),
        ({"track": "360"}, "course_rad", 0.0),
        ({"speed": ""}, "ground_speed_mps", None),
        ({"climb": ""}, "climb_mps", None),
        ({"speed": "0"}, "airborne", False),
        ({"speed": "0", "type": "3"}, "airborne", True),
        ({"speed": "0", "type": "0"}, "airborne", True),
        ({"speed": ""}, "airborne", True),
        ({"type": "D"}, "kind", TrafficKind.UAV),
        ({"type": "F"}, "kind", TrafficKind.OBSTACLE),
        ({"type": "E"}, "kind", TrafficKind.AIRCRAFT),
        ({"type": ""}, "kind", TrafficKind.AIRCRAFT),
        ({"source": "1"}, "source", TrafficSource.ADSB),
        ({"source": "3"}, "source", TrafficSource.ADSR),
        ({"source": "4"}, "source", TrafficSource.TISB),
        ({"source": "6"}, "source", TrafficSource.MODE_S),
        ({"source": "9"}, "source", TrafficSource.FLARM),
        ({"source": ""}, "source", TrafficSource.FLARM),
        ({"east": ""}, "relative_m", None),
        ({"up": ""}, "relative_m", None),
        ({"east": "", "source": ""}, "source", TrafficSource.MODE_S),
        ({"north": "-42782", "east": "0.5"}, "relative_m", (-42782.0, 0.5, 220.0)),
    ],
    ids=str,
)
def test_each_field_and_its_unknown_value(changes: dict[str, str], field: str, value: object) -> None:
    found = report(pflaa(**changes))
    assert getattr(found, field) == value
    assert (found.lat_deg, found.lon_deg, found.altitude_m) == (None, None, None)


def test_a_target_without_direction_has_the_height_of_its_transponder() -> None:
    decoder = FlarmDecoder()
    decoder.feed(sentence("PGRMZ,3281,F,2"), RECEIVED_S - 1.0)
    found = report("PFLAA,2,4000,,-150,1,39299C,,,,,8", decoder)
    assert (found.relative_m, found.alarm, found.icao) == (None, 2, 0x39299C)
    assert found.altitude_m == pytest.approx(3281 * 0.3048 - 150.0)
    decoder.feed(sentence("PGRMZ,3281,F,3"), RECEIVED_S)
    assert report("PFLAA,2,4000,,-150,1,39299C,,,,,8", decoder).altitude_m is None


def test_the_most_dangerous_target_is_used_where_no_other_sentence_reports_it() -> None:
    decoder = FlarmDecoder()
    decoder.feed(POSITION, RECEIVED_S)
    (fact,) = decoder.feed(ALARM, RECEIVED_S)
    assert (fact.report.alarm, fact.report.key) == (2, "")
    assert fact.report.relative_m == pytest.approx(
        (-755 * math.cos(math.radians(60)), -755 * math.sin(math.radians(60)), -32)
    )
    decoder.feed(AIRCRAFT, RECEIVED_S)
    named = sentence("PFLAU,3,1,2,1,2,-30,2,-32,755,DD8F12")
    assert decoder.feed(named, RECEIVED_S + 1.0) == []
    (later,) = decoder.feed(named, RECEIVED_S + 9.0)
    assert (later.report.key, later.report.relative_m) == ("FLARM-DD8F12", None)


def test_the_key_of_a_target_is_the_same_in_both_sentences() -> None:
    decoder = FlarmDecoder()
    decoder.feed(sentence(pflaa(id_type="1")), RECEIVED_S - 10.0)
    found = report("PFLAU,1,1,2,1,1,0,2,10,500,DD8F12", decoder)
    assert (found.key, found.icao) == ("DD8F12", 0xDD8F12)


def test_an_obstacle_alarm_is_an_obstacle() -> None:
    assert report("PFLAU,1,1,2,1,3,0,3,-20,900,").kind is TrafficKind.OBSTACLE


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("PFLAU,0,1,2,1,0,,0,,", None),
        ("PFLAU,0,1,1,1,0,,0,,,", None),
        ("PFLAU,0,1,0,1,0,,0,,", "no GPS fix"),
        ("PFLAU,0,0,0,0,0,,0,,", "no GPS fix, does not transmit, supply voltage low"),
        ("PFLAE,A,0,0", None),
        ("PFLAE,A,1,93", None),
        ("PFLAE,A,2,81", "obstacle database unusable"),
        ("PFLAE,A,2,2A,XPDR receiver", "XPDR receiver"),
        ("PFLAE,A,3,11", "firmware expired"),
        ("PFLAE,A,3,1FF", "error 1FF"),
        ("PFLAE,R", None),
    ],
)
def test_the_status_says_what_is_wrong(text: str, words: str | None) -> None:
    decoder = FlarmDecoder()
    assert decoder.feed(sentence(text), RECEIVED_S) == []
    assert decoder.status == words
    decoder.restart()
    assert decoder.status is None


def test_an_error_stays_until_the_device_takes_it_back() -> None:
    decoder = FlarmDecoder()
    heard(decoder, [sentence("PFLAE,A,3,11"), sentence("PFLAU,0,1,0,1,0,,0,,")])
    assert decoder.status == "firmware expired, no GPS fix"
    heard(decoder, [sentence("PFLAE,A,0,0"), sentence("PFLAU,0,1,2,1,0,,0,,")])
    assert decoder.status is None


def test_the_position_of_the_receiver_has_both_altitudes() -> None:
    decoder = FlarmDecoder()
    height = sentence("GNGGA,120000.00,4730.6000,N,00815.0000,W,1,08,1.0,500.0,M,47.0,M,,")
    facts = heard(decoder, [height, sentence("PGRMZ,1500,F,2"), POSITION])
    (fact,) = facts
    assert isinstance(fact, ReceiverOwnship)
    own = fact.report
    assert (own.lat_deg, own.lon_deg) == pytest.approx((47.51, -8.25))
    assert (own.ground_speed_mps, own.course_rad) == pytest.approx((50.0, math.radians(270)), abs=0.01)
    assert (own.altitude_m, own.geometric_altitude_m) == pytest.approx((457.2, 547.0))
    assert own.altitude_reference is AltitudeReference.BAROMETRIC


def test_without_a_barometer_the_receiver_has_its_geometric_altitude() -> None:
    decoder = FlarmDecoder()
    height = sentence("GPGGA,120000,4730.6,S,00815.0,E,2,08,1.0,500.0,M,47.0,M,,")
    _, fact = [*heard(decoder, [POSITION]), *heard(decoder, [height, POSITION])]
    assert (fact.report.altitude_m, fact.report.altitude_reference) == (547.0, AltitudeReference.GEOMETRIC)


def test_a_position_without_a_fix_is_none() -> None:
    lost = sentence("GPRMC,120000.00,V,,,,,,,180226,,,N")
    no_height = sentence("GPGGA,120000.00,,,,,0,00,,,M,,M,,")
    decoder = FlarmDecoder()
    assert heard(decoder, [lost, no_height]) == []
    assert (decoder.counters.messages, decoder.counters.bad) == (2, {})


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (AIRCRAFT.replace(b"220", b"221"), "wrong checksum"),
        (b"$PFLAA,0,-1234,1234,220,2,DD8F12,180,,30,-1.4,1\r\n", "no checksum"),
        (b"$PFLAA,0*5\r\n", "no checksum"),
        (b"FLARM\r\n", "no sentence"),
        (b"$" + b"x" * 300 + b"\n", "too long"),
        (b"$" + b"x" * 3000, "too long"),
        (sentence(pflaa(north="12a")), "not a number"),
        (sentence(pflaa(east="nan")), "not a number"),
        (sentence(pflaa(up="1_0")), "not a number"),
        (sentence(pflaa(type="G")), "not a number"),
        (sentence(pflaa(climb="1e3")), "not a number"),
        (sentence(pflaa(alarm="4")), "out of range"),
        (sentence(pflaa(north="900000")), "out of range"),
        (sentence(pflaa(speed="-1")), "out of range"),
        (sentence(pflaa(track="361")), "out of range"),
        (sentence(pflaa(id="DD8F1")), "not an address"),
        (sentence("GPRMC,120000,A,4760.6,N,00815.0,E,97,270,180226"), "out of range"),
        (sentence("GPRMC,120000,A,9100.0,N,00815.0,E,97,270,180226"), "out of range"),
        (sentence("GPRMC,120000,A,4730.6,X,00815.0,E,97,270,180226"), "not a number"),
        (sentence("PGRMZ,abc,F,2"), "not a number"),
        (AIRCRAFT[:20] + sentence("PFLAU,0,1,2,1,0,,0,,"), "truncated"),
    ],
    ids=str,
)
def test_bad_lines_are_counted_by_reason_and_the_next_one_is_read(data: bytes, reason: str) -> None:
    decoder = FlarmDecoder()
    assert decoder.feed(data, RECEIVED_S) == []
    assert decoder.counters.bad == {reason: 1}
    decoder.feed(b"\r\n", RECEIVED_S)
    assert len(decoder.feed(AIRCRAFT, RECEIVED_S)) == 1


def test_other_sentences_are_counted_only() -> None:
    decoder = FlarmDecoder()
    others = (b"\r\n", sentence("PFLAV,A,2.00,5.00,alps"), sentence("GPGSA,A,3,,,"), sentence("PFLAA"))
    assert len(heard(decoder, others)) == 1, "an aircraft of which nothing is known"
    assert (decoder.counters.messages, decoder.counters.bad) == (3, {})


def test_a_stream_cut_anywhere_gives_the_same() -> None:
    stream = POSITION + ALARM + AIRCRAFT + b"\r\n" + sentence("PFLAE,A,2,81")
    whole = heard(FlarmDecoder(), [stream])
    assert len(whole) == 3
    for cut in range(len(stream) + 1):
        assert heard(FlarmDecoder(), [stream[:cut], stream[cut:]]) == whole
    assert heard(FlarmDecoder(), [bytes((byte,)) for byte in stream]) == whole


@pytest.mark.parametrize("line", [AIRCRAFT, ALARM, POSITION])
def test_no_truncated_line_is_believed(line: bytes) -> None:
    for length in range(len(line) - 2):
        decoder = FlarmDecoder()
        assert heard(decoder, [line[:length], b"\r\n"]) == []
        assert len(heard(decoder, [AIRCRAFT])) == 1


@pytest.mark.parametrize("line", [AIRCRAFT, ALARM, POSITION, WITH_CALLSIGN])
def test_a_line_with_a_flipped_bit_is_dropped_or_means_the_same(line: bytes) -> None:
    """Letters of the checksum may be small ones, and there are several kinds of white space at the end."""
    meant = heard(FlarmDecoder(), [line])
    for damaged in flipped(line):
        facts = heard(FlarmDecoder(), [damaged, b"\r\n"])
        assert facts in ([], meant)
        assert facts == [] or damaged[:-4] == line[:-4]


def test_memory_is_bounded() -> None:
    decoder = FlarmDecoder()
    for number in range(2000):
        decoder.feed(b"x" * 200, RECEIVED_S)
        decoder.feed(sentence(pflaa(id=f"{number:06X}")), RECEIVED_S)
    assert len(decoder._sentences._rest) <= 256
    assert len(decoder._reported) <= 500


def test_the_simulated_receiver_needs_its_own_position() -> None:
    decoder = FlarmDecoder()
    assert heard(decoder, FlarmEncoder().encode(Reception(RECEIVED_S, [transmission()]))) == []
    assert decoder.status == "no GPS fix"
    own = transmission(icao=0xABCDEF)
    facts = heard(decoder, FlarmEncoder().encode(Reception(RECEIVED_S, [transmission()], own)))
    assert [type(fact) for fact in facts] == [ReceiverOwnship, Traffic]
    assert decoder.status is None
