"""The parameters of the fake ArduPlane: real names and types; those of the envelope are really used."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

# MAV_PARAM_TYPE
_INT8, _INT16, _INT32, _REAL32 = 2, 4, 6, 9


@dataclass(slots=True)
class Parameter:
    """One parameter with its MAV_PARAM_TYPE and place in the list."""

    name: str
    value: float
    type: int
    index: int


# name, default, type
_TABLE: tuple[tuple[str, float, int], ...] = (
    ("ADSB_ICAO_ID", 0, _INT32),
    ("ADSB_LIST_MAX", 25, _INT16),
    ("ADSB_LIST_RADIUS", 10_000, _INT16),
    ("ADSB_TYPE", 1, _INT8),
    ("AIRSPEED_CRUISE", 22, _REAL32),
    ("AIRSPEED_MAX", 30, _INT16),
    ("AIRSPEED_MIN", 10, _INT16),
    ("AVD_ENABLE", 0, _INT8),
    ("AVD_F_ACTION", 1, _INT8),
    ("FENCE_ENABLE", 0, _REAL32),
    ("FS_GCS_ENABL", 0, _INT8),
    ("FS_LONG_TIMEOUT", 5, _REAL32),
    ("MIS_TOTAL", 0, _INT16),
    ("ROLL_LIMIT_DEG", 45, _REAL32),
    ("RTL_ALTITUDE", 100, _REAL32),
    ("RTL_AUTOLAND", 0, _INT8),
    ("SERIAL0_PROTOCOL", 2, _INT8),
    ("STAT_RUNTIME", 0, _INT32),
    ("SYSID_THISMAV", 1, _INT16),
    ("TECS_CLMB_MAX", 5, _REAL32),
    ("TECS_SINK_MAX", 5, _REAL32),
    ("TKOFF_ALT", 50, _REAL32),
    ("WP_LOITER_RAD", 60, _INT16),
    ("WP_RADIUS", 90, _INT16),
)
# What the vehicle itself counts: a PARAM_SET on these is answered with the value as it was.
_READ_ONLY = frozenset({"MIS_TOTAL", "STAT_RUNTIME", "SYSID_THISMAV"})


class Parameters:
    """The values by name, in the order in which PARAM_REQUEST_LIST tells them."""

    def __init__(self) -> None:
        self._by_name = {
            name: Parameter(name, float(value), kind, index)
            for index, (name, value, kind) in enumerate(_TABLE)
        }
        self._order = list(self._by_name)

    def __len__(self) -> int:
        return len(self._order)

    def __iter__(self) -> Iterator[Parameter]:
        return iter(self._by_name.values())

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
        if parameter is not None and math.isfinite(value) and name not in _READ_ONLY:
            parameter.value = float(value if parameter.type == _REAL32 else round(value))
        return parameter

    def record(self, name: str, value: float) -> Parameter:
        """Write one of the vehicle's own counts."""
        parameter = self._by_name[name]
        parameter.value = float(value)
        return parameter
