"""What an aircraft states of its accuracy and integrity by ADS-B, spread over several of its messages.

Source: RTCA DO-260B table 2-14 (type codes and NIC), 2.2.3.2.7.2 (operational status); DO-260A and DO-260 for
the versions 1 and 0; DO-260B N.3.2 for the accuracy that type codes of version 0 stand for.
"""

import math
from dataclasses import dataclass
from typing import Final

from companion.sources import accuracy

# Status and velocity are sent every 2.5 s and 0.5 s; what was stated longer ago is not true any more.
_STATED_S: Final = 30.0
# NIC by type code of a position, without supplements; 18 and 22 have none.
_NIC: Final = {
    5: 11, 6: 10, 7: 8, 9: 11, 10: 10, 11: 8, 12: 7, 13: 6, 14: 5, 15: 4, 16: 2, 17: 1, 20: 11, 21: 10,
}  # fmt: skip
# The same with supplements: A and B of version 2 in the air, A and C on the ground; A alone in version 1.
_SUPPLEMENTED_NIC: Final = {
    2: {(11, 1, 1): 9, (16, 1, 1): 3, (7, 1, 0): 9, (8, 1, 1): 7, (8, 1, 0): 6, (8, 0, 1): 6},
    1: {(11, 1, 0): 9, (16, 1, 0): 3, (7, 1, 0): 9},
}
# NACp by type code in version 0, which does not state one.
_NACP_OF_TYPE: Final = {
    5: 11, 6: 10, 7: 8, 8: 7, 9: 11, 10: 10, 11: 8, 12: 7, 13: 6, 14: 5, 15: 4, 16: 1, 17: 1, 20: 11, 21: 10,
}  # fmt: skip


@dataclass(slots=True)
class StatedAccuracy:
    """The newest statements; `None` for what was not stated."""

    version: int = 0
    type_code: int = 0
    nic_a: int = 0
    nic_b: int = 0
    nic_c: int = 0
    nacp: int | None = None
    sil: int | None = None
    nacv: int | None = None
    status_s: float = -math.inf
    velocity_s: float = -math.inf

    def take_status(self, now_s: float, nacp: int, sil: int) -> None:
        """Note what an operational status or a target state says."""
        self.status_s, self.nacp, self.sil = now_s, nacp, sil

    def take_velocity(self, now_s: float, nacv: int) -> None:
        """Note the accuracy in a velocity message."""
        self.velocity_s, self.nacv = now_s, nacv

    def take_type(self, type_code: int, nic_b: int) -> None:
        """Note the type of a position."""
        self.type_code, self.nic_b = type_code, nic_b

    def position_sigma_m(self, now_s: float) -> float | None:
        """The standard deviation of each horizontal axis [m]."""
        return accuracy.position_sigma_m(self._nacp(now_s))

    def altitude_sigma_m(self, now_s: float) -> float | None:
        """The standard deviation of a geometric altitude [m]."""
        return accuracy.altitude_sigma_m(self._nacp(now_s))

    def velocity_sigma_mps(self, now_s: float) -> float | None:
        """The standard deviation of each horizontal axis [m/s]."""
        return accuracy.velocity_sigma_mps(self.nacv) if now_s - self.velocity_s <= _STATED_S else None

    def containment_m(self) -> float | None:
        """The containment radius [m]."""
        return accuracy.containment_m(self.nic)

    def integrity(self, now_s: float) -> int | None:
        """The surveillance integrity level."""
        return self.sil if self._is_status_fresh(now_s) else None

    @property
    def nic(self) -> int | None:
        """The navigation integrity category of the newest position."""
        second = self.nic_c if self.type_code in (7, 8) else self.nic_b
        supplements = (self.type_code, self.nic_a, second if self.version >= 2 else 0)
        supplemented = _SUPPLEMENTED_NIC.get(min(self.version, 2), {})
        return supplemented.get(supplements, _NIC.get(self.type_code))

    def _nacp(self, now_s: float) -> int | None:
        if self._is_status_fresh(now_s):
            return self.nacp
        return _NACP_OF_TYPE.get(self.type_code)

    def _is_status_fresh(self, now_s: float) -> bool:
        return now_s - self.status_s <= _STATED_S
