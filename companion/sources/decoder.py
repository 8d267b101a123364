"""The interface of all formats: bytes in, facts out, the time of reception is an argument."""

from abc import ABC, abstractmethod
from collections import Counter
from dataclasses import dataclass, field
from typing import ClassVar

from companion.mavlink.facts import ReceiverOwnship, Traffic

Heard = Traffic | ReceiverOwnship
"""What a receiver reports, with `RECEIVER` as its sender."""


@dataclass(slots=True)
class DecoderCounters:
    """Counts since the start. `messages` are whole and undamaged, whether or not they are about traffic.

    `bad` counts what was dropped, by reason in plain words ("wrong checksum", "truncated", "not a number").
    """

    messages: int = 0
    reports: int = 0
    bad: Counter[str] = field(default_factory=Counter)


class Decoder(ABC):
    """Decodes what one receiver sends. Never raises, whatever the bytes; memory is bounded."""

    format: ClassVar[str]
    """The name in addresses, such as `gdl90`."""
    title: ClassVar[str]
    """The name for people, such as "GDL 90"."""
    lacks: ClassVar[str]
    """What the format cannot say, in a few words for the list of receivers."""

    def __init__(self) -> None:
        self.counters = DecoderCounters()

    @abstractmethod
    def feed(self, data: bytes, received_s: float) -> list[Heard]:
        """Decode a datagram, the next piece of a stream, or a whole document; incomplete pieces are kept."""

    @abstractmethod
    def restart(self) -> None:
        """Forget the incomplete rest of a stream, as the connection was made again."""

    @staticmethod
    def divided(document: bytes) -> list[bytes]:
        """The parts of a document, each to be fed as one; a thread may call it."""
        return [document]

    @property
    def status(self) -> str | None:
        """A problem that the receiver itself reports ("no GPS fix"); `None` if there is none known."""
        return None
