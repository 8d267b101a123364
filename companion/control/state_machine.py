"""The state machine of who has the aircraft; `companion check --table` prints it.

`TRANSITIONS` maps state and event to the next state; a pair that is not in it changes nothing. `DATA` lists
what each state remembers: all other data is forgotten when the state is entered. What Companion does
depends on the state, on its data and on what is heard now, and on nothing else.
"""

import math
from dataclasses import dataclass, field, fields
from enum import StrEnum
from typing import Annotated, Literal

from annotated_types import Ge, Le, MinLen

from companion.control.mode_request import ModeRequest
from companion.control.rejoin import AnyRejoin
from companion.model import PriorFlightState
from companion.output.persisted_state import PersistedState


class State(StrEnum):
    """What Companion is doing with the aircraft."""

    STANDBY = "standby"  # not to be taken over: on the ground, disarmed, in another mode
    WAITING = "waiting"  # not to be taken over yet: after a refusal, or after it had been abandoned
    MONITOR = "monitor"  # the mission is flown; ready to take over
    ENGAGING = "engaging"  # the guided mode is requested
    OUTER = "outer"  # flying, outer layer
    INNER = "inner"  # flying, inner layer
    RETURNING = "returning"  # flying back to where the former mode belongs: a leg, a circle, a course
    RE_ENTERING = "re-entering"  # the guided mode is requested again, for the controller to recover in it
    RECOVERING = "recovering"  # flying until the autopilot's controller has recovered
    RESYNCHRONISING = "resynchronising"  # after a stall of ours: nothing is sent until its state is known
    RELEASING = "releasing"  # the former mode is requested
    HANDS_OFF = "hands off"  # someone else took the aircraft from us: it is theirs until settled
    SUPPRESSED = "suppressed"  # the pilot resumed the mission while we flew: this conflict is not avoided
    STOPPING = "stopping"  # giving back because the service ends
    STOPPED = "stopped"


class Event(StrEnum):
    """What can happen."""

    READY = "ready"  # may be taken over: armed, airborne, fresh position, allowed mode, role fly, settled
    NOT_READY = "not ready"
    OUTER_CONFLICT = "outer conflict"
    INNER_CONFLICT = "inner conflict"
    CLEAR = "clear"
    FAR = "far"  # clear, but not where the former mode belongs: beside its leg, circle or course
    TAKEN = "taken"  # the autopilot's heartbeat shows its guided mode
    REFUSED = "refused"  # the autopilot refused, or still shows the former mode after a while
    UNKNOWN = "unknown"  # no heartbeat shows the outcome of the request
    LATE = "late"  # the guided mode was entered after the request was given up
    FOUND = "found"  # in the mode that the autopilot enters when Companion is killed or not heard
    ABANDONED = "abandoned"  # taken from us, but left in the guided mode and flown by no one
    INVALID_GUIDED = "setpoint invalid"  # in our guided mode, the controller has no valid setpoint
    INVALID_OUTSIDE = "setpoint invalid outside"  # the same, but no longer in the guided mode
    RECOVERED = "recovered"
    GAP = "gap"  # we did nothing for a while: what is known is of before
    SETTLED = "settled"  # the first heartbeat from after the gap: it still flies as it was commanded
    LOST = "lost"  # own position, or the autopilot
    ADVISE = "advise"  # the operator's role is now advise or off
    RESUME = "resume"  # the operator resumes the mission, whatever the traffic
    GIVEN_BACK = "given back"  # the heartbeat shows the mode in which it is given back
    RECLAIMED = "reclaimed"  # the same, after it had been abandoned
    STOP = "stop"  # the service ends
    STOP_UNATTENDED = "stop unattended"  # the same, and the aircraft may be left in the guided mode by us
    # Someone else has the aircraft:
    MODE_CHANGED = "mode changed"  # not by us: the pilot, the autopilot's own avoidance
    SENT_BACK = "sent back"  # the same, to a mode that may be taken over from
    STICKS = "sticks moved"
    DISARMED = "disarmed"
    LANDING = "landing"
    FAILSAFE = "failsafe"
    FENCE = "fence breached"
    NO_WING = "not in wing flight"
    TARGET = "another target"  # given to the guided mode by someone else
    AMBIGUOUS = "two vehicles"  # with the address of ours
    COMPANION = "another companion"  # avoids too: two that steer would work against each other


