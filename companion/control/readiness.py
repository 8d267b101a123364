"""Whether the aircraft may be taken over, and the reasons why not, in words for the operator."""

from collections.abc import Callable, Iterator

from companion.control.context import hindrances
from companion.control.state_machine import SupervisorParams
from companion.model import Role
from companion.ownship.aircraft import Aircraft


class Readiness:
    """Every condition for a take-over except the conflict.

    `other_avoider` returns the name of the autopilot's own avoidance while that acts, otherwise `None`.
    """

    def __init__(
        self,
        aircraft: Aircraft,
        params: SupervisorParams,
        *,
        position_fresh_s: float,
        other_avoider: Callable[[], str | None],
    ) -> None:
        self.params = params
        self._aircraft = aircraft
        self._position_fresh_s = position_fresh_s
        self._other_avoider = other_avoider

    def hindrances(self, now_s: float, role: Role) -> list[str]:
        """The reasons why the aircraft would not be taken over now, in this role; empty when it would."""
        if role is not Role.FLY:
            return [f"role is {role.name.lower()}"]
        if self._aircraft.adapter is None:
            return ["no autopilot that can be flown is heard"]
        return list(self._of_the_aircraft(now_s))

    def _of_the_aircraft(self, now_s: float) -> Iterator[str]:
        aircraft, params = self._aircraft, self.params
        other = self._other_avoider()
        if aircraft.adapter is not None and aircraft.adapter.cannot_fly is not None:
            yield aircraft.adapter.cannot_fly
        if not aircraft.contact.heard(now_s):
            yield "the autopilot is not heard"
        elif not aircraft.contact.resynchronized:
            yield "its state is not known since we stalled"
        yield from hindrances(aircraft, now_s)
        if now_s - aircraft.kinematics.position_s > self._position_fresh_s:
            yield "its position is old"
        if other is not None and params.beside_other_avoider == "advise":
            yield f"another avoider acts: {other}"
        if aircraft.mode not in params.take_over_from:
            yield f"its mode is {aircraft.mode}, not {' or '.join(params.take_over_from)}"
        if aircraft.flight_state.armed and not aircraft.flying(params.min_height_m):
            yield from self._why_not_flying()
        if not aircraft.landed_state_known(now_s):
            yield "it has not reported yet whether it is landing"
        if aircraft.mission_awaited(now_s):
            yield "its mission is not read yet"
        elif aircraft.may_be_landing():
            yield "it may be landing, its mission is not known"

    def _why_not_flying(self) -> Iterator[str]:
        position, lowest_m = self._aircraft.kinematics.position, self.params.min_height_m
        if position is not None and position.height_above_home_m < lowest_m:
            yield f"it is {position.height_above_home_m:.0f} m above home, below {lowest_m:.0f} m"
        elif not self._aircraft.flight_state.landing:
            yield "it is on the ground, taking off or landing"
