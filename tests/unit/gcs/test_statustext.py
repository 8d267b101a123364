"""Texts about traffic and guidance, in metric and aviation units, as a fact and as advice."""

import math

import pytest

from companion.gcs.phrases import TrafficSituation, describe_guidance, worded
from companion.gcs.statustext import StatusText
from companion.mavlink.dialect import mavlink
from companion.model import Decision, Guidance, Layer, Ownship, TextUnits, Threat, Track
from companion.output.effects import Say
from companion.output.notice import AnyNotice, ConflictNotice, Notice, ResumeNotice

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


def texts(notice: AnyNotice, situation: TrafficSituation, units: TextUnits = "metric") -> list[str]:
    """The STATUSTEXT messages of a notice."""
    text = worded(notice, situation, units)
    said = [] if text is None else StatusText().say(text, 0.0)
    return [str(message.text) for message in said if not isinstance(message, Say)]


@pytest.mark.parametrize(
    ("units", "flying", "words"),
    [
        ("aviation", True, "Traffic ABC123 2 o'clock 1.8 km 200 ft below: turning right 040"),
        ("metric", True, "Traffic ABC123 2 o'clock 1.8 km 61 m below: turning right 040"),
        ("metric", False, "Traffic ABC123 2 o'clock 1.8 km 61 m below: turn right 040"),
    ],
)
def test_a_conflict_is_described_as_pilots_do(units: TextUnits, flying: bool, words: str) -> None:
    situation = TrafficSituation(flown(40.0), OWN, [track(None)])
    chunks = texts(ConflictNotice(flying), situation, units)
    assert "".join(chunks) == words
    assert all(len(chunk) <= 50 for chunk in chunks)


def test_the_callsign_is_used_if_it_is_known() -> None:
    said = texts(ConflictNotice(flying=True), TrafficSituation(flown(), OWN, [track("SWR1")]))
    assert said == ["Traffic SWR1 2 o'clock 1.8 km 61 m below: holding"]


def test_a_topic_is_repeated_only_after_half_a_minute() -> None:
    statustext = StatusText()
    first, later = Notice(4, "1.8 km", topic="A"), Notice(4, "1.7 km", topic="A")
    assert len(statustext.say(first, 0.0)) == 2
    assert statustext.last_text == "1.8 km"
    assert statustext.say(later, 1.0) == []
    assert statustext.say(later, 29.9) == []
    assert len(statustext.say(Notice(4, "other"), 29.9)) == 2
    assert len(statustext.say(later, 30.0)) == 2


def test_a_notice_marked_once_is_never_repeated() -> None:
    statustext = StatusText()
    assert statustext.say(Notice(4, "no receiver", once=True), 0.0)
    assert not statustext.say(Notice(4, "no receiver", once=True), 3600.0)


def test_a_notice_for_the_log_is_not_sent() -> None:
    assert StatusText().say(Notice(6, "Mission: 4 items", log_only=True), 0.0) == [Say(6, "Mission: 4 items")]


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
def test_guidance_is_described_as_a_fact_and_as_advice(
    decision: Decision, doing: str, advice: str, aviation: str
) -> None:
    assert describe_guidance(decision, OWN, "metric", doing=True) == doing
    assert describe_guidance(decision, OWN, "metric", doing=False) == advice
    assert describe_guidance(decision, OWN, "aviation", doing=True) == aviation


@pytest.mark.parametrize(
    ("threats", "layer", "words"),
    [
        ([threat()], Layer.OUTER, "Resuming MISSION: ABC123 not avoided"),
        ([threat(), threat("B"), threat("C")], Layer.OUTER, "Resuming MISSION: ABC123 + 2 not avoided"),
        ([threat()], Layer.INNER, "Resuming MISSION: ABC123 near, not avoided"),
        ([], Layer.OUTER, "Resuming MISSION"),
    ],
)
def test_a_resumed_mission_names_the_threats_that_are_not_avoided(
    threats: list[Threat], layer: Layer, words: str
) -> None:
    situation = TrafficSituation(Decision(layer, None, tuple(threats)), OWN, [track(None)])
    notice = worded(ResumeNotice("MISSION"), situation, "metric")
    assert notice is not None
    assert notice.text == words
    assert (notice.severity == mavlink.MAV_SEVERITY_CRITICAL) == (layer is Layer.INNER)
