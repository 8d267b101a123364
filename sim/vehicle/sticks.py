"""The pilot's sticks, as the receiver hands them to the autopilot and RC_CHANNELS tells them."""

from dataclasses import dataclass

_CENTRE_US, _HALF_TRAVEL_US, _LOW_US = 1500, 400, 1100
_CHANNELS_TOLD = 18


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
        return moved + switches + [65_535] * (_CHANNELS_TOLD - len(moved) - len(switches))


def _centred_us(deflection: float) -> int:
    return round(_CENTRE_US + _HALF_TRAVEL_US * min(max(deflection, -1.0), 1.0))
