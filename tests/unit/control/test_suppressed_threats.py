"""How long the operator's decision about an aircraft holds."""

from companion.control.suppressed_threats import SuppressedThreats
from companion.engine import EngineConfig
from companion.gcs.parameters import BY_NAME
from companion.gcs.settings import Settings
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


def test_it_holds_for_those_in_conflict_and_nobody_else() -> None:
    dismissed = SuppressedThreats(Settings(EngineConfig()))
    assert not dismissed.cover(conflict("A"))
    assert not dismissed.cover(conflict())
    dismissed.add(conflict("A", "B"), 0.0)
    assert dismissed.cover(conflict("A", "B"))
    assert dismissed.cover(conflict("B"))
    assert not dismissed.cover(conflict("B", "C"))
    dismissed.add(conflict("C"), 1.0)
    assert dismissed.cover(conflict("B", "C"))
    dismissed.forget()
    assert not dismissed


def test_it_ends_when_the_conflict_has_been_over_for_a_while_for_each_by_itself() -> None:
    dismissed = SuppressedThreats(Settings(EngineConfig()))
    dismissed.add(conflict("A", "B"), 0.0)
    for tick in range(100):
        dismissed.observe(conflict("A"), tick / 10)
        assert dismissed.cover(conflict("B")) == (tick <= 50)
    dismissed.observe(conflict(), 14.9)
    assert dismissed.cover(conflict("A"))
    dismissed.observe(conflict("A"), 15.0)  # flickers
    dismissed.observe(conflict(), 19.9)
    assert dismissed.cover(conflict("A"))
    dismissed.observe(conflict(), 20.1)
    assert not dismissed


def test_how_long_is_a_setting() -> None:
    settings = Settings(EngineConfig())
    dismissed = SuppressedThreats(settings)
    dismissed.add(conflict("A"), 0.0)
    settings.put(BY_NAME["CA_SETTLE"], 0.0)
    dismissed.observe(conflict("A"), 60.0)
    assert dismissed
    dismissed.observe(conflict(), 60.1)
    assert not dismissed
