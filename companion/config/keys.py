"""Field names and file keys: angles are in radians in the code, in degrees in files, and named so."""

import dataclasses
import re
from typing import Any, get_args, get_origin, get_type_hints

# max_bank_rad, max_turn_rate_radps
_RADIANS = re.compile(r"_rad(?=(ps2?)?\b)")


def file_key(field_name: str) -> str:
    """The key of a field in files: `max_bank_deg` for `max_bank_rad`."""
    return _RADIANS.sub("_deg", field_name)


def is_angle(field_name: str) -> bool:
    """Whether a field is in radians (or radians per second), and its key in degrees."""
    return _RADIANS.search(field_name) is not None


def with_file_keys(message: str) -> str:
    """A message with file keys in place of field names."""
    return _RADIANS.sub("_deg", message)


def field_types(cls: type) -> dict[str, Any]:
    """The type of each field of a dataclass, without `Annotated`."""
    hints = get_type_hints(cls)
    return {field.name: hints[field.name] for field in dataclasses.fields(cls)}


def dataclass_in(hint: Any) -> type | None:
    """The dataclass in a type: the type itself, or a member of a union such as `Envelope | None`."""
    candidates = (hint, *get_args(hint)) if get_origin(hint) is not tuple else (hint,)
    return next((c for c in candidates if isinstance(c, type) and dataclasses.is_dataclass(c)), None)


def item_type(hint: Any, index: int) -> Any:
    """The type of one item of a `tuple[X, ...]`, `tuple[X, Y]` or `frozenset[X]`; `None` if unknown."""
    args = get_args(hint)
    if get_origin(hint) is tuple and (len(args) < 2 or args[1] is not Ellipsis):
        return args[index] if index < len(args) else None
    return args[0] if args else None
