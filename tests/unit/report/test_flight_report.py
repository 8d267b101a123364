"""The flight report: invented records with known results, and invalid records."""

import contextlib
import json
import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from companion.engine import Engine
from companion.errors import LogError
from companion.geodesy import LocalFrame
from companion.mavlink.dialect import Encoder, mavlink
from companion.mavlink.framing import FrameSplitter
from companion.mavlink.tlog import TlogWriter
from companion.recording import DECISION, STATE, TEXT, McapMessage, McapWriter
from companion.report.encounters import encounters_of
from companion.report.flight import Flight
from companion.report.link import LinkLog
from companion.report.page import page_of
from companion.report.plotting import clock
from companion.report.reading import Log, read_log
from tests.support.thorough import sample

FRAME = LocalFrame(47.0, 8.0)
START_US = 1_750_000_000_000_000


def record(time_s: float, north_m: float = 0.0, east_m: float = 0.0, **changes: Any) -> dict[str, Any]:
    place = FRAME.to_geo(north_m, east_m, -500.0)
    return {
        "time_us": START_US + round(time_s * 1e6),
        "layer": "clear",
        "state": "monitor",
        "flying": False,
        "mode": "AUTO",
        "guidance": None,
        "tracks": 0,
        "own": {
            "lat_deg": place.lat_deg,
            "lon_deg": place.lon_deg,
            "north_m": north_m,
            "east_m": east_m,
            "altitude_m": 500.0,
            "course_deg": 0.0,
            "ground_speed_mps": 20.0,
            "airspeed_mps": 20.0,
            "climb_mps": 0.0,
        },
        "because": "no conflict",
        "threats": [],
        "traffic": [],
        **changes,
    }


def track(name: str, north_m: float, east_m: float, altitude_m: float = 500.0) -> dict[str, Any]:
    return {
        "track": name, "icao": name, "callsign": "N1 ", "kind": "aircraft", "north_m": north_m,
        "east_m": east_m, "altitude_m": altitude_m, "course_deg": 0.0, "ground_speed_mps": 50.0,
        "climb_mps": 0.0, "age_s": 0.1,
    }  # fmt: skip


def threat(name: str) -> dict[str, Any]:
    return {"track": name, "layer": "outer"}


GUIDANCE = {"course_deg": 45.0, "airspeed_mps": 22.0, "altitude_m": 560.0}


def avoided() -> Iterator[dict[str, Any]]:
    """A flight north at 20 m/s, one record a second. A00001 comes head-on at 30 m/s, and is abeam at 60 s.

    The companion flies from 20 to 80 s, 400 m to the east and 60 m higher from 40 s on. A00002 stays 10 km
    away. A00003 passes at 130 s, 100 m abeam and 20 m below, and is not avoided.
    """
    for second in range(200):
        flying = 20 <= second < 80
        east_m = 400.0 if 40 <= second < 80 else 0.0
        one = record(second, 20.0 * second, east_m)
        one["own"]["altitude_m"] = 560.0 if 40 <= second < 80 else 500.0
        if flying:
            one |= {
                "flying": True,
                "state": "outer",
                "layer": "outer",
                "mode": "GUIDED",
                "guidance": GUIDANCE,
            }
            one["threats"] = [threat("A00001")]
        one["traffic"] = [
            track("A00001", 50.0 * (60 - second), -east_m),
            track("A00002", 10_000.0, 0.0),
            track("A00003", 0.0, 100.0 + 30.0 * abs(second - 130), 480.0),
        ]
        yield one


def flight_of(records: Iterator[dict[str, Any]] | list[Any]) -> Flight:
    flight = Flight("invented")
    for one in records:
        flight.add_decision(json.dumps(one))
    return flight


def test_encounters_have_the_known_figures() -> None:
    flight = flight_of(avoided())
    assert (len(flight), flight.unusable) == (200, 0)
    first, second = encounters_of(flight)
    assert first.name == "N1"
    assert flight.time_s[first.closest_at] == pytest.approx(60.0)
    assert first.closest_horizontal_m == pytest.approx(400.0)
    assert first.closest_vertical_m == pytest.approx(-60.0)
    assert first.closest_slant_m == pytest.approx(math.hypot(400.0, 60.0))
    assert (first.layer, first.well_clear, first.nmac) == ("outer", False, False)
    assert (first.acted_s, first.advised_s) == (pytest.approx(40.0), pytest.approx(40.0))
    assert first.aside_m == pytest.approx(400.0, abs=0.5)
    assert first.height_m == pytest.approx(60.0)
    assert flight.time_s[second.closest_at] == pytest.approx(130.0)
    assert (second.closest_horizontal_m, second.closest_vertical_m) == (100.0, -20.0)
    assert (second.layer, second.well_clear, second.nmac) == ("clear", False, True)
    assert (second.acted_s, second.advised_s, second.aside_m, second.height_m) == (None,) * 4


