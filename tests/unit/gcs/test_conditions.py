"""Conditions: announced when they begin, again every half minute while they matter, and when they end."""

import itertools

import pytest

from companion.gcs.conditions import Conditions
from companion.output.notice import Condition

LOW = Condition("low", 4, "too low", "high enough")


def spoken(
    keeper: Conditions, present: list[Condition], from_s: float, to_s: float
) -> list[tuple[float, str]]:
    """The texts of ten ticks a second, with their times."""
    texts = []
    for tick in range(round(from_s * 10), round(to_s * 10)):
        texts += [(tick / 10, notice.text) for notice in keeper.tick(present, tick / 10)]
    return texts


def test_a_condition_is_announced_repeated_and_its_end_announced() -> None:
    keeper = Conditions()
    assert spoken(keeper, [LOW], 0.0, 65.0) == [(0.0, "too low"), (30.0, "too low"), (60.0, "too low")]
    assert keeper.holding == (LOW,)
    assert spoken(keeper, [], 65.0, 200.0) == [(67.9, "high enough")]
    assert keeper.holding == ()


def test_a_condition_that_does_not_matter_is_announced_once() -> None:
    keeper = Conditions()
    assert spoken(keeper, [LOW._replace(matters=False)], 0.0, 100.0) == [(0.0, "too low")]
    assert [text for _, text in spoken(keeper, [LOW], 100.0, 101.0)] == ["too low"], "now it matters"


def test_a_changing_number_is_no_news_and_the_next_text_has_the_newest() -> None:
    keeper, texts = Conditions(), []
    for tick in range(310):
        present = Condition("low", 4, f"{tick} m")
        texts += [notice.text for notice in keeper.tick([present], tick / 10)]
    assert texts == ["0 m", "300 m"]


@pytest.mark.parametrize("period_s", [0.2, 1.0, 4.0, 7.0, 13.0])
def test_a_flickering_condition_is_announced_at_most_every_half_minute(period_s: float) -> None:
    keeper, begun, ended = Conditions(), [], []
    for tick in range(1200):
        now_s = tick / 10
        present = [LOW] if now_s % period_s < period_s / 2 else []
        for notice in keeper.tick(present, now_s):
            (begun if notice.text == "too low" else ended).append(now_s)
    assert begun[0] == 0.0
    assert all(later - earlier >= 30.0 for earlier, later in itertools.pairwise(begun))
    assert len(ended) <= len(begun)


def test_a_condition_counts_after_it_has_lasted() -> None:
    keeper, short = Conditions(), LOW._replace(after_s=5.0)
    assert spoken(keeper, [short], 0.0, 4.9) == []
    assert keeper.holding == ()
    assert spoken(keeper, [], 4.9, 20.0) == [], "nor is its end announced"
    assert spoken(keeper, [short], 20.0, 26.0) == [(25.0, "too low")]


def test_many_conditions_do_not_flood_and_the_most_severe_come_first() -> None:
    keeper = Conditions()
    present = [Condition(str(number), number % 8, f"text {number}") for number in range(24)]
    texts = spoken(keeper, present, 0.0, 60.0)
    assert [text for now_s, text in texts if now_s == 0.0] == [
        "text 0", "text 8", "text 16", "text 1", "text 9",
    ]  # fmt: skip
    assert {text for _, text in texts} == {condition.text for condition in present}, "each at last"
    assert len(texts) <= 5 + 60.0 / 2.0
    assert len(keeper.holding) == 24


def test_an_end_is_announced_once_when_all_that_share_it_have_ended() -> None:
    keeper = Conditions()
    low, blind = LOW._replace(ended="on again"), Condition("blind", 4, "no position", "on again")
    assert len(spoken(keeper, [low, blind], 0.0, 1.0)) == 2
    assert spoken(keeper, [blind], 1.0, 10.0) == []
    assert [text for _, text in spoken(keeper, [], 10.0, 20.0)] == ["on again"]
    assert len(spoken(keeper, [low, blind], 100.0, 101.0)) == 2
    assert [text for _, text in spoken(keeper, [], 101.0, 110.0)] == ["on again"]


def test_an_end_waits_for_another_condition_that_shares_it() -> None:
    """The other one may begin meanwhile, and may end before it was announced."""
    keeper = Conditions()
    low = LOW._replace(ended="on again")
    blind = Condition("blind", 4, "no position", "on again", after_s=20.0)
    assert len(spoken(keeper, [low], 0.0, 1.0)) == 1
    assert spoken(keeper, [blind], 1.0, 15.0) == []
    assert [text for _, text in spoken(keeper, [], 15.0, 25.0)] == ["on again"]


def test_a_condition_that_returns_before_its_end_was_announced_ends_later() -> None:
    keeper = Conditions()
    low = LOW._replace(ended="on again")
    blind = Condition("blind", 4, "no position", "on again")
    assert len(spoken(keeper, [low, blind], 0.0, 1.0)) == 2
    assert spoken(keeper, [blind], 1.0, 6.0) == [], "the first one has ended, the text waits"
    assert spoken(keeper, [low, blind], 6.0, 8.0) == [], "told half a minute ago at most"
    assert [text for _, text in spoken(keeper, [], 8.0, 20.0)] == ["on again"], "of both"
