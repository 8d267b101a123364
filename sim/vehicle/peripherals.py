"""Equipment beside the autopilot: the battery, and the RC receiver with the pilot's sticks."""

from dataclasses import dataclass

_FULL_MV, _EMPTY_MV = 12_600.0, 10_500.0
_CAPACITY_MAH = 3300.0
_CRUISE_CA, _TAKEOFF_CA, _IDLE_CA = 1200, 4000, 125

_CENTRE_US, _HALF_TRAVEL_US, _LOW_US = 1500, 400, 1100
_REPORTED_CHANNELS = 18


class Battery:
    """One pack; currents in hundredths of an ampere, as in the messages."""

    def __init__(self) -> None:
        self.consumed_mah = 0.0
        self.current_ca = _IDLE_CA

    @property
    def remaining(self) -> float:
        """Remaining charge, 1 to 0."""
        return max(1.0 - self.consumed_mah / _CAPACITY_MAH, 0.0)

    @property
    def voltage_mv(self) -> int:
        """Pack voltage [mV], linear in the remaining charge."""
        return round(_EMPTY_MV + (_FULL_MV - _EMPTY_MV) * self.remaining)

    def drain(self, seconds: float, *, armed: bool, full_throttle: bool) -> None:
        """Draw the present current for some seconds."""
        if not armed:
            self.current_ca = _IDLE_CA
        else:
            self.current_ca = _TAKEOFF_CA if full_throttle else _CRUISE_CA
        self.consumed_mah += self.current_ca * 10.0 * seconds / 3600.0


@dataclass(frozen=True, slots=True)
class Sticks:
    """Deflections, -1 to 1 (throttle 0 to 1); roll positive to the right, pitch positive up."""

    roll: float = 0.0
    pitch: float = 0.0
    throttle: float = 0.0
    yaw: float = 0.0

    @property
    def pulses_us(self) -> list[int]:
        """Channels 1 to 18 of RC_CHANNELS: roll, pitch, throttle, yaw, four switches; 65535 is unused."""
        moved = [
            _centred_us(self.roll),
            _centred_us(self.pitch),
            round(_LOW_US + 2.0 * _HALF_TRAVEL_US * min(max(self.throttle, 0.0), 1.0)),
            _centred_us(self.yaw),
        ]
        switches = [_LOW_US] * 4
        return moved + switches + [65_535] * (_REPORTED_CHANNELS - len(moved) - len(switches))


def _centred_us(deflection: float) -> int:
    return round(_CENTRE_US + _HALF_TRAVEL_US * min(max(deflection, -1.0), 1.0))
