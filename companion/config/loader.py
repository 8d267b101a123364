"""A YAML file to a `Config`, or a one-line error with file, line, key and what is allowed."""

import difflib
import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

from pydantic import TypeAdapter, ValidationError
from pydantic_core import ErrorDetails

from companion.config.document import Items, Leaf, Node, Table, load_document, quoted
from companion.config.keys import dataclass_in, field_types, file_key, is_angle, item_type, with_file_keys
from companion.config.schema import Config
from companion.errors import ConfigError

# The requirement a value fails, by the type of pydantic's error; numbers come from the error's context.
_MUST_BE = {
    "greater_than": "greater than {gt}",
    "greater_than_equal": "at least {ge}",
    "less_than": "less than {lt}",
    "less_than_equal": "at most {le}",
    "multiple_of": "a multiple of {multiple_of}",
    "float_type": "a number",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "bool_type": "true or false",
    "string_type": "text",
    "path_type": "text",
    "literal_error": "{expected}",
    "enum": "{expected}",
    "tuple_type": "a list",
    "list_type": "a list",
    "set_type": "a list",
    "frozen_set_type": "a list",
    "dict_type": "a mapping",
    "dataclass_type": "a mapping",
    "too_short": "a list of at least {min_length}",
    "too_long": "a list of at most {max_length}",
}
_LIMITS = ("gt", "ge", "lt", "le", "multiple_of")
_MAX_REASON_LENGTH = 200
# A field in a message, as in `supervisor.take_over_from[1]`.
_NAMES = re.compile(r"[a-z]\w*(?:\.[a-z]\w*|\[\d+\])*")
_PARTS = re.compile(r"\w+")

FieldPath = tuple[str | int, ...]
T = TypeVar("T")


def load_config(path: str | Path) -> Config:
    """The configuration in a file; `ConfigError` if it is not valid."""
    path = Path(path)
    config = read_checked(load_document(path), str(path), Config)
    # Paths of further files are relative to the folder of this file.
    token_file = config.web.token_file
    return replace(
        config,
        obstacle_files=tuple((path.parent / file).absolute() for file in config.obstacle_files),
        web=replace(config.web, token_file=token_file and (path.parent / token_file).absolute()),
    )


def line_of(path: Path, *keys: str) -> int | None:
    """The line of a key in a configuration file; `None` where the file leaves it at its default."""
    node: Node = load_document(path)
    line = None
    for key in keys:
        if not isinstance(node, Table) or key not in node.entries:
            return None
        line, node = node.entries[key]
    return line


def read_checked(document: Table, name: str, kind: type[T]) -> T:
    """A document as a dataclass; `name` is the file name in a `ConfigError`."""
    return _FileReader(name).read(document, kind)


