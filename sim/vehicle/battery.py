"""The battery: drains with the current that flying takes."""

_FULL_MV, _EMPTY_MV = 12_600.0, 10_500.0
_CAPACITY_MAH = 3300.0
_CRUISE_CA, _TAKEOFF_CA, _IDLE_CA = 1200, 4000, 125


class Battery:
    """One pack; currents in hundredths of an ampere, as messages carry them."""

    def __init__(self) -> None:
        self.consumed_mah = 0.0
        self.current_ca = _IDLE_CA

    @property
    def remaining(self) -> float:
        """What is left, 1 to 0."""
        return max(1.0 - self.consumed_mah / _CAPACITY_MAH, 0.0)

    @property
    def voltage_mv(self) -> int:
        """Falls in proportion."""
        return round(_EMPTY_MV + (_FULL_MV - _EMPTY_MV) * self.remaining)

    def drain(self, seconds: float, *, armed: bool, full_throttle: bool) -> None:
        """Let some time pass."""
        if not armed:
            self.current_ca = _IDLE_CA
        else:
            self.current_ca = _TAKEOFF_CA if full_throttle else _CRUISE_CA
        self.consumed_mah += self.current_ca * 10.0 * seconds / 3600.0
