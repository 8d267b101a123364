"""Texts about traffic and guidance: metric and aviation, as a fact and as advice, in full and brief."""

import itertools
import math
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.gcs.maneuvers import ManeuverNotices
from companion.gcs.phrases import Maneuver, TrafficSituation, resume_notice
from companion.gcs.statustext import StatusText
from companion.mavlink.dialect import mavlink
from companion.model import Decision, Guidance, Layer, Ownship, TextUnits, Threat
from companion.output.effects import Say
from companion.output.notice import TEXT_BYTES, AnyNotice, ConflictNotice, Notice

HOME_M = 584.0
OWN = Ownship(0.0, (0.0, 0.0, -884.0), (22.0, 0.0, 0.0), 22.0, 0.0)


def threat(
    track_id: str = "ABC123", above_m: float = -61.0, layer: Layer = Layer.OUTER, name: str = ""
) -> Threat:
    return Threat(
        track_id=track_id, icao=0xABC123, distance_m=1800.0, bearing_rad=math.radians(60.0),
        relative_altitude_m=above_m, closing_mps=70.0, time_to_closest_s=25.0, miss_horizontal_m=0.0,
        miss_vertical_m=0.0, layer=layer, name=name,
    )  # fmt: skip


def guidance(course_deg: float = 0.0, airspeed_mps: float = 22.0, height_m: float = 300.0) -> Guidance:
    return Guidance(math.radians(course_deg), airspeed_mps, HOME_M + height_m)


def situation(
    flown: Guidance, callsign: str = "", layer: Layer = Layer.OUTER, *, home_m: float | None = HOME_M
) -> TrafficSituation:
    decision = Decision(layer, flown, (threat(layer=layer, name=callsign),))
    return TrafficSituation(decision, OWN, home_m)


def texts(notice: AnyNotice, around: TrafficSituation, units: TextUnits = "metric") -> tuple[str, list[str]]:
    """The text for the log, and the STATUSTEXT messages of a notice."""
    text = ManeuverNotices().worded(notice, around, units, 0.0)
    said = [] if text is None else StatusText().say(text, 0.0)
    (logged,) = [one.text for one in said if isinstance(one, Say)]
    return logged, [str(message.text) for message in said if not isinstance(message, Say)]


TURN, BOTH = guidance(40.0), guidance(45.0, height_m=397.0)
ALL = guidance(45.0, 28.0, 397.0)


@pytest.mark.parametrize(
    ("flown", "units", "flying", "full", "brief"),
    [
        (TURN, "aviation", True, "RIGHT 040: N123 2 o'clock 1.8 km 200 ft below", None),
        (TURN, "metric", True, "RIGHT 040: N123 2 o'clock 1.8 km 61 m below", None),
        (TURN, "metric", False, "Advise RIGHT 040: N123 2 o'clock 1.8 km 61 m below",
         "Advise RIGHT 040: N123 2 o'clock 1.8 km 61 m below"),
        (BOTH, "metric", True, "CLIMB to 397 m, RIGHT 045: N123 2 o'clock 1.8 km 61 m below",
         "CLIMB to 397 m, RIGHT 045: N123 2 o'clock 1.8 km"),
        (BOTH, "aviation", True, "CLIMB to 1300 ft, RIGHT 045: N123 2 o'clock 1.8 km 200 ft below",
         "CLIMB to 1300 ft, RIGHT 045: N123 2 o'clock 1.8 km"),
        (BOTH, "metric", False, "Advise CLIMB to 397 m, RIGHT 045: N123 2 o'clock 1.8 km 61 m below",
         "Advise CLIMB to 397 m, RIGHT 045: N123 1.8 km"),
        (ALL, "metric", True, "CLIMB to 397 m, RIGHT 045, FASTER 28 m/s: N123 2 o'clock 1.8 km 61 m below",
         "CLIMB to 397 m, RIGHT 045, FASTER 28 m/s: N123"),
    ],
)  # fmt: skip
def test_the_manoeuvre_comes_first_and_the_traffic_is_shortened(
    flown: Guidance, units: TextUnits, flying: bool, full: str, brief: str | None
) -> None:
    logged, sent = texts(ConflictNotice(flying), situation(flown, "N123"), units)
    assert logged == full
    assert sent == [brief or full]


def test_a_near_threat_is_marked() -> None:
    logged, _ = texts(ConflictNotice(flying=True), situation(BOTH, "N123", Layer.INNER))
    assert logged.startswith("CLIMB to 397 m, RIGHT 045! N123")


def test_the_callsign_is_used_if_it_is_known() -> None:
    held = ConflictNotice(flying=True)
    assert texts(held, situation(guidance(), "SWR1"))[1] == ["HOLD: SWR1 2 o'clock 1.8 km 61 m below"]
    assert texts(held, situation(guidance()))[1] == ["HOLD: ABC123 2 o'clock 1.8 km 61 m below"]


