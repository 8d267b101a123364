"""Lines with faults: loss, delay, order and duplication of a thousand items."""

import pytest

from sim.faults import MAX_IN_FLIGHT, Faults, FaultyLine


def through(faults: Faults, count: int = 1000, seed: int = 3) -> tuple[list[int], FaultyLine[int]]:
    """The output of a line that gets a number every 10 ms."""
    line: FaultyLine[int] = FaultyLine(faults, seed)
    out = []
    for number in range(count):
        now_s = number / 100.0
        out += line.take(now_s)
        line.put(number, now_s)
    return out + line.take(1e6), line


def test_a_line_without_faults_delivers_everything_at_once() -> None:
    line: FaultyLine[str] = FaultyLine(Faults(), 0)
    line.put("a", 5.0)
    assert line.next_due_s == 5.0
    assert line.take(5.0) == ["a"]
    assert line.next_due_s is None
    assert through(Faults())[0] == list(range(1000))


def test_loss() -> None:
    out, line = through(Faults(loss=0.3))
    assert 650 < len(out) < 750
    assert out == sorted(out)
    assert line.counters.lost == 1000 - len(out)
    assert (line.counters.sent, line.counters.delivered) == (1000, len(out))
    assert through(Faults(loss=1.0))[0] == []


def test_the_same_seed_loses_the_same() -> None:
    assert through(Faults(loss=0.3), seed=1)[0] == through(Faults(loss=0.3), seed=1)[0]
    assert through(Faults(loss=0.3), seed=1)[0] != through(Faults(loss=0.3), seed=2)[0]


def test_delay_keeps_the_order() -> None:
    line: FaultyLine[int] = FaultyLine(Faults(delay_s=0.5), 0)
    line.put(1, 10.0)
    line.put(2, 10.2)
    assert line.take(10.49) == []
    assert line.take(10.5) == [1]
    assert line.next_due_s == pytest.approx(10.7)
    assert through(Faults(delay_s=0.5))[0] == list(range(1000))


def test_jitter_reorders_and_loses_nothing() -> None:
    out, line = through(Faults(delay_s=0.1, jitter_s=0.05))
    assert out != sorted(out)
    assert sorted(out) == list(range(1000))
    assert line.counters.overtaken > 100
    assert all(abs(place - number) < 10 for place, number in enumerate(out)), "by no more than the jitter"


def test_duplication() -> None:
    out, line = through(Faults(duplication=0.25))
    assert 200 < line.counters.duplicated < 300
    assert len(out) == 1000 + line.counters.duplicated
    assert sorted(set(out)) == list(range(1000))
    assert line.counters.overtaken == 0


def test_a_cut_line_loses_items_in_flight_too() -> None:
    line: FaultyLine[int] = FaultyLine(Faults(delay_s=1.0), 0)
    line.put(1, 0.0)
    line.cut()
    line.put(2, 0.5)
    line.mend()
    line.put(3, 0.6)
    assert line.take(10.0) == [3]
    assert line.counters.cut == 2


def test_items_in_flight_are_bounded() -> None:
    line: FaultyLine[int] = FaultyLine(Faults(delay_s=60.0), 0)
    for number in range(MAX_IN_FLIGHT + 5):
        line.put(number, 0.0)
    assert line.counters.flooded == 5
    assert len(line.take(60.0)) == MAX_IN_FLIGHT


@pytest.mark.parametrize(
    "wrong",
    [{"loss": 1.1}, {"loss": -0.1}, {"duplication": float("nan")}, {"delay_s": -1.0}, {"jitter_s": 1e9}],
)
def test_impossible_faults_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=next(iter(wrong))):
        Faults(**wrong)
