"""The formats of receivers, one line each: addresses, `check --link` and the README's table follow from it.

A decoder is imported when a receiver of its format is configured: a flight without one does not load its
libraries.
"""

import inspect
from dataclasses import dataclass
from importlib import import_module

from companion.errors import ConfigError
from companion.sources.decoder import Decoder


@dataclass(frozen=True, slots=True)
class Format:
    """`decoder` is its class, as module:class. `documents`: it is read as a whole, by HTTP or from a file."""

    decoder: str
    documents: bool = False


FORMATS: dict[str, Format] = {
    "sbs": Format("companion.sources.sbs:SbsDecoder"),
    "readsb": Format("companion.sources.readsb:ReadsbDecoder", documents=True),
    "beast": Format("companion.sources.beast:BeastDecoder"),
    "gdl90": Format("companion.sources.gdl90:Gdl90Decoder"),
    "flarm": Format("companion.sources.flarm:FlarmDecoder"),
}

_TEXTS = ("format", "title", "lacks")


def decoder_class(name: str) -> type[Decoder]:
    """The decoder of a format; `ConfigError` with the name of the part that is missing."""
    module_name, _, class_name = FORMATS[name].decoder.partition(":")
    try:
        kind = getattr(import_module(module_name), class_name, None)
    except ModuleNotFoundError as error:
        raise ConfigError(f"{name}: the Python package {error.name} is missing: install it") from error
    except ImportError as error:
        raise ConfigError(f"{name}: {module_name} cannot be used: {error}") from error
    if not (isinstance(kind, type) and issubclass(kind, Decoder)):
        raise ConfigError(f"{name}: {module_name} has no decoder {class_name}")
    missing = [part for part in _TEXTS if not isinstance(getattr(kind, part, None), str)]
    missing += sorted(kind.__abstractmethods__) if inspect.isabstract(kind) else []
    if missing:
        raise ConfigError(f"{name}: {class_name} has no {', '.join(missing)}")
    if kind.format != name:
        raise ConfigError(f"{name}: {class_name} has the format {kind.format}")
    return kind


def new_decoder(name: str) -> Decoder:
    """A decoder of this format; `ConfigError` as above."""
    return decoder_class(name)()