@given(
    course_deg=st.floats(0.0, 359.0),
    airspeed_mps=st.floats(10.0, 60.0),
    height_m=st.floats(-50.0, 5000.0),
    home_m=st.one_of(st.none(), st.floats(-100.0, 4000.0)),
    distance_m=st.floats(0.0, 99_000.0),
    above_m=st.floats(-3000.0, 3000.0),
    name=st.from_regex(r"[A-Z0-9-]{1,9}", fullmatch=True) | st.just("UTM-" + 18 * "A1"),
    layer=st.sampled_from([Layer.OUTER, Layer.INNER]),
    units=st.sampled_from(["metric", "aviation"]),
    flying=st.booleans(),
)
def test_a_conflict_fits_one_message_with_its_numbers_whole(
    course_deg: float, airspeed_mps: float, height_m: float, home_m: float | None, distance_m: float,
    above_m: float, name: str, layer: Layer, units: TextUnits, flying: bool,
) -> None:  # fmt: skip
    flown = guidance(course_deg, airspeed_mps, height_m)
    near = Threat(name, None, distance_m, above_m, 1.0, 70.0, 25.0, 0.0, 0.0, layer)
    around = TrafficSituation(Decision(layer, flown, (near,)), OWN, home_m)
    full, sent = texts(ConflictNotice(flying), around, units)
    assert len(sent) == 1
    assert len(sent[0]) <= TEXT_BYTES
    words = Maneuver.of(flown, OWN, home_m, units)
    assert all(part[1] in sent[0] for part in (words.height, words.speed))
    assert words.turn in sent[0]
    numbers = re.findall(r"[0-9.]+", full)
    assert all(number in numbers for number in re.findall(r"[0-9.]+", sent[0]))


@given(st.text(alphabet="ab 019.", max_size=160))
def test_chunks_join_to_the_text_and_cut_no_number(text: str) -> None:
    said = StatusText().say(Notice(4, text, topic="x"), 0.0)
    chunks = [str(one.text) for one in said if not isinstance(one, Say)]
    assert all(len(chunk) == TEXT_BYTES for chunk in chunks[:-1])
    assert "".join(chunks).replace(" ", "") == text.replace(" ", "")
    for chunk, after in itertools.pairwise(chunks):
        whole = " " not in chunk.strip() or not (chunk[-1].isdigit() and after[:1].isdigit())
        assert whole


def test_the_prefix_is_left_out_if_the_text_fits_then() -> None:
    notice = Notice(4, "Avoidance: several autopilots, set autopilot_system_id")
    said, message = StatusText().say(notice, 0.0)
    assert isinstance(said, Say)
    assert said.text == notice.text
    assert message.text == "several autopilots, set autopilot_system_id"


def test_a_topic_is_repeated_only_after_half_a_minute() -> None:
    statustext = StatusText()
    first, later = Notice(4, "1.8 km", topic="A"), Notice(4, "1.7 km", topic="A")
    assert len(statustext.say(first, 0.0)) == 2
    assert statustext.last_text == "1.8 km"
    assert statustext.say(later, 1.0) == []
    assert statustext.say(later, 29.9) == []
    assert len(statustext.say(Notice(4, "other"), 29.9)) == 2
    assert len(statustext.say(later, 30.0)) == 2


def test_a_notice_for_the_log_is_not_sent() -> None:
    assert StatusText().say(Notice(6, "Mission: 4 items", log_only=True), 0.0) == [Say(6, "Mission: 4 items")]


@pytest.mark.parametrize(
    ("flown", "metric", "aviation"),
    [
        (guidance(40.0), "RIGHT 040", "RIGHT 040"),
        (guidance(-90.0), "LEFT 270", "LEFT 270"),
        (guidance(height_m=380.0), "CLIMB to 380 m", "CLIMB to 1250 ft"),
        (guidance(height_m=200.0), "DESCEND to 200 m", "DESCEND to 660 ft"),
        (guidance(airspeed_mps=28.0), "FASTER 28 m/s", "FASTER 54 kt"),
        (guidance(airspeed_mps=18.0), "SLOWER 18 m/s", "SLOWER 35 kt"),
        (guidance(30.0, 22.0, 380.0), "CLIMB to 380 m, RIGHT 030", "CLIMB to 1250 ft, RIGHT 030"),
        (guidance(2.0, 23.0, 303.0), "HOLD", "HOLD"),
    ],
)
def test_a_manoeuvre_is_described_with_heights_above_home(
    flown: Guidance, metric: str, aviation: str
) -> None:
    assert Maneuver.of(flown, OWN, HOME_M).text == metric
    assert Maneuver.of(flown, OWN, HOME_M, "aviation").text == aviation


def test_without_home_a_height_is_a_difference() -> None:
    assert Maneuver.of(guidance(height_m=380.0), OWN, None).text == "CLIMB 80 m"


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
    notice = resume_notice(TrafficSituation(Decision(layer, None, tuple(threats)), OWN), "MISSION")
    assert notice.text == words
    assert (notice.severity == mavlink.MAV_SEVERITY_CRITICAL) == (layer is Layer.INNER)
