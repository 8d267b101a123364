"""Who may fly, and when: the whole supervisor is the table below; `companion check CONFIG --table` prints it.

It knows neither clock nor wire. The engine tells it events, one at a time, and acts on the state it is in.
A pair that is not in the table changes nothing.
"""

from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated, Literal

from annotated_types import Ge, Le, MinLen


class State(StrEnum):
    """What the companion is doing with the aircraft."""

    STANDBY = "standby"  # the aircraft is not one to take over: on the ground, disarmed, in another mode
    MONITOR = "monitor"  # the mission is flown; ready to take over
    ENGAGING = "engaging"  # asked the autopilot for its guided mode
    OUTER = "outer"  # flying, outer layer
    INNER = "inner"  # flying, inner layer
    RETURNING = "returning"  # flying back to where the former mode belongs: a circle, a course
    RELEASING = "releasing"  # asked the autopilot to take the mission up again
    HANDS_OFF = "hands off"  # somebody else took the aircraft while we had it: theirs until settled
    STOPPING = "stopping"  # giving back because the service ends
    STOPPED = "stopped"


class Event(StrEnum):
    """What can happen."""

    READY = "ready"  # armed, airborne, position fresh, in a mode that may be taken over, settled, told to fly
    NOT_READY = "not ready"
    OUTER_CONFLICT = "outer conflict"
    INNER_CONFLICT = "inner conflict"
    CLEAR = "clear"
    FAR = "far"  # clear, but not where the former mode belongs
    TAKEN = "taken"  # the autopilot's heartbeat shows its guided mode
    REFUSED = "refused"  # it refused, or still shows the former mode after a while
    UNKNOWN = "unknown"  # nothing is heard of what became of the request
    LATE = "late"  # it entered the guided mode after we had given up asking
    FOUND = "found"  # it is where it goes when a companion is killed, or not heard for a while
    POISONED = "poisoned"  # its controller has lost itself by our doing: flown until it has recovered
    ABANDONED = "abandoned"  # taken from us, but left in the guided mode with nobody flying it
    ADVISE = "advise"  # told in flight to advise only, or to be off
    RESUME = "resume"  # told to resume the mission now, whatever the traffic
    GIVEN_BACK = "given back"  # the heartbeat shows the mode it was given back to
    STOP = "stop"  # the service is told to end
    # Somebody else has the aircraft:
    MODE_CHANGED = "mode changed"  # one that we did not ask for: the pilot's, the autopilot's own avoidance
    STICKS = "sticks moved"
    DISARMED = "disarmed"
    LANDING = "landing"
    FAILSAFE = "failsafe"
    FENCE = "fence breached"


FLYING = frozenset({State.OUTER, State.INNER, State.RETURNING})
WATCHING = frozenset({State.STANDBY, State.MONITOR, State.HANDS_OFF})
HELD = FLYING | {State.ENGAGING, State.RELEASING}
TAKEN_AWAY = frozenset(
    {Event.MODE_CHANGED, Event.STICKS, Event.DISARMED, Event.LANDING, Event.FAILSAFE, Event.FENCE}
)