FLYING = frozenset({State.OUTER, State.INNER, State.RETURNING, State.RECOVERING})
WATCHING = frozenset({State.STANDBY, State.WAITING, State.MONITOR, State.HANDS_OFF, State.SUPPRESSED})
ENTERING = frozenset({State.ENGAGING, State.RE_ENTERING})
HELD = FLYING | ENTERING | {State.RESYNCHRONISING, State.RELEASING}
# States in which a change of mode is under way.
ASKING = ENTERING | {State.RELEASING, State.STOPPING}
# Each of these makes the aircraft someone else's at once.
OVERRIDES = frozenset(
    {
        Event.MODE_CHANGED,
        Event.STICKS,
        Event.DISARMED,
        Event.LANDING,
        Event.FAILSAFE,
        Event.FENCE,
        Event.NO_WING,
        Event.TARGET,
        Event.AMBIGUOUS,
    }
)
# An aircraft that is found where it was left is given back in spite of these, until they have ceased.
OVERLOOKED_WHEN_FOUND = OVERRIDES - {Event.MODE_CHANGED, Event.STICKS, Event.DISARMED}
# The service may end only after the aircraft is given back: these delay the release and do not end it.
YIELDED_TO = frozenset({Event.STICKS, Event.FAILSAFE, Event.FENCE, Event.NO_WING, Event.AMBIGUOUS})


def _from(states: frozenset[State], event: Event, after: State) -> dict[tuple[State, Event], State]:
    return {(state, event): after for state in states}


TRANSITIONS: dict[tuple[State, Event], State] = {
    **{(state, event): State.HANDS_OFF for state in HELD for event in OVERRIDES},
    **_from(HELD, Event.SENT_BACK, State.SUPPRESSED),
    # When the service ends, the claims of `YIELDED_TO` delay the release: it is the last chance.
    (State.STOPPING, Event.MODE_CHANGED): State.STOPPED,
    (State.STOPPING, Event.TARGET): State.STOPPED,
    (State.STOPPING, Event.FOUND): State.STOPPING,  # the release goes on from the mode that it fell into
    (State.STOPPING, Event.DISARMED): State.STOPPED,
    (State.STOPPING, Event.LANDING): State.STOPPED,
    # It left the guided mode by itself while the link was lost.
    **_from(FLYING | {State.RELEASING}, Event.FOUND, State.RELEASING),
    **_from(FLYING | {State.RELEASING}, Event.INVALID_OUTSIDE, State.RE_ENTERING),
    **_from(FLYING, Event.INVALID_GUIDED, State.RECOVERING),
    # Nothing is performed for the time of a gap, and nothing is sent before its outcome is known.
    **_from(FLYING | ENTERING, Event.GAP, State.RESYNCHRONISING),
    (State.RESYNCHRONISING, Event.SETTLED): State.OUTER,
    (State.RESYNCHRONISING, Event.REFUSED): State.WAITING,
    (State.RESYNCHRONISING, Event.FOUND): State.RELEASING,
    (State.RESYNCHRONISING, Event.INVALID_OUTSIDE): State.RE_ENTERING,
    (State.RESYNCHRONISING, Event.OUTER_CONFLICT): State.ENGAGING,
    (State.RESYNCHRONISING, Event.INNER_CONFLICT): State.ENGAGING,
    (State.RESYNCHRONISING, Event.CLEAR): State.RELEASING,
    (State.RESYNCHRONISING, Event.RESUME): State.RELEASING,
    **_from(FLYING | {State.RESYNCHRONISING}, Event.LOST, State.RELEASING),
    **_from(HELD - {State.RELEASING}, Event.ADVISE, State.RELEASING),
    **_from(HELD - {State.RELEASING}, Event.COMPANION, State.RELEASING),
    **_from(HELD, Event.STOP, State.STOPPING),
    **_from(WATCHING, Event.STOP, State.STOPPED),
    **_from(WATCHING, Event.STOP_UNATTENDED, State.STOPPING),
    **_from(WATCHING - {State.MONITOR}, Event.READY, State.MONITOR),
    **_from(WATCHING - {State.MONITOR}, Event.LATE, State.RELEASING),
    **_from(frozenset({State.STANDBY, State.WAITING}), Event.FOUND, State.RELEASING),
    **_from(
        frozenset({State.STANDBY, State.WAITING, State.MONITOR}), Event.INVALID_OUTSIDE, State.RE_ENTERING
    ),
    (State.MONITOR, Event.NOT_READY): State.STANDBY,
    (State.MONITOR, Event.OUTER_CONFLICT): State.ENGAGING,
    (State.MONITOR, Event.INNER_CONFLICT): State.ENGAGING,
    (State.ENGAGING, Event.TAKEN): State.OUTER,
    **_from(ENTERING, Event.REFUSED, State.WAITING),
    **_from(ENTERING, Event.UNKNOWN, State.RELEASING),
    (State.ENGAGING, Event.CLEAR): State.RELEASING,
    (State.ENGAGING, Event.RESUME): State.RELEASING,
    (State.OUTER, Event.INNER_CONFLICT): State.INNER,
    (State.OUTER, Event.CLEAR): State.RELEASING,
    (State.OUTER, Event.FAR): State.RETURNING,
    (State.OUTER, Event.RESUME): State.RELEASING,
    (State.INNER, Event.OUTER_CONFLICT): State.OUTER,
    (State.INNER, Event.CLEAR): State.RELEASING,
    (State.INNER, Event.FAR): State.RETURNING,
    (State.INNER, Event.RESUME): State.RELEASING,
    (State.RETURNING, Event.OUTER_CONFLICT): State.OUTER,
    (State.RETURNING, Event.INNER_CONFLICT): State.INNER,
    (State.RETURNING, Event.CLEAR): State.RELEASING,
    (State.RETURNING, Event.RESUME): State.RELEASING,
    # With an invalid setpoint the aircraft cannot fly its mission: it is given back only after it recovered.
    (State.RE_ENTERING, Event.TAKEN): State.RECOVERING,
    (State.RECOVERING, Event.RECOVERED): State.OUTER,
    # The autopilot refuses the former mode, and there is traffic.
    (State.RELEASING, Event.OUTER_CONFLICT): State.ENGAGING,
    (State.RELEASING, Event.INNER_CONFLICT): State.ENGAGING,
    (State.RELEASING, Event.GIVEN_BACK): State.MONITOR,
    (State.RELEASING, Event.RECLAIMED): State.WAITING,
    **_from(WATCHING, Event.ABANDONED, State.RELEASING),
    (State.STOPPING, Event.GIVEN_BACK): State.STOPPED,
    (State.STOPPING, Event.RECLAIMED): State.STOPPED,
}


