"""Who may fly, and when: the whole supervisor is the table below.

It knows neither clock nor wire. The engine tells it events, one at a time, and acts on the state it is in.
A pair that is not in the table changes nothing.
"""

from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated

from annotated_types import Ge, Le, MinLen


class State(StrEnum):
    """What the companion is doing with the aircraft."""

    STANDBY = "standby"  # the aircraft is not one to take over: on the ground, disarmed, other mode
    MONITOR = "monitor"  # the mission is flown; ready to take over
    ENGAGING = "engaging"  # asked the autopilot for its guided mode
    OUTER = "outer"  # flying, outer layer
    INNER = "inner"  # flying, inner layer
    RELEASING = "releasing"  # asked the autopilot to take the mission up again
    HANDS_OFF = "hands off"  # somebody else changed the mode while we flew: theirs until settled
    STOPPING = "stopping"  # giving back because the service ends
    STOPPED = "stopped"


class Event(StrEnum):
    """What can happen."""

    READY = "ready"  # armed, airborne, position fresh, in a mode that may be taken over, settled
    NOT_READY = "not ready"
    OUTER_CONFLICT = "outer conflict"
    INNER_CONFLICT = "inner conflict"
    CLEAR = "clear"
    TAKEN = "taken"  # the autopilot's heartbeat shows its guided mode
    REFUSED = "refused"  # it refused, or still shows the former mode after a while
    UNKNOWN = "unknown"  # nothing is heard of what became of the request
    LATE = "late"  # it entered the guided mode after we had given up asking
    LOST = "lost"  # a mode that we did not ask for, or disarmed, or landed
    GIVEN_BACK = "given back"  # the heartbeat shows the mode it was given back to
    STOP = "stop"  # the service is told to end


FLYING = frozenset({State.OUTER, State.INNER})
WATCHING = frozenset({State.STANDBY, State.MONITOR, State.HANDS_OFF})

TRANSITIONS: dict[tuple[State, Event], State] = {
    (State.STANDBY, Event.READY): State.MONITOR,
    (State.STANDBY, Event.LATE): State.RELEASING,
    (State.STANDBY, Event.STOP): State.STOPPED,
    (State.MONITOR, Event.NOT_READY): State.STANDBY,
    (State.MONITOR, Event.OUTER_CONFLICT): State.ENGAGING,
    (State.MONITOR, Event.INNER_CONFLICT): State.ENGAGING,
    (State.MONITOR, Event.STOP): State.STOPPED,
    (State.ENGAGING, Event.TAKEN): State.OUTER,
    (State.ENGAGING, Event.REFUSED): State.STANDBY,
    (State.ENGAGING, Event.UNKNOWN): State.RELEASING,
    (State.ENGAGING, Event.CLEAR): State.RELEASING,
    (State.ENGAGING, Event.LOST): State.HANDS_OFF,
    (State.ENGAGING, Event.STOP): State.STOPPING,
    (State.OUTER, Event.INNER_CONFLICT): State.INNER,
    (State.OUTER, Event.CLEAR): State.RELEASING,
    (State.OUTER, Event.LOST): State.HANDS_OFF,
    (State.OUTER, Event.STOP): State.STOPPING,
    (State.INNER, Event.OUTER_CONFLICT): State.OUTER,
    (State.INNER, Event.CLEAR): State.RELEASING,
    (State.INNER, Event.LOST): State.HANDS_OFF,
    (State.INNER, Event.STOP): State.STOPPING,
    (State.RELEASING, Event.GIVEN_BACK): State.MONITOR,
    (State.RELEASING, Event.OUTER_CONFLICT): State.ENGAGING,
    (State.RELEASING, Event.INNER_CONFLICT): State.ENGAGING,
    (State.RELEASING, Event.LOST): State.HANDS_OFF,
    (State.RELEASING, Event.STOP): State.STOPPING,
    (State.HANDS_OFF, Event.READY): State.MONITOR,
    (State.HANDS_OFF, Event.LATE): State.RELEASING,
    (State.HANDS_OFF, Event.STOP): State.STOPPED,
    (State.STOPPING, Event.GIVEN_BACK): State.STOPPED,
    (State.STOPPING, Event.LOST): State.STOPPED,
}


@dataclass(frozen=True)
class SupervisorParams:
    """When the aircraft may be taken over."""

    # Names of the autopilot's modes, as its ground stations show them.
    take_over_from: Annotated[tuple[str, ...], MinLen(1)] = ("AUTO", "MISSION")
    # Never below this height above home.
    min_height_m: Annotated[float, Ge(0)] = 30.0
    # A mode that somebody chose after we flew is theirs; only after so long in an allowed one we may again.
    settle_s: Annotated[float, Ge(0), Le(600)] = 5.0
    # After a refusal the autopilot is not asked again for so long.
    retry_s: Annotated[float, Ge(0), Le(600)] = 2.0


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
