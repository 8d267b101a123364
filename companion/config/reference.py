"""The configuration reference: every key with its default, what it may be, and the words of its own source.

Made from the dataclasses, so that it cannot say anything else than what the loader takes.
"""

import ast
import dataclasses
import inspect
import math
import textwrap
from collections.abc import Iterator
from enum import Enum
from typing import Annotated, Any, Literal, get_args, get_origin, get_type_hints

from annotated_types import Ge, Gt, Le, Lt

from companion.config.description import value_text
from companion.config.keys import dataclass_in, file_key, in_file_words, is_angle
from companion.config.schema import Config

_WIDTH = 110
_EXAMPLE_LINK = "udpin:0.0.0.0:14550"
_HEAD = "Everything that a configuration may say, with its default. Only `links` must be there."


def reference() -> str:
    """A YAML file that loads: all defaults, each with what it means and what it may be."""
    config = Config(links=(_EXAMPLE_LINK,))
    return "\n".join([*_comment(_HEAD, ""), "", *_lines(config, "")]) + "\n"


def _lines(section: Any, indent: str) -> Iterator[str]:
    kind = type(section)
    hints, comments = get_type_hints(kind, include_extras=True), _comments(kind)
    for field in dataclasses.fields(kind):
        value, key = getattr(section, field.name), file_key(field.name)
        if dataclasses.is_dataclass(value):
            yield ""
            yield from _comment(comments.get(field.name) or _first_line(type(value)), indent)
            yield f"{indent}{key}:"
            yield from _lines(value, indent + "  ")
            continue
        yield from _comment(comments.get(field.name, ""), indent)
        allowed = in_file_words(_allowed(hints[field.name], is_angle(field.name)))
        line = f"{indent}{key}: {value_text(value, field.name)}"
        yield f"{line}  # {allowed}" if allowed else line


def _comment(words: str, indent: str) -> list[str]:
    if not words:
        return []
    start = f"{indent}# "
    return textwrap.wrap(in_file_words(words), _WIDTH, initial_indent=start, subsequent_indent=start)


def _first_line(kind: type) -> str:
    return (inspect.getdoc(kind) or "").partition("\n")[0]


def _comments(kind: type) -> dict[str, str]:
    """What the source says of each field: the comment lines right above it, else the one behind it."""
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
    """What a value may be, in words; empty where its default says enough."""
    origin, parts = get_origin(hint), get_args(hint)
    if origin is Annotated:
        inside = _allowed(parts[0], angle)
        bounds = [words for bound in parts[1:] if (words := _bound(bound, angle))]
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