@dataclass(slots=True)
class StateData:
    """Everything that is remembered about who has the aircraft; times in seconds of the engine's clock."""

    # The flight to go back to, and whether it is still flown in the mode that we left it in.
    prior: PriorFlightState = field(default_factory=lambda: PriorFlightState(0))
    left_in_prior_mode: bool = False
    # The state of the plan then (see `Aircraft.plan_changes`).
    plan: int = 0
    # When the guided mode was last requested: the request may still arrive after it was given up.
    requested_s: float = -math.inf
    last_unguided_mode: int = 0
    # Take-overs given up since the last one that succeeded.
    given_up: int = 0
    # Tracks that are not avoided by the operator's decision: when each was last in conflict.
    suppressed_s: dict[str, float] = field(default_factory=dict)
    # The change of mode under way.
    request: ModeRequest | None = None
    # The way back to the mission's leg, or to a circle or a course that the former mode holds.
    rejoin: AnyRejoin | None = None
    # The mission's own airspeed, flown at the take-over, that the autopilot forgets at a mode change.
    mission_airspeed_mps: float | None = None
    # Since when it has been in the guided mode at our request.
    guided_since_s: float | None = None
    # Overrides that were there already when we began: they count only after they have ceased.
    overlooked: frozenset[Event] = frozenset()
    # The last time that the controller had no valid setpoint.
    invalid_s: float = -math.inf
    # It was abandoned and is being given back: a wait follows before the next take-over.
    reclaiming: bool = False
    given_back_s: float = -math.inf
    wait_until_s: float = -math.inf
    ready_since_s: float | None = None
    # Since when it has been in the guided mode and flown by no one.
    unattended_since_s: float | None = None
    # The claim after which we let go, and whether a heartbeat since then has shown the guided mode.
    let_go: Event | None = None
    seen_guided: bool = False
    # It left the guided mode by itself, as our setpoints ended.
    fell_out: bool = False
    # The mode in which it was left, because the former one was refused.
    fallback: int | None = None
    # While it is not ours: since when the heartbeats have not shown the guided mode; `None` while they do.
    left_guided_s: float | None = None
    # Since when they have shown neither that mode nor the one that the autopilot enters from it by itself.
    away_s: float | None = None
    # A claim delays the release until then, when the service ends.
    yields_until_s: float = -math.inf
    # Since when we fly it, without a break.
    flown_since_s: float | None = None
    # The state left by a former run, and since when the aircraft has been heard in this one.
    left_behind: PersistedState | None = None
    left_behind_since_s: float | None = None

    def forget_request(self) -> None:
        """Note that no request for the guided mode is under way any more."""
        self.requested_s = -math.inf

    def forget_item(self) -> None:
        """Do not restore the mission's item any more."""
        self.given_back_s = -math.inf

    def forget(self, kept: frozenset[str]) -> None:
        """Reset every field that is not `kept`."""
        fresh = StateData()
        for one in fields(self):
            if one.name not in kept:
                setattr(self, one.name, getattr(fresh, one.name))


