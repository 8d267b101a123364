"""What must survive a crash of the companion: that it had the aircraft, and from what it had taken it."""

import json
from dataclasses import asdict, dataclass, field

from companion.autopilots.adapter import Before
from companion.geodesy import GeoPoint

# Longer ago than this, whoever is responsible has decided otherwise.
LONGEST_S = 20.0


@dataclass(frozen=True)
class Held:
    """The aircraft was ours at `time_s` [s, Unix]. `borrowed` are parameters to put back, by name."""

    time_s: float
    system_id: int
    before: Before
    borrowed: dict[str, float] = field(default_factory=dict)

    def to_text(self) -> str:
        """One line of JSON."""
        return json.dumps(asdict(self), separators=(",", ":"))

    @classmethod
    def from_text(cls, text: str) -> "Held | None":
        """What a former run left; `None` when it is nothing that can be used."""
        try:
            raw = json.loads(text)
            before, borrowed = raw["before"], raw["borrowed"]
            target = before["target"]
            return cls(
                float(raw["time_s"]),
                int(raw["system_id"]),
                Before(
                    int(before["mode"]),
                    None if before["sequence"] is None else int(before["sequence"]),
                    None if target is None else GeoPoint(*(float(target[k]) for k in _GEO)),
                    float(before["course_rad"]),
                    float(before["altitude_m"]),
                    float(before["airspeed_mps"]),
                ),
                {str(name): float(value) for name, value in borrowed.items()},
            )
        except (ValueError, TypeError, KeyError, AttributeError):
            return None

    def is_fresh(self, now_s: float) -> bool:
        """Whether it still says something of who has the aircraft."""
        return 0.0 <= now_s - self.time_s <= LONGEST_S


_GEO = ("lat_deg", "lon_deg", "altitude_m")
