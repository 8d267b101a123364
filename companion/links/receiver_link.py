"""A receiver of traffic at its link: opened again when it fails, only listened to, and its health."""

from collections import Counter
from collections.abc import Callable, Sequence

from companion.address import ReceiverAddress
from companion.links.content import Content
from companion.links.link import Link
from companion.links.opening import make_link
from companion.links.reconnect import Reconnect
from companion.mavlink.dialect import mavlink
from companion.mavlink.framing import Frame, StreamCounters
from companion.output.notice import Condition
from companion.sources.receiver import Piece, Receiver

SILENCE_S = 10.0
_OPENED_AGAIN_S = 2.0  # a link that works again by then is not worth a text
# A message of these formats takes up to 0.1 ms: ticks stay on time with so many bytes at once, and what waits
# is not older than a few tenths of a second.
_PIECE_BYTES, _BYTES_AT_ONCE, _MAX_WAITING = 1024, 2048, 128


OnPiece = Callable[[Receiver, Piece], None]


class ReceiverLink:
    """One link and one receiver. `link` carries no MAVLink: its bytes go to `on_piece` of `run`."""

    def __init__(self, text: str, address: ReceiverAddress, *, document_period_s: float = 1.0) -> None:
        """`ConfigError` if a part of the format is missing."""
        self.receiver = Receiver.of(text, address.format)
        content = Content(
            self._new_reader,
            max_peers=1,
            max_waiting=_MAX_WAITING,
            piece_bytes=_PIECE_BYTES,
            bytes_at_once=_BYTES_AT_ONCE,
            document_period_s=document_period_s,
            divide=self.receiver.divided,
        )
        self.link: Link = make_link(text, address.at, content)
        self._reconnect = Reconnect(self.link)
        self._on_piece: OnPiece = _ignore
        self._since_s: float | None = None

    async def run(self, on_piece: OnPiece) -> None:
        """Pass what arrives to `on_piece` until the link is closed or `on_piece` raises."""
        self._on_piece = on_piece
        await self._reconnect.run(lambda _frames, _link: None)

    def silent_s(self, now_s: float) -> float:
        """The time since the last whole message, or since the first call of this."""
        if self._since_s is None:
            self._since_s = now_s
        heard_s = self.receiver.heard_s
        return now_s - (self._since_s if heard_s is None else heard_s)

    def problem(self, now_s: float) -> str | None:
        """Why it is of no use now, in a few words; `None` if it is."""
        if self._reconnect.problem is not None:
            return self._reconnect.problem
        if self.silent_s(now_s) < SILENCE_S:
            return self.receiver.status
        taken_s = self.receiver.taken_s
        heard = taken_s is not None and now_s - taken_s < SILENCE_S
        return f"{'not understood' if heard else 'silent'} for {SILENCE_S:.0f} s"

    def condition(self, name: str, now_s: float) -> Condition | None:
        """What the operator should know of it; `name` is its name in texts."""
        problem = self.problem(now_s)
        if problem is None:
            return None
        return Condition(
            f"receiver {self.receiver.address}",
            mavlink.MAV_SEVERITY_WARNING,
            f"Avoidance: {name}: {problem}",
            f"Avoidance: {name} works again",
            after_s=0.0 if self._reconnect.problem is None else _OPENED_AGAIN_S,
        )

    def _new_reader(self, _counters: StreamCounters) -> "_Pieces":
        return _Pieces(self._take)

    def _take(self, data: bytes, begins: bool) -> None:
        self._on_piece(self.receiver, Piece(self.receiver.address, data, begins))


def conditions_of(receivers: Sequence[ReceiverLink], now_s: float) -> list[Condition]:
    """What the operator should know of the receivers, each by its format if it is the only one of it."""
    formats = Counter(one.receiver.format for one in receivers)
    found = []
    for one in receivers:
        only = formats[one.receiver.format] == 1
        name = f"{one.receiver.format} receiver" if only else one.receiver.address
        found.append(one.condition(name, now_s))
    return [condition for condition in found if condition is not None]


class _Pieces:
    """Passes on what arrives as it is: it holds no frames."""

    def __init__(self, take: Callable[[bytes, bool], None]) -> None:
        self._take = take
        self._begins = True

    def feed(self, data: bytes) -> list[Frame]:
        """Take the next piece of a stream, or a document."""
        begins, self._begins = self._begins, False
        self._take(data, begins)
        return []

    def feed_datagram(self, data: bytes) -> list[Frame]:
        """Take a datagram; senders may divide a message between two."""
        self._take(data, False)
        return []


def _ignore(_receiver: Receiver, _piece: Piece) -> None:
    return None
