"""The parameters of a fake autopilot: real names and types; those of the envelope are really used."""

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass

# MAV_PARAM_TYPE
INT8, INT16, INT32, REAL32 = 2, 4, 6, 9

Row = tuple[str, float, int]  # name, default, type


@dataclass(slots=True)
class Parameter:
    """One parameter with its MAV_PARAM_TYPE and place in the list."""

    name: str
    value: float
    type: int
    index: int


class Parameters:
    """The values by name, in the order in which PARAM_REQUEST_LIST tells them."""

    def __init__(self, table: Sequence[Row], read_only: Collection[str] = ()) -> None:
        """`read_only`: what the vehicle itself counts, and answers to PARAM_SET with the value as it was."""
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
        """The value; KeyError for a name that does not exist."""
        return self._by_name[name].value

    def find(self, name: str) -> Parameter | None:
        """The parameter of that name, if there is one."""
        return self._by_name.get(name)

    def at(self, index: int) -> Parameter | None:
        """The parameter at that place of the list, if there is one."""
        return self._by_name[self._order[index]] if 0 <= index < len(self._order) else None

    def set(self, name: str, value: float) -> Parameter | None:
        """Take a value from outside; returns the parameter as it is now, None for an unknown name.

        Values that are no numbers are refused, integers are rounded as the autopilot does.
        """
        parameter = self.find(name)
        if parameter is not None and math.isfinite(value) and name not in self._read_only:
            parameter.value = float(value if parameter.type == REAL32 else round(value))
        return parameter

    def record(self, name: str, value: float) -> Parameter:
        """Write one of the vehicle's own counts."""
        parameter = self._by_name[name]
        parameter.value = float(value)
        return parameter
