"""Each noticeable change of what is flown is announced once and at once; small drifts are not."""

import math
import random
from dataclasses import replace

import pytest

from companion.gcs.maneuvers import ManeuverNotices
from companion.gcs.phrases import TrafficSituation
from companion.geodesy import wrap_pi
from companion.model import Decision, Guidance, Layer, Ownship, TextUnits, Threat
from companion.output.notice import TEXT_BYTES, ConflictNotice

OWN = Ownship(0.0, (0.0, 0.0, -300.0), (22.0, 0.0, 0.0), 22.0, 0.0)
THREAT = Threat("A1", None, 1800.0, 0.0, 0.0, 80.0, 25.0, 0.0, 0.0, Layer.OUTER)


def flown(course_deg: float = 0.0, height_m: float = 300.0, airspeed_mps: float = 22.0) -> Guidance:
    return Guidance(math.radians(course_deg), airspeed_mps, height_m)


class Crew:
    """What the crew reads while guidance is commanded ten times a second."""

    def __init__(self, own: Ownship = OWN) -> None:
        self.notices, self.own, self.now_s = ManeuverNotices(), own, 0.0
        self.read: list[str] = []

    def situation(self, guidance: Guidance | None, *, threats: bool = True) -> TrafficSituation:
        threatened = (THREAT,) if threats else ()
        because = "" if threats else "clear of conflict, returning along the fence"
        layer = Layer.OUTER if guidance is not None else Layer.CLEAR
        return TrafficSituation(Decision(layer, guidance, threatened, because), self.own, 0.0)

    def conflict(self, guidance: Guidance, *, flying: bool = True) -> list[str]:
        around = self.situation(guidance)
        notice = self.notices.worded(ConflictNotice(flying), around, "metric", self.now_s)
        return [] if notice is None else [notice.text.partition(":")[0]]

    def tick(
        self,
        guidance: Guidance | None,
        *,
        threats: bool = True,
        returning: bool = False,
        seconds: float = 0.1,
    ) -> list[str]:
        texts = []
        for _ in range(round(seconds * 10)):
            self.now_s += 0.1
            around = self.situation(guidance, threats=threats)
            for notice in self.notices.changes(guidance, around, "metric", self.now_s, returning=returning):
                texts.append(notice.text if not threats else notice.text.partition(":")[0])
        return texts


CLIMB = flown(0.0, 397.0)


@pytest.mark.parametrize(
    ("then", "text"),
    [
        (flown(45.0, 397.0), "CLIMB to 397 m, RIGHT 045"),
        (flown(-25.0, 397.0), "CLIMB to 397 m, LEFT 335"),
        (flown(0.0, 374.0), "CLIMB to 374 m"),
        (flown(0.0, 300.0), "HOLD"),
        (flown(0.0, 203.0), "DESCEND to 203 m"),
        (flown(0.0, 397.0, 14.0), "CLIMB to 397 m, SLOWER 14 m/s"),
        (flown(0.0, 397.0, 28.0), "CLIMB to 397 m, FASTER 28 m/s"),
        (flown(19.0, 397.0), None),
        (flown(0.0, 410.0), None),
        (flown(0.0, 397.0, 23.5), None),
    ],
)
def test_a_change_is_announced_once_with_the_tick_that_flies_it(then: Guidance, text: str | None) -> None:
    crew = Crew()
    assert crew.conflict(CLIMB) == ["CLIMB to 397 m"]
    assert crew.tick(CLIMB, seconds=5.0) == []
    assert crew.tick(then) == ([] if text is None else [text])
    assert crew.tick(then, seconds=60.0) == []
    assert crew.notices.words == (text or "CLIMB to 397 m")


def test_a_small_turn_the_other_way_is_announced() -> None:
    crew = Crew()
    assert crew.conflict(flown(15.0)) == ["RIGHT 015"]
    assert crew.tick(flown(2.0)) == [], "it turns less"
    assert crew.tick(flown(-3.0)) == []
    assert crew.tick(flown(-9.0)) == ["LEFT 351"]


def test_a_slow_drift_is_announced_when_it_has_become_a_change() -> None:
    crew = Crew()
    assert crew.conflict(flown(0.0)) == ["HOLD"]
    texts = [text for degrees in range(70) for text in crew.tick(flown(degrees + 0.7))]
    assert texts == ["RIGHT 021", "RIGHT 041", "RIGHT 061"]


def test_the_way_back_is_announced_and_after_it_the_next_take_over() -> None:
    crew = Crew()
    assert crew.conflict(flown(45.0)) == ["RIGHT 045"]
    assert crew.tick(flown(45.0)) == []
    assert crew.tick(flown(270.0), threats=False) == ["LEFT 270: returning along the fence"]
    assert crew.tick(flown(300.0), threats=False, returning=True) == ["LEFT 300: returning"]
    assert crew.tick(None, threats=False) == []
    assert crew.notices.words == ""
    assert crew.conflict(flown(45.0)) == ["RIGHT 045"]


