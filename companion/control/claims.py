"""What ends our control of the aircraft, and what only keeps us from taking it: one table.

Each row looks at what is known now. `check --table` prints the table.
"""

from collections.abc import Callable, Iterable
from enum import StrEnum
from typing import NamedTuple

from companion.control.mode_request import Progress
from companion.control.state_machine import Event, StateData
from companion.ownship.aircraft import Aircraft


class Consequence(StrEnum):
    """What follows while the aircraft is ours, or is being taken over or given back."""

    HANDS_OFF = "hands off"  # it is someone else's from this instant
    GIVEN_BACK = "given back"  # its former mode is requested


class Claim(NamedTuple):
    """A sign that the aircraft is not ours to fly."""

    event: Event
    holds: Callable[[Aircraft, StateData, float], bool]
    consequence: Consequence
    # What the operator reads while it keeps the aircraft from being taken over; "" for a sign that is only
    # looked for while the aircraft is ours.
    hindrance: str


def _is_overruled(aircraft: Aircraft, data: StateData, _now_s: float) -> bool:
    """Whether someone else changed the mode, or chose the one that was entered in a failsafe."""
    request = data.request
    if request is not None:
        chosen = request.in_failsafe and not aircraft.flight_state.failsafe
        if chosen and aircraft.custom_mode == request.start:
            return True
        return request.progress(aircraft.custom_mode, aircraft.heartbeat_s) is Progress.OVERRULED
    return not aircraft.guided


def _is_redirected(aircraft: Aircraft, data: StateData, _now_s: float) -> bool:
    """Whether someone gave the guided mode another target, as with "fly here"."""
    adapter, target = aircraft.adapter, aircraft.navigation.confirmed_target
    if adapter is None or not aircraft.guided:
        return False
    if target is not None and adapter.is_foreign_target(target):
        return True
    if not adapter.keeps_guided_target or (target is not None and adapter.is_own_target(target)):
        return False
    before = data.prior.target if data.prior.mode == adapter.guided_mode else None
    navigation = aircraft.navigation
    return navigation.is_redirected if before is None else navigation.redirected_from(before)


CLAIMS: tuple[Claim, ...] = (
    Claim(
        Event.AMBIGUOUS,
        lambda aircraft, _, now_s: aircraft.identity.is_ambiguous(now_s),
        Consequence.HANDS_OFF,
        "two vehicles have its system id",
    ),
    Claim(Event.DISARMED, lambda aircraft, *_: not aircraft.armed, Consequence.HANDS_OFF, "it is disarmed"),
    Claim(
        Event.LANDING,
        lambda aircraft, *_: aircraft.flight_state.landing,
        Consequence.HANDS_OFF,
        "it is landing or on the ground",
    ),
    Claim(
        Event.NO_WING,
        lambda aircraft, *_: not aircraft.fixed_wing,
        Consequence.HANDS_OFF,
        "it does not fly as a fixed wing",
    ),
    Claim(
        Event.FAILSAFE,
        lambda aircraft, *_: aircraft.flight_state.failsafe,
        Consequence.HANDS_OFF,
        "it is in a failsafe",
    ),
    Claim(
        Event.FENCE,
        lambda aircraft, *_: aircraft.flight_state.fence_breached,
        Consequence.HANDS_OFF,
        "it has breached its fence",
    ),
    Claim(Event.STICKS, lambda aircraft, *_: aircraft.sticks.moved, Consequence.HANDS_OFF, ""),
    Claim(Event.MODE_CHANGED, _is_overruled, Consequence.HANDS_OFF, ""),
    Claim(Event.TARGET, _is_redirected, Consequence.HANDS_OFF, ""),
    Claim(
        Event.COMPANION,
        lambda aircraft, _, now_s: aircraft.identity.other_companion(now_s) is not None,
        Consequence.GIVEN_BACK,
        "another companion avoids too",
    ),
)


# The claims with a hindrance look at the aircraft alone.
_NO_DATA = StateData()


class Claims:
    """Looks for claims while we have the aircraft, or are about to take it or give it back."""

    def __init__(self, aircraft: Aircraft) -> None:
        self._aircraft = aircraft

    def begin(self, data: StateData, overlooked: Iterable[Event] = ()) -> None:
        """Start looking. A claim that is `overlooked` counts only after it has ceased."""
        data.overlooked = frozenset(overlooked)
        self._aircraft.sticks.mark()
        self._aircraft.navigation.forget_guided_target()

    def current(self, data: StateData, now_s: float) -> list[Event]:
        """Every claim that holds now, in the order of the table."""
        present = [claim.event for claim in CLAIMS if claim.holds(self._aircraft, data, now_s)]
        data.overlooked = data.overlooked.intersection(present)
        return [event for event in present if event not in data.overlooked]


def hindrances(aircraft: Aircraft, now_s: float) -> list[str]:
    """The claims that keep the aircraft from being taken over now, in words for the operator."""
    return [claim.hindrance for claim in CLAIMS if claim.hindrance and claim.holds(aircraft, _NO_DATA, now_s)]


def printed() -> str:
    """The table as text, a line for each claim."""
    width = max(len(claim.event) for claim in CLAIMS)
    rows = [("claim", "while the aircraft is ours", "before")]
    rows += [(claim.event, claim.consequence, "advise only" if claim.hindrance else "") for claim in CLAIMS]
    return "\n".join(f"{event:{width}} | {then:26} | {before}".rstrip(" |") for event, then, before in rows)
