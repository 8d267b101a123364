"""What a transmitter says of itself."""

import pytest

from companion.model import TrafficKind
from companion.sources.identity import address_key, callsign, emitter_kind, squawk


def test_addresses_that_are_not_of_icao_have_keys_of_their_own() -> None:
    assert address_key(0x4840D6, is_icao=True) == "4840D6"
    assert address_key(0x4840D6, is_icao=False) == "~4840D6"
    assert address_key(0, is_icao=True) == address_key(0, is_icao=False) == ""


@pytest.mark.parametrize(
    ("category", "kind"),
    [
        ("A0", TrafficKind.AIRCRAFT),
        ("A7", TrafficKind.AIRCRAFT),
        ("B1", TrafficKind.AIRCRAFT),
        ("B6", TrafficKind.UAV),
        ("C1", TrafficKind.SURFACE_VEHICLE),
        ("C2", TrafficKind.SURFACE_VEHICLE),
        ("C3", TrafficKind.OBSTACLE),
        ("C5", TrafficKind.OBSTACLE),
        ("C6", TrafficKind.AIRCRAFT),
        ("", TrafficKind.AIRCRAFT),
        ("Z9", TrafficKind.AIRCRAFT),
    ],
)
def test_kinds_follow_from_the_category(category: str, kind: TrafficKind) -> None:
    assert emitter_kind(category) is kind


@pytest.mark.parametrize("text", ["", "        ", "KLM#023", "@@@@@@@@", "KLM1023XX", "-", "KL\tM", "ÄBC"])
def test_what_is_no_callsign_is_none(text: str) -> None:
    assert callsign(text) is None


def test_a_callsign_is_stripped() -> None:
    assert callsign("KLM1023 ") == "KLM1023"
    assert callsign(" d-ekkk ") == "D-EKKK"
    assert callsign("A") == "A"


@pytest.mark.parametrize("text", ["", "123", "12345", "7800", "-123", "12.3", "٠١٢٣"])
def test_what_is_no_transponder_code_is_none(text: str) -> None:
    assert squawk(text) is None


def test_a_transponder_code_is_its_digits() -> None:
    assert (squawk("7700"), squawk("0021")) == (7700, 21)
