"""What the parameters of an autopilot say about how it flies, whatever it calls them."""

import math
from dataclasses import dataclass, replace

from sim.dynamics import Airframe

# Whatever the parameters say
_SLOWEST_MPS, _FASTEST_MPS = 5.0, 100.0
_SLOWEST_CLIMB_MPS, _FASTEST_CLIMB_MPS = 0.1, 20.0
_LEAST_BANK_DEG, _MOST_BANK_DEG = 5.0, 80.0


@dataclass(frozen=True, slots=True)
class Limits:
    """As the parameters give them, in SI units but for `bank_deg`; heights are above home."""

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
        """The airframe as far as these limits, kept within reason, let it go."""
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
