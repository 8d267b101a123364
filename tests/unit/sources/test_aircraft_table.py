"""The table of aircraft that a receiver hears: bounded, and not emptied by invented ones."""

from companion.sources.aircraft_table import FORGET_S, AircraftTable


def table(capacity: int = 10) -> AircraftTable[int, list[str]]:
    return AircraftTable(list, capacity)


def test_an_aircraft_keeps_its_state_until_it_was_silent_for_long() -> None:
    aircraft = table()
    aircraft.heard(1, 0.0).append("said")
    assert aircraft.heard(1, FORGET_S) == ["said"]
    assert aircraft.known(1, FORGET_S + 1.0) == ["said"]
    assert aircraft.known(1, 2.0 * FORGET_S + 1.0) is None
    assert aircraft.heard(1, 2.0 * FORGET_S + 1.0) == []


def test_only_what_was_heard_is_known() -> None:
    assert table().known(1, 0.0) is None


def test_a_flood_of_invented_aircraft_evicts_no_established_one() -> None:
    aircraft = table()
    for second in range(5):
        aircraft.heard(1, second).append("said")
    for invented in range(2, 5_000):
        aircraft.heard(invented, 6.0)
    assert len(aircraft.heard(1, 7.0)) == 5


def test_the_table_is_bounded() -> None:
    aircraft = table()
    for repeat in range(6):
        for address in range(1_000):
            aircraft.heard(address, repeat)
            assert len(aircraft) <= 20
    for address in range(100):
        for _ in range(6):
            aircraft.heard(address, 7.0)
        assert len(aircraft) <= 20
