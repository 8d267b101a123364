"""Effects: what the shell is to do. The engine itself does no input or output.

Text is formatted only when it is read, as a campaign writes none.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, NamedTuple

from companion.mavlink.dialect import Message
from companion.mavlink.facts import Sender
from companion.model import Decision, Ownship, Track
from companion.output.decision_record import Circumstances, decision_line
from companion.output.persisted_state import PersistedState

Place = Literal["all", "autopilot", "station"]
"""All links, those on which our autopilot is heard, or the others."""


class Transmit(NamedTuple):
    """Send a message from this address to these links."""

    sender: Sender
    message: Message
    to: Place = "all"


class Record(NamedTuple):
    """Record `line`, one decision as JSON: made at `time_s` from these tracks."""

    time_s: float
    decision: Decision
    own: Ownship
    tracks: tuple[Track, ...]
    around: Circumstances

    @property
    def line(self) -> str:
        """One line without the newline."""
        return decision_line(self.time_s, self.decision, self.own, self.tracks, self.around)


@dataclass(frozen=True, slots=True)
class Say:
    """Write to the log of the service."""

    severity: int
    text: str


@dataclass(frozen=True, slots=True)
class Keep:
    """Replace the state saved for the next run by `text`; `None` removes it."""

    state: PersistedState | None

    @property
    def text(self) -> str | None:
        """One line of JSON, or `None`."""
        return None if self.state is None else self.state.to_text()


@dataclass(frozen=True, slots=True)
class Save:
    """Save the settings that differ from the configuration, by name, for all later runs."""

    values: Mapping[str, float]

    @property
    def text(self) -> str | None:
        """JSON with a line for each setting; `None` when none differs."""
        return json.dumps(self.values, indent=1) + "\n" if self.values else None


Effect = Transmit | Record | Say | Keep | Save
