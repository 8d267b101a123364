"""The words: where somebody is and what is done, in metres or in feet, as a fact or as advice."""

import math

import pytest

from companion.gcs.statustext import StatusText, TrafficSituation, describe_guidance
from companion.mavlink.dialect import mavlink
from companion.mavlink.facts import Sender
from companion.model import Decision, Guidance, Layer, Ownship, TextUnits, Threat, Track
from companion.output.effects import Transmit

OWN = Ownship(0.0, (0.0, 0.0, -300.0), (22.0, 0.0, 0.0), 22.0, 0.0)


def threat(track_id: str = "ABC123", above_m: float = -61.0, layer: Layer = Layer.OUTER) -> Threat:
    return Threat(
        track_id=track_id, icao=0xABC123, distance_m=1800.0, bearing_rad=math.radians(60.0),
        relative_altitude_m=above_m, closing_mps=70.0, time_to_closest_s=25.0, miss_horizontal_m=0.0,
        miss_vertical_m=0.0, layer=layer,
    )  # fmt: skip


def track(callsign: str | None) -> Track:
    return Track("ABC123", 0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), callsign=callsign)


def flown(course_deg: float = 0.0, airspeed_mps: float = 22.0, altitude_m: float = 300.0) -> Decision:
    return Decision(Layer.OUTER, Guidance(math.radians(course_deg), airspeed_mps, altitude_m), (threat(),))


def texts(
    announcer: StatusText, outlook: TrafficSituation, *, flying: bool = True, now_s: float = 0.0
) -> list[str]:
    return [
        effect.message.text if isinstance(effect.message.text, str) else effect.message.text.decode()
        for effect in announcer.conflict(outlook, now_s, flying=flying)
        if isinstance(effect, Transmit)
    ]


@pytest.mark.parametrize(
    ("units", "flying", "words"),
    [
        ("aviation", True, "Traffic ABC123 2 o'clock 1.8 km 200 ft below: turning right 040"),
        ("metric", True, "Traffic ABC123 2 o'clock 1.8 km 61 m below: turning right 040"),
        ("metric", False, "Traffic ABC123 2 o'clock 1.8 km 61 m below: turn right 040"),
    ],
)
def test_a_conflict_is_told_once_in_the_words_of_pilots(units: TextUnits, flying: bool, words: str) -> None:
    announcer = StatusText(lambda: Sender(1, 196), lambda: units)
    outlook = TrafficSituation(flown(40.0), OWN, [track(None)])
    chunks = texts(announcer, outlook, flying=flying)
    assert "".join(chunks) == words
    assert all(len(chunk) <= 50 for chunk in chunks)
    assert announcer.last_text == words
    assert texts(announcer, outlook, flying=flying, now_s=1.0) == []


def test_whoever_has_a_callsign_is_called_by_it() -> None:
    said = texts(StatusText(lambda: Sender(1, 196)), TrafficSituation(flown(), OWN, [track("SWR1")]))
    assert said == ["Traffic SWR1 2 o'clock 1.8 km 61 m below: holding"]


@pytest.mark.parametrize(
    ("decision", "doing", "advice", "aviation"),
    [
        (flown(40.0), "turning right 040", "turn right 040", "turning right 040"),
        (flown(-90.0), "turning left 270", "turn left 270", "turning left 270"),
        (flown(altitude_m=380.0), "climbing 80 m", "climb 80 m", "climbing 260 ft"),
        (flown(altitude_m=200.0), "descending 100 m", "descend 100 m", "descending 330 ft"),
        (flown(airspeed_mps=28.0), "speeding up to 28 m/s", "speed up to 28 m/s", "speeding up to 54 kt"),
        (flown(airspeed_mps=18.0), "slowing to 18 m/s", "slow to 18 m/s", "slowing to 35 kt"),
        (flown(30.0, 22.0, 380.0), "turning right 030, climbing 80 m", "turn right 030, climb 80 m",
         "turning right 030, climbing 260 ft"),
        (flown(2.0, 23.0, 303.0), "holding", "hold", "holding"),
        (Decision(Layer.CLEAR), "mission", "mission", "mission"),
    ],
)  # fmt: skip
def test_what_is_done(decision: Decision, doing: str, advice: str, aviation: str) -> None:
    assert describe_guidance(decision, OWN, "metric", doing=True) == doing
    assert describe_guidance(decision, OWN, "metric", doing=False) == advice
    assert describe_guidance(decision, OWN, "aviation", doing=True) == aviation


@pytest.mark.parametrize(
    ("threats", "layer", "words"),
    [
        ([threat()], Layer.OUTER, "Told to resume MISSION: ABC123 not avoided"),
        ([threat(), threat("B"), threat("C")], Layer.OUTER, "Told to resume MISSION: ABC123 + 2 not avoided"),
        ([threat()], Layer.INNER, "Told to resume MISSION: ABC123 near, not avoided"),
        ([], Layer.OUTER, "Told to resume MISSION"),
    ],
)
def test_whoever_sends_it_on_its_mission_is_told_who_is_not_avoided(
    threats: list[Threat], layer: Layer, words: str
) -> None:
    announcer = StatusText(lambda: Sender(1, 196))
    outlook = TrafficSituation(Decision(layer, None, tuple(threats)), OWN, [track(None)])
    effects = announcer.resuming(outlook, "MISSION", 0.0)
    (sent,) = [effect.message for effect in effects if isinstance(effect, Transmit)]
    assert sent.text in (words, words.encode())
    critical = sent.severity == mavlink.MAV_SEVERITY_CRITICAL
    assert critical == (layer is Layer.INNER)
