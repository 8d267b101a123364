"""The envelope of the aircraft: its controls (paper §3.2), and the limits that every row keeps (§3.2.3)."""

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated

from annotated_types import Ge, Gt, Le, Lt

from companion.units import STANDARD_GRAVITY_MPS2


class Control(StrEnum):
    """A quantity that an avoidance can change."""

    HEADING = "heading"
    SPEED = "speed"
    HEIGHT = "height"


ALL_CONTROLS = frozenset(Control)


class Pace(StrEnum):
    """A choice of airspeed."""

    KEEP = "keep"  # the mission's
    SLOWEST = "slowest"
    FASTEST = "fastest"


@dataclass(frozen=True)
class Envelope:
    """Limits and response of the aircraft. The defaults suit a small fixed wing of 20-25 m/s."""

    min_airspeed_mps: Annotated[float, Gt(0), Le(200)] = 16.0
    max_airspeed_mps: Annotated[float, Gt(0), Le(200)] = 28.0
    max_bank_rad: Annotated[float, Gt(0), Lt(math.radians(80))] = math.radians(30.0)
    max_turn_rate_radps: Annotated[float, Gt(0), Le(math.radians(90))] = math.radians(20.0)
    max_climb_mps: Annotated[float, Gt(0), Le(50)] = 2.5
    max_sink_mps: Annotated[float, Gt(0), Le(50)] = 2.5
    # Time from a command to the turn or climb that it causes. ArduPlane turned 77 degrees in 9.5 s at a bank
    # of 27 degrees, which a delay of one second and then the full rate describe well.
    response_s: Annotated[float, Ge(0), Le(10)] = 1.0
    max_acceleration_mps2: Annotated[float, Gt(0), Le(20)] = 1.0
    # Heights above the zero of the local frame that no row may leave; `None`: no limit.
    min_altitude_m: float | None = None
    max_altitude_m: float | None = None

    def __post_init__(self) -> None:
        if self.min_airspeed_mps > self.max_airspeed_mps:
            raise ValueError("min_airspeed_mps must not exceed max_airspeed_mps")
        if (
            self.min_altitude_m is not None
            and self.max_altitude_m is not None
            and self.min_altitude_m > self.max_altitude_m
        ):
            raise ValueError("min_altitude_m must not exceed max_altitude_m")

    @property
    def turn_acceleration_mps2(self) -> float:
        """Lateral acceleration of a coordinated turn at the bank limit: g tan(bank)."""
        return STANDARD_GRAVITY_MPS2 * math.tan(self.max_bank_rad)

    def turn_rate_radps(self, airspeed_mps: float) -> float:
        """Turn rate of a coordinated turn at the bank limit, g tan(bank) / V, within the rate limit."""
        return min(self.turn_acceleration_mps2 / max(airspeed_mps, 1.0), self.max_turn_rate_radps)

    def clamp_airspeed_mps(self, airspeed_mps: float) -> float:
        """The nearest airspeed that can be flown."""
        return min(max(airspeed_mps, self.min_airspeed_mps), self.max_airspeed_mps)

    def airspeed_mps(self, pace: Pace, wanted_mps: float) -> float:
        """The airspeed of a pace, within the limits; `wanted_mps` is that of `Pace.KEEP`."""
        if pace is Pace.KEEP:
            return self.clamp_airspeed_mps(wanted_mps)
        return self.min_airspeed_mps if pace is Pace.SLOWEST else self.max_airspeed_mps

    def clamp_altitude_m(self, altitude_m: float) -> float:
        """The nearest height between floor and ceiling."""
        if self.max_altitude_m is not None:
            altitude_m = min(altitude_m, self.max_altitude_m)
        if self.min_altitude_m is not None:
            altitude_m = max(altitude_m, self.min_altitude_m)
        return altitude_m
