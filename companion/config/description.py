"""Configurations as YAML text: the values in effect, and the reference of all keys.

The reference is made from the dataclasses and the comments in their source, so that it always agrees with the
loader.
"""

import ast
import dataclasses
import inspect
import json
import math
import re
import textwrap
from collections.abc import Iterator
from enum import Enum
from pathlib import Path
from typing import Annotated, Any, Literal, get_args, get_origin, get_type_hints

from annotated_types import Ge, Gt, Le, Lt

from companion.config.keys import dataclass_in, file_key, is_angle, with_file_keys
from companion.config.schema import Config

# Texts that need no quotes in YAML.
_PLAIN = re.compile(r"(?!(true|false|null)$)[A-Za-z_][\w./-]*", re.ASCII | re.IGNORECASE)
_WIDTH = 110
_EXAMPLE_LINK = "udpin:0.0.0.0:14550"
_HEAD = "All keys of a configuration, with their defaults. Only `links` is required."


def describe(config: Config) -> str:
    """The configuration as a YAML file that loads to the same configuration; angles in degrees."""
    return "\n".join(_lines(config, "", comments=False)) + "\n"


def reference() -> str:
    """A YAML file of all keys with their defaults, meanings and allowed values; it loads to the defaults."""
    config = Config(links=(_EXAMPLE_LINK,))
    return "\n".join([*_comment(_HEAD, ""), "", *_lines(config, "", comments=True)]) + "\n"


def _lines(section: Any, indent: str, *, comments: bool) -> Iterator[str]:
    kind = type(section)
    hints = get_type_hints(kind, include_extras=True)
    meanings = _source_comments(kind) if comments else {}
    for field in dataclasses.fields(kind):
        key, value = file_key(field.name), getattr(section, field.name)
        meaning = meanings.get(field.name, "")
        if dataclasses.is_dataclass(value):
            if comments:
                yield ""
                yield from _comment(meaning or _first_line(type(value)), indent)
            yield f"{indent}{key}:"
            yield from _lines(value, indent + "  ", comments=comments)
            continue
        yield from _comment(meaning, indent)
        if isinstance(value, tuple) and value and dataclasses.is_dataclass(value[0]):
            yield f"{indent}{key}:"
            for item in value:
                first, *others = _lines(item, indent + "    ", comments=comments)
                yield f"{indent}  - {first.lstrip()}"
                yield from others
            continue
        line = f"{indent}{key}: {value_text(value, field.name)}"
        allowed = with_file_keys(_allowed(hints[field.name], is_angle(field.name))) if comments else ""
        yield f"{line}  # {allowed}" if allowed else line


def value_text(value: Any, name: str) -> str:
    """The value of the field `name` as YAML text; angles in degrees."""
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
    # With twelve digits the rounding of the conversion to radians and back is not visible.
    return f"{math.degrees(value):.12g}" if is_angle(name) else repr(value)


def _comment(text: str, indent: str) -> list[str]:
    start = f"{indent}# "
    return textwrap.wrap(with_file_keys(text), _WIDTH, initial_indent=start, subsequent_indent=start)


def _first_line(kind: type) -> str:
    return (inspect.getdoc(kind) or "").partition("\n")[0]


def _source_comments(kind: type) -> dict[str, str]:
    """The comment of each field in the source of a dataclass: the lines above it, otherwise behind it."""
    source = textwrap.dedent(inspect.getsource(kind))
    lines = source.splitlines()
    (tree,) = ast.parse(source).body
    assert isinstance(tree, ast.ClassDef)
    found = {}
    for node in tree.body:
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            above: list[str] = []
            at = node.lineno - 2
            while lines[at].lstrip().startswith("#"):
                above.insert(0, lines[at].strip().lstrip("# "))
                at -= 1
            assert node.end_lineno is not None
            behind = lines[node.end_lineno - 1][node.end_col_offset :].strip().lstrip("# ")
            found[node.target.id] = " ".join(above) if above else behind
    return found


def _allowed(hint: Any, angle: bool) -> str:
    """The values that a type allows, as text; empty if the default makes them clear."""
    origin, parts = get_origin(hint), get_args(hint)
    if origin is Annotated:
        inside = _allowed(parts[0], angle)
        bounds = [text for bound in parts[1:] if (text := _bound(bound, angle))]
        return ", ".join([*([inside] if inside else []), *bounds])
    if origin is Literal:
        return ", ".join(map(str, parts))
    if isinstance(hint, type) and issubclass(hint, Enum):
        return ", ".join(str(choice.value) for choice in hint)
    if origin in (tuple, frozenset, set, list):
        item = "mappings" if dataclass_in(parts[0]) is not None else _allowed(parts[0], angle)
        return f"a list of {item}" if item else "a list"
    if parts and origin is not None:  # a union
        choices = [("null" if part is type(None) else _allowed(part, angle) or _noun(part)) for part in parts]
        return " or ".join(choices)
    return ""


def _noun(kind: Any) -> str:
    return {float: "a number", int: "a whole number", str: "text"}.get(kind, "a path")


def _bound(bound: Any, angle: bool) -> str:
    for kind, words, name in (
        (Gt, "more than", "gt"),
        (Ge, "at least", "ge"),
        (Lt, "less than", "lt"),
        (Le, "at most", "le"),
    ):
        if isinstance(bound, kind):
            value = getattr(bound, name)
            return f"{words} {math.degrees(value) if angle else value:.6g}"
    return ""