class _FileReader:
    """Reads one file; keeps the position of each value for error messages."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._places: dict[FieldPath, tuple[int, str, Node]] = {}

    def read(self, document: Table, kind: type[T]) -> T:
        values = self._value(document, kind, (), "", document.line, angle=False)
        try:
            # As JSON, because only for JSON does "strict" have the rules that suit a file: lists for tuples,
            # text for enumerations, 3 for 3.0, but not 3.0 for 3, not "3", and not 1 for true.
            return TypeAdapter(kind).validate_json(json.dumps(values), strict=True)
        except ValidationError as error:
            raise self._config_error(error.errors()) from error

    def _value(self, node: Node, hint: Any, path: FieldPath, key: str, line: int, *, angle: bool) -> Any:
        """The input for pydantic: field names for keys, radians for degrees, all numbers finite."""
        self._places[path] = line, key, node
        section = dataclass_in(hint)
        if isinstance(node, Leaf):
            if section is not None and node.value is None:
                return {} if section is hint else None  # a section with comments only
            return self._scalar(node, key, line, angle=angle)
        if isinstance(node, Items):
            return [
                self._value(item, item_type(hint, i), (*path, i), f"{key}[{i}]", item.line, angle=angle)
                for i, item in enumerate(node.items)
            ]
        if section is None:
            raise self._error(line, key, "must not be a mapping")
        return self._section(node, section, path, key)

    def _section(self, table: Table, section: type, path: FieldPath, key: str) -> dict[str, Any]:
        types = field_types(section)
        fields = {file_key(name): name for name in types}
        values = {}
        for written, (line, node) in table.entries.items():
            full_key = f"{key}.{quoted(written)}" if key else quoted(written)
            name = fields.get(written)
            if name is None:
                raise self._error(line, full_key, f"is unknown, {_hint(written, list(fields))}")
            values[name] = self._value(node, types[name], (*path, name), full_key, line, angle=is_angle(name))
        return values

    def _scalar(self, leaf: Leaf, key: str, line: int, *, angle: bool) -> Any:
        value = leaf.value
        if isinstance(value, bool) or not isinstance(value, int | float):
            return value
        if not math.isfinite(value):
            raise self._error(line, key, f"must be a finite number (got {leaf.text})")
        return math.radians(value) if angle else value

    def _config_error(self, errors: Sequence[ErrorDetails]) -> ConfigError:
        """The error that comes first in the file; the alternatives of a union become one message."""
        by_path: dict[FieldPath, list[ErrorDetails]] = {}
        for error in errors:
            by_path.setdefault(self._known_part(error["loc"]), []).append(error)
        # A list with a wrong item is also reported as too short; the error of the item is more useful.
        innermost = [p for p in by_path if not any(p == other[: len(p)] and p != other for other in by_path)]
        path = min(innermost, key=lambda known: self._places[known][0])
        line, key, node = self._places[path]
        if (named := self._first_named(by_path[path], path)) is not None:
            line = named
        missing = next((e["loc"][-1] for e in by_path[path] if e["type"] == "missing"), None)
        if isinstance(missing, str):
            required = file_key(missing)
            return self._error(line, f"{key}.{required}" if key else required, "is required")
        return self._error(line, key, _message(by_path[path], path, node))

    def _first_named(self, errors: Sequence[ErrorDetails], path: FieldPath) -> int | None:
        """The line of the first key that a rule between several keys names and the file has."""
        for error in errors:
            reason = str(error.get("ctx", {}).get("error"))
            if error["type"] != "value_error" or reason.startswith("must "):
                continue  # it is about the section as a whole
            for name in _NAMES.findall(reason):
                parts = tuple(int(part) if part.isdigit() else part for part in _PARTS.findall(name))
                if (*path, *parts) in self._places:
                    return self._places[*path, *parts][0]
        return None

    def _known_part(self, loc: tuple[int | str, ...]) -> FieldPath:
        """The part of a location that is in the file; the rest names alternatives of a union."""
        return next(loc[:length] for length in range(len(loc), -1, -1) if loc[:length] in self._places)

    def _error(self, line: int, key: str, message: str) -> ConfigError:
        return ConfigError(
            f"{self._name}:{line}: {key}: {message}" if key else f"{self._name}:{line}: {message}"
        )


def _message(errors: Sequence[ErrorDetails], path: FieldPath, node: Node) -> str:
    name = next((part for part in reversed(path) if isinstance(part, str)), "")
    allowed = []
    for error in errors:
        context: Mapping[str, Any] = error.get("ctx", {})
        if error["type"] == "value_error":
            return quoted(with_file_keys(str(context["error"])), _MAX_REASON_LENGTH)
        if error["type"] == "missing":
            allowed.append("a longer list")
        elif error["type"] in _MUST_BE:
            allowed.append(_MUST_BE[error["type"]].format_map(_in_file_units(context, angle=is_angle(name))))
        else:
            return quoted(with_file_keys(error["msg"]), _MAX_REASON_LENGTH)
    got = f" (got {quoted(node.text) or 'nothing'})" if isinstance(node, Leaf) else ""
    return f"must be {' or '.join(allowed)}{got}"


def _in_file_units(context: Mapping[str, Any], *, angle: bool) -> dict[str, Any]:
    """The limits in a context as text; those of angles in degrees."""
    return {
        name: f"{math.degrees(limit) if angle else limit:.10g}" if name in _LIMITS else limit
        for name, limit in context.items()
    }


def _hint(key: str, known: list[str]) -> str:
    close = difflib.get_close_matches(file_key(key), known, n=1)
    return f"did you mean {close[0]}?" if close else f"allowed are {', '.join(sorted(known))}"
