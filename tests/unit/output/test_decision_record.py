"""The recorded line of a decision: its fields, and the same JSON as the standard library writes."""

import json
import math
from collections.abc import Sequence
from typing import Any

import pytest

from companion.geodesy import GeoPoint, LocalFrame
from companion.model import Decision, Layer, Ownship, Threat, Track, TrafficKind
from companion.output.decision_record import Circumstances, decision_line

FRAME = LocalFrame(-35.36, 149.16)
HERE = GeoPoint(-35.35, 149.17, 884.0)
OWN = Ownship(5.0, FRAME.to_ned_m(HERE), (0.0, 20.0, -1.0), 22.0, 1.5)
NORTH_M, EAST_M, DOWN_M = OWN.position_m


def line(*tracks: Track, frame: LocalFrame | None = FRAME) -> dict[str, Any]:
    return parsed(Decision(Layer.CLEAR, because='"so"'), tracks, frame)


def parsed(decision: Decision, tracks: Sequence[Track], frame: LocalFrame | None = FRAME) -> dict[str, Any]:
    text = decision_line(5.0, decision, OWN, tracks, Circumstances("monitor", False, "AUTO", frame, 584.0))
    record: dict[str, Any] = json.loads(text)
    assert json.dumps(record, separators=(",", ":")) == text
    return record


def track(**changes: Any) -> Track:
    values: dict[str, Any] = {
        "track_id": "A00001",
        "time_s": 5.0,
        "position_m": (NORTH_M + 100.0, EAST_M - 50.04, DOWN_M - 30.0),
        "velocity_mps": (-3.0, -4.0, 2.0),
        "icao": 0xA00001,
        "callsign": 'N"1',
        "age_s": 0.26,
    }
    return Track(**values | changes)


def test_a_line_has_position_state_and_mode() -> None:
    record = line()
    assert record["own"]["lat_deg"] == pytest.approx(HERE.lat_deg, abs=1e-7)
    assert record["own"]["lon_deg"] == pytest.approx(HERE.lon_deg, abs=1e-7)
    assert (record["own"]["altitude_m"], record["own"]["height_m"]) == (884.0, 300.0)
    assert (record["own"]["course_deg"], record["own"]["climb_mps"]) == (90.0, 1.0)
    assert (record["state"], record["flying"], record["mode"]) == ("monitor", False, "AUTO")
    assert (record["tracks"], record["traffic"]) == (0, [])
    assert line(frame=None)["own"]["lat_deg"] is None


def test_every_track_is_relative_to_ownship() -> None:
    record = line(track(), track(track_id="mast", icao=None, callsign=None, kind=TrafficKind.OBSTACLE))
    assert record["tracks"] == 2
    first, second = record["traffic"]
    assert first == {
        "track": "A00001",
        "icao": "A00001",
        "callsign": 'N"1',
        "kind": "aircraft",
        "north_m": 100.0,
        "east_m": -50.0,
        "altitude_m": 914.0,
        "course_deg": 233.1,
        "ground_speed_mps": 5.0,
        "climb_mps": -2.0,
        "age_s": 0.3,
    }
    assert (second["icao"], second["callsign"], second["kind"]) == (None, None, "obstacle")


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_numbers_that_are_not_finite_are_refused(bad: float) -> None:
    with pytest.raises(ValueError, match="not finite"):
        line(track(position_m=(bad, 0.0, 0.0)))


def test_every_threat_is_in_the_line() -> None:
    threats = [
        Threat('T"1', 1, 1234.56, -30.0, -math.pi / 2, 60.0, 12.34, 99.9, -3.0, Layer.OUTER),
        Threat("T2", None, 1.0, 0.0, 0.0, 0.0, math.inf, 0.0, 0.0, Layer.INNER),
    ]
    first, second = parsed(Decision(Layer.INNER, threats=threats), [])["threats"]
    assert first == {
        "track": 'T"1',
        "distance_m": 1234.6,
        "relative_altitude_m": -30.0,
        "bearing_deg": 270.0,
        "closing_mps": 60.0,
        "time_to_closest_s": 12.3,
        "miss_horizontal_m": 99.9,
        "miss_vertical_m": -3.0,
        "layer": "outer",
    }
    assert (second["time_to_closest_s"], second["layer"]) == (None, "inner")
