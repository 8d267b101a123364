"""The state that survives a crash of Companion: whether it flew the aircraft, and the operator's role."""

import json
from dataclasses import asdict, dataclass, field
from typing import Any

from companion.geodesy import GeoPoint
from companion.model import PriorFlightState, Role

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
            role, left_behind = raw["role"], raw["left_behind"]
            return cls(
                float(raw["time_s"]),
                int(raw["system_id"]),
                None if raw["before"] is None else _before(raw["before"]),
                None if role is None else Role(role),
                None if left_behind is None else int(left_behind),
                {str(name): float(value) for name, value in raw["borrowed"].items()},
            )
        except (ValueError, TypeError, KeyError, AttributeError, OverflowError):
            return None

    def is_fresh(self, now_s: float) -> bool:
        """Whether it is recent enough to say who has the aircraft."""
        return 0.0 <= now_s - self.time_s <= LONGEST_S


def _before(raw: Any) -> PriorFlightState:
    """The inverse of `asdict`; raises the errors that `PersistedState.from_text` catches."""
    sequence, target = raw["sequence"], raw["target"]
    return PriorFlightState(
        int(raw["mode"]),
        None if sequence is None else int(sequence),
        None if target is None else GeoPoint(*(float(value) for value in target)),
        float(raw["course_rad"]),
        float(raw["altitude_m"]),
        float(raw["airspeed_mps"]),
    )
