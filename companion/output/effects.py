"""Effects: what the engine wants done. The shell does them; nothing in the engine touches the world.

What is written is made into text when it is asked for: a flight of a campaign writes nothing.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

from companion.mavlink.dialect import Message
from companion.mavlink.facts import Sender
from companion.model import Decision, Ownship, Track
from companion.output.decision_record import Circumstances, decision_line
from companion.output.persisted_state import PersistedState


class Transmit(NamedTuple):
    """Send a message, from this address, to all links."""

    sender: Sender
    message: Message


class Record(NamedTuple):
    """Keep `line`, one decision as JSON: made at `time_s`, among these tracks."""

    time_s: float
    decision: Decision
    own: Ownship
    tracks: tuple[Track, ...]
    around: Circumstances

    @property
    def line(self) -> str:
        """One line, without the newline; the same every time."""
        return decision_line(self.time_s, self.decision, self.own, self.tracks, self.around)


@dataclass(frozen=True, slots=True)
class Say:
    """Tell whoever reads the log of the service."""

    severity: int
    text: str


@dataclass(frozen=True, slots=True)
class Keep:
    """Keep `text` for the next run, in place of what was kept before; `None`: nothing needs to be known."""

    held: PersistedState | None

    @property
    def text(self) -> str | None:
        """One line of JSON; the same every time."""
        return None if self.held is None else self.held.to_text()


@dataclass(frozen=True, slots=True)
class Save:
    """Keep the settings that differ from the configuration, by name, for every run from now on."""

    values: Mapping[str, float]

    @property
    def text(self) -> str | None:
        """JSON, a line for each; `None` when none differs."""
        return json.dumps(self.values, indent=1) + "\n" if self.values else None


Effect = Transmit | Record | Say | Keep | Save
