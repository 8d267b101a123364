"""Field names and file keys: angles are radians in the house and degrees in files, and each name says so."""

import dataclasses
import re
from typing import Any, get_args, get_origin, get_type_hints

# max_bank_rad, max_turn_rate_radps
_RADIANS = re.compile(r"_rad(?=(ps2?)?\b)")


def file_key(field_name: str) -> str:
    """The key in files for a field: `max_bank_deg` for `max_bank_rad`."""
    return _RADIANS.sub("_deg", field_name)


def is_angle(field_name: str) -> bool:
    """Whether a field holds radians (or radians per second), and its key in files degrees."""
    return _RADIANS.search(field_name) is not None


def in_file_words(message: str) -> str:
    """A message of the house with file keys in place of field names."""
    return _RADIANS.sub("_deg", message)


def field_types(cls: type) -> dict[str, Any]:
    """Type of each field of a dataclass, by field name, without `Annotated`."""
    hints = get_type_hints(cls)
    return {field.name: hints[field.name] for field in dataclasses.fields(cls)}


def dataclass_in(hint: Any) -> type | None:
    """The dataclass that a type is, or may be (`Envelope | None`)."""
    candidates = (hint, *get_args(hint)) if get_origin(hint) is not tuple else (hint,)
    return next((c for c in candidates if isinstance(c, type) and dataclasses.is_dataclass(c)), None)


def item_type(hint: Any, index: int) -> Any:
    """Type of one item of a `tuple[X, ...]`, `tuple[X, Y]` or `frozenset[X]`; None if nothing is known."""
    args = get_args(hint)
    if get_origin(hint) is tuple and (len(args) < 2 or args[1] is not Ellipsis):
        return args[index] if index < len(args) else None
    return args[0] if args else None