def test_the_deviation_is_measured_from_the_mission_if_it_is_known() -> None:
    flight = flight_of(avoided())
    legs_m = [(0.0, 150.0), (1_000.0, 150.0), (9_000.0, 150.0)]
    places = [FRAME.to_geo(north_m, east_m, 0.0) for north_m, east_m in legs_m]
    flight.mission = [(place.lat_deg, place.lon_deg) for place in places]
    (first, _) = encounters_of(flight)
    assert first.aside_m == pytest.approx(250.0, abs=1.0)


def heard(one: dict[str, Any], state: str, *sources: str, **changes: Any) -> dict[str, Any]:
    evidence = {
        "position_sigma_m": 30.0,
        "velocity_sigma_mps": 1.5,
        "vertical_uncertainty_m": 0.0,
        "alarm": 0,
    }
    return one | {"state": state, "sources": [*sources]} | evidence | changes


def of_sources() -> Iterator[dict[str, Any]]:
    """A00001 is heard by two receivers, by one from 60 s on, coasted from 120 s on, and lost at 150 s.

    A00002 <b> is known by ADS-B to the end. HB1 has no height from 30 to 40 s, and comes to 900 m.
    """
    for second in range(200):
        north_m = 50.0 * (60 - second)
        both = ("gdl90:udpin:0.0.0.0:4000", "sbs:tcp:a:1")
        traffic = [heard(track("A00002", 10_000.0, 0.0), "confirmed", "ADS-B<b>", reports=10 * second)]
        if second < 120:
            sources = both if second < 60 else both[:1]
            traffic.append(heard(track("A00001", north_m, 0.0), "confirmed", *sources, reports=second))
        elif second < 150:
            silent = {"reports": 119, "age_s": second - 119.0, "position_sigma_m": None}
            traffic.append(heard(track("A00001", north_m, 0.0), "coasted", **silent))
        concern = {
            "kind": "height unknown",
            "name": "HB1",
            "avoided": False,
            "bearing_deg": 0.0,
            "seconds": 0.4,
        }
        near = 30 <= second <= 40
        concerns = [concern | {"distance_m": 900.0 + 100.0 * abs(35 - second)}] if near else []
        yield record(second, 20.0 * second, traffic=traffic, concerns=concerns)


def test_the_sources_and_the_end_of_each_aircraft_are_known() -> None:
    flight = flight_of(of_sources())
    assert flight.unusable == 0
    first, second = flight.tracks["A00001"].sighting, flight.tracks["A00002"].sighting
    assert first.sources == ("gdl90:udpin:0.0.0.0:4000", "sbs:tcp:a:1")
    assert first.spans_s["sbs:tcp:a:1"] == [(0.0, 59.0)]
    assert first.spans_s["gdl90:udpin:0.0.0.0:4000"] == [(0.0, 119.0)]
    assert (first.last_heard_s, first.coasted_s()) == (pytest.approx(119.0, abs=0.2), 29.0)
    assert (first.closest_m, first.closest_s, first.reports) == (0.0, 60.0, 119)
    assert (first.state_at(199.0), second.state_at(199.0)) == ("lost", "confirmed")
    assert second.reports == 1990
    (concern,) = flight.concerns.values()
    assert (concern.first_s, concern.last_s, concern.nearest_m) == (30.0, 40.0, 900.0)
    assert (concern.kind, concern.avoided) == ("height unknown", False)


def test_the_page_lists_aircraft_by_source_and_what_was_not_avoided() -> None:
    text = page_of(Log(flight_of(of_sources())))
    row = re.search(r"<tr><td><b>N1</b></td><td>gdl90:udpin:0.0.0.0:4000, sbs:tcp:a:1</td>.*?</tr>", text)
    assert row is not None
    assert "<td>119</td><td>±73 m</td><td>0 m</td><td>1:00</td><td>29 s</td><td>lost</td>" in row[0]
    assert "ADS-B&lt;b&gt;" in text
    assert "<td>HB1</td><td>height unknown</td><td>no</td><td>0:30</td><td>0:40</td><td>900 m</td>" in text
    assert "when each source reported each aircraft" in text
    former = page_of(Log(flight_of(avoided())))
    assert "Not avoided, or odd" not in former
    assert "when each source reported" not in former, "records of former versions have no sources"


def test_advice_that_was_not_flown_has_no_action() -> None:
    records = [one | {"flying": False, "state": "monitor"} for one in avoided()]
    first, _ = encounters_of(flight_of(records))
    assert (first.acted_s, first.advised_s, first.aside_m) == (None, pytest.approx(40.0), None)


