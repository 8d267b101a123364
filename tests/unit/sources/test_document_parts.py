"""Large documents as several small ones: the same aircraft, the same values, in their order."""

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.sources.document_parts import divided
from companion.sources.readsb import ReadsbDecoder

_TEXT = "]},{\"'\\ é"


def document(count: int, name: str = "aircraft") -> dict[str, Any]:
    aircraft = [
        {
            "hex": f"{0x400000 + number:06x}", "flight": _TEXT, "lat": 48.0, "lon": 11.0 + number * 1e-4,
            "alt_baro": 10_000, "seen_pos": 0.5, "mlat": [], "nested": {"a": [{"b": 1}]},
        }
        for number in range(count)
    ]  # fmt: skip
    return {"now": 1.75e9, "messages": 3, name: aircraft, "after": {"aircraft": [1, 2]}, "pad": " " * 70_000}


@pytest.mark.parametrize("name", ["aircraft", "ac"])
@pytest.mark.parametrize("indent", [None, 2])
@pytest.mark.parametrize("count", [0, 1, 100, 101, 950])
def test_the_parts_are_the_whole(name: str, indent: int | None, count: int) -> None:
    whole = document(count, name)
    parts = [json.loads(part) for part in divided(json.dumps(whole, indent=indent).encode())]
    assert [one for part in parts for one in part[name]] == whole[name]
    assert len(parts) == max(-(-count // 100), 1)
    for number, part in enumerate(parts if count else []):
        assert part.pop("part") == number
        assert {key: part[key] for key in whole if key != name} == {k: whole[k] for k in whole if k != name}


@given(st.binary(max_size=200))
def test_what_is_no_document_stays_as_it_is(rubbish: bytes) -> None:
    assert divided(rubbish) == [rubbish]
    for begins in (b'{"aircraft":[', b'{"now":1,"aircraft":[{},', b"[", b"{", b""):
        damaged = begins + rubbish + b" " * 70_000
        parts = divided(damaged)
        assert parts == [damaged] or all(isinstance(json.loads(part), dict) for part in parts)


def test_every_truncation_stays_as_it_is() -> None:
    raw = json.dumps(document(150)).encode()
    for length in range(0, len(raw) - 1, 997):
        assert divided(raw[:length]) == [raw[:length]]


def test_the_parts_are_one_message_and_each_aircraft_is_reported_once() -> None:
    decoder, raw = ReadsbDecoder(), json.dumps(document(950)).encode()
    heard = [fact for part in decoder.divided(raw) for fact in decoder.feed(part, 1.75e9)]
    assert len(heard) == len({fact.report.key for fact in heard}) == 950
    assert (decoder.counters.messages, decoder.counters.reports) == (1, 950)
    again = [fact for part in decoder.divided(raw) for fact in decoder.feed(part, 1.75e9 + 1.0)]
    assert again == []
    assert not decoder.counters.bad


def test_the_parts_of_a_document_with_too_many_aircraft_are_read_up_to_the_limit() -> None:
    decoder, raw = ReadsbDecoder(), json.dumps(document(5_050)).encode()
    heard = [fact for part in decoder.divided(raw) for fact in decoder.feed(part, 1.75e9)]
    assert len(heard) == 5_000
    assert decoder.counters.bad["too many aircraft"] == 50


def test_a_document_that_is_too_large_is_refused_as_a_whole() -> None:
    decoder, raw = ReadsbDecoder(), b" " * 8_000_001
    assert decoder.divided(raw) == [raw]
    assert decoder.feed(raw, 1.75e9) == []
    assert decoder.counters.bad["document too large"] == 1
