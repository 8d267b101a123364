"""Facts of receivers that do not speak MAVLink, in the engine."""

from dataclasses import replace

import pytest

from companion.engine import Engine, Stepper
from companion.engine.stepper import FACTS_AT_ONCE, MOST_FACTS_WAITING, SHORTEST_PROMPT_US
from companion.mavlink.facts import RECEIVER, Fact, Heartbeat, ReceiverOwnship, Sender, Traffic
from companion.model import TrafficReport, TrafficSource
from companion.traffic import Urgency

NOW_US = 1_750_000_000_000_000


def report(key: str = "A00001") -> TrafficReport:
    return TrafficReport(TrafficSource.ADSB, key, NOW_US / 1e6, 48.0, 11.0, 500.0, heard_by="gdl90:udpin:x:1")


def test_a_report_of_a_receiver_is_traffic() -> None:
    engine = Engine()
    assert engine.receive(Traffic(RECEIVER, report()), NOW_US / 1e6) is False
    assert not engine.tracker.dropped
    assert engine.foreign == 0


def test_where_a_receiver_is_goes_to_the_picture_and_is_no_autopilot(monkeypatch: pytest.MonkeyPatch) -> None:
    engine = Engine()
    seen: list[tuple[ReceiverOwnship, float]] = []
    monkeypatch.setattr(
        engine._picture, "observe_receiver", lambda *fact_and_time: seen.append(fact_and_time)
    )
    fact = ReceiverOwnship(RECEIVER, report())
    assert engine.receive(fact, NOW_US / 1e6) is False
    assert seen == [(fact, NOW_US / 1e6)]
    assert engine.aircraft.sender is None


class AlwaysUrgent(Engine):
    """Wants a tick after every fact."""

    def receive(self, fact: Fact, now_s: float, true_s: float | None = None) -> bool:
        super().receive(fact, now_s, true_s)
        return True


def test_facts_that_came_together_prompt_one_tick_and_a_flood_few() -> None:
    ticked: list[int] = []
    stepper = Stepper(AlwaysUrgent(), lambda time_us, _effects: ticked.append(time_us))
    stepper.advance(NOW_US)
    ticked.clear()
    facts = [Traffic(RECEIVER, report(f"A0000{number}")) for number in range(9)]
    stepper.receive_together(facts, NOW_US + 1)
    assert ticked == [NOW_US + 1]
    for after_us in range(2, SHORTEST_PROMPT_US, 2000):
        stepper.receive_together(facts, NOW_US + after_us)
    assert ticked == [NOW_US + 1]
    stepper.receive_together(facts, NOW_US + 1 + SHORTEST_PROMPT_US)
    assert len(ticked) == 2
    stepper.receive_together([], NOW_US + 90_000)
    assert len(ticked) == 2


class Counting(Engine):
    """Remembers the facts of each tick."""

    def __init__(self) -> None:
        super().__init__()
        self.facts: list[Fact] = []

    def receive(self, fact: Fact, now_s: float, true_s: float | None = None) -> bool:
        del now_s, true_s
        self.facts.append(fact)
        return False


def test_many_facts_at_once_are_taken_in_over_the_next_ticks() -> None:
    engine, taken = Counting(), []
    stepper = Stepper(engine, lambda _time_us, _effects: taken.append(len(engine.facts)))
    stepper.advance(NOW_US)
    facts = [Traffic(RECEIVER, report(f"{number:06X}")) for number in range(3 * FACTS_AT_ONCE - 100)]
    stepper.receive_together(facts, NOW_US + 1)
    assert len(engine.facts) == FACTS_AT_ONCE
    stepper.receive_together([Traffic(RECEIVER, report("FFFFFF"))], NOW_US + 2)
    assert len(engine.facts) == FACTS_AT_ONCE, "another receiver waits, too"
    stepper.advance(NOW_US + 400_000)
    assert taken == [0, 2 * FACTS_AT_ONCE, len(facts) + 1, len(facts) + 1, len(facts) + 1]
    assert engine.facts[:-1] == facts
    assert stepper.dropped_facts == 0


def test_of_too_many_facts_the_oldest_are_dropped_and_counted() -> None:
    stepper = Stepper(Counting(), lambda _time_us, _effects: None)
    for batch in range(2):
        keys = [f"{batch * MOST_FACTS_WAITING + number:06X}" for number in range(MOST_FACTS_WAITING)]
        stepper.receive_together([Traffic(RECEIVER, report(key)) for key in keys], NOW_US + 1)
    assert stepper.dropped_facts == MOST_FACTS_WAITING - FACTS_AT_ONCE


def test_a_newer_report_replaces_one_of_the_same_aircraft_that_waits() -> None:
    engine = Counting()
    stepper = Stepper(engine, lambda _time_us, _effects: None)
    stepper.advance(NOW_US)
    keys = [f"{number:06X}" for number in range(FACTS_AT_ONCE + 2)]
    stepper.receive_together([Traffic(RECEIVER, report(key)) for key in keys], NOW_US + 1)
    newer = [Traffic(RECEIVER, replace(report(key), altitude_m=600.0)) for key in keys[-2:]]
    stepper.receive_together(newer, NOW_US + 2)
    stepper.advance(NOW_US + 200_000)
    assert engine.facts[FACTS_AT_ONCE:] == newer
    assert stepper.dropped_facts == 2


def test_of_many_facts_at_once_the_most_urgent_come_first(monkeypatch: pytest.MonkeyPatch) -> None:
    engine = Counting()
    near = Traffic(RECEIVER, report("FFFFFF"))
    monkeypatch.setattr(
        engine, "urgency", lambda fact, _now_s: Urgency.NEAR_AGAIN if fact is near else Urgency.NEW
    )
    facts = [Traffic(RECEIVER, report(f"{number:06X}")) for number in range(FACTS_AT_ONCE)]
    stepper = Stepper(engine, lambda _time_us, _effects: None)
    stepper.receive_together([*facts, near], NOW_US)
    assert engine.facts == [near, *facts[:-1]]
    stepper.receive_together([facts[0], near], NOW_US + 1)
    assert engine.facts[FACTS_AT_ONCE:] == [near], "it does not wait for the next tick"


def test_a_flood_of_reports_of_a_threat_prompts_few_ticks() -> None:
    ticked: list[int] = []
    stepper = Stepper(AlwaysUrgent(), lambda time_us, _effects: ticked.append(time_us))
    stepper.advance(NOW_US)
    ticked.clear()
    for after_us in range(1, SHORTEST_PROMPT_US, 100):
        stepper.receive(Traffic(RECEIVER, report()), NOW_US + after_us)
    assert ticked == [NOW_US + 1]
    heartbeat = Heartbeat(Sender(1, 1), 1, 3, armed=True, custom_mode=10, system_status=4)
    stepper.receive(heartbeat, NOW_US + SHORTEST_PROMPT_US - 1)
    assert len(ticked) == 2, "the pilot does not wait"
