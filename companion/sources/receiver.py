"""One receiver: what it sends, decoded and counted. No I/O: a flight and a replay feed it alike."""

import logging
from dataclasses import replace
from typing import NamedTuple

from companion.mavlink.facts import Traffic
from companion.sources.decoder import Decoder, DecoderCounters, Heard
from companion.sources.registry import new_decoder

_log = logging.getLogger("companion")

# Aircraft that were not heard for this long are not counted any more; more than the other are not counted.
_COUNTED_S, _MAX_COUNTED = 60.0, 10_000
INTERNAL_ERROR = "internal error"


class Piece(NamedTuple):
    """What the receiver at `address` sent; `begins`: it is the first of a connection."""

    address: str
    data: bytes
    begins: bool = False


class Receiver:
    """A decoder, and when it was heard. `address` names it in reports, on pages and in logs.

    `pieces` counts what was taken, `taken_s` is the time of the newest piece and `heard_s` that of the newest
    whole message. `status` is a problem that the receiver itself reports; `None` if there is none known.
    """

    def __init__(self, address: str, decoder: Decoder) -> None:
        self.address = address
        self.pieces = 0
        self.taken_s: float | None = None
        self.heard_s: float | None = None
        self.status: str | None = None
        self._decoder = decoder
        self._aircraft: dict[str, float] = {}  # time of the newest report by key, the oldest first

    @classmethod
    def of(cls, address: str, name: str) -> "Receiver":
        """A receiver of this format; `ConfigError` if a part of the format is missing."""
        return cls(address, new_decoder(name))

    @property
    def format(self) -> str:
        """The format, as in addresses."""
        return self._decoder.format

    @property
    def title(self) -> str:
        """The format, for people."""
        return self._decoder.title

    @property
    def lacks(self) -> str:
        """What the format cannot say."""
        return self._decoder.lacks

    def divided(self, document: bytes) -> list[bytes]:
        """The parts of a document, each to be taken as a piece; a thread may call it."""
        return self._decoder.divided(document)

    @property
    def counters(self) -> DecoderCounters:
        """Counts since the start."""
        return self._decoder.counters

    def aircraft(self, now_s: float) -> int:
        """The number of aircraft that were heard in the last minute."""
        self._forget(now_s)
        return len(self._aircraft)

    def take(self, piece: Piece, received_s: float) -> list[Heard]:
        """The facts in the next piece, each with our address."""
        self.pieces += 1
        self.taken_s = received_s
        messages = self.counters.messages
        try:
            if piece.begins:
                self._decoder.restart()
            heard = [self._named(fact) for fact in self._decoder.feed(piece.data, received_s)]
            self.status = self._decoder.status
        except Exception as error:  # noqa: BLE001 - a bug in a decoder must not end the flight
            self.counters.bad[INTERNAL_ERROR] += 1
            if self.counters.bad[INTERNAL_ERROR] == 1:
                _log.exception("%s: dropped what it sent: %r", self.address, error)
            return []
        if self.counters.messages != messages:
            self.heard_s = received_s
        for fact in heard:
            if isinstance(fact, Traffic) and fact.report.key:
                self._count(fact.report.key, received_s)
        return heard

    def _named(self, fact: Heard) -> Heard:
        return replace(fact, report=replace(fact.report, heard_by=self.address))

    def _count(self, key: str, now_s: float) -> None:
        self._aircraft.pop(key, None)
        self._aircraft[key] = now_s
        if len(self._aircraft) > _MAX_COUNTED:
            del self._aircraft[next(iter(self._aircraft))]

    def _forget(self, now_s: float) -> None:
        while self._aircraft:
            key = next(iter(self._aircraft))
            if now_s - self._aircraft[key] <= _COUNTED_S:
                return
            del self._aircraft[key]
