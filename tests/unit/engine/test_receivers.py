"""Facts of receivers that do not speak MAVLink, in the engine."""

import pytest

from companion.engine import Engine, Stepper
from companion.engine.stepper import SHORTEST_PROMPT_US
from companion.mavlink.facts import RECEIVER, Fact, ReceiverOwnship, Traffic
from companion.model import TrafficReport, TrafficSource

NOW_US = 1_750_000_000_000_000


def report(key: str = "A00001") -> TrafficReport:
    return TrafficReport(TrafficSource.ADSB, key, NOW_US / 1e6, 48.0, 11.0, 500.0, heard_by="gdl90:udpin:x:1")


def test_a_report_of_a_receiver_is_traffic() -> None:
    engine = Engine()
    assert engine.receive(Traffic(RECEIVER, report()), NOW_US / 1e6) is False
    assert engine.tracker.without_position(NOW_US / 1e6) == 0
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
    for after_us in range(2, SHORTEST_PROMPT_US, 100):
        stepper.receive_together(facts, NOW_US + after_us)
    assert ticked == [NOW_US + 1]
    stepper.receive_together(facts, NOW_US + 1 + SHORTEST_PROMPT_US)
    assert len(ticked) == 2
    stepper.receive_together([], NOW_US + 90_000)
    assert len(ticked) == 2
