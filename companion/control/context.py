"""May we act on the aircraft now: what control knows on one tick, what ends our control, what may be sent.

The claims are what ends our control, or only keeps us from taking the aircraft: one table, each row of which
looks at what is known now. `check --table` prints it.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import NamedTuple

from companion.autopilots.adapter import Adapter, RefusedValue
from companion.control import suppressed_threats
from companion.control.mode_request import ModeRequest, Progress
from companion.control.rejoin import ControlParams
from companion.control.state_machine import ENTERING, Event, State, StateData, Supervisor, SupervisorParams
from companion.mavlink.dialect import Message
from companion.model import Decision, Guidance, Layer, Role
from companion.output.notice import AnyNotice
from companion.ownship.aircraft import Aircraft

# Messages for the autopilot and notices for the operator, in the order of sending.
Outgoing = list[Message | AnyNotice]
Unheard = Callable[[float], str | None]

# Heartbeats come at least once a second; two may be lost.
_HEARTBEAT_RECENT_S = 3.2


@dataclass(slots=True)
class ControlContext:
    """The aircraft, the state machine, the operator's role and the present decision."""

    aircraft: Aircraft
    supervisor: Supervisor
    params: SupervisorParams
    role: Role
    decision: Decision
    control: ControlParams
    # In words, that the last threat is not heard any more: then nothing is known to be clear.
    unheard: Unheard = lambda _now_s: None

    @property
    def data(self) -> StateData:
        """The data of the present state."""
        return self.supervisor.data

    @property
    def adapter(self) -> Adapter:
        """The adapter of our autopilot; RuntimeError while there is none."""
        adapter = self.aircraft.adapter
        if adapter is None:
            raise RuntimeError("no autopilot: the supervisor must not get here")
        return adapter

    @property
    def prior_mode(self) -> str:
        """Name of the mode in which the aircraft is given back."""
        return self.adapter.mode_name(self.data.prior.mode)

    @property
    def loss_mode(self) -> int | None:
        """The mode that the autopilot enters by itself without our setpoints; `None`: it stays in guided."""
        adapter = self.aircraft.adapter
        mode = None if adapter is None else adapter.setpoint_loss_mode()
        return None if adapter is None or mode == adapter.guided_mode else mode

    @property
    def in_loss_mode(self) -> bool:
        """Whether the autopilot entered the present mode by itself: it reports that as a failsafe."""
        aircraft = self.aircraft
        return aircraft.flight_state.custom_mode == self.loss_mode and aircraft.flight_state.failsafe

    def fell_out(self, request: ModeRequest | None) -> bool:
        """Whether a change of mode began in the mode that the autopilot enters by itself."""
        return request is not None and request.start == self.loss_mode

    @property
    def clear(self) -> bool:
        """Whether nothing has to be avoided: no conflict, or only suppressed ones."""
        if self.decision.layer is Layer.CLEAR:
            return True
        return bool(self.data.suppressed_s) and suppressed_threats.covers(self.data, self.decision)

    @property
    def conflict(self) -> Event:
        """The event of the present conflict."""
        return Event.INNER_CONFLICT if self.decision.layer is Layer.INNER else Event.OUTER_CONFLICT


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
        if chosen and aircraft.flight_state.custom_mode == request.start:
            return True
        return (
            request.progress(aircraft.flight_state.custom_mode, aircraft.contact.heartbeat_s)
            is Progress.OVERRULED
        )
    adapter = aircraft.adapter
    return adapter is None or not adapter.is_guided(aircraft.flight_state.custom_mode)


def _is_redirected(aircraft: Aircraft, data: StateData, _now_s: float) -> bool:
    """Whether someone gave the guided mode another target, as with "fly here"."""
    adapter, target = aircraft.adapter, aircraft.navigation.confirmed_target
    if adapter is None or not adapter.is_guided(aircraft.flight_state.custom_mode):
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
    Claim(
        Event.DISARMED,
        lambda aircraft, *_: not aircraft.flight_state.armed,
        Consequence.HANDS_OFF,
        "it is disarmed",
    ),
    Claim(
        Event.LANDING,
        lambda aircraft, *_: aircraft.flight_state.landing,
        Consequence.HANDS_OFF,
        "it is landing or on the ground",
    ),
    Claim(
        Event.NO_WING,
        lambda aircraft, *_: not aircraft.flight_state.flies_as_wing(aircraft.identity.vehicle_type),
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


def printed_claims() -> str:
    """The table of claims as text, a line for each claim."""
    width = max(len(claim.event) for claim in CLAIMS)
    rows = [("claim", "while the aircraft is ours", "before")]
    rows += [(claim.event, claim.consequence, "advise only" if claim.hindrance else "") for claim in CLAIMS]
    return "\n".join(f"{event:{width}} | {then:26} | {before}".rstrip(" |") for event, then, before in rows)


class Commanding:
    """Turns guidance into the adapter's messages, when they may be sent."""

    def __init__(self, context: ControlContext) -> None:
        self._context = context
        self._refused: list[RefusedValue] = []
        self.commanded: Guidance | None = None  # on this tick, while there is more to fly than straight on

    @property
    def may_fly(self) -> bool:
        """Whether guidance may be sent: we fly, and the heartbeat shows the guided mode."""
        context = self._context
        if not context.supervisor.flying:
            return False
        return context.adapter.is_guided(context.aircraft.flight_state.custom_mode)

    def in_contact(self, now_s: float) -> bool:
        """Whether it is known now who has the aircraft; without contact nothing acts on it."""
        aircraft = self._context.aircraft
        recent = now_s - aircraft.contact.heartbeat_s <= _HEARTBEAT_RECENT_S
        return recent and aircraft.contact.resynchronized and aircraft.contact.in_contact(now_s)

    def messages(
        self, guidance: Guidance | None, now_s: float, *, max_bank_rad: float, urgent: bool
    ) -> list[Message]:
        """The messages of this tick; without `guidance`, those that the state needs.

        `urgent`: a report of a threat was received since the last tick.
        """
        self.commanded = None
        aircraft, supervisor = self._context.aircraft, self._context.supervisor
        adapter, state = aircraft.adapter, supervisor.state
        if adapter is None or not supervisor.holds:
            return []
        level = aircraft.kinematics.command(aircraft.kinematics.guidance(), max_bank_rad=max_bank_rad)
        if level is None:
            return []
        if not self.in_contact(now_s) or now_s < supervisor.data.yields_until_s:
            return []
        if state in ENTERING:
            return adapter.entering(level, now_s)
        guided = adapter.is_guided(aircraft.flight_state.custom_mode)
        if guided and state in (State.RELEASING, State.STOPPING):
            return adapter.leaving(level, now_s)
        guidance = guidance or self._without_conflict()
        if not self.may_fly or guidance is None:
            return []
        self.commanded = None if state is State.RECOVERING else guidance
        messages = adapter.command(replace(level, guidance=guidance), now_s, urgent=urgent)
        self._refused += adapter.refused_values()
        return messages

    def take_refused(self) -> list[RefusedValue]:
        """The values that the autopilot has refused since the last call."""
        refused, self._refused = self._refused, []
        return refused

    def _without_conflict(self) -> Guidance | None:
        """Guidance without a conflict: straight on to recover, or to where the former mode is entered."""
        context, state, rejoin = self._context, self._context.supervisor.state, self._context.data.rejoin
        if state is State.RECOVERING:
            return context.aircraft.kinematics.guidance()
        return rejoin.guidance(context.aircraft) if state is State.RETURNING and rejoin is not None else None