def test_an_attempt_that_fails_is_not_announced_again_at_each_retry() -> None:
    crew, texts = Crew(), []
    for _ in range(10):
        texts += crew.conflict(flown(45.0))
        crew.tick(None, seconds=2.0)
    assert texts == ["RIGHT 045"]


def test_attempts_and_advice_in_turn_are_each_announced_once() -> None:
    crew, texts = Crew(), []
    for attempt in range(14):
        texts += crew.conflict(flown(45.0), flying=attempt % 2 == 0)
        crew.tick(None, seconds=2.0)
    assert texts == ["RIGHT 045", "Advise RIGHT 045"]


def test_advice_follows_some_seconds_after_the_aircraft_was_let_go() -> None:
    crew, texts = Crew(), []
    assert crew.conflict(flown(45.0)) == ["RIGHT 045"]
    assert crew.tick(flown(45.0)) == []
    let_go_s = crew.now_s
    for _ in range(50):
        crew.tick(None)
        texts += [(round(crew.now_s - let_go_s, 1), t) for t in crew.conflict(flown(45.0), flying=False)]
    assert texts == [(3.0, "Advise RIGHT 045")]


def test_advice_is_announced_again_after_half_a_minute_and_when_it_changes() -> None:
    crew, texts = Crew(), []
    for tick in range(700):
        crew.now_s = tick / 10
        texts += [(tick, text) for text in crew.conflict(flown(45.0 if tick < 50 else -45.0), flying=False)]
    assert texts == [
        (0, "Advise RIGHT 045"), (50, "Advise LEFT 315"), (350, "Advise LEFT 315"), (650, "Advise LEFT 315"),
    ]  # fmt: skip


def test_a_storm_of_changes_does_not_flood() -> None:
    rng = random.Random(1)
    crew = Crew()
    texts = [
        text
        for _ in range(600)
        for text in crew.tick(flown(rng.uniform(-180.0, 180.0), rng.uniform(150.0, 450.0)))
    ]
    assert len(texts) <= 6 + 60.0 / 3.0 + 1


def test_the_crew_always_knows_what_is_flown() -> None:
    """A random flight: within some seconds, the last text describes what is commanded."""
    for seed in range(20):
        rng, crew = random.Random(seed), Crew()
        guidance, known = flown(), flown()
        for _ in range(100):
            guidance = flown(rng.uniform(-90.0, 90.0), rng.uniform(200.0, 400.0), rng.uniform(15.0, 29.0))
            if crew.tick(guidance, seconds=4.0):
                known = guidance
            assert abs(wrap_pi(guidance.course_rad - known.course_rad)) <= math.radians(20.1)
            assert abs(guidance.altitude_m - known.altitude_m) <= 15.1
            assert abs(guidance.airspeed_mps - known.airspeed_mps) <= 2.1


def test_the_crew_always_knows_what_is_advised() -> None:
    """Advice that is held back by many changes in a row follows when texts may be sent again."""
    for seed in range(20):
        rng, crew, known = random.Random(seed), Crew(), flown()
        for _ in range(60):
            guidance = flown(rng.uniform(-90.0, 90.0), rng.uniform(200.0, 400.0))
            for _ in range(rng.randint(1, 40)):  # some last for less than the interval of texts
                crew.now_s += 0.1
                known = guidance if crew.conflict(guidance, flying=False) else known
        for _ in range(130):  # the texts in reserve are used up, and then refilled
            crew.now_s += 0.1
            known = guidance if crew.conflict(guidance, flying=False) else known
        assert abs(wrap_pi(guidance.course_rad - known.course_rad)) <= math.radians(20.1)
        assert abs(guidance.altitude_m - known.altitude_m) <= 15.1


@pytest.mark.parametrize("units", ["metric", "aviation"])
def test_the_way_back_fits_one_statustext(units: TextUnits) -> None:
    notices, own = ManeuverNotices(), replace(OWN, position_m=(0.0, 0.0, -1300.0))
    around = TrafficSituation(Decision(Layer.CLEAR, None, (), "clear, returning along the fence"), own, 0.0)
    guidance = flown(200.0, 1130.0, 28.0)
    (notice,) = notices.changes(guidance, around, units, 0.0, returning=False)
    assert notice.text.startswith("DESCEND to ")
    assert notice.text.endswith(": returning along the fence")
    assert notice.brief is not None
    assert len(notice.brief) <= TEXT_BYTES
    assert notice.brief.startswith("DESCEND to ")
    assert "LEFT 200" in notice.brief
    (shorter,) = notices.changes(flown(90.0, 1130.0, 28.0), around, units, 1.0, returning=True)
    assert shorter.text.endswith(": returning")
    assert shorter.brief is not None
    assert len(shorter.brief) <= TEXT_BYTES
    assert shorter.brief.endswith(": returning")
