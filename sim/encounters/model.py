"""The encounter models of MIT Lincoln Laboratory: plain-text Bayesian networks of how aircraft fly.

"Encounter Models for the Littoral Regions / Uncorrelated Encounter Model of the National Airspace System",
Kochenderfer et al., ATC-345 (2008). A model has an initial network (airspace, class, layer, speed, and the
rates of speed, height and course) and a transition network for the rates a second later. Counts are stored
column by column: the values of a variable for each combination of its parents in turn, the first parent
changing fastest. Values are drawn uniformly within bins; the bin around zero gives zero.
"""

from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path as FilePath

import numpy as np

from companion.errors import ConfigError
from sim.encounters.encounter import Array, Path

_KNOT_MPS, _FOOT_M = 1852.0 / 3600.0, 0.3048
_INITIAL = 7  # airspace, class, layer, speed, acceleration, climb, turn
_LAYER, _SPEED, _ACCELERATION, _CLIMB, _TURN = 2, 3, 4, 5, 6
_DYNAMIC = (_ACCELERATION, _CLIMB, _TURN)
_SECTIONS = (
    "labels_initial", "G_initial", "r_initial", "N_initial", "labels_transition", "G_transition",
    "r_transition", "N_transition", "boundaries", "resample_rates",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class _Node:
    """One variable: its parents with strides, and its cumulative shares for each combination of parents."""

    strides: tuple[tuple[int, int], ...]
    shares: tuple[tuple[float, ...], ...]  # empty for a combination without counts

    def draw(self, values: list[int], chance: float) -> int | None:
        """A value, given the parents' values; `None` for a combination without counts."""
        place = 0
        for parent, stride in self.strides:
            place += stride * values[parent]
        shares = self.shares[place]
        return bisect_right(shares, chance) if shares else None


@dataclass(frozen=True, slots=True)
class EncounterModel:
    """One model. `boundaries` by variable, in the file's units; empty for categories."""

    name: str
    order: tuple[int, ...]
    initial: tuple[_Node, ...]
    transition: tuple[_Node, ...]  # of acceleration, climb and turn
    boundaries: tuple[tuple[float, ...], ...]
    resample_rates: tuple[float, ...]

    def draw(self, rng: np.random.Generator, seconds: int) -> Path:
        """A random path, once a second, starting north from the origin: (seconds + 1, 3)."""
        chances = iter(rng.random(2 * _INITIAL + 9 * (seconds + 1)).tolist())
        values, numbers = self._begin(chances)
        speed, height, course = numbers[_SPEED], numbers[_LAYER], 0.0
        bounds = self.boundaries[_SPEED]
        flown = np.empty((seconds + 1, 4))  # speed [kt], height [ft], course [rad], climb [ft/min]
        for second in range(seconds + 1):
            flown[second] = speed, height, course, numbers[_CLIMB]
            speed = min(max(speed + numbers[_ACCELERATION], bounds[0]), bounds[-1])
            height += numbers[_CLIMB] / 60.0
            course += np.pi / 180.0 * numbers[_TURN]
            self._advance(values, numbers, chances)
        return _path(flown)

    def _begin(self, chances: Iterator[float]) -> tuple[list[int], list[float]]:
        values, numbers = [0] * _INITIAL, [0.0] * _INITIAL
        for variable in self.order:
            drawn = self.initial[variable].draw(values, next(chances))
            values[variable] = drawn or 0
            numbers[variable] = self._within(variable, values[variable], next(chances))
        return values, numbers

    def _advance(self, values: list[int], numbers: list[float], chances: Iterator[float]) -> None:
        """One second later: a new bin, or sometimes a new number within the old bin."""
        after = [node.draw(values, next(chances)) for node in self.transition]
        for variable, bin_after in zip(_DYNAMIC, after, strict=True):
            resampling, number = next(chances), next(chances)
            changed = bin_after is not None and bin_after != values[variable]
            if changed or resampling < self.resample_rates[variable]:
                values[variable] = bin_after if bin_after is not None else values[variable]
                numbers[variable] = self._within(variable, values[variable], number)

    def _within(self, variable: int, value: int, chance: float) -> float:
        bounds = self.boundaries[variable]
        if not bounds:
            return float(value)
        low, high = bounds[value], bounds[value + 1]
        if variable in _DYNAMIC and low < 0.0 < high:
            return 0.0
        return low + chance * (high - low)


def _path(flown: Array) -> Path:
    speed_mps, height_m = flown[:, 0] * _KNOT_MPS, flown[:, 1] * _FOOT_M
    climb_mps = flown[:, 3] * _FOOT_M / 60.0
    horizontal_mps = np.sqrt(np.maximum(speed_mps**2 - climb_mps**2, 0.0))
    velocity = np.column_stack(
        [horizontal_mps * np.cos(flown[:, 2]), horizontal_mps * np.sin(flown[:, 2]), -climb_mps]
    )
    position = np.zeros_like(velocity)
    position[1:, :2] = np.cumsum(0.5 * (velocity[1:, :2] + velocity[:-1, :2]), axis=0)
    position[:, 2] = -height_m
    return Path(np.arange(len(flown), dtype=float), position, velocity)


def read_model(path: FilePath) -> EncounterModel:
    """Read a model; `ConfigError` names the error and its place in one line."""
    sections = _sections(path)
    try:
        return _model(path.stem, sections)
    except (ValueError, IndexError) as error:
        raise ConfigError(f"{path}: no encounter model: {error}") from error


def _sections(path: FilePath) -> dict[str, list[str]]:
    try:
        lines = path.read_text(encoding="ascii").splitlines()
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: no encounter model: not plain text") from error
    sections: dict[str, list[str]] = {}
    for number, line in enumerate(lines, start=1):
        if line.startswith("#"):
            sections[line[1:].strip()] = []
        elif line.strip():
            if not sections:
                raise ConfigError(f"{path}, line {number}: no encounter model: text before the first section")
            sections[next(reversed(sections))].append(line)
    missing = [name for name in _SECTIONS if name not in sections]
    if missing:
        raise ConfigError(f"{path}: no encounter model: {missing[0]} is missing")
    return sections


def _model(name: str, sections: dict[str, list[str]]) -> EncounterModel:
    sizes = _integers(sections["r_initial"])
    sizes_after = _integers(sections["r_transition"])
    if len(sizes) != _INITIAL or len(sizes_after) != _INITIAL + len(_DYNAMIC) or min(sizes_after) < 1:
        raise ValueError("its variables are not speed, layer, and the rates of speed, height and course")
    graph, graph_after = _graph(sections["G_initial"]), _graph(sections["G_transition"])
    initial = _nodes(graph, sizes, _integers(sections["N_initial"]), "N_initial")
    after = _nodes(graph_after, sizes_after, _integers(sections["N_transition"]), "N_transition")
    if any(parent >= _INITIAL for node in after[_INITIAL:] for parent, _ in node.strides):
        raise ValueError("a rate depends on another of the same moment")
    boundaries = tuple(_boundaries(line) for line in sections["boundaries"])
    rates = tuple(float(word) for word in " ".join(sections["resample_rates"]).split())
    for variable in (_LAYER, _SPEED, *_DYNAMIC):
        if len(boundaries[variable]) != sizes[variable] + 1:
            raise ValueError(f"variable {variable + 1} has {sizes[variable]} bins, but other boundaries")
    if len(rates) != _INITIAL:
        raise ValueError(f"{len(rates)} resample rates for {_INITIAL} variables")
    return EncounterModel(name, _topological(graph), initial, after[_INITIAL:], boundaries, rates)


def _integers(lines: list[str]) -> list[int]:
    return [int(word) for word in " ".join(lines).split()]


def _boundaries(line: str) -> tuple[float, ...]:
    return () if line.strip() == "*" else tuple(float(word) for word in line.split())


def _graph(lines: list[str]) -> list[list[int]]:
    """The parents of each variable."""
    rows = [[int(word) for word in line.split()] for line in lines]
    if any(len(row) != len(rows) for row in rows):
        raise ValueError("a graph is not square")
    return [[parent for parent in range(len(rows)) if rows[parent][child]] for child in range(len(rows))]


def _topological(graph: list[list[int]]) -> tuple[int, ...]:
    order: list[int] = []
    while len(order) < len(graph):
        ready = [v for v in range(len(graph)) if v not in order and set(graph[v]) <= set(order)]
        if not ready:
            raise ValueError("its graph has a loop")
        order.append(ready[0])
    return tuple(order)


def _nodes(graph: list[list[int]], sizes: list[int], counts: list[int], what: str) -> tuple[_Node, ...]:
    nodes, taken = [], 0
    # In the transition network only variables with parents have counts.
    is_transition = len(graph) > _INITIAL
    for variable, parents in enumerate(graph):
        if is_transition and not parents:
            nodes.append(_Node((), ((),)))
            continue
        strides = np.cumprod([1, *(sizes[parent] for parent in parents)]).tolist()
        size, combinations = sizes[variable], strides.pop()
        block = np.array(counts[taken : taken + size * combinations], dtype=float)
        taken += size * combinations
        if len(block) < size * combinations or (block < 0).any():
            raise ValueError(f"{what} is damaged: too few counts, or negative ones")
        shares = _cumulated(block.reshape(combinations, size))
        nodes.append(_Node(tuple(zip(parents, strides, strict=True)), shares))
    if taken != len(counts):
        raise ValueError(f"{what} is damaged: {len(counts)} counts instead of {taken}")
    return tuple(nodes)


def _cumulated(counts: Array) -> tuple[tuple[float, ...], ...]:
    """Upper ends of all values except the last, which absorbs rounding; empty without counts."""
    totals = counts.sum(axis=1)
    ends = np.cumsum(counts, axis=1)[:, :-1] / np.maximum(totals, 1.0)[:, None]
    return tuple(
        tuple(row) if total else () for row, total in zip(ends.tolist(), totals.tolist(), strict=True)
    )