TRANSITIONS: dict[tuple[State, Event], State] = {
    **{(state, event): State.HANDS_OFF for state in HELD for event in TAKEN_AWAY},
    # Giving back goes on whatever the sticks and the failsafes say: there is no later.
    (State.STOPPING, Event.MODE_CHANGED): State.STOPPED,
    (State.STOPPING, Event.DISARMED): State.STOPPED,
    (State.STOPPING, Event.LANDING): State.STOPPED,
    # It fell out of the guided mode while the link was gone.
    **{(state, Event.FOUND): State.RELEASING for state in FLYING | {State.RELEASING}},
    **{(state, Event.POISONED): State.ENGAGING for state in FLYING | {State.RELEASING}},
    (State.STANDBY, Event.READY): State.MONITOR,
    (State.STANDBY, Event.LATE): State.RELEASING,
    (State.STANDBY, Event.FOUND): State.RELEASING,
    (State.STANDBY, Event.POISONED): State.ENGAGING,
    (State.STANDBY, Event.STOP): State.STOPPED,
    (State.MONITOR, Event.NOT_READY): State.STANDBY,
    (State.MONITOR, Event.OUTER_CONFLICT): State.ENGAGING,
    (State.MONITOR, Event.INNER_CONFLICT): State.ENGAGING,
    (State.MONITOR, Event.POISONED): State.ENGAGING,
    (State.MONITOR, Event.STOP): State.STOPPED,
    (State.ENGAGING, Event.TAKEN): State.OUTER,
    (State.ENGAGING, Event.REFUSED): State.STANDBY,
    (State.ENGAGING, Event.UNKNOWN): State.RELEASING,
    (State.ENGAGING, Event.CLEAR): State.RELEASING,
    (State.ENGAGING, Event.ADVISE): State.RELEASING,
    (State.ENGAGING, Event.RESUME): State.RELEASING,
    (State.ENGAGING, Event.STOP): State.STOPPING,
    (State.OUTER, Event.INNER_CONFLICT): State.INNER,
    (State.OUTER, Event.CLEAR): State.RELEASING,
    (State.OUTER, Event.FAR): State.RETURNING,
    (State.OUTER, Event.ADVISE): State.RELEASING,
    (State.OUTER, Event.RESUME): State.RELEASING,
    (State.OUTER, Event.STOP): State.STOPPING,
    (State.INNER, Event.OUTER_CONFLICT): State.OUTER,
    (State.INNER, Event.CLEAR): State.RELEASING,
    (State.INNER, Event.FAR): State.RETURNING,
    (State.INNER, Event.ADVISE): State.RELEASING,
    (State.INNER, Event.RESUME): State.RELEASING,
    (State.INNER, Event.STOP): State.STOPPING,
    (State.RETURNING, Event.OUTER_CONFLICT): State.OUTER,
    (State.RETURNING, Event.INNER_CONFLICT): State.INNER,
    (State.RETURNING, Event.CLEAR): State.RELEASING,
    (State.RETURNING, Event.ADVISE): State.RELEASING,
    (State.RETURNING, Event.RESUME): State.RELEASING,
    (State.RETURNING, Event.STOP): State.STOPPING,
    (State.RELEASING, Event.GIVEN_BACK): State.MONITOR,
    (State.RELEASING, Event.OUTER_CONFLICT): State.ENGAGING,
    (State.RELEASING, Event.INNER_CONFLICT): State.ENGAGING,
    (State.RELEASING, Event.STOP): State.STOPPING,
    (State.HANDS_OFF, Event.READY): State.MONITOR,
    (State.HANDS_OFF, Event.LATE): State.RELEASING,
    (State.HANDS_OFF, Event.ABANDONED): State.RELEASING,
    (State.HANDS_OFF, Event.STOP): State.STOPPED,
    (State.STOPPING, Event.GIVEN_BACK): State.STOPPED,
}


@dataclass(frozen=True)
class SupervisorParams:
    """When the aircraft may be taken over."""

    # What to begin with; MAVLink parameter CA_ROLE or a command changes it in flight.
    role: Literal["off", "advise", "fly"] = "fly"
    # Names of the autopilot's modes, as its ground stations show them.
    take_over_from: Annotated[tuple[str, ...], MinLen(1)] = ("AUTO", "MISSION")
    # Never below this height above home.
    min_height_m: Annotated[float, Ge(0)] = 30.0
    # A mode that somebody chose after we flew is theirs; only after so long in an allowed one we may again.
    settle_s: Annotated[float, Ge(0), Le(600)] = 5.0
    # After a refusal the autopilot is not asked again for so long.
    retry_s: Annotated[float, Ge(0), Le(600)] = 2.0
    # Roll, pitch or yaw stick further than this from where it was at take-over: the pilot flies. 0: never.
    stick_us: Annotated[float, Ge(0), Le(500)] = 100.0
    # Taken from us but left in the guided mode, where it would fly on for ever: given back after so long.
    abandoned_s: Annotated[float, Ge(1), Le(600)] = 5.0
    # The autopilot's own avoidance acts too: two that steer fight, so that by default we only advise.
    beside_other_avoider: Literal["advise", "fly"] = "advise"


class Supervisor:
    """The state, and the only way to change it."""

    def __init__(self) -> None:
        self.state = State.STANDBY

    def handle(self, event: Event) -> bool:
        """Apply an event; true when the state changed."""
        after = TRANSITIONS.get((self.state, event), self.state)
        changed = after is not self.state
        self.state = after
        return changed

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
