"""The settings that can be changed in flight: one table, from parameter names to configuration fields.

The range of a number, and the rules between fields, are those of the configuration file.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, get_args, get_type_hints

import numpy as np
from annotated_types import Ge, Le

from companion.avoidance import ALL_CONTROLS, Control
from companion.engine_config import EngineConfig
from companion.model import Role, TextUnits

# No setting needs a larger value, and a larger one may not fit the 32 bits of the wire.
_LARGEST = 1e9
_CONTROL_BITS = {Control.HEADING: 1, Control.SPEED: 2, Control.HEIGHT: 4}


@dataclass(frozen=True, slots=True)
class _Coding:
    """How a field becomes a number on the wire and back; ValueError for a number without a meaning."""

    number: Callable[[Any], float]
    field: Callable[[float], Any]


def _choice(names: tuple[str, ...]) -> _Coding:
    return _Coding(lambda name: float(names.index(name)), lambda value: names[_whole(value)])


def _whole(value: float) -> int:
    if value != math.floor(value):
        raise ValueError("a whole number")
    return int(value)


def _controls(value: float) -> frozenset[Control]:
    bits = _whole(value)
    if not bits & _CONTROL_BITS[Control.HEADING]:
        raise ValueError("1 (course) must be included")  # the outer layer steers by course
    return frozenset(control for control in ALL_CONTROLS if bits & _CONTROL_BITS[control])


_PLAIN = _Coding(float, float)
_DEGREES = _Coding(math.degrees, math.radians)
_ZERO_IS_NONE = _Coding(lambda value: 0.0 if value is None else value, lambda value: value or None)
_ROLE = _choice(tuple(role.name.lower() for role in Role))
_TEXT_UNITS = _choice(get_args(TextUnits))
_CONTROLS = _Coding(lambda controls: float(sum(_CONTROL_BITS[c] for c in controls)), _controls)


@dataclass(frozen=True, slots=True)
class GcsParam:
    """One setting: `field` is its path in the configuration; the range is in `unit`, as on the wire."""

    name: str
    field: str
    unit: str
    lowest: float
    highest: float
    words: str
    coding: _Coding = _PLAIN

    def value(self, config: EngineConfig) -> float:
        """The value on the wire, with the precision of 32 bits."""
        return as_sent(self.coding.number(self._field_of(config)))

    def put(self, config: EngineConfig, value: float | None, configured: EngineConfig) -> EngineConfig:
        """The configuration with this value; ValueError with the allowed range.

        The `configured` value is always allowed, even outside the range of the wire.
        """
        if value is None or not abs(value) < _LARGEST:
            raise ValueError("a number")
        value = as_sent(value)
        if value == self.value(configured):
            return self._exchanged(config, self._field_of(configured))
        if not self.lowest <= value <= self.highest:
            raise ValueError(f"{self.lowest:g} to {self.highest:g} {self.unit}".rstrip())
        return self._exchanged(config, self.coding.field(value))

    def shown(self, value: float) -> str:
        """The value with its unit."""
        return f"{value:g} {self.unit}".rstrip()

    def _exchanged(self, config: EngineConfig, value: Any) -> EngineConfig:
        changed: EngineConfig = _exchanged(config, self.field.split("."), value)
        return changed

    def _field_of(self, config: EngineConfig) -> Any:
        place: Any = config
        for part in self.field.split("."):
            place = getattr(place, part)
        return place


def as_sent(value: float) -> float:
    """The shortest number that has the same 32 bits on the wire: 609.6, not 609.5999755859375."""
    return float(str(np.float32(min(max(value, -_LARGEST), _LARGEST))))


def _exchanged(section: Any, path: list[str], value: Any) -> Any:
    """A copy of the section with one field replaced; its rules are checked."""
    first, *rest = path
    return replace(section, **{first: _exchanged(getattr(section, first), rest, value) if rest else value})


def _ranged(name: str, field: str, unit: str, words: str, coding: _Coding = _PLAIN) -> GcsParam:
    """A setting with the range of its field, in `unit`."""
    section, last = EngineConfig, field
    while "." in last:
        first, last = last.split(".", 1)
        section = get_type_hints(section)[first]
    bounds = get_type_hints(section, include_extras=True)[last].__metadata__
    lowest = next(bound.ge for bound in bounds if isinstance(bound, Ge))
    highest = next(bound.le for bound in bounds if isinstance(bound, Le))
    return GcsParam(name, field, unit, coding.number(lowest), coding.number(highest), words, coding)


# The order is that of the indices on the wire: add new settings at the end.
GCS_PARAMETERS: tuple[GcsParam, ...] = (
    GcsParam("CA_ROLE", "supervisor.role", "", 0, 2, "0 off, 1 advise, 2 fly", _ROLE),
    _ranged("CA_WC_HORIZ", "avoidance.well_clear_horizontal_m", "m", "well clear, sideways"),
    _ranged("CA_WC_VERT", "avoidance.well_clear_vertical_m", "m", "well clear, in height"),
    _ranged("CA_MARGIN_H", "avoidance.horizontal_margin", "share", "margin, sideways"),
    _ranged("CA_MARGIN_V", "avoidance.vertical_margin", "share", "margin, in height"),
    _ranged("CA_OBST_HORIZ", "avoidance.obstacle_horizontal_m", "m", "obstacles, sideways"),
    _ranged("CA_OBST_VERT", "avoidance.obstacle_vertical_m", "m", "obstacles, in height"),
    _ranged("CA_OUTER_DIST", "avoidance.outer_radius_m", "m", "reach of the outer layer"),
    _ranged("CA_OUTER_TIME", "avoidance.outer_time_s", "s", "in time; the greater reach counts"),
    _ranged("CA_INNER_DIST", "avoidance.inner_radius_m", "m", "reach of the inner layer"),
    _ranged("CA_INNER_TIME", "avoidance.inner_time_s", "s", "in time; the greater reach counts"),
    _ranged("CA_DOMAIN", "avoidance.delta_beta_rad", "deg", "width of transition domain", _DEGREES),
    _ranged("CA_BEGIN_NEAR", "avoidance.begin_near", "share", "begin below this miss, soon"),
    _ranged("CA_BEGIN_FAR", "avoidance.begin_far", "share", "begin below this miss, later"),
    _ranged("CA_RESERVE", "avoidance.reserve_s", "s", "begin this long before it must be"),
    _ranged("CA_REL_MARGIN", "avoidance.release_margin", "share", "extra margin to give back"),
    _ranged("CA_REL_TIME", "avoidance.release_after_s", "s", "time clear before giving back"),
    _ranged("CA_HEIGHT_CHG", "avoidance.largest_height_change_m", "m", "largest change of height"),
    _ranged("CA_HEIGHT_MIN", "supervisor.min_height_m", "m", "lowest height above home"),
    GcsParam(
        "CA_HEIGHT_MAX", "engine.max_height_m", "m", 0, 10_000, "highest height above home; 0: none",
        _ZERO_IS_NONE,
    ),
    _ranged("CA_SETTLE", "supervisor.settle_s", "s", "time ready before taking over again"),
    GcsParam(
        "CA_CONTROLS", "avoidance.controls", "", 1, 7, "1 course + 2 speed + 4 height", _CONTROLS
    ),
    _ranged("CA_SPARE_CLIMB", "avoidance.weights.spared_height", "", "cost of a climb, PX4 to 1.16"),
    GcsParam("CA_UNITS", "engine.text_units", "", 0, 1, "units of texts: 0 metric, 1 aviation", _TEXT_UNITS),
)  # fmt: skip
BY_NAME: Mapping[str, GcsParam] = {parameter.name: parameter for parameter in GCS_PARAMETERS}
INDEX: Mapping[str, int] = {parameter.name: index for index, parameter in enumerate(GCS_PARAMETERS)}


def values_changed(config: EngineConfig, configured: EngineConfig) -> dict[str, float]:
    """The settings that differ from the configuration, by name."""
    shown = (
        (parameter.name, parameter.value(config), parameter.value(configured)) for parameter in GCS_PARAMETERS
    )
    return {name: value for name, value, before in shown if value != before}


def with_values(configured: EngineConfig, values: Mapping[str, Any]) -> tuple[EngineConfig, list[str]]:
    """The configuration with these values, and the refused ones, each with a reason."""
    config, waiting, reasons = configured, dict(values), dict.fromkeys(values, "")
    while True:
        # A value may become valid only after another one, as with the reaches of both layers.
        done = []
        for name, value in waiting.items():
            try:
                config = _with_value(config, name, value, configured)
                done.append(name)
            except ValueError as error:
                reasons[name] = str(error)
        if not done:
            return config, [f"{name}: {reasons[name]}" for name in waiting]
        waiting = {name: value for name, value in waiting.items() if name not in done}


def _with_value(config: EngineConfig, name: str, value: Any, configured: EngineConfig) -> EngineConfig:
    parameter = BY_NAME.get(name)
    if parameter is None:
        raise ValueError("unknown")
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < _LARGEST:
        raise ValueError("must be a number")
    try:
        return parameter.put(config, value, configured)
    except ValueError as error:
        raise ValueError(f"{value:g} refused: {error}") from error
