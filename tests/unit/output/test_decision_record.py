"""The recorded line of a decision: its fields, and the same JSON as the standard library writes."""

import json
import math
from collections.abc import Sequence
from typing import Any

import pytest

from companion.gcs.concern_values import concern_values
from companion.geodesy import GeoPoint, LocalFrame
from companion.model import Decision, Layer, Ownship, Threat, Track, TrackState, TrafficKind
from companion.output.decision_record import Circumstances, decision_line
from companion.traffic import Concern, ConcernKind

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
        "state": "confirmed",
        "sources": [],
        "alarm": 0,
        "position_sigma_m": None,
        "velocity_sigma_mps": None,
        "vertical_uncertainty_m": 0.0,
        "reports": 0,
    }
    assert (second["icao"], second["callsign"], second["kind"]) == (None, None, "obstacle")


def test_every_track_has_its_evidence() -> None:
    heard = track(
        state=TrackState.COASTED,
        sources=("sbs:tcp:a:1", 'un"usual'),
        alarm=2,
        position_sigma_m=30.04,
        velocity_sigma_mps=math.inf,
        vertical_uncertainty_m=60.0,
    )
    around = Circumstances("monitor", False, "AUTO", FRAME, reports={"A00001": 812})
    (one,) = json.loads(decision_line(5.0, Decision(Layer.CLEAR), OWN, [heard], around))["traffic"]
    assert (one["state"], one["sources"], one["alarm"]) == ("coasted", ["sbs:tcp:a:1", 'un"usual'], 2)
    assert (one["position_sigma_m"], one["velocity_sigma_mps"]) == (30.0, None)
    assert (one["vertical_uncertainty_m"], one["reports"]) == (60.0, 812)


def test_what_is_not_avoided_is_in_the_line() -> None:
    concern = Concern(ConcernKind.HEIGHT_UNKNOWN, 'N"2', 1840.4, math.radians(-10.0), 0.44)
    shadow = Concern(ConcernKind.TWO_PLACES, "A1")
    values = [concern_values(one) for one in (concern, shadow)]
    around = Circumstances("monitor", False, "AUTO", FRAME, concerns=values)
    assert json.loads(decision_line(5.0, Decision(Layer.CLEAR), OWN, [], around))["concerns"] == [
        {
            "kind": "height unknown", "name": 'N"2', "avoided": False, "distance_m": 1840,
            "bearing_deg": 350.0, "seconds": 0.4,
        },
        {
            "kind": "reported in two places", "name": "A1", "avoided": True, "distance_m": None,
            "bearing_deg": None, "seconds": 0.0,
        },
    ]  # fmt: skip
    assert line()["concerns"] == []


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


def test_of_thousands_of_tracks_the_nearest_are_listed() -> None:
    norths_m = [7_919 * number % 20_011 for number in range(1000)]
    crowd = [
        track(track_id=f"T{number}", position_m=(NORTH_M + north_m, EAST_M, DOWN_M))
        for number, north_m in enumerate(norths_m)
    ]
    record = line(*crowd)
    assert record["tracks"] == 1000
    listed = [one["north_m"] for one in record["traffic"]]
    assert len(listed) == 200
    assert max(listed) == sorted(norths_m)[199]
    assert [one["track"] for one in record["traffic"]] == sorted(
        (one["track"] for one in record["traffic"]), key=lambda name: int(name[1:])
    )
