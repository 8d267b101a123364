"""What a link carries: how the bytes of a peer are read, and how much of them at once."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from companion.mavlink.framing import Frame, FrameSplitter, StreamCounters

MAX_PEERS = 16


class Reader(Protocol):
    """Reads what one peer, connection or device sends."""

    def feed(self, data: bytes) -> list[Frame]:
        """Read the next bytes of a stream, and return the frames that they complete."""

    def feed_datagram(self, data: bytes) -> list[Frame]:
        """Read a datagram, and return its frames."""


@dataclass(frozen=True, slots=True)
class Content:
    """`new_reader` makes the reader of a new peer, connection or device, from the counters of the link.

    At most `max_waiting` datagrams or pieces of a stream wait to be read; of a larger one each `piece_bytes`
    count as one. After `bytes_at_once` other tasks get a turn, so that ticks stay on time. Documents are read
    every `document_period_s`; `divide`, called in a thread, makes parts of one that are read one by one.
    """

    new_reader: Callable[[StreamCounters], Reader] = FrameSplitter
    max_peers: int = MAX_PEERS
    max_waiting: int = 512  # about a second of a busy link
    piece_bytes: int = 1 << 16
    bytes_at_once: int = 32_768  # junk costs a microsecond a byte
    document_period_s: float = 1.0
    divide: Callable[[bytes], list[bytes]] = lambda document: [document]


MAVLINK = Content()
