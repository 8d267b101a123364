"""A YAML file as a tree with line numbers; limits keep time and memory small even for malicious files.

Scalars follow the core schema of YAML 1.2 (https://yaml.org/spec/1.2.2/#103-core-schema), not PyYAML's 1.1:
`1e3` is a number, `no` and `12:30` are texts, `010` is ten. Anchors, aliases and tags are refused:
configurations do not need them, and with aliases a small file can expand to any size.
"""

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import yaml

from companion.errors import ConfigError

MAX_BYTES = 1 << 20
_MAX_DEPTH = 20
_MAX_NODES = 10_000
# 64-bit floats with exponent have less than 25 characters.
_MAX_NUMBER_LENGTH = 40

Scalar = bool | int | float | str | None


@dataclass(frozen=True, slots=True)
class Leaf:
    """A scalar, and its text in the file."""

    line: int
    value: Scalar
    text: str


@dataclass(frozen=True, slots=True)
class Items:
    """A list."""

    line: int
    items: tuple["Node", ...]


@dataclass(frozen=True, slots=True)
class Table:
    """A mapping; the line of an entry is that of its key."""

    line: int
    entries: Mapping[str, tuple[int, "Node"]]


Node = Leaf | Items | Table


def quoted(text: str, longest: int = 60) -> str:
    """A text from a file for use in a message: one line, of limited length, printable characters only."""
    text = "".join(c if c.isprintable() else "?" for c in " ".join(text[: 2 * longest].split()))
    return text if len(text) <= longest else f"{text[:longest]}..."


def load_document(path: Path) -> Table:
    """The tree of a file; `ConfigError` with file and line if it is not valid."""
    return parse_document(_read(path), str(path))


def parse_document(text: str, name: str) -> Table:
    """The tree of a text; `name` is the file name in messages."""
    try:
        root = _Loader(text, name).get_single_node()
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = name if mark is None else f"{name}:{mark.line + 1}"
        raise ConfigError(
            f"{where}: not valid YAML: {quoted(str(error.problem or error.context))}"
        ) from error
    except yaml.reader.ReaderError as error:
        line = text.count("\n", 0, error.position) + 1
        raise ConfigError(f"{name}:{line}: not valid YAML: {quoted(error.reason)}") from error
    if root is None:
        raise ConfigError(f"{name}: is empty")
    tree = _tree(root, name)
    if isinstance(tree, Leaf) and tree.value is None:
        raise ConfigError(f"{name}: is empty")
    if not isinstance(tree, Table):
        raise ConfigError(f"{name}:{tree.line}: must be a mapping of keys to values")
    return tree


def _read(path: Path) -> str:
    try:
        with path.open("rb") as file:
            data = file.read(MAX_BYTES + 1)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from error
    if len(data) > MAX_BYTES:
        raise ConfigError(f"{path}: is larger than {MAX_BYTES >> 20} MiB, this is not a configuration")
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise ConfigError(f"{path}:{line}: is not UTF-8 text") from error


class _Loader(yaml.SafeLoader):
    """PyYAML's parser with the core schema, without aliases, and with limits to nesting and size."""

    def __init__(self, text: str, name: str) -> None:
        super().__init__(text)
        self._name = name
        self._depth = 0
        self._nodes = 0

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        event = self.peek_event()  # type: ignore[no-untyped-call]
        line = event.start_mark.line + 1
        if isinstance(event, yaml.AliasEvent) or getattr(event, "anchor", None) is not None:
            raise ConfigError(f"{self._name}:{line}: anchors (&) and aliases (*) are not supported")
        self._nodes += 1
        if self._nodes > _MAX_NODES:
            raise ConfigError(f"{self._name}:{line}: has too many values, this is not a configuration")
        if self._depth >= _MAX_DEPTH:
            raise ConfigError(f"{self._name}:{line}: is nested too deeply")
        self._depth += 1
        node = super().compose_node(parent, index)
        self._depth -= 1
        return node


_TAG = "tag:yaml.org,2002:"


def _parse_float(text: str) -> float:
    lower = text.lower()
    if lower.endswith(".nan"):
        return math.nan
    return float(lower.replace(".inf", "inf"))


# tag, pattern, first characters, conversion
_CORE_SCHEMA: tuple[tuple[str, str, str, Callable[[str], Scalar]], ...] = (
    ("null", r"~|null|Null|NULL|", "~nN", lambda _: None),
    ("bool", r"true|True|TRUE|false|False|FALSE", "tTfF", lambda text: text.lower() == "true"),
    ("int", r"[-+]?[0-9]+", "-+0123456789", int),
    ("int", r"0o[0-7]+|0x[0-9a-fA-F]+", "0", lambda text: int(text, 0)),
    (
        "float",
        r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)",
        "-+.0123456789",
        _parse_float,
    ),
)
_SCALARS = tuple(
    (_TAG + kind, re.compile(rf"(?:{pattern})\Z"), first, convert)
    for kind, pattern, first, convert in _CORE_SCHEMA
)
# Otherwise PyYAML would copy its YAML 1.1 resolvers into this subclass.
_Loader.yaml_implicit_resolvers = {}
for _tag, _pattern, _first, _ in _SCALARS:
    _Loader.add_implicit_resolver(_tag, _pattern, [*_first, ""] if _tag == _TAG + "null" else list(_first))


def _tree(node: yaml.Node, name: str) -> Node:
    line = node.start_mark.line + 1
    if isinstance(node, yaml.MappingNode) and node.tag == _TAG + "map":
        return Table(line, _entries(node, name))
    if isinstance(node, yaml.SequenceNode) and node.tag == _TAG + "seq":
        return Items(line, tuple(_tree(item, name) for item in node.value))
    if isinstance(node, yaml.ScalarNode):
        return Leaf(line, _scalar(node, f"{name}:{line}"), node.value)
    raise ConfigError(f"{name}:{line}: tags ({quoted(node.tag)}) are not supported")


def _entries(node: yaml.MappingNode, name: str) -> dict[str, tuple[int, Node]]:
    entries: dict[str, tuple[int, Node]] = {}
    for key_node, value_node in node.value:
        line = key_node.start_mark.line + 1
        if not isinstance(key_node, yaml.ScalarNode) or key_node.tag != _TAG + "str":
            raise ConfigError(f"{name}:{line}: a key must be text")
        key: str = key_node.value
        if key in entries:
            raise ConfigError(f"{name}:{line}: {quoted(key)}: is a duplicate of line {entries[key][0]}")
        entries[key] = line, _tree(value_node, name)
    return entries


def _scalar(node: yaml.ScalarNode, where: str) -> Scalar:
    text: str = node.value
    if node.tag == _TAG + "str":
        return text
    if len(text) > _MAX_NUMBER_LENGTH:
        raise ConfigError(f"{where}: a number with {len(text)} characters is too long")
    for tag, pattern, _, convert in _SCALARS:
        if node.tag == tag and pattern.match(text):
            return convert(text)
    raise ConfigError(f"{where}: tags ({quoted(node.tag)}) are not supported")
