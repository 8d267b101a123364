"""Whether the service keeps up, and what the operator is told."""

from companion.load import Load


def text(load: Load, now_s: float, ticks: int, skipped: int = 0, dropped: int = 0) -> str | None:
    held = load.condition(now_s, ticks=ticks, skipped=skipped, dropped=dropped)
    return None if held is None else held.text


def test_a_service_that_keeps_up_says_nothing() -> None:
    load = Load()
    for tick in range(100):
        load.note_tick(20_000)
        assert text(load, tick * 0.1, tick) is None
    assert load.late_ticks == 0


def test_late_and_skipped_ticks_are_told_while_there_are_many() -> None:
    load = Load()
    for tick in range(41):
        said = text(load, tick * 0.1, tick)
        load.note_tick(0 if tick % 2 else 80_000)
    assert said == "Overloaded: 50 % of ticks late"
    assert load.late_ticks == 21
    assert text(load, 5.0, 41, skipped=59) == "Overloaded: 80 % of ticks late"
    assert text(load, 12.0, 120, skipped=40) is None


def test_one_late_tick_is_not_worth_a_text() -> None:
    load = Load()
    load.note_tick(300_000)
    assert text(load, 0.0, 1) is None
    load.note_tick(0)
    assert text(load, 0.1, 2) is None
    assert load.late_ticks == 1


def test_anything_dropped_is_told_for_five_seconds() -> None:
    load = Load()
    assert text(load, 0.0, 0) is None
    assert text(load, 1.0, 10, dropped=300) == "Overloaded: 300/s dropped"
    assert text(load, 4.0, 40, dropped=300) == "Overloaded: 75/s dropped"
    assert text(load, 6.1, 61, dropped=300) is None


def test_a_clock_that_is_set_back_does_no_harm() -> None:
    load = Load()
    assert text(load, 100.0, 10) is None
    assert text(load, 50.0, 20) is None
