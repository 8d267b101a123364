"""Whether the aircraft is one to take over, and if not, why: in words that an operator understands."""

from collections.abc import Callable, Iterator

from companion.gcs.requests import GcsRequests
from companion.gcs.settings import Settings
from companion.model import Role
from companion.ownship.aircraft import Aircraft


class Readiness:
    """Everything that must be so before the aircraft may be taken over.

    `other_avoider` names another avoidance that acts in the autopilot, if one is known to.
    """

    def __init__(
        self,
        aircraft: Aircraft,
        settings: Settings,
        operator: GcsRequests,
        *,
        position_fresh_s: float,
        other_avoider: Callable[[], str | None],
    ) -> None:
        self._aircraft = aircraft
        self._settings = settings
        self._operator = operator
        self._position_fresh_s = position_fresh_s
        self._other_avoider = other_avoider

    def hindrances(self, now_s: float, *, role: Role | None = None) -> list[str]:
        """Why the aircraft would not be taken over now (were the role `role`); empty when it would."""
        role = self._operator.role if role is None else role
        if role is not Role.FLY:
            return [f"told to {'advise only' if role is Role.ADVISE else 'be off'}"]
        if self._aircraft.adapter is None:
            return ["no autopilot that can be flown is heard"]
        return list(self._of_the_aircraft(now_s))

    def _of_the_aircraft(self, now_s: float) -> Iterator[str]:
        """What speaks against it, once the operator says fly; asked at every tick, so told only where so."""
        aircraft, rules = self._aircraft, self._settings.supervisor
        other = self._other_avoider()
        if not aircraft.fixed_wing:
            yield "it is no fixed wing"
        if not aircraft.heard(now_s):
            yield "the autopilot is not heard"
        if now_s - aircraft.position_s > self._position_fresh_s:
            yield "its position is old"
        if other is not None and rules.beside_other_avoider == "advise":
            yield f"another avoider acts: {other}"
        if aircraft.mode not in rules.take_over_from:
            yield f"its mode is {aircraft.mode}, not {' or '.join(rules.take_over_from)}"
        if not aircraft.armed:
            yield "it is disarmed"
        elif not aircraft.flying(rules.min_height_m):
            yield self._why_not_flying()
        if not aircraft.known(now_s):
            yield "it has not said yet whether it is landing"
        if aircraft.failsafe:
            yield "it is in a failsafe"
        if aircraft.fence_breached:
            yield "it has breached its fence"

    def _why_not_flying(self) -> str:
        """What keeps an armed aircraft from flying, where anything does."""
        position, least_m = self._aircraft.position, self._settings.supervisor.min_height_m
        if position is None or position.height_above_home_m >= least_m:
            return "it is on the ground, taking off or landing"
        return f"it is {position.height_above_home_m:.0f} m above home, below {least_m:.0f} m"