_ALWAYS = frozenset(
    {"prior", "plan", "left_in_prior_mode", "requested_s", "last_unguided_mode", "given_up", "suppressed_s"}
)
_OURS = _ALWAYS | {"rejoin", "mission_airspeed_mps", "guided_since_s", "overlooked", "flown_since_s"}
_LEFT = frozenset({"let_go", "seen_guided", "fell_out", "fallback", "left_guided_s", "away_s"})
_WATCH = _ALWAYS | _LEFT | {"guided_since_s", "unattended_since_s"}
_IDLE = _WATCH | {"given_back_s", "mission_airspeed_mps", "left_behind", "left_behind_since_s"}
DATA: dict[State, frozenset[str]] = {
    State.STANDBY: _IDLE,
    State.WAITING: _IDLE | {"wait_until_s"},
    State.MONITOR: _IDLE,
    State.ENGAGING: _OURS | {"request", "given_back_s"},
    State.OUTER: _OURS,
    State.INNER: _OURS,
    State.RETURNING: _OURS,
    State.RE_ENTERING: _OURS | {"request"},
    State.RECOVERING: _OURS | {"invalid_s"},
    State.RESYNCHRONISING: _OURS | {"request"},
    State.RELEASING: _OURS | {"request", "reclaiming", "wait_until_s"},
    State.HANDS_OFF: _WATCH | {"ready_since_s"},
    State.SUPPRESSED: _WATCH | {"ready_since_s"},
    State.STOPPING: _OURS | {"request", "reclaiming", "yields_until_s"},
    State.STOPPED: _ALWAYS,
}


@dataclass(frozen=True)
class SupervisorParams:
    """When the aircraft may be taken over."""

    # The role at the start; MAVLink parameter CA_ROLE or a command changes it in flight.
    role: Literal["off", "advise", "fly"] = "fly"
    # Names of the autopilot's modes, as ground stations show them.
    take_over_from: Annotated[tuple[str, ...], MinLen(1)] = ("AUTO", "MISSION")
    # Never below this height above home.
    min_height_m: Annotated[float, Ge(10), Le(1000)] = 30.0
    # After someone else took the aircraft, it must be ready for this long before it is taken over again.
    settle_s: Annotated[float, Ge(0), Le(120)] = 5.0
    # Wait after a refusal before the next take-over; it grows with refusals in a row.
    retry_s: Annotated[float, Ge(0), Le(600)] = 2.0
    # The pilot flies when the roll, pitch or yaw stick is further than this from where it was. 0: never.
    stick_us: Annotated[float, Ge(0), Le(500)] = 100.0
    # An aircraft taken from us but left in the guided mode, flown by no one, is given back after this time.
    abandoned_s: Annotated[float, Ge(1), Le(600)] = 5.0
    # Highest role while the autopilot's own avoidance acts too: two that steer would work against each other.
    beside_other_avoider: Literal["advise", "fly"] = "advise"


class Supervisor:
    """The state and its data. `handle` is the only way to change the state."""

    def __init__(self) -> None:
        self.state = State.STANDBY
        self.data = StateData()

    def handle(self, event: Event) -> bool:
        """Apply an event; true when the state changed. Data that the new state does not have is forgotten."""
        after = TRANSITIONS.get((self.state, event), self.state)
        changed = after is not self.state
        if changed:
            self.state = after
            self.data.forget(DATA[after])
        return changed

    def heeds(self, event: Event) -> bool:
        """Whether the event changes anything in this state."""
        return (self.state, event) in TRANSITIONS

    @property
    def holds(self) -> bool:
        """Whether the aircraft is ours, or is being taken over or given back."""
        return self.state in HELD or self.state in ASKING

    @property
    def flying(self) -> bool:
        """Whether setpoints may be sent."""
        return self.state in FLYING


def printed() -> str:
    """The table as text: a line for each event, a column for each state, empty where nothing changes."""
    table = [["", *State]]
    table += [[event, *(TRANSITIONS.get((state, event), "") for state in State)] for event in Event]
    widths = [max(len(row[column]) for row in table) for column in range(len(table[0]))]
    lines = [" | ".join(f"{cell:{width}}" for cell, width in zip(row, widths, strict=True)) for row in table]
    return "\n".join(line.rstrip() for line in lines)


def printed_data() -> str:
    """The data of each state as text: first what every state remembers, then a line for each state."""
    width = max(map(len, State))
    lines = [f"{'every state':{width}} : {', '.join(sorted(_ALWAYS))}"]
    lines += [f"{state:{width}} : {', '.join(sorted(DATA[state] - _ALWAYS))}".rstrip(" :") for state in State]
    return "\n".join(lines)