def test_an_aircraft_that_returns_later_makes_another_encounter() -> None:
    def records() -> Iterator[dict[str, Any]]:
        for second in range(300):
            here = second < 100 or second >= 200
            yield record(second, traffic=[track("A1", 0.0, 500.0 + second)] if here else [])

    first, second = encounters_of(flight_of(records()))
    assert (first.closest_horizontal_m, second.closest_horizontal_m) == (500.0, 700.0)
    assert first.well_clear is False
    assert second.well_clear is True


def test_each_change_is_listed_once_without_changes_of_readiness() -> None:
    records = [
        record(0),
        record(1, state="standby"),
        record(2, state="outer", layer="outer", flying=True, mode="GUIDED", guidance=GUIDANCE),
        record(3, state="outer", layer="outer", flying=True, mode="GUIDED",
               guidance=GUIDANCE | {"course_deg": 50.0}),
        record(4, state="outer", layer="outer", flying=True, mode="GUIDED",
               guidance=GUIDANCE | {"course_deg": 60.0}),
        record(5, mode="AUTO"),
    ]  # fmt: skip
    flight = flight_of(records)
    assert [change.time_s for change in flight.changes] == [0.0, 2.0, 4.0, 5.0]


@pytest.mark.parametrize(
    "change",
    [
        {"own": None},
        {"own": {"lat_deg": 47.0}},
        {"own": record(0)["own"] | {"lat_deg": 147.0}},
        {"own": record(0)["own"] | {"altitude_m": 1e300}},
        {"own": record(0)["own"] | {"course_deg": True}},
        {"own": record(0)["own"] | {"course_deg": "north"}},
        {"layer": "middle"},
        {"time_us": "now"},
        {"time_us": 1.5},
        {"guidance": {"course_deg": None}},
        {"guidance": [1, 2, 3]},
        {"traffic": 5},
        {"traffic": [{"track": "A"}]},
        {"traffic": [track("A", math.nan, 0.0)]},
        {"threats": [7]},
    ],
    ids=str,
)
def test_invalid_records_are_left_out(change: dict[str, Any]) -> None:
    flight = flight_of([record(0), record(1) | change, record(2)])
    assert (len(flight), flight.unusable) == (2, 1)
    assert [*flight.time_s] == [0.0, 2.0]


@pytest.mark.parametrize("line", [b"", b"\xff", b"null", b"[]", b"7", b'{"a":' * 5000, b'{"time_us":1e999}'])
def test_lines_that_are_not_records_are_left_out(line: bytes) -> None:
    flight = Flight("invented")
    flight.add_decision(line)
    assert (len(flight), flight.unusable) == (0, 1)


def test_decisions_without_a_fix_are_left_out() -> None:
    no_fix = record(0)["own"] | {"lat_deg": 0.0, "lon_deg": 1e-7}
    flight = flight_of([record(0) | {"own": no_fix}, record(1, 10.0), record(2, 20.0)])
    assert (len(flight), flight.unusable, flight.without_fix) == (2, 0, 1)
    assert flight.column("north_m").max() == pytest.approx(10.0, abs=0.1)


def test_jumps_of_the_time_are_ignored_but_an_hour_without_position_is_not() -> None:
    times_us = [START_US, START_US + 10**6, START_US + 3601 * 10**6, 2**63, 2**63 + 10**6, 5, -(10**30)]
    flight = flight_of([record(0) | {"time_us": time_us} for time_us in times_us])
    assert [*flight.time_s] == [0.0, 1.0, 3601.0, 3601.0, 3602.0, 3602.0, 3602.0]
    assert flight.jumps == 3
    assert flight.unusable == 0
    assert "at an unknown time" in page_of(
        Log(flight_of([record(0) | {"time_us": 10**30}, record(1) | {"time_us": 10**30 + 1}]))
    )


def test_the_link_counts_losses_and_gaps() -> None:
    encoder, splitter, link = Encoder(), FrameSplitter(), LinkLog()
    heartbeat = mavlink.MAVLink_heartbeat_message(1, 3, 217, 10, 4, 3)
    for number in range(100):
        raw = encoder.encode(heartbeat, 1, 1)
        (frame,) = splitter.feed(raw)
        if number not in (10, 11, 50) and not 60 <= number < 70:
            link.add(0.5 * number, frame)
    raw = encoder.encode(mavlink.MAVLink_statustext_message(4, b"Fence bre", 7, 0), 1, 1)
    raw += encoder.encode(mavlink.MAVLink_statustext_message(4, b"ached", 7, 1), 1, 1)
    for frame in splitter.feed(raw):
        link.add(50.0, frame)
    autopilot = link.autopilot
    assert autopilot is not None
    assert (autopilot.messages, autopilot.lost) == (89, 13)
    assert autopilot.gaps == [(29.5, 35.0)]
    assert autopilot.per_second[3] == 2
    assert [one.text for one in link.texts] == ["Fence breached"]


