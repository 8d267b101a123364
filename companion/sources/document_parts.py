"""A large document of aircraft as several small ones: reading it at once would delay a tick.

Each aircraft is found by the JSON decoder, in a few microseconds: a thread that does this lets others run.
"""

import json
import re
from collections.abc import Iterator
from typing import Any, Final

LISTS: Final = ("aircraft", "ac")
"""The names of the list of aircraft, by program."""
PART: Final = "part"
"""The key that numbers the parts of a document."""

_AIRCRAFT_OF_A_PART: Final = 100
_SMALL_BYTES: Final = 1 << 16
_skip_white: Final = re.compile(r"[ \t\r\n]*").match
_decode: Final = json.JSONDecoder().raw_decode


def divided(document: bytes) -> list[bytes]:
    """The parts, each a document with the same values; one that is small, or not as expected, as it is."""
    if len(document) <= _SMALL_BYTES:
        return [document]
    try:
        return list(_parts(document.decode())) or [document]
    except (ValueError, IndexError, RecursionError):
        return [document]


def _parts(text: str) -> Iterator[bytes]:
    others: dict[str, Any] = {}
    name, aircraft = LISTS[0], list[str]()
    for key, value, elements in _members(text):
        if elements is None:
            others[key] = value
        elif elements:
            name, aircraft = key, elements
    for number, first in enumerate(range(0, len(aircraft), _AIRCRAFT_OF_A_PART)):
        head = json.dumps(others | {PART: number}, separators=(",", ":"))
        listed = ",".join(aircraft[first : first + _AIRCRAFT_OF_A_PART])
        yield f'{head[:-1]},"{name}":[{listed}]}}'.encode()


def _members(text: str) -> Iterator[tuple[str, Any, list[str] | None]]:
    """The keys and values of the object; of a list of aircraft its elements as text instead."""
    at = _past(text, 0, "{")
    while text[at] != "}":
        key, at = _decode(text, at)
        if not isinstance(key, str):
            raise ValueError("not a key")
        at = _past(text, at, ":")
        value, elements = None, None
        if key in LISTS and text[at] == "[":
            elements, at = _elements(text, at)
        else:
            value, at = _decode(text, at)
        yield key, value, elements
        at = _next(text, at, "}")


def _elements(text: str, at: int) -> tuple[list[str], int]:
    """The elements of an array as text, and where it ends."""
    found: list[str] = []
    at = _past(text, at, "[")
    while text[at] != "]":
        end = _decode(text, at)[1]
        found.append(text[at:end])
        at = _next(text, end, "]")
    return found, at + 1


def _next(text: str, at: int, close: str) -> int:
    """Where the next element begins, or the closing bracket is."""
    at = _white(text, at)
    return at if text[at] == close else _past(text, at, ",")


def _past(text: str, at: int, expected: str) -> int:
    """The place after a character, and white space around it; `ValueError` if another one is there."""
    at = _white(text, at)
    if text[at] != expected:
        raise ValueError(f"{expected} expected")
    return _white(text, at + 1)


def _white(text: str, at: int) -> int:
    found = _skip_white(text, at)
    return at if found is None else found.end()
