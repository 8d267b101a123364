"""The parameters of a fake autopilot, with real names and types, and the flight limits that they set."""

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace

from sim.dynamics import Airframe

# MAV_PARAM_TYPE
INT8, INT16, INT32, REAL32 = 2, 4, 6, 9

Row = tuple[str, float, int]  # name, default, type

# Bounds of what parameters can set; wider values are clamped.
_SLOWEST_MPS, _FASTEST_MPS = 5.0, 100.0
_SLOWEST_CLIMB_MPS, _FASTEST_CLIMB_MPS = 0.1, 20.0
_LEAST_BANK_DEG, _MOST_BANK_DEG = 5.0, 80.0


@dataclass(slots=True)
class Parameter:
    """One parameter with its MAV_PARAM_TYPE and its index in the list."""

    name: str
    value: float
    type: int
    index: int


class Parameters:
    """The values by name, in the order of the answer to PARAM_REQUEST_LIST."""

    def __init__(self, table: Sequence[Row], read_only: Collection[str] = ()) -> None:
        """`read_only`: counters of the vehicle; PARAM_SET does not change them."""
        self._by_name = {
            name: Parameter(name, float(value), kind, index)
            for index, (name, value, kind) in enumerate(table)
        }
        self._order = list(self._by_name)
        self._read_only = frozenset(read_only)

    def __len__(self) -> int:
        return len(self._order)

    def __iter__(self) -> Iterator[Parameter]:
        return iter(self._by_name.values())

    def __contains__(self, name: str) -> bool:
        return name in self._by_name

    def __getitem__(self, name: str) -> float:
        """The value; KeyError for an unknown name."""
        return self._by_name[name].value

    def find(self, name: str) -> Parameter | None:
        """The parameter of that name, None for an unknown name."""
        return self._by_name.get(name)

    def at(self, index: int) -> Parameter | None:
        """The parameter at that index of the list, None outside the list."""
        return self._by_name[self._order[index]] if 0 <= index < len(self._order) else None

    def set(self, name: str, value: float) -> Parameter | None:
        """Apply PARAM_SET; returns the parameter as it is afterwards, None for an unknown name.

        Values that are not finite are refused; integer parameters are rounded, as in the autopilot.
        """
        parameter = self.find(name)
        if parameter is not None and math.isfinite(value) and name not in self._read_only:
            parameter.value = float(value if parameter.type == REAL32 else round(value))
        return parameter

    def record(self, name: str, value: float) -> Parameter:
        """Write a value from inside the vehicle, read-only ones too."""
        parameter = self._by_name[name]
        parameter.value = float(value)
        return parameter


@dataclass(frozen=True, slots=True)
class Limits:
    """Flight limits as the parameters give them, in SI units except `bank_deg`; heights are above home."""

    airspeed_min_mps: float
    airspeed_cruise_mps: float
    airspeed_max_mps: float
    bank_deg: float
    climb_mps: float
    sink_mps: float
    loiter_radius_m: float
    turn_radius_m: float
    rtl_height_m: float
    takeoff_height_m: float

    def bound(self, airframe: Airframe) -> Airframe:
        """The airframe restricted to these limits, which are clamped to sane ranges first."""
        return replace(
            airframe,
            bank_limit_rad=math.radians(_within(self.bank_deg, _LEAST_BANK_DEG, _MOST_BANK_DEG)),
            airspeed_min_mps=_within(self.airspeed_min_mps, _SLOWEST_MPS, _FASTEST_MPS),
            airspeed_max_mps=_within(self.airspeed_max_mps, _SLOWEST_MPS, _FASTEST_MPS),
            climb_limit_mps=_within(self.climb_mps, _SLOWEST_CLIMB_MPS, _FASTEST_CLIMB_MPS),
            sink_limit_mps=_within(self.sink_mps, _SLOWEST_CLIMB_MPS, _FASTEST_CLIMB_MPS),
        )


def _within(value: float, lowest: float, highest: float) -> float:
    return min(max(value, lowest), highest)
