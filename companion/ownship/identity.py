"""Which autopilot is ours: the configured one, or the only one that is heard."""

import math

from companion.autopilots import Adapter, choose
from companion.mavlink.dialect import mavlink
from companion.mavlink.facts import Heartbeat, Sender

# Aeroplanes, and those VTOLs that fly like one.
_FIXED_WINGS = frozenset({mavlink.MAV_TYPE_FIXED_WING, *range(19, 26)})


class Identity:
    """Adopts one autopilot and keeps it.

    `autopilot` is a MAV_AUTOPILOT. If it or `system_id` is given, no other autopilot is adopted. Without
    `system_id` the adoption waits `adopt_after_s`, and none is adopted while several are heard.
    """

    def __init__(self, system_id: int | None, autopilot: int | None, adopt_after_s: float) -> None:
        self._wanted_system_id = system_id
        self._wanted_autopilot = autopilot
        self._adopt_after_s = adopt_after_s
        self._first_heard_s: float | None = None
        self.adapter: Adapter | None = None
        self.adopted_s = -math.inf
        self.fixed_wing = False
        self.version: str | None = None
        self.others: set[int] = set()  # systems with another autopilot that could be ours
        self.unwanted_since_s: dict[int, float] = {}  # systems whose autopilot is not the configured one

    @property
    def sender(self) -> Sender | None:
        """The address of our autopilot."""
        return None if self.adapter is None else self.adapter.target

    def expect(self, system_id: int) -> None:
        """Adopt the autopilot of this system without waiting, unless another system is configured."""
        if self._wanted_system_id is None:
            self._wanted_system_id = system_id

    def is_ours(self, fact: Heartbeat, now_s: float) -> bool:
        """Whether the heartbeat comes from our autopilot; may adopt the sender."""
        if fact.autopilot == mavlink.MAV_AUTOPILOT_INVALID:
            return False
        if self.adapter is None:
            self._consider(fact, now_s)
        if fact.sender == self.sender:
            return True
        if self._is_wanted(fact):
            self.others.add(fact.sender.system_id)
        else:
            self.unwanted_since_s.setdefault(fact.sender.system_id, now_s)
        return False

    def _is_wanted(self, fact: Heartbeat) -> bool:
        return self._wanted_system_id in (None, fact.sender.system_id) and self._wanted_autopilot in (
            None,
            fact.autopilot,
        )

    def _consider(self, fact: Heartbeat, now_s: float) -> None:
        """Adopt the sender, unless another one is configured or several are heard."""
        if not self._is_wanted(fact):
            return
        if self._first_heard_s is None:
            self._first_heard_s = now_s
        waited = now_s - self._first_heard_s >= self._adopt_after_s
        alone = not self.others - {fact.sender.system_id}
        if self._wanted_system_id is None and not (waited and alone):
            return
        self.adapter = choose(fact.autopilot, fact.sender)
        self.adopted_s = now_s
        self.fixed_wing = fact.vehicle_type in _FIXED_WINGS
        self.others.discard(fact.sender.system_id)
