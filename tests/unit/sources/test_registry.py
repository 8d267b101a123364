"""The registry of formats: a part that is missing fails at once, with its name."""

import subprocess
import sys
from importlib import import_module
from inspect import isabstract
from pkgutil import iter_modules

import pytest

from companion import sources
from companion.errors import ConfigError
from companion.sources.decoder import Decoder
from companion.sources.registry import FORMATS, Format, decoder_class, new_decoder
from tests.support.line_decoder import LineDecoder, line_formats


class _WithoutTitle(LineDecoder):
    format = "untitled"
    title = None  # type: ignore[assignment]


class _Unfinished(Decoder):
    format = "unfinished"
    title = "Unfinished"
    lacks = ""


def test_a_decoder_is_made_when_it_is_needed() -> None:
    with line_formats():
        assert isinstance(new_decoder("gdl90"), LineDecoder)
        assert decoder_class("readsb").title == "readsb"


@pytest.mark.parametrize(
    ("name", "decoder", "words"),
    [
        ("nothing", "no_such_package:Decoder", "nothing: the Python package no_such_package is missing"),
        ("noclass", f"{__name__}:NoSuchClass", "has no decoder NoSuchClass"),
        ("noclass", f"{__name__}:pytest", "has no decoder pytest"),
        ("untitled", f"{__name__}:_WithoutTitle", "untitled: _WithoutTitle has no title"),
        ("unfinished", f"{__name__}:_Unfinished", "unfinished: _Unfinished has no feed, restart"),
        ("other", f"{LineDecoder.__module__}:LineDecoder", "other: LineDecoder has the format gdl90"),
    ],
)
def test_a_missing_part_is_named(
    name: str, decoder: str, words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(FORMATS, name, Format(decoder))
    with pytest.raises(ConfigError, match=words) as caught:
        decoder_class(name)
    assert "\n" not in str(caught.value)


def test_the_registry_loads_no_library_of_a_format() -> None:
    code = (
        "import sys, companion.config, companion.links, companion.runtime; "
        "print([m for m in ('pyModeS', 'http.client', 'companion.sources.beast') if m in sys.modules])"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "[]"


@pytest.mark.parametrize("name", FORMATS)
def test_every_format_is_whole(name: str) -> None:
    kind = decoder_class(name)
    assert kind.title
    assert kind.lacks
    assert new_decoder(name).counters.messages == 0


def test_every_decoder_in_this_room_is_in_the_registry() -> None:
    registered = {form.decoder for form in FORMATS.values()}
    for module in iter_modules(sources.__path__, f"{sources.__name__}."):
        for name, kind in vars(import_module(module.name)).items():
            if isinstance(kind, type) and issubclass(kind, Decoder) and kind.__module__ == module.name:
                assert isabstract(kind) or f"{module.name}:{name}" in registered
