"""What was seen of one aircraft: its times by source, its closest point, its end."""

from companion.output.sighting import NOT_HEARD, Evidence, Sighting


def test_an_aircraft_without_reports_has_no_end() -> None:
    sighting = Sighting()
    assert sighting.state_at(10.0) is None
    assert sighting.sources == ()
    assert sighting.coasted_s() == 0.0


def test_a_pause_divides_the_time_of_a_source() -> None:
    sighting = Sighting()
    for second in (0.0, 1.0, 5.5, 20.0, 21.0):
        sighting.note(second, Evidence("confirmed", ("a",), 0.5, 100.0 - second, 30.0 - second, 7))
    assert sighting.spans_s == {"a": [(0.0, 5.5), (20.0, 21.0)]}
    assert (sighting.first_heard_s, sighting.last_heard_s) == (-0.5, 20.5)
    assert (sighting.closest_m, sighting.closest_s) == (79.0, 21.0)
    assert (sighting.least_sigma_m, sighting.reports) == (9.0, 7)
    assert sighting.state_at(21.0) == "confirmed"
    assert sighting.state_at(30.0) == "lost"


def test_a_coasted_aircraft_is_heard_by_no_source() -> None:
    sighting = Sighting()
    sighting.note(0.0, Evidence("confirmed", ("a",), 0.0, 1.0))
    for second in (1.0, 2.0, 3.0):
        sighting.note(second, Evidence("coasted", ("a",), second, 1.0))
    assert sighting.spans_s == {"a": [(0.0, 0.0)], NOT_HEARD: [(1.0, 3.0)]}
    assert sighting.sources == ("a",)
    assert sighting.coasted_s() == 2.0
    assert sighting.last_heard_s == 0.0


def test_a_flood_of_sources_is_bounded() -> None:
    sighting = Sighting()
    for number in range(1000):
        sighting.note(0.0, Evidence("confirmed", (f"source {number}",), 0.0, 1.0))
    assert len(sighting.spans_s) < 20
