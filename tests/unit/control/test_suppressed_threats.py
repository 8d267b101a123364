"""Which conflicts the operator's decision suppresses, and for how long."""

from companion.control.state_machine import StateData
from companion.control.suppressed_threats import covers, suppress, update
from companion.model import Decision, Layer, Threat


def conflict(*track_ids: str) -> Decision:
    if not track_ids:
        return Decision(Layer.CLEAR)
    threats = tuple(
        Threat(
            track_id=track_id, icao=None, distance_m=900.0, bearing_rad=0.0, relative_altitude_m=0.0,
            closing_mps=80.0, time_to_closest_s=11.0, miss_horizontal_m=0.0, miss_vertical_m=0.0,
            layer=Layer.OUTER,
        )
        for track_id in track_ids
    )  # fmt: skip
    return Decision(Layer.OUTER, None, threats)


def test_only_the_tracks_in_conflict_are_suppressed() -> None:
    data = StateData()
    assert not covers(data, conflict("A"))
    assert not covers(data, conflict())
    suppress(data, conflict("A", "B"), 0.0)
    assert covers(data, conflict("A", "B"))
    assert covers(data, conflict("B"))
    assert not covers(data, conflict("B", "C"))
    suppress(data, conflict("C"), 1.0)
    assert covers(data, conflict("B", "C"))


def test_a_suppression_ends_when_its_conflict_has_been_over_for_the_settling_time() -> None:
    data = StateData()
    suppress(data, conflict("A", "B"), 0.0)
    for tick in range(100):
        update(data, conflict("A"), 5.0, tick / 10)
        assert covers(data, conflict("B")) == (tick <= 50)
    update(data, conflict(), 5.0, 14.9)
    assert covers(data, conflict("A"))
    update(data, conflict("A"), 5.0, 15.0)  # in conflict again for a moment
    update(data, conflict(), 5.0, 19.9)
    assert covers(data, conflict("A"))
    update(data, conflict(), 5.0, 20.1)
    assert not data.suppressed_s


def test_without_a_settling_time_it_ends_with_the_conflict() -> None:
    data = StateData()
    suppress(data, conflict("A"), 0.0)
    update(data, conflict("A"), 0.0, 60.0)
    assert data.suppressed_s
    update(data, conflict(), 0.0, 60.1)
    assert not data.suppressed_s
