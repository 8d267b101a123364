"""An extension that lacks one of its places fails here, and the failure names the place.

CONTRIBUTING.md has the recipes: a traffic source, an autopilot, a row of the strategy table.
"""

import ast
import importlib
import inspect
from collections.abc import Iterator
from enum import Enum
from functools import cache
from pathlib import Path
from typing import get_args, get_type_hints

import pytest

from companion import autopilots
from companion.autopilots import MODES_OF, NAMES, NEVER_TAKEN, Adapter, choose
from companion.avoidance import Control
from companion.avoidance.cost import Height, Speed
from companion.avoidance.inner import TABLE, Course
from companion.config import Config
from companion.control.state_machine import SupervisorParams
from companion.gcs.parameters import BY_NAME
from companion.mavlink.facts import Sender
from companion.model import TrafficSource
from sim.scenario import Autopilot
from tests.support.paths import ROOT

AUTOPILOT = Sender(1, 1)


# --- tables and branches by the members of an enumeration


def incomplete(source: str, kind: type[Enum]) -> Iterator[tuple[int, list[str]]]:
    """Line and missing members of each dict display and each `match` over some members of `kind`."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Dict):
            named = {name for key in node.keys if (name := _member(key, kind)) is not None}
        elif isinstance(node, ast.Match):
            named = {name for case in node.cases for name in _members_of_case(case, kind)}
            if any(_is_wildcard(case) for case in node.cases):
                continue
        else:
            continue
        missing = [member.name for member in kind if member.name not in named]
        if named and missing:
            yield node.lineno, missing


def _member(node: ast.AST | None, kind: type[Enum]) -> str | None:
    """The member's name when the expression is `Kind.MEMBER`."""
    if (
        isinstance(node, ast.Attribute)
        and isinstance(node.value, ast.Name)
        and node.value.id == kind.__name__
    ):
        return node.attr
    return None


def _members_of_case(case: ast.match_case, kind: type[Enum]) -> Iterator[str]:
    for node in ast.walk(case.pattern):
        if isinstance(node, ast.MatchValue) and (name := _member(node.value, kind)) is not None:
            yield name


def _is_wildcard(case: ast.match_case) -> bool:
    return isinstance(case.pattern, ast.MatchAs) and case.pattern.pattern is None


@cache
def sources() -> dict[str, str]:
    """The text of each file of the package, by its path in the repository."""
    files = (ROOT / "companion").rglob("*.py")
    return {str(path.relative_to(ROOT)): path.read_text(encoding="utf-8") for path in sorted(files)}


@pytest.mark.parametrize("kind", [TrafficSource, Course, Height, Speed], ids=lambda kind: kind.__name__)
def test_every_table_and_branch_has_all_members(kind: type[Enum]) -> None:
    found = [
        f"{path}:{line} lacks {kind.__name__}.{', '.join(missing)}"
        for path, text in sources().items()
        if f"{kind.__name__}." in text
        for line, missing in incomplete(text, kind)
    ]
    assert not found, "\n".join(found)


class Example(Enum):
    FIRST, SECOND, THIRD = range(3)


def test_a_forgotten_entry_is_named_with_its_line() -> None:
    table = "\n_RANK = {Example.FIRST: 0, Example.SECOND: 1}"
    branches = "match example:\n    case Example.FIRST | Example.THIRD:\n        pass"
    assert list(incomplete(table, Example)) == [(2, ["THIRD"])]
    assert list(incomplete(branches, Example)) == [(1, ["SECOND"])]
    assert list(incomplete(branches + "\n    case _:\n        pass", Example)) == []


# --- traffic sources


@pytest.mark.parametrize("source", TrafficSource)
def test_a_traffic_source_is_reported_by_some_file(source: TrafficSource) -> None:
    """A member without a file that makes reports of it is an extension that was not finished."""
    name = f"TrafficSource.{source.name}"
    makers = [path for path, text in sources().items() if "TrafficReport(" in text and name in text]
    assert makers, f"no file makes a TrafficReport of {name}"


# --- autopilots


def adapters() -> list[type[Adapter]]:
    """Every adapter that is defined in a file of `companion/autopilots/`."""
    folder = Path(inspect.getfile(autopilots)).parent
    found = []
    for path in sorted(folder.glob("*.py")):
        module = importlib.import_module(f"{autopilots.__name__}.{path.stem}".removesuffix(".__init__"))
        for kind in vars(module).values():
            if inspect.isclass(kind) and issubclass(kind, Adapter) and not inspect.isabstract(kind):
                found.append(kind)
    return list(dict.fromkeys(found))


def name_of(kind: type[Adapter]) -> str | None:
    """The name of an adapter in a configuration."""
    for name, autopilot in NAMES.items():
        adapter = choose(autopilot, AUTOPILOT)
        if adapter is not None and type(adapter) is kind:
            return name
    return None


@pytest.mark.parametrize("kind", adapters(), ids=lambda kind: kind.__name__)
def test_an_adapter_is_registered(kind: type[Adapter]) -> None:
    name = name_of(kind)
    assert name is not None, (
        f"{kind.__name__}: companion/autopilots/__init__.py has no name and MAV_AUTOPILOT"
    )
    assert name in MODES_OF, f"{kind.__name__}: companion/autopilots/__init__.py: MODES_OF has no {name!r}"


@pytest.mark.parametrize("kind", adapters(), ids=lambda kind: kind.__name__)
def test_an_adapter_defines_everything_without_a_default(kind: type[Adapter]) -> None:
    for field in get_type_hints(Adapter):
        assert hasattr(kind, field) or field in vars(kind(AUTOPILOT)), f"{kind.__name__} has no {field}"
    guided = kind.mode_name(kind(AUTOPILOT).guided_mode)
    modes = MODES_OF.get(name_of(kind) or "", frozenset())
    assert guided in modes, f"{kind.__name__}: {guided} is not among its modes"


@pytest.mark.parametrize("name", NAMES)
def test_an_autopilot_is_known_in_every_place(name: str) -> None:
    assert choose(NAMES[name], AUTOPILOT) is not None, f"companion/autopilots: no adapter for {name!r}"
    configured = get_args(get_type_hints(Config)["autopilot"])
    assert name in configured, f"companion/config/schema.py: Config.autopilot does not accept {name!r}"
    taken = set(SupervisorParams().take_over_from) & MODES_OF[name] - NEVER_TAKEN
    assert taken, f"SupervisorParams.take_over_from: none of the modes of {name!r}"
    assert name in get_args(Autopilot), f"sim/scenario.py: no simulated vehicle for {name!r}"


# --- strategies


@pytest.mark.parametrize(
    "member", [*Course, *Height, *Speed], ids=lambda member: f"{type(member).__name__}.{member.name}"
)
def test_a_choice_of_the_strategy_table_is_used_by_a_row(member: Course | Height | Speed) -> None:
    used = {choice for row in TABLE for choice in (row.ground.course, row.ground.speed, row.height)}
    assert member in used, f"companion/avoidance/inner.py: no row uses {type(member).__name__}.{member.name}"


def test_the_rows_use_every_control_and_each_can_be_switched_off() -> None:
    assert {control for row in TABLE for control in row.controls} == set(Control)
    highest = BY_NAME["CA_CONTROLS"].highest
    assert highest == 2 ** len(Control) - 1, "companion/gcs/parameters.py: CA_CONTROLS"
