"""The effective configuration as text: what was written, and every default that was not."""

import dataclasses
import json
import math
import re
from collections.abc import Iterator
from enum import Enum
from pathlib import Path
from typing import Any

from companion.config.keys import file_key, is_angle
from companion.config.schema import Config

# Texts that need no quotes in YAML.
_PLAIN = re.compile(r"(?!(true|false|null)$)[A-Za-z_][\w./-]*", re.ASCII | re.IGNORECASE)


def describe(config: Config) -> str:
    """The configuration as a YAML file that loads to the same configuration; angles in degrees."""
    return "\n".join(_lines(config, "")) + "\n"


def _lines(section: Any, indent: str) -> Iterator[str]:
    for field in dataclasses.fields(section):
        key, value = file_key(field.name), getattr(section, field.name)
        if dataclasses.is_dataclass(value):
            yield f"{indent}{key}:"
            yield from _lines(value, indent + "  ")
        elif isinstance(value, tuple) and value and dataclasses.is_dataclass(value[0]):
            yield f"{indent}{key}:"
            for item in value:
                first, *others = _lines(item, indent + "    ")
                yield f"{indent}  - {first.lstrip()}"
                yield from others
        else:
            yield f"{indent}{key}: {value_text(value, field.name)}"


def value_text(value: Any, name: str) -> str:
    """A value as YAML writes it; angles in degrees, as the key says."""
    if isinstance(value, tuple | frozenset):
        items = sorted(value) if isinstance(value, frozenset) else value
        return f"[{', '.join(value_text(item, name) for item in items)}]"
    if value is None or isinstance(value, bool):
        return json.dumps(value)
    if isinstance(value, Enum):
        value = value.value
    if isinstance(value, str | Path):
        return str(value) if _PLAIN.fullmatch(str(value)) else json.dumps(str(value), ensure_ascii=False)
    if name.endswith("icao"):
        return f"0x{value:06X}"
    # Twelve digits hide what the conversion to radians and back adds to a round number of degrees.
    return f"{math.degrees(value):.12g}" if is_angle(name) else repr(value)
