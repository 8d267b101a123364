"""The state that survives a crash of Companion: whether it flew the aircraft, and the operator's role."""

import json
import math
from dataclasses import asdict, dataclass, field
from typing import Any

from companion.geodesy import GeoPoint
from companion.model import PriorFlightState, Role

# What a former run wrote is believed within these limits only.
_LATEST_S = 1e11
_MAX_UINT16, _MAX_UINT32 = 0xFFFF, 0xFFFF_FFFF
_HIGHEST_M = 50_000.0
_FASTEST_MPS = 500.0
_MAX_PARAMETER = 1e6
_MAX_BORROWED, _NAME_LENGTH = 16, 16
# After this time the state is obsolete: the pilot or the autopilot has acted.
LONGEST_S = 20.0


@dataclass(frozen=True)
class PersistedState:
    """State at `time_s` [s, Unix]. `before` is the flight to go back to; `None`: the aircraft was not ours.

    `role` is set when the operator changed it in flight. `left_behind` is the mode that the autopilot enters
    by itself some time after our setpoints end. `borrowed` are parameters to restore, by name.
    """

    time_s: float
    system_id: int
    before: PriorFlightState | None = None
    role: Role | None = None
    left_behind: int | None = None
    borrowed: dict[str, float] = field(default_factory=dict)

    def to_text(self) -> str:
        """One line of JSON."""
        return json.dumps(asdict(self), separators=(",", ":"))

    @classmethod
    def from_text(cls, text: str) -> "PersistedState | None":
        """The state of a former run; `None` when the text is not valid."""
        try:
            raw = json.loads(text)
            role, left_behind, borrowed = raw["role"], raw["left_behind"], raw["borrowed"]
            if len(borrowed) > _MAX_BORROWED or any(len(name) > _NAME_LENGTH for name in borrowed):
                raise ValueError("not what Companion wrote")
            return cls(
                _number(raw["time_s"], 0.0, _LATEST_S),
                _integer(raw["system_id"], 1, 255),
                None if raw["before"] is None else _before(raw["before"]),
                None if role is None else Role(role),
                None if left_behind is None else _integer(left_behind, 0, _MAX_UINT32),
                {name: _number(value, -_MAX_PARAMETER, _MAX_PARAMETER) for name, value in borrowed.items()},
            )
        except (ValueError, TypeError, KeyError, AttributeError, OverflowError, RecursionError):
            return None

    def is_fresh(self, now_s: float) -> bool:
        """Whether it is recent enough to say who has the aircraft."""
        return 0.0 <= now_s - self.time_s <= LONGEST_S


def _before(raw: Any) -> PriorFlightState:
    """The inverse of `asdict`; raises the errors that `PersistedState.from_text` catches."""
    sequence, target = raw["sequence"], raw["target"]
    return PriorFlightState(
        _integer(raw["mode"], 0, _MAX_UINT32),
        None if sequence is None else _integer(sequence, 0, _MAX_UINT16),
        None if target is None else _place(*target),
        _number(raw["course_rad"], -math.tau, math.tau),
        _number(raw["altitude_m"], -_HIGHEST_M, _HIGHEST_M),
        _number(raw["airspeed_mps"], 0.0, _FASTEST_MPS),
    )


def _place(lat_deg: Any, lon_deg: Any, altitude_m: Any) -> GeoPoint:
    return GeoPoint(
        _number(lat_deg, -90.0, 90.0),
        _number(lon_deg, -180.0, 180.0),
        _number(altitude_m, -_HIGHEST_M, _HIGHEST_M),
    )


def _number(value: Any, low: float, high: float) -> float:
    """A number of JSON within these limits; `ValueError` otherwise, also for NaN."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
        raise ValueError("not a number in range")
    return float(value)


def _integer(value: Any, low: int, high: int) -> int:
    """A whole number of JSON within these limits; `ValueError` otherwise."""
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        raise ValueError("not a whole number in range")
    return value
