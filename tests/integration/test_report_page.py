"""The page of a flight, drawn as a whole."""

import re
from functools import cache

import pytest

from companion.report import page
from companion.report.page import page_of
from companion.report.reading import Log
from tests.unit.report.test_flight_report import avoided, flight_of, record, track


@cache
def usual_page() -> str:
    """Of a flight without home, drawn once."""
    flight = flight_of(avoided())
    flight.notes.append("<b>cut off</b>")
    return page_of(Log(flight))


def test_a_page_is_complete_works_offline_and_is_reproducible() -> None:
    text = usual_page()
    assert "<td>N1</td>" in text
    assert "404 m" in text
    assert "&lt;b&gt;cut off" in text
    assert "<script" not in text
    assert not re.findall(r"(?:src|href)='?\"?https?:", text)
    again = flight_of(avoided())
    again.notes.append("<b>cut off</b>")
    assert page_of(Log(again)) == text


def test_more_aircraft_than_can_be_drawn_are_in_the_table(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a dozen usually."""
    monkeypatch.setattr(page, "_MAX_DETAILS", 3)
    names = [f"A{number:05X}" for number in range(40)]
    records = [
        record(second, 20.0 * second, traffic=[track(name, 0.0, 100.0 + second) for name in names])
        for second in range(20)
    ]
    text = page_of(Log(flight_of(records)))
    assert text.count("<td>N1</td>") == len(names)
    assert text.count("<h3>") == 3


def test_heights_are_above_home_where_home_is_recorded() -> None:
    records = list(avoided())
    for one in records:
        one["own"]["height_m"] = one["own"]["altitude_m"] - 400.0
    text = page_of(Log(flight_of(records)))
    assert "<th>height above home</th><td>100 to 160 m</td>" in text
    assert "guidance, height above home" in text
    assert "course 045, 22.0 m/s, 160 m" in text
    unknown = usual_page()
    assert "<th>height above sea</th><td>500 to 560 m</td>" in unknown
    assert "course 045, 22.0 m/s, 560 m" in unknown
