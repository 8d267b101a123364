"""Effects: what the engine wants done. The shell does them; nothing in the engine touches the world."""

from dataclasses import dataclass

from companion.mavlink.dialect import Message
from companion.mavlink.facts import Sender


@dataclass(frozen=True, slots=True)
class Transmit:
    """Send a message, from this address, to all links."""

    sender: Sender
    message: Message


@dataclass(frozen=True, slots=True)
class Record:
    """Keep this line: one decision as JSON."""

    line: str


@dataclass(frozen=True, slots=True)
class Say:
    """Tell whoever reads the log of the service."""

    severity: int
    text: str


@dataclass(frozen=True, slots=True)
class Keep:
    """Keep this for the next run, in place of what was kept before; `None`: nothing needs to be known."""

    text: str | None


Effect = Transmit | Record | Say | Keep