SHORT = [[record(0)] * 3 + [record(1, 1e6)], [record(0)], [record(0), record(0)]]


@pytest.mark.parametrize("records", sample(SHORT[:2], SHORT))
def test_a_page_of_very_short_flights(records: list[dict[str, Any]]) -> None:
    for one in records:
        one["traffic"] = [track("A1", 0.0, 0.0)]
    assert "<h2>Encounters" in page_of(Log(flight_of(records)))


def test_clock() -> None:
    assert [clock(s) for s in (0.0, 59.6, 61.0, 3600.0, 7384.0, -2.0)] == [
        "0:00", "1:00", "1:01", "1:00:00", "2:03:04", "-0:02",
    ]  # fmt: skip


# --- from files


def recording(path: Path, *, close: bool = True) -> Path:
    file = McapWriter(path)
    mission = {"items": [{"sequence": 1, "lat_deg": 47.0, "lon_deg": 8.0, "altitude_m": 500.0}]}
    for one in avoided():
        messages = [McapMessage(DECISION, one["time_us"], json.dumps(one))]
        messages.append(McapMessage(STATE, one["time_us"], json.dumps({"version": 1, "mission": mission})))
        if one["time_us"] == START_US + 20_000_000:
            text = json.dumps({"time_us": one["time_us"], "severity": 4, "text": "Traffic <N1>"})
            messages.append(McapMessage(TEXT, one["time_us"], text))
        file.write(messages)
    if close:
        file.close()
    return path


def test_a_recording_is_read_with_texts_and_mission(tmp_path: Path) -> None:
    log = read_log(recording(tmp_path / "a.mcap"), Engine)
    assert len(log.flight) == 200
    assert [(one.time_s, one.text) for one in log.flight.texts] == [(20.0, "Traffic <N1>")]
    assert log.flight.mission == [(47.0, 8.0)]
    assert log.link is None
    assert log.flight.notes == ["a.tlog is missing: the link is unknown"]
    assert "Traffic &lt;N1&gt;" in page_of(log)


def test_a_truncated_recording_is_reported_up_to_its_end(tmp_path: Path) -> None:
    path = recording(tmp_path / "a.mcap", close=False)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    log = read_log(path, Engine)
    assert 50 < len(log.flight) < 150
    assert log.flight.notes[0].startswith("a.mcap was cut off")


def test_later_parts_are_read_too(tmp_path: Path) -> None:
    for part in ("", ".part2", ".part4"):
        recording(tmp_path / f"companion-20260101-120000{part}.mcap")
    log = read_log(tmp_path / "companion-20260101-120000.mcap", Engine)
    assert len(log.flight) == 400


def test_the_tlog_beside_a_recording_gives_the_link(tmp_path: Path) -> None:
    recording(tmp_path / "a.mcap")
    writer = TlogWriter(tmp_path / "a.tlog")
    for second in range(10):
        raw = Encoder().encode(mavlink.MAVLink_heartbeat_message(1, 3, 217, 10, 4, 3), 1, 1)
        writer.write(START_US + second * 1_000_000, raw)
    writer.close()
    log = read_log(tmp_path / "a.mcap", Engine)
    assert log.link is not None
    assert log.link.autopilot is not None
    assert log.link.autopilot.messages == 10
    assert "messages per second" in page_of(log)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "empty"),
        (b"\x89PNG\r\n\x1a\n" + bytes(500), "no MAVLink frame"),
        (b"\x89MCAP0\r\n", "no decisions"),
    ],
)
def test_files_without_a_flight_are_refused_in_one_line(tmp_path: Path, content: bytes, words: str) -> None:
    (tmp_path / "a.mcap").write_bytes(content)
    with pytest.raises(LogError, match=words):
        read_log(tmp_path / "a.mcap", Engine)


def test_random_bytes_and_damage_raise_log_errors_only(tmp_path: Path) -> None:
    chance = np.random.default_rng(5)
    whole = recording(tmp_path / "whole.mcap").read_bytes()
    path = tmp_path / "a.mcap"
    for _ in range(60):
        raw = bytearray(whole[: chance.integers(0, len(whole))])
        for at in chance.integers(0, max(len(raw), 1), 5):
            raw[at : at + 1] = chance.bytes(1)
        path.write_bytes(bytes(raw) if chance.random() < 0.7 else chance.bytes(2000))
        with contextlib.suppress(LogError):
            read_log(path, Engine)
